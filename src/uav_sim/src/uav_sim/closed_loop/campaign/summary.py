# SPDX-License-Identifier: MIT
"""The figures of a campaign from its rows, and the gates it must pass."""

from typing import Any, Dict, List, Optional

from rich.table import Table

from uav_sim.closed_loop.campaign.flying import Row, quantiles
from uav_sim.closed_loop.campaign.settings import Settings

_ONLY_IN_LEDGER = ("solve_times_us",)
_LATE = 3.0  # [s] behind the free flight in suite head_on
_OUTDOOR_CLEARANCE = 0.25  # [m] hull to surface
_ARRIVED, _OUTDOOR, _INFEASIBLE = 0.98, 0.99, 0.05  # shares of the flights
_IN_THE_WAY = ("static_fields", "appearing", "head_on")  # suites in which who is blind
_BLIND = 0.7  # or a greater share collides


def summary(settings: Settings, rows: List[Row]) -> Dict[str, Any]:
    """Return the figures of all rows, which come in order of their index."""
    flown = [row for row in rows if "error" not in row]
    open_rows = [row for row in flown if row["feasible"] is not False]
    infeasible = [row for row in flown if row["feasible"] is False and not row["closed"]]
    margins = [row["worst_margin_m"] for row in flown if row["worst_margin_m"] is not None]
    times = [t / 1e3 for row in flown for t in row["solve_times_us"]]
    figures: Dict[str, Any] = {
        "suite": settings.suite,
        "plant": settings.plant,
        "disturbance": settings.disturbance,
        "seed": settings.seed,
        "avoidance": "on" if settings.avoidance else "off",
        "changes": list(settings.changes),
        "flights": len(rows),
        "collisions": sum(row["collisions"] > 0 for row in flown),
        "collisions_feasible": sum(row["collisions"] > 0 for row in open_rows),
        "margin_entered": sum(row["margin_entered"] for row in flown),
        "worst_margin_m": min(margins, default=None),
        "arrived": sum(row["arrived"] for row in flown),
        "arrived_feasible": sum(row["arrived"] for row in open_rows),
        "held": sum(row["held"] for row in flown),
        "late": sum(_is_late(row) for row in open_rows),
        "infeasible": len(infeasible),
        "infeasible_flights": [_name(row) for row in infeasible],
        "unjudged": sum(row["feasible"] is None for row in flown),
        "errors": len(rows) - len(flown),
        "solve_time_ms": quantiles(times),
        "wall_s_per_flight": _mean([row["wall_s"] for row in flown]),
        "deviation_m": _mean([r["deviation_m"] for r in flown if r["deviation_m"] is not None]),
    }
    figures["gates"] = gates(settings, rows, figures)
    figures["passed"] = all(gate["passed"] for gate in figures["gates"])
    figures["rows"] = [
        {key: value for key, value in row.items() if key not in _ONLY_IN_LEDGER} for row in rows
    ]
    return figures


def gates(settings: Settings, rows: List[Row], figures: Dict[str, Any]) -> List[Dict[str, Any]]:
    """Return name, value, bound and verdict of everything the campaign must pass."""
    flights, suite = figures["flights"], settings.suite
    errors = _at_most("errors", figures["errors"], 0)
    if not settings.avoidance:
        blind = _BLIND if suite in _IN_THE_WAY else 0.0
        return [errors, _at_least("collisions", figures["collisions"], blind * flights)]
    result = [errors, _at_most("collisions_feasible", figures["collisions_feasible"], 0)]
    if suite == "no_way":
        return [*result, _at_least("held", figures["held"], flights)]
    result.append(_at_most("infeasible", figures["infeasible"], _INFEASIBLE * flights))
    open_count = flights - figures["infeasible"] - figures["errors"]
    result.append(_at_least("arrived_feasible", figures["arrived_feasible"], _ARRIVED * open_count))
    if suite == "static_fields" and settings.disturbance == "none":
        result.append(_at_most("margin_entered", figures["margin_entered"], 0))
    if suite == "static_fields" and settings.disturbance == "outdoor":
        clear = sum((row.get("clearance_m") or 0.0) >= _OUTDOOR_CLEARANCE for row in rows)
        result.append(_at_least("clearance_0.25_m", clear, _OUTDOOR * flights))
    if suite == "head_on":
        result.append(_at_most("late", figures["late"], 0))
    return result


def table(figures: Dict[str, Any]) -> Table:
    """Return the figures for people."""
    title = "{suite}, plant {plant}, disturbance {disturbance}, seed {seed}".format(**figures)
    result = Table(title=title, show_header=False)
    for key, value in figures.items():
        if key not in ("rows", "gates", "machine", "versions", "suite", "plant", "disturbance"):
            result.add_row(key, _text(value))
    for gate in figures["gates"]:
        verdict = "passed" if gate["passed"] else "FAILED"
        result.add_row(f"gate {gate['name']}", f"{gate['value']} {gate['bound']}: {verdict}")
    return result


def _is_late(row: Row) -> bool:
    return row["late_s"] is None or row["late_s"] > _LATE


def _name(row: Row) -> Dict[str, int]:
    return {"index": row["index"], "seed": row["seed"]}


def _at_most(name: str, value: float, bound: float) -> Dict[str, Any]:
    return {"name": name, "value": value, "bound": f"<= {bound:g}", "passed": value <= bound}


def _at_least(name: str, value: float, bound: float) -> Dict[str, Any]:
    return {"name": name, "value": value, "bound": f">= {bound:g}", "passed": value >= bound}


def _mean(values: List[float]) -> Optional[float]:
    return round(sum(values) / len(values), 3) if values else None


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {number}" for name, number in value.items())
    return str(value)
