# SPDX-License-Identifier: MIT
"""The paper's closed-loop simulation: its formulation at 10 Hz on its own Euler model."""

from dataclasses import dataclass
from typing import Dict, List

import numpy as np

from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.state import NX, POSITION
from uav_sim.closed_loop.bench.paper_formulation import (
    DT,
    N,
    PaperFormulation,
    PaperSolution,
    euler_step,
    hover_guess,
)

# average deviation [m], maximum [m], iterations: measured with the code that comes with the paper
PUBLISHED = {"hexagon": (0.180, 2.332, 3.1), "multi_obstacle": (0.944, 2.21, 5.2)}


@dataclass(frozen=True)
class PaperFlight:
    """Sample by sample, at 10 Hz."""

    positions: np.ndarray  # (M + 1, 3) [m]
    deviations: np.ndarray  # (M,) [m]
    solutions: List[PaperSolution]
    clearances: Dict[str, float]  # [m] centre of the aircraft to each sphere's surface

    def figures(self) -> Dict[str, object]:
        """Return what the paper's table of simulations has."""
        times = 1e3 * np.array([s.solve_time for s in self.solutions])
        return {
            "deviation_mean_m": float(np.mean(self.deviations)),
            "deviation_max_m": float(np.max(self.deviations)),
            "iterations_mean": float(np.mean([s.iterations for s in self.solutions])),
            "solve_ms_p50": float(np.median(times)),
            "solve_ms_p99": float(np.quantile(times, 0.99)),
            "failed": sum(not s.success for s in self.solutions),
            "clearance_m": self.clearances,
        }


def fly_as_in_the_paper(scenario: Scenario) -> PaperFlight:
    """Return the flight of a scenario from rest; its reference clock counts solves."""
    spheres = np.array([[*o.position, o.size[0]] for o in scenario.obstacles]).reshape(-1, 4)
    controller, plant = PaperFormulation(len(spheres)), euler_step()
    x = np.zeros(NX)
    x[POSITION] = scenario.initial_position
    guess = hover_guess(x)
    count = round(scenario.trajectory.duration / DT)
    positions, deviations, solutions = [x[POSITION]], [], []
    for k in range(count):
        reference = scenario.trajectory.sample(k * DT + np.linspace(0.0, N * DT, N)).position
        deviations.append(np.linalg.norm(x[POSITION] - reference[0]))
        solution = controller.solve(x, reference, spheres, guess)
        x = np.asarray(plant(x, solution.inputs[0])).ravel()
        guess = solution.shifted()
        positions.append(x[POSITION])
        solutions.append(solution)
    path = np.array(positions)
    clearances = {o.id: float(np.min(o.distance(path))) for o in scenario.obstacles}
    return PaperFlight(path, np.array(deviations), solutions, clearances)


def reproduction(name: str) -> Dict[str, object]:
    """Return the figures of one of the paper's scenarios beside those of its published code."""
    flight = fly_as_in_the_paper(load_scenario(name, variant="paper"))
    mean, most, iterations = PUBLISHED[name]
    return {
        **flight.figures(),
        "published_deviation_mean_m": mean,
        "published_deviation_max_m": most,
        "published_iterations_mean": iterations,
    }
