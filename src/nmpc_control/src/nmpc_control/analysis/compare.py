# SPDX-License-Identifier: MIT
"""Is one flight better than another? Differences of means, with block bootstrap intervals.

Samples of a flight follow one another, so neighbours tell nearly the same: whole blocks of seconds
are drawn instead of samples (moving-block bootstrap, H. R. Kuensch, Annals of Statistics 17, 1989).
With several flights on a side the flights are drawn first: the interval then also holds what
differs from flight to flight. With one flight it is about these two flights alone.
"""

from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.analysis.deviation import errors, path_deviation
from nmpc_control.analysis.record import ITERATIONS, SOLVE_TIME, FlightRecord, Metrics, Series
from nmpc_control.analysis.windows import Window, scenario_window

BLOCK = 2.0  # [s] longer than a deviation remembers
DRAWS = 2000
CONFIDENCE = 0.95
_SEED = 0  # the same bags give the same interval

Samples = Callable[[FlightRecord, Window], Optional[Series]]


class Comparison(NamedTuple):
    """A mean figure of the baseline and of the others; the difference is others minus baseline."""

    figure: str
    unit: str
    baseline: float
    other: float
    difference: float
    low: float  # bounds of the interval of the difference
    high: float

    @property
    def is_clear(self) -> bool:
        """Return whether the interval excludes that nothing changed."""
        return not self.low <= 0.0 <= self.high


def compare(baseline: Sequence[FlightRecord], others: Sequence[FlightRecord]) -> List[Comparison]:
    """Return the comparison of every figure that both sides have."""
    rows = []
    for (figure, unit), samples in _FIGURES.items():
        sides = [_blocks_of(side, samples) for side in (baseline, others)]
        if all(sides):
            rows.append(_compare(figure, unit, *sides))
    return rows


def _compare(figure: str, unit: str, baseline: List, others: List) -> Comparison:
    random = np.random.default_rng(_SEED)
    before, after = _mean(baseline), _mean(others)
    draws = _drawn_means(others, random) - _drawn_means(baseline, random)
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(draws, (tail, 100.0 - tail))
    return Comparison(figure, unit, before, after, after - before, float(low), float(high))


def _blocks_of(
    records: Sequence[FlightRecord], samples: Samples
) -> List[Tuple[np.ndarray, np.ndarray]]:
    """Return sum and number of the samples of all moving blocks, of every flight that has them."""
    found = []
    for record in records:
        window = scenario_window(record)
        series = None if window is None else samples(record, window)
        if series is None or not len(series):
            continue
        total = np.concatenate(([0.0], np.cumsum(series.values)))
        ends = np.searchsorted(series.times, series.times + BLOCK)
        last = np.searchsorted(series.times, series.times[-1] - BLOCK, side="right")
        starts = np.arange(max(1, last))
        counts = ends[starts] - starts
        found.append((total[ends[starts]] - total[starts], counts, total[-1] / len(series)))
    return found


def _mean(flights: List) -> float:
    return float(np.mean([mean for _, _, mean in flights]))


def _drawn_means(flights: List, random: np.random.Generator) -> np.ndarray:
    """Return the mean of every draw (DRAWS,): of flights, and of blocks within each of them."""
    chosen = random.integers(len(flights), size=(DRAWS, len(flights)))
    means = np.empty(chosen.shape)
    for index, (sums, counts, _) in enumerate(flights):
        slots = chosen == index
        needed = max(1, int(np.ceil((len(sums) + counts[-1]) / counts.mean())))
        drawn = random.integers(len(sums), size=(np.count_nonzero(slots), needed))
        means[slots] = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    return means.mean(axis=1)


def _deviation(record: FlightRecord, window: Window) -> Optional[Series]:
    if record.position is None or record.reference is None:
        return None
    error = errors(record.position, record.reference, window.start, window.reference_end)
    return Series(error.times, np.linalg.norm(error.values, axis=1))


def _from_path(record: FlightRecord, window: Window) -> Optional[Series]:
    if record.position is None or record.reference is None:
        return None
    flown = record.position.between(window.start, window.reference_end)
    return Series(flown.times, path_deviation(flown.values, record.reference.path.values))


def _speed(record: FlightRecord, window: Window) -> Optional[Series]:
    if record.velocity is None:
        return None
    flown = record.velocity.between(window.start, window.end)
    return Series(flown.times, np.linalg.norm(flown.values, axis=1))


def _solver(column: int, factor: float) -> Samples:
    def samples(record: FlightRecord, window: Window) -> Optional[Series]:
        if record.solver is None:
            return None
        plans = record.solver.between(window.start, window.end)
        return Series(plans.times, factor * plans.values[:, column])

    return samples


_FIGURES: Dict[Tuple[str, str], Samples] = {
    ("average deviation", "m"): _deviation,
    ("average deviation from the path", "m"): _from_path,
    ("average speed", "m/s"): _speed,
    ("average solver iterations", "1"): _solver(ITERATIONS, 1.0),
    ("average solve time", "ms"): _solver(SOLVE_TIME, 1e3),
}


def as_json(rows: Sequence[Comparison]) -> List[Metrics]:
    """Return the rows as JSON types."""
    return [{**row._asdict(), "is_clear": row.is_clear} for row in rows]


def as_text(rows: Sequence[Comparison], name: str, baseline: str) -> str:
    """Return the rows as aligned text."""
    lines = [f"{name} compared with {baseline} ({CONFIDENCE:.0%} intervals, blocks of {BLOCK:g} s)"]
    for row in rows:
        label = row.figure + ("" if row.unit == "1" else f" [{row.unit}]")
        word = "clear" if row.is_clear else "not clear"
        lines.append(
            f"  {label:<36} {row.baseline:9.3f} -> {row.other:9.3f}   "
            f"{row.difference:+9.3f}  [{row.low:+.3f}, {row.high:+.3f}]  {word}"
        )
    return "\n".join(lines) + "\n"
