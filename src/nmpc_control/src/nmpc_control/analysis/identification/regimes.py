# SPDX-License-Identifier: MIT
"""Where attitude followed the commands, where it followed a part of them, and where not.

What is in the air and commanded is fitted as a whole, robustly; windows that the fit explains are
one regime. What is left is fitted again by itself: another regime, until nothing is left or what
is left follows nothing.
"""

from typing import List, Sequence, Tuple

import numpy as np

from nmpc_control.analysis.identification.log import Log
from nmpc_control.analysis.identification.output_error import (
    Fit,
    ResponseModel,
    fit,
    fit_percent,
)
from nmpc_control.analysis.identification.passages import Passage, attitude_passages
from nmpc_control.analysis.identification.response import LONGEST_DEAD_TIME, SECOND
from nmpc_control.analysis.identification.segments import (
    FLIGHT,
    LIMITED,
    labels,
    mark_short,
    stretches,
)

NORMAL_GAIN = 0.7  # [1] attitude per command below this is a regime with limited attitude
NORMAL_LIMIT = 0.45  # [rad] as well; DJI's own limits are 30 and 35 deg
EXCITED = 0.03  # [rad] rms of commands or attitude below this tells nothing of a response
_WINDOW = 1.0  # [s]
_UNEXPLAINED = 0.5  # [1] of a window's motion: more than this is not following
_LEAST_FIT = 50.0  # [percent] less is no regime
_MOST_REGIMES = 3
_CONCENTRATIONS = 3
_LEFT = "left over"


def classify(logs: Sequence[Log]) -> List[np.ndarray]:
    """Return for each log the kind (n,) of each sample of its attitude."""
    return [_classify(log) for log in logs]


def _classify(log: Log) -> np.ndarray:
    kinds = labels(log)
    mark_short(log.attitude.times, kinds, (FLIGHT,))
    todo = FLIGHT
    for _ in range(_MOST_REGIMES):
        passages = attitude_passages(stretches(log, kinds, todo))
        if not passages or not is_excited(passages):
            break
        found = _one_regime(passages)
        regime = LIMITED if is_limited(found) else FLIGHT
        if not _separate(log, kinds, passages, found, regime):
            break
        todo = _LEFT
        mark_short(log.attitude.times, kinds, (_LEFT,))
    kinds[kinds == _LEFT] = "not_following"
    mark_short(log.attitude.times, kinds, (FLIGHT, LIMITED))
    return kinds


def is_limited(found: Fit) -> bool:
    """Return whether a fit of roll and pitch is of a regime with limited attitude."""
    return bool(found.rows[:, 0].max() < NORMAL_GAIN or found.limit < NORMAL_LIMIT)


def is_excited(passages: Sequence[Passage]) -> bool:
    """Return whether roll and pitch commands moved enough to see a response."""
    commands = np.concatenate([passage.commands for passage in passages])
    return bool(np.sqrt(np.mean(commands**2)) > EXCITED)


def _one_regime(passages: Sequence[Passage]) -> Fit:
    """Return the fit of one regime where there may be several.

    A robust fit alone lands between regimes of like length; refitting what it explains best
    concentrates on one (as least trimmed squares do).
    """
    found = fit(_model(passages), passages, is_robust=True)
    for _ in range(_CONCENTRATIONS):
        models = found.model.simulate(found.parameters, passages)
        ratios = [_unexplained(passage, model) for passage, model in zip(passages, models)]
        moving = np.concatenate([ratio[np.isfinite(ratio)] for ratio in ratios])
        if not len(moving):
            break
        bound = np.median(moving)
        kept = [
            p.only(ratio <= bound) for p, ratio in zip(passages, ratios) if (ratio <= bound).any()
        ]
        found = fit(found.model, kept, start=found.parameters)
    return found


def _model(passages: Sequence[Passage]) -> ResponseModel:
    largest = max(np.linalg.norm(passage.commands, axis=1).max() for passage in passages)
    return ResponseModel(SECOND, 2, has_limit=bool(largest > NORMAL_LIMIT))


def _separate(
    log: Log, kinds: np.ndarray, passages: Sequence[Passage], found: Fit, regime: str
) -> bool:
    """Give samples that follow the fit their regime, leave the others; return whether any did."""
    models = found.model.simulate(found.parameters, passages)
    follows = [_follows(passage, model) for passage, model in zip(passages, models)]
    measured = np.concatenate([p.values[f] for p, f in zip(passages, follows)])
    explained = np.concatenate([m[f] for m, f in zip(models, follows)])
    percent = fit_percent(measured, explained) if len(measured) else None
    is_regime = percent is not None and percent > _LEAST_FIT
    times = log.attitude.times
    for passage, is_followed in zip(passages, follows):
        # what settles before the first sample that is compared goes with it
        lead = (times > passage.grid[0] + LONGEST_DEAD_TIME - 1e-6) & (times < passage.times[0])
        inside = (times >= passage.times[0]) & (times <= passage.times[-1])
        kinds[lead] = regime if is_regime and is_followed[0] else _LEFT
        kinds[inside] = np.where(is_followed & is_regime, regime, _LEFT)
    return is_regime


def _follows(passage: Passage, model: np.ndarray) -> np.ndarray:
    """Return for each sample whether the second around it is explained by the model."""
    error, motion = _windows(passage, model)
    return error < np.maximum(_UNEXPLAINED**2 * motion, EXCITED**2)


def _unexplained(passage: Passage, model: np.ndarray) -> np.ndarray:
    """Return for each sample the share of the motion that is not explained; NaN at rest."""
    error, motion = _windows(passage, model)
    return np.where(motion > EXCITED**2, error / np.maximum(motion, EXCITED**2), np.nan)


def _windows(passage: Passage, model: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return mean square error and motion [rad^2] in the second around each sample."""
    duration = max(float(np.ptp(passage.times)), _WINDOW)
    count = max(1, int(round(_WINDOW * len(passage.times) / duration)))
    larger = np.maximum(np.abs(passage.values), np.abs(model))
    error, motion = (
        _moving_mean(np.sum(x**2, axis=1), count) for x in (passage.values - model, larger)
    )
    return error, motion


def _moving_mean(x: np.ndarray, count: int) -> np.ndarray:
    count = min(count, len(x))
    return np.convolve(x, np.ones(count) / count, mode="same")
