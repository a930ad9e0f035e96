"""What is known beforehand of the shared parameters, of each alone and of several together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.deviations import Deviation, deviation_priors, deviations_of
from aerotri.adjustment.field_prior import field_prior, photograph_priors
from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.unknowns import Unknowns
from aerotri.observations import Block


@dataclass(frozen=True, eq=False)
class SharedPriors:
    """Observations of the s shared parameters.

    Parameters
    ----------
    weight, value : (s,) 1/σ² and the observed value of each; weight 0 where it is not observed.
    of_points : (s,) bool, coordinates of points that are not eliminated.
    fields : of the random fields. deviations : the parameters that differ from group to group, and their priors.
    position_errors : of errors of positions that stay. photograph_fields : of smooth errors of single photographs.
    """

    weight: np.ndarray
    value: np.ndarray
    of_points: np.ndarray
    fields: tuple[JointPrior, ...]
    deviations: tuple[Deviation, ...]
    deviation_priors: tuple[JointPrior, ...]
    position_errors: tuple[JointPrior, ...]
    photograph_fields: tuple[JointPrior, ...]

    @classmethod
    def of(cls, unknowns: Unknowns) -> SharedPriors:
        """As the settings of the block say."""
        shared, block = unknowns.shared, unknowns.block
        sigma = np.array(shared.sigma).reshape(-1)
        deviations = deviations_of(block, shared)
        return cls(
            weight=np.where(np.isfinite(sigma), 1.0 / sigma**2, 0.0),
            value=np.array(shared.observed).reshape(-1),
            of_points=np.array([kind == "point" for kind in shared.kinds], dtype=bool),
            fields=tuple(field_prior(field, block.settings) for field in shared.fields),
            deviations=deviations,
            deviation_priors=deviation_priors(deviations, block),
            position_errors=tuple(shared.position_errors),
            photograph_fields=photograph_priors(shared.photograph_fields, block.settings),
        )

    def as_settings_say(self, unknowns: Unknowns, block: Block) -> SharedPriors:
        """With the covariances of fields and deviations that other settings of the same block say."""
        return replace(
            self,
            fields=tuple(field_prior(field, block.settings) for field in unknowns.shared.fields),
            deviation_priors=deviation_priors(self.deviations, block),
            photograph_fields=photograph_priors(unknowns.shared.photograph_fields, block.settings),
        )

    def without(self, columns: np.ndarray) -> SharedPriors:
        """Without the observations of some parameters alone."""
        weight = self.weight.copy()
        weight[columns] = 0.0
        return replace(self, weight=weight)

    @property
    def joint(self) -> tuple[JointPrior, ...]:
        """Of several parameters together: random fields, groups, errors of positions and of photographs."""
        return (*self.fields, *self.deviation_priors, *self.position_errors, *self.photograph_fields)

    @property
    def count(self) -> int:
        """How many observations they are, coordinates of points apart."""
        return sum(prior.rank for prior in self.joint) + int((self.weight[~self.of_points] > 0.0).sum())

    def add_to(self, corner: np.ndarray, squares: np.ndarray) -> None:
        """Add the weights to the normal matrix (s, s), and those of several together to its diagonal (s,)."""
        corner[np.diag_indices_from(corner)] += self.weight
        for prior in self.joint:
            corner[np.ix_(prior.columns, prior.columns)] += prior.weight
            squares[prior.columns] += np.diagonal(prior.weight)

    def add_gaps_to(self, right: np.ndarray, shared: np.ndarray) -> tuple[float, float]:
        """Add what the observations want of the values (s,) to the right side (s,); the costs, together and alone."""
        gap, cost = self.value - shared, 0.0
        right += self.weight * gap
        for prior in self.joint:
            pull = prior.weight @ shared[prior.columns]
            right[prior.columns] -= pull
            cost += float(shared[prior.columns] @ pull)
        return cost, float(np.sum(self.weight * gap**2))

    def products(self, shared: np.ndarray) -> np.ndarray:
        """VᵀWV (k, k) of directions V (s, k) with the weights W."""
        return shared.T @ self.pulls(shared)

    def pulls(self, shared: np.ndarray) -> np.ndarray:
        """W·V (s, k) of directions V (s, k) with the weights W."""
        pulls = self.weight[:, None] * shared
        for prior in self.joint:
            pulls[prior.columns] += prior.weight @ shared[prior.columns]
        return pulls

    def root(self) -> np.ndarray:
        """(s, k) R with R·Rᵀ the weights."""
        known = np.flatnonzero(self.weight > 0.0)
        root = np.zeros((len(self.weight), len(known)))
        root[known, np.arange(len(known))] = np.sqrt(self.weight[known])
        for prior in self.joint:
            own = np.zeros((len(root), prior.rank))
            own[prior.columns] = prior.root()
            root = np.concatenate([root, own], axis=1)
        return root
