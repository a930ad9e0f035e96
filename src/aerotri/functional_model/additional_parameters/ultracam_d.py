"""The special additional parameters 42–73 of BLUH for the UltraCamD: its CCD tiles.

[P] the list (Spreckels et al., Table 1); [L/D] the tile layout; [C] the numbering. Nine CCDs in 3 × 3 make the image;
the eight around the centre may each be scaled (42–49), shifted (50–57 in x, 58–65 in y) and turned (66–73) about their
own centres. Scale and rotation are per unit (a rotation in radians, counter-clockwise), shifts in millimetres.
The tiles live in the sensor's native frame, x across the flight; `flight_axis` turns it into the image.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family
from aerotri.functional_model.additional_parameters.native_frame import native_from_image
from aerotri.functional_model.additional_parameters.terms import Terms, only, turned
from aerotri.observations import Camera

ITEMS = tuple(str(i) for i in range(42, 74))
"""Parameters 42–73: scale, shift in x, shift in y, rotation of eight tiles each [P]."""

SENSOR_SIZE_PX = (11500, 7500)
"""Across and along the flight [L]."""
TILE_CENTRE_COLUMNS = np.array([2004.0, 5750.0, 9496.0])
"""px: tiles 4008 px wide that begin every 3746 px [L]."""
TILE_CENTRE_ROWS = np.array([1336.0, 3750.0, 6164.0])
"""px: tiles 2672 px high that begin every 2414 px [L]."""
SEAM_COLUMNS = np.array([3877.0, 7623.0])
"""px, the middles of overlaps of 262 px: every point belongs to one tile [D]."""
SEAM_ROWS = np.array([2543.0, 4957.0])
"""px, the middles of overlaps of 258 px."""
CENTRE_TILE = 4
"""Number of the tile without parameters, to which the others are referred."""
TILE_NAMES = (
    "upper left", "upper", "upper right", "left", "right", "lower left", "lower", "lower right",
)  # fmt: skip
DESCRIPTION = {
    str(42 + 8 * kind + tile): f"{what}, {name} tile"
    for kind, what in enumerate(("scale", "shift x", "shift y", "rotation"))
    for tile, name in enumerate(TILE_NAMES)
}
"""What every parameter corrects, in words of a report."""


def native_pixel_mm(camera: Camera) -> float:
    """Size of a sensor pixel from the longer side of the format, so that reduced copies of an image keep the tiles."""
    return max(camera.size_px) * camera.pixel_mm / SENSOR_SIZE_PX[0]


def tile_centres_mm(camera: Camera) -> np.ndarray:
    """(9, 2) centres of the tiles in native millimetres, row by row from the upper left."""
    pixel = native_pixel_mm(camera)
    across = (TILE_CENTRE_COLUMNS - SENSOR_SIZE_PX[0] / 2) * pixel
    along = (SENSOR_SIZE_PX[1] / 2 - TILE_CENTRE_ROWS) * pixel
    return np.array([(x, y) for y in along for x in across])


def tile_of(camera: Camera, x_native: np.ndarray, y_native: np.ndarray) -> np.ndarray:
    """(n,) number 0–8 of the tile that holds each native position, row by row from the upper left."""
    pixel = native_pixel_mm(camera)
    column = np.searchsorted((SEAM_COLUMNS - SENSOR_SIZE_PX[0] / 2) * pixel, x_native, side="right")
    row = np.searchsorted((SEAM_ROWS - SENSOR_SIZE_PX[1] / 2) * pixel, -np.asarray(y_native), side="right")
    return 3 * row + column


def _evaluate(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
    """The four patterns of the tile each point lies in: scale, shift x, shift y, rotation.

    Up to four columns; all zero within the centre tile, which is held.
    """
    turn = native_from_image(camera)
    native = np.stack([x, y], axis=-1) @ turn.T
    tile = tile_of(camera, native[:, 0], native[:, 1])
    acts = (tile != CENTRE_TILE).astype(float)
    offset = (native - tile_centres_mm(camera)[tile]) * acts[:, None]
    value = np.zeros((len(tile), 2, 4))
    value[:, :, 0] = offset
    value[:, 0, 1] = value[:, 1, 2] = acts
    value[:, 0, 3], value[:, 1, 3] = -offset[:, 1], offset[:, 0]
    partial = None
    if partials:
        partial = np.zeros((len(tile), 2, 4, 2))
        partial[:, 0, 0, 0] = partial[:, 1, 0, 1] = acts
        partial[:, 0, 3, 1], partial[:, 1, 3, 0] = -acts, acts
    number = np.where(tile > CENTRE_TILE, tile - 1, np.minimum(tile, CENTRE_TILE - 1))
    index = number[:, None] + 8 * np.arange(4)
    return turned(only(Terms(index, value, partial), ITEMS, items), turn)


FAMILY = Family(
    name="ultracam_d",
    items=ITEMS,
    mark="P",
    reference="Spreckels, Schlienkamp, Jacobsen, Table 1 (42–73); tile numbering of this project, row by row",
    text=DESCRIPTION.__getitem__,
    unit=lambda item: (NO_UNIT, "mm", "mm", "rad")[(int(item) - 42) // 8],
    evaluate=_evaluate,
    camera_model="ultracam_d",
)
"""Units go with the kind of the parameter, eight of each from 42 on."""
