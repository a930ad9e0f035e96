"""Matches between neighbouring photographs: mutual best descriptors that pass the ratio test, verified by geometry.

[L] Descriptors are compared as RootSIFT (Arandjelović and Zisserman 2012); a match has to be the best in both
directions, and clearly better than the second best in both (Lowe 2004). What one epipolar geometry or one homography
explains is kept (COLMAP's two-view estimation). The largest features of two photographs are compared first, all with
all; where these fit one geometry, the others are compared only with those near where it puts them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.formats.files.atomic import atomic_file
from aerotri.observations import Camera
from aerotri.tie_points import _kernels
from aerotri.tie_points.features import Features
from aerotri.tie_points.first_orientation import pinhole, two_view_inliers
from aerotri.tie_points.settings import DEFAULTS

ROWS = 1024
"""Descriptors compared at a time."""
FIRST_LOOK, FEWEST_AT_FIRST = 2000, 6
"""Pairs whose first features, so many of each, have fewer matches than this are taken as apart (Wu 2013)."""
SAME_DISTANCE = 1e-6
"""Relative difference of two distances below which rounding decides which is the longer."""
CELLS, ROOM, NEAR = 8, 2.0, 0.2
"""Cells along the longer side of a photograph whose features are compared at a time; room around where they should be,
in distances of sure matches, and in cells."""
Report = Callable[[int, int], None]
Windows = Iterable[tuple[np.ndarray, np.ndarray]]
"""Rows of one photograph, and of the other, that are compared with each other."""


@dataclass(frozen=True)
class MatchOptions:
    """How matches are sought.

    Parameters
    ----------
    neighbours : photographs nearest to each that it is compared with.
    ratio : distance of the best over that of the second best descriptor, at most.
    tolerance_px : of the geometry, in pixels of the photograph features were sought in; what the lens of an unknown
        camera does has to find room in it.
    fewest : matches without which two photographs are not tied.
    seed : of random sampling.
    """

    neighbours: int = DEFAULTS.neighbours
    ratio: float = 0.8
    tolerance_px: float = 4.0
    fewest: int = 15
    seed: int = 1


@dataclass(frozen=True, eq=False)
class PairMatches:
    """Verified matches of two photographs: (m, 2) features of the first and of the second."""

    first: int
    second: int
    matches: np.ndarray


def neighbours(position: np.ndarray, count: int) -> list[tuple[int, int]]:
    """Pairs of photographs to compare, each with the `count` nearest to it in plan.

    Of photographs equally far away, as on the grid of a flight plan, those that come first are taken.

    Parameters
    ----------
    position : (n, 2) or (n, 3) m; NaN where not known: such a photograph is compared with every other.
    """
    known = np.isfinite(position[:, :2]).all(axis=1)
    pairs = {(min(i, j), max(i, j)) for i in np.flatnonzero(~known).tolist() for j in range(len(position)) if i != j}
    rows = np.flatnonzero(known)
    if len(rows) > 1:
        from scipy.spatial import KDTree

        # twice as many and a few: among these are those as far away as the last
        asked = min(2 * count + 8, len(rows))
        distance, nearest = KDTree(position[rows, :2]).query(position[rows, :2], asked)
        for number, (far, near) in enumerate(zip(np.atleast_2d(distance), np.atleast_2d(nearest), strict=True)):
            own = _first_of_equal(far[near != number], near[near != number], count)
            pairs |= {(min(i, j), max(i, j)) for i, j in ((int(rows[number]), int(rows[k])) for k in own)}
    return sorted(pairs)


def _first_of_equal(distance: np.ndarray, index: np.ndarray, count: int) -> np.ndarray:
    """The `count` nearest; of those as far away as the last, the ones with the smallest index.

    Parameters
    ----------
    distance, index : (k,) the distance ascending.
    """
    if len(index) <= count:
        return index
    last = distance[count - 1]
    nearer = index[distance < last * (1.0 - SAME_DISTANCE)]
    equal = np.sort(index[np.abs(distance - last) <= last * SAME_DISTANCE])
    return np.concatenate([nearer, equal[: count - len(nearer)]])


def match_all(
    features: Sequence[Features],
    cameras: Sequence[Camera],
    names: np.ndarray,
    pairs: list[tuple[int, int]],
    options: MatchOptions,
    cache: Path,
    report: Report = lambda done, count: None,
) -> list[PairMatches]:
    """Verified matches of all pairs, from `cache` where they are there already; those with too few are left out.

    Parameters
    ----------
    features, cameras : of every photograph. names : (n,) str. report : called with pairs done and their number.
    """
    found, done = [], 0
    for first in sorted({i for i, _ in pairs}):
        seconds = [j for i, j in pairs if i == first]
        matches = matches_of(
            (first, seconds), features, cameras, options, cache / f"{names[first]}.npz",
            lambda number, done=done: report(done + number, len(pairs)),
        )  # fmt: skip
        done += len(seconds)
        found += [
            PairMatches(first, j, result)
            for j, result in zip(seconds, matches, strict=True)
            if len(result) >= options.fewest
        ]
    return found


def matches_of(
    photographs: tuple[int, Sequence[int]],
    features: Mapping[int, Features] | Sequence[Features],
    cameras: Sequence[Camera],
    options: MatchOptions,
    kept: Path,
    report: Callable[[int], None] = lambda done: None,
) -> list[np.ndarray]:
    """(m, 2) verified matches of a photograph with each of some others, from a file where they are there already.

    Parameters
    ----------
    photographs : the first, and the others. features, cameras : by photograph. kept : the file.
    report : called with the number of pairs that are done.
    """
    from threadpoolctl import threadpool_limits

    first, seconds = photographs
    keys = {j: _key(features[first], features[j], cameras[first], cameras[j], options) for j in seconds}
    known = _kept(kept, {keys[j]: (len(features[first].xy), len(features[j].xy)) for j in seconds})

    def one(j: int) -> np.ndarray:
        old = known.get(keys[j])
        return _match(features[first], features[j], (cameras[first], cameras[j]), options) if old is None else old

    out: list[np.ndarray] = []
    # threads within threads would wait for one another
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(thread_count()) as pool:
        for result in pool.map(one, seconds):
            out.append(result)
            report(len(out))
    if any(key not in known for key in keys.values()):
        _keep(kept, {keys[j]: result for j, result in zip(seconds, out, strict=True)})
    return out


def _match(one: Features, other: Features, cameras: tuple[Camera, Camera], options: MatchOptions) -> np.ndarray:
    look = mutual_matches(one.descriptors[:FIRST_LOOK], other.descriptors[:FIRST_LOOK], options.ratio)
    if len(look) < FEWEST_AT_FIRST:
        return np.zeros((0, 2), np.int64)
    sure = _verified(one, other, cameras, look, options)
    if len(sure):
        windows = windows_of((one.xy, other.xy), sure)
        candidates = mutual_matches(one.descriptors, other.descriptors, options.ratio, windows)
    else:
        candidates = mutual_matches(one.descriptors, other.descriptors, options.ratio)
    return _verified(one, other, cameras, candidates, options)


def _verified(
    one: Features, other: Features, cameras: tuple[Camera, Camera], matches: np.ndarray, options: MatchOptions
) -> np.ndarray:
    """The matches (m, 2) that one geometry explains, none where they are too few."""
    if len(matches) < options.fewest:
        return np.zeros((0, 2), np.int64)
    tolerance = options.tolerance_px * 2.0 * max(one.sigma_px, other.sigma_px)
    xy = one.xy[matches[:, 0]], other.xy[matches[:, 1]]
    pinholes = pinhole(cameras[0]), pinhole(cameras[1])
    return matches[two_view_inliers(pinholes, xy, tolerance, options.fewest, options.seed)]


def mutual_matches(one: np.ndarray, other: np.ndarray, ratio: float, windows: Windows | None = None) -> np.ndarray:
    """(m, 2) rows of descriptors (n1, 128) and (n2, 128) that are each other's best and pass the ratio test.

    Parameters
    ----------
    windows : rows of the first and those of the second that may be their partners; all with all where None.
    """
    a, b = _root(one), _root(other)
    best, two = np.full(len(a), -1, np.int64), np.full((len(a), 2), -1.0, np.float32)
    column_best, column_two = np.full(len(b), -1, np.int64), np.full((len(b), 2), -1.0, np.float32)
    for rows, columns in _all_with_all(len(a), len(b)) if windows is None else windows:
        similarity = a[rows] @ (b.T if len(columns) == len(b) else b[columns].T)
        _kernels.two_best(similarity, rows, columns, best, two, column_best, column_two)
    rows = np.flatnonzero(_clear(two, ratio) & (best >= 0))
    rows = rows[_clear(column_two, ratio)[best[rows]] & (column_best[best[rows]] == rows)]
    return np.column_stack([rows, best[rows]])


def _all_with_all(rows: int, columns: int) -> Windows:
    every = np.arange(columns)
    return ((np.arange(first, min(first + ROWS, rows)), every) for first in range(0, rows, ROWS))


def windows_of(xy: tuple[np.ndarray, np.ndarray], sure: np.ndarray) -> Windows:
    """Where partners may be, from matches that are sure: cell by cell of the first photograph.

    A plane carries the cell over; around it there is room for twice what sure matches lie off that plane, for ground
    may be higher or lower than where it was matched.

    Parameters
    ----------
    xy : (n1, 2) and (n2, 2) px of the features. sure : (m, 2) rows of matches.
    """
    plane = fitted_plane(xy[0][sure[:, 0]], xy[1][sure[:, 1]])
    off = np.abs(carried(plane, xy[0][sure[:, 0]]) - xy[1][sure[:, 1]]).max(axis=0)
    size = xy[0].max() / CELLS
    room = ROOM * off + NEAR * size
    there = carried(plane, xy[0])
    cell = (xy[0] / size).astype(np.int64) @ np.array([1, CELLS + 1])
    order = np.argsort(cell, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(cell[order])) + 1):
        low, high = there[rows].min(axis=0) - room, there[rows].max(axis=0) + room
        columns = np.flatnonzero(((xy[1] >= low) & (xy[1] <= high)).all(axis=1))
        if len(columns) > 1:
            yield rows, columns


def fitted_plane(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(3, 3) the affine transformation of (m, 2) px to (m, 2) px by least squares."""
    design = np.column_stack([one, np.ones(len(one))]).astype(float)
    return np.linalg.lstsq(design, other.astype(float), rcond=None)[0]


def carried(plane: np.ndarray, xy: np.ndarray) -> np.ndarray:
    return xy @ plane[:2] + plane[2]


def _root(descriptors: np.ndarray) -> np.ndarray:
    """RootSIFT: (n, 128) float32 of length 1."""
    values = descriptors.astype(np.float32)
    return np.sqrt(values / np.maximum(values.sum(axis=1, keepdims=True), 1.0))


def _clear(two: np.ndarray, ratio: float) -> np.ndarray:
    """(n,) bool: the distance of the best is less than `ratio` times that of the second best; d² = 2 − 2s."""
    return (1.0 - two[:, 0]) < ratio**2 * (1.0 - two[:, 1])


def _key(one: Features, other: Features, first: Camera, second: Camera, options: MatchOptions) -> str:
    geometry = [(camera.focal_length_mm / camera.pixel_mm, camera.principal_point_mm) for camera in (first, second)]
    settings = (options.ratio, options.tolerance_px, options.fewest, options.seed, FIRST_LOOK, CELLS, ROOM, NEAR)
    return "k" + hashlib.sha256(repr((one.key, other.key, geometry, settings)).encode()).hexdigest()


def _kept(path: Path, sizes: Mapping[str, tuple[int, int]]) -> dict[str, np.ndarray]:
    """Matches from disk by their key; those that name features there are not are left out.

    Parameters
    ----------
    sizes : numbers of features of the two photographs, by key.
    """
    from aerotri.formats.files.npz import read_kept

    found = {}
    for key, size in sizes.items():
        kept = read_kept(path, {key: ("i", (None, 2))}) if path.is_file() else None
        if kept is not None and ((kept[key] >= 0) & (kept[key] < np.array(size))).all():
            found[key] = kept[key]
    return found


def _keep(path: Path, found: dict[str, np.ndarray]) -> None:
    with atomic_file(path) as place, place.open("wb") as file:
        arrays: dict[str, Any] = {key: matches.astype(np.int32) for key, matches in found.items()}
        np.savez(file, **arrays)
