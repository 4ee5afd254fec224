# SPDX-License-Identifier: MIT
"""YAML to frozen dataclasses, strict about missing, unknown, wrong-typed and non-finite values."""

import dataclasses
import math
import re
from pathlib import Path
from typing import Any, Dict, Tuple, Type, TypeVar, Union, get_type_hints

import numpy as np
import yaml

from nmpc_control.errors import ConfigError

T = TypeVar("T")
PROFILE_PARTS = ("controller", "guard")


def config_directory() -> Path:
    """Return the folder of the package's YAML files, in a source tree or installed."""
    here = Path(__file__).resolve()
    candidates = (here.parents[2] / "config", here.parents[4] / "share" / "nmpc_control" / "config")
    for candidate in candidates:
        if candidate.is_dir():
            return candidate
    raise ConfigError(
        str(candidates[0]), "config", "no such folder", "the package's configuration folder"
    )


class _UniqueKeyLoader(yaml.SafeLoader):
    """Safe loader that refuses a key given twice and reads 1e-3 as a number."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key!r} given twice", node.start_mark
                )
        return super().construct_mapping(node, deep)


_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$"),
    list("-+0123456789"),
)


def load_yaml(path: Union[str, Path]) -> Dict[str, Any]:
    """Return the mapping in a YAML file.

    Raises:
        ConfigError: the file cannot be read, is no YAML, or holds no mapping.
    """
    try:
        with open(path, encoding="utf-8") as stream:
            data = yaml.load(stream, Loader=_UniqueKeyLoader)  # noqa: S506 (a SafeLoader)
    except OSError as error:
        raise ConfigError(str(path), "file", error.strerror, "a readable file") from None
    except UnicodeDecodeError:
        raise ConfigError(str(path), "file", "binary data", "YAML text") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}" if mark else "file"
        raise ConfigError(
            str(path), where, getattr(error, "problem", str(error)), "valid YAML"
        ) from None
    if not isinstance(data, dict):
        raise ConfigError(str(path), "file", data, "a mapping of keys to values")
    return data


def load_profile(name: str, part: str, directory: Path) -> Dict[str, Any]:
    """Return what ``profiles/<name>.yaml`` changes in a part, ``controller`` or ``guard``.

    No name: nothing.

    Raises:
        ConfigError: no such profile, or another part in it.
    """
    if not name:
        return {}
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ConfigError("profile", "name", name, "small letters, digits and _")
    path = directory / "profiles" / f"{name}.yaml"
    data = load_yaml(path)
    for key in data:
        if key not in PROFILE_PARTS:
            raise ConfigError(path.name, key, data[key], f"one of {', '.join(PROFILE_PARTS)}")
    return data.get(part, {})


def overlay(data: Dict[str, Any], changes: Any, source: str, key: str = "") -> Dict[str, Any]:
    """Return the data with changes laid over them, mapping by mapping.

    Raises:
        ConfigError: a change is no mapping, or of a key that the data do not have.
    """
    if not isinstance(changes, dict):
        raise ConfigError(source, key or "file", changes, "a mapping of keys to values")
    result = dict(data)
    for name, value in changes.items():
        where = f"{key}.{name}" if key else str(name)
        if name not in data:
            raise ConfigError(source, where, value, f"one of the keys {', '.join(data)}")
        inner = data.get(name)
        if isinstance(inner, dict):
            value = overlay(inner, value, source, where)
        result[name] = value
    return result


def from_dict(cls: Type[T], data: Any, source: str, key: str = "") -> T:
    """Build the dataclass ``cls`` from a mapping.

    A field's metadata may give ``min``, ``max``, ``choices``, ``length``.

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
            raise ConfigError(
                source, f"{prefix}{name}", data[name], f"one of the keys {', '.join(fields)}"
            )
    values = {}
    for name, f in fields.items():
        if name in data:
            values[name] = _convert(data[name], hints[name], f.metadata, source, prefix + name)
        elif f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING:
            raise ConfigError(source, prefix + name, None, "a value (the key is missing)")
    return cls(**values)


def number(
    value: Any, source: str, key: str, minimum: float = -math.inf, maximum: float = math.inf
) -> float:
    """Return a finite number within bounds, or raise ConfigError."""
    expected = "a finite number"
    if math.isfinite(minimum) or math.isfinite(maximum):
        expected += f" in [{minimum:g}, {maximum:g}]"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ConfigError(source, key, value, expected)
    if not math.isfinite(value) or not minimum <= value <= maximum:
        raise ConfigError(source, key, value, expected)
    return float(value)


def _convert(value: Any, hint: Any, metadata: Any, source: str, key: str) -> Any:
    origin = getattr(hint, "__origin__", None)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, source, key)
    if origin is Union:  # Optional[...]
        return None if value is None else _convert(value, hint.__args__[0], metadata, source, key)
    low, high = metadata.get("min", -math.inf), metadata.get("max", math.inf)
    if hint is float:
        return number(value, source, key, low, high)
    if hint is int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ConfigError(source, key, value, f"a whole number in [{low:g}, {high:g}]")
        return value
    if hint is bool:
        if not isinstance(value, bool):
            raise ConfigError(source, key, value, "true or false")
        return value
    if hint is str:
        choices = metadata.get("choices")
        if not isinstance(value, str) or (choices and value not in choices):
            raise ConfigError(
                source, key, value, f"one of {', '.join(choices)}" if choices else "text"
            )
        return value
    if hint is np.ndarray or origin in (tuple, Tuple):
        length = metadata.get("length")
        expected = f"a list of {length} numbers" if length else "a list of numbers"
        if not isinstance(value, list) or (length is not None and len(value) != length):
            raise ConfigError(source, key, value, expected)
        numbers = [number(v, source, f"{key}[{i}]", low, high) for i, v in enumerate(value)]
        if hint is np.ndarray:
            array = np.array(numbers)
            array.setflags(write=False)
            return array
        return tuple(numbers)
    if hint is Any or hint is dict or origin is dict:
        return value
    raise TypeError(f"{key}: no conversion for {hint}")
