# SPDX-License-Identifier: MIT
"""How near a replay comes to its recording."""

from typing import Optional, Sequence

import numpy as np


def fit_percent(measured: np.ndarray, replayed: np.ndarray) -> Optional[float]:
    """Return 100 (1 - |y - y_model| / |y - mean y|) of (n,); None where y is constant."""
    spread = np.linalg.norm(measured - measured.mean()) if len(measured) else 0.0
    if spread == 0.0:
        return None
    return float(100.0 * (1.0 - np.linalg.norm(measured - replayed) / spread))


def r_squared(measured: Sequence[np.ndarray], replayed: Sequence[np.ndarray]) -> Optional[float]:
    """Return R^2 over segments, each about its own mean; None where all are constant."""
    error = sum(float(np.sum((y - model) ** 2)) for y, model in zip(measured, replayed))
    spread = sum(float(np.sum((y - y.mean()) ** 2)) for y in measured if len(y))
    return 1.0 - error / spread if spread > 0.0 else None
