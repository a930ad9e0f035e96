"""What additional parameters leave of a camera's errors: a random field over the format, the same in all photographs.

The adjustment takes image errors for noise. What all photographs of a camera share bends a surface that is measured in
them, however many cells there are. [D] As in `cluster_fields` camera k has the errors s_k = B·p_k at its rays, p_k its
nodes over the format with the covariance σ_s²·R, R = exp(−ρ²/2ℓ²), and the scores h = BᵀPv have the covariance
σ0²·K + σ_s²·K·R·K. Here the noise is not known beforehand: σ̂0 of the adjustment holds the field. With γ = σ_s²/σ0²,
the eigenvalues λ of K^½·R·K^½, z = h in their directions, whitened, and the redundancy r the restricted likelihood is
that of

    r·ln Ω(γ) + Σ ln(1 + γλ),   Ω(γ) = vᵀPv − Σ z²·γλ/(1 + γλ),   σ0² = Ω/r.

A place that is intersected from rays with gains G moves by G·B·p, and with the unknowns by J·F·p, F = Q·AᵀPB: where the
parameters describe a part of the field both cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from aerotri.results.adjustment import Adjustment
from aerotri.statistics.cluster_fields import (
    KEPT,
    SIZES,
    FieldEquations,
    correlations,
    field_equations,
    half_format,
    node_counts,
    nodes_at,
    of_patterns,
)
from aerotri.statistics.cluster_test import LEVEL
from aerotri.statistics.clusters import CAMERA, LARGE, Clusters
from aerotri.statistics.model_part import why_not

LENGTHS = (0.2, 0.28, 0.4)
"""Correlation lengths looked at, in half diagonals of the format; chosen [C]: longer ones explain the residuals as
well, and σ of heights is then up to twice the errors of simulated cameras of which parameters were estimated."""
SEEN = 1e-4
"""Eigenvalue of K over the largest below which a pattern does not count; chosen [C]: the unknowns take nearly all of it
up, and what is left shows where the iterations ended."""
LEAST = 1e-12
"""Of vᵀPv that no field explains: rounding."""
MOST_CAMERAS = 12
"""Cameras with a field each at most; chosen [C]: each has seventy columns in the equations."""


_KNOWN: WeakKeyDictionary[Adjustment, CameraField | None] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class CameraField:
    """The fields of all cameras of a block.

    Parameters
    ----------
    sigma : mm, of an image coordinate. length : mm.
    gain : twice the logarithm of the likelihood with the field over that without.
    noise : σ0 of what the field leaves as noise, dimensionless; σ̂0 of the adjustment holds both.
    root : (nodes, k) of σ_s²·R. half : (c, 2) mm, half formats of all cameras. counts : nodes along x and y.
    part : (c,) place of a camera among those with photographs, −1 for others.
    by_unknowns : (6n + s, 2·m·k) F·R^½ of the unknowns of the reduced system; columns by part, component and pattern.
    """

    sigma: float
    length: float
    gain: float
    noise: float
    root: np.ndarray
    half: np.ndarray
    counts: tuple[int, int]
    part: np.ndarray
    by_unknowns: np.ndarray

    def at(self, xy: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(r, k) mm, the patterns at image places (r, 2) mm from the middle of the format, of cameras (r,)."""
        node, weight = nodes_at(xy, self.half[camera], self.counts)
        return np.einsum("rc,rck->rk", weight, self.root[node])

    def moved(self, gain: np.ndarray, xy: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(r, d, 2·m·k) what image errors do through the gains (r, d, 2) of rays, m a mm."""
        k = self.root.shape[1]
        out = np.zeros((len(gain), gain.shape[1], self.by_unknowns.shape[1] // (2 * k), 2, k))
        ray = np.arange(len(gain))
        out[ray, :, self.part[camera]] = gain[:, :, :, None] * self.at(xy, camera)[:, None, None, :]
        return out.reshape(len(gain), gain.shape[1], self.by_unknowns.shape[1])


def known_field(found: Adjustment) -> CameraField | None:
    """As `camera_field`, found once for an adjustment while it is in use; None where the model part is switched off."""
    if found.system.unknowns.block.settings.adjustment.model_part == "off":
        return None
    if found not in _KNOWN:
        _KNOWN[found] = camera_field(found)
    return _KNOWN[found]


def noise_beside_field(found: Adjustment) -> float:
    """σ0 of what is noise in the residuals, dimensionless: σ̂0 where there is no field, which it holds otherwise."""
    left = known_field(found)
    return found.local.outcome.sigma0 if left is None else left.noise


def is_of_camera(found: Adjustment) -> bool:
    """Whether the model part of σ is of errors that all photographs of a camera share: a field takes its place."""
    part = found.local.model_part
    return part is not None and part.counts and (part.clusters == 1 or part.scheme == CAMERA)


def camera_field(found: Adjustment) -> CameraField | None:
    """The fields; None where the residuals are explained by noise, or say too little.

    Too little say those of an adjustment without an end, and fewer than twice as many as the field has nodes. A field
    in a free block would depend on which coordinates hold it: there is none.
    """
    system, solution, outcome = found.system, found.solution, found.local.outcome
    u = system.unknowns
    cameras = np.unique(u.block.images.camera[u.images])
    if why_not("", len(u.images), solution.status, outcome.sigma0) or u.block.settings.adjustment.is_free:
        return None
    if len(cameras) > MOST_CAMERAS or len(u.images) * len(cameras) > LARGE:
        return None
    factor = system.factorise(solution.equations)
    one = Clusters(CAMERA, np.zeros(len(u.images), np.int64), ("",), 1)
    equations = field_equations(system, solution, factor, one)
    if outcome.redundancy < 2 * len(equations.scores):
        return None
    gain, variance, noise, length = _most_likely(found, equations, outcome.sigma0**2 * outcome.redundancy)
    if np.exp(-0.5 * gain) >= LEVEL:
        return None
    power, patterns = np.linalg.eigh(variance * correlations(u.block.cameras, length, True))
    kept = power > KEPT * power[-1]
    root = patterns[:, kept] * np.sqrt(power[kept])
    part = np.full(len(u.block.cameras), -1)
    part[equations.camera] = np.arange(len(equations.camera))
    by_unknowns = factor.solve(of_patterns(equations.sides, root))
    by_unknowns[: 6 * len(u.images)] *= u.eo_free.reshape(-1, 1)
    half = np.array([camera.half_format_mm for camera in u.block.cameras])
    return CameraField(
        float(np.sqrt(variance)),
        length,
        gain,
        float(np.sqrt(noise)),
        root,
        half,
        node_counts(u.block.cameras),
        part,
        by_unknowns,
    )


def _most_likely(found: Adjustment, equations: FieldEquations, squares: float) -> tuple[float, float, float, float]:
    """Twice the gain of the logarithm of the likelihood, σ_s² mm², σ0², and length mm.

    Parameters
    ----------
    squares : vᵀPv.
    """
    u, redundancy = found.system.unknowns, found.local.outcome.redundancy
    cameras = u.block.cameras
    values, vectors = np.linalg.eigh(equations.normals)
    there = values > SEEN * values[-1]
    root = vectors[:, there] * np.sqrt(values[there])
    z = (vectors[:, there].T @ equations.scores) / np.sqrt(values[there])
    spread = root.reshape(2 * len(equations.camera), equations.nodes.count, -1)
    unit, half = float(np.median(1.0 / u.rays.inv_sigma)), float(np.hypot(*half_format(cameras)))
    sizes = (unit * SIZES) ** 2
    best = (0.0, 0.0, squares / redundancy, half)
    for length in half * np.array(LENGTHS):
        r = correlations(cameras, length, True)
        power, patterns = np.linalg.eigh(np.einsum("cip,ij,cjq->pq", spread, r, spread, optimize=True))
        grown = sizes[:, None] * np.maximum(power, 0.0)
        explained = np.sum((patterns.T @ z) ** 2 * grown / (1.0 + grown), axis=1)
        left = np.maximum(squares - explained, LEAST * squares)
        gains = redundancy * np.log(squares / left) - np.sum(np.log1p(grown), axis=1)
        n = int(np.argmax(gains))
        if gains[n] > best[0]:
            noise = float(left[n]) / redundancy
            best = (float(gains[n]), float(sizes[n]) * noise, noise, float(length))
    return best
