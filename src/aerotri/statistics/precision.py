"""How precise the unknowns are: correlations by name, the weakest parts, ellipsoids, theoretical and practical means.

All from the covariances of a result; every σ contains σ̂0, and the model part where there is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri import of_known
from aerotri.quantiles import chi_square_quantile
from aerotri.results.adjusted_block import AdjustedBlock, SharedParameters
from aerotri.statistics.covariance import correlations

ORIENTATION = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
HIGH_CORRELATION = 0.95
"""Correlation from which two unknowns of one photograph, or two shared parameters, are worth naming [C]."""

WEAK = 3.0
"""Times the median σ from which a photograph or point counts as weak [C]."""

MOST_NAMED = 1000
"""Correlations that are named, the largest first [C]: more than anybody reads, and files stay small where all are
high."""


@dataclass(frozen=True)
class NamedCorrelation:
    """Two unknowns that are hard to tell apart; `photograph` is '' for shared parameters."""

    first: str
    second: str
    photograph: str
    value: float

    @property
    def text(self) -> str:
        """Such as 'X0–phi of photo 1: +99.9 %'."""
        of = f" of photo {self.photograph}" if self.photograph else ""
        return f"{self.first}–{self.second}{of}: {100.0 * self.value:+.1f} %"


def photograph_correlations(
    adjusted: AdjustedBlock, threshold: float = HIGH_CORRELATION, most: int = MOST_NAMED
) -> tuple[NamedCorrelation, ...]:
    """Correlations of at least `threshold` between the orientation elements of one photograph, largest first.

    Parameters
    ----------
    most : how many to name; the largest are.
    """
    covariance = adjusted.images.covariance
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.nan_to_num(covariance / (sigma[:, :, None] * sigma[:, None, :]), posinf=0.0, neginf=0.0)
    first, second = np.triu_indices(6, 1)
    image, pair = np.nonzero(np.abs(r[:, first, second]) >= threshold)
    value = r[image, first[pair], second[pair]]
    names = adjusted.block.images.names
    return tuple(
        NamedCorrelation(
            ORIENTATION[first[pair[k]]], ORIENTATION[second[pair[k]]], str(names[image[k]]), float(value[k])
        )
        for k in np.argsort(-np.abs(value), kind="stable")[:most]
    )


def parameter_correlations(
    parameters: SharedParameters, threshold: float = HIGH_CORRELATION, most: int = MOST_NAMED
) -> tuple[NamedCorrelation, ...]:
    """Correlations of at least `threshold` between shared parameters, largest first; groups named where several are."""
    if len(parameters) < 2:
        return ()
    r = np.nan_to_num(correlations(parameters.covariance), posinf=0.0, neginf=0.0)
    first, second = np.triu_indices(len(parameters), 1)
    nodes = parameters.is_node
    value = np.where(nodes[first] & nodes[second], 0.0, r[first, second])
    several = len(set(parameters.groups.tolist())) > 1
    labels = [f"{n} ({g})" if several else str(n) for n, g in zip(parameters.names, parameters.groups, strict=True)]
    high = np.flatnonzero(np.abs(value) >= threshold)
    high = high[np.argsort(-np.abs(value[high]), kind="stable")][:most]
    return tuple(NamedCorrelation(labels[first[k]], labels[second[k]], "", float(value[k])) for k in high)


@dataclass(frozen=True)
class WeakPart:
    """A photograph or point whose σ stands out.

    Parameters
    ----------
    name : of the photograph or point. element : the unknown that stands out most. sigma, median : of this element in
        the photograph or point and in all of them, m or rad. rays : that hold it.
    """

    name: str
    element: str
    sigma: float
    median: float
    rays: int

    @property
    def ratio(self) -> float:
        return self.sigma / self.median if self.median > 0.0 else float("inf")


def weakest_photographs(adjusted: AdjustedBlock, ratio: float = WEAK, most: int = 20) -> tuple[WeakPart, ...]:
    """Photographs with a σ of at least `ratio` times the median, the weakest first."""
    images = adjusted.images
    return _weakest(images.total_sigma, adjusted.block.images.names, ORIENTATION, images.rays, ratio, most)


def weakest_points(adjusted: AdjustedBlock, ratio: float = WEAK, most: int = 20) -> tuple[WeakPart, ...]:
    """Points with a σ of at least `ratio` times the median, the weakest first."""
    points = adjusted.points
    return _weakest(points.total_sigma, adjusted.block.points, ("X", "Y", "Z"), points.rays, ratio, most)


def _weakest(
    sigma: np.ndarray, names: np.ndarray, elements: Sequence[str], rays: np.ndarray, ratio: float, most: int
) -> tuple[WeakPart, ...]:
    there = np.isfinite(sigma).any(axis=1)
    if not there.any():
        return ()
    median = of_known.medians(sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(np.where(median > 0.0, sigma / median, 0.0))
    element = np.argmax(share, axis=1)
    largest = share[np.arange(len(share)), element]
    rows = np.flatnonzero(largest >= ratio)
    rows = rows[np.argsort(-largest[rows], kind="stable")][:most]
    return tuple(
        WeakPart(
            str(names[k]),
            elements[int(element[k])],
            float(sigma[k, element[k]]),
            float(median[element[k]]),
            int(rays[k]),
        )
        for k in rows
    )


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """Ellipsoids of k positions.

    Parameters
    ----------
    semi_axes : (k, 3) m, the largest first. directions : (k, 3, 3) unit vectors of the axes as columns, right-handed.
    azimuth : (k, 3) rad of each axis, from +Y (north) towards +X. elevation : (k, 3) rad, 0 to 90°.
    """

    semi_axes: np.ndarray
    directions: np.ndarray

    @property
    def azimuth(self) -> np.ndarray:
        upward = self._upward
        return np.arctan2(upward[:, 0], upward[:, 1])

    @property
    def elevation(self) -> np.ndarray:
        return np.arcsin(np.clip(self._upward[:, 2], -1.0, 1.0))

    @property
    def _upward(self) -> np.ndarray:
        """(k, 3, 3) the axes, turned so that none points down."""
        return self.directions * np.where(self.directions[:, 2:3] < 0.0, -1.0, 1.0)


def point_ellipsoids(adjusted: AdjustedBlock, probability: float | None = None) -> Ellipsoids:
    """Ellipsoids of the object points; see `ellipsoids`."""
    return ellipsoids(adjusted.points.total_covariance, probability)


def centre_ellipsoids(adjusted: AdjustedBlock, probability: float | None = None) -> Ellipsoids:
    """Ellipsoids of the projection centres; see `ellipsoids`."""
    return ellipsoids(adjusted.images.total_covariance[:, :3, :3], probability)


def plan_ellipses(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard error ellipses in plan (axes of one σ, 39 %) of (k, 3, 3) covariances; NaN where one is not known.

    Returns
    -------
    a, b : (k,) m, semi-axes, a ≥ b. azimuth : (k,) rad of the axis a, from +Y (north) towards +X, 0 to π.
    """
    xx, yy, xy = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    middle, spread = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
    azimuth = np.mod(np.arctan2(2.0 * xy, yy - xx) / 2.0, np.pi)
    return np.sqrt(middle + spread), np.sqrt(np.maximum(middle - spread, 0.0)), azimuth


def ellipsoids(covariance: np.ndarray, probability: float | None = None) -> Ellipsoids:
    """Ellipsoids of (k, 3, 3) covariances, NaN where one is not known.

    Parameters
    ----------
    probability : with which the ellipsoid holds the position, √χ²(3) times the standard one; without it the standard
        ellipsoid (axes of one σ, 20 %).
    """
    known = np.isfinite(covariance).all(axis=(1, 2))
    values, vectors = np.full((len(covariance), 3), np.nan), np.full((len(covariance), 3, 3), np.nan)
    rising, columns = np.linalg.eigh(covariance[known])
    columns = columns[:, :, ::-1].copy()
    columns[:, :, 2] *= np.sign(np.linalg.det(columns))[:, None]
    values[known], vectors[known] = rising[:, ::-1], columns
    scale = 1.0 if probability is None else float(np.sqrt(chi_square_quantile(probability, 3)))
    return Ellipsoids(scale * np.sqrt(np.maximum(values, 0.0)), vectors)


@dataclass(frozen=True)
class Precision:
    """Mean precision of n object points, m [P: paper 002, equations 2 and 3].

    Theoretical: μ = σ̂0·√(tr Q/3n), per coordinate √(mean σ²). Practical: the same means of squared differences.
    """

    count: int
    mean: float
    x: float
    y: float
    z: float


def theoretical_precision(adjusted: AdjustedBlock, chosen: np.ndarray | None = None) -> Precision:
    """Of the adjusted points, all or those chosen ((N,) bool)."""
    return _precision(adjusted.points.total_sigma if chosen is None else adjusted.points.total_sigma[chosen])


def practical_precision(adjusted: AdjustedBlock) -> Precision:
    """From the check points with three coordinates; it holds the errors of the given coordinates as well."""
    return _precision(adjusted.check.difference)


def precision_against_truth(adjusted: AdjustedBlock, truth: np.ndarray, chosen: np.ndarray | None = None) -> Precision:
    """From the true positions (N, 3) m of a simulated block's points, all or those chosen ((N,) bool)."""
    difference = adjusted.points.xyz - truth
    return _precision(difference if chosen is None else difference[chosen])


def _precision(deviations: np.ndarray) -> Precision:
    """Root mean squares of (k, 3) deviations, rows that are not complete left out."""
    complete = deviations[np.isfinite(deviations).all(axis=1)]
    if not len(complete):
        nan = float("nan")
        return Precision(0, nan, nan, nan, nan)
    squares = np.mean(complete**2, axis=0)
    x, y, z = (float(value) for value in np.sqrt(squares))
    return Precision(len(complete), float(np.sqrt(squares.mean())), x, y, z)
