"""Groups of observations that share one unknown factor of their σ: who belongs to which, and how each group fits.

Image points by camera (by the parameter groups of the block), control in plan and height, GNSS in plan and height, INS
in ω, φ and in κ, conditions between points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.prepare import with_edits
from aerotri.adjustment.shared_parameters import group_of_images
from aerotri.observations import Block, Control, GnssIns
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import spread, used_rays

CONTROL_GROUPS = ("control plan", "control plan", "control height")
GNSS_GROUPS = ("GNSS plan", "GNSS plan", "GNSS height")
INS_GROUPS = ("INS omega phi", "INS omega phi", "INS kappa")
CONSTRAINT_GROUP = "constraints"
EXTRA_GROUPS = {
    **{("projection centres", axis): name for axis, name in zip("XYZ", GNSS_GROUPS, strict=True)},
    **{("attitudes", angle): name for angle, name in zip(("omega", "phi", "kappa"), INS_GROUPS, strict=True)},
    ("constraints", ""): CONSTRAINT_GROUP,
}
"""Group of an observation beside image points and control, by the name and component that its rows carry."""


@dataclass(frozen=True)
class GroupFit:
    """How the residuals of a group fit its σ.

    Parameters
    ----------
    unit : 'µm', 'm' or 'rad'. count : observations. sigma : median σ used, rms : of the residuals, in the unit.
    omega : vᵀPv of the group with the weights used; of rays in a robust adjustment what the median of their normalised
        residuals says, so that gross errors and their weights leave it alone.
    redundancy : Σ of the redundancy numbers.
    robust : `omega` comes from a median.
    """

    name: str
    unit: str
    count: int
    sigma: float
    rms: float
    omega: float
    redundancy: float
    robust: bool = False


def image_groups_of(block: Block) -> np.ndarray:
    """(n,) str, the group of image points that every photograph belongs to."""
    labels = group_of_images(block)
    if len(set(labels.tolist())) <= 1:
        return np.full(len(labels), "image points", dtype=object)
    return np.array([f"image points {label}" for label in labels], dtype=object)


def control_groups(shape: tuple[int, ...]) -> np.ndarray:
    """(·, 3) str, the groups of given coordinates X, Y, Z."""
    return np.broadcast_to(np.array(CONTROL_GROUPS, dtype=object), shape)


def group_fits(adjusted: AdjustedBlock) -> tuple[GroupFit, ...]:
    """The groups that took part in an adjustment.

    Parameters
    ----------
    adjusted : in the frame of the adjustment.
    """
    return (*_image_fits(adjusted), *_control_fits(adjusted), *_extra_fits(adjusted))


def _image_fits(adjusted: AdjustedBlock) -> list[GroupFit]:
    block, rays = adjusted.block, adjusted.rays
    robust = block.settings.adjustment.robust not in ("off", "data-snooping")
    names, used = image_groups_of(block), used_rays(adjusted)
    of_ray = names[block.image_points.image]
    fits = []
    for name in dict.fromkeys(names.tolist()):
        own = used & (of_ray == name)
        if own.any():
            v, sigma, weight = rays.v[own], block.image_points.sigma[own], rays.weight[own]
            redundancy = float(rays.r[own].sum())
            omega = float(np.sum(weight[:, None] * (v / sigma) ** 2))
            if robust:
                omega = redundancy * spread(rays.w[own].ravel()) ** 2
            fits.append(_fit(name, "µm", 1e3 * v, 1e3 * sigma, redundancy, omega, robust))
    return fits


def _control_fits(adjusted: AdjustedBlock) -> list[GroupFit]:
    block, control = adjusted.block, adjusted.control
    if block.settings.adjustment.datum != "control" or not len(control):
        return []
    given = {int(point): k for k, point in enumerate(block.control.point)}
    sigma = block.control.sigma[[given[int(point)] for point in control.point]]
    known = np.isfinite(control.r) & np.isfinite(control.difference) & (sigma > 0.0)
    names = control_groups(known.shape)[known]
    return _fits_by_name(names, "m", control.difference[known], sigma[known], control.r[known])


def _extra_fits(adjusted: AdjustedBlock) -> list[GroupFit]:
    o = adjusted.observations
    if o is None:
        return []
    names = np.array([EXTRA_GROUPS.get(key, "") for key in zip(o.group, o.component, strict=True)], dtype=object)
    in_radians, known = np.isin(names, INS_GROUPS), (names != "") & np.isfinite(o.v) & np.isfinite(o.r)
    parts = [(unit, known & (in_radians == (unit == "rad"))) for unit in ("m", "rad")]
    return [fit for unit, own in parts for fit in _fits_by_name(names[own], unit, o.v[own], o.sigma[own], o.r[own])]


def _fits_by_name(names: np.ndarray, unit: str, v: np.ndarray, sigma: np.ndarray, r: np.ndarray) -> list[GroupFit]:
    fits = []
    for name in dict.fromkeys(names.tolist()):
        own = names == name
        omega = float(np.sum((v[own] / sigma[own]) ** 2))
        fits.append(_fit(name, unit, v[own], sigma[own], float(r[own].sum()), omega))
    return fits


def _fit(name: str, unit: str, v: np.ndarray, sigma: np.ndarray, r: float, omega: float, robust: bool = False):
    return GroupFit(name, unit, v.size, float(np.median(sigma)), float(np.sqrt(np.mean(v**2))), omega, r, robust)


def with_scaled_sigmas(block: Block, factors: Mapping[str, float]) -> Block:
    """The block with the σ of its groups multiplied by their factors; a group not named keeps its σ.

    Check points keep theirs: they are no observations. `image_sigma_um` follows the image points, by the mean of their
    variances where there are several groups.
    """
    rays = block.image_points
    of_image = np.array([factors.get(name, 1.0) for name in image_groups_of(block)], dtype=float)
    of_ray = of_image[rays.image]
    common_um = block.settings.image_sigma_um * (float(np.sqrt(np.mean(of_ray**2))) if len(of_ray) else 1.0)
    sigma = rays.sigma * of_ray[:, None]
    if len(set(of_image.tolist())) == 1:
        # bit for bit what a reader makes of the common σ, so that it need not be written ray by ray
        sigma = np.where(rays.sigma == block.settings.image_sigma_um * 1e-3, common_um * 1e-3, sigma)
    constraints = block.constraints
    if constraints is not None:
        constraints = replace(constraints, sigma=constraints.sigma * factors.get(CONSTRAINT_GROUP, 1.0))
    return replace(
        block,
        image_points=replace(rays, sigma=sigma),
        control=_scaled_control(block, factors),
        gnss_ins=None if block.gnss_ins is None else _scaled_navigation(block.gnss_ins, factors),
        constraints=constraints,
        settings=replace(block.settings, image_sigma_um=common_um),
    )


def _scaled_control(block: Block, factors: Mapping[str, float]) -> Control:
    is_check = with_edits(block)[0].control.is_check
    per_axis = np.array([factors.get(name, 1.0) for name in CONTROL_GROUPS])
    return replace(block.control, sigma=block.control.sigma * np.where(is_check[:, None], 1.0, per_axis))


def _scaled_navigation(observed: GnssIns, factors: Mapping[str, float]) -> GnssIns:
    of_centre, of_angle = (
        np.array([factors.get(name, 1.0) for name in names]) for names in (GNSS_GROUPS, INS_GROUPS)
    )  # fmt: skip
    return replace(observed, sigma=observed.sigma * of_centre, angles_sigma=observed.angles_sigma * of_angle)
