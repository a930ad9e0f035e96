"""Points measured in all photographs that show them, by least squares against a window of one of them [L] (Förstner
1982, Grün 1985).

A feature lies where a scale space has its extremum, to some tenths of a pixel. Once photographs are oriented, windows
tell it better: of the photographs of a point the one that has it nearest to its middle is the reference. The point is
the middle of the pixel there, and the window around it is sought wherever the orientation puts the point: in
photographs with a feature of it and in those without. Points whose windows are not found keep their features.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.conventions import px_from_mm
from aerotri.functional_model.collinearity import interior_row, predict
from aerotri.memory import fitting
from aerotri.observations import Camera
from aerotri.tie_points import _window_kernels as kernels
from aerotri.tie_points.features import grey_8bit
from aerotri.tie_points.tracks import Measured, Tracks, tracks_of

RIM = kernels.HALF + 1
"""Pixels of a window with what its slopes need, on either side of its middle."""
BROWN_ROUNDS = 5
"""Brown's errors belong to the measured position, which is sought."""
REACH_KNOWN, REACH_PREDICTED = 2.0, 4.0
"""Pixels that a window may lie from a feature, and from where the orientation alone puts it [C]: beyond, least squares
finds other texture."""
LEAST_CORRELATION = 0.7
"""Of windows that show the same [C]: by 0.8 there are a tenth fewer, and their residuals are 2 % smaller."""
LARGEST_SIGMA_PX = 0.2
"""σ of a place by least squares, at most [C]: windows with more have next to no texture."""
SIGMA_PX = 0.25
"""A-priori standard deviation of a coordinate, in pixels of the photograph [C]: it counts beside that of features, for
the misfit of all sets their common size."""
STEP_PX = 5.0
"""Pixels of the reference over which slopes are taken."""


@dataclass(frozen=True, eq=False)
class View:
    """Oriented photographs, n of them.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3) camera → object; NaN where not oriented.
    cameras : the cameras; camera : (n,) index into them. paths : of the files.
    """

    centre: np.ndarray
    rotation: np.ndarray
    cameras: tuple[Camera, ...]
    camera: np.ndarray
    paths: Sequence[Path]

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def size_px(self) -> np.ndarray:
        """(n, 2) columns and rows."""
        return np.array([self.cameras[c].size_px for c in self.camera.tolist()], dtype=float)

    def projected(self, number: int, points: np.ndarray) -> np.ndarray:
        """(k, 2) px of points (k, 3) in a photograph; NaN behind it."""
        camera = self.cameras[self.camera[number]]
        zero, every, xy = np.zeros(len(points), np.int64), np.arange(len(points)), np.zeros((len(points), 2))
        pose = self.rotation[number][None], self.centre[number][None]
        for _ in range(BROWN_ROUNDS if camera.brown else 1):
            xy = predict(*pose, points, interior_row(camera)[None], zero, every, zero, xy)
        xy[~((points - self.centre[number]) @ self.rotation[number][:, 2] < 0.0)] = np.nan
        return px_from_mm(xy, camera.size_px, camera.pixel_mm)

    def planes_in(self, number: int, planes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, 2) px of points, and (k, 2, 2) px of the steps from them, of planes as `References` has them."""
        corners = planes + np.array([0.0, 1.0, 1.0])[:, None] * planes[:, :1]
        px = self.projected(number, corners.reshape(-1, 3)).reshape(-1, 3, 2)
        return px[:, 0], np.swapaxes(px[:, 1:] - px[:, :1], 1, 2)


@dataclass(frozen=True, eq=False)
class References:
    """The windows of points, N of them.

    Parameters
    ----------
    image : (N,) the photograph, −1 for points without. ray : (N,) their ray there.
    middle : (N, 2) px. planes : (N, 3, 3) m, the point and two steps from it in a plane that faces the photographs.
    slope : (N, 2, 2) px of these steps. windows : (N, n, n) uint8.
    """

    image: np.ndarray
    ray: np.ndarray
    middle: np.ndarray
    planes: np.ndarray
    slope: np.ndarray
    windows: np.ndarray


def measured_by_windows(
    view: View, tracks: Tracks, measured: Measured, points: np.ndarray, report: Callable[[int], None]
) -> tuple[Tracks, Measured]:
    """Tracks with their rays measured by windows, and with more rays.

    Parameters
    ----------
    tracks, measured : of features. points : (t, 3) m, where their rays meet; NaN where not known.
    report : called with the photographs that are done.
    """
    greys, (xy, _) = _Greys(view), measured.of(tracks)
    chosen = _references(view, tracks, xy, points)
    common = _with_points_in_common(tracks, len(view))

    def read(number: int) -> None:
        _read_windows(view, number, chosen, greys)

    def find(number: int) -> tuple[np.ndarray, np.ndarray]:
        return _found_in(view, number, (tracks, xy), chosen, (common[:, number], greys))

    found: list[tuple[np.ndarray, np.ndarray]] = []
    with ThreadPoolExecutor(thread_count()) as pool:
        list(pool.map(read, range(len(view))))
        for part in pool.map(find, range(len(view))):
            found.append(part)
            report(len(found))
    return _joined(tracks, measured, found)


def _joined(tracks: Tracks, measured: Measured, found: list[tuple[np.ndarray, np.ndarray]]) -> tuple[Tracks, Measured]:
    """Tracks of the windows found in every photograph; of points with fewer than two, those of the features."""
    image = np.repeat(np.arange(len(found)), [len(point) for point, _ in found])
    point, place = (np.concatenate([part[k] for part in found]) for k in (0, 1))
    held = np.bincount(point, minlength=len(tracks)) > 1
    own, other = held[point], ~held[tracks.of_ray]
    xy, sigma = measured.of(tracks)
    return tracks_of(
        np.concatenate([point[own], tracks.of_ray[other]]),
        np.concatenate([image[own], tracks.image[other]]),
        Measured(
            np.concatenate([place[own], xy[other]]),
            np.concatenate([np.full(int(own.sum()), SIGMA_PX), sigma[other]]),
        ),
    )


class _Greys:
    """Grey values of photographs; all are kept where they fit into half of the memory."""

    def __init__(self, view: View):
        self._paths, self._kept = view.paths, dict[int, np.ndarray]()
        self._keep = fitting(float(view.size_px.prod(axis=1).max())) > 2 * len(view)

    def __call__(self, number: int) -> np.ndarray:
        if number in self._kept:
            return self._kept[number]
        grey = grey_8bit(self._paths[number])
        if self._keep:
            self._kept[number] = grey
        return grey


def _with_points_in_common(tracks: Tracks, images: int) -> np.ndarray:
    """(n, n) bool, photographs that have tracks in common."""
    from scipy.sparse import csr_array

    ones = np.ones(len(tracks.image), np.int32)
    shown = csr_array((ones, (tracks.of_ray, tracks.image)), shape=(len(tracks), images))
    return (shown.T @ shown).toarray() > 0


def _references(view: View, tracks: Tracks, xy: np.ndarray, points: np.ndarray) -> References:
    """The reference of every point, its windows not yet read."""
    size, of_ray = view.size_px[tracks.image], tracks.of_ray
    inside = ((xy >= RIM + 1.0) & (xy <= size - RIM - 1.0)).all(axis=1)
    inside &= np.isfinite(points[of_ray]).all(axis=1) & np.isfinite(view.centre[tracks.image, 0])
    off = np.where(inside, np.linalg.norm(xy / size - 0.5, axis=1), np.inf)
    first = np.lexsort((tracks.image, off, of_ray))[tracks.start[:-1]]
    good, side = inside[first], kernels.SIDE + 2
    image = np.where(good, tracks.image[first], -1)
    return References(
        image, np.where(good, first, -1), np.floor(xy[first]) + 0.5, _planes(view, tracks, points, image),
        np.full((len(tracks), 2, 2), np.nan), np.zeros((len(tracks), side, side), np.uint8),
    )  # fmt: skip


def _planes(view: View, tracks: Tracks, points: np.ndarray, image: np.ndarray) -> np.ndarray:
    """(t, 3, 3) points, and steps of some pixels of the reference across the mean axis of their photographs."""
    axis = np.zeros((len(points), 3))
    np.add.at(axis, tracks.of_ray, np.nan_to_num(view.rotation[tracks.image][:, :, 2]))
    one = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])
    other = np.cross(axis, one)
    pixel = np.array([camera.pixel_mm / camera.focal_length_mm for camera in view.cameras])[view.camera[image]]
    step = STEP_PX * pixel * np.linalg.norm(points - view.centre[image], axis=1)
    length = [np.maximum(np.linalg.norm(v, axis=1), 1e-12) for v in (one, other)]
    return np.stack([points, one * (step / length[0])[:, None], other * (step / length[1])[:, None]], axis=1)


def _read_windows(view: View, number: int, chosen: References, greys: _Greys) -> None:
    """Windows and slopes of the points of which a photograph is the reference."""
    own = np.flatnonzero(chosen.image == number)
    if not len(own):
        return
    chosen.slope[own] = view.planes_in(number, chosen.planes[own])[1]
    side = chosen.windows.shape[1:]
    column, row = (np.floor(chosen.middle[own]).astype(np.int64) - RIM).T
    chosen.windows[own] = np.lib.stride_tricks.sliding_window_view(greys(number), side)[row, column]


def _found_in(
    view: View, number: int, features: tuple[Tracks, np.ndarray], chosen: References,
    among: tuple[np.ndarray, _Greys],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Points (k,) and px (k, 2) of the windows in a photograph, its own among them."""
    (tracks, xy), (partners, greys) = features, among
    own = np.flatnonzero(chosen.image == number)
    if np.isnan(view.centre[number, 0]):
        return own, chosen.middle[own]
    there = np.flatnonzero(tracks.image == number)
    ray = np.full(len(tracks), -1)
    ray[tracks.of_ray[there]] = there
    point = np.flatnonzero((chosen.image >= 0) & (chosen.image != number) & partners[chosen.image])
    place, slope = view.planes_in(number, chosen.planes[point])
    with np.errstate(all="ignore"):
        slope = slope @ _inverse(chosen.slope[point])
    known = ray[point] >= 0
    moved = chosen.middle[point] - xy[chosen.ray[point]]
    place[known] = (xy[ray[point]] + np.einsum("kij,kj->ki", slope, moved))[known]
    inside = np.isfinite(slope).all(axis=(1, 2))
    inside &= ((place > RIM) & (place < view.size_px[number] - RIM)).all(axis=1)
    point, place, slope, known = point[inside], place[inside], slope[inside], known[inside]
    told = np.full((len(point), 2), np.nan)
    reach = np.where(known, REACH_KNOWN, REACH_PREDICTED)
    kernels.match_windows(greys(number), chosen.windows, point, reach, place, slope, told)
    good = (told[:, 0] >= LEAST_CORRELATION) & (told[:, 1] <= LARGEST_SIGMA_PX)
    return np.concatenate([own, point[good]]), np.concatenate([chosen.middle[own], place[good]])


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """(k, 2, 2) by cofactors: of a singular one ∞ or NaN, no error."""
    a, b, c, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]
    return np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2) / (a * d - b * c)[:, None, None]
