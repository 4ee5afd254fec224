# SPDX-License-Identifier: MIT
"""The bench's results as tables for a terminal."""

from typing import Any, Dict, Iterator

from rich.table import Table


def tables(results: Dict[str, Any]) -> Iterator[Table]:
    """Yield a table for every section that was measured."""
    makers = {
        "machine": _machine,
        "rows": _rows,
        "paper": _paper,
        "scaling_n": lambda results: _scaling(results, "scaling_n", "stages N"),
        "scaling_obstacles": lambda results: _scaling(results, "scaling_obstacles", "obstacles"),
        "closed_loop": _closed_loop,
        "horizon": lambda results: _horizon(results, "horizon", "multi_obstacle at 2.35 m/s"),
        "horizon_circuit": lambda results: _horizon(results, "horizon_circuit", "circuit at 4 m/s"),
        "presets": _presets,
        "integrators": _integrators,
        "startup": lambda results: _pairs(results["startup"], "a process up to its first plan"),
        "agreement": lambda results: _pairs(results["agreement"], "converged against tight IPOPT"),
        "section_s": lambda results: _pairs(results["section_s"], "seconds spent"),
    }
    for key, maker in makers.items():
        if key in results:
            yield maker(results)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    return table


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, (int, float)) else str(value)


def _pairs(data: Dict[str, Any], title: str) -> Table:
    table = _table(title, "", "value")
    for key, value in data.items():
        table.add_row(key.replace("_", " "), _text(value))
    return table


def _machine(results: Dict[str, Any]) -> Table:
    return _pairs({**results["machine"], **results["versions"]}, "measured on")


def _rows(results: Dict[str, Any]) -> Table:
    share, speedup = results["python_share"], results["speedup"]
    table = _table(
        f"one call from Python; {100 * share:.0f} % of a budgeted call is Python around the C",
        *("problem", "backend", "p50 ms", "p95 ms", "p99 ms", "max ms"),
        *("iterations", "cost gap", "residual", "x p50", "x p99"),
    )
    keys = ("p50_ms", "p95_ms", "p99_ms", "max_ms", "iterations_mean", "cost_gap", "residual")
    before = None
    for row in results["rows"]:
        if before not in (None, row["problem"]):
            table.add_section()
        before = row["problem"]
        times = speedup[row["backend"]] if before == "all" else {}
        factors = [f"{times[key]:.0f}" if times else "" for key in ("p50_ms", "p99_ms")]
        table.add_row(before, row["backend"], *(f"{row[key]:.3g}" for key in keys), *factors)
    return table


def _paper(results: Dict[str, Any]) -> Table:
    table = _table(
        "the paper's formulation in the paper's simulations (published code in brackets)",
        *("scenario", "mean deviation m", "max m", "iterations", "solve ms p50", "p99"),
    )
    for name, row in results["paper"].items():
        pairs = ("deviation_mean_m", "deviation_max_m", "iterations_mean")
        table.add_row(
            name,
            *(f"{row[key]:.3f} ({row['published_' + key]:g})" for key in pairs),
            *(f"{row[key]:.1f}" for key in ("solve_ms_p50", "solve_ms_p99")),
        )
    return table


def _scaling(results: Dict[str, Any], key: str, name: str) -> Table:
    data = results[key]
    table = _table(f"growth with the power {data['exponent']:.2f}", name, "p50 ms", "ratio")
    for size, milliseconds in zip(data["size"], data["p50_ms"]):
        ratio = milliseconds / data["p50_ms"][0]
        table.add_row(str(size), f"{milliseconds:.3f}", f"{ratio:.1f}")
    return table


def _closed_loop(results: Dict[str, Any]) -> Table:
    columns = ("cost", "deviation_mean", "deviation_max", "clearance", "iterations_mean")
    table = _table("closed loops", "scenario", "backend", *columns, "cost by ipopt's")
    for scenario, flights in results["closed_loop"].items():
        for name, row in flights.items():
            excess = row["cost"] / flights["ipopt"]["cost"] - 1.0
            figures = ["-" if row[c] is None else f"{row[c]:.4g}" for c in columns]
            table.add_row(scenario, name, *figures, f"{100 * excess:+.3f} %")
    return table


def _horizon(results: Dict[str, Any], key: str, title: str) -> Table:
    columns = ("seconds", "cost", "deviation_mean", "deviation_max", "clearance")
    columns += ("iterations_mean", "plans_rejected")
    table = _table(f"{title}, against the length of the horizon", *columns)
    for row in results[key]:
        table.add_row(*("-" if row[c] is None else f"{row[c]:.3g}" for c in columns))
    return table


def _presets(results: Dict[str, Any]) -> Table:
    columns = ("preset", "speed", "corner_distance_m", "roundness")
    table = _table("hexagon by weight preset", *columns)
    for row in results["presets"]:
        table.add_row(*(_text(row[c]) for c in columns))
    return table


def _integrators(results: Dict[str, Any]) -> Table:
    table = _table(
        "integrators with the paper's lags: worst error relative to the change; horizon of 6 s",
        *("dt s", "integrator", "step error", "after 1 s", "factor"),
        *("step us", "solve ms", "per s"),
    )
    keys = ("step_error", "second_error", "lag_factor", "step_us", "solve_ms", "solve_rate_hz")
    for row in results["integrators"]:
        figures = [f"{row[key]:.2g}" for key in keys[:3]]
        times = ["-" if row[key] is None else _rounded(row[key]) for key in keys[3:]]
        table.add_row(f"{row['dt']:g}", row["integrator"], *figures, *times)
    return table


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"
