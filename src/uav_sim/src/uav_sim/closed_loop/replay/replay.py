# SPDX-License-Identifier: MIT
"""Replay of a recording through a plant preset: what is fitted per bag, what is compared."""

from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from nmpc_control.errors import BagError
from uav_sim.closed_loop.replay.flight import Motion, replay_segment
from uav_sim.closed_loop.replay.recorded import Recorded
from uav_sim.closed_loop.replay.scores import fit_percent, r_squared
from uav_sim.closed_loop.replay.segments import Segment, airborne_segments
from uav_sim.preset import PlantPreset

LONG = 10.0  # [s] vertical velocity is judged, and the bias fitted, on segments from this length on
_BIAS_PROBE = 0.1  # [m/s^2]
_SCALE_PROBE = 0.1  # [1] small enough to stay below the tilt limit
_MUCH_BETTER = 30.0  # [percent] of fit that an attitude scale must gain to be believed


class Replay(NamedTuple):
    """A recording beside what the plant made of its commands."""

    preset: PlantPreset
    recorded: Recorded
    segments: List[Segment]
    motions: List[Motion]  # one of each segment
    thrust_bias: float  # [m/s^2] fitted, constant over the bag
    attitude_scale: float  # [1] of the commanded roll and pitch
    remarks: Tuple[str, ...]

    @property
    def judged(self) -> List[Motion]:
        """Motions of the segments whose vertical velocity counts."""
        long = [m for s, m in zip(self.segments, self.motions) if s.duration >= LONG]
        return long or self.motions

    def figures(self) -> Dict[str, Any]:
        """Return the figures of the whole and of each segment, by name."""
        rows = [
            {"start_s": s.start, "end_s": s.end, "duration_s": s.duration, **_figures([m], [m])}
            for s, m in zip(self.segments, self.motions)
        ]
        return {
            "plant": self.preset.name,
            "source": self.recorded.source,
            **_figures(self.motions, self.judged),
            "thrust_bias_mps2": self.thrust_bias,
            "attitude_scale": self.attitude_scale,
            "segments": rows,
            "remarks": list(self.remarks),
        }


def replay(
    recorded: Recorded,
    preset: PlantPreset,
    start: float = -np.inf,
    end: float = np.inf,
    attitude_scale: Optional[float] = None,
) -> Replay:
    """Fly the recorded commands of all airborne segments.

    One thrust bias per bag is fitted, by least squares of vertical velocity. The scale of the
    commanded angles is 1 unless the recording contradicts it grossly.

    Args:
        recorded: commands and motion.
        preset: the plant.
        start: nothing before this time [s] of the bag counts.
        end: nothing after it counts.
        attitude_scale: of the commanded roll and pitch; None: 1, or fitted where 1 fails.

    Raises:
        BagError: no segment is in the air under commands.
    """
    segments = airborne_segments(recorded, preset.hover_percent, start, end)
    if not segments:
        raise BagError("no 2 s in the air under commands of roll, pitch and thrust")
    remarks = list(recorded.remarks)
    scale = 1.0 if attitude_scale is None else attitude_scale
    motions = _fly(recorded, segments, preset, 0.0, scale)
    if attitude_scale is None:
        better = _attitude_scale(recorded, segments, preset, motions)
        if better is not None:
            scale, motions = better, _fly(recorded, segments, preset, 0.0, better)
            remarks.append(
                f"the recorded attitude is the commanded one times {better:.3f}: another regime of"
                " the flight controller; commands are replayed with that scale"
            )
    probe = _fly(recorded, segments, preset, _BIAS_PROBE, scale)
    bias = _thrust_bias(segments, motions, probe)
    motions = _fly(recorded, segments, preset, bias, scale)
    return Replay(preset, recorded, segments, motions, bias, scale, tuple(remarks))


def _fly(
    recorded: Recorded, segments: List[Segment], preset: PlantPreset, bias: float, scale: float
) -> List[Motion]:
    return [replay_segment(recorded, segment, preset, bias, scale) for segment in segments]


def _thrust_bias(segments: List[Segment], zero: List[Motion], probe: List[Motion]) -> float:
    """Return the bias [m/s^2] of least squares; vertical velocity is linear in it."""
    long = [s.duration >= LONG for s in segments]
    pairs = [(z, p) for z, p, counts in zip(zero, probe, long) if counts or not any(long)]
    error = np.concatenate([z.vertical_velocity - z.replayed_vertical_velocity for z, _ in pairs])
    effect = np.concatenate(
        [p.replayed_vertical_velocity - z.replayed_vertical_velocity for z, p in pairs]
    )
    return float(_BIAS_PROBE * (effect @ error) / max(effect @ effect, 1e-12))


def _attitude_scale(
    recorded: Recorded, segments: List[Segment], preset: PlantPreset, motions: List[Motion]
) -> Optional[float]:
    """Return the scale of the commanded angles, where 1 fails and one scale explains them."""
    small = _fly(recorded, segments, preset, 0.0, _SCALE_PROBE)
    measured = np.concatenate([m.attitude[:, :2].ravel() for m in motions])
    model = np.concatenate([m.replayed_attitude[:, :2].ravel() for m in motions])
    unit = np.concatenate([m.replayed_attitude[:, :2].ravel() for m in small])
    if not unit @ unit:
        return None
    scale = float(_SCALE_PROBE * (unit @ measured) / (unit @ unit))
    as_commanded = fit_percent(measured, model)
    scaled = fit_percent(measured, unit * scale / _SCALE_PROBE)
    if as_commanded is None or scale <= 0.0 or scaled < as_commanded + _MUCH_BETTER:
        return None
    return scale


def _figures(attitude: List[Motion], vertical: List[Motion]) -> Dict[str, Any]:
    def fit(axis: int) -> Dict[str, Optional[float]]:
        measured = np.concatenate([m.attitude[:, axis] for m in attitude])
        model = np.concatenate([m.replayed_attitude[:, axis] for m in attitude])
        return {"fit_percent": fit_percent(measured, model)}

    r2 = r_squared(
        [m.vertical_velocity for m in vertical], [m.replayed_vertical_velocity for m in vertical]
    )
    return {"roll": fit(0), "pitch": fit(1), "vertical_velocity": {"r2": r2}}
