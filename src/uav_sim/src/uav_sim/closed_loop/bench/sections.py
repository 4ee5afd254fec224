# SPDX-License-Identifier: MIT
"""What the bench measures, section by section; each returns JSON types."""

import dataclasses
import math
from typing import Any, Callable, Dict, List, Tuple

from rich.progress import Progress

from nmpc_control.scenario import load_scenario
from uav_sim.closed_loop.bench import integrators, node_memory, scaling, startup
from uav_sim.closed_loop.bench.agreement import draw, study, summary
from uav_sim.closed_loop.bench.comparison import compare
from uav_sim.closed_loop.bench.effort import Effort
from uav_sim.closed_loop.bench.flights import (
    BACKENDS,
    FlightFigures,
    fly_with,
    fly_with_horizon,
)
from uav_sim.closed_loop.bench.laps import lap
from uav_sim.closed_loop.bench.paper_flight import reproduction
from uav_sim.closed_loop.bench.parameters import PLANT, bench_parameters
from uav_sim.closed_loop.bench.problems import recorded_problems
from uav_sim.closed_loop.bench.scenes import circuit

Result = Dict[str, Any]
_HORIZON_SPEED = 2.35  # [m/s] the fastest at which this path was flown with the paper's code


def backends(effort: Effort, seed: int, bar: Progress) -> Result:
    """Compare the backends on identical problems."""
    problems = recorded_problems(effort.problems, seed, effort.until)
    count = sum(len(group) for group in problems.values())
    task = bar.add_task("backends", total=count)
    comparison = compare(problems, bench_parameters(), effort.repeats, lambda: bar.advance(task))
    return {
        "rows": comparison.rows(),
        "python_share": comparison.python_share(),
        "speedup": comparison.speedups(),
        "samples_ms": comparison.milliseconds(),
    }


def paper(effort: Effort, seed: int, bar: Progress) -> Result:
    """Fly the paper's two simulations with its own formulation."""
    return {"paper": _tracked(bar, "paper's simulations", effort.paper_scenarios, reproduction)}


def growth(effort: Effort, seed: int, bar: Progress) -> Result:
    """Time against horizon and obstacles."""
    task = bar.add_task("scaling", total=2)
    by_horizon = scaling.by_horizon(effort.horizons, effort.scaling_problems, effort.repeats)
    bar.advance(task)
    by_obstacles = scaling.by_obstacles(effort.slots, effort.scaling_problems, effort.repeats, seed)
    bar.advance(task)
    return {"scaling_n": by_horizon, "scaling_obstacles": by_obstacles}


def closed_loop(effort: Effort, seed: int, bar: Progress) -> Result:
    """Fly the same scenarios with every backend."""
    flights = [(scenario, name) for scenario in effort.flights for name in BACKENDS]
    figures = _tracked(
        bar,
        "closed loops",
        flights,
        lambda f: _plain(fly_with(f[1], load_scenario(f[0]), effort.until)),
    )
    return {"closed_loop": _nested(figures)}


def horizon(effort: Effort, seed: int, bar: Progress) -> Result:
    """Fly with horizons from short to long: the paper's obstacles, and a faster circuit."""
    scenes = {"horizon": load_scenario("multi_obstacle", speed=_HORIZON_SPEED)}
    scenes["horizon_circuit"] = circuit()
    flights = [(key, seconds) for key in scenes for seconds in effort.seconds]

    def row(flight: Tuple[str, float]) -> Dict[str, Any]:
        key, seconds = flight
        flown = fly_with_horizon(seconds, scenes[key], effort.until)
        path = [[round(c, 3) for c in t.position[:2]] for t in flown.log.truths[::5]]
        return {"seconds": seconds, **_plain(FlightFigures.of(flown)), "path": path}

    figures = _tracked(bar, "horizons", flights, row)
    return {key: [figures[key, seconds] for seconds in effort.seconds] for key in scenes}


def presets(effort: Effort, seed: int, bar: Progress) -> Result:
    """Fly the hexagon with the weight presets that keep its corners or round them."""
    laps = _tracked(bar, "presets", effort.presets, lambda p: lap(*p)).values()
    return {
        "presets": [
            {
                "preset": one.preset,
                "speed": one.speed,
                "corner_distance_m": one.corner_distance,
                "roundness": one.roundness,
                "path": one.path[::5].tolist(),
                "corners": one.corners.tolist(),
            }
            for one in laps
        ]
    }


def integration(effort: Effort, seed: int, bar: Progress) -> Result:
    """Accuracy and speed by integrator and sampling time."""
    rows = _tracked(
        bar,
        "integrators",
        effort.steps,
        lambda dt: integrators.study((dt,), effort.scaling_problems, effort.repeats),
    )
    return {"integrators": [row for group in rows.values() for row in group]}


def start(effort: Effort, seed: int, bar: Progress) -> Result:
    """First and later start of a process, its memory, and that of the real nodes."""
    return {"startup": {**startup.measure(), **node_memory.measure(PLANT)}}


def agreement(effort: Effort, seed: int, bar: Progress) -> Result:
    """Compare ``converged`` with tight IPOPT; the study itself has more to tell."""
    problems = draw(seed, effort.agreement, effort.until)
    return {"agreement": summary(study(problems, quiet=True))}


def _tracked(bar: Progress, title: str, items: Any, work: Callable[[Any], Any]) -> Dict[Any, Any]:
    task = bar.add_task(title, total=len(items))
    result = {}
    for item in items:
        result[item] = work(item)
        bar.advance(task)
    return result


def _plain(figures: Any) -> Dict[str, Any]:
    """Return a dataclass as a dictionary; what is not finite becomes None, as JSON wants it."""
    data = dataclasses.asdict(figures)
    return {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in data.items()
    }


def _nested(figures: Dict[Any, Any]) -> Dict[str, Dict[str, Any]]:
    result: Dict[str, Dict[str, Any]] = {}
    for (scenario, name), figure in figures.items():
        result.setdefault(scenario, {})[name] = figure
    return result


SECTIONS: Dict[str, Callable[[Effort, int, Progress], Result]] = {
    "backends": backends,
    "paper": paper,
    "scaling": growth,
    "closed_loop": closed_loop,
    "horizon": horizon,
    "presets": presets,
    "integrators": integration,
    "start": start,
    "agreement": agreement,
}
ORDER: List[str] = list(SECTIONS)
