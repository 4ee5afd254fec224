# SPDX-License-Identifier: MIT
"""YAML to frozen dataclasses, strict about missing, unknown, wrong-typed and non-finite values."""

import dataclasses
import math
import re
from pathlib import Path
from typing import Any, Dict, Optional, Tuple, Type, TypeVar, Union, get_type_hints

import yaml

from uav_sim.errors import ConfigError

T = TypeVar("T")
Source = Union[str, Path]


def config_directory() -> Path:
    """Return the folder of the package's YAML files, in a source tree or where it is installed."""
    here = Path(__file__).resolve()
    candidates = (here.parents[2] / "config", here.parents[4] / "share" / "uav_sim" / "config")
    for candidate in candidates:
        if candidate.is_dir():
            return candidate
    raise ConfigError(str(candidates[0]), "folder", None, "the package's configuration folder")


class _NumberLoader(yaml.SafeLoader):
    """Safe loader that reads 1e-3 as a number."""


_NumberLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?\d+(\.\d*)?[eE][-+]?\d+$"), list("-+0123456789")
)


def load_yaml(path: Source) -> Dict[str, Any]:
    """Return the mapping in a YAML file.

    Raises:
        ConfigError: the file cannot be read, is no YAML, or holds no mapping.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(str(path), "file", error.strerror, "a readable file") from None
    except UnicodeDecodeError:
        raise ConfigError(str(path), "file", "binary data", "YAML text") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, source: str) -> Dict[str, Any]:
    """Return the mapping in YAML text.

    Raises:
        ConfigError: it is no YAML, or holds no mapping.
    """
    try:
        data = yaml.load(text, Loader=_NumberLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}" if mark else "file"
        raise ConfigError(source, where, getattr(error, "problem", ""), "valid YAML") from None
    if not isinstance(data, dict):
        raise ConfigError(source, "file", data, "a mapping of keys to values")
    return data


def from_dict(cls: Type[T], data: Any, source: str, key: str = "") -> T:
    """Build the dataclass ``cls`` from a mapping.

    A field's metadata may give ``min`` and ``max`` of a number, or the ``choices`` of a text. A
    field with a default may be missing; a tuple of numbers is a list in YAML.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if not isinstance(data, dict):
        raise ConfigError(source, key or "file", data, "a mapping of keys to values")
    hints = get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}
    prefix = f"{key}." if key else ""
    for name in data:
        if name not in fields:
            raise ConfigError(source, f"{prefix}{name}", data[name], f"one of {', '.join(fields)}")
    for name in fields:
        if name not in data and fields[name].default is dataclasses.MISSING:
            raise ConfigError(source, f"{prefix}{name}", None, "a value, but the key is missing")
    values = {
        name: _convert(data[name], hints[name], f.metadata, source, prefix + name)
        for name, f in fields.items()
        if name in data
    }
    return cls(**values)


def number(
    value: Any, source: str, key: str, low: float = -math.inf, high: float = math.inf
) -> float:
    """Return a finite number within [low, high]; raises ConfigError."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or not low <= value <= high:
        bounded = math.isfinite(low) or math.isfinite(high)
        raise ConfigError(
            source, key, value, "a finite number" + (f" in [{low:g}, {high:g}]" if bounded else "")
        )
    return float(value)


def numbers(
    value: Any, source: str, key: str, length: int, low: float = -math.inf
) -> Tuple[float, ...]:
    """Return ``length`` finite numbers, none below ``low``, as a tuple; raises ConfigError."""
    if not isinstance(value, (list, tuple)) or len(value) != length:
        raise ConfigError(source, key, value, f"a list of {length} numbers")
    return tuple(number(v, source, f"{key}[{i}]", low) for i, v in enumerate(value))


def merged(data: Dict[str, Any], changes: Dict[str, Any]) -> Dict[str, Any]:
    """Return ``data`` with the values of ``changes`` in place of its own, mapping by mapping."""
    result = dict(data)
    for key, value in changes.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = merged(result[key], value) if both else value
    return result


def _convert(value: Any, hint: Any, metadata: Any, source: str, key: str) -> Any:
    if getattr(hint, "__origin__", None) is Union:
        hint = _matching(hint.__args__, value, source, key)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, source, key)
    if hint is float:
        low, high = metadata.get("min", -math.inf), metadata.get("max", math.inf)
        return number(value, source, key, low, high)
    if getattr(hint, "__origin__", None) is tuple:
        return numbers(value, source, key, len(hint.__args__), metadata.get("min", -math.inf))
    if hint is bool:
        if not isinstance(value, bool):
            raise ConfigError(source, key, value, "true or false")
        return value
    if hint is int:
        return _whole(value, metadata, source, key)
    choices: Optional[Tuple[str, ...]] = metadata.get("choices")
    if not isinstance(value, str) or (choices and value not in choices):
        raise ConfigError(source, key, value, f"one of {', '.join(choices)}" if choices else "text")
    return value


def _whole(value: Any, metadata: Any, source: str, key: str) -> int:
    low, high = metadata["min"], metadata["max"]
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ConfigError(source, key, value, f"a whole number in [{low}, {high}]")
    return value


def _matching(classes: Tuple[type, ...], value: Any, source: str, key: str) -> type:
    """Return the dataclass whose fields are the keys of ``value``."""
    names = [sorted(f.name for f in dataclasses.fields(cls)) for cls in classes]
    for cls, expected in zip(classes, names):
        if isinstance(value, dict) and sorted(map(str, value)) == expected:
            return cls
    raise ConfigError(source, key, value, "the keys " + " or ".join(", ".join(n) for n in names))
