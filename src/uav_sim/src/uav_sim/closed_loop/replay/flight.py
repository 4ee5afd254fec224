# SPDX-License-Identifier: MIT
"""A plant that flies recorded commands from a recorded state."""

import dataclasses
import math
from typing import List, NamedTuple

import numpy as np

from nmpc_control.analysis.record import Series
from uav_sim.closed_loop.replay.recorded import PITCH, ROLL, THRUST, YAW_RATE, Recorded
from uav_sim.closed_loop.replay.segments import Segment
from uav_sim.plant import Plant
from uav_sim.preset import PlantPreset

_HEIGHT = 1e5  # [m] the ground is not there: a segment ends where it was touched
_RATE_SPAN = 0.05  # [s] over which recorded angles give the rates at the start


class Motion(NamedTuple):
    """Recorded and replayed motion at the stamps of a segment."""

    attitude_times: np.ndarray  # (m,) [s]
    attitude: np.ndarray  # (m, 3) roll, pitch, yaw [rad] recorded
    replayed_attitude: np.ndarray  # (m, 3)
    velocity_times: np.ndarray  # (k,) [s]
    vertical_velocity: np.ndarray  # (k,) [m/s] recorded
    replayed_vertical_velocity: np.ndarray  # (k,)


def replay_segment(
    recorded: Recorded,
    segment: Segment,
    preset: PlantPreset,
    thrust_bias: float = 0.0,
    attitude_scale: float = 1.0,
) -> Motion:
    """Return what the plant does in a segment.

    The plant lives one telemetry dead time before the stamps. Commands under way at the start are
    those recorded before; velocity and attitude begin as recorded.

    Args:
        recorded: commands and motion.
        segment: which part.
        preset: the plant.
        thrust_bias: [m/s^2] along the body's z axis, constant.
        attitude_scale: [1] of the commanded roll and pitch.
    """
    thrust = dataclasses.replace(preset.thrust, offset=preset.thrust.offset + thrust_bias)
    plant = Plant(dataclasses.replace(preset, thrust=thrust))
    plant.place((0.0, 0.0, _HEIGHT))
    step, lag, delay = preset.step, preset.delay.telemetry, preset.delay
    warm_up = math.ceil(max(delay.attitude, delay.thrust, delay.yaw_rate) / step) + 1
    count = math.ceil(segment.duration / step) + 1
    times = segment.start - lag + step * np.arange(-warm_up, count)
    attitude = recorded.attitude.between(segment.start, segment.end)
    velocity = recorded.velocity.between(segment.start, segment.end)
    rows = []
    for k, command in enumerate(_held(recorded, times, attitude_scale, plant.hover_percent)):
        if k == warm_up:
            _begin(plant, recorded, segment.start)
        if k >= warm_up:
            rows.append((*plant.rpy, plant.velocity[2]))
        plant.command(*command)
        plant.step()
    replayed = Series(times[warm_up:] + lag, np.array(rows))
    return Motion(
        attitude.times,
        attitude.values,
        replayed.at(attitude.times)[:, :3],
        velocity.times,
        velocity.values[:, 2],
        replayed.at(velocity.times)[:, 3],
    )


def _held(
    recorded: Recorded, times: np.ndarray, attitude_scale: float, hover_percent: float
) -> List[List[float]]:
    """Return roll, pitch, thrust, yaw rate that the plant is given at times (n,) [s]."""
    commands = recorded.commands.held_at(times + 1e-9)
    commands = np.where(np.isfinite(commands), commands, np.array([hover_percent, 0.0, 0.0, 0.0]))
    scaled = attitude_scale * commands[:, [ROLL, PITCH]]
    return np.column_stack([scaled, commands[:, [THRUST, YAW_RATE]]]).tolist()


def _begin(plant: Plant, recorded: Recorded, t: float) -> None:
    """Give the plant what the recording shows at a stamp [s]; commands under way stay."""
    span = np.array([t - 0.5 * _RATE_SPAN, t, t + 0.5 * _RATE_SPAN])
    before, now, after = recorded.attitude.at(span)
    rates = (after - before) / _RATE_SPAN
    velocity = recorded.velocity.at(span)[1]
    plant.set_motion(velocity.tolist(), now.tolist(), rates.tolist())
