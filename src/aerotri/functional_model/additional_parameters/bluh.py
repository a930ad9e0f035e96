"""The general additional parameters 1–12 of the Hannover program BLUH.

[P] Spreckels, Schlienkamp, Jacobsen: Model deformation – accuracy of digital frame cameras, Table 1. Normalisation [D]:
the constants 16384 = 128², π/64 and π/32 belong to millimetres on a 23 cm format, so image coordinates are scaled to a
half diagonal of 115·√2 mm; displacements come out in the same unit and are scaled back.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family, per_mm
from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms
from aerotri.observations import Camera

DESCRIPTION = {
    "1": "angular affinity",
    "2": "affinity",
    "3": "radial, cos 2b",
    "4": "radial, sin 2b",
    "5": "radial, cos b",
    "6": "radial, sin b",
    "7": "tangential distortion 1",
    "8": "tangential distortion 2",
    "9": "radial symmetric r³",
    "10": "radial symmetric, sin(πr/64)",
    "11": "radial symmetric, sin(πr/32)",
    "12": "radial, sin 4b",
}

NORMAL_R_MAX = 115.0 * np.sqrt(2.0)
"""mm, half the diagonal of a photograph of 23 × 23 cm: 128², π/64 and π/32 only fit mm on that format [D]."""
ZERO_RADIUS_SQUARED = 128.0**2
"""mm² of the normalised image: at a radius of 128 mm the pattern 9 is zero [P]."""
UNITS = {"7": per_mm(1), "8": per_mm(1), "9": per_mm(2)}
"""In normalised image coordinates."""
FREQUENCY = {"10": np.pi / 64.0, "11": np.pi / 32.0}
"""Of the patterns sin(πr/64) and sin(πr/32), 1/mm of the normalised image [P]."""


def scale(camera: Camera) -> float:
    """Normalised length of one millimetre in the image: 162.6 mm / r_max of the format."""
    return NORMAL_R_MAX / camera.r_max_mm


class _Polar:
    """r, cos b and sin b of normalised positions, and the functions of b; all but r are 0 at r = 0.

    cos b = u/r and sin b = v/r keep the quadrant that a plain arctan(v/u) would lose.
    """

    def __init__(self, u: np.ndarray, v: np.ndarray):
        self.r = np.hypot(u, v)
        self.per_r = np.divide(1.0, self.r, out=np.zeros_like(self.r), where=self.r > 0.0)
        self.cos, self.sin = u * self.per_r, v * self.per_r

    def of_angle(self, item: str) -> tuple[np.ndarray, np.ndarray]:
        """The function of b of item 3, 4, 5, 6 or 12 and its derivative by b."""
        if item == "5":
            return self.cos, -self.sin
        if item == "6":
            return self.sin, self.cos
        cos_2b, sin_2b = self.cos**2 - self.sin**2, 2.0 * self.sin * self.cos
        if item == "3":
            return cos_2b, -2.0 * sin_2b
        if item == "4":
            return sin_2b, 2.0 * cos_2b
        return 2.0 * sin_2b * cos_2b, 4.0 * (cos_2b**2 - sin_2b**2)


def _radial_factor(item: str, u: np.ndarray, v: np.ndarray, polar: _Polar, partials: bool):
    """The scalar g of a pattern −(u, v)·g, and its gradient (None unless asked for)."""
    if item == "9":
        return polar.r**2 - ZERO_RADIUS_SQUARED, (2.0 * u, 2.0 * v)
    if item in FREQUENCY:
        frequency = FREQUENCY[item]
        if not partials:
            return np.sin(frequency * polar.r), None
        slope = frequency * np.cos(frequency * polar.r)
        return np.sin(frequency * polar.r), (slope * polar.cos, slope * polar.sin)
    g, slope = polar.of_angle(item)
    # the gradient of b is (−sin b, cos b)/r
    return g, (-slope * polar.sin * polar.per_r, slope * polar.cos * polar.per_r) if partials else None


def _pattern(item: str, u: np.ndarray, v: np.ndarray, polar: _Polar, partials: bool):
    """Pattern (Δu, Δv) of an item and its partials (Δu_u, Δu_v, Δv_u, Δv_v), in normalised coordinates."""
    if item == "1":
        return (-v, -u), (0.0, -1.0, -1.0, 0.0)
    if item == "2":
        return (-u, v), (-1.0, 0.0, 0.0, 1.0)
    # r·cos b = u and r·sin b = v
    if item == "7":
        return (v * u, -u * u), (v, u, -2.0 * u, 0.0)
    if item == "8":
        return (v * v, -u * v), (0.0, 2.0 * v, -v, -u)
    g, gradient = _radial_factor(item, u, v, polar, partials)
    if gradient is None:
        return (-u * g, -v * g), None
    return (-u * g, -v * g), (-g - u * gradient[0], -u * gradient[1], -v * gradient[0], -g - v * gradient[1])


def _evaluate(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
    """Patterns 1–12 at image points."""
    s = scale(camera)

    def fill(x: np.ndarray, y: np.ndarray, value: np.ndarray, partial: np.ndarray | None) -> None:
        u, v = s * x, s * y
        polar = _Polar(u, v)
        for k, item in enumerate(items):
            (du, dv), derivatives = _pattern(item, u, v, polar, partials)
            np.divide(du, s, out=value[:, 0, k])
            np.divide(dv, s, out=value[:, 1, k])
            if partial is not None and derivatives is not None:
                for place, derivative in enumerate(derivatives):
                    partial[:, place // 2, k, place % 2] = derivative

    return dense_terms(x, y, len(items), partials, fill)


FAMILY = Family(
    name="bluh",
    items=tuple(DESCRIPTION),
    mark="P",
    reference="Spreckels, Schlienkamp, Jacobsen, Model deformation – accuracy of digital frame cameras, Table 1",
    text=DESCRIPTION.__getitem__,
    unit=lambda item: UNITS.get(item, NO_UNIT),
    evaluate=_evaluate,
)
