"""What a flight plan is asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerotri.conventions import InputError

HEIGHT_MODES = ("constant", "follow")
KINDS = ("asprs", "sigma-z", "sigma-volume")
MOST_PHOTOGRAPHS = 1500
"""Photographs of a plan at most [C]: as many are adjusted in some minutes."""
MOST_OVERLAP = 0.95


@dataclass(frozen=True)
class Target:
    """What the σ predicted must keep.

    Parameters
    ----------
    kind : 'asprs' (RMSE_H and RMSE_V over the area at most `value`, m), 'sigma-z' (σ_Z at most `value`, m, on 95 % of
        the area) or 'sigma-volume' (σ of the volume over the area at most `value`, m³).
    """

    kind: str
    value: float

    @property
    def unit(self) -> str:
        return "m³" if self.kind == "sigma-volume" else "m"


@dataclass(frozen=True)
class PlanOptions:
    """How is flown, measured and controlled.

    Parameters
    ----------
    gsd : m, over the mean ground. forward_overlap, side_overlap : at least, over all ground of the area.
    direction : deg clockwise from grid north; None for that of the longest side. cross_strips : their number.
    height_mode : 'constant', or 'follow' for a height of its own of every strip. rays : photographs of every place of
        the area at least. speed : m/s. turn : s from strip to strip. interval : s that the camera needs, 0 where
        unknown.
    positions_sigma : m of X, Y and of Z of every exposure; None without. tie_points : expected in a photograph.
    image_sigma : px of an image coordinate. probability : that a photograph that sees a tie point measures it.
    control_sigma : m of X, Y and of Z. self_calibration : additional parameters, as in block.toml.
    most_photographs : a plan with more is refused.
    """

    gsd: float
    forward_overlap: float = 0.8
    side_overlap: float = 0.6
    direction: float | None = None
    cross_strips: int = 0
    height_mode: str = "constant"
    rays: int = 3
    speed: float = 10.0
    turn: float = 15.0
    interval: float = 0.0
    positions_sigma: tuple[float, float] | None = None
    tie_points: int = 200
    image_sigma: float = 0.5
    probability: float = 0.6
    control_sigma: tuple[float, float] = (0.02, 0.03)
    self_calibration: str = "none"
    most_photographs: int = MOST_PHOTOGRAPHS

    def checked(self) -> PlanOptions:
        """Itself.

        Raises
        ------
        InputError
            For what is not possible.
        """
        positive = {"gsd": self.gsd, "speed": self.speed, "image sigma": self.image_sigma}
        positive |= {"control sigma": min(self.control_sigma), "positions sigma": min(self.positions_sigma or (1.0,))}
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} {value:g} is not possible", "give a number above 0")
        for name, value in (("forward overlap", self.forward_overlap), ("side overlap", self.side_overlap)):
            if not 0.0 <= value <= MOST_OVERLAP:
                raise InputError(f"{name} {value:g} is not possible", f"give a share of 0 to {MOST_OVERLAP:g}")
        if self.height_mode not in HEIGHT_MODES:
            raise InputError(f"the height mode '{self.height_mode}' is not known", f"give {' or '.join(HEIGHT_MODES)}")
        if self.rays < 2:
            raise InputError(f"{self.rays} photographs of a place do not give its height", "ask for 2 rays or more")
        if not 0.0 < self.probability <= 1.0:
            raise InputError(f"the probability {self.probability:g} is not possible", "give a number of 0 to 1")
        if self.tie_points < 20 or self.cross_strips < 0 or min(self.turn, self.interval) < 0.0:
            raise InputError(
                "fewer than 20 tie points, or a number below 0, is not possible", "give larger numbers"
            )  # fmt: skip
        return self


def parse_target(text: str) -> Target:
    """'asprs 0.05', 'asprs 5cm', 'sigma-z 0.03' or 'sigma-volume 20'.

    Raises
    ------
    InputError
    """
    remedy = "give 'asprs 0.05' or 'asprs 5cm', 'sigma-z 0.03' (m), or 'sigma-volume 20' (m³)"
    kind, _, number = text.strip().lower().replace("=", " ").partition(" ")
    number = number.strip().removesuffix("-class").strip()
    factor = 1.0
    if kind == "asprs" and number.endswith("cm"):
        number, factor = number[:-2].rstrip(" -"), 0.01
    elif number.endswith("m"):
        number = number[:-1].rstrip()
    try:
        value = factor * float(number)
    except ValueError:
        value = math.nan
    if kind not in KINDS or not (math.isfinite(value) and value > 0.0):
        raise InputError(f"the target '{text}' is not known", remedy)
    return Target(kind, value)
