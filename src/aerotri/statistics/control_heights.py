"""The heights of the control points together against the photographs.

Where photographs determine heights weakly, a block follows its control, and every residual is small. Half of the points
.3 m too high then leave residuals of a centimetre. Together these residuals still contradict.

[D] With cofactors Q of the adjusted heights, weights W and g = W^½·(x̂ − l), errors b of the given heights l give
E(g) = −R·W^½·b, R = I − W^½·Q·W^½, and D(g) = σ0²·R. In the directions of R that are determined gᵀD⁻¹g is χ² where
b = 0 [L: the global test of a group; Baarda 1968], and d of b = h·d has its estimate and σ by least squares. Any
division in two groups is one of 2ⁿ⁻¹: so often its probability counts, unless that of χ² is smaller: it holds for all.
The model part of σ is left out of D: a bowl of the control points bends the photographs too, and would explain itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.control_heights import BOWL, NAMES, SPLIT, ControlHeights, HeightPattern

FEWEST = 5
"""Heights below which there is no test: three hold the block, and of four any two make a group."""
FEWEST_OF_GROUP = 2
"""A single point has its own test."""
DETERMINED = 0.01
"""Redundancy of a combination of heights that is tested [C]: of less, a hundredth of an error shows, and image errors
that are not modelled may be all of it."""
COLUMNS_AT_ONCE = 24
"""Right sides solved together [C]: limits the memory, a row of each for every unknown."""


@dataclass(frozen=True, eq=False)
class _Misfit:
    """The misfit in its determined directions (m, n).

    Parameters
    ----------
    row : (n,) of the points. xyz : (n, 3) m, given. weight_root : (n,) 1/m. gap : (n,) m, adjusted − given.
    covariance : (n, n) of the weighted gaps. r : (n, n) redundancy. directions : (m, n).
    """

    row: np.ndarray
    xyz: np.ndarray
    weight_root: np.ndarray
    gap: np.ndarray
    covariance: np.ndarray
    r: np.ndarray
    directions: np.ndarray


def control_heights(system: NormalSystem, solution: Solution, factor: Factor, sigma0: float) -> ControlHeights | None:
    """The test of the heights; None where there are too few, or nothing else determines them.

    Parameters
    ----------
    factor : undamped, at the solution.
    """
    u = system.unknowns
    row = np.flatnonzero((u.prior_weight[:, 2] > 0.0) & u.point_free[:, 2])
    if len(row) < FEWEST:
        return None
    misfit = _misfit(system, solution, factor, max(1.0, sigma0), row)
    if len(misfit.directions) < FEWEST_OF_GROUP:
        return None
    own = misfit.directions @ (misfit.weight_root * misfit.gap)
    omega = float(own @ np.linalg.solve(misfit.directions @ misfit.covariance @ misfit.directions.T, own))
    freedom = len(misfit.directions)
    names = u.block.points[u.points[row]].astype(str)
    tried = [_estimated(misfit, *shape, u.points) for shape in _shapes(misfit, names)]
    patterns = sorted((one for one in tried if one is not None), key=lambda one: one.p)
    ratio, p = float(np.sqrt(omega / freedom)), chi_square_exceedance(omega, float(freedom))
    return ControlHeights(
        len(row), freedom, ratio, p, float(np.median(1.0 / misfit.weight_root)), _least_likely(patterns)
    )


def _misfit(system: NormalSystem, solution: Solution, factor: Factor, noise: float, row: np.ndarray) -> _Misfit:
    u = system.unknowns
    q = _cofactors(system, solution, factor, row)
    root = np.sqrt(u.prior_weight[row, 2])
    r = np.eye(len(row)) - root[:, None] * q * root
    value, vectors = np.linalg.eigh(r)
    gap = solution.state.points[row, 2] - u.prior_xyz[row, 2]
    return _Misfit(row, u.prior_xyz[row], root, gap, noise**2 * r, r, vectors.T[value > DETERMINED])


def _cofactors(system: NormalSystem, solution: Solution, factor: Factor, row: np.ndarray) -> np.ndarray:
    """(n, n) cofactors of the heights."""
    found = []
    for first in range(0, len(row), COLUMNS_AT_ONCE):
        own = row[first : first + COLUMNS_AT_ONCE]
        sides = np.zeros((len(system.unknowns.points), 3, len(own)))
        sides[own, 2, np.arange(len(own))] = 1.0
        found.append(solve_sides(system, solution.state, factor, sides, solution.estimator, rows=row)[2][row, 2])
    q = np.concatenate(found, axis=1)
    return 0.5 * (q + q.T)


def _shapes(misfit: _Misfit, names: np.ndarray) -> Iterator[tuple[str, np.ndarray, float, str]]:
    """Kind, error of the heights (n,) of size 1, how many like it there are, and the beginning of the names."""
    distance = _from_middle(misfit.xyz)
    yield BOWL, (distance / max(float(distance.max()), 1e-12)) ** 2, 1.0, ""
    groups = [(label, own) for label, own in _by_name(names) if _both_large(own)]
    for label, own in groups:
        yield NAMES, own.astype(float), float(len(groups)), label
    # an error of a height shows in its own test with the other sign
    w = misfit.gap * misfit.weight_root / np.sqrt(np.maximum(np.diagonal(misfit.covariance), 1e-12))
    order = np.argsort(w)
    for count in range(FEWEST_OF_GROUP, len(order) - FEWEST_OF_GROUP + 1):
        higher = np.zeros(len(order))
        higher[order[:count]] = 1.0
        yield SPLIT, higher, 2.0 ** min(len(order) - 1, 1000), ""


def _by_name(names: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """The points whose names have one beginning, up to the first digit."""
    beginning = np.array([re.split(r"\d", name, maxsplit=1)[0] for name in names])
    return [(label, beginning == label) for label in np.unique(beginning).tolist()]


def _both_large(own: np.ndarray) -> bool:
    return FEWEST_OF_GROUP <= int(own.sum()) <= len(own) - FEWEST_OF_GROUP


def _from_middle(xyz: np.ndarray) -> np.ndarray:
    """(n,) m, in plan, from the middle of the points."""
    plan = np.nan_to_num(xyz[:, :2])
    return np.linalg.norm(plan - plan.mean(axis=0), axis=1)


def _estimated(
    misfit: _Misfit, kind: str, shape: np.ndarray, tried: float, label: str, points: np.ndarray
) -> HeightPattern | None:
    """The size of an error of a shape; None where the photographs do not determine it."""
    v = misfit.directions
    column = -v @ (misfit.r @ (misfit.weight_root * shape))
    weighted = np.linalg.solve(v @ misfit.covariance @ v.T, column)
    normal = float(column @ weighted)
    if not normal > DETERMINED * float(np.sum((misfit.weight_root * (shape - shape.mean())) ** 2)) / len(shape):
        return None
    size, sigma = float(weighted @ (v @ (misfit.weight_root * misfit.gap))) / normal, 1.0 / float(np.sqrt(normal))
    higher = shape > 0.0
    p = min(1.0, tried * chi_square_exceedance((size / sigma) ** 2, 1.0))
    warp = abs(size) * _beside_a_plane(misfit.xyz, shape)
    reach = float(_from_middle(misfit.xyz).max())
    chosen = points[misfit.row if kind == BOWL else misfit.row[higher]]
    return HeightPattern(kind, chosen, size, sigma, p, warp, reach, label)


def _beside_a_plane(xyz: np.ndarray, shape: np.ndarray) -> float:
    """RMS of a shape (n,) less the plane that fits it best."""
    plan = np.nan_to_num(xyz[:, :2])
    off = plan - plan.mean(axis=0)
    design = np.column_stack([np.ones(len(off)), off / max(float(np.abs(off).max()), 1e-12)])
    left = shape - design @ np.linalg.lstsq(design, shape, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def _least_likely(patterns: list[HeightPattern]) -> tuple[HeightPattern, ...]:
    """The least likely by chance of every kind."""
    first = {one.kind: one for one in reversed(patterns)}
    return tuple(sorted(first.values(), key=lambda one: one.p))
