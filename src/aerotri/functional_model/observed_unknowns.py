"""Unknowns that were themselves observed: projection centres by GNSS, attitudes by INS.

[L] X_gnss + v = X0 + R·lever_arm + shift + drift·(t − t_s) + velocity·time_offset + c(t); c: the error that stays for
a while, interpolated between the two nodes around the exposure; lever arm from the projection centre
to the antenna in the camera frame, t_s the mean time of the strip.
[L] R_ins + v = R·R_boresight (R_boresight: INS → camera): δ = Log(R_model·R_obsᵀ) in object axes, and v = E⁻¹δ with E
of the observed angles, so that the σ of ω, φ, κ apply as they are given. Body axes would swap ω and φ at κ = 90°.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.rotation import cross_matrix, exponential, logarithm, small_rotation_per_angle


@dataclass(frozen=True, eq=False)
class Rows:
    """Observations beside the image points, linearised; g of them with k components.

    Parameters
    ----------
    name : of the group. unit : 'm' or 'rad'.
    labels : (g,) what each is about. components : (k,) names.
    image : (g,) row of the photograph, −1 where none is touched.
    gap : (g, k) observed − predicted. inv_sigma : (g, k), 0 where a component was not observed.
    by_image : (g, k, 6) partials of the prediction by centre and small rotation.
    columns : (g, c) shared parameters touched, −1 for none. by_shared : (g, k, c).
    """

    name: str
    unit: str
    labels: np.ndarray
    components: tuple[str, ...]
    image: np.ndarray
    gap: np.ndarray
    inv_sigma: np.ndarray
    by_image: np.ndarray
    columns: np.ndarray
    by_shared: np.ndarray

    @property
    def count(self) -> int:
        """Number of observed values."""
        return int((self.inv_sigma > 0.0).sum())


@dataclass(frozen=True, eq=False)
class CentreObservations:
    """Observed antenna positions, g of them.

    Parameters
    ----------
    labels : (g,) photographs. image : (g,) row of the photograph.
    xyz : (g, 3) m, local. inv_sigma : (g, 3) 1/m, 0 where a coordinate is not observed.
    shift, drift : (g, 3) shared parameter of each coordinate, −1 where there is none.
    lever : (3,) shared parameters of the lever arm, −1 where it is held at `lever_arm` (3,) m.
    offset : (g,) shared parameter of the time offset. velocity : (g, 3) m/s. time : (g,) s from the strip's mean.
    nodes : (g, 3, 2) shared parameters of the errors that stay for a while, of every coordinate at the two nodes around
        the exposure; None where there are none. by_nodes : (g, 2) their weights.
    """

    labels: np.ndarray
    image: np.ndarray
    xyz: np.ndarray
    inv_sigma: np.ndarray
    shift: np.ndarray
    drift: np.ndarray
    lever: np.ndarray
    lever_arm: np.ndarray
    offset: np.ndarray
    velocity: np.ndarray
    time: np.ndarray
    nodes: np.ndarray | None = None
    by_nodes: np.ndarray | None = None

    @property
    def count(self) -> int:
        """Number of observed values."""
        return int((self.inv_sigma > 0.0).sum())

    def rows(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> Rows:
        """Linearised at (n, 3), (n, 3, 3), (s,)."""
        turned = rotation[self.image]
        lever_arm = np.where(self.lever >= 0, _values(shared, self.lever), self.lever_arm)
        arm = turned @ lever_arm
        predicted = centre[self.image] + arm
        predicted = predicted + _values(shared, self.shift) + _values(shared, self.drift) * self.time[:, None]
        predicted = predicted + self.velocity * _values(shared, self.offset)[:, None]
        by_image = np.zeros((len(self.image), 3, 6))
        by_image[:, :, :3] = np.eye(3)
        by_image[:, :, 3:] = -cross_matrix(arm)
        g = len(self.image)
        by_shared = np.zeros((g, 3, 10))
        by_shared[:, :, :3] = np.eye(3)
        by_shared[:, :, 3:6] = np.eye(3) * self.time[:, None, None]
        by_shared[:, :, 6:9] = turned
        by_shared[:, :, 9] = self.velocity
        columns = np.concatenate(
            [self.shift, self.drift, np.broadcast_to(self.lever, (g, 3)), self.offset[:, None]], axis=1
        )
        if self.nodes is not None and self.by_nodes is not None:
            weights = self.by_nodes[:, None, :]
            predicted = predicted + np.sum(weights * _values(shared, self.nodes), axis=2)
            columns = np.concatenate([columns, self.nodes.reshape(g, 6)], axis=1)
            of_nodes = (np.eye(3)[None, :, :, None] * weights[:, None]).reshape(g, 3, 6)
            by_shared = np.concatenate([by_shared, of_nodes], axis=2)
        gap = np.where(self.inv_sigma > 0.0, self.xyz - predicted, 0.0)
        return Rows(
            "projection centres", "m", self.labels, ("X", "Y", "Z"), self.image, gap, self.inv_sigma, by_image, columns,
            by_shared,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class AttitudeObservations:
    """Observed attitudes, g of them.

    Parameters
    ----------
    labels : (g,) photographs. image : (g,) row of the photograph.
    rotation : (g, 3, 3) observed, INS → object. angles : (g, 3) rad, the same as ω, φ, κ in `order`.
    inv_sigma : (g, 3) 1/rad, of ω, φ, κ; 0 where not observed.
    boresight : (g, 3) shared parameters of the boresight vector b, −1 where there is none.
    boresight_start : (g, 3, 3) R_boresight = exp([b]×)·boresight_start.
    drift : (g, 3) shared parameters, rad/s. time : (g,) s from the strip's mean.
    """

    labels: np.ndarray
    image: np.ndarray
    rotation: np.ndarray
    angles: np.ndarray
    order: str
    inv_sigma: np.ndarray
    boresight: np.ndarray
    boresight_start: np.ndarray
    drift: np.ndarray
    time: np.ndarray

    @property
    def count(self) -> int:
        """Number of observed values."""
        return int((self.inv_sigma > 0.0).sum())

    def rows(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> Rows:
        """Linearised at (n, 3), (n, 3, 3), (s,)."""
        turned, b = rotation[self.image], _values(shared, self.boresight)
        model = turned @ exponential(b) @ self.boresight_start
        delta = logarithm(model @ np.swapaxes(self.rotation, 1, 2))
        per_angle = small_rotation_per_angle(self.angles, self.order)
        to_angles = np.linalg.inv(per_angle)
        predicted = np.einsum("gij,gj->gi", to_angles, delta) + _values(shared, self.drift) * self.time[:, None]
        by_delta = to_angles @ inverse_left_jacobian(delta)
        g = len(self.image)
        by_image = np.zeros((g, 3, 6))
        by_image[:, :, 3:] = by_delta
        by_shared = np.zeros((g, 3, 6))
        by_shared[:, :, :3] = by_delta @ turned @ left_jacobian(b)
        by_shared[:, :, 3:] = np.eye(3) * self.time[:, None, None]
        gap = np.where(self.inv_sigma > 0.0, -predicted, 0.0)
        columns = np.concatenate([self.boresight, self.drift], axis=1)
        return Rows(
            "attitudes", "rad", self.labels, ("omega", "phi", "kappa"), self.image, gap, self.inv_sigma, by_image,
            columns, by_shared,
        )  # fmt: skip


def left_jacobian(delta: np.ndarray) -> np.ndarray:
    """J with exp([δ + dδ]×) = exp([J·dδ]×)·exp([δ]×); (..., 3) → (..., 3, 3)."""
    angle, k = np.linalg.norm(delta, axis=-1)[..., None, None], cross_matrix(delta)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    b = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + a * k + b * (k @ k)


def inverse_left_jacobian(delta: np.ndarray) -> np.ndarray:
    """The inverse of `left_jacobian`: Log(exp([dδ]×)·exp([δ]×)) = δ + J⁻¹·dδ."""
    angle, k = np.linalg.norm(delta, axis=-1)[..., None, None], cross_matrix(delta)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    b = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, 1.0 / safe**2 - 0.5 / (safe * np.tan(safe / 2.0)))
    return np.eye(3) - 0.5 * k + b * (k @ k)


def _values(shared: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Values of shared parameters, 0 where there is no column."""
    there = columns >= 0
    return np.where(there, shared[np.where(there, columns, 0)], 0.0) if there.any() else np.zeros(columns.shape)
