"""The image errors of a group for other programs: a correction grid, the ideal camera, and the nearest lens.

Sign throughout: measured = ideal + d, corrected = measured − d.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from aerotri.conventions import mm_from_px
from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.image_errors.error_function import ErrorFunction
from aerotri.image_errors.tile_grid import seams_px
from aerotri.observations import Camera, Prior
from aerotri.observations.block import BROWN_NAMES, INTERIOR_ELEMENTS

NODE_SPACING = 1.0 / 40.0
"""Largest distance of two nodes of the correction table, in units of the longer side of the format."""
CELLS = 230
"""Cells of the correction raster along the longer side of the format."""
INSIDE_PX = 1e-6
"""By which places on the edge of a tile or of the format are moved into it [C]: far above rounding, far below any
effect."""
OPENCV_ITEMS = ("k1", "k2", "p1", "p2")
FIT_GRID = (93, 61)
"""Places across and along to which a lens is fitted [C]: square cells in a format of 3 : 2, hundreds of times more
places than parameters."""
BROWN_ROUNDS = 3
"""Linear fits, each about the principal point of the one before [C]: it moves by little, so that few are needed."""


@dataclass(frozen=True, eq=False)
class CorrectionNodes:
    """Nodes of all tiles, n of them; those on a seam stand there once for either side.

    Parameters
    ----------
    tile : (n,) number of the tile, row by row from the upper left, from 0.
    column_row : (n, 2) px. xy : (n, 2) mm from the image centre.
    """

    tile: np.ndarray
    column_row: np.ndarray
    xy: np.ndarray


@dataclass(frozen=True, eq=False)
class NearestLens:
    """The camera of a simpler model that comes nearest to a group's camera with all its errors.

    Parameters
    ----------
    model : 'OPENCV' or 'brown'.
    camera : with lens and affinity, or with Brown's parameters.
    rms_mm, max_mm : length of what the model leaves in the image, RMS and longest.
    """

    model: str
    camera: Camera
    rms_mm: float
    max_mm: float


def ideal_camera(errors: ErrorFunction) -> Camera:
    """The camera of the ideal photographs: principal distance and point as adjusted, no errors."""
    interior = {
        name: Prior(float(value), fixed=True) for name, value in zip(INTERIOR_ELEMENTS, errors.interior, strict=True)
    }
    return replace(
        errors.camera, interior=interior, brown={}, lens={}, parameters={}, fiducials={}, interior_orientation=None
    )  # fmt: skip


def correction_nodes(camera: Camera) -> CorrectionNodes:
    """Nodes that cover every tile to its edges, so that nobody has to interpolate across a seam."""
    spacing = NODE_SPACING * max(camera.size_px)
    places = []
    for seams, count in zip(seams_px(camera), camera.size_px, strict=True):
        edges = pairwise([0.0, *seams.tolist(), float(count)])
        places.append([np.linspace(a, b, int(np.ceil((b - a) / spacing)) + 1) for a, b in edges])
    tile, nodes = [], []
    for i, rows in enumerate(places[1]):
        for j, columns in enumerate(places[0]):
            own = np.stack(np.meshgrid(_inside(columns), _inside(rows)), axis=-1).reshape(-1, 2)
            nodes.append(own)
            tile.append(np.full(len(own), i * len(places[0]) + j))
    column_row = np.concatenate(nodes)
    return CorrectionNodes(
        np.concatenate(tile), column_row, mm_from_px(column_row, camera.size_px, camera.pixel_mm)
    )  # fmt: skip


def _inside(places: np.ndarray) -> np.ndarray:
    moved = places.copy()
    moved[0] += INSIDE_PX
    moved[-1] -= INSIDE_PX
    return moved


def correction_raster(errors: ErrorFunction) -> tuple[np.ndarray, int]:
    """d at the centres of square cells from the upper left corner of the image on.

    Returns
    -------
    (2, rows, columns) mm, dx and dy; and the size of a cell in pixels.
    """
    camera = errors.camera
    cell = max(round(max(camera.size_px) / CELLS), 1)
    columns, rows = (np.minimum(np.arange(0, n, cell) + cell / 2.0, n - INSIDE_PX) for n in camera.size_px)
    nodes = np.stack(np.meshgrid(columns, rows), axis=-1)
    d = errors.of_measured(mm_from_px(nodes.reshape(-1, 2), camera.size_px, camera.pixel_mm))
    return np.moveaxis(d.reshape(nodes.shape), -1, 0), cell


def nearest_opencv(errors: ErrorFunction) -> NearestLens:
    """The nearest camera with OpenCV's k1, k2, p1, p2 and two focal lengths, all of them and the principal point free.

    It stands in place of the adjusted camera with the orientations as they are. An affinity b1 of Brown's makes the two
    focal lengths, see `formats.colmap`.
    """
    from scipy.optimize import least_squares

    measured, direction = _directions(errors)

    def residuals(p: np.ndarray) -> np.ndarray:
        bent = lens.distort(direction[:, 0], direction[:, 1], lens.vector(dict(zip(OPENCV_ITEMS, p[4:], strict=True))))
        return (bent * p[:2] + p[2:4] - measured).ravel()

    c, x0, y0 = errors.interior
    found = least_squares(residuals, np.array([c, c, x0, y0, *errors.lens[:4]]), x_scale="jac", xtol=1e-12, ftol=1e-12)
    fx, fy = found.x[:2]
    camera = replace(
        ideal_camera(errors),
        interior=_held(INTERIOR_ELEMENTS, (fy, *found.x[2:4])),
        lens=_held(OPENCV_ITEMS, found.x[4:]),
        brown=_held(("b1",), (fy / fx - 1.0,)),
    )
    return NearestLens("OPENCV", camera, *_lengths(found.fun.reshape(-1, 2)))


def nearest_brown(errors: ErrorFunction) -> NearestLens:
    """The nearest camera with Brown's parameters, all of them and the interior orientation free."""
    measured, direction = _directions(errors)
    interior, values, left = errors.interior, np.zeros(len(BROWN_NAMES)), np.zeros_like(measured)
    one, zero = np.ones(len(measured)), np.zeros(len(measured))
    linear = np.stack([direction, np.stack([one, zero], 1), np.stack([zero, one], 1)], axis=-1)
    for _ in range(BROWN_ROUNDS):
        basis = brown.basis(measured[:, 0] - interior[1], measured[:, 1] - interior[2])
        design = np.concatenate([linear, basis], axis=-1).reshape(measured.size, -1)
        size = np.linalg.norm(design, axis=0)
        solved = np.linalg.lstsq(design / size, measured.ravel(), rcond=None)[0] / size
        interior, values = solved[:3], solved[3:]
        left = (design @ solved).reshape(-1, 2) - measured
    camera = replace(
        ideal_camera(errors), interior=_held(INTERIOR_ELEMENTS, interior), brown=_held(BROWN_NAMES, values)
    )
    return NearestLens("brown", camera, *_lengths(left))


def _directions(errors: ErrorFunction) -> tuple[np.ndarray, np.ndarray]:
    """Measured positions over the format (n, 2) mm, and the tangents (n, 2) of their ideal directions."""
    half = np.array(errors.camera.half_format_mm)
    x, y = ((2.0 * (np.arange(n) + 0.5) / n - 1.0) * h for n, h in zip(FIT_GRID, half, strict=True))
    measured = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    ideal = measured - errors.of_measured(measured)
    return measured, (ideal - errors.interior[1:]) / errors.interior[0]


def _held(names: tuple[str, ...], values: Iterable[float]) -> dict[str, Prior]:
    return {name: Prior(float(value), fixed=True) for name, value in zip(names, values, strict=True)}


def _lengths(vectors: np.ndarray) -> tuple[float, float]:
    length = np.hypot(vectors[:, 0], vectors[:, 1])
    return float(np.sqrt(np.mean(length**2))), float(length.max())
