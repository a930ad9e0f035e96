"""A mark brought to the place that is meant: the centre of a target, or where other photographs say the point is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.bench.coded_targets import find_coded
from aerotri.bench.matching import HALF_PX, Match, match, sampled_window
from aerotri.bench.pictures import Pictures, corner_of
from aerotri.bench.prediction import Prediction
from aerotri.bench.rough_prediction import RoughPrediction
from aerotri.bench.targets import find_target
from aerotri.conventions import counted

TARGET_REACH_PX, MATCH_REACH_PX = 8.0, 12
"""How far from the click a target may be, and a match [C]: a hand that sees the point is nearer."""
PIECE_PX = 160
MOST_OTHERS = 5
STEP_M = 0.5
"""Of the places about a point by which photographs are compared."""


@dataclass(frozen=True)
class Snapped:
    """Where a mark goes.

    Parameters
    ----------
    place : column and row, px. how : in words, '' where it stays. number : that a coded target has; None without.
    """

    place: tuple[float, float]
    how: str
    number: int | None = None


def snapped(
    pictures: Pictures, image: int, place: tuple[float, float], others: Sequence[tuple[int, np.ndarray]],
    prediction: Prediction | RoughPrediction | None, xyz: np.ndarray | None,
) -> Snapped:  # fmt: skip
    """The place of a mark; the one given where there is neither a target nor a match.

    Parameters
    ----------
    image : the photograph. place : clicked, column and row, px.
    others : photographs and places (2,) px where the point is measured already.
    prediction, xyz : where ground appears and the point (3,) m, to turn windows alike; None where not known.

    Raises
    ------
    InputError
        When a photograph cannot be read.
    """
    left, top = corner_of(place, PIECE_PX)
    piece = pictures.grey(image, left, top, PIECE_PX)
    near = np.array(place) - (left, top)
    coded = next((one for one in find_coded(piece) if one.covers(near)), None)
    if coded is not None:
        at = (float(coded.place[0]) + left, float(coded.place[1]) + top)
        return Snapped(at, f"coded target {coded.number} ({coded.family}), σ {coded.sigma_px:.2f} px", coded.number)
    target = find_target(piece, (float(near[0]), float(near[1])), TARGET_REACH_PX)
    if target is not None:
        at = (target.place[0] + left, target.place[1] + top)
        return Snapped(at, f"{target.kind}, σ {target.sigma_px:.2f} px")
    found: list[Match] = []
    for other, there in others:
        if other in pictures and other != image and len(found) < MOST_OTHERS:
            affine = _affine(prediction, image, other, xyz)
            one = _matched(pictures, other, there, piece, near, affine)
            found += [] if one is None else [one]
    if not found:
        return Snapped(place, "")
    weight = np.array([1.0 / one.sigma_px**2 for one in found])
    middle = np.median([one.place for one in found], axis=0)
    near_middle = np.array([np.abs(one.place - middle).max() < 1.0 for one in found])
    if near_middle.sum() * 2 <= len(found) and len(found) > 1:
        return Snapped(place, "")
    weight = weight * near_middle
    mean = np.array([one.place for one in found]).T @ weight / weight.sum()
    sigma = 1.0 / np.sqrt(weight.sum())
    number = int(near_middle.sum())
    return Snapped(
        (float(mean[0]) + left, float(mean[1]) + top), f"matched with {counted(number, 'photograph')}, σ {sigma:.2f} px"
    )


def _matched(
    pictures: Pictures, other: int, there: np.ndarray, piece: np.ndarray, near: np.ndarray, affine: np.ndarray
) -> Match | None:
    size = 2 * (HALF_PX + 4)
    left, top = corner_of((float(there[0]), float(there[1])), size)
    template = sampled_window(pictures.grey(other, left, top, size), there - (left, top))
    return None if template is None else match(piece, near, template, affine, MATCH_REACH_PX)


def _affine(
    prediction: Prediction | RoughPrediction | None, image: int, other: int, xyz: np.ndarray | None
) -> np.ndarray:
    """(2, 2) offsets in one photograph per offset in the other, on level ground about it; unity where unknown."""
    if prediction is None or xyz is None or not np.isfinite(xyz).all():
        return np.eye(2)
    around = xyz + STEP_M * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    here, there = prediction.pixels(image, around), prediction.pixels(other, around)
    by_ground = [(px[1:] - px[0]).T for px in (here, there)]
    if not all(np.isfinite(one).all() for one in by_ground) or abs(np.linalg.det(by_ground[1])) < 1e-9:
        return np.eye(2)
    return by_ground[0] @ np.linalg.inv(by_ground[1])
