"""The image errors of one photograph of a model: both directions within the tile, and their partials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.image_errors import ImageGroup, image_groups
from aerotri.image_errors.error_function import ErrorFunction, error_function
from aerotri.image_errors.groups import parameters_of_group
from aerotri.image_errors.tile_grid import seams_px, tiles_of
from aerotri.observations import Camera
from aerotri.results.adjustment import Adjustment

LENS_STEP = 1e-6
"""Half the step of a difference by a lens parameter, in its own unit [C]: the error goes with its square; with a
smaller one the tolerance of the fixed point in `of_measured` would show."""


@dataclass(frozen=True, eq=False)
class PhotoErrors:
    """d(x, y) of a group of photographs.

    Parameters
    ----------
    function : the image errors in force.
    column : place of each estimated parameter among the p additional parameters of the block, by name.
    count : p.
    """

    function: ErrorFunction
    column: Mapping[str, int]
    count: int

    @property
    def camera(self) -> Camera:
        return self.function.camera

    def inside(self, xy: np.ndarray) -> np.ndarray:
        """(n,) bool: on the format."""
        return np.all(np.abs(xy) <= np.array(self.camera.half_format_mm), axis=1)

    def measured(self, ideal: np.ndarray) -> np.ndarray:
        """(n, 2) mm, m = ideal + d(m), d that of the tile in which the ideal position lies.

        Beyond the format d is that of its edge: nothing was measured there, and polynomials may turn back.
        """
        out = np.empty_like(ideal)
        half = np.array(self.camera.half_format_mm)
        x_seams, y_seams = seams_mm(self.camera)
        column = np.searchsorted(x_seams, ideal[:, 0], side="right")
        row = len(y_seams) - np.searchsorted(y_seams, ideal[:, 1], side="right")
        for i, tiles in enumerate(tiles_of(self.camera)):
            for j, tile in enumerate(tiles):
                own = np.flatnonzero((row == i) & (column == j))
                if len(own):
                    low, high = tile.bounds_mm(self.camera)
                    within = np.maximum(low, -half), np.minimum(high, half)
                    out[own] = self.function.measured(ideal[own], within)
        return out

    def partials(self, measured: np.ndarray) -> np.ndarray:
        """(n, 2, p) partials of d by the additional parameters of the block at measured positions (n, 2) mm.

        Those of a forward lens are differences: it is a function of the ideal direction.
        """
        f, (x, y) = self.function, measured.T
        out = np.zeros((len(measured), 2, self.count))
        for chosen, _ in f.linear:
            self._put(out, chosen.names, chosen.basis(x, y))
        names = tuple(f"{brown.FAMILY.name}.{item}" for item in brown.ITEMS)
        if any(name in self.column for name in names):
            self._put(out, names, brown.basis(x - f.interior[1], y - f.interior[2]))
        for k, item in enumerate(lens.ITEMS):
            name = f"{lens.FAMILY.name}.{item}"
            if name in self.column:
                step = LENS_STEP * np.eye(len(lens.COLUMNS))[k]
                ends = [replace(f, lens=f.lens + sign * step).of_measured(measured) for sign in (1.0, -1.0)]
                self._put(out, (name,), ((ends[0] - ends[1]) / (2.0 * LENS_STEP))[:, :, None])
        return out

    def _put(self, out: np.ndarray, names: tuple[str, ...], basis: np.ndarray) -> None:
        """Columns of a family to their places; what was given and not estimated has none."""
        chosen = [k for k, name in enumerate(names) if name in self.column]
        out[:, :, [self.column[names[k]] for k in chosen]] += basis[:, :, chosen]


def photo_errors(calibration: Adjustment, group: ImageGroup, rows: np.ndarray) -> PhotoErrors:
    """The image errors of a group.

    Parameters
    ----------
    rows : (p,) the additional parameters of the block in the record of the shared parameters.
    """
    adjusted = calibration.local
    own = parameters_of_group(adjusted, group)
    column = {str(adjusted.parameters.names[row]): k for k, row in enumerate(rows) if own[row]}
    return PhotoErrors(error_function(adjusted, group), column, len(rows))


def errors_by_image(calibration: Adjustment, rows: np.ndarray) -> tuple[tuple[PhotoErrors, ...], np.ndarray]:
    """The image errors of all groups of the block, and (n,) which of them each photograph has."""
    groups = image_groups(calibration.local.block)
    number = np.zeros(len(calibration.local.block.images), dtype=np.int64)
    for k, group in enumerate(groups):
        number[group.images] = k
    return tuple(photo_errors(calibration, group, rows) for group in groups), number


def seams_mm(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """x and y on which the tiles of a camera meet, mm from the image centre, rising."""
    columns, rows = seams_px(camera)
    half = np.array(camera.size_px) / 2.0
    return (columns - half[0]) * camera.pixel_mm, np.sort((half[1] - rows) * camera.pixel_mm)
