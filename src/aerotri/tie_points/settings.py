"""What a user may say about the finding of tie points, with what holds where nothing is said."""

from __future__ import annotations

from dataclasses import dataclass

from aerotri.conventions import LARGEST, InputError

LEAST = {"mark_sigma_px": 1e-3, "points": 10, "features": 100, "feature_size": 300, "neighbours": 1}
"""Smallest value of a setting."""


@dataclass(frozen=True)
class TiePointSettings:
    """How tie points are found.

    Parameters
    ----------
    mark_sigma_px : σ of the image points of control, pixels.
    points : tie points wanted in a photograph.
    features : sought in a photograph.
    feature_size : features are sought in photographs of this size, pixels.
    neighbours : photographs that each is compared with, the nearest.
    seed : of random sampling.
    """

    mark_sigma_px: float = 0.5
    points: int = 1000
    features: int = 8000
    feature_size: int = 2000
    neighbours: int = 20
    seed: int = 1

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
        """
        for name, least in LEAST.items():
            value = getattr(self, name)
            if not least <= value <= LARGEST:
                raise InputError(f"{name} {value:g} is not possible", f"give a number from {least:g} on")


DEFAULTS = TiePointSettings()
