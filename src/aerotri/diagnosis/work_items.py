"""Items of the work list, and those that residuals give: contradictions in rays, control and other observations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.diagnosis.control_rays import control_ray_rows
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import RayTests, pixel_mm_of_rays, sure_value
from aerotri.statistics.reliability import critical_value

PRIORITIES = ("wrong", "weak", "doubtful")
"""What a priority of 1, 2, 3 means."""

KINDS = (
    "left out", "control", "check point", "control ray", "ray", "observation", "part", "photograph", "parameters",
    "point",
)  # fmt: skip

FEWEST_CONTROL_RAYS, SINGLE_PHOTOGRAPHS = 3, 2
"""Control rays that say something of a photograph, and photographs listed one by one [C]: of two rays either may be
wrong; where more photographs err to the same side the cause is a common one."""
CONTROL_HINTS = (
    "look at the photograph's control rays one by one, and at its tie points",
    "control was pointed at otherwise than tie points: another pixel origin, another part of the mark?",
)


@dataclass(frozen=True)
class WorkItem:
    """Something to look at.

    Parameters
    ----------
    priority : 1 wrong (chance does not explain it), 2 weak (little holds or controls it), 3 doubtful.
    kind : one of `KINDS`. where : names. what : the finding with its numbers. hint : what to do.
    severity : how many times beyond its limit; infinite for what was left out.
    points, images : rows of the object points and photographs that it is about.
    """

    priority: int
    kind: str
    where: str
    what: str
    severity: float
    hint: str
    points: tuple[int, ...] = ()
    images: tuple[int, ...] = ()


def residual_items(adjusted: AdjustedBlock, tests: RayTests) -> list[WorkItem]:
    """Items about observations that contradict the block."""
    return [
        *_ground_coordinates(adjusted, tests.scale),
        *_rays(adjusted, tests),
        *_control_of_photographs(adjusted, tests),
        *_observations(adjusted, tests.scale),
    ]


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
            point = int(results.point[row])
            name, severity = str(adjusted.block.points[point]), float(size[row, axis] / limit)
            items.append(WorkItem(priority, kind, name, what, severity, hint, points=(point,)))
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
        axis, error_um = "xy"[tests.axis[row]], 1e3 * tests.estimated_mm[row]
        what = f"w{axis} {tests.w[row]:+.1f}, error {error_um:+.1f} µm ({tests.estimated_px[row]:+.1f} px)"
        if others:
            what += f"; {others} more {'ray' if others == 1 else 'rays'} of the point"
        image = int(block.image_points.image[row])
        where = f"{block.points[point]} in {block.images.names[image]}"
        kind = "control ray" if is_control[point] else "ray"
        hint = _ray_hint(int(adjusted.points.rays[point]), others, float(adjusted.rays.weight[row]))
        priority, severity = 1 if w > tests.sure else 3, float(w / tests.limit)
        items.append(WorkItem(priority, kind, where, what, severity, hint, (point,), (image,)))
    return items


def _ray_hint(rays: int, others: int, weight: float) -> str:
    down = f"weighted down to {weight:.2f} already; " if weight < 1.0 else ""
    if rays == 1:
        return f"{down}its only ray: an error of the given coordinates looks the same"
    if rays == 2:
        return f"{down}two rays only: the other one may be the wrong one; measure it in a third photograph"
    if others + 1 > rays / 2:
        return f"{down}most rays of the point contradict: measure the whole point again, or rename a confused one"
    return f"{down}measure the ray again, or switch it off in edits.csv"


def _control_of_photographs(adjusted: AdjustedBlock, tests: RayTests) -> list[WorkItem]:
    """Photographs whose control rays err to one side: no single one need stand out."""
    block, rows = adjusted.block, control_ray_rows(adjusted)
    rows = rows[np.isfinite(adjusted.rays.w[rows]).all(axis=1)]
    image = block.image_points.image[rows]
    n = len(block.images)
    count = np.bincount(image, minlength=n)
    limit, items = sure_value(block.settings.adjustment.alpha, 2 * n) * tests.scale, []
    v_px = adjusted.rays.v[rows] / pixel_mm_of_rays(block)[rows, None]
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        total = sign * np.bincount(image, adjusted.rays.w[rows, axis], n) / np.sqrt(np.maximum(count, 1))
        found = np.flatnonzero((count >= FEWEST_CONTROL_RAYS) & (total > limit))
        together = [found] if len(found) > SINGLE_PHOTOGRAPHS else found[:, None]
        for photographs in together:
            own = np.isin(image, photographs)
            mean = float(np.mean(v_px[own, axis]))
            what = f"control rays off by {-mean:+.1f} px in {'xy'[axis]} on average of {own.sum()}"
            names = [str(name) for name in block.images.names[photographs]]
            where = names[0] if len(names) == 1 else f"{len(names)} photographs ({', '.join(names[:3])}, …)"
            severity = float(total[photographs].max() / limit)
            hint, own = CONTROL_HINTS[len(names) > 1], tuple(photographs.tolist())
            items.append(WorkItem(1, "control ray", where, what, severity, hint, images=own))
    return items


def _observations(adjusted: AdjustedBlock, scale: float) -> list[WorkItem]:
    """Observed positions, attitudes and conditions that contradict the block."""
    observed = adjusted.observations
    if observed is None:
        return []
    alpha = adjusted.block.settings.adjustment.alpha
    size = np.abs(np.nan_to_num(observed.w)) / max(scale, 1.0)
    limit, sure = critical_value(alpha), sure_value(alpha, int(np.isfinite(observed.w).sum()))
    photographs = {str(name): row for row, name in enumerate(adjusted.block.images.names)}
    items = []
    for row in np.flatnonzero(size > limit):
        in_angle = observed.group[row] == "attitudes"
        v = f"{np.degrees(observed.v[row]):+.4f}°" if in_angle else f"{observed.v[row]:+.3f} m"
        what = f"{observed.group[row]} {observed.component[row]}: adjusted − observed {v}, w {observed.w[row]:+.1f}"
        hint = "look at the observation and its σ; at shift and drift where many are listed"
        priority = 1 if size[row] > sure else 3
        label, severity = str(observed.label[row]), float(size[row] / limit)
        own = (photographs[label],) if observed.group[row] != "constraints" and label in photographs else ()
        items.append(WorkItem(priority, "observation", label, what, severity, hint, images=own))
    return items
