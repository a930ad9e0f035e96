"""What additional parameters leave of a camera's errors: a random field over the format, the same in all photographs.

The adjustment takes image errors for noise. What all photographs of a camera share bends a surface that is measured in
them, however many cells there are. [D] As in `cluster_fields` camera k has the errors s_k = B·p_k at its rays, p_k its
nodes over the format with the covariance σ_s²·R, R = exp(−ρ²/2ℓ²), ℓ a share of its own half diagonal, and the scores
h = BᵀPv have the covariance σ0²·K + σ_s²·K·R·K. Here the noise is not known beforehand: σ̂0 of the adjustment holds the
field. With γ = σ_s²/σ0², the eigenvalues λ of K^½·R·K^½, z = h in their directions, whitened, and the redundancy r the
restricted likelihood is that of

    r·ln Ω(γ) + Σ ln(1 + γλ),   Ω(γ) = vᵀPv − Σ z²·γλ/(1 + γλ),   σ0² = Ω/r.

The residuals tell the size of the field, and much of the field itself. Given them its nodes have, with S = σ_s²·R and
H = (σ0²·K + K·S·K)⁺, the mean p̂ = S·K·H·h and the covariance C = S − S·K·H·K·S. Nothing is corrected by p̂, so that the
mean square about zero counts, p̂·p̂ᵀ + C: where the residuals say nothing it is S, where they say all it is that of the
errors that are there.

A place that is intersected from rays with gains G moves by G·B·p, and with the unknowns by J·F·p, F = Q·AᵀPB: where the
parameters describe a part of the field both cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from aerotri.results.adjustment import Adjustment
from aerotri.results.model_part import ModelRoot
from aerotri.statistics.cluster_fields import (
    NODES,
    SEEN,
    SIZES,
    FieldEquations,
    correlations,
    field_equations,
    half_formats,
    node_counts,
    nodes_at,
    roots_of_fields,
    spread_of_fields,
)
from aerotri.statistics.cluster_test import LEVEL
from aerotri.statistics.clusters import CAMERA, Clusters

LENGTHS = (0.2, 0.28, 0.4, 0.57, 0.8, 1.13, 1.6)
"""Correlation lengths looked at, in half diagonals of each format, from that of the nodes to that of the format."""
LEAST = 1e-12
"""Of vᵀPv that no field explains: rounding."""
MOST_CAMERAS = 12
"""Cameras with a field each at most; chosen [C]: each has seventy columns in the equations."""
MOST_PHOTOGRAPHS = 60_000
"""Photographs times cameras at most; chosen [C]: the equations have 3.4 kB of each, held about eight times, so that
they need 1.6 GB then. 20 000 photographs of one camera take 3.5 s of one processor, the adjustment 58 s."""


_KNOWN: WeakKeyDictionary[Adjustment, CameraField | None] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class CameraField:
    """The fields of all cameras of a block.

    Parameters
    ----------
    sigma : mm, of an image coordinate. length : ℓ as a share of the half diagonal of each camera's format.
    gain : twice the logarithm of the likelihood with the field over that without.
    noise : σ0 of what the field leaves as noise, dimensionless; σ̂0 of the adjustment holds both.
    root : (m, 2, nodes, k) mm, root·rootᵀ the mean products of the nodes of all parts, given the residuals.
    half : (c, 2) mm, half formats of all cameras. counts : (c, 2) their nodes along x and y.
    part : (c,) place of a camera among the m with photographs, −1 for others.
    by_unknowns : (6n + s, k) F·root of the unknowns of the reduced system.
    """

    sigma: float
    length: float
    gain: float
    noise: float
    root: np.ndarray
    half: np.ndarray
    counts: np.ndarray
    part: np.ndarray
    by_unknowns: np.ndarray

    def moved(self, gain: np.ndarray, xy: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(r, d, k) what image errors do through the gains (r, d, 2) of rays, m a mm.

        Parameters
        ----------
        xy : (r, 2) mm from the middle of the format. camera : (r,).
        """
        node, weight = nodes_at(xy, self.half[camera], self.counts[camera])
        own = self.root[self.part[camera][:, None], :, node]
        return np.einsum("rdi,rc,rcik->rdk", gain, weight, own, optimize=True)

    def summed(self, gain: np.ndarray, xy: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(k,) the sum over many rays of what `moved` gives for each, gains (r, 2)."""
        node, weight = nodes_at(xy, self.half[camera], self.counts[camera])
        onto, part = np.zeros(self.root.shape[:3]), self.part[camera][:, None]
        for axis in range(2):
            np.add.at(onto[:, axis], (part, node), weight * gain[:, axis, None])
        return np.einsum("min,mink->k", onto, self.root)


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


def model_beside_field(found: Adjustment) -> ModelRoot | None:
    """The root of the model part of σ beside what is known of the field of the cameras; None where there is none.

    A field takes the place of a model part that is of the same errors, and not of what another set of parameters would
    change.
    """
    root = found.model
    if root is None or known_field(found) is None or not is_of_camera(found):
        return root
    return root.beside


def too_little_said(found: Adjustment) -> str:
    """Why the residuals say too little for a field: no final σ0, or too few of them; '' where they say enough."""
    outcome, u = found.local.outcome, found.system.unknowns
    if found.solution.status != "converged" or not outcome.sigma0 > 0.0:
        return "the adjustment has no final σ0"
    coordinates = 2 * NODES[0] * NODES[1] * len(np.unique(u.block.images.camera[u.images]))
    return f"the redundancy is below {2 * coordinates}" if outcome.redundancy < 2 * coordinates else ""


def not_looked_for(found: Adjustment) -> str:
    """Why no field is looked for although there may be one, '' where it is.

    A field in a free block would depend on which coordinates hold it.
    """
    u = found.system.unknowns
    photographs, cameras = len(u.images), len(np.unique(u.block.images.camera[u.images]))
    if u.block.settings.adjustment.is_free:
        return "the datum of the block is free"
    if cameras > MOST_CAMERAS:
        return f"the block has {cameras} cameras, more than {MOST_CAMERAS}"
    if photographs * cameras > MOST_PHOTOGRAPHS:
        most = f"{MOST_PHOTOGRAPHS // cameras}" + (f" with {cameras} cameras" if cameras > 1 else "")
        return f"the block has {photographs} photographs, more than {most}"
    return ""


def missing_in_sigma(found: Adjustment) -> str:
    """A sentence where σ lacks what the parameters may leave of the errors of cameras, '' else.

    None where the user has switched it off, or the residuals say too little to have a reason to fear it.
    """
    reason = not_looked_for(found)
    if not reason or found.system.unknowns.block.settings.adjustment.model_part == "off" or too_little_said(found):
        return ""
    return f"{reason}: image errors that the additional parameters leave were not looked for and are not in σ"


def camera_field(found: Adjustment) -> CameraField | None:
    """The fields; None where the residuals are explained by noise, and for the reasons of the two functions above."""
    if too_little_said(found) or not_looked_for(found):
        return None
    system, solution, outcome = found.system, found.solution, found.local.outcome
    u = system.unknowns
    factor = system.factorise(solution.equations)
    one = Clusters(CAMERA, np.zeros(len(u.images), np.int64), ("",), 1)
    equations = field_equations(system, solution, factor, one)
    gain, variance, noise, length = _most_likely(found, equations, outcome.sigma0**2 * outcome.redundancy)
    if np.exp(-0.5 * gain) >= LEVEL:
        return None
    nodes = _known_nodes(equations, variance * correlations(u.block.cameras, length, True), noise)
    part = np.full(len(u.block.cameras), -1)
    part[equations.camera] = np.arange(len(equations.camera))
    by_unknowns = factor.solve(np.ascontiguousarray(equations.sides @ nodes))
    by_unknowns[: 6 * len(u.images)] *= u.eo_free.reshape(-1, 1)
    return CameraField(
        float(np.sqrt(variance)),
        length,
        gain,
        float(np.sqrt(noise)),
        nodes.reshape(len(equations.camera), 2, -1, nodes.shape[1]),
        half_formats(u.block.cameras),
        node_counts(u.block.cameras),
        part,
        by_unknowns,
    )


def _known_nodes(equations: FieldEquations, prior: np.ndarray, noise: float) -> np.ndarray:
    """(2·m·nodes, k) root of the mean products of all nodes: their mean, and the root of their covariance.

    Parameters
    ----------
    prior : (c, nodes, nodes) mm², σ_s²·R of the cameras of the block. noise : σ0².
    """
    roots = np.repeat(roots_of_fields(prior)[equations.camera], 2, axis=0)
    m, nodes, k = roots.shape
    root = np.zeros((m, nodes, m, k))
    root[np.arange(m), :, np.arange(m)] = roots
    root = root.reshape(m * nodes, m * k)
    spread, scores = _seen(equations)
    along = spread.T @ root
    lower = np.linalg.cholesky(noise * np.eye(root.shape[1]) + along.T @ along)
    mean = root @ np.linalg.solve(lower.T, np.linalg.solve(lower, along.T @ scores))
    return np.column_stack([mean, np.sqrt(noise) * np.linalg.solve(lower, root.T).T])


def _seen(equations: FieldEquations) -> tuple[np.ndarray, np.ndarray]:
    """K^½ (2·m·nodes, q) of the patterns that residuals show, and z, the scores along them, whitened."""
    values, vectors = np.linalg.eigh(equations.normals)
    there = values > SEEN * values[-1]
    root = vectors[:, there] * np.sqrt(values[there])
    return root, (vectors[:, there].T @ equations.scores) / np.sqrt(values[there])


def _most_likely(found: Adjustment, equations: FieldEquations, squares: float) -> tuple[float, float, float, float]:
    """Twice the gain of the logarithm of the likelihood, σ_s² mm², σ0², and ℓ.

    Parameters
    ----------
    squares : σ̂0² times the redundancy: vᵀPv, with a robust estimator that of so many observations of full weight.
    """
    u, redundancy = found.system.unknowns, found.local.outcome.redundancy
    cameras = u.block.cameras
    root, z = _seen(equations)
    sizes = (float(np.median(1.0 / u.rays.inv_sigma)) * SIZES) ** 2
    best = (0.0, 0.0, squares / redundancy, 1.0)
    for length in LENGTHS:
        r = correlations(cameras, length, True)
        power, patterns = np.linalg.eigh(spread_of_fields(root, r[equations.camera]))
        grown = sizes[:, None] * np.maximum(power, 0.0)
        explained = np.sum((patterns.T @ z) ** 2 * grown / (1.0 + grown), axis=1)
        left = np.maximum(squares - explained, LEAST * squares)
        gains = redundancy * np.log(squares / left) - np.sum(np.log1p(grown), axis=1)
        n = int(np.argmax(gains))
        if gains[n] > best[0]:
            noise = float(left[n]) / redundancy
            best = (float(gains[n]), float(sizes[n]) * noise, noise, length)
    return best
