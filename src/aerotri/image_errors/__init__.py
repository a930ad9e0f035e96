"""What the camera does wrong: systematic image errors from the parameters, and what the residuals still show."""

from aerotri.image_errors.averaged_residuals import AveragedResiduals, averaged_residuals
from aerotri.image_errors.change import Change, change, group_changes
from aerotri.image_errors.field import (
    ErrorField,
    field_between,
    field_difference,
    field_of,
    field_on_grid,
    field_without_orientation,
    largest_effects,
    lens_errors,
    systematic_errors,
)
from aerotri.image_errors.groups import ImageGroup, image_group, image_groups, interior_elements, interior_model_sigmas

__all__ = [
    "AveragedResiduals",
    "Change",
    "ErrorField",
    "ImageGroup",
    "averaged_residuals",
    "change",
    "field_between",
    "field_difference",
    "field_of",
    "field_on_grid",
    "field_without_orientation",
    "group_changes",
    "image_group",
    "image_groups",
    "interior_elements",
    "interior_model_sigmas",
    "largest_effects",
    "lens_errors",
    "systematic_errors",
]
