"""Small residual errors of a lens, drawn at random: radial, tangential, and slow ones without symmetry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RADIAL_SHARES = np.array([1.0, 0.6, 0.35])
"""σ of the random coefficients of the three radial patterns; chosen [C]: higher orders are smaller in lenses; equal
ones make edges that no lens has."""
WAVES = 4
"""Slow waves without symmetry in either coordinate; chosen [C]: one would be a stripe, many sum up to noise."""


def unit_rms(patterns: np.ndarray) -> np.ndarray:
    """(k,) factors that give each of k patterns (n, 2, k) the RMS 1 over the points, in a coordinate."""
    rms = np.sqrt(np.mean(patterns**2, axis=(0, 1)))
    return 1.0 / np.where(rms > 0.0, rms, 1.0)


@dataclass(frozen=True, eq=False)
class LensError:
    """Residual error of one lens [D].

    Radial: odd Chebyshev polynomials T3, T5, T7 of r / r_max, as residual curves of calibrations oscillate.
    Tangential: (r² + 2x², 2xy) and (2xy, r² + 2y²). Slow: waves of 1.5 to 3 half diagonals, each coordinate its own,
    as a temperature gradient across the glass gives.

    Parameters
    ----------
    axis : (2,) mm, where the optical axis meets the image.
    r_max : mm.
    coefficients : (5 + 2·WAVES,) mm.
    wave_number : (2·WAVES, 2) rad/mm, phase : (2·WAVES,) rad.
    """

    axis: np.ndarray
    r_max: float
    coefficients: np.ndarray
    wave_number: np.ndarray
    phase: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm at (n,) mm."""
        return self.patterns(x, y) @ self.coefficients

    def patterns(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2, 5 + 2·WAVES) per unit of each coefficient."""
        px, py = (x - self.axis[0]) / self.r_max, (y - self.axis[1]) / self.r_max
        q2 = px * px + py * py
        position = np.stack([px, py], axis=1)
        # T_n(q)/q for n = 3, 5, 7
        over_q = (4 * q2 - 3, (16 * q2 - 20) * q2 + 5, ((64 * q2 - 112) * q2 + 56) * q2 - 7)
        out = np.zeros((len(px), 2, len(self.coefficients)))
        for k, radial in enumerate(over_q):
            out[:, :, k] = position * radial[:, None]
        out[:, 0, 3], out[:, 1, 3] = q2 + 2 * px * px, 2 * px * py
        out[:, 0, 4], out[:, 1, 4] = 2 * px * py, q2 + 2 * py * py
        waves = np.cos(np.stack([x, y], axis=1) @ self.wave_number.T + self.phase)
        out[:, 0, 5 : 5 + WAVES] = waves[:, :WAVES]
        out[:, 1, 5 + WAVES :] = waves[:, WAVES:]
        return out


def random_lens(
    half_format: tuple[float, float], radial: float, tangential: float, slow: float, rng: np.random.Generator
) -> LensError:
    """A lens whose three kinds of error have the given RMS of a coordinate over the format.

    Parameters
    ----------
    half_format : mm.
    radial, tangential, slow : mm.
    """
    r_max = float(np.hypot(*half_format))
    direction = rng.uniform(0.0, 2.0 * np.pi, 2 * WAVES)
    number = 2.0 * np.pi / (r_max * rng.uniform(1.5, 3.0, 2 * WAVES))
    wave_number = number[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    coefficients = rng.normal(size=5 + 2 * WAVES)
    coefficients[:3] *= RADIAL_SHARES
    plain = LensError(
        rng.normal(size=2) * 0.005 * r_max, r_max, coefficients, wave_number, rng.uniform(0.0, 2.0 * np.pi, 2 * WAVES)
    )
    x, y = format_grid(half_format, 25, 25)
    patterns = plain.patterns(x, y)
    scaled = coefficients.copy()
    for part, size in ((slice(0, 3), radial), (slice(3, 5), tangential), (slice(5, None), slow)):
        whole = patterns[:, :, part] @ coefficients[part]
        scaled[part] *= size * unit_rms(whole[:, :, None])[0]
    return LensError(plain.axis, r_max, scaled, wave_number, plain.phase)


def format_grid(half_format: tuple[float, float], columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres of columns × rows equal cells of the format, row by row from the upper left: (n,) x and (n,) y, mm."""
    x = ((np.arange(columns) + 0.5) / columns * 2.0 - 1.0) * half_format[0]
    y = (1.0 - (np.arange(rows) + 0.5) / rows * 2.0) * half_format[1]
    xx, yy = np.meshgrid(x, y)
    return xx.ravel(), yy.ravel()
