"""The general additional parameters 1–12 of the Hannover program BLUH.

[P] Spreckels, Schlienkamp, Jacobsen: Model deformation – accuracy of digital frame cameras, Table 1. Normalisation [D]:
the constants 16384 = 128², π/64 and π/32 belong to millimetres on a 23 cm format, so image coordinates are scaled to a
half diagonal of 115·√2 mm; displacements come out in the same unit and are scaled back.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms
from aerotri.observations import Camera

FAMILY = "bluh"
ITEMS = tuple(str(i) for i in range(1, 13))
MARK = "P"
CAMERA_MODEL = None
REFERENCE = "Spreckels, Schlienkamp, Jacobsen, Model deformation – accuracy of digital frame cameras, Table 1"

NORMAL_R_MAX = 115.0 * np.sqrt(2.0)


def scale(camera: Camera) -> float:
    """Normalised length of one millimetre in the image: 162.6 mm / r_max of the format."""
    return NORMAL_R_MAX / camera.r_max_mm


def _along_radius(u, v, g, g_u, g_v):
    """Pattern −(u, v)·g and its partials, for a scalar function g with partials g_u, g_v."""
    return (-u * g, -v * g), (-g - u * g_u, -u * g_v, -v * g_u, -g - v * g_v)


def _patterns(u: np.ndarray, v: np.ndarray):
    """The twelve patterns and their partials in normalised coordinates.

    cos b = u/r and sin b = v/r keep the quadrant that a plain arctan(v/u) would lose; every term is 0 at r = 0.
    """
    r = np.hypot(u, v)
    at_centre = r == 0.0
    ri = 1.0 / np.where(at_centre, 1.0, r)
    ri[at_centre] = 0.0
    cos_b, sin_b = u * ri, v * ri
    zero, one = np.zeros_like(u), np.ones_like(u)
    # the gradient of b is (−sin b, cos b)/r, that of r is (cos b, sin b)
    b_u, b_v = -sin_b * ri, cos_b * ri
    b = np.arctan2(v, u)
    yield (-v, -u), (zero, -one, -one, zero)
    yield (-u, v), (-one, zero, zero, one)
    for order, function, derivative in (
        (2, np.cos, lambda a: -np.sin(a)),
        (2, np.sin, np.cos),
        (1, np.cos, lambda a: -np.sin(a)),
        (1, np.sin, np.cos),
    ):
        slope = order * derivative(order * b)
        g = np.where(at_centre, 0.0, function(order * b))
        yield _along_radius(u, v, g, slope * b_u, slope * b_v)
    # r·cos b = u and r·sin b = v
    yield (v * u, -u * u), (v, u, -2.0 * u, zero)
    yield (v * v, -u * v), (zero, 2.0 * v, -v, -u)
    yield _along_radius(u, v, r * r - 128.0**2, 2.0 * u, 2.0 * v)
    for frequency in (np.pi / 64.0, np.pi / 32.0):
        slope = frequency * np.cos(frequency * r)
        yield _along_radius(u, v, np.sin(frequency * r), slope * cos_b, slope * sin_b)
    slope = 4.0 * np.cos(4.0 * b)
    yield _along_radius(u, v, np.where(at_centre, 0.0, np.sin(4.0 * b)), slope * b_u, slope * b_v)


def terms(camera: Camera, x: np.ndarray, y: np.ndarray) -> Terms:
    """Patterns 1–12 at image points.

    Parameters
    ----------
    x, y : (n,) mm from the image centre.

    Returns
    -------
    Terms with 12 columns.
    """
    s = scale(camera)
    u, v = s * np.asarray(x, dtype=float), s * np.asarray(y, dtype=float)
    values, partials = zip(*_patterns(u, v), strict=True)
    return dense_terms([p[0] / s for p in values], [p[1] / s for p in values], list(partials))
