# SPDX-License-Identifier: MIT
"""The hexagon flown around three times: what the weight presets make of its corners."""

from dataclasses import dataclass, replace

import numpy as np

from nmpc_control.scenario import load_scenario
from nmpc_control.timing import Motion, Timing
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.recording import exact_solver, record, structure_of

PRESETS = (("position_priority", 1.5), ("velocity_priority", 3.0))  # mean speed [m/s]


@dataclass(frozen=True)
class Lap:
    """The middle lap of three: the start from rest is forgotten, the end not yet in sight."""

    preset: str
    speed: float  # [m/s]
    path: np.ndarray  # (M, 3) [m] flown
    corners: np.ndarray  # (6, 3) [m]

    @property
    def corner_distance(self) -> float:
        """Mean distance [m] by which the corners are missed."""
        offsets = np.linalg.norm(self.path[None] - self.corners[:, None], axis=2)
        return float(np.mean(np.min(offsets, axis=1)))

    @property
    def roundness(self) -> float:
        """Least by greatest distance of the path from its middle: circle 1, hexagon 0.87."""
        middle = np.mean(self.path, axis=0)
        radius = np.linalg.norm((self.path - middle)[:, :2], axis=1)
        return float(np.min(radius) / np.max(radius))


class _Repeated:
    """A timing that runs over the curve again and again."""

    continuous = True

    def __init__(self, once: Timing, times: int) -> None:
        self._once = once
        self.duration = times * once.duration

    def __call__(self, t: np.ndarray) -> Motion:
        return self._once(np.mod(t, self._once.duration))


def lap(preset: str, speed: float) -> Lap:
    """Return the hexagon flown with a weight preset at a mean speed [m/s]."""
    scenario = load_scenario("hexagon", speed=speed)
    once = scenario.trajectory
    thrice = replace(scenario, trajectory=replace(once, timing=_Repeated(once.timing, 3)))
    parameters = bench_parameters(preset)
    flight = record(thrice, parameters, exact_solver(structure_of(parameters)))
    start = flight.log.clock_start + once.duration
    truths = [t for t in flight.log.truths if start <= t.t <= start + once.duration]
    corners = once.sample(np.arange(6) * once.duration / 6).position
    return Lap(preset, speed, np.array([truth.position for truth in truths]), corners)
