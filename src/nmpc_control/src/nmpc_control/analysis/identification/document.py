# SPDX-License-Identifier: MIT
"""An identification as plain data for JSON, with units and the version of its layout."""

from typing import Any, Dict

from nmpc_control.analysis.identification.attitude import AXES, LIMIT
from nmpc_control.analysis.identification.identify import Identification
from nmpc_control.analysis.identification.segments import KINDS
from nmpc_control.analysis.identification.thrust import VERTICAL

SCHEMA = "nmpc_control/identify/1"
UNITS = {
    "segments": "s since the bag's first message",
    "gain": "1",
    "omega": "rad/s",
    "zeta": "1",
    "time_constant_s": "s",
    "dead_time_s": "s",
    "fit_percent": "percent, 100 (1 - |y - model| / |y - mean(y)|)",
    "confidence": "95 % interval, in the unit of the parameter",
    "tilt_limit_rad": "rad, norm of the commanded (roll, pitch)",
    "thrust.slope": "m/s^2 per percent",
    "thrust.offset": "m/s^2",
    "thrust.lag_s": "s, time constant of first order after the dead time",
    "thrust.hover_percent": "percent",
    "thrust.charge_percent": "percent of charge, where the offset moves with it: at this one",
    "thrust.offset_per_charge": "m/s^2 per percent of charge",
    "thrust.r2": "1, of mean accelerations over 0.2 s",
    "drag": "1/s",
    "drag.velocity_lag_s": "s, that velocity is later than attitude",
    "drag.steady_x": "m/s^2",
    "drag.steady_y": "m/s^2",
    "drag.speed_rms": "m/s",
    "drag.quadratic_forward": "1/m, in place of the linear one",
    "drag.quadratic_sideways": "1/m, in place of the linear one",
    "battery.levels": "percent",
    "battery.slope": "percent of thrust per percent of charge",
    "noise.attitude": "rad, standard deviation of roll, pitch, yaw",
    "noise.velocity": "m/s, standard deviation of x, y, z",
    "noise.gyro": "rad/s, standard deviation of x, y, z",
    "noise.accelerometer": "m/s^2, standard deviation of x, y, z",
    "validation": "percent, as fit_percent",
}


def as_document(found: Identification) -> Dict[str, Any]:
    """Return the identification as data; what is not identifiable is null beside its reason."""
    attitude, limit = found.attitude, found.attitude.tilt_limit
    document = {
        "schema": SCHEMA,
        "source": found.source,
        "bags": list(found.bags),
        "regime": found.regime,
        "segments": [
            {"start": s.start, "end": s.end, "kind": s.kind, "bag": s.bag} for s in found.segments
        ],
        "kinds": KINDS,
        "attitude": {
            **{axis: attitude.second[axis].as_dict() for axis in AXES},
            "first_order": {axis: attitude.first[axis].as_dict() for axis in AXES},
            "cross_validation": found.cross_validation,
        },
        "tilt_limit_rad": limit.values[LIMIT],
        "tilt_limit": limit.as_dict(),
        "yaw_rate": {
            **found.yaw_rate.second.as_dict(),
            "first_order": found.yaw_rate.first.as_dict(),
        },
        "thrust": found.thrust.estimate.as_dict(),
        "drag": _drag(found),
        "battery": found.battery.as_dict(),
        "noise": found.noise,
        "remarks": list(found.remarks),
        "units": UNITS,
    }
    if found.validation is not None:
        document["validation"] = found.validation
    if found.other_regime is not None:
        document["limited_regime"] = found.other_regime
    return document


def _drag(found: Identification) -> Dict[str, Any]:
    horizontal, vertical = found.drag.estimate, found.thrust.vertical_drag
    drag = horizontal.as_dict()
    drag[VERTICAL] = vertical.values[VERTICAL]
    drag["confidence"][VERTICAL] = vertical.as_dict()["confidence"][VERTICAL]
    reasons = [e.reason for e in (horizontal, vertical) if e.reason]
    return {**drag, "reason": "; ".join(dict.fromkeys(reasons))} if reasons else drag
