"""Keypoints of SIFT [L] (Lowe 2004) in the pixels that there are: OpenCV's own search always doubles the image first.

Doubling finds points smaller than those that an even choice of the largest keeps, at four times the pixels. Scale
space, thresholds and the form of the result are OpenCV's, whose descriptors are computed at these keypoints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.tie_points import _detection_kernels

LAYERS, SIGMA, EDGE_THRESHOLD = 3, 1.6, 10.0
"""Lowe's values: layers of an octave, σ of its first one in pixels, largest ratio of the curvatures."""
OWN_SIGMA = 0.5
"""σ in pixels of the blur that photographs have [L]."""
BORDER = 5
"""Pixels at the edge of an octave without keypoints."""
SMALLEST = 8
"""Pixels of the shorter side of the last octave."""
SHARE_FOUND = 16
"""One extremum in so many pixels is made room for at first."""


@dataclass(frozen=True, eq=False)
class Keypoints:
    """Places with a size, n of them.

    Parameters
    ----------
    xy : (n, 2) px from the centre of the first pixel. size : (n,) px, diameter.
    octave, layer : (n,) where in the scale space. between : (n,) −0.5 … 0.5, what is left beside the layer.
    """

    xy: np.ndarray
    size: np.ndarray
    octave: np.ndarray
    layer: np.ndarray
    between: np.ndarray

    def __len__(self) -> int:
        return len(self.xy)

    def chosen(self, rows: np.ndarray) -> Keypoints:
        return Keypoints(self.xy[rows], self.size[rows], self.octave[rows], self.layer[rows], self.between[rows])


def scale_space(grey: np.ndarray) -> list[np.ndarray]:
    """Octaves (layers + 3, rows, columns) float32 of a grey image uint8, each half the size of the one before."""
    import cv2

    step = 2.0 ** (1.0 / LAYERS)
    image = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), float(np.sqrt(SIGMA**2 - OWN_SIGMA**2)))
    octaves = []
    while min(image.shape) >= SMALLEST:
        octave = np.empty((LAYERS + 3, *image.shape), np.float32)
        octave[0] = image
        for layer in range(1, LAYERS + 3):
            blur = SIGMA * step ** (layer - 1) * np.sqrt(step**2 - 1.0)
            cv2.GaussianBlur(octave[layer - 1], (0, 0), float(blur), dst=octave[layer])
        octaves.append(octave)
        image = np.ascontiguousarray(octave[LAYERS, ::2, ::2])
    return octaves


def keypoints_of(octaves: list[np.ndarray], contrast: float) -> Keypoints:
    """Extrema of the differences of Gaussians whose value is `contrast` grey values or more, and which are no edges."""
    found = [_extrema(octave, contrast) for octave in octaves]
    number = np.repeat(np.arange(len(found)), [len(part) for part in found])
    every = np.concatenate(found) if found else np.zeros((0, 4))
    layer = np.rint(every[:, 2]).astype(np.int64)
    factor = 2.0**number
    size = 2.0 * SIGMA * 2.0 ** (every[:, 2] / LAYERS) * factor
    return Keypoints(every[:, :2] * factor[:, None], size, number, layer, every[:, 2] - layer)


def _extrema(octave: np.ndarray, contrast: float) -> np.ndarray:
    found = np.empty((octave[0].size // SHARE_FOUND + 1, 4))
    count = _detection_kernels.extrema(octave, contrast, EDGE_THRESHOLD, BORDER, found)
    if count > len(found):
        found = np.empty((count, 4))
        _detection_kernels.extrema(octave, contrast, EDGE_THRESHOLD, BORDER, found)
    return found[:count]


def with_directions(octaves: list[np.ndarray], keypoints: Keypoints) -> list[Any]:
    """The keypoints as OpenCV has them, with the main direction of the gradients around each."""
    import cv2

    angle = np.empty(len(keypoints))
    for number, octave in enumerate(octaves):
        own = np.flatnonzero(keypoints.octave == number)
        one = keypoints.chosen(own)
        column, row = (one.xy / 2.0**number).T.copy()
        found = np.empty(len(own))
        _detection_kernels.directions(octave, column, row, one.layer, one.size / 2.0 ** (number + 1), found)
        angle[own] = found
    packed = keypoints.octave + (keypoints.layer << 8) + (np.rint((keypoints.between + 0.5) * 255).astype(int) << 16)
    rows = zip(keypoints.xy.tolist(), keypoints.size.tolist(), angle.tolist(), packed.tolist(), strict=True)
    return [cv2.KeyPoint(x, y, size, turn, 0.0, place) for (x, y), size, turn, place in rows]
