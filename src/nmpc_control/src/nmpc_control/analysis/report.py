# SPDX-License-Identifier: MIT
"""One self-contained HTML file per flight: the tables, what is missing, and the figures."""

import base64
from html import escape
from pathlib import Path
from typing import List, Sequence

from nmpc_control.analysis.record import Metrics
from nmpc_control.analysis.tables import sections

_STYLE = (
    "body{font:15px sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin-bottom:1.5em}td{padding:.2em .8em;"
    "border-bottom:1px solid #ddd}td+td{text-align:right}img{max-width:100%}"
)


def html_report(metrics: Metrics, images: Sequence[Path]) -> str:
    """Return the report as HTML; text from the bag is escaped, the PNG images are embedded."""
    title = escape(" ".join(str(metrics[k]) for k in ("bag", "scenario") if metrics[k]) or "Flight")
    parts: List[str] = [
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>',
        f"<style>{_STYLE}</style></head><body><h1>{title}</h1>",
    ]
    for heading, rows in sections([metrics]):
        cells = "".join(
            f"<tr><td>{escape(label)}</td><td>{escape(value)}</td></tr>" for label, (value,) in rows
        )
        parts.append(f"<h2>{escape(heading)}</h2><table>{cells}</table>")
    if metrics["missing"]:
        items = "".join(f"<li>{escape(sentence)}</li>" for sentence in metrics["missing"])
        parts.append(f"<h2>Not computed</h2><ul>{items}</ul>")
    for image in images:
        data = base64.b64encode(image.read_bytes()).decode("ascii")
        name = escape(image.stem, quote=True)
        parts.append(f'<p><img alt="{name}" src="data:image/png;base64,{data}"></p>')
    return "\n".join(parts) + "\n</body></html>\n"
