# SPDX-License-Identifier: MIT
"""How much the bench does: enough for the figures, or just enough to see that it works."""

from dataclasses import dataclass
from typing import Optional, Tuple

from uav_sim.closed_loop.bench.laps import PRESETS


@dataclass(frozen=True)
class Effort:
    """Numbers of problems, repeats and flights."""

    problems: int  # of each kind
    repeats: int  # of each solve; the fastest counts
    until: Optional[float]  # part of a recorded flight that is flown; None: all of it
    paper_scenarios: Tuple[str, ...]
    horizons: Tuple[int, ...]  # N
    slots: Tuple[int, ...]  # obstacles
    scaling_problems: int
    flights: Tuple[str, ...]  # scenarios flown with every backend
    seconds: Tuple[float, ...]  # [s] horizons flown
    presets: Tuple[Tuple[str, float], ...]  # weight preset, mean speed [m/s]
    agreement: int  # problems
    steps: Tuple[float, ...]  # [s] sampling times of the integrators


FULL = Effort(
    problems=40,
    repeats=5,
    until=None,
    paper_scenarios=("hexagon", "multi_obstacle"),
    horizons=(20, 40, 60, 90, 120, 180, 240),
    slots=(0, 8, 16, 32, 64, 128),
    scaling_problems=20,
    flights=("hexagon", "multi_obstacle"),
    seconds=(1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0),
    presets=PRESETS,
    agreement=60,
    steps=(0.01, 0.02, 0.05, 0.1, 0.2),
)
QUICK = Effort(
    problems=2,
    repeats=2,
    until=0.2,
    paper_scenarios=("hexagon",),
    horizons=(20, 60),
    slots=(0, 8, 16),
    scaling_problems=2,
    flights=("hexagon",),
    seconds=(2.0, 6.0),
    presets=PRESETS[1:],
    agreement=4,
    steps=(0.1,),
)
