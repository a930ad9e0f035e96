"""The error of an adjustment that has no result."""

from __future__ import annotations

from aerotri.results.adjusted_block import Outcome


class AdjustmentFailedError(Exception):
    """The adjustment has no result; `outcome` says why."""

    def __init__(self, outcome: Outcome):
        self.outcome = outcome
        super().__init__(f"{outcome.status}: {outcome.message}")
