"""What a part gives for the page of the whole: its photographs, a sample of its points, and its extremes."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.diagnosis import findings
from aerotri.diagnosis.finding import Finding
from aerotri.diagnosis.work_list import WorkList, work_list
from aerotri.observations import ImagePoints, Images
from aerotri.partition.photographs import images_together, positions_together
from aerotri.results.adjusted_block import AdjustedBlock, ImageResults, PointResults, RayResults
from aerotri.statistics.photograph_residuals import ResidualSums, residual_sums
from aerotri.statistics.reliability import critical_value

SAMPLE_RAYS = 200_000
"""Image points of the sample in all parts, about [C]: plots look the same with more."""
MOST_EXTREMES = 30
"""Points with the largest residuals, and the weakest, that every part names: those of the tables."""
OF_WHOLE_PHOTOGRAPHS = ("photograph", "part", "left out")
"""Kinds of the work list that need all rays of a photograph: a shared one has them in several parts."""


@dataclass(frozen=True, eq=False)
class PartPicture:
    """What a part gives for the page.

    Parameters
    ----------
    sample : all photographs, some points with all their rays, all control and check points among them.
    extremes : the points with the largest residuals and standard deviations, with all their rays.
    sums : of the residuals of the photographs. lights : what the part is judged by. work : what to look at.
    photographs, shared : how many. largest_w : of an image coordinate. beyond : rays whose |w| exceeds the test.
    sigma : (3,) m, median of the points.
    """

    sample: AdjustedBlock
    extremes: AdjustedBlock
    sums: ResidualSums
    lights: tuple[Finding, ...]
    work: WorkList
    photographs: int
    shared: int
    largest_w: float
    beyond: int
    sigma: np.ndarray


def picture_of(local: AdjustedBlock, found: AdjustedBlock, shared: np.ndarray, every: int) -> PartPicture:
    """The picture of a part.

    Parameters
    ----------
    local : its result in the frame of the adjustment, judged. found : the same in the CRS of the block.
    shared : (n,) bool, photographs that other parts have as well.
    every : one point of so many belongs to the sample.
    """
    names, results = found.block.points.tolist(), found.points
    chosen = np.array([zlib.crc32(name.encode()) % every == 0 for name in names], bool)
    chosen[found.control.point], chosen[found.check.point] = True, True
    w, sigma = np.nan_to_num(results.max_abs_w), np.nan_to_num(results.total_sigma).max(axis=1, initial=0.0)
    far = np.zeros(len(names), bool)
    for size in (w, sigma):
        far[np.argsort(-size, kind="stable")[:MOST_EXTREMES]] = True
    known = np.isfinite(results.total_sigma).all(axis=1)
    limit = critical_value(found.block.settings.adjustment.alpha)
    beyond = int((np.nan_to_num(np.abs(found.rays.w)).max(axis=1, initial=0.0) > limit).sum())
    median = np.median(results.total_sigma[known], axis=0) if known.any() else np.full(3, np.nan)
    return PartPicture(
        _restricted(found, chosen), _restricted(found, far), residual_sums(found), tuple(findings(local)),
        _own_work(work_list(local), shared), len(shared), int(shared.sum()), float(w.max(initial=0.0)), beyond, median,
    )  # fmt: skip


def _own_work(found: WorkList, shared: np.ndarray) -> WorkList:
    """Without what is said of shared photographs from the rays of one part alone."""
    items = [
        item
        for item in found.items
        if not (item.kind in OF_WHOLE_PHOTOGRAPHS and item.images and shared[list(item.images)].any())
    ]
    left = [item.kind for item in found.items if item not in items]
    count = {kind: number - left.count(kind) for kind, number in found.found.items()}
    return WorkList(tuple(items), {kind: number for kind, number in count.items() if number})


def _restricted(found: AdjustedBlock, chosen: np.ndarray) -> AdjustedBlock:
    """The result with these points alone, (N,) bool, and their rays."""
    block, points, rays = found.block, found.points, found.block.image_points
    own, row = chosen[rays.point], np.cumsum(chosen) - 1
    r = found.rays
    return replace(
        found,
        block=replace(
            block,
            points=block.points[chosen],
            image_points=ImagePoints(rays.image[own], row[rays.point[own]], rays.xy[own], rays.sigma[own]),
            control=type(block.control)(
                np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool)
            ),
        ),
        points=PointResults(
            points.xyz[chosen], points.covariance[chosen], points.rays[chosen], points.max_abs_w[chosen],
            None if points.model is None else points.model[chosen],
        ),
        rays=RayResults(r.v[own], r.r[own], r.w[own], r.weight[own], r.status[own]),
        observations=None,
        effects=None,
    )  # fmt: skip


def together(record: AdjustedBlock, parts: Sequence[AdjustedBlock]) -> AdjustedBlock:
    """The result of the whole with all photographs, and the points and rays that the parts gave.

    Parameters
    ----------
    record : of the whole; its points are the control and check points, which stay the first.
    parts : of `_restricted`.
    """
    photographs, row_of = _photographs(parts)
    row = {name: k for k, name in enumerate(record.block.points.tolist())}
    place = [np.array([row.setdefault(n, len(row)) for n in p.block.points.tolist()], np.int64) for p in parts]
    count = len(row)
    points = PointResults(
        np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan), np.zeros(count, int), np.full(count, np.nan)
    )
    model = None if any(one.points.model is None for one in parts) else np.full((count, 3, 3), np.nan)
    for one, at in zip(parts, place, strict=True):
        points.xyz[at], points.covariance[at] = one.points.xyz, one.points.covariance
        points.rays[at], points.max_abs_w[at] = one.points.rays, one.points.max_abs_w
        if model is not None:
            model[at] = one.points.model
    of_parts = [one.block.image_points for one in parts]
    rays = ImagePoints(
        np.concatenate([own[r.image] for own, r in zip(row_of, of_parts, strict=True)]),
        np.concatenate([at[r.point] for at, r in zip(place, of_parts, strict=True)]),
        np.concatenate([r.xy for r in of_parts]),
        np.concatenate([r.sigma for r in of_parts]),
    )
    results = {
        key: np.concatenate([getattr(one.rays, key) for one in parts]) for key in ("v", "r", "w", "weight", "status")
    }
    block = replace(
        record.block, images=photographs, points=np.array(list(row), dtype=str), image_points=rays,
        gnss_ins=positions_together([part.block.gnss_ins for part in parts], row_of),
    )  # fmt: skip
    return replace(record, block=block, images=_orientations(parts, row_of, len(photographs)),
                   points=replace(points, model=model),
                   rays=RayResults(**results))  # fmt: skip


def sums_together(sums: Sequence[ResidualSums], row_of: Sequence[np.ndarray], count: int) -> ResidualSums:
    """The sums of all photographs; those of shared ones added up.

    Parameters
    ----------
    row_of : rows of the photographs of every part among all `count`.
    """
    whole = ResidualSums(
        np.zeros(count, np.int64), np.zeros(count), np.zeros((count, 2)), np.zeros(count),
        sum(one.fourth for one in sums), sum(one.weight for one in sums),
    )  # fmt: skip
    for one, rows in zip(sums, row_of, strict=True):
        for key in ("rays", "freedom", "squares_px", "squares"):
            getattr(whole, key)[rows] += getattr(one, key)
    return whole


def rows_of_parts(parts: Sequence[AdjustedBlock]) -> list[np.ndarray]:
    """Rows of the photographs of every part among all, which are in the order of `together`."""
    return _photographs(parts)[1]


def _photographs(parts: Sequence[AdjustedBlock]) -> tuple[Images, list[np.ndarray]]:
    return images_together([part.block.images for part in parts])


def _orientations(parts: Sequence[AdjustedBlock], row_of: Sequence[np.ndarray], count: int) -> ImageResults:
    """Adjusted orientations of all photographs; the rays of shared ones are added up."""
    found = ImageResults(
        np.full((count, 3), np.nan), np.full((count, 3), np.nan), np.full((count, 6, 6), np.nan), np.zeros(count, int)
    )
    if not any(one.images.model is None for one in parts):
        found = replace(found, model=np.full((count, 6, 6), np.nan))
    for one, rows in zip(parts, row_of, strict=True):
        known = np.isfinite(one.images.centre).all(axis=1)
        for key in ("centre", "angles", "covariance", *(("model",) if found.model is not None else ())):
            getattr(found, key)[rows[known]] = getattr(one.images, key)[known]
        found.rays[rows] += one.images.rays
    return found
