"""What sets of additional parameters do to the object, against what they do to the image points.

[D] Of two sets that were adjusted to the same image points one changes the residuals by d (RMS of the vectors, as
angles), and the object by D once a similarity of the whole block is taken off (RMS of the vectors). Rays that change by
d, at photographs which stay where they are, move a point by s·d, s² = k·tr(Σ (I − u·uᵀ)/r²)⁻¹ for k rays of directions
u and lengths r. The leverage D/(s·d) tells how much farther the object goes than these image points can measure. It is
near 1 where nothing bends. Where photographs and parameters give way together, as in parallel strips at one height that
look straight down, a change of the residuals by a tenth of their size bends the block by many times of what they
measure: errors of that size which no set knows would do the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.datum import motions_of_points
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import Unknowns
from aerotri.results.parameter_comparison import AdjustedObject, SetOutcome

MOST_LEVERAGE = 10.0
"""Leverage beyond which the change of the object is not the image points' to decide [C]."""
WITHOUT_LENS = ("collocation", "ultracam_d")
"""Families that hold the lens as it is given, or near it."""
FEWEST_RAYS = 3
"""Rays of the points that the object is compared by [C]: two rays show no error across their plane."""
FEWEST_POINTS = 12
"""Points below which nothing is said of the shape of an object [C]: seven motions are taken off three coordinates."""


def object_of(system: NormalSystem, solution: Solution) -> AdjustedObject:
    """The object and the residuals of an adjustment, as far as sets are compared by them."""
    u, equations = system.unknowns, solution.equations
    rays = u.rays
    focal = np.array([camera.focal_length_mm for camera in u.block.cameras])
    focal = focal[u.block.images.camera[u.images]][rays.image]
    root = np.sqrt(equations.weight) if solution.estimator.is_robust else np.ones(len(rays.image))
    used = np.all(rays.inv_sigma > 0.0, axis=1)
    residual = np.where(used[:, None], equations.residual * (root / focal)[:, None], 0.0)
    count, reach = _reach(u, solution.state.centre, solution.state.points, used)
    many = count >= FEWEST_RAYS
    free = u.block.settings.adjustment.is_free
    return AdjustedObject(u.points[many], solution.state.points[many], reach[many], rays.source, residual, free)


def _reach(
    unknowns: Unknowns, centre: np.ndarray, points: np.ndarray, used: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(P,) rays of every point, and m per rad by which it moves where all its rays err."""
    rays = unknowns.rays
    row = np.repeat(np.arange(len(points)), np.diff(rays.start))[used]
    away = points[row] - centre[rays.image[used]]
    square = np.sum(away**2, axis=1)
    normals = np.zeros((len(points), 3, 3))
    np.add.at(
        normals, row, (np.eye(3) - away[:, :, None] * away[:, None, :] / square[:, None, None]) / square[:, None, None]
    )
    count = np.bincount(row, minlength=len(points))
    eigenvalue = np.linalg.eigvalsh(normals)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.sqrt(count * np.sum(1.0 / eigenvalue, axis=1))
    return count, np.where((count >= FEWEST_RAYS) & (eigenvalue[:, 0] > 0.0), reach, np.nan)


def leverage(one: SetOutcome, other: SetOutcome) -> float:
    """How many times farther the object differs between two sets than their image points can reach; NaN of too few."""
    first, second = one.object, other.object
    if first is None or second is None:
        return float("nan")
    _, of_first, of_second = np.intersect1d(first.point, second.point, return_indices=True)
    reach = first.reach[of_first]
    known = np.isfinite(reach)
    if known.sum() < FEWEST_POINTS:
        return float("nan")
    xyz = first.xyz[of_first][known]
    moved = _without_similarity(xyz, second.xyz[of_second][known] - xyz)
    _, of_first, of_second = np.intersect1d(first.ray, second.ray, return_indices=True)
    in_image = second.residual[of_second] - first.residual[of_first]
    of_image = float(np.sqrt(np.mean(np.sum(in_image**2, axis=1))))
    # some points have rays that hardly part: the usual point tells what image points reach
    return float(np.sqrt(np.mean(np.sum(moved**2, axis=1)))) / max(float(np.median(reach[known])) * of_image, 1e-300)


def movement(one: SetOutcome, other: SetOutcome) -> float:
    """m, RMS of the distances between the points of two sets, of a free block of its shape; NaN of too few."""
    first, second = one.object, other.object
    if first is None or second is None:
        return float("nan")
    _, of_first, of_second = np.intersect1d(first.point, second.point, return_indices=True)
    if len(of_first) < FEWEST_POINTS:
        return float("nan")
    xyz = first.xyz[of_first]
    moved = second.xyz[of_second] - xyz
    moved = _without_similarity(xyz, moved) if first.free else moved
    return float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))


def _without_similarity(xyz: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """(k, 3) m, what is left of shifts of points without the similarity that fits them best."""
    motions = motions_of_points(xyz - xyz.mean(axis=0)).reshape(-1, 7)
    flat = moved.reshape(-1)
    return (flat - motions @ np.linalg.lstsq(motions, flat, rcond=None)[0]).reshape(moved.shape)


@dataclass(frozen=True)
class FarMoved:
    """A set whose object goes farther than the image points can tell.

    Parameters
    ----------
    against : the set borne out from which it differs most. leverage : as the function has it.
    """

    against: str
    leverage: float


def frees_the_lens(outcome: SetOutcome) -> bool:
    """Whether a set has parameters of the lens.

    A random field stays near the lens that was given, and CCDs that are moved one by one leave it as it is.
    """
    return any(family not in WITHOUT_LENS for family, _ in outcome.choice)


def far_moved(outcomes: Sequence[SetOutcome]) -> dict[str, FarMoved]:
    """The sets whose object the image points do not bear out, by name.

    Sets are taken in the order of their leverage against the smallest one that frees the lens, and each is held against
    all before it that are borne out themselves and free the lens: one that holds it bends the block by the errors of
    the lens. Of two that contradict each other the one goes that is farther from the smallest.
    """
    by_size = sorted(outcomes, key=lambda o: o.effective)
    first = next((o for o in by_size if frees_the_lens(o)), None)

    def away(outcome: SetOutcome) -> float:
        if first is None or outcome.effective <= first.effective:
            return 0.0
        return float(np.nan_to_num(leverage(first, outcome)))

    borne: list[SetOutcome] = []
    found: dict[str, FarMoved] = {}
    for outcome in sorted(by_size, key=away):
        against = [FarMoved(o.name, leverage(o, outcome)) for o in borne if frees_the_lens(o)]
        farthest = max((one for one in against if np.isfinite(one.leverage)), key=lambda f: f.leverage, default=None)
        if farthest is not None and farthest.leverage > MOST_LEVERAGE:
            found[outcome.name] = farthest
        else:
            borne.append(outcome)
    return found
