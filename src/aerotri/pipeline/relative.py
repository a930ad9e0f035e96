"""σ of the shape of a block, put into an adjustment."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from aerotri.coordinates.local_frame import LocalFrame
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.results.relative import RelativePrecision
from aerotri.statistics.relative import MOTIONS, RelativeCovariances, local_cofactors, relative_covariances

FEWEST_POINTS = 4
"""Object points from which a block has a shape: of three a similarity leaves nothing that would be tested [C]."""


def with_relative(found: Adjustment) -> Adjustment:
    """The adjustment with σ after a similarity of the whole block; as it is where there is no final σ0, or no
    σ of any point."""
    begun = time.perf_counter()
    system, solution, sigma0 = found.system, found.solution, found.local.outcome.sigma0
    u = system.unknowns
    if solution.status != "converged" or not sigma0 > 0.0 or len(u.points) < FEWEST_POINTS:
        return found
    if not np.isfinite(solution.state.points).all() or not np.isfinite(solution.state.centre).all():
        return found
    factor = system.factorise(solution.equations)
    covariances = relative_covariances(system, solution, factor, sigma0, local_cofactors(found), found.model)
    if covariances is None:
        return found
    relative = _in_frame(found.local, found.frame, covariances, u.points, u.images)
    local = _told(found.local, _in_frame(found.local, None, covariances, u.points, u.images), begun)
    result = local if found.frame is None else _told(found.result, relative, begun)
    return replace(found, local=local, result=result)


def _told(result: AdjustedBlock, relative: RelativePrecision, begun: float) -> AdjustedBlock:
    timings = dict(result.outcome.timings_s)
    if "statistics" in timings:
        timings["statistics"] += time.perf_counter() - begun
    return replace(result, relative=relative, outcome=replace(result.outcome, timings_s=timings))


def _in_frame(
    local: AdjustedBlock, frame: LocalFrame | None, c: RelativeCovariances, points: np.ndarray, images: np.ndarray
) -> RelativePrecision:
    """The record in the CRS of the block, of that of the adjustment without a frame."""
    similarity = np.where(c.free, np.nan, np.sqrt(np.maximum(np.diagonal(c.similarity), 0.0)))
    assert len(similarity) == MOTIONS
    return RelativePrecision(
        points=_sigma(c.points, local.points.xyz, points, frame),
        centres=_sigma(c.centres, local.images.centre, images, frame),
        position=similarity[:3], rotation=similarity[3:6], scale=float(similarity[6]), neighbours=c.neighbours,
    )  # fmt: skip


def _sigma(covariance: np.ndarray, place: np.ndarray, rows: np.ndarray, frame: LocalFrame | None) -> np.ndarray:
    """(N, 3) m, σ of all places (N, 3), NaN of those that are not among `rows`."""
    if frame is not None:
        jacobian = frame.crs_per_local(place[rows])
        covariance = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
    sigma = np.full(place.shape, np.nan)
    sigma[rows] = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    return sigma
