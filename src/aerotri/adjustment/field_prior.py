"""What is known beforehand of a random field: one observation of all its nodes together, 0 [D]."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.shared_parameters import RandomField
from aerotri.observations import Settings

FIRST_SIGMA = 1.5
"""σ_d to begin with, in σ of an image coordinate [C]."""
FIRST_PHOTOGRAPH_SIGMA = 0.5
"""The same of the errors of single photographs [C]."""
FIRST_LENGTH = 0.5
"""Correlation length to begin with, in half diagonals of the format [C]."""


def field_prior(field: RandomField, settings: Settings) -> JointPrior:
    """The prior of a field with the covariance that the settings say, or one to begin with."""
    sigma_um, length_mm = known_or_first(field, settings)
    weight = field.prior_weight(sigma_um, length_mm)[0]
    return JointPrior(np.arange(field.columns.start, field.columns.stop), weight, len(weight))


def known_or_first(field: RandomField, settings: Settings) -> tuple[float, float]:
    """σ_d (µm) and correlation length (mm) as the settings say, or to begin with."""
    known = settings.collocation
    sigma = FIRST_SIGMA * settings.image_sigma_um if known.sigma_um is None else known.sigma_um
    length = FIRST_LENGTH * field.camera.r_max_mm if known.length_mm is None else known.length_mm
    return sigma, length


def photograph_priors(fields: Sequence[RandomField], settings: Settings) -> tuple[JointPrior, ...]:
    """The priors of smooth errors of photographs; photographs of one camera share a weight matrix."""
    weights: dict[str, np.ndarray] = {}
    for field in fields:
        if field.camera.name not in weights:
            weights[field.camera.name] = field.prior_weight(*known_of_photographs(field, settings))[0]
    return tuple(
        JointPrior(np.arange(f.columns.start, f.columns.stop), weights[f.camera.name], len(f.items)) for f in fields
    )


def known_of_photographs(field: RandomField, settings: Settings) -> tuple[float, float]:
    """σ (µm) and correlation length (mm) of the errors of photographs as the settings say, or to begin with."""
    known = settings.photograph_fields
    sigma = FIRST_PHOTOGRAPH_SIGMA * settings.image_sigma_um if known.sigma_um is None else known.sigma_um
    length = FIRST_LENGTH * field.camera.r_max_mm if known.length_mm is None else known.length_mm
    return sigma, length
