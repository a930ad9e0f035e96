"""Coefficients of the cubic B-spline surface through the pixels of an image.

Keys' cubic convolution moves what lies between two pixels: an image of wave number ω at the place t between them by
ω²·t(1 − t)(1 − 2t)/6 [D], a hundredth of a pixel for the texture of photographs. The spline moves it by less
than a quarter of that. Its coefficients are the image convolved with √3·z^|k|, z = √3 − 2 [L: Unser 1999].
"""

from __future__ import annotations

import cv2
import numpy as np

REACH = 5
"""Pixels to the farthest that counts; chosen [C]: what is left out is less than a thousandth of the image."""


def _weights() -> np.ndarray:
    """(2·`REACH` + 1,) of the pixels around; exact for polynomials of third order, as all of them would be."""
    k = np.arange(-REACH, REACH + 1)
    out = np.sqrt(3.0) * (np.sqrt(3.0) - 2.0) ** np.abs(k)
    out[np.abs(k) == REACH] += 0.5 * (-1.0 / 3.0 - k**2 @ out) / REACH**2
    out[k == 0] += 1.0 - out.sum()
    return out


WEIGHTS, ONE = _weights().astype(np.float32), np.ones(1, np.float32)


def along_rows(image: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """(rows, columns) float32, coefficients of a spline along every row; in `out` where that is given."""
    return cv2.sepFilter2D(image, cv2.CV_32F, WEIGHTS, ONE, dst=out, borderType=cv2.BORDER_REFLECT_101)


def of_surface(image: np.ndarray) -> np.ndarray:
    """(rows, columns) float32, coefficients of a spline along rows and columns."""
    return cv2.sepFilter2D(image, cv2.CV_32F, WEIGHTS, WEIGHTS, borderType=cv2.BORDER_REFLECT_101)
