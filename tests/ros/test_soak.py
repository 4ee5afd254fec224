# SPDX-License-Identifier: MIT
"""The command of a soak in its short form: that everything is measured, not what comes out."""

import json
import math
import subprocess

import pytest
from ros_session import workspace_environment

pytestmark = [pytest.mark.ros, pytest.mark.alone, pytest.mark.long]
MEASURED = {"flight_guard", "nmpc_controller", "nmpc_visualizer", "uav_sim"}


def test_a_short_soak_measures_everything(tmp_path):
    file = tmp_path / "soak.json"
    command = ["rosrun", "uav_sim", "soak", "--minutes", "0.35", "--json", str(file)]
    done = subprocess.run(
        command,
        env=workspace_environment(),
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
    )
    assert file.is_file(), done.stderr
    found = json.loads(file.read_text())
    assert found["minutes"] == pytest.approx(0.35, abs=0.1)
    assert set(found["memory_growth_mb"]) == MEASURED
    assert found["markers"]["most"] > 0
    assert found["modes"]["FLYING"] > 100
    for name in ("jitter_p99_ms", "gap_max_ms", "tick_p50_ms", "tick_p99_ms"):
        assert all(math.isfinite(value) and value > 0.0 for value in found[name].values()), name
    assert len(found["rows"]) == 11
    assert done.returncode == (0 if all(row["passed"] for row in found["rows"]) else 1)
    assert "Traceback" not in done.stderr
