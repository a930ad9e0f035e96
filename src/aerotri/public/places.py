"""Where something lies, for messages."""

from __future__ import annotations


def place_in_words(bounds: tuple[float, float, float, float]) -> str:
    """Left, bottom, right and top as 'X … to …, Y … to …'; with more decimals where they may be degrees."""
    left, bottom, right, top = bounds
    digits = 6 if max(abs(v) for v in bounds) <= 360.0 else 0
    return f"X {left:.{digits}f} to {right:.{digits}f}, Y {bottom:.{digits}f} to {top:.{digits}f}"
