"""The UltraCamD as a machine: four cones, nine CCDs, and the factory's stitching [D].

The master cone carries the four corner tiles; a second cone the upper and lower middle tile, a third the left and right
one, a fourth the centre. Since the laboratory calibration each lens and each CCD has changed a little. The tiles of the
slave cones are laid onto their neighbours by a similarity, fitted to the overlaps of the tiles, as the software that
makes the virtual image does; what a similarity cannot follow stays, and so do the errors of the master cone.

Everything here is in the native frame: x across, y along the flight, mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.additional_parameters.ultracam_d import native_pixel_mm, tile_centres_mm, tile_of
from aerotri.observations import Camera
from aerotri.simulation.camera_errors.lens import LensError, format_grid, random_lens, unit_rms

WEIGHTS = {"lens": 1.0, "cone": 0.4, "focal": 0.4, "ccd": 0.8, "ccd_tilt": 0.25, "stitching": 0.15}
"""RMS of each cause before scaling: change common to the four lenses; each cone's own lens; each cone's principal
distance; shift, turn and scale of a CCD; its tilt; matching noise of the stitching."""

TILE_SIZE_PX = (4008, 2672)
"""Columns and rows of a CCD: tiles every 3746 and 2414 pixels that overlap by 262 and 258 [L/D]."""
CONE_OF_TILE = np.array([0, 1, 0, 2, 3, 2, 0, 1, 0])
"""Cone that carries each CCD, row by row from the upper left: the master cone, 0, has the four corners."""
STITCHING = ((1, (0, 2)), (7, (6, 8)), (3, (0, 6)), (5, (2, 8)), (4, (0, 1, 2, 3, 5, 6, 7, 8)))
"""Each slave tile and the tiles it is laid onto, in this order: the centre last, onto tiles already in place."""
TIES_PER_OVERLAP = (6, 24)
"""Tie points across and along the area where two CCDs overlap; chosen [C]: it is ten times as long as wide, or more;
nearly square ones, at corners, have 6 × 6."""


@dataclass(frozen=True, eq=False)
class UltraCamDError:
    """Image error of the virtual image, native frame.

    Parameters
    ----------
    common : the change all lenses share; cones : four lenses.
    linear : (9, 2, 3) affine error of each tile about its centre: shift (mm), and two columns per mm.
    tilt : (9, 2) unflatness of a CCD, mm of height per mm along x and y, over the principal distance.
    stitching : (9, 4) similarity that laid the tile onto its neighbours: shift x, shift y, scale, rotation.
    """

    camera: Camera
    common: LensError
    cones: tuple[LensError, ...]
    linear: np.ndarray
    tilt: np.ndarray
    stitching: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm at native positions, each by the tile it lies in."""
        return self.of_tile(tile_of(self.camera, x, y), x, y)

    def of_tile(self, tile: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm as the given tiles record the positions, wherever these lie."""
        error = self.common(x, y)
        for cone, lens in enumerate(self.cones):
            own = np.flatnonzero(CONE_OF_TILE[tile] == cone)
            error[own] += lens(x[own], y[own])
        offset = np.stack([x, y], axis=1) - tile_centres_mm(self.camera)[tile]
        error += self.linear[tile, :, 0] + np.einsum("nab,nb->na", self.linear[tile, :, 1:], offset)
        # a CCD out of the focal plane by δz shifts the point along its radius by δz·r/f
        height = np.sum(self.tilt[tile] * offset, axis=1)
        error += height[:, None] * np.stack([x, y], axis=1) / self.camera.focal_length_mm
        return error - _similarity(offset, self.stitching[tile])


def _similarity(offset: np.ndarray, s: np.ndarray) -> np.ndarray:
    return s[:, :2] + s[:, 2:3] * offset + s[:, 3:] * np.stack([-offset[:, 1], offset[:, 0]], axis=1)


def ultracam_d_error(camera: Camera, weights: dict[str, float], rng: np.random.Generator) -> UltraCamDError:
    """A camera drawn at random.

    Parameters
    ----------
    weights : RMS in mm of each cause, the keys of `WEIGHTS`.
    """
    half = max(camera.half_format_mm), min(camera.half_format_mm)
    common = random_lens(half, weights["lens"] * 0.8, weights["lens"] * 0.3, weights["lens"] * 0.5, rng)
    own = weights["cone"]
    cones = tuple(random_lens(half, own * 0.8, own * 0.4, own * 0.4, rng) for _ in range(4))
    linear, tilt = _ccd_errors(camera, weights, rng)
    plain = UltraCamDError(camera, common, cones, linear, tilt, np.zeros((9, 4)))
    return UltraCamDError(camera, common, cones, linear, tilt, _stitch(plain, weights["stitching"], rng))


def _ccd_errors(camera: Camera, weights: dict[str, float], rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Affine error (9, 2, 3) and tilt (9, 2) of every tile; a cone's principal distance scales its tiles' positions."""
    centres = tile_centres_mm(camera)
    half_tile = np.array(TILE_SIZE_PX) * native_pixel_mm(camera) / 2.0
    x, y = format_grid((half_tile[0], half_tile[1]), 15, 15)
    one, zero = np.ones_like(x), np.zeros_like(x)
    shift_x, shift_y = np.stack([one, zero], 1), np.stack([zero, one], 1)
    scale, turn = np.stack([x, y], 1), np.stack([-y, x], 1)
    factor = unit_rms(np.stack([shift_x, shift_y, scale, turn], axis=2)) * weights["ccd"] / 2.0
    draw = rng.normal(size=(9, 4)) * factor
    linear = np.zeros((9, 2, 3))
    linear[:, :, 0] = draw[:, :2]
    linear[:, 0, 1] = linear[:, 1, 2] = draw[:, 2]
    linear[:, 0, 2], linear[:, 1, 1] = -draw[:, 3], draw[:, 3]
    zoom = rng.normal(size=4) * weights["focal"] / np.sqrt(np.mean(centres**2) + np.mean(half_tile**2) / 3.0)
    per_tile = zoom[CONE_OF_TILE]
    linear[:, :, 0] += per_tile[:, None] * centres
    linear[:, 0, 1] += per_tile
    linear[:, 1, 2] += per_tile
    tilt = rng.normal(size=(9, 2)) * weights["ccd_tilt"] / half_tile * 3.0
    return linear, tilt


def overlap_points(camera: Camera, tile: int, other: int) -> tuple[np.ndarray, np.ndarray]:
    """Tie positions (n,) x and y, mm, spread over the common area of two tiles."""
    half = np.array(TILE_SIZE_PX) * native_pixel_mm(camera) / 2.0
    centres = tile_centres_mm(camera)
    low = np.maximum(centres[tile], centres[other]) - half
    high = np.minimum(centres[tile], centres[other]) + half
    size = high - low
    if (size <= 0.0).any():
        return np.zeros(0), np.zeros(0)
    columns, rows = TIES_PER_OVERLAP if size[0] < size[1] else TIES_PER_OVERLAP[::-1]
    if size.max() < 4.0 * size.min():
        columns = rows = TIES_PER_OVERLAP[0]
    x, y = format_grid((size[0] / 2.0, size[1] / 2.0), columns, rows)
    middle = (low + high) / 2.0
    return x + middle[0], y + middle[1]


def _stitch(plain: UltraCamDError, noise_mm: float, rng: np.random.Generator) -> np.ndarray:
    """(9, 4) similarities, one slave tile after the other, least squares in the overlaps with noise of matching."""
    stitching = np.zeros((9, 4))
    centres = tile_centres_mm(plain.camera)
    for tile, onto in STITCHING:
        designs, differences = [], []
        for other in onto:
            x, y = overlap_points(plain.camera, tile, other)
            placed = UltraCamDError(plain.camera, plain.common, plain.cones, plain.linear, plain.tilt, stitching)
            gap = placed.of_tile(np.full(len(x), tile), x, y) - placed.of_tile(np.full(len(x), other), x, y)
            offset = np.stack([x, y], axis=1) - centres[tile]
            designs.append(np.stack([_similarity(offset, np.tile(e, (len(x), 1))) for e in np.eye(4)], axis=2))
            differences.append(gap + noise_mm * rng.normal(size=gap.shape))
        design, difference = np.concatenate(designs), np.concatenate(differences)
        stitching[tile] = np.linalg.lstsq(design.reshape(-1, 4), difference.ravel(), rcond=None)[0]
    return stitching
