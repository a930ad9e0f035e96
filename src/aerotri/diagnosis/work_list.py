"""What to look at first: places of an adjusted block that an operator should check, the worst ones on top."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri import of_known
from aerotri.diagnosis.ties import Ties, intersection_angles, photograph_ties
from aerotri.diagnosis.work_items import KINDS, WorkItem, residual_items
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import judge_rays, spread
from aerotri.statistics.summarise import INSEPARABLE

__all__ = ["WorkItem", "WorkLimits", "WorkList", "work_list"]

FEWEST_RAYS = 10
"""Rays from which the spread in a photograph is judged [C]: the median of twenty |w| is uncertain by a quarter, of
fewer by more."""


@dataclass(frozen=True)
class WorkLimits:
    """Where an item begins.

    Parameters
    ----------
    shared_points : a photograph, or a part of the block, should have as many points in common with the rest.
    pair_points : and as many with one other photograph; five orient two photographs to one another.
    sigma_ratio : σ of a photograph over the median of all. point_sigma_ratio : the same for points.
    angle_deg : at which the rays of a point should meet at least.
    per_kind, items : how many are listed, of a kind and in all.
    """

    shared_points: int = 10
    pair_points: int = 6
    sigma_ratio: float = 3.0
    residual_ratio: float = 1.7
    point_sigma_ratio: float = 8.0
    angle_deg: float = 4.0
    per_kind: int = 10
    items: int = 40


@dataclass(frozen=True)
class WorkList:
    """The items to look at, first things first, and how many of each kind were found, listed or not."""

    items: tuple[WorkItem, ...]
    found: Mapping[str, int]

    @property
    def unlisted(self) -> int:
        return sum(self.found.values()) - len(self.items)


def work_list(adjusted: AdjustedBlock, limits: WorkLimits | None = None) -> WorkList:
    """The work list of an adjustment.

    Parameters
    ----------
    adjusted : in metres (the local frame, or a projected CRS): angles between rays are computed from it.
    """
    limits = limits or WorkLimits()
    tests = judge_rays(adjusted)
    ties = photograph_ties(adjusted, limits.shared_points)
    found = [
        *_left_out(adjusted),
        *residual_items(adjusted, tests),
        *_parts(adjusted, ties, limits),
        *_photographs(adjusted, ties, limits),
        *_parameters(adjusted),
        *_points(adjusted, limits),
    ]
    return _listed(found, limits)


def joined(lists: Sequence[WorkList], limits: WorkLimits | None = None) -> WorkList:
    """One work list of those of several parts of a block; rows of points and photographs are left out."""
    items = [replace(item, points=(), images=()) for one in lists for item in one.items]
    count = Counter[str]()
    for one in lists:
        count.update(one.found)
    return replace(_listed(items, limits or WorkLimits()), found=dict(count))


def _listed(found: list[WorkItem], limits: WorkLimits) -> WorkList:
    found.sort(key=lambda item: (item.priority, -item.severity, KINDS.index(item.kind)))
    listed, of_kind = list[WorkItem](), Counter[str]()
    for item in found:
        of_kind[item.kind] += 1
        if of_kind[item.kind] <= limits.per_kind and len(listed) < limits.items:
            listed.append(item)
    return WorkList(tuple(listed), dict(of_kind))


def _left_out(adjusted: AdjustedBlock) -> list[WorkItem]:
    """Photographs and control points that take no part."""
    block = adjusted.block
    measured = np.bincount(block.image_points.image, minlength=len(block.images))
    items = []
    for image in np.flatnonzero(adjusted.images.rays == 0):
        what = f"left out of the adjustment, {measured[image]} image points measured"
        hint = "give it start values, or measure more points" if measured[image] else "measure points in it"
        items.append(WorkItem(1, "left out", str(block.images.names[image]), what, np.inf, hint, images=(int(image),)))
    there = np.concatenate([adjusted.control.point, adjusted.check.point])
    rays = np.bincount(block.image_points.point, minlength=len(block.points))
    for point in np.setdiff1d(block.control.point, there):
        what = f"given coordinates, {rays[point]} {'ray' if rays[point] == 1 else 'rays'} measured, not used"
        hint = "see whether it was switched off, or measure it in another photograph" if rays[point] else "measure it"
        items.append(WorkItem(3, "left out", str(block.points[point]), what, 1.0, hint, points=(int(point),)))
    return items


def _parts(adjusted: AdjustedBlock, ties: Ties, limits: WorkLimits) -> list[WorkItem]:
    names, items = adjusted.block.images.names, []
    for cut in ties.cuts:
        if len(cut.part) < 2:
            continue
        shown = ", ".join(str(names[image]) for image in cut.part[:3]) + ", …" * (len(cut.part) > 3)
        what = f"{len(cut.part)} photographs with {cut.common} points in common with all others"
        severity = limits.shared_points / cut.common if cut.common else np.inf
        hint = "measure tie points between the part and its neighbours"
        own = tuple(int(image) for image in cut.part)
        items.append(WorkItem(2 if cut.common >= 3 else 1, "part", shown, what, severity, hint, images=own))
    return items


def _photographs(adjusted: AdjustedBlock, ties: Ties, limits: WorkLimits) -> list[WorkItem]:
    """Photographs that little holds: few common points, none with any single neighbour, σ or residuals too large."""
    names, sigma = adjusted.block.images.names, adjusted.images.total_sigma
    sizes = {
        "σ of the position": (np.linalg.norm(sigma[:, :3], axis=1), limits.sigma_ratio),
        "σ of the attitude": (np.linalg.norm(sigma[:, 3:], axis=1), limits.sigma_ratio),
        "residuals": (_residual_sizes(adjusted), limits.residual_ratio),
    }
    ratios = {
        name: (size / of_known.median(size), limit)
        for name, (size, limit) in sizes.items()
        if of_known.median(size) > 0.0
    }
    items = []
    for image in np.flatnonzero(adjusted.images.rays > 0):
        shared, strongest, found = int(ties.shared[image]), int(ties.strongest[image]), []
        if shared < limits.shared_points:
            found.append((limits.shared_points / max(shared, 0.5), f"{shared} points in common with all others"))
        if strongest < limits.pair_points:
            other = f", {names[ties.neighbour[image]]}" if strongest else ""
            found.append((limits.pair_points / max(strongest, 0.5), f"{strongest} with the nearest one{other}"))
        for name, (ratio, limit) in ratios.items():
            if ratio[image] > limit:
                found.append((ratio[image] / limit, f"{name} {ratio[image]:.1f} times the median"))
        if found:
            what = f"{adjusted.images.rays[image]} rays; " + "; ".join(text for _, text in found)
            severity = float(max(size for size, _ in found))
            only_residuals = len(found) == 1 and found[0][1].startswith("residuals")
            hint = "blurred, or of another camera?" if only_residuals else "measure tie points in it and its neighbours"
            items.append(WorkItem(2, "photograph", str(names[image]), what, severity, hint, images=(int(image),)))
    return items


def _residual_sizes(adjusted: AdjustedBlock) -> np.ndarray:
    """(n,) robust spread of w in each photograph; NaN below `FEWEST_RAYS` rays, which say little."""
    image, w = adjusted.block.image_points.image, adjusted.rays.w
    order = np.argsort(image, kind="stable")
    ends = np.cumsum(np.bincount(image, minlength=len(adjusted.block.images)))
    parts = np.split(w[order], ends[:-1])
    tested = [part[np.isfinite(part).all(axis=1)] for part in parts]
    return np.array([spread(part) if len(part) >= FEWEST_RAYS else np.nan for part in tested])


def _parameters(adjusted: AdjustedBlock) -> list[WorkItem]:
    """Shared parameters that the block cannot tell from one another, or from all others together."""
    p, items, named = adjusted.parameters, [], set()
    r, total = np.abs(np.nan_to_num(p.max_correlation)), np.nan_to_num(p.total_correlation)
    hint = "leave one out, or give it a σ"
    for k in np.argsort(-r, kind="stable"):
        pair = frozenset((str(p.names[k]), str(p.max_correlation_with[k])))
        if r[k] > INSEPARABLE and pair not in named:
            named.add(pair)
            severity = (1.0 - INSEPARABLE) / max(1.0 - r[k], 1e-6)
            what = f"cannot be told apart, correlation {100.0 * p.max_correlation[k]:+.3f} %"
            items.append(WorkItem(2, "parameters", " and ".join(sorted(pair)), what, float(severity), hint))
    told = {name for pair in named for name in pair}
    for k in np.flatnonzero(total > INSEPARABLE):
        if str(p.names[k]) not in told:
            severity = (1.0 - INSEPARABLE) / max(1.0 - total[k], 1e-6)
            what = f"replaceable by the other parameters together, B {100.0 * total[k]:.3f} %"
            items.append(WorkItem(3, "parameters", f"{p.names[k]} ({p.groups[k]})", what, float(severity), hint))
    return items


def _points(adjusted: AdjustedBlock, limits: WorkLimits) -> list[WorkItem]:
    """Points with poor rays: they meet at a small angle, or leave a σ far beyond the usual."""
    points, names = adjusted.points, adjusted.block.points
    angle = np.degrees(intersection_angles(adjusted))
    sigma = points.total_sigma
    there = (points.rays > 0) & np.isfinite(sigma).all(axis=1)
    if not there.any():
        return []
    usual = np.median(sigma[there], axis=0)
    ratio = np.where(there[:, None] & (usual > 0.0), sigma / np.where(usual > 0.0, usual, 1.0), 0.0)
    small = np.where(there, limits.angle_deg / np.maximum(angle, 1e-3), 0.0)
    wide = ratio.max(axis=1) / limits.point_sigma_ratio
    severity = np.fmax(np.nan_to_num(small), wide)
    items = []
    for point in np.flatnonzero(severity > 1.0):
        axis = int(np.argmax(ratio[point]))
        what = f"{points.rays[point]} rays meet at {angle[point]:.1f}°; " if np.isfinite(angle[point]) else "one ray; "
        what += f"σ{'XYZ'[axis]} {sigma[point, axis]:.3f} m, {ratio[point, axis]:.1f} times the median"
        hint = "measure it in photographs farther apart, or do without it"
        own = (int(point),)
        items.append(WorkItem(3, "point", str(names[point]), what, float(severity[point]), hint, points=own))
    return items
