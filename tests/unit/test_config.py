"""Configuration is read strictly, and what ships is consistent."""

import numpy as np
import pytest

from nmpc_control.config import from_dict, load_yaml
from nmpc_control.errors import ConfigError
from nmpc_control.params import Lag, config_directory, load_parameters, load_vehicle, load_weights


def write(tmp_path, text):
    path = tmp_path / "file.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_constant: 0.1\n", "gain"),
        ("time_constant: 0.1\ngain: 1.0\ntypo: 3\n", "typo"),
        ("time_constant: fast\ngain: 1.0\n", "'fast'"),
        ("time_constant: .nan\ngain: 1.0\n", "nan"),
        ("time_constant: .inf\ngain: 1.0\n", "inf"),
        ("time_constant: -0.1\ngain: 1.0\n", "-0.1"),
        ("time_constant: true\ngain: 1.0\n", "True"),
    ],
    ids=["missing", "unknown", "type", "NaN", "inf", "negative", "bool"],
)
def test_bad_values_name_file_key_and_value(tmp_path, text, words):
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as error:
        from_dict(Lag, load_yaml(path), path.name)
    assert "file.yaml" in str(error.value)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text",
    ["a: [1, 2\n", "a: 1\na: 2\n", "- 1\n- 2\n", "", "!!python/object/apply:os.system ['true']\n"],
    ids=["syntax", "key twice", "a list", "empty", "code"],
)
def test_unusable_files_end_in_one_line(tmp_path, text):
    with pytest.raises(ConfigError) as error:
        load_yaml(write(tmp_path, text))
    assert "\n" not in str(error.value)


def test_missing_and_binary_files_end_in_one_line(tmp_path):
    with pytest.raises(ConfigError):
        load_yaml(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ConfigError):
        load_yaml(tmp_path / "binary.yaml")


def test_numbers_with_an_exponent_are_numbers(tmp_path):
    assert load_yaml(write(tmp_path, "a: 1e-3\n"))["a"] == 1e-3


@pytest.mark.parametrize(
    "name", sorted(p.stem for p in (config_directory() / "vehicles").glob("*.yaml"))
)
def test_every_vehicle_hovers_inside_its_thrust_range(name):
    vehicle = load_vehicle(name)
    percent = vehicle.thrust_map.percent(9.81)
    expected = {"dji_hil": 38.3, "eth": 29.9, "paper": 37.4}[name]
    assert percent == pytest.approx(expected, abs=0.1)
    assert vehicle.thrust_map.minimum < percent < vehicle.thrust_map.maximum
    assert vehicle.thrust_map.thrust(percent) == pytest.approx(9.81)


@pytest.mark.parametrize(
    "name", sorted(p.stem for p in (config_directory() / "weights").glob("*.yaml"))
)
def test_every_weight_preset_loads_and_hover_is_inside_the_limits(name):
    parameters = load_parameters("dji_hil", name)
    assert np.all(load_weights(name).Q >= 0)
    hover = np.array([9.81, 0, 0, 0])
    assert np.all(parameters.limits.input_min < hover)
    assert np.all(hover < parameters.limits.input_max)
