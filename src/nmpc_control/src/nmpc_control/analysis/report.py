# SPDX-License-Identifier: MIT
"""One self-contained HTML file per flight; works offline, and shows a bag's text as text."""

import json
import platform
from html import escape
from typing import Dict, List, Optional, Tuple

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from nmpc_control.analysis import bars, plots
from nmpc_control.analysis.provenance import analysed_by
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.scene import scene_figure
from nmpc_control.analysis.tables import sections
from nmpc_control.analysis.timeline import shown_window

_STYLE = """\
body{font:15px/1.45 system-ui,sans-serif;max-width:1100px;margin:0 auto;padding:1em;color:#212529}
h1{font-size:1.5em;margin:.4em 0 .1em}h2{font-size:1.15em;margin:1.8em 0 .5em;
border-bottom:2px solid #e9ecef}nav a{margin-right:1em}a{color:#1c6dd0}
.cards{display:flex;flex-wrap:wrap;gap:.6em;margin:1em 0}.card{border:1px solid #dee2e6;
border-radius:6px;padding:.4em .9em}.card b{display:block;font-size:1.25em}
.bad{color:#c92a2a}.good{color:#2b8a3e}.note{color:#495057}
table{border-collapse:collapse;margin-bottom:1em}td,th{padding:.15em .8em;text-align:left;
border-bottom:1px solid #e9ecef}td+td{text-align:right}.tables{display:flex;flex-wrap:wrap;
gap:0 3em}.log td{text-align:left;font:12px monospace}pre{background:#f8f9fa;padding:.8em;
overflow:auto;max-height:30em;font-size:12px}.scroll{overflow:auto;max-height:24em}
"""
_POLICY = (  # even if something of a bag got through: nothing may be loaded from anywhere
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; connect-src data: blob:"
)
_LEVELS = {1: "debug", 2: "info", 4: "warning", 8: "error", 16: "fatal"}
_MOST_LOG_LINES = 500


def html_report(record: FlightRecord, metrics: Metrics) -> str:
    """Return the report of a flight as HTML."""
    title = escape(" ".join(str(metrics[k]) for k in ("bag", "scenario") if metrics[k]) or "Flight")
    blocks = {
        name: content
        for name, content in (
            *_drawings(record, metrics),
            ("Figures", _tables(metrics)),
            ("Not computed", _missing(metrics)),
            ("Parameters and versions", _provenance(record)),
            ("Log", _log(record)),
        )
        if content
    }
    links = "".join(f'<a href="#{_anchor(name)}">{escape(name)}</a>' for name in blocks)
    body = "\n".join(
        f'<h2 id="{_anchor(name)}">{escape(name)}</h2>\n{content}'
        for name, content in blocks.items()
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<style>{_STYLE}</style>\n<script>{get_plotlyjs()}</script></head>\n"
        f"<body><h1>{title}</h1>\n{_cards(metrics)}\n<nav>{links}</nav>\n{body}\n</body></html>\n"
    )


def _drawings(record: FlightRecord, metrics: Metrics) -> List[Tuple[str, str]]:
    window = shown_window(record)
    figures: Dict[str, Optional[go.Figure]] = {}
    if window is not None:
        radius = metrics["vehicle_radius_m"]
        figures["Flight in space"] = scene_figure(record, window, radius)
    figures["Timeline"] = bars.timeline_figure(record)
    if window is not None:
        for name, rows in (
            ("Errors", plots.error_rows(record, window)),
            ("Inputs", plots.input_rows(record)),
            ("States", plots.state_rows(record, window)),
            ("Solver and guard", plots.solver_rows(record)),
        ):
            figures[name] = plots.time_figure(rows, record, window)
        figures["Solve times"] = bars.histogram_figure(record, window)
    return [(name, _embedded(name, figure)) for name, figure in figures.items() if figure]


def _embedded(name: str, figure: go.Figure) -> str:
    """Return the place of a figure and the call that draws it; its data cannot end the script."""
    data = figure.to_json().replace("<", "\\u003c").replace(">", "\\u003e")
    data = data.replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    place = json.dumps(_anchor(name) + "-figure")
    options = '{"responsive": true, "displaylogo": false}'
    return (
        f"<div id={place}></div>\n<script>(f => Plotly.newPlot({place}, f.data, f.layout, "
        f"{options}))({data})</script>"
    )


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")


def _cards(metrics: Metrics) -> str:
    deviation, truth = metrics["average_deviation_m"], metrics["average_deviation_truth_m"]
    least = [v for v in (metrics["clearance_m"] or {}).values() if v is not None]
    solve = metrics["solve_time_ms"]
    cards = (
        ("source", metrics["source"], ""),
        ("arrived", _verdict(metrics["arrived"]), _class(metrics["arrived"])),
        (
            "collisions",
            metrics["collisions"],
            "" if metrics["collisions"] is None else _class(metrics["collisions"] == 0),
        ),
        ("average deviation", _with_unit(deviation, "m"), ""),
        ("average deviation, truth", _with_unit(truth, "m"), ""),
        ("least clearance of the hull", _with_unit(min(least, default=None), "m"), ""),
        ("navigation time", _with_unit(metrics["navigation_time_s"], "s"), ""),
        ("solve time, p99", _with_unit(solve and solve["p99"], "ms"), ""),
    )
    return (
        '<div class="cards">'
        + "".join(
            f'<div class="card"><b class="{kind}">{escape(str(value))}</b>{label}</div>'
            for label, value, kind in cards
            if value is not None
        )
        + "</div>"
    )


def _verdict(value: Optional[bool]) -> Optional[str]:
    return None if value is None else ("no", "yes")[value]


def _class(is_good: Optional[bool]) -> str:
    return "" if is_good is None else ("bad", "good")[is_good]


def _with_unit(value: Optional[float], unit: str) -> Optional[str]:
    return None if value is None else f"{value:.2f} {unit}"


def _tables(metrics: Metrics) -> str:
    parts = []
    for heading, rows in sections([metrics]):
        cells = "".join(
            f"<tr><td>{escape(label)}</td><td>{escape(value)}</td></tr>" for label, (value,) in rows
        )
        parts.append(f"<div><h3>{escape(heading)}</h3><table>{cells}</table></div>")
    return f'<div class="tables">{"".join(parts)}</div>'


def _missing(metrics: Metrics) -> str:
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in metrics["missing"])
    return items and f"<ul>{items}</ul>"


def _provenance(record: FlightRecord) -> str:
    lines = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>"
        for name, value in (*analysed_by().items(), ("Python", platform.python_version()))
    )
    given = (
        f"<p>As recorded in nmpc/parameters:</p><pre>{escape(record.parameters)}</pre>"
        if record.parameters
        else '<p class="note">The bag holds no nmpc/parameters: what the controller was set to, '
        "and its commit, are not known from it.</p>"
    )
    return f"{given}<table>{lines}</table>"


def _log(record: FlightRecord) -> str:
    chosen = [line for line in record.log if line[2] != "/record"][:_MOST_LOG_LINES]
    rows = "".join(
        f"<tr><td>{time:.2f} s</td><td>{escape(_LEVELS.get(level, str(level)))}</td>"
        f"<td>{escape(node)}</td><td>{escape(text)}</td></tr>"
        for time, level, node, text in chosen
    )
    return rows and f'<div class="scroll"><table class="log">{rows}</table></div>'
