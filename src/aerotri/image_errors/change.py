"""Did the camera change between two groups of photographs? The difference of their image errors, and a test.

Free parameters [L]: with Δ the differences of the parameters of the same name (one that only one group has counts as 0
in the other) and C their covariance, Δᵀ·C⁻¹·Δ/f is F-distributed with f and the redundancy where nothing changed.

Random field [D]: an estimate is drawn towards 0, so the posterior covariance Q is not that of its error around an
unchanged field. With prior weight P = K⁻¹ of the nodes and both groups having the same field p ~ N(0, K),
Δ = D·p̂ has C = D(Q − Q·P·Q)Dᵀ + (D(I − Q·P)J)·K·(D(I − Q·P)J)ᵀ, J the common field in both groups. The test looks in
those directions in which a change as large as the field itself would exceed the noise, so that the many combinations
of nodes that no ray sees do not water it down.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from scipy.linalg import eigh, null_space

from aerotri.adjustment.shared_parameters import random_field
from aerotri.functional_model.additional_parameters import Parameter, collocation, parameter_set
from aerotri.image_errors.field import ErrorField, field_difference
from aerotri.image_errors.groups import ImageGroup, image_groups
from aerotri.quantiles import f_exceedance
from aerotri.results.adjusted_block import AdjustedBlock

ALPHA = 0.01
"""Probability below which 'no change' is given up [C]."""
MOST_PAIRS = 10
"""Pairs of groups tested at most; where there are more, only each group with the next."""
RANK = 1e-10
"""Added to the diagonal of a correlation matrix [C]: it makes a singular one positive definite and changes no quotient
that can be told from 1."""


@dataclass(frozen=True, eq=False)
class Change:
    """First group less second group.

    Parameters
    ----------
    camera : the one they have in common, None where each has its own.
    field : the difference of the image errors with its covariance.
    statistic : F, distributed with `freedom` and the redundancy where nothing changed. p : its probability.
    noise_mm : RMS length that the difference would have by its σ alone.
    """

    first: str
    second: str
    camera: str | None
    field: ErrorField
    statistic: float
    freedom: int
    p: float
    noise_mm: float

    @property
    def changed(self) -> bool:
        """Whether 'no change' is given up."""
        return self.p < ALPHA

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        told = (
            f"the image errors of {self.first} and {self.second} differ"
            if self.changed
            else f"no change of the image errors is seen between {self.first} and {self.second}"
        )
        return (
            f"{told}: RMS {1e3 * self.field.rms:.2f} µm, largest {1e3 * self.field.max:.2f} µm, expected from σ alone "
            f"{1e3 * self.noise_mm:.2f} µm; F = {self.statistic:.2f} with {self.freedom} degrees of freedom, "
            f"p = {self.p:.2g}"
        )


def group_changes(adjusted: AdjustedBlock) -> tuple[Change, ...]:
    """The differences between the groups of a block that have additional parameters and the same format."""
    groups = [g for g in image_groups(adjusted.block) if len(_rows(adjusted, g.name))]
    pairs = [pair for pair in combinations(groups, 2) if _same_format(*pair)]
    if len(pairs) > MOST_PAIRS:
        pairs = [pair for pair in pairwise(groups) if _same_format(*pair)]
    return tuple(change(adjusted, one.name, two.name, _common_camera(one, two)) for one, two in pairs[:MOST_PAIRS])


def change(adjusted: AdjustedBlock, first: str, second: str, camera: str | None = None) -> Change:
    """The difference of two groups and the test of 'no change'."""
    delta, covariance, signal = _differences(adjusted, first, second)
    scale = np.sqrt(np.diagonal(covariance))
    seen = scale > 0.0
    delta, scale = delta[seen] / scale[seen], np.outer(scale[seen], scale[seen])
    noise, signal = covariance[np.ix_(seen, seen)] / scale, signal[np.ix_(seen, seen)] / scale
    ratio, directions = eigh(signal, noise + RANK * np.eye(len(noise))) if len(noise) else (np.zeros(0), noise)
    kept = ratio > 1.0
    freedom, redundancy = int(kept.sum()), max(adjusted.outcome.redundancy, 1)
    statistic = float(np.sum((directions[:, kept].T @ delta) ** 2)) / max(freedom, 1)
    field = field_difference(adjusted, first, second, camera=camera)
    noise_mm = float(np.sqrt(np.mean(np.sum(field.sigma**2, axis=-1))))
    p = f_exceedance(statistic, freedom, redundancy) if freedom else 1.0
    return Change(first, second, camera, field, statistic, freedom, p, noise_mm)


def _common_camera(one: ImageGroup, two: ImageGroup) -> str | None:
    return one.camera.name if one.camera is two.camera else None


def _same_format(one: ImageGroup, two: ImageGroup) -> bool:
    a, b = one.camera, two.camera
    return one.name != two.name and (a.model, a.size_px, a.pixel_um) == (b.model, b.size_px, b.pixel_um)


def _rows(adjusted: AdjustedBlock, group: str) -> np.ndarray:
    """Rows of the additional parameters of a group that were adjusted."""
    p = adjusted.parameters
    varies = np.isin(p.status, ("estimated", "weighted"))
    return np.flatnonzero((p.groups == group) & (p.kinds == "additional") & varies)


def _differences(adjusted: AdjustedBlock, first: str, second: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Δ (k,), its covariance (k, k) where nothing changed, and that of a change as large as is expected beforehand."""
    p, known = adjusted.parameters, adjusted.block.settings.collocation
    rows = [_rows(adjusted, group) for group in (first, second)]
    both = np.concatenate(rows)
    names = list(dict.fromkeys(p.names[both].tolist()))
    place = {name: k for k, name in enumerate(names)}
    d = np.zeros((len(names), len(both)))
    sign = np.repeat([1.0, -1.0], [len(rows[0]), len(rows[1])])
    d[[place[name] for name in p.names[both]], np.arange(len(both))] = sign
    delta, q = d @ p.value[both], np.asarray(p.covariance[np.ix_(both, both)])
    nodes = np.array([Parameter.of(name).family == collocation.FAMILY.name for name in p.names[both]], dtype=bool)
    free = ~nodes[[int(np.flatnonzero(row)[0]) for row in d]] if len(both) else np.zeros(0, bool)
    if not nodes.any() or known.sigma_um is None or known.length_mm is None:
        covariance = d @ q @ d.T
        return delta, covariance, 1e6 * np.diag(np.diagonal(covariance))
    field = np.flatnonzero(nodes)
    items = tuple(Parameter.of(name).item for name in p.names[both[field[: len(field) // 2]]])
    camera = next(g.camera for g in image_groups(adjusted.block) if g.name == first)
    nodes_of_one = random_field(adjusted.block, parameter_set(collocation.FAMILY.name, items, camera), first, 0)
    # what a field does not have is certain: it is left out
    seen = null_space(nodes_of_one.held.T)
    s2 = adjusted.outcome.sigma0**2
    weight_of_one = seen.T @ nodes_of_one.prior_weight(known.sigma_um, known.length_mm)[0] @ seen / s2
    combined = np.zeros((int(free.sum()) + seen.shape[1], len(free)))
    combined[np.arange(free.sum()), np.flatnonzero(free)] = 1.0
    combined[int(free.sum()) :, np.flatnonzero(~free)] = seen.T
    across = np.zeros((len(q), 2 * seen.shape[1]))
    across[field] = np.kron(np.eye(2), seen)
    covariance, signal = _of_a_common_field(combined @ d, q, weight_of_one, across)
    is_free = np.arange(len(covariance)) < free.sum()
    return combined @ delta, covariance, signal + 1e6 * np.diag(np.where(is_free, np.diagonal(covariance), 0.0))


def _of_a_common_field(
    d: np.ndarray, q: np.ndarray, weight: np.ndarray, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance (k, k) of differences D·p̂ (k, p) where both groups have one field, and where each has its own.

    Parameters
    ----------
    q : (p, p) posterior covariance of all parameters. weight : (u, u) inverse prior covariance of one group's field.
    across : (p, 2u) from the fields of the two groups to the parameters.
    """
    both = across @ np.kron(np.eye(2), weight) @ across.T
    shrunk = d @ (across - q @ both @ across)
    prior = np.linalg.inv(weight)
    common = shrunk @ np.tile(np.eye(len(weight)), (2, 1))
    covariance = d @ (q - q @ both @ q) @ d.T + common @ prior @ common.T
    return covariance, shrunk @ np.kron(np.eye(2), prior) @ shrunk.T
