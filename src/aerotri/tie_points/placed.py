"""What the first orientation was brought onto, point by point: how well each fits, and whether it was used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.formats.results.json_text import number_or_none
from aerotri.tie_points.georeferencing import Placement

CONTROL, POSITIONS = "control points", "positions"
MOST_NAMED = 5
"""Points that a sentence names; all of them stand in the JSON."""
BENT = 0.01
"""Bend of a first orientation from which it is said [C]: usual ones stay below."""


@dataclass(frozen=True)
class PlacedPoint:
    """One of the points.

    Parameters
    ----------
    offset : dX, dY, dZ, m, where the first orientation has it less where it is stated to be; NaN where it has none.
    sigma : of these, m. relative : the misfit in σ.
    used : whether it agrees and the place rests on it. reason : why it was left aside, '' where it could be compared.
    """

    name: str
    offset: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    sigma: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    relative: float = np.nan
    used: bool = False
    reason: str = ""

    @property
    def misfit(self) -> float:
        """m."""
        return float(np.linalg.norm(self.offset))


@dataclass(frozen=True)
class Placed:
    """How a first orientation was placed.

    Parameters
    ----------
    by : 'control points' or 'positions'. points : all that could have been used.
    agreed : whether most of them agree. fits : also better than a first orientation may be bent.
    bend : by how much it had to be taken as bent, as a share of the extent of the points.
    """

    by: str
    points: tuple[PlacedPoint, ...]
    agreed: bool
    fits: bool
    bend: float

    @property
    def compared(self) -> tuple[PlacedPoint, ...]:
        """Those that the first orientation has somewhere."""
        return tuple(point for point in self.points if not point.reason)

    @property
    def sentence(self) -> str:
        """What fits, in one sentence."""
        used = [point for point in self.compared if point.used]
        count = f"{len(used)} of {len(self.compared)}" if len(used) < len(self.compared) else str(len(used))
        median = float(np.median([point.misfit for point in used])) if used else float("nan")
        return f"the first orientation fits {count} {self.by} to {median:.3g} m (median)"

    @property
    def problem(self) -> str:
        """Why the place is not to be trusted, with what to look at; '' where it is."""
        if self.fits:
            return ""
        used = [point for point in self.compared if point.used]
        median = float(np.median([point.misfit for point in self.compared]))
        why = (
            f"the misfits are {median:.3g} m (median), {100 * self.bend:.2g} % of their extent or more"
            if self.agreed
            else f"only {len(used)} of {len(self.compared)} agree with one another"
        )
        look = (
            "look at the coordinates and marks of the control points: names and axes exchanged, units, coordinate "
            "system, a mark at another point"
            if self.by == CONTROL
            else "look at the positions: names and axes exchanged, units, coordinate system"
        )
        return f"the {self.by} do not fit the photographs: {why}. The block has no place that can be trusted; {look}"

    def doubts(self) -> Iterator[str]:
        """Sentences about points that do not fit."""
        if self.problem:
            yield self.problem
        elif self.bend >= BENT:
            yield (
                f"the {self.by} agree only if the first orientation is bent by some {100 * self.bend:.2g} % of their "
                "extent: look at them if the adjustment does not accept them"
            )
        wrong = sorted((point for point in self.compared if not point.used), key=lambda point: -point.relative)
        if wrong and self.agreed:
            named = ", ".join(
                f"{point.name} ({point.misfit:.3g} m, {point.relative:.0f} σ)" for point in wrong[:MOST_NAMED]
            )
            more = f" and {len(wrong) - MOST_NAMED} more" if len(wrong) > MOST_NAMED else ""
            yield f"{self.by} that do not fit the others and were not used to place the block: {named}{more}"

    def as_json(self) -> dict[str, Any]:
        """For tiepoints.json."""
        return {
            "by": self.by,
            "fits": self.fits,
            "problem": self.problem,
            "bend_percent": 100.0 * self.bend,
            "points": [
                {
                    "name": point.name,
                    "offset_m": list(map(number_or_none, point.offset)),
                    "sigma_m": list(map(number_or_none, point.sigma)),
                    "misfit_sigma": number_or_none(point.relative),
                    "used": point.used,
                    "reason": point.reason,
                }
                for point in self.points
            ],
        }


def placed_by(by: str, names: np.ndarray, compared: np.ndarray, placement: Placement, reasons: list[str]) -> Placed:
    """The record of a placement.

    Parameters
    ----------
    names : (k,) str of all. compared : (k,) bool, those the placement was found from, in its order.
    reasons : of each of the others, '' of these.
    """
    row = np.cumsum(compared) - 1
    points = []
    for k, name in enumerate(names.astype(str).tolist()):
        if not compared[k]:
            points.append(PlacedPoint(name, reason=reasons[k]))
            continue
        at = int(row[k])
        offset, sigma = _three(placement.offset[at]), _three(placement.sigma[at])
        points.append(PlacedPoint(name, offset, sigma, float(placement.relative[at]), bool(placement.used[at])))
    return Placed(by, tuple(points), placement.agreed, placement.fits, placement.bend)


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
