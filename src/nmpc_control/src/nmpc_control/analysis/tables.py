# SPDX-License-Identifier: MIT
"""The rows of the paper's three tables, and what else a flight shows, as text and as CSV."""

import csv
from typing import Any, Callable, Dict, List, Optional, Sequence, TextIO, Tuple

from nmpc_control.analysis.record import Metrics

UNKNOWN = "-"
NOT_APPLICABLE = "N/A"
_SAME = 0.01  # share by which length and duration of the same reference may differ

_PAIRS = {
    "thrust_percent": ("min", "max"),
    "window_s": ("start", "end"),
    "battery_percent": ("start", "end"),
}
_NO_COLUMNS = ("units", "timeline", "segments", "streams")  # lists, and what is no figure

Cell = Callable[[Metrics], str]
Row = Tuple[str, List[str]]  # label, one cell per flight
Section = Tuple[str, List[Row]]  # title, rows


def sections(flights: Sequence[Metrics]) -> List[Section]:
    """Return the tables, with one column for each flight."""
    simulation: Dict[str, Cell] = {
        "Average deviation [m]": _number("average_deviation_m"),
        "Maximum deviation [m]": _number("maximum_deviation_m"),
        "Avg. number of solver iterations": _number("solver_iterations_mean", 2),
        "Avg. convergence time [s]": _seconds("mean"),
        "Convergence time, p99 [s]": _seconds("p99"),
        "Input control range, thrust [%]": _range("thrust_percent"),
        "Total time for scenario [s]": _number("scenario_time_s", 2),
    }
    real: Dict[str, Cell] = {
        "Navigation time [s]": _number("navigation_time_s", 2),
        "Average deviation [m]": _number("average_deviation_m"),
        "Average solver iterations": _number("solver_iterations_mean", 2),
    }
    beyond: Dict[str, Cell] = {
        "Source": _text("source"),
        "Arrived": _text("arrived"),
        "Total time of automatic flight [s]": _number("total_time_s", 2),
        "Time in the air [s]": _number("airborne_time_s", 2),
        "Average deviation after 6 s [m]": _number("average_deviation_after_6s_m"),
        "Average deviation from the path [m]": _number("average_path_deviation_m"),
        "Average deviation, truth [m]": _number("average_deviation_truth_m"),
        "Maximum deviation, truth [m]": _number("maximum_deviation_truth_m"),
        "Root mean square error [m]": _part("rmse_m", "total"),
        "Root mean square error, x, y, z [m]": _part("rmse_m", "x", "y", "z"),
        "Deviation, p50, p90, p99 [m]": _part("deviation_percentiles_m", "p50", "p90", "p99"),
        "Cross-track error, mean and maximum [m]": _part("cross_track_m", "mean", "max"),
        "Along-track error, mean and maximum [m]": _part("along_track_m", "mean", "max"),
        "Path length [m]": _number("path_length_m", 2),
        "Speed, mean and maximum [m/s]": _part("speed_m_s", "mean", "max"),
        "Tilt, mean and maximum [rad]": _part("tilt_rad", "mean", "max"),
        "Jerk, rms and maximum [m/s^3]": _part("jerk_m_s3", "rms", "max", digits=2),
        "Input effort, roll, pitch [rad]": _part("input_effort", "roll_rad", "pitch_rad"),
        "Time in saturation [s]": _part("saturation", "time_s", digits=2),
        "Solver iterations, p50, p99, max": _part(
            "solver_iterations", "p50", "p99", "max", digits=0
        ),
        "Solve time, p50 and p99 [ms]": _part("solve_time_ms", "p50", "p99"),
        "Automatic and manual time [s]": _both("automatic_time_s", "manual_time_s"),
        "Time on rungs below the first plan [s]": _lower_rungs,
        "Battery, start and end [%]": _ends("battery_percent"),
        "Hover thrust [%]": _part("hover_thrust_percent", "median", digits=2),
        "Command rate [Hz]": _number("command_rate_hz", 2),
        "Longest gap between commands [ms]": _number("command_gap_ms_max", 1),
        "Plans rejected by the guard": _text("plans_rejected"),
        "Deadlines missed by the controller": _text("deadline_misses"),
        "Collisions": _text("collisions"),
        "Hull, centre to propeller tip [m]": _number("vehicle_radius_m", 2),
    }
    return [
        ("Simulation (paper, table 1)", _rows(simulation, flights)),
        ("With and without obstacles (paper, table 2)", _obstacle_rows(flights)),
        ("Experiment (paper, table 3)", _rows(real, flights)),
        ("Beyond the paper", _rows(beyond, flights) + _clearance_rows(flights)),
    ]


def as_text(flights: Sequence[Metrics]) -> str:
    """Return all tables as aligned text, and below what is missing."""
    header = [title(flight) for flight in flights]
    tables = sections(flights)
    labels = max(len(label) for _, rows in tables for label, _ in rows)
    columns = [
        max([len(header[i])] + [len(cells[i]) for _, rows in tables for _, cells in rows])
        for i in range(len(flights))
    ]
    lines = [_line("", header, labels, columns)]
    for name, rows in tables:
        lines += ["", name]
        lines += [_line(label, cells, labels, columns) for label, cells in rows]
    for flight in flights:
        name = flight["bag"] or "flight"
        lines += [""] + [f"{name}: {sentence}" for sentence in flight["missing"]]
    return "\n".join(line.rstrip() for line in lines).rstrip() + "\n"


def segments_as_text(flight: Metrics) -> str:
    """Return a line of figures for each part of a flight; empty without parts."""
    parts = flight.get("segments")
    if not parts:
        return ""
    cells: Dict[str, Cell] = {
        "from [s]": _number("start_s", 2),
        "to [s]": _number("end_s", 2),
        "automatic": _text("automatic"),
        "deviation [m]": _number("average_deviation_m"),
        "maximum [m]": _number("maximum_deviation_m"),
        "path [m]": _number("path_length_m", 2),
        "speed [m/s]": _part("speed_m_s", "mean"),
        "p99 solve [ms]": _part("solve_time_ms", "p99"),
        "saturated [s]": _part("saturation", "time_s", digits=2),
    }
    rows = [["part", *cells]] + [[p["name"], *(c(p) for c in cells.values())] for p in parts]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [f"{row[0]:<{widths[0]}}" + _cells(row[1:], widths[1:]) for row in rows]
    return "\n".join(["", f"Parts of {title(flight)}", *(f"  {line}" for line in lines)]) + "\n"


def write_csv(flights: Sequence[Metrics], stream: TextIO) -> None:
    """Write one line per flight; nested figures get names like ``solve_time_ms.p99``."""
    rows = [_flat(flight) for flight in flights]
    names = list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(stream, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)


def _flat(metrics: Metrics, prefix: str = "") -> Metrics:
    flat: Metrics = {}
    for key, value in metrics.items():
        if key in _NO_COLUMNS:
            continue
        if key in _PAIRS and isinstance(value, list):
            value = dict(zip(_PAIRS[key], value))
        if isinstance(value, dict):
            flat.update(_flat(value, f"{prefix}{key}."))
        else:
            flat[prefix + key] = _cell("; ".join(value) if key == "missing" else value)
    return flat


def _cell(value: Any) -> Any:
    """Return the value so that no spreadsheet takes a bag's text for a formula."""
    return "'" + value if isinstance(value, str) and value[:1] in ("=", "+", "-", "@") else value


def _line(label: str, cells: Sequence[str], labels: int, columns: Sequence[int]) -> str:
    return f"  {label:<{labels}}" + _cells(cells, columns)


def _cells(cells: Sequence[str], widths: Sequence[int]) -> str:
    return "".join(f"  {cell:>{width}}" for cell, width in zip(cells, widths))


def title(flight: Metrics) -> str:
    """Return what a column is called."""
    scenario = f" {flight['scenario']}" if flight["scenario"] else ""
    return name_of(flight) + scenario


def name_of(flight: Metrics) -> str:
    """Return the bag's name, with the flight's number where the bag has several."""
    number = f" ({flight['flight']}/{flight['flights']})" if flight["flights"] > 1 else ""
    return f"{flight['bag'] or 'flight'}{number}"


def _rows(cells: Dict[str, Cell], flights: Sequence[Metrics]) -> List[Row]:
    return [(label, [cell(flight) for flight in flights]) for label, cell in cells.items()]


def _obstacle_rows(flights: Sequence[Metrics]) -> List[Row]:
    figures = (
        ("Navigation time", " [s]", _number("navigation_time_s", 2)),
        ("Average deviation", " [m]", _number("average_deviation_m")),
        ("Average solver iterations", "", _number("solver_iterations_mean", 2)),
    )
    rows: List[Row] = []
    for name, unit, cell in figures:
        free = [_without_obstacles(flight, flights) for flight in flights]
        rows.append((name + unit, [NOT_APPLICABLE if f is None else cell(f) for f in free]))
        among = [cell(f) if f["clearance_m"] else NOT_APPLICABLE for f in flights]
        rows.append((f"{name} (obstacles){unit}", among))
    increase = [_time_increase(flight, flights) for flight in flights]
    rows.insert(2, ("Time increase (obstacles) [%]", increase))
    return rows


def _without_obstacles(flight: Metrics, flights: Sequence[Metrics]) -> Optional[Metrics]:
    """Return the flight itself, or the one of the same reference that had no obstacles."""
    if not flight["clearance_m"]:
        return flight
    free = (other for other in flights if other["clearance_m"] == {})
    return next((other for other in free if _is_same_reference(flight, other)), None)


def _is_same_reference(a: Metrics, b: Metrics) -> bool:
    pairs = [(a[key], b[key]) for key in ("reference_length_m", "scenario_time_s")]
    return all(None not in (x, y) and abs(x - y) <= _SAME * max(x, y) for x, y in pairs)


def _time_increase(flight: Metrics, flights: Sequence[Metrics]) -> str:
    free = _without_obstacles(flight, flights)
    if free is None or free is flight:
        return NOT_APPLICABLE
    times = flight["navigation_time_s"], free["navigation_time_s"]
    return UNKNOWN if not all(times) else f"{100.0 * (times[0] / times[1] - 1.0):.2f}"


def _clearance_rows(flights: Sequence[Metrics]) -> List[Row]:
    names = dict.fromkeys(name for f in flights for name in f["clearance_m"] or {})
    return [
        (
            f"Clearance, hull to {name or 'unnamed'} [m]",
            [_format((flight["clearance_m"] or {}).get(name), 3) for flight in flights],
        )
        for name in names
    ]


def _format(value: Optional[float], digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def _number(key: str, digits: int = 3) -> Cell:
    return lambda flight: _format(flight[key], digits)


def _text(key: str) -> Cell:
    def cell(flight: Metrics) -> str:
        value = flight[key]
        if value is None:
            return UNKNOWN
        return ("no", "yes")[value] if isinstance(value, bool) else str(value)

    return cell


def _seconds(key: str) -> Cell:
    return lambda flight: _format(flight["solve_time_ms"] and flight["solve_time_ms"][key] / 1e3, 4)


def _range(key: str) -> Cell:
    return lambda flight: (
        UNKNOWN if flight[key] is None else "[{:.2f}, {:.2f}]".format(*flight[key])
    )


def _part(key: str, *parts: str, digits: int = 3) -> Cell:
    def cell(flight: Metrics) -> str:
        found = flight[key] or {}
        values = [found.get(part) for part in parts]
        return UNKNOWN if None in values else ", ".join(f"{v:.{digits}f}" for v in values)

    return cell


def _both(*keys: str) -> Cell:
    return lambda flight: (
        UNKNOWN
        if all(flight[key] is None for key in keys)
        else ", ".join(_format(flight[key], 2) for key in keys)
    )


def _ends(key: str) -> Cell:
    return lambda flight: UNKNOWN if flight[key] is None else "{:.0f}, {:.0f}".format(*flight[key])


def _lower_rungs(flight: Metrics) -> str:
    times = flight["rung_time_s"]
    if times is None:
        return UNKNOWN
    lower = {name: t for name, t in times.items() if name not in ("none", "new_plan", "last_plan")}
    return ", ".join(f"{name} {t:.2f}" for name, t in lower.items()) or "0.00"
