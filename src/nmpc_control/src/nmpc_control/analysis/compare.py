# SPDX-License-Identifier: MIT
"""Is one flight better than another? Differences of means, with block bootstrap intervals.

Samples of a flight follow one another, so neighbours tell nearly the same: whole blocks of seconds
are drawn instead of samples (moving-block bootstrap, H. R. Kuensch, Annals of Statistics 17, 1989).
Of one flight on a side that is all there is: the interval tells nothing of what differs from flight
to flight. Several flights on a side are one number each, and their mean is drawn from Student's
distribution: drawing few flights again and again would give intervals that are far too narrow.
The difference of two such draws is the Behrens-Fisher interval, which errs on the wide side.
"""

from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy.stats import t as student

from nmpc_control.analysis.clearance import clearance_figures
from nmpc_control.analysis.deviation import errors, path_deviation
from nmpc_control.analysis.metrics import VEHICLE_RADIUS
from nmpc_control.analysis.record import ITERATIONS, SOLVE_TIME, FlightRecord, Metrics, Series
from nmpc_control.analysis.tracking import arrival_figures
from nmpc_control.analysis.windows import Window, scenario_window

BLOCK = 2.0  # [s] longer than a deviation remembers
DRAWS = 2000
CONFIDENCE = 0.95
_SEED = 0  # the same bags give the same interval

_RMSE = "root mean square error"

Samples = Callable[[FlightRecord, Window], Optional[Series]]
Number = Callable[[FlightRecord, Window, float], Optional[float]]  # with the hull's radius [m]


class Comparison(NamedTuple):
    """A mean figure of the baseline and of the others; the difference is others minus baseline."""

    figure: str
    unit: str
    baseline: float
    other: float
    difference: float
    low: Optional[float]  # bounds of the interval of the difference; None: nothing tells them
    high: Optional[float]

    @property
    def is_clear(self) -> bool:
        """Return whether the interval excludes that nothing changed."""
        return self.low is not None and not self.low <= 0.0 <= self.high


class _Flight(NamedTuple):
    """A figure of one flight, with sum and number of the samples of all its moving blocks."""

    value: float
    blocks: Optional[Tuple[np.ndarray, np.ndarray]] = None  # None: one number, not a mean
    is_root: bool = False  # the figure is the root of the mean


def compare(
    baseline: Sequence[FlightRecord],
    others: Sequence[FlightRecord],
    radius: float = VEHICLE_RADIUS,
) -> List[Comparison]:
    """Return the comparison of every figure that both sides have.

    Args:
        baseline: Flights before.
        others: Flights after.
        radius: Hull [m] that clearance counts from.
    """
    rows = []
    for (figure, unit), samples in _FIGURES.items():
        sides = [_blocks_of(s, samples, figure in _ROOTS) for s in (baseline, others)]
        if all(sides):
            rows.append(_compare(figure, unit, *sides))
    for (figure, unit), number in _NUMBERS.items():
        sides = [_numbers_of(side, number, radius) for side in (baseline, others)]
        if all(sides):
            rows.append(_compare(figure, unit, *sides))
    return rows


def _compare(figure: str, unit: str, baseline: List, others: List) -> Comparison:
    random = np.random.default_rng(_SEED)
    before, after = _mean(baseline), _mean(others)
    drawn = [_drawn_means(side, random) for side in (baseline, others)]
    low = high = None
    if all(means is not None for means in drawn):
        tail = 50.0 * (1.0 - CONFIDENCE)
        low, high = map(float, np.percentile(drawn[1] - drawn[0], (tail, 100.0 - tail)))
    return Comparison(figure, unit, before, after, after - before, low, high)


def _blocks_of(records: Sequence[FlightRecord], samples: Samples, is_root: bool) -> List[_Flight]:
    """Return the figure of every flight that has samples."""
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
        mean = total[-1] / len(series)
        blocks = (total[ends[starts]] - total[starts], counts)
        found.append(_Flight(float(np.sqrt(mean)) if is_root else mean, blocks, is_root))
    return found


def _numbers_of(records: Sequence[FlightRecord], number: Number, radius: float) -> List[_Flight]:
    windows = [(record, scenario_window(record)) for record in records]
    found = [number(record, window, radius) for record, window in windows if window is not None]
    return [_Flight(float(value)) for value in found if value is not None]


def _mean(flights: List[_Flight]) -> float:
    return float(np.mean([flight.value for flight in flights]))


def _drawn_means(flights: List[_Flight], random: np.random.Generator) -> Optional[np.ndarray]:
    """Return the mean of every draw (DRAWS,); None where one number is all there is."""
    count = len(flights)
    if count > 1:
        spread = np.std([flight.value for flight in flights], ddof=1) / np.sqrt(count)
        quantiles = student.ppf((np.arange(DRAWS) + 0.5) / DRAWS, count - 1)
        return _mean(flights) + spread * random.permutation(quantiles)
    if flights[0].blocks is None:
        return None
    sums, counts = flights[0].blocks
    needed = max(1, int(np.ceil((len(sums) + counts[-1]) / counts.mean())))
    drawn = random.integers(len(sums), size=(DRAWS, needed))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    return np.sqrt(means) if flights[0].is_root else means


def _deviation(record: FlightRecord, window: Window) -> Optional[Series]:
    if record.position is None or record.reference is None:
        return None
    error = errors(record.position, record.reference, window.start, window.reference_end)
    return Series(error.times, np.linalg.norm(error.values, axis=1))


def _squared_error(record: FlightRecord, window: Window) -> Optional[Series]:
    deviation = _deviation(record, window)
    return deviation and Series(deviation.times, deviation.values**2)


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


def _least_clearance(record: FlightRecord, window: Window, radius: float) -> Optional[float]:
    clearances = clearance_figures(record, window, radius, [])["clearance_m"] or {}
    return min((c for c in clearances.values() if c is not None), default=None)


def _navigation_time(record: FlightRecord, window: Window, _: float) -> Optional[float]:
    return arrival_figures(record, window, [])["navigation_time_s"]


_FIGURES: Dict[Tuple[str, str], Samples] = {
    ("average deviation", "m"): _deviation,
    (_RMSE, "m"): _squared_error,
    ("average deviation from the path", "m"): _from_path,
    ("average speed", "m/s"): _speed,
    ("average solver iterations", "1"): _solver(ITERATIONS, 1.0),
    ("average solve time", "ms"): _solver(SOLVE_TIME, 1e3),
}
_ROOTS = (_RMSE,)
_NUMBERS: Dict[Tuple[str, str], Number] = {
    ("least clearance", "m"): _least_clearance,
    ("navigation time", "s"): _navigation_time,
}


def as_json(rows: Sequence[Comparison]) -> List[Metrics]:
    """Return the rows as JSON types."""
    return [{**row._asdict(), "is_clear": row.is_clear} for row in rows]


def as_text(rows: Sequence[Comparison], name: str, baseline: str) -> str:
    """Return the rows as aligned text."""
    lines = [f"{name} compared with {baseline} ({CONFIDENCE:.0%} intervals, blocks of {BLOCK:g} s)"]
    for row in rows:
        label = row.figure + ("" if row.unit == "1" else f" [{row.unit}]")
        verdict = "one flight: no interval"
        if row.low is not None:
            word = "clear" if row.is_clear else "not clear"
            verdict = f"[{row.low:+.3f}, {row.high:+.3f}]  {word}"
        numbers = f"{row.baseline:9.3f} -> {row.other:9.3f}   {row.difference:+9.3f}"
        lines.append(f"  {label:<36} {numbers}  {verdict}")
    return "\n".join(lines) + "\n"
