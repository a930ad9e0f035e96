"""The DMC as a machine: four tilted heads resampled into one virtual image [D].

Each head has changed since its calibration: focal length, lens, attitude in the frame that holds it. The software that
makes the virtual image finds the attitudes of the heads anew from tie points in their overlaps; what the three angles
of a head cannot follow stays.

Native frame: x across, y along the flight, mm; heads counter-clockwise from x > 0, y > 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.additional_parameters import dmc_heads
from aerotri.functional_model.additional_parameters.dmc_heads import HALF_FORMAT_MM, turning
from aerotri.observations import Camera
from aerotri.simulation.camera_errors.lens import LensError, format_grid, random_lens

WEIGHTS = {"lens": 0.15, "focal": 1.5, "head_lens": 0.05, "head_focal": 0.05, "pose": 1.0, "stitching": 0.02}
"""RMS of each cause before scaling, in the plane of a head and before the stitching, which takes all of the attitude
and most of the focal length: lens error and focal length, as far as they change in all heads alike (one design, one
temperature) and each head's own; attitude; matching noise of the stitching."""

SIGNS = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
"""Signs of x and y in the quadrants of the heads 0–3, counter-clockwise from x > 0, y > 0 [C]."""


def head_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n,) head 0–3 whose quadrant holds a native position."""
    return np.where(y >= 0.0, np.where(x >= 0.0, 0, 1), np.where(x >= 0.0, 3, 2))


@dataclass(frozen=True, eq=False)
class LensPair:
    """The lens error of a head: what all heads share and what is its own."""

    common: LensError
    own: LensError

    def __call__(self, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        """(n, 2) mm at (n,) mm in the head."""
        return self.common(xi, eta) + self.own(xi, eta)


@dataclass(frozen=True, eq=False)
class DmcError:
    """Image error of the virtual image, native frame.

    Parameters
    ----------
    focal_length : mm, common to heads and virtual image.
    lenses : four.
    focal_change : (4,) relative change of the heads' focal lengths.
    attitude : (4, 3) rad, small rotations of the heads less what the stitching found.
    """

    focal_length: float
    lenses: tuple[LensPair, ...]
    focal_change: np.ndarray
    attitude: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm at native positions, each by the head of its quadrant."""
        return self.of_head(head_of(x, y), x, y)

    def of_head(self, head: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm as the given heads record the positions."""
        f = self.focal_length
        xi, eta, jacobian = in_head(f, head, x, y)
        error = self.focal_change[head, None] * np.stack([xi, eta], axis=1)
        error += np.einsum("nak,nk->na", turning(np.stack([xi, eta], axis=1), f), self.attitude[head])
        for k, lens in enumerate(self.lenses):
            own = np.flatnonzero(head == k)
            error[own] += lens(xi[own], eta[own])
        return np.einsum("nab,nb->na", jacobian, error)


def in_head(f: float, head: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position (ξ, η) in the plane of the head, mm, and J_H = ∂(x, y)/∂(ξ, η), (n, 2, 2).

    All heads are mirror images of the one that `dmc_heads` describes.
    """
    sign = SIGNS[head]
    mirrored = dmc_heads.in_head(sign[:, 0] * x, sign[:, 1] * y, f)
    xi, eta = (sign * mirrored).T
    return xi, eta, sign[:, :, None] * dmc_heads.jacobian(mirrored, f) * sign[:, None, :]


def dmc_error(camera: Camera, weights: dict[str, float], rng: np.random.Generator) -> DmcError:
    """A camera drawn at random.

    Parameters
    ----------
    weights : RMS in mm of each cause, the keys of `WEIGHTS`.
    """
    f, half = camera.focal_length_mm, HALF_FORMAT_MM
    common, own = weights["lens"], weights["head_lens"]
    # in all heads alike a lens changes about its axis; what has no symmetry is each head's own
    design = random_lens(half, common, 0.0, 0.0, rng)
    lenses = tuple(LensPair(design, random_lens(half, own * 0.6, own * 0.5, own * 0.6, rng)) for _ in range(4))
    xi, eta = format_grid(half, 15, 15)
    # a uniform sign is drawn, not a size: the scaling of the whole field would undo it
    zoom = weights["focal"] * rng.choice([-1.0, 1.0]) + weights["head_focal"] * rng.normal(size=4)
    focal = zoom / np.sqrt(np.mean(xi**2 + eta**2) / 2.0)
    per_radian = np.sqrt(np.mean(turning(np.stack([xi, eta], axis=1), f) ** 2, axis=(0, 1)))
    attitude = rng.normal(size=(4, 3)) * weights["pose"] / per_radian
    plain = DmcError(f, lenses, focal, attitude)
    return DmcError(f, lenses, focal, attitude - _stitch(camera, plain, weights["stitching"], rng))


def overlap_points(camera: Camera) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    """Tie positions of every pair of neighbouring heads: those on a grid that both heads see."""
    half = max(camera.half_format_mm), min(camera.half_format_mm)
    x, y = format_grid(half, 288, 160)
    seen = []
    for head in range(4):
        xi, eta, _ = in_head(camera.focal_length_mm, np.full(len(x), head), x, y)
        seen.append((np.abs(xi) <= HALF_FORMAT_MM[0]) & (np.abs(eta) <= HALF_FORMAT_MM[1]))
    pairs = ((0, 1), (1, 2), (2, 3), (3, 0))
    return [(a, b, x[seen[a] & seen[b]], y[seen[a] & seen[b]]) for a, b in pairs]


def _stitch(camera: Camera, plain: DmcError, noise_mm: float, rng: np.random.Generator) -> np.ndarray:
    """(4, 3) rad rotations of the heads that close the overlaps best; common ones are left to the orientation."""
    f = camera.focal_length_mm
    designs, differences = [], []
    for a, b, x, y in overlap_points(camera):
        design = np.zeros((len(x), 2, 4, 3))
        for head, sign in ((a, 1.0), (b, -1.0)):
            xi, eta, jacobian = in_head(f, np.full(len(x), head), x, y)
            design[:, :, head] = sign * jacobian @ turning(np.stack([xi, eta], axis=1), f)
        gap = plain.of_head(np.full(len(x), a), x, y) - plain.of_head(np.full(len(x), b), x, y)
        designs.append(design.reshape(-1, 12))
        differences.append((gap + noise_mm * rng.normal(size=gap.shape)).ravel())
    found = np.linalg.lstsq(np.concatenate(designs), np.concatenate(differences), rcond=1e-9)[0]
    return found.reshape(4, 3)
