# SPDX-License-Identifier: MIT
import pytest

from nmpc_control.params import load_parameters
from nmpc_control.tuning import values_of

pytestmark = pytest.mark.ros


def test_a_refused_change_is_rolled_back_and_says_why(ros):
    """A controller alone, without telemetry, is enough: its loop runs."""
    ros.start("rosrun", "nmpc_control", "nmpc_controller", "_vehicle:=dji_hil")
    seen = ros.run_json("tuning_client.py", timeout=90)
    assert seen["first"] == {
        "Q_x": 4.0,
        "speed": 8.0,
        "safety_distance": 0.5,
        "answer": "as in the files",
    }
    assert seen["names"] == sorted(values_of(load_parameters()))
    assert seen["good"] == {"Q_x": 7.5, "speed": 3.0, "answer": "in force: Q_x 7.5, speed 3"}
    assert seen["bad"]["speed"] == 3.0
    assert seen["bad"]["answer"].startswith("refused: tuning: speed: got -1.0, expected")
    assert "the last change was refused: tuning: speed" in seen["diagnostics"]
    assert seen["near"]["safety_distance"] == 0.5
    assert "nearer the guard refuses plans" in seen["near"]["answer"]
    assert seen["kept"] == {"Q_x": 7.5, "Q_y": 4.0, "speed": 3.0}
    assert seen["files"] == {"as_in_files": False, "Q_x": 1.0, "answer": "in force: Q_x 1"}
    assert seen["latched"] == 8.0
    assert any(answer.startswith("tuning refused: tuning: speed") for answer in seen["answers"])
    assert seen["answers"][-2:] == [
        "command/pose refused: frame 'map', expected 'world'",
        "command/trajectory refused: automatic flight is off, call `start` first",
    ]
    log = ros.output_of_all()
    assert "refused: tuning: speed" in log
    assert "Traceback" not in log
