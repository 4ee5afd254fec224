# SPDX-License-Identifier: MIT
"""How well parameters fit what they were not fitted to."""

from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from nmpc_control.analysis.identification.attitude import AXES
from nmpc_control.analysis.identification.output_error import (
    Fit,
    fit,
    fit_percent,
    fit_percents,
)
from nmpc_control.analysis.identification.passages import Passage

FOLDS = 5
_SHORTEST = 20.0  # [s]


def validate(found: Optional[Fit], passages: Sequence[Passage]) -> Dict[str, Any]:
    """Return the fit [percent] of roll and pitch on passages, with parameters given."""
    if found is None or not passages:
        why = "parameters" if found is None else "part in flight in the period to validate on"
        return {**dict.fromkeys(AXES), "reason": f"no {why}"}
    return dict(zip(AXES, fit_percents(found.model, found.parameters, passages)))


def cross_validate(found: Optional[Fit], passages: Sequence[Passage]) -> Dict[str, Any]:
    """Return the fit [percent] on each fifth of the flight with parameters from the others."""
    duration = sum(float(np.ptp(passage.times)) for passage in passages)
    if found is None or duration < _SHORTEST:
        why = "no parameters" if found is None else f"{duration:.0f} s, expected {_SHORTEST:g}"
        return {"folds": [], **dict.fromkeys(AXES), "reason": why}
    folds: List[Dict[str, Any]] = []
    measured, simulated = [], []
    for number in range(FOLDS):
        kept, held_back = _split(passages, number)
        refit = fit(found.model, kept, start=found.parameters)
        start = float(held_back[0].times[0])
        percents = fit_percents(refit.model, refit.parameters, held_back)
        folds.append({"start": start, "end": float(held_back[-1].times[-1])})
        folds[-1].update(zip(AXES, percents))
        measured += [passage.values for passage in held_back]
        simulated += refit.model.simulate(refit.parameters, held_back)
    pairs = zip(AXES, np.concatenate(measured).T, np.concatenate(simulated).T)
    return {"folds": folds, **{axis: fit_percent(y, model) for axis, y, model in pairs}}


def _split(passages: Sequence[Passage], number: int) -> List[List[Passage]]:
    """Return the passages without a fifth of all samples in a row, and that fifth."""
    total = sum(len(passage.times) for passage in passages)
    low, high = total * number // FOLDS, total * (number + 1) // FOLDS
    parts: List[List[Passage]] = [[], []]
    begin = 0
    for passage in passages:
        index = begin + np.arange(len(passage.times))
        is_held_back = (index >= low) & (index < high)
        begin += len(index)
        for part, chosen in zip(parts, (~is_held_back, is_held_back)):
            if chosen.any():
                part.append(passage.only(chosen))
    return parts
