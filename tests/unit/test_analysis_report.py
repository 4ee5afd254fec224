# SPDX-License-Identifier: MIT
"""The report: one file, no network, a bag's text is text; opened in a browser if there is one."""

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest
from analysis_bags import Flight, header

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.figures import write_figures
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.record import FlightRecord, Series
from nmpc_control.analysis.report import html_report
from nmpc_control.analysis.scene import scene_figure
from nmpc_control.analysis.windows import Window

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
EVIL = "<script>document.title='PWNED'</script>"
TAGS = set("html head meta title style script body h1 h2 h3 div b nav a".split()) | set(
    "table tr td ul li p pre".split()
)
DRAWN = (
    "flight-in-space",
    "timeline",
    "errors",
    "inputs",
    "states",
    "solver-and-guard",
    "solve-times",
)


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    flight = Flight()
    flight.spheres = (
        ("</script>" + EVIL, (5.0, 2.0, 2.0), 0.5),
        ("<img src=x onerror=\"document.title='PWNED'\">", (5.0, -4.0, 2.0), 1.0),
    )
    bag = flight.build(name=EVIL)
    bag.add("nmpc/parameters", "std_msgs/msg/String", 105.0, {"data": f"</pre>{EVIL} mass: 2.9"})
    log = {"header": header(106.0), "level": 4, "name": f"/{EVIL}", "msg": f"late {EVIL}"}
    bag.add("rosout", "rosgraph_msgs/msg/Log", 106.0, log)
    return read_flight(bag.write(tmp_path_factory.mktemp("bags") / "evil.bag"))


@pytest.fixture(scope="module")
def page(record):
    return html_report(record, flight_metrics(record))


class Elements(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found, self.text = [], []

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def elements(page):
    parser = Elements()
    parser.feed(page)
    return parser


def test_nothing_is_loaded_from_elsewhere(elements):
    for tag, attributes in elements.found:
        assert tag in TAGS
        assert not {"src", "onerror", "onload", "onclick"} & set(attributes)
        assert attributes.get("href", "#").startswith("#")
    policy = [a["content"] for t, a in elements.found if t == "meta" and "content" in a]
    assert "default-src 'none'" in policy[0]


def test_text_of_the_bag_is_text(page, elements):
    assert EVIL not in page
    assert "<img" not in page.split("<body>")[1]
    text = "".join(elements.text)
    assert f"late {EVIL}" in text
    assert f"</pre>{EVIL} mass: 2.9" in text
    scripts = [attributes for tag, attributes in elements.found if tag == "script"]
    assert len(scripts) == 1 + len(DRAWN)


def test_every_figure_has_its_data(page):
    drawn = dict(re.findall(r'newPlot\("([\w-]+)-figure".*?\)\)\((\{.*?\})\)</script>', page, re.S))
    assert set(drawn) == set(DRAWN)
    names = [trace["name"] for trace in json.loads(drawn["flight-in-space"])["data"]]
    assert {"reference", "flown (estimate)", "flown (truth)"} <= set(names)
    assert sum(name.startswith("obstacle ") for name in names) == 2


def test_what_is_missing_and_unknown_is_said(tmp_path):
    bag = Flight().build().without("odometry", "ground_truth", "trajectory", "plan", "status")
    record = read_flight(bag.write(tmp_path / "little.bag"))
    page = html_report(record, flight_metrics(record))
    assert "Not computed" in page
    assert "no positions: no path length" in page
    assert "The bag holds no nmpc/parameters" in page


def test_pdf_figures_need_no_browser(record, tmp_path):
    written = write_figures(record, tmp_path, "evil", 0.5)
    names = {path.name for path in written}
    assert names == {
        f"evil_{n}.pdf" for n in ("path", "inputs", "states", "errors", "deviation", "solver")
    }
    assert all(path.read_bytes().startswith(b"%PDF-") for path in written)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine to open the report with")
def test_browser_draws_all_figures_and_runs_nothing_of_the_bag(page, tmp_path):
    path = tmp_path / "evil.html"
    path.write_text(page, encoding="utf-8")
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-dev-shm-usage"]
    command += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-sandbox"]
    command += [f"--user-data-dir={tmp_path}/profile", "--virtual-time-budget=10000", "--dump-dom"]
    result = subprocess.run(
        [*command, path.as_uri()], stdout=subprocess.PIPE, timeout=120, check=True
    )
    shown = result.stdout.decode("utf-8")
    assert "<title>PWNED" not in shown
    parser = Elements()
    parser.feed(shown)
    plots = [a for t, a in parser.found if t == "div" and "js-plotly-plot" in a.get("class", "")]
    assert {a["id"] for a in plots} == {f"{name}-figure" for name in DRAWN}
    assert sum("main-svg" in a.get("class", "") for t, a in parser.found if t == "svg") >= len(
        DRAWN
    )
    assert any(t == "canvas" for t, _ in parser.found)


@pytest.mark.parametrize("thickness", [0.0, 0.02, 5.0])
def test_a_metre_is_a_metre_on_all_axes_of_the_scene(thickness):
    angle = np.linspace(0.0, 6.0, 200)
    circle = np.stack([9.0 * np.cos(angle), 4.0 * np.sin(angle), thickness * angle / 6.0], axis=1)
    record = FlightRecord(position=Series(angle, circle))
    scene = scene_figure(record, Window(0.0, 6.0, 6.0), 0.5).layout.scene
    ranges = np.array([scene[f"{name}axis"].range for name in "xyz"], dtype=float)
    ratio = np.array([scene.aspectratio[name] for name in "xyz"])
    assert ratio == pytest.approx(np.diff(ranges).ravel() / np.diff(ranges).max())
    assert (ranges[:, 0] <= circle.min(axis=0)).all()
    assert (ranges[:, 1] >= circle.max(axis=0)).all()
    assert ratio.min() > 0.25
