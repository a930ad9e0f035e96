"""What to look at first: places of an adjusted block that an operator should check, the worst ones on top."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aerotri.statistics.adjusted_block import AdjustedBlock
from aerotri.statistics.control_rays import control_ray_rows
from aerotri.statistics.outliers import RayTests, judge_rays, sure_value
from aerotri.statistics.reliability import critical_value
from aerotri.statistics.summarise import INSEPARABLE
from aerotri.statistics.ties import Ties, intersection_angles, photograph_ties

PRIORITIES = ("wrong", "weak", "doubtful")
"""What a priority of 1, 2, 3 means."""

KINDS = (
    "left out", "control", "check point", "control ray", "ray", "observation", "part", "photograph", "parameters",
    "point",
)  # fmt: skip


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
    point_sigma_ratio: float = 8.0
    angle_deg: float = 4.0
    per_kind: int = 10
    items: int = 40


@dataclass(frozen=True)
class WorkItem:
    """Something to look at.

    Parameters
    ----------
    priority : 1 wrong (chance does not explain it), 2 weak (little holds or controls it), 3 doubtful.
    kind : one of `KINDS`. where : names. what : the finding with its numbers. hint : what to do.
    severity : how many times beyond its limit; infinite for what was left out.
    """

    priority: int
    kind: str
    where: str
    what: str
    severity: float
    hint: str


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
        *_ground_coordinates(adjusted, tests.scale),
        *_rays(adjusted, tests),
        *_observations(adjusted, tests.scale),
        *_parts(adjusted, ties, limits),
        *_photographs(adjusted, ties, limits),
        *_parameters(adjusted),
        *_points(adjusted, limits),
    ]
    found.sort(key=lambda item: (item.priority, -item.severity, KINDS.index(item.kind)))
    listed, of_kind = [], Counter()
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
        items.append(WorkItem(1, "left out", str(block.images.names[image]), what, np.inf, hint))
    there = np.concatenate([adjusted.control.point, adjusted.check.point])
    rays = np.bincount(block.image_points.point, minlength=len(block.points))
    for point in np.setdiff1d(block.control.point, there):
        what = f"given coordinates, {rays[point]} ray{'s' * (rays[point] != 1)} measured, not used"
        hint = "measure it" if rays[point] == 0 else "see whether it was switched off, or measure it in another photograph"
        items.append(WorkItem(3, "left out", str(block.points[point]), what, 1.0, hint))
    return items


def _ground_coordinates(adjusted: AdjustedBlock, scale: float) -> list[WorkItem]:
    """Given coordinates of control and check points that contradict the block.

    A control point's w counts in units of the a-priori σ, as does the block it is compared with; a check point's holds
    σ̂0 already.
    """
    items, alpha = [], adjusted.block.settings.adjustment.alpha
    for results, kind, unit, hint in (
        (adjusted.control, "control", max(scale, 1.0), "look at its rays, then at the given coordinate; --check-free"),
        (adjusted.check, "check point", 1.0, "its rays or its coordinates are wrong, or the block is deformed there"),
    ):
        size = np.abs(np.nan_to_num(results.w)) / unit
        limit, sure = critical_value(alpha), sure_value(alpha, int(np.isfinite(results.w).sum()))
        for row, axis in zip(*np.nonzero(size > limit), strict=True):
            d = results.difference[row, axis]
            what = f"{'XYZ'[axis]}: adjusted − given {d:+.3f} m, w {results.w[row, axis]:+.1f}"
            if kind == "control" and results.r[row, axis] > 0.0:
                what += f", given value off by {-d / results.r[row, axis]:+.3f} m"
            priority = 1 if size[row, axis] > sure else 3
            name = str(adjusted.block.points[results.point[row]])
            items.append(WorkItem(priority, kind, name, what, float(size[row, axis] / limit), hint))
    return items


def _rays(adjusted: AdjustedBlock, tests: RayTests) -> list[WorkItem]:
    """Rays with large residuals: of control and check points every one, of a tie point the largest."""
    block = adjusted.block
    rows = tests.order[np.abs(tests.w[tests.order]) > tests.limit]
    is_control = np.zeros(len(block.points), dtype=bool)
    is_control[block.image_points.point[control_ray_rows(adjusted)]] = True
    point_of, seen, items = block.image_points.point, set(), []
    large = np.bincount(point_of[rows], minlength=len(block.points))
    for row in rows:
        point = int(point_of[row])
        if point in seen and not is_control[point]:
            continue
        seen.add(point)
        w, others = abs(tests.w[row]), int(large[point]) - 1
        what = (
            f"w{'xy'[tests.axis[row]]} {tests.w[row]:+.1f}, error {1e3 * tests.estimated_mm[row]:+.1f} µm "
            f"({tests.estimated_px[row]:+.1f} px)" + (f"; {others} more ray{'s' * (others > 1)} of the point" * (others > 0))
        )
        where = f"{block.points[point]} in {block.images.names[block.image_points.image[row]]}"
        kind = "control ray" if is_control[point] else "ray"
        hint = _ray_hint(int(adjusted.points.rays[point]), others, float(adjusted.rays.weight[row]))
        items.append(WorkItem(1 if w > tests.sure else 3, kind, where, what, float(w / tests.limit), hint))
    return items


def _ray_hint(rays: int, others: int, weight: float) -> str:
    down = f"weighted down to {weight:.2f} already; " if weight < 1.0 else ""
    if rays == 2:
        return f"{down}two rays only: the other one may be the wrong one; measure it in a third photograph"
    if others + 1 > rays / 2:
        return f"{down}most rays of the point contradict: measure the whole point again, or rename a confused one"
    return f"{down}measure the ray again, or switch it off in edits.csv"


def _observations(adjusted: AdjustedBlock, scale: float) -> list[WorkItem]:
    """Observed positions, attitudes and conditions that contradict the block."""
    observed = adjusted.observations
    if observed is None:
        return []
    alpha = adjusted.block.settings.adjustment.alpha
    size = np.abs(np.nan_to_num(observed.w)) / max(scale, 1.0)
    limit, sure = critical_value(alpha), sure_value(alpha, int(np.isfinite(observed.w).sum()))
    items = []
    for row in np.flatnonzero(size > limit):
        in_angle = observed.group[row] == "attitudes"
        v = f"{np.degrees(observed.v[row]):+.4f}°" if in_angle else f"{observed.v[row]:+.3f} m"
        what = f"{observed.group[row]} {observed.component[row]}: adjusted − observed {v}, w {observed.w[row]:+.1f}"
        hint = "look at the observation and its σ; at shift and drift where many are listed"
        priority = 1 if size[row] > sure else 3
        items.append(
            WorkItem(priority, "observation", str(observed.label[row]), what, float(size[row] / limit), hint)
        )
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
        items.append(WorkItem(2 if cut.common >= 3 else 1, "part", shown, what, severity, hint))
    return items


def _photographs(adjusted: AdjustedBlock, ties: Ties, limits: WorkLimits) -> list[WorkItem]:
    """Photographs that little holds: few common points, none with any single neighbour, σ beyond the usual."""
    names, sigma = adjusted.block.images.names, adjusted.images.sigma
    groups = {"position": np.linalg.norm(sigma[:, :3], axis=1), "attitude": np.linalg.norm(sigma[:, 3:], axis=1)}
    ratio = {name: size / np.nanmedian(size) for name, size in groups.items() if np.isfinite(size).any()}
    items = []
    for image in np.flatnonzero(adjusted.images.rays > 0):
        shared, strongest, found = int(ties.shared[image]), int(ties.strongest[image]), []
        if shared < limits.shared_points:
            found.append((limits.shared_points / max(shared, 0.5), f"{shared} points in common with all others"))
        if strongest < limits.pair_points:
            other = f", {names[ties.neighbour[image]]}" if strongest else ""
            found.append((limits.pair_points / max(strongest, 0.5), f"{strongest} with the nearest one{other}"))
        for name, values in ratio.items():
            if values[image] > limits.sigma_ratio:
                found.append((values[image] / limits.sigma_ratio, f"σ of the {name} {values[image]:.1f} times the median"))
        if found:
            what = f"{adjusted.images.rays[image]} rays; " + "; ".join(text for _, text in found)
            severity = float(max(size for size, _ in found))
            hint = "measure tie points in it and its neighbours"
            items.append(WorkItem(2, "photograph", str(names[image]), what, severity, hint))
    return items


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
    sigma = points.sigma
    there = (points.rays > 0) & np.isfinite(sigma).all(axis=1)
    if not there.any():
        return []
    ratio = np.where(there[:, None], sigma / np.median(sigma[there], axis=0), 0.0)
    small = np.where(there, limits.angle_deg / np.maximum(angle, 1e-3), 0.0)
    wide = ratio.max(axis=1) / limits.point_sigma_ratio
    severity = np.fmax(np.nan_to_num(small), wide)
    items = []
    for point in np.flatnonzero(severity > 1.0):
        axis = int(np.argmax(ratio[point]))
        what = f"{points.rays[point]} rays meet at {angle[point]:.1f}°; " if np.isfinite(angle[point]) else "one ray; "
        what += f"σ{'XYZ'[axis]} {sigma[point, axis]:.3f} m, {ratio[point, axis]:.1f} times the median"
        hint = "measure it in photographs farther apart, or do without it"
        items.append(WorkItem(3, "point", str(names[point]), what, float(severity[point]), hint))
    return items
