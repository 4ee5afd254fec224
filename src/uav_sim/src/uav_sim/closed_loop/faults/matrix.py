# SPDX-License-Identifier: MIT
"""The matrix as its two files say it: what goes wrong, and what is expected of it.

``config/fault_matrix/faults.yaml`` names faults and pairs of them, ``expected.yaml`` what must come
of each. The second one is written from the design, not from what the code does.
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Dict, List, Mapping, Set, Tuple

from nmpc_control.mode_inputs import Mode
from uav_sim.closed_loop.faults.kinds import make_trouble
from uav_sim.config import config_directory, from_dict, load_yaml, number
from uav_sim.errors import ConfigError
from uav_sim.faults.kinds import make_fault

SITUATIONS = ("hover", "turn", "beside")
AS_BEFORE = "as before"
AT_REST = 0.3  # [m/s] at most where it holds; brake.rest_speed, and DJI's own hold anchors there
HEIGHT_LOSS = 1.0  # [m] at most in automatic flight
_PART_KEYS = ("fault", "trouble", "after", "duration")


@dataclass(frozen=True)
class Part:
    """One fault of the simulator, or one trouble between the parts."""

    kind: str
    is_trouble: bool
    parameters: Mapping[str, Any]
    after: float  # [s] since the case begins
    duration: float  # [s] infinite: to the end


@dataclass(frozen=True)
class Case:
    """Something that goes wrong: one fault, or a pair."""

    name: str
    words: str
    parts: Tuple[Part, ...]
    watch: float  # [s] for which the flight goes on
    level: str  # of disturbance
    situations: Tuple[str, ...]
    is_pair: bool = False


@dataclass(frozen=True)
class Expectation:
    """What must come of a case in a situation; modes with reason codes, "mode code"."""

    end: str = field()  # at the end of the flight; "as before": nothing changes
    by: str = ""  # first change; empty only with ``untimed``
    within: float = field(default=math.inf, metadata={"min": 0.0})  # [s] of that change
    gap_ms: float = field(default=40.0, metadata={"min": 0.0})  # of the stream, at most
    rests: float = field(default=math.inf, metadata={"min": 0.0})  # [m/s] at the end, on truth
    sinks: float = field(default=math.inf, metadata={"min": 0.0})  # [m] below where it was
    lands: bool = False  # stands on the ground at the end, on truth; always where it has landed
    unavoidable: bool = False  # whether a collision is expected that a checker calls so
    untimed: str = ""  # why neither ``by`` nor ``within`` says anything
    why: str = ""

    @property
    def mode(self) -> str:
        """The mode at the end; empty: as before."""
        return "" if self.end == AS_BEFORE else self.end.split()[0]


def folder() -> Path:
    """Return where the files are."""
    return config_directory() / "fault_matrix"


def load_cases() -> Dict[str, Case]:
    """Return all cases by name, faults first; raises ConfigError.

    What stands below ``ingredients`` goes wrong in pairs only.
    """
    path = folder() / "faults.yaml"
    data = load_yaml(path)
    cases = {name: _case(name, item, path.name) for name, item in data["faults"].items()}
    parts = dict(cases)
    for name, item in (data.get("ingredients") or {}).items():
        parts[name] = _case(name, item, path.name)
    for name, item in (data.get("pairs") or {}).items():
        cases[name] = _pair(name, item, parts, path.name)
    return cases


def load_expectations() -> Dict[str, Dict[str, Expectation]]:
    """Return what is expected, by case and situation; raises ConfigError."""
    path = folder() / "expected.yaml"
    cases, result = load_cases(), {}
    for name, item in load_yaml(path).items():
        if name not in cases:
            raise ConfigError(path.name, name, item, "the name of a fault or a pair")
        result[name] = _expected(item, cases[name].situations, f"{path.name}: {name}")
    return result


def _case(name: str, item: Mapping[str, Any], source: str) -> Case:
    keys = {"words", "parts", "watch", "level", "situations"}
    place = f"{source}: {name}"
    if not isinstance(item, dict) or not {"words", "parts"} <= set(item) <= keys:
        raise ConfigError(source, name, item, f"a mapping with {', '.join(sorted(keys))}")
    return Case(
        name,
        item["words"],
        tuple(_part(part, place) for part in item["parts"]),
        number(item.get("watch", 6.0), place, "watch", 0.1),
        item.get("level", "none"),
        _situations(item.get("situations", SITUATIONS), place),
    )


def _pair(name: str, item: Mapping[str, Any], cases: Mapping[str, Case], source: str) -> Case:
    place, keys = f"{source}: {name}", {"of", "situation", "after", "watch"}
    if not isinstance(item, dict) or not {"of", "situation"} <= set(item) <= keys:
        raise ConfigError(source, name, item, f"a mapping with {', '.join(sorted(keys))}")
    for other in item["of"]:
        if other not in cases:
            raise ConfigError(place, "of", other, "the name of a fault")
    first, second = (cases[other] for other in item["of"])
    after = number(item.get("after", 0.0), place, "after", 0.0)
    late = (
        Part(p.kind, p.is_trouble, p.parameters, p.after + after, p.duration) for p in second.parts
    )
    watch = number(item.get("watch", max(first.watch, after + second.watch)), place, "watch", 0.1)
    level = first.level if first.level != "none" else second.level
    when = f" {after:g} s later" if after else ""
    words = f"{first.words};{when} {second.words}"
    situations = _situations([item["situation"]], place)
    return Case(name, words, (*first.parts, *late), watch, level, situations, is_pair=True)


def _part(item: Mapping[str, Any], source: str) -> Part:
    is_trouble = "trouble" in item
    kind = item.get("trouble" if is_trouble else "fault")
    parameters = {key: value for key, value in item.items() if key not in _PART_KEYS}
    (make_trouble if is_trouble else make_fault)(kind, parameters, source)
    after = number(item.get("after", 0.0), source, "after", 0.0)
    duration = item.get("duration", float("inf"))
    return Part(kind, is_trouble, parameters, after, float(duration))


def _situations(names: Any, source: str) -> Tuple[str, ...]:
    for name in names:
        if name not in SITUATIONS:
            raise ConfigError(source, "situations", name, f"one of {', '.join(SITUATIONS)}")
    return tuple(names)


def _expected(item: Any, situations: Tuple[str, ...], source: str) -> Dict[str, Expectation]:
    """Return the expectation of each situation: what ``all`` says, and what it says itself."""
    if not isinstance(item, dict):
        raise ConfigError(source, "all", item, "a mapping of all, hover, turn, beside")
    for key in item:
        if key not in ("all", "why", *situations):
            raise ConfigError(source, key, item[key], f"one of all, why, {', '.join(situations)}")
    result = {}
    for situation in situations:
        merged = {"why": item.get("why", ""), **(item.get(situation, item.get("all")) or {})}
        expectation = from_dict(Expectation, merged, source, situation)
        _check_words([expectation.by, expectation.end], f"{source}: {situation}")
        _check_time(expectation, f"{source}: {situation}")
        result[situation] = _with_motion(expectation, situation, set(merged), source)
    return result


def _with_motion(e: Expectation, situation: str, given: Set[str], source: str) -> Expectation:
    """Return the expectation with what holds for motion where the row says nothing of its own."""
    before = "hovering" if situation == "hover" else "flying"
    mode = before if e.end == AS_BEFORE else e.mode
    holds = mode in ("hovering", "braking") or e.end.endswith("held_back")
    flies = mode in ("flying", "hovering", "braking")
    usual = {"rests": AT_REST if holds else math.inf, "sinks": HEIGHT_LOSS if flies else math.inf}
    for name, limit in usual.items():
        if name in given and getattr(e, name) > limit and not e.why:
            raise ConfigError(
                f"{source}: {situation}", "why", "", f"why {name} is not at most {limit:g}"
            )
    return replace(e, **{name: usual[name] for name in usual if name not in given})


def _check_time(e: Expectation, source: str) -> None:
    """Refuse a change that nothing says the time of, or that none is expected to begin with."""
    if e.end == AS_BEFORE or e.untimed:
        return
    if not math.isfinite(e.within):
        raise ConfigError(source, "within", e.within, "a time in s, or why not as `untimed`")
    if not e.by:
        raise ConfigError(source, "by", e.by, "the first change, or why not as `untimed`")


def _check_words(texts: List[str], source: str) -> None:
    modes = [mode.name.lower() for mode in Mode]
    for text in texts:
        words = text.split()
        if text not in ("", AS_BEFORE) and (len(words) != 2 or words[0] not in modes):
            raise ConfigError(source, "mode", text, "a mode and a reason code, or as before")
