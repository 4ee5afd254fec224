# SPDX-License-Identifier: MIT
"""Does the compiled solver find what IPOPT finds?

Both solve from the same start, IPOPT to a tight tolerance. Half of the problems are recorded from
closed loops, half are drawn at random. Where the compiled solver ends with a higher cost, IPOPT
starts again from there: if that stays, it was another local minimum.
"""

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Dict, List, Optional, Sequence

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from nmpc_control.ocp import Structure
from nmpc_control.solution import Guess, Solution
from nmpc_control.state import POSITION
from uav_sim.closed_loop.bench.backends import converged, tight_ipopt
from uav_sim.closed_loop.bench.objective import Objective, relative_gap
from uav_sim.closed_loop.bench.problem import Problem
from uav_sim.closed_loop.bench.problems import KINDS, in_reach, recorded_problems
from uav_sim.closed_loop.bench.random_problems import random_problems

COST_LIMIT = 1e-4  # [1] relative: more is worse
INPUT_LIMIT = 1e-3  # [1] of the input's range: less is the same


@dataclass(frozen=True)
class Comparison:
    """One problem solved twice."""

    kind: str
    index: int
    cost: float  # of tight IPOPT
    gap: float  # [1] relative excess of the compiled solver's cost
    input_gap: float  # [1] largest difference of the first inputs, by the input's range
    reached: bool  # an obstacle's potential acts on either solution
    active_bounds: int
    status: str
    iterations: int
    residual: float
    ipopt_status: str
    ipopt_iterations: int
    verdict: str = ""  # local minimum | not converged, where worse


class Judge:
    """Solves problems of one structure with both backends."""

    def __init__(self, structure: Structure) -> None:
        self.ours, self.theirs = converged(structure), tight_ipopt(structure)
        self._polisher = tight_ipopt(structure, near=True)
        self._objective = Objective(structure)

    def compare(self, problem: Problem, index: int) -> Comparison:
        """Solve a problem with both from the same start."""
        instance = problem.instance
        a, b = self.ours.solve(instance, problem.guess), self.theirs.solve(instance, problem.guess)
        cost_a, states_a = self._objective(instance, a.inputs)
        cost_b, states_b = self._objective(instance, b.inputs)
        gap = relative_gap(cost_a, cost_b)
        span = instance.input_max - instance.input_min
        return Comparison(
            kind=problem.kind,
            index=index,
            cost=cost_b,
            gap=gap,
            input_gap=float(np.max(np.abs(a.inputs[0] - b.inputs[0]) / span)),
            reached=in_reach(problem, states_a[:, POSITION])
            or in_reach(problem, states_b[:, POSITION]),
            active_bounds=a.active_bounds,
            status=a.status,
            iterations=a.iterations,
            residual=a.kkt_residual,
            ipopt_status=b.status,
            ipopt_iterations=b.iterations,
            verdict=self._verdict(problem, a, cost_a) if gap > COST_LIMIT else "",
        )

    def _verdict(self, problem: Problem, solution: Solution, cost: float) -> str:
        again = self._polisher.solve(problem.instance, Guess(solution.states, solution.inputs))
        better = (
            relative_gap(cost, self._objective(problem.instance, again.inputs)[0])
            > 0.1 * COST_LIMIT
        )
        return "not converged" if better else "local minimum"


def summary(comparisons: List[Comparison]) -> Dict[str, float]:
    """Return the figures over all problems: parts in percent."""
    gaps = np.array([c.gap for c in comparisons])
    free = [c for c in comparisons if not c.reached]
    return {
        "problems": len(comparisons),
        "not_worse_percent": _percent(gaps <= COST_LIMIT),
        "better_percent": _percent(gaps < -COST_LIMIT),
        "same_input_percent": _percent([c.input_gap <= INPUT_LIMIT for c in free]),
        "without_obstacle": len(free),
        "with_active_bounds": sum(c.active_bounds > 0 for c in comparisons),
        "oracle_failed": sum(c.ipopt_status != "converged" for c in comparisons),
        "iterations_mean": float(np.mean([c.iterations for c in comparisons])),
        "iterations_max": max(c.iterations for c in comparisons),
    }


def _percent(flags: Sequence[bool]) -> float:
    return 100.0 * float(np.mean(flags)) if len(flags) else 100.0


def draw(
    seed: int, count: int, until: Optional[float] = None, bounded: float = 0.0
) -> List[Problem]:
    """Return ``count`` problems, half of them recorded until that part of the flights."""
    recorded = recorded_problems(-(-count // (2 * len(KINDS))), seed, until)
    problems = [problem for kind in KINDS for problem in recorded[kind]][: count // 2]
    return problems + random_problems(seed, count - len(problems), bounded)


def study(problems: List[Problem], quiet: bool = False) -> List[Comparison]:
    """Return the comparison on problems of one structure."""
    judge = Judge(problems[0].structure)
    bar = track(problems, "comparing", transient=True, disable=quiet)
    return [judge.compare(problem, i) for i, problem in enumerate(bar)]


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point; exit status 0 whatever the figures say."""
    parser = argparse.ArgumentParser(
        prog="agreement", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the problems (default: %(default)s)"
    )
    parser.add_argument(
        "--count", type=int, default=500, help="number of problems (default: %(default)s)"
    )
    parser.add_argument(
        "--bounded",
        type=float,
        default=0.0,
        help="part of the random problems with felt bounds of speed, input rate, Eq. 7 "
        "(default: %(default)s)",
    )
    parser.add_argument("--json", type=Path, help="write every comparison to this file")
    options = parser.parse_args(argv)
    comparisons = study(draw(options.seed, options.count, bounded=options.bounded))
    if options.json:
        data = {"summary": summary(comparisons), "problems": [asdict(c) for c in comparisons]}
        options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    _show(comparisons)


def _show(comparisons: List[Comparison]) -> None:
    console = Console()
    console.print(_by_kind(comparisons))
    worse = [
        c
        for c in comparisons
        if c.gap > COST_LIMIT or (not c.reached and c.input_gap > INPUT_LIMIT)
    ]
    table = Table(
        title=f"{len(worse)} problems with a worse cost, or another first input without obstacle"
    )
    for name in (
        "kind",
        "index",
        "cost",
        "gap",
        "input gap",
        "reached",
        "active",
        "status",
        "it",
        "residual",
        "ipopt",
        "verdict",
    ):
        table.add_column(name)
    for c in sorted(worse, key=lambda c: -c.gap):
        table.add_row(
            c.kind,
            str(c.index),
            f"{c.cost:.4g}",
            f"{c.gap:.1e}",
            f"{c.input_gap:.1e}",
            "yes" if c.reached else "no",
            str(c.active_bounds),
            c.status,
            str(c.iterations),
            f"{c.residual:.0e}",
            c.ipopt_status,
            c.verdict,
        )
    console.print(table)


def _by_kind(comparisons: List[Comparison]) -> Table:
    groups = {"all": comparisons}
    for c in comparisons:
        groups.setdefault(c.kind, []).append(c)
    figures = {kind: summary(group) for kind, group in groups.items()}
    table = Table(title="compiled solver, converged, against tight IPOPT from the same start")
    table.add_column("problems")
    for kind in figures:
        table.add_column(kind, justify="right")
    for key in figures["all"]:
        table.add_row(key.replace("_", " "), *(f"{figure[key]:.4g}" for figure in figures.values()))
    return table


if __name__ == "__main__":
    main()
