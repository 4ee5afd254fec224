# SPDX-License-Identifier: MIT
"""Thrust that would hover at each state of charge, from flight of any kind.

A window that climbs, brakes or tilts is corrected with the thrust map, so that all of it counts:

    hover = u c / mean(c) + (g - (mean(vz') + g + k mean(vz)) / mean(c)) / slope
"""

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from nmpc_control.analysis.identification.confidence import (
    BLOCK,
    block_covariance,
    intervals,
)
from nmpc_control.analysis.identification.estimate import Interval
from nmpc_control.analysis.identification.thrust import Map, Thrust
from nmpc_control.analysis.identification.translation import Motion
from nmpc_control.state import GRAVITY

_FEWEST = 20  # windows of one level
_RANGE = 5.0  # [percent] of charge that a slope needs
_WILD = 5.0  # robust standard deviations


@dataclass(frozen=True)
class Battery:
    """Hover thrust by state of charge."""

    levels: Tuple[Dict[str, float], ...] = ()  # battery_percent, hover_percent, std, samples
    slope: Optional[float] = None  # [percent of thrust per percent of charge]
    interval: Optional[Interval] = None
    reason: Optional[str] = None

    def as_dict(self) -> Dict[str, Any]:
        """Return plain data for JSON."""
        data: Dict[str, Any] = {
            "levels": list(self.levels),
            "slope": self.slope,
            "confidence": {"slope": self.interval and list(self.interval)},
        }
        return data if self.reason is None else {**data, "reason": self.reason}


def identify_battery(thrust: Thrust) -> Battery:
    """Return the curve from charge to hover thrust."""
    if thrust.map is None:
        return Battery(reason="needs the thrust map, which is not identified")
    motions = [motion for motion in thrust.motions if motion.battery is not None]
    if not motions:
        return Battery(reason="no dji_sdk/battery_state in flight")
    hover = np.concatenate([_hover(motion, thrust.map) for motion in motions])
    level = np.concatenate([np.round(motion.level) for motion in motions])
    blocks = np.concatenate([motion.blocks(BLOCK) for motion in motions])
    off = np.abs(hover - np.median(hover))
    sane = off <= _WILD * max(1.4826 * float(np.median(off)), 1.0)
    hover, level, blocks = hover[sane], level[sane], blocks[sane]
    levels = tuple(_level(x, hover[level == x]) for x in np.unique(level))
    levels = tuple(entry for entry in levels if entry["samples"] >= _FEWEST)
    if np.ptp(level) < _RANGE:
        low, high = level.min(), level.max()
        return Battery(levels, reason=f"charge from {low:g} to {high:g} percent only: no slope")
    columns = np.column_stack([np.ones_like(level), level - level.mean()])
    solution = np.linalg.lstsq(columns, hover, rcond=None)[0]
    found = block_covariance(-columns, hover - columns @ solution, blocks)
    spans = intervals(("mean", "slope"), solution, found)
    return Battery(levels, float(solution[1]), spans["slope"])


def _hover(motion: Motion, thrust_map: Map) -> np.ndarray:
    """Return the thrust (w,) [percent] that would have hovered in each window."""
    up = motion.up[:, 2]
    mean_up = motion.mean(up)
    percent = motion.mean(motion.percent(*thrust_map.late) * up) / mean_up
    climb = motion.mean(motion.speed[:, 2])
    lift = motion.acceleration[:, 2] + GRAVITY + thrust_map.vertical_drag * climb
    return percent + (GRAVITY - lift / mean_up) / thrust_map.slope


def _level(level: float, hover: np.ndarray) -> Dict[str, Any]:
    return {
        "battery_percent": float(level),
        "hover_percent": float(hover.mean()),
        "std": float(hover.std()),
        "samples": int(len(hover)),
    }


def curve(levels: Tuple[Dict[str, float], ...]) -> List[np.ndarray]:
    """Return charge, hover thrust and its standard deviation [percent], to be drawn."""
    names = ("battery_percent", "hover_percent", "std")
    return [np.array([entry[name] for entry in levels]) for name in names]
