# SPDX-License-Identifier: MIT
"""Identified numbers: value, 95 % interval, and why a number is missing where it is."""

from dataclasses import dataclass, field, replace
from typing import Any, Dict, Optional, Sequence, Tuple

Interval = Tuple[float, float]


@dataclass(frozen=True)
class Estimate:
    """Parameters of one part of the model; None is a parameter that the data cannot tell."""

    values: Dict[str, Optional[float]]
    confidence: Dict[str, Optional[Interval]] = field(default_factory=dict)  # 95 %
    reason: Optional[str] = None  # why parameters, or their intervals, are None

    @property
    def is_found(self) -> bool:
        """Whether any parameter was identified."""
        return any(value is not None for value in self.values.values())

    def without(self, names: Sequence[str], reason: str) -> "Estimate":
        """Return the estimate with some parameters withdrawn."""
        reasons = [text for text in (self.reason, reason) if text]
        return replace(
            self,
            values={k: None if k in names else v for k, v in self.values.items()},
            confidence={k: None if k in names else v for k, v in self.confidence.items()},
            reason="; ".join(reasons),
        )

    def as_dict(self) -> Dict[str, Any]:
        """Return plain data for JSON."""
        intervals = {k: v and list(v) for k, v in self.confidence.items()}
        data: Dict[str, Any] = {**self.values, "confidence": intervals}
        return data if self.reason is None else {**data, "reason": self.reason}


def unidentified(names: Sequence[str], intervals: Sequence[str], reason: str) -> Estimate:
    """Return an estimate in which everything is missing for one reason."""
    return Estimate(dict.fromkeys(names), dict.fromkeys(intervals), reason)
