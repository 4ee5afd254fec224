# SPDX-License-Identifier: MIT
"""All kinds of faults by name, and how a mapping becomes one."""

from typing import Any, Dict, Mapping, Type

from uav_sim.config import from_dict
from uav_sim.errors import ConfigError
from uav_sim.faults import control, flight, topics
from uav_sim.faults.base import Fault

KINDS: Dict[str, Type[Fault]] = {
    "topic_frozen": topics.TopicFrozen,
    "topic_dropped": topics.TopicDropped,
    "topic_delayed": topics.TopicDelayed,
    "topic_nan": topics.TopicNan,
    "topic_jump": topics.TopicJump,
    "authority_refused": control.AuthorityRefused,
    "authority_lost": control.AuthorityLost,
    "authority_taken": control.AuthorityTaken,
    "rc_off": control.RcOff,
    "rc_mode": control.RcMode,
    "rc_sticks": control.RcSticks,
    "setpoints_ignored": control.SetpointsIgnored,
    "gps_lost": flight.GpsLost,
    "battery_low": flight.BatteryLow,
    "battery_empty": flight.BatteryEmpty,
    "motor_weak": flight.MotorWeak,
    "thrust_gain": flight.ThrustGain,
    "mass_change": flight.MassChange,
    "wind_gust": flight.WindGust,
    "node_killed": control.NodeKilled,
}


def make_fault(kind: Any, parameters: Mapping[str, Any], source: str, key: str = "fault") -> Fault:
    """Return a fault that has not begun.

    Args:
        kind: one of ``KINDS``.
        parameters: values of the kind's parameters; those that are missing have defaults.
        source: where both come from, for the words of an error.
        key: of the kind, for the same.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigError(source, key, kind, f"one of {', '.join(KINDS)}")
    return from_dict(KINDS[kind], dict(parameters), f"{source}: {kind}")
