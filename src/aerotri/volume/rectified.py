"""Moments of max(h, 0) where h is normal: what errors do to a volume above a line that they move.

[D] With t = m/s the functions of h ~ N(m, s²) are E max(h, 0) = s·(φ(t) + t·Φ(t)), and of two such heights with the
correlation ρ  Cov(max(h₁, 0), max(h₂, 0)) = Σ_n a_n(t₁)·a_n(t₂)·s₁·s₂·ρⁿ/n!,  a₁ = Φ, a₂ = φ, a₃ = −t·φ,
a₄ = (t² − 1)·φ: the expansion in Hermite polynomials [L: Price 1958].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

BEYOND = 4.0
"""Standard deviations from the line at which a height counts as wholly on its side: what is left is 1e-5 of σ."""


LINE = "zero_line"
"""The part of σ of a cut or a fill that comes from the line between them: errors move it."""


def density(t: np.ndarray) -> np.ndarray:
    """φ(t) of the standard normal distribution."""
    return np.exp(-0.5 * np.square(t)) / np.sqrt(2.0 * np.pi)


def expected_above(mean: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """E max(h, 0) of h ~ N(mean, sigma²), in the unit of both; max(mean, 0) where sigma is 0."""
    s = np.maximum(sigma, 1e-300)
    t = np.clip(mean / s, -40.0, 40.0)
    return np.where(np.abs(mean) >= 40.0 * sigma, np.maximum(mean, 0.0), s * (density(t) + t * ndtr(t)))


def excess(mean: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """E max(h, 0) − max(mean, 0), the same below the line: never negative."""
    return expected_above(-np.abs(mean), sigma)


def share_of_variance(t: np.ndarray) -> np.ndarray:
    """Var max(h, 0) over the variance of h, t = mean/σ: 0 far below, 1 far above."""
    above = density(t) + t * ndtr(t)
    return np.maximum((np.square(t) + 1.0) * ndtr(t) + t * density(t) - np.square(above), 0.0)


def covariance_above(t: np.ndarray, sigma: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(…, n, n), covariances of max(h, 0) of places with t = mean/σ and σ (…, n) and covariances (…, n, n) of h."""
    scale = np.maximum(sigma[..., :, None] * sigma[..., None, :], 1e-300)
    rho = np.clip(covariance / scale, -1.0, 1.0)
    phi = density(t)
    total, power = np.zeros_like(rho), np.ones_like(rho)
    for a, factorial in ((ndtr(t), 1.0), (phi, 2.0), (-t * phi, 6.0), ((np.square(t) - 1.0) * phi, 24.0)):
        power = power * rho
        total += a[..., :, None] * a[..., None, :] * power / factorial
    return scale * total


@dataclass(frozen=True)
class Line:
    """What moving the line between cut and fill does to either of them, beyond the first order.

    Parameters
    ----------
    moved : m³, by which an error that all places share is expected to change it. spread : m³, its first-order width
        over the line: the change scatters by spread/√2. noise : m³ that noise alone adds to cut and to fill.
        between : m³ that triangles lose of either of them; taken account of by itself, not in `mean_square`.
    """

    moved: float = 0.0
    spread: float = 0.0
    noise: float = 0.0
    between: float = 0.0

    def __add__(self, other: Line) -> Line:
        return Line(self.moved + other.moved, self.spread + other.spread, self.noise + other.noise,
                    self.between + other.between)  # fmt: skip

    @property
    def mean_square(self) -> float:
        """m⁶."""
        return self.moved**2 + 0.5 * self.spread**2 + self.noise**2


NO_LINE = Line()


def line_of_shared(d: np.ndarray, area: np.ndarray, spread: np.ndarray | float) -> Line:
    """Of an error that places with heights d (n,) m over the line and areas (n,) m² share.

    Parameters
    ----------
    spread : m, (n,) or of all, its σ.
    """
    spread = np.broadcast_to(spread, d.shape)
    near = np.isfinite(d) & (np.abs(d) < BEYOND * spread)
    if not near.any():
        return NO_LINE
    h, a, s = d[near], area[near], spread[near]
    return Line(float(a @ excess(h, s)), float((a * s) @ density(h / s)))
