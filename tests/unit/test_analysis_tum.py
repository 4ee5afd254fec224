# SPDX-License-Identifier: MIT
"""Trajectories for evo, and that ape_m is what evo_ape prints of them."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from nmpc_control.analysis.compare import compare
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.quaternions import from_rpy, rpy_of
from nmpc_control.analysis.record import FlightRecord, Reference, Series
from nmpc_control.analysis.segments import parts
from nmpc_control.analysis.timeline import shown_window
from nmpc_control.analysis.tum import write_tum

EPOCH = 1_700_000_000.25
# evo 1.38.1, stats.json of: evo_ape tum reference.tum estimate.tum --save_results r.zip
EVO = {
    "rmse": 0.44230854577098777,
    "mean": 0.4228143219289956,
    "median": 0.42721620255593784,
    "std": 0.12986492534079266,
    "min": 0.13582008554874356,
    "max": 0.6735367921090487,
}


@pytest.fixture(scope="module")
def record():
    """Return 30 s around a wavy reference, with irregular stamps, some of them twice."""
    path = np.linspace(0.0, 30.0, 601)
    curve = np.stack([path, np.sin(path), 2.0 + 0.3 * np.cos(0.7 * path)], axis=1)
    times = 10.0 + np.cumsum(0.05 + 0.01 * np.sin(np.arange(700)))
    times[100:110] = times[100]
    own = times - 12.0
    flown = np.stack(
        [own - 0.4 * np.sin(0.2 * own), np.sin(own - 0.3), 2.1 + 0.2 * np.cos(own)], axis=1
    )
    angles = np.stack([0.2 * np.sin(own), 0.1 * np.cos(own), 0.3 * own], axis=1)
    wrapped = rpy_of(from_rpy(angles))
    return FlightRecord(
        position=Series(times, flown),
        attitude=Series(times, wrapped),
        reference=Reference(12.0, Series(path, curve)),
        start_time=EPOCH,
    )


@pytest.fixture(scope="module")
def folder(record, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tum")
    assert write_tum(record, folder) == ["reference.tum", "estimate.tum"]
    return folder


def test_files_say_what_was_flown_and_what_should_have_been(record, folder):
    estimate, reference = (np.loadtxt(folder / name) for name in ("estimate.tum", "reference.tum"))
    assert estimate.shape == reference.shape
    assert (estimate[:, 0] == reference[:, 0]).all()
    assert (np.diff(estimate[:, 0]) > 0.0).all()
    assert estimate[0, 0] == pytest.approx(EPOCH + 12.0, abs=0.06)
    own = estimate[:, 0] - EPOCH
    assert estimate[:, 1:4] == pytest.approx(record.position.at(own), abs=1e-5)
    assert reference[:, 1:4] == pytest.approx(record.reference.position_at(own), abs=1e-5)
    assert np.linalg.norm(estimate[:, 4:], axis=1) == pytest.approx(np.ones(len(own)), abs=1e-6)
    yaw = rpy_of(estimate[:, 4:])[:, 2]
    assert np.unwrap(yaw) == pytest.approx(0.3 * (own - 12.0), abs=1e-3)


def test_ape_equals_a_recomputation_from_the_files(record, folder):
    estimate, reference = (np.loadtxt(folder / name) for name in ("estimate.tum", "reference.tum"))
    nearest = np.abs(estimate[:, :1] - reference[:, 0]).argmin(axis=1)
    distance = np.linalg.norm(estimate[:, 1:4] - reference[nearest, 1:4], axis=1)
    ape = flight_metrics(record)["ape_m"]
    expected = {
        "rmse": np.sqrt((distance**2).mean()),
        "mean": distance.mean(),
        "median": np.median(distance),
        "std": distance.std(),
        "min": distance.min(),
        "max": distance.max(),
    }
    assert ape == pytest.approx(expected, abs=1e-6)


def test_ape_is_what_evo_printed(record):
    assert flight_metrics(record)["ape_m"] == pytest.approx(EVO, abs=1e-6)


@pytest.mark.skipif(shutil.which("evo_ape") is None, reason="evo is not installed here")
def test_ape_is_what_evo_prints_now(record, folder):
    command = ["evo_ape", "tum", "reference.tum", "estimate.tum"]
    shown = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, check=True).stdout
    printed = dict(line.split() for line in shown.decode().splitlines() if len(line.split()) == 2)
    ape = flight_metrics(record)["ape_m"]
    assert ape == pytest.approx({key: float(printed[key]) for key in ape}, abs=1e-6)


def test_part_of_the_time_is_the_same_part_everywhere(record, tmp_path):
    chosen = replace(record, between=(20.0, 25.0))
    write_tum(chosen, tmp_path)
    table = np.loadtxt(tmp_path / "estimate.tum")
    assert EPOCH + 20.0 <= table[0, 0] < table[-1, 0] <= EPOCH + 25.0
    deviation = np.linalg.norm(
        table[:, 1:4] - np.loadtxt(tmp_path / "reference.tum")[:, 1:4], axis=1
    )
    ape = flight_metrics(record, between=(20.0, 25.0))["ape_m"]
    assert ape["mean"] == pytest.approx(deviation.mean(), abs=1e-6)
    assert flight_metrics(chosen)["ape_m"] == ape
    window = shown_window(chosen)
    assert (window.start, window.end) == (20.0, 25.0)
    found = parts(chosen, "2")
    assert (found[0].start, found[-1].end) == (20.0, 25.0)
    rows = compare([chosen], [chosen])
    assert rows[0].baseline == pytest.approx(ape["mean"])


def test_without_a_reference_or_positions(record, tmp_path):
    bare = FlightRecord(position=record.position, true_position=record.position)
    assert write_tum(bare, tmp_path) == ["estimate.tum", "truth.tum"]
    assert write_tum(FlightRecord(), tmp_path / "none") == []
    beyond = replace(record, between=(500.0, 600.0))
    assert write_tum(beyond, tmp_path / "none") == []
    assert not (tmp_path / "none").exists()
