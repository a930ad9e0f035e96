"""What is known beforehand of a random field: one observation of all its nodes together, 0 [D]."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.shared_parameters import RandomField
from aerotri.observations import Settings

FIRST_SIGMA = 1.5
"""σ_d to begin with, in σ of an image coordinate [C]."""
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
