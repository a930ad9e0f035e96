"""Why a result is doubted or rejected, and the error probability that all rules share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ACCEPTED, DOUBTFUL, REJECTED = LEVELS = ("accepted", "doubtful", "rejected")
Level = Literal["accepted", "doubtful", "rejected"]

SIGNIFICANCE = 0.001
"""Probability with which a rule may doubt a faultless block by chance."""


@dataclass(frozen=True)
class Reason:
    """One reason not to accept a result: 'doubtful' or 'rejected', and a sentence with the numbers."""

    level: Level
    sentence: str


def graded(value: float, doubtful: float, rejected: float) -> Level:
    """The level of a measure that grows as a result gets worse; NaN is accepted: nothing was measured."""
    if value >= rejected:
        return "rejected"
    return "doubtful" if value >= doubtful else "accepted"
