# SPDX-License-Identifier: MIT
"""Colours and samples that all drawings share; the meaning of colours is that of the 3D view."""

import numpy as np

from nmpc_control.analysis.record import Series

# As in RViz: green the reference, blue what was flown; distinct for the colour-blind too
REFERENCE, FLOWN, TRUTH, COMMAND = "#2f9e44", "#1c6dd0", "#10b3c7", "#d9480f"
MANUAL, OBSTACLE, SHELL = "#c92a2a", "#8d99a6", "#f2b705"
AXES = ("#d9480f", "#2f9e44", "#1c6dd0")  # x, y, z
MODES = {
    "waiting": "#ced4da",
    "ready": "#b2c7d9",
    "taking_off": "#99d8b4",
    "flying": "#1c6dd0",
    "hovering": "#74b3f0",
    "braking": "#f08c00",
    "landing": "#63c29a",
    "manual": "#c92a2a",
    "released": "#e599b5",
    "fault": "#7a1f6f",
    "switch at F": "#1c6dd0",
    "switch not at F": "#c92a2a",
    "on the ground": "#ced4da",
    "in the air": "#1c6dd0",
}
OTHER_MODE = "#868e96"
_MOST_POINTS = 4000  # drawn of one curve


def thinned(series: Series, most: int = _MOST_POINTS) -> Series:
    """Return at most that many samples, with the extremes of every stretch of the first column.

    What is left out lies between what is drawn: a peak of one sample stays visible.
    """
    if len(series) <= most:
        return series
    column = series.values.reshape(len(series), -1)[:, 0]
    kept = set()
    for part in np.array_split(np.arange(len(series)), most // 2):
        values = np.nan_to_num(column[part])
        kept |= {int(part[values.argmin()]), int(part[values.argmax()])}
    chosen = sorted({0, len(series) - 1, *kept})
    return Series(series.times[chosen], series.values[chosen])
