# SPDX-License-Identifier: MIT
"""Weights, limits and margins changed while flying: all of it, or nothing and why not.

They are parameters of the compiled problem (``ocp``), so a change costs one packing of numbers and
no solver is built. A change is checked by the code that checks the YAML files, and then against the
guard, which goes on holding plans to what the launch gave it: limits may be narrowed and opened
again in flight, but not beyond the launch, nor so far that nothing is left to fly with, and the
margin stays above the guard's own.
"""

from dataclasses import fields, replace
from typing import Any, Callable, Dict, Mapping, Tuple

import numpy as np

from nmpc_control.config import from_dict
from nmpc_control.errors import NmpcError
from nmpc_control.params import Avoidance, Limits, Parameters, Weights
from nmpc_control.state import GRAVITY

SOURCE = "tuning"
_STATE = ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "yaw_rate")
_INPUT = ("thrust", "roll", "pitch", "yaw_rate")
_PLACE = ("x", "y", "z")
_VECTORS = {  # group, key: names of the components
    ("weights", "Q"): _STATE,
    ("weights", "Q_f"): _STATE,
    ("weights", "R"): _INPUT,
    ("weights", "R_delta"): _INPUT,
    ("limits", "input_min"): _INPUT,
    ("limits", "input_max"): _INPUT,
    ("limits", "input_rate"): _INPUT,
    ("limits", "fence_min"): _PLACE,
    ("limits", "fence_max"): _PLACE,
}
_NUMBERS = (
    ("limits", "speed"),
    ("avoidance", "eta"),
    ("avoidance", "safety_distance"),
    ("avoidance", "inflation"),
    ("avoidance", "cushion"),
    ("avoidance", "cushion_gain"),
    ("avoidance", "allowance"),
)
_LEAST_FREEDOM = {  # least range of each input: wind and a wrong mass are to be stood against
    "thrust": (0.85 * GRAVITY, 1.3 * GRAVITY),  # [m/s^2]
    "roll": (-0.1, 0.1),  # [rad] 6 degrees
    "pitch": (-0.1, 0.1),
    "yaw_rate": (-0.1, 0.1),  # [rad/s]
}
_LEAST_RATE = {"thrust": 10.0, "roll": 1.0, "pitch": 1.0, "yaw_rate": 1.0}  # of change, per second
_LEAST_ROOM = 2.0  # [m] between two sides of the fence
_LEAST_SPEED = 0.2  # [m/s]
_GROUPS = {"weights": Weights, "limits": Limits, "avoidance": Avoidance}

Values = Mapping[str, float]


class TuningError(NmpcError):
    """A change that must not be made; the text says why."""


def values_of(parameters: Parameters) -> Dict[str, float]:
    """Return all that may be changed, by name: ``Q_x``, ``input_max_roll``, ``speed``, ...."""
    values = {}
    for (group, key), components in _VECTORS.items():
        vector = getattr(getattr(parameters, group), key)
        values.update({f"{key}_{name}": float(v) for name, v in zip(components, vector)})
    for group, key in _NUMBERS:
        values[key] = float(getattr(getattr(parameters, group), key))
    return values


def with_values(parameters: Parameters, changes: Values) -> Parameters:
    """Return the parameters with some values changed, checked as those of the YAML files are.

    Raises:
        ConfigError: a value that the files could not have either.
        TuningError: a name that cannot be changed.
    """
    values = values_of(parameters)
    for name in changes:
        if name not in values:
            raise TuningError(f"{SOURCE}: {name}: not among what may be changed in flight")
    values.update(changes)
    groups = {}
    for group, kind in _GROUPS.items():
        old = getattr(parameters, group)
        data: Dict[str, Any] = {f.name: _plain(getattr(old, f.name)) for f in fields(kind)}
        for (owner, key), components in _VECTORS.items():
            if owner == group:
                data[key] = [values[f"{key}_{name}"] for name in components]
        data.update({key: values[key] for owner, key in _NUMBERS if owner == group})
        groups[group] = from_dict(kind, data, SOURCE)
    return replace(parameters, **groups)


def require_kept_by_guard(limits: Limits, margin: float, held: Limits, least: float) -> None:
    """Raise TuningError where the guard would refuse the plans that come of it.

    Args:
        limits: wanted.
        margin: [m] wanted from hull to surface.
        held: limits of the launch, to which the guard holds plans.
        least: [m] clearance that the guard itself keeps.
    """
    for key, sign in (("input_min", -1), ("fence_min", -1), ("input_max", 1), ("fence_max", 1)):
        names = _VECTORS["limits", key]
        for name, wanted, most in zip(names, getattr(limits, key), getattr(held, key)):
            if sign * (wanted - most) > 1e-9:
                bound = "least" if sign < 0 else "most"
                raise TuningError(
                    f"{SOURCE}: {key}_{name}: got {wanted:g}, "
                    f"expected {most:g} at {bound}: the launch's, which the guard holds"
                )
    if limits.speed > held.speed + 1e-9:
        raise TuningError(
            f"{SOURCE}: speed: got {limits.speed:g}, expected {held.speed:g} at most: the launch's"
        )
    if margin < least:
        raise TuningError(
            f"{SOURCE}: safety_distance: got {margin:g}, expected {least:g} at least: "
            "nearer the guard refuses plans"
        )


def require_flyable(parameters: Parameters) -> None:
    """Raise TuningError where what is left does not hold an aircraft up and in its place.

    The guard would not see it in time: a plan that sinks by its own bounds is a plan.
    """
    limits, weights = parameters.limits, parameters.weights
    for name, low, high, rate in zip(_INPUT, limits.input_min, limits.input_max, limits.input_rate):
        most, least = _LEAST_FREEDOM[name]
        _require(f"input_min_{name}", low <= most, low, f"{most:.3g} at most")
        _require(f"input_max_{name}", high >= least, high, f"{least:.3g} at least")
        slowest = _LEAST_RATE[name]
        _require(f"input_rate_{name}", rate >= slowest, rate, f"{slowest:g} at least")
    for name, low, high in zip(_PLACE, limits.fence_min, limits.fence_max):
        room = f"{_LEAST_ROOM:g} m above fence_min_{name} at least"
        _require(f"fence_max_{name}", high - low >= _LEAST_ROOM, high, room)
    for name, weight in zip(_PLACE, weights.Q):
        _require(f"Q_{name}", weight > 0.0, weight, "more than 0: or nothing holds a place")
    least_speed = f"{_LEAST_SPEED:g} at least"
    _require("speed", limits.speed >= _LEAST_SPEED, limits.speed, least_speed)


def _require(name: str, holds: bool, value: float, expected: str) -> None:
    if not holds:
        raise TuningError(f"{SOURCE}: {name}: got {value:g}, expected {expected}")


class Tuning:
    """What is changed, over what the files say; a change that fails leaves all as it was."""

    def __init__(self, parameters: Parameters, minimum_clearance: float) -> None:
        """Begin with the launch's parameters; the guard keeps a clearance [m] of its own."""
        self.base = parameters
        self.changes: Dict[str, float] = {}
        self.refusal = ""  # why the last change was not made; empty: it was
        self._held, self._least = parameters.limits, minimum_clearance

    @property
    def parameters(self) -> Parameters:
        """What is in force."""
        return with_values(self.base, self.changes)

    def change(
        self, values: Values, take: Callable[[Parameters], None], anew: bool = False
    ) -> Tuple[bool, str]:
        """Change values on top of what was changed before; ``anew``: on top of the files alone.

        ``take`` puts parameters into force; what it raises refuses the change. Returns whether it
        was made, and a sentence.
        """
        given = values_of(self.base)
        changes = {**({} if anew else self.changes), **{k: float(v) for k, v in values.items()}}
        changes = {name: v for name, v in changes.items() if v != given.get(name)}
        try:
            parameters = with_values(self.base, changes)
            limits, margin = parameters.limits, parameters.avoidance.safety_distance
            require_kept_by_guard(limits, margin, self._held, self._least)
            require_flyable(parameters)
            take(parameters)
        except NmpcError as error:
            self.refusal = str(error)
            return False, f"refused: {error}"
        self.changes, self.refusal = changes, ""
        told = ", ".join(f"{name} {value:g}" for name, value in sorted(changes.items()))
        return True, f"in force: {told}" if told else "in force: as in the files"

    def use_weights(self, weights: Weights, take: Callable[[Parameters], None]) -> None:
        """Take over another preset, as with a scenario; what was changed by hand stays changed.

        Raises:
            NmpcError: what ``take`` raises; the old preset remains.
        """
        base = replace(self.base, weights=weights)
        take(with_values(base, self.changes))
        self.base = base


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
