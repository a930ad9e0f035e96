"""With what a block's photographs are restituted: their true orientation, the one in use, and their image errors.

Two variants, always labelled. `free`: the orientation of the self-calibrated block, the photographs used uncorrected.
`absorbed`: the orientation of an adjustment without additional parameters, which swallows part of the image errors.
What a rolling shutter does is an image error too: in use, all rows of a photograph count as exposed at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.deformation.absorbed import absorbed_orientation, absorbed_partials
from aerotri.deformation.error_parameters import error_rows
from aerotri.deformation.orientation import Orientation, calibrated_orientation
from aerotri.deformation.photo_errors import PhotoErrors, errors_by_image
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import CameraField

FREE, ABSORBED, GIVEN = "free", "absorbed", "given"
VARIANTS = (FREE, ABSORBED)
ORIENTED = {
    FREE: "photographs oriented with additional parameters",
    ABSORBED: "photographs oriented without additional parameters",
    GIVEN: "photographs oriented as stated",
}
"""The variants in words."""

SIGMA_INCLUDES = {
    FREE: (
        "with the uncertainty of the additional parameters; that of the orientation has nearly no effect; without the "
        "noise of matching and measuring"
    ),
    ABSORBED: (
        "with the uncertainty of the additional parameters, less what the orientation without them takes over; without "
        "the noise of matching and measuring"
    ),
}
SIGMA_INCLUDES[GIVEN] = SIGMA_INCLUDES[ABSORBED] + "; the given orientation is taken for one of the same observations"


@dataclass(frozen=True, eq=False)
class Restitution:
    """All n photographs of a block, in its local frame.

    Parameters
    ----------
    variant : 'free', 'absorbed', or 'given' for an orientation from elsewhere.
    true, used : the orientation after the self-calibration, with the motion of rolling shutters, and the one the models
        are restituted with, which knows none.
    errors : image errors of the groups of photographs. group : (n,) which of them each photograph has.
    follows : (n, 9, p) partials of the used orientation by the additional parameters, as `absorbed_partials`.
    covariance : (p, p) of the additional parameters, σ̂0² and the model part included.
    change : how the errors of the photographs change that make the model part, '' where there is none.
    left : what the additional parameters leave of image errors; None where nothing shows, or nobody asked.
    """

    variant: str
    true: Orientation
    used: Orientation
    errors: tuple[PhotoErrors, ...]
    group: np.ndarray
    follows: np.ndarray
    covariance: np.ndarray
    change: str = ""
    left: CameraField | None = None


def sigma_in_words(variant: str, change: str) -> str:
    """What σ of a deformation contains; variant and change as of `Restitution`."""
    said = SIGMA_INCLUDES[variant]
    if not change:
        return said
    return f"{said}; with the model part, because the errors of the photographs change {change}"


def restitution_of(calibration: Adjustment, variant: str = FREE, used: Orientation | None = None) -> Restitution:
    """The restitution of a block.

    Parameters
    ----------
    variant : 'free' or 'absorbed'; of no meaning where `used` is given.
    used : orientation from elsewhere, (n,) photographs of the block.

    Raises
    ------
    AbsorptionFailedError
    """
    rows = error_rows(calibration)
    errors, group = errors_by_image(calibration, rows)
    true = calibrated_orientation(calibration)
    follows = np.zeros((len(true), 9, len(rows)))
    if used is not None:
        variant, follows = GIVEN, absorbed_partials(calibration)
    elif variant == ABSORBED:
        used, follows = absorbed_orientation(calibration).orientation, absorbed_partials(calibration)
    else:
        used = true.standing_still
    covariance = calibration.local.parameters.total_covariance[np.ix_(rows, rows)]
    part = calibration.local.model_part
    return Restitution(variant, true, used, errors, group, follows, covariance, "" if part is None else part.change)
