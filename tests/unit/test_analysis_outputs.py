# SPDX-License-Identifier: MIT
"""What flight_metrics and bag_to_mcap write beside tables: LaTeX, TUM, comparisons, MCAP."""

import json
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from analysis_bags import REPOSITORY, Flight
from mcap.reader import make_reader
from rosbags.rosbag1 import Reader
from test_analysis_cli import run

from nmpc_control.analysis import mcap_export
from nmpc_control.analysis.latex import as_latex, escape
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.record import FlightRecord

LAYOUT = REPOSITORY / "src/nmpc_control/config/plotjuggler/flight.xml"
EXAMPLE = REPOSITORY / "src/nmpc_control/doc/analysis.md"


class Worse(Flight):
    start, take_off, land, end = 210.0, 204.0, 224.0, 228.0
    offset = np.array([0.0, 0.65, 0.0])


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    good, bad = Flight().build(name="line"), Worse().build(name="line")
    paths = {"good": good.write(folder / "good.bag"), "bad": bad.write(folder / "bad.bag")}
    both = good.without("nothing")
    both.messages += bad.messages
    return {**paths, "both": both.write(folder / "both.bag"), "builder": good}


def test_tum_of_one_flight_and_of_several(bags, tmp_path):
    assert run(bags["good"], "--quiet", "--tum", tmp_path / "one").returncode == 0
    assert {p.name for p in (tmp_path / "one").iterdir()} == {
        "estimate.tum",
        "reference.tum",
        "truth.tum",
    }
    run(bags["both"], bags["bad"], "--flight", "all", "--quiet", "--tum", tmp_path / "many")
    assert {p.name for p in (tmp_path / "many").iterdir()} == {"both_1", "both_2", "bad"}
    last = np.loadtxt(tmp_path / "many" / "both_2" / "estimate.tum")
    assert np.abs(last[:, 2] - 0.65).max() < 1e-6


def test_all_flights_of_a_bag(bags, tmp_path):
    shown = run(bags["both"], "--flight", "all", "--json", tmp_path / "both.json").stdout
    assert "both.bag (2/2) compared with both.bag (1/2)" in shown
    found = json.loads((tmp_path / "both.json").read_text())
    assert [f["flight"] for f in found] == [1, 2]
    assert [f["average_deviation_m"] for f in found] == pytest.approx([0.25, 0.65])


def test_baseline_and_others_are_compared(bags, tmp_path):
    result = run(bags["good"], "--baseline", bags["bad"], "--json", tmp_path / "c.json")
    assert (result.returncode, result.stderr) == (0, "")
    assert "good.bag compared with bad.bag" in result.stdout
    content = json.loads((tmp_path / "c.json").read_text())
    assert [f["bag"] for f in content["flights"]] == ["bad.bag", "good.bag"]
    deviation = content["comparison"][0]
    assert deviation["difference"] == pytest.approx(-0.4)
    assert deviation["is_clear"] is True
    assert content["schema_version"] == content["flights"][0]["schema_version"]


def test_two_bags_are_compared_in_their_order(bags):
    assert "bad.bag compared with good.bag" in run(bags["good"], bags["bad"]).stdout


def test_parts_are_printed_and_written(bags, tmp_path):
    result = run(bags["good"], "--segments", "mode", "--json", tmp_path / "parts.json")
    assert re.search(r"^  hovering .* yes ", result.stdout, re.M)
    parts = json.loads((tmp_path / "parts.json").read_text())["segments"]
    assert [p["name"] for p in parts][2] == "flying"


@pytest.mark.parametrize(
    "arguments",
    [
        ("--segments", "modes"),
        ("--between", "1", "x"),
        ("--between", "20", "10", "END"),
        ("--flight", "some"),
        ("--vehicle", "none_such"),
    ],
)
def test_wrong_choices_are_one_clear_line(bags, arguments):
    result = run(bags["good"], *(a for a in arguments if a != "END"))
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    assert arguments[-1] in result.stderr.splitlines()[-1]


def test_vehicle_without_positions_has_no_tum_and_says_so(tmp_path):
    bag = Flight().build().without("odometry", "ground_truth").write(tmp_path / "blind.bag")
    result = run(bag, "--quiet", "--tum", tmp_path / "tum")
    assert result.returncode == 2
    assert result.stderr == f"flight_metrics: {bag}: no positions: no TUM files\n"


def test_latex_has_the_papers_rows_and_commands_nothing(bags, tmp_path):
    run(bags["good"], "--quiet", "--latex", tmp_path / "t.tex")
    text = (tmp_path / "t.tex").read_text()
    assert text.count(r"\begin{tabular}{|l|r|}") == text.count(r"\end{tabular}") == 3
    assert r"\textbf{Average Deviation [m]} & 0.250 \\ \hline".lower() in text.lower()
    assert r"\textbf{Time increase (obstacles) [\%]}" in text
    evil = as_latex([flight_metrics(FlightRecord(bag=r"\input{/etc/passwd}_%$&#^~"))])
    assert r"\input" not in evil
    assert escape(r"\a_b{}") == r"\textbackslash{}a\_b\{\}"


def test_mcap_holds_the_same_messages(bags, tmp_path, capsys):
    mcap_export.main([str(bags["good"]), "--output", str(tmp_path)])
    assert "messages" in capsys.readouterr().out
    with Reader(bags["good"]) as reader:
        expected = sorted((c.topic, c.msgtype, t, bytes(raw)) for c, t, raw in reader.messages())
    with (tmp_path / "good.mcap").open("rb") as stream:
        found = sorted(
            (channel.topic, schema.name.replace("/", "/msg/"), message.log_time, message.data)
            for schema, channel, message in make_reader(stream).iter_messages()
        )
    assert found == expected


def test_mcap_of_damaged_and_of_no_bag(bags, tmp_path, capsys):
    cut, text = tmp_path / "cut.bag", tmp_path / "text.bag"
    cut.write_bytes(bags["good"].read_bytes()[:200_000])
    text.write_text("no bag")
    with pytest.raises(SystemExit, match="2"):
        mcap_export.main([str(cut), str(text), str(tmp_path / "none.bag")])
    lines = capsys.readouterr().err.splitlines()
    assert any("cut.bag" in line and "index" in line for line in lines)
    assert any("text.bag: not a ROS 1 bag" in line for line in lines)
    assert any("none.bag: No such file" in line for line in lines)
    assert (tmp_path / "cut.mcap").exists()
    assert not (tmp_path / "text.mcap").exists()


def test_layout_names_topics_that_a_flight_has(bags):
    root = ElementTree.parse(LAYOUT).getroot()
    curves = [curve.get("name") for curve in root.iter("curve")]
    selected = {topic.get("name") for topic in root.iter("topic")}
    assert len(curves) > 20
    assert {"/" + "/".join(name.split("/")[1:3]) for name in curves} == selected


@pytest.mark.parametrize(
    "absent",
    [
        (),
        ("nmpc/odometry",),
        ("nmpc/odometry", "uav_sim/ground_truth", "nmpc/trajectory"),
        ("flight_status", "nmpc/trajectory"),
    ],
)
def test_example_of_the_documentation_runs(absent, bags, tmp_path, monkeypatch):
    (code,) = re.findall(r"```python\n(.*?)```", EXAMPLE.read_text(encoding="utf-8"), re.S)
    monkeypatch.chdir(tmp_path)
    bags["builder"].without(*absent, "nothing").write(tmp_path / "flight.bag")
    exec(compile(code, str(EXAMPLE), "exec"), {})  # our own documentation
    assert (tmp_path / "height.pdf").read_bytes().startswith(b"%PDF-")
