# SPDX-License-Identifier: MIT
"""Tables and CSV: the paper's rows, with the figures of the metrics and nothing made up."""

import csv
import io

import pytest

from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.record import FlightRecord
from nmpc_control.analysis.tables import NOT_APPLICABLE, UNKNOWN, as_text, sections, write_csv

FREE = {
    **flight_metrics(FlightRecord(bag="free.bag", scenario="spline")),
    "average_deviation_m": 0.2123,
    "maximum_deviation_m": 2.3312,
    "solver_iterations_mean": 2.114,
    "solve_time_ms": {"mean": 21.3, "p50": 20.0, "p99": 31.0, "max": 40.0},
    "thrust_percent": [37.14, 37.15],
    "scenario_time_s": 27.5,
    "reference_length_m": 9.6,
    "navigation_time_s": 44.5,
    "clearance_m": {},
    "arrived": True,
    "collisions": 0,
}
AMONG = {
    **FREE,
    "bag": "among.bag",
    "navigation_time_s": 56.78,
    "average_deviation_m": 1.87,
    "clearance_m": {"ball": 0.412},
    "collisions": 1,
}


def rows(flights):
    return {label: cells for _, rows in sections(flights) for label, cells in rows}


def test_rows_of_the_first_table():
    (title, table), *_ = sections([FREE])
    assert "table 1" in title
    assert [cells[0] for _, cells in table] == [
        "0.212",
        "2.331",
        "2.11",
        "0.0213",
        "0.0310",
        "[37.14, 37.15]",
        "27.50",
    ]


def test_rows_of_the_second_table_pair_the_flights_of_one_reference():
    found = rows([FREE, AMONG])
    assert found["Navigation time [s]"] == ["44.50", "56.78"]  # the third table's
    second = dict(sections([FREE, AMONG])[1][1])
    assert second["Navigation time [s]"] == ["44.50", "44.50"]
    assert second["Navigation time (obstacles) [s]"] == [NOT_APPLICABLE, "56.78"]
    assert second["Time increase (obstacles) [%]"] == [NOT_APPLICABLE, "27.60"]
    assert second["Average deviation (obstacles) [m]"] == [NOT_APPLICABLE, "1.870"]


def test_another_reference_is_not_compared_with():
    other = {**FREE, "reference_length_m": 12.0}
    second = dict(sections([other, AMONG])[1][1])
    assert second["Time increase (obstacles) [%]"] == [NOT_APPLICABLE, NOT_APPLICABLE]
    assert second["Navigation time [s]"] == ["44.50", NOT_APPLICABLE]


def test_clearance_arrival_and_collisions():
    found = rows([FREE, AMONG])
    assert found["Clearance, hull to ball [m]"] == [UNKNOWN, "0.412"]
    assert found["Arrived"] == ["yes", "yes"]
    assert found["Collisions"] == ["0", "1"]


def test_empty_flight_shows_no_number():
    found = rows([flight_metrics(FlightRecord())])
    assert found.pop("Hull, centre to propeller tip [m]") == ["0.50"]
    assert {cell for row in found.values() for cell in row} == {UNKNOWN, NOT_APPLICABLE}


def test_text_is_aligned_and_lists_what_is_missing():
    text = as_text([{**FREE, "missing": ["no guard"]}, AMONG])
    lines = text.splitlines()
    assert "free.bag: no guard" in lines
    right_edges = {len(line) for line in lines if line.endswith(("27.50", "56.78"))}
    assert len(right_edges) == 1


def test_csv_has_one_line_per_flight_and_one_column_per_figure():
    stream = io.StringIO()
    write_csv([FREE, AMONG], stream)
    free, among = list(csv.DictReader(io.StringIO(stream.getvalue())))
    assert float(free["solve_time_ms.p99"]) == 31.0
    assert (float(free["thrust_percent.min"]), float(free["thrust_percent.max"])) == (37.14, 37.15)
    assert float(among["clearance_m.ball"]) == 0.412
    assert free["rmse_m"] == ""


@pytest.mark.parametrize("name", ["=1+1", "+A1", "-2", "@SUM(A1)"])
def test_text_of_a_bag_is_no_formula(name):
    stream = io.StringIO()
    write_csv([{**FREE, "scenario": name}], stream)
    assert next(csv.DictReader(io.StringIO(stream.getvalue())))["scenario"] == "'" + name
