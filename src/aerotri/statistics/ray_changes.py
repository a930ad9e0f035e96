"""Which rays two adjustments of a block use differently: come, gone, switched, measured anew, weighted anew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.results.adjusted_block import AdjustedBlock

SAME_PLACE_MM = 1e-4
"""Image coordinates closer than this are the same measurement."""

STRONGLY = 2.0
"""Factor by which the weight of a ray has to change to be named."""

LISTED = 1000
"""Rays of one kind that are named [C]: more than anybody reads; all are counted."""
KINDS = ("added", "gone", "switched", "measured anew", "weighted anew")


@dataclass(frozen=True)
class RayChange:
    """A ray that the two runs use differently; `kind` is one of `KINDS`, `first` and `second` say how."""

    kind: str
    image: str
    point: str
    first: str
    second: str


@dataclass(frozen=True)
class RayChanges:
    """How many rays changed, by kind, and the first `LISTED` of each kind."""

    counts: Mapping[str, int]
    listed: tuple[RayChange, ...]


def rows_in_common(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of `first` and of `second` that hold the same name, in the order of `second`; names do not repeat."""
    _, i, j = np.intersect1d(np.asarray(first, dtype=str), np.asarray(second, dtype=str), return_indices=True)
    order = np.argsort(j)
    return i[order], j[order]


def compare_rays(first: AdjustedBlock, second: AdjustedBlock) -> RayChanges:
    """Compare the rays of two runs, matched by the names of photograph and point."""
    key_one, key_two = _keys(first, second)
    _, i, j = np.intersect1d(key_one, key_two, return_indices=True)
    order = np.argsort(j)
    i, j = i[order], j[order]
    status_one, status_two = _status(first)[i], _status(second)[j]
    used = (status_one == "used") & (status_two == "used")
    apart = np.linalg.norm(second.block.image_points.xy[j] - first.block.image_points.xy[i], axis=1)
    weight_one, weight_two = _weight(first)[i], _weight(second)[j]
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.abs(np.log(weight_two / weight_one))
    switched = status_one != status_two
    moved = apart > SAME_PLACE_MM
    weighted = used & (factor > np.log(STRONGLY))
    only_one, only_two = np.setdiff1d(np.arange(len(key_one)), i), np.setdiff1d(np.arange(len(key_two)), j)
    place = [f"{d * 1e3:.1f} µm away" for d in apart[moved]]
    text_one = [f"weight {w:.3g}" for w in weight_one[weighted] / np.median(weight_one[used])] if used.any() else []
    text_two = [f"weight {w:.3g}" for w in weight_two[weighted] / np.median(weight_one[used])] if used.any() else []
    found = {
        "added": (second, only_two, [""] * len(only_two), _status(second)[only_two]),
        "gone": (first, only_one, _status(first)[only_one], [""] * len(only_one)),
        "switched": (second, j[switched], status_one[switched], status_two[switched]),
        "measured anew": (second, j[moved], [""] * int(moved.sum()), place),
        "weighted anew": (second, j[weighted], text_one, text_two),
    }
    listed = [change for kind, what in found.items() for change in _listed(kind, *what)]
    return RayChanges({kind: len(what[1]) for kind, what in found.items()}, tuple(listed))


def _keys(first: AdjustedBlock, second: AdjustedBlock) -> tuple[np.ndarray, np.ndarray]:
    """A number for every ray of both runs, the same for rays of the same photograph and point."""
    images = _codes(first.block.images.names, second.block.images.names)
    points = _codes(first.block.points, second.block.points)
    n_points = len(first.block.points) + len(second.block.points)
    rays = (first.block.image_points, second.block.image_points)
    one, two = (
        i[r.image].astype(np.int64) * n_points + p[r.point] for i, p, r in zip(images, points, rays, strict=True)
    )
    return one, two


def _codes(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    together = np.concatenate([np.asarray(first, dtype=str), np.asarray(second, dtype=str)])
    code = np.unique(together, return_inverse=True)[1]
    return code[: len(first)], code[len(first) :]


def _status(run: AdjustedBlock) -> np.ndarray:
    return np.array(RAY_STATUS)[run.rays.status]


def _weight(run: AdjustedBlock) -> np.ndarray:
    """(m,) 1/mm², robust factor over the a-priori variance."""
    return run.rays.weight / np.prod(run.block.image_points.sigma, axis=1)


def _listed(
    kind: str,
    run: AdjustedBlock,
    rows: np.ndarray,
    first: Sequence[str] | np.ndarray,
    second: Sequence[str] | np.ndarray,
) -> list[RayChange]:
    block = run.block
    return [
        RayChange(
            kind,
            str(block.images.names[block.image_points.image[row]]),
            str(block.points[block.image_points.point[row]]),
            str(a),
            str(b),
        )
        for row, a, b in list(zip(rows, first, second, strict=True))[:LISTED]
    ]
