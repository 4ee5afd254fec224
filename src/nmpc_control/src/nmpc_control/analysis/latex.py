# SPDX-License-Identifier: MIT
"""The paper's three tables as LaTeX: a tabular each, with a column for every flight."""

from typing import List, Sequence

from nmpc_control.analysis.record import Metrics
from nmpc_control.analysis.tables import Section, sections, title

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
}
_PAPER_TABLES = 3


def as_latex(flights: Sequence[Metrics]) -> str:
    """Return the tables; text of a bag is escaped and cannot command LaTeX."""
    heads = [escape(title(flight)) for flight in flights]
    return "\n".join(_table(section, heads) for section in sections(flights)[:_PAPER_TABLES])


def escape(text: str) -> str:
    """Return the text as LaTeX shows it."""
    return "".join(_ESCAPES.get(c, c) for c in text)


def _table(section: Section, heads: List[str]) -> str:
    name, rows = section
    lines = [
        f"% {name}",
        rf"\begin{{tabular}}{{|l|{'r|' * len(heads)}}}",
        r"\hline",
        _row([r"\textbf{Metric}", *(rf"\textbf{{{head}}}" for head in heads)]),
    ]
    lines += [_row([rf"\textbf{{{escape(label)}}}", *map(escape, cells)]) for label, cells in rows]
    return "\n".join([*lines, r"\end{tabular}", ""])


def _row(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\ \hline"
