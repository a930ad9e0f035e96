"""What became of a picket."""

from __future__ import annotations

from enum import IntEnum


class PicketStatus(IntEnum):
    """Status of a node of the grid; from BACKWARD on it was measured and is in error."""

    ACCEPTED = 0
    NOT_SEEN = 1
    LOW_CORRELATION = 2
    AT_END = 3
    NO_TEXTURE = 4
    BACKWARD = 5
    AMBIGUOUS = 6
    NEIGHBOURS = 7
    PEAK = 8

    @property
    def text(self) -> str:
        """As tables and reports have it."""
        return TEXTS[self]

    @property
    def is_error(self) -> bool:
        """Whether it was measured and found to be in error."""
        return self >= PicketStatus.BACKWARD


TEXTS = {
    PicketStatus.ACCEPTED: "accepted",
    PicketStatus.NOT_SEEN: "not seen",
    PicketStatus.LOW_CORRELATION: "low correlation",
    PicketStatus.AT_END: "at the end of the heights",
    PicketStatus.NO_TEXTURE: "no texture along the base",
    PicketStatus.BACKWARD: "backward",
    PicketStatus.AMBIGUOUS: "ambiguous",
    PicketStatus.NEIGHBOURS: "neighbours",
    PicketStatus.PEAK: "peak or pit",
}
