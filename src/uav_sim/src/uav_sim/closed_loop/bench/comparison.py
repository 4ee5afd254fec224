# SPDX-License-Identifier: MIT
"""All backends on the same problems in one run: time, iterations, cost gap, residual."""

import time
from dataclasses import dataclass
from typing import Callable, Dict, List

import numpy as np

from nmpc_control.params import Parameters
from uav_sim.closed_loop.bench.backends import all_backends, tight_ipopt
from uav_sim.closed_loop.bench.native import native_time
from uav_sim.closed_loop.bench.objective import Objective, relative_gap
from uav_sim.closed_loop.bench.paper_backend import PaperBackend
from uav_sim.closed_loop.bench.problem import Problem
from uav_sim.closed_loop.bench.recording import structure_of

ALL = "all"


@dataclass(frozen=True)
class Sample:
    """One backend on one problem."""

    seconds: float  # the fastest of the repeats
    iterations: int
    cost_gap: float  # [1] relative to a tight IPOPT solution from the same start
    residual: float  # largest violation of dynamics or bounds


class Comparison:
    """Runs the backends in turn on one problem after the other, so that all see the same load."""

    def __init__(self, parameters: Parameters, repeats: int = 5) -> None:
        structure = structure_of(parameters)
        self.backends = all_backends(parameters)
        self.samples: Dict[str, Dict[str, List[Sample]]] = {}  # by kind of problem, backend
        self.native: List[float] = []  # [s] generated C alone of the budgeted solves
        self._repeats = repeats
        self._oracle, self._objective = tight_ipopt(structure), Objective(structure)

    def run(self, problem: Problem) -> None:
        """Solve one problem some times with every backend; keep the fastest."""
        for backend in self.backends.values():
            backend.prepare(problem)
        best, solutions = {}, {}
        for name, backend in self.backends.items():
            times = []
            for _ in range(self._repeats):
                start = time.perf_counter()
                solutions[name] = backend.solve(problem)
                times.append(time.perf_counter() - start)
            best[name] = min(times)
        self.native.append(native_time(self.backends["budgeted"].solver, problem))
        instance = problem.instance
        reference = self._oracle.solve(instance, problem.guess)
        least = self._objective(instance, reference.inputs)[0]
        for name, solution in solutions.items():
            backend = self.backends[name]
            if isinstance(backend, PaperBackend):  # its own problem, its own yardstick
                gap = relative_gap(solution.cost, backend.solve(problem, tight=True).cost)
                residual = solution.kkt_residual
            else:
                gap = relative_gap(self._objective(instance, solution.inputs)[0], least)
                residual = self._objective.defect(instance, solution.states, solution.inputs)
            sample = Sample(best[name], solution.iterations, gap, residual)
            for kind in (problem.kind, ALL):
                self.samples.setdefault(kind, {}).setdefault(name, []).append(sample)

    def rows(self) -> List[Dict[str, object]]:
        """Return one row per kind of problem and backend."""
        kinds = [kind for kind in self.samples if kind != ALL] + [ALL]
        return [
            {"problem": kind, "backend": name, **_row(samples)}
            for kind in kinds
            for name, samples in self.samples[kind].items()
        ]

    def python_share(self) -> float:
        """Return the part of a whole budgeted call that is not generated C."""
        whole = np.array([s.seconds for s in self.samples[ALL]["budgeted"]])
        return float(np.median(1.0 - np.array(self.native) / whole))

    def milliseconds(self) -> Dict[str, Dict[str, List[float]]]:
        """Return the time of every sample [ms], by kind of problem and backend."""
        return {
            kind: {name: [1e3 * s.seconds for s in samples] for name, samples in group.items()}
            for kind, group in self.samples.items()
        }

    def speedups(self) -> Dict[str, Dict[str, float]]:
        """Return how many times faster than the paper's formulation, quantile by quantile."""
        rows = {row["backend"]: row for row in self.rows() if row["problem"] == ALL}
        return {
            name: {key: rows["paper"][key] / row[key] for key in ("p50_ms", "p95_ms", "p99_ms")}
            for name, row in rows.items()
        }


def _row(samples: List[Sample]) -> Dict[str, float]:
    milliseconds = 1e3 * np.array([s.seconds for s in samples])
    return {
        "p50_ms": float(np.quantile(milliseconds, 0.5)),
        "p95_ms": float(np.quantile(milliseconds, 0.95)),
        "p99_ms": float(np.quantile(milliseconds, 0.99)),
        "max_ms": float(np.max(milliseconds)),
        "iterations_mean": float(np.mean([s.iterations for s in samples])),
        "cost_gap": float(np.mean([s.cost_gap for s in samples])),
        "residual": float(np.max([s.residual for s in samples])),
    }


def compare(
    problems: Dict[str, List[Problem]],
    parameters: Parameters,
    repeats: int,
    on_problem: Callable[[], None] = lambda: None,
) -> Comparison:
    """Return the comparison on all problems."""
    comparison = Comparison(parameters, repeats)
    for group in problems.values():
        for problem in group:
            comparison.run(problem)
            on_problem()
    return comparison
