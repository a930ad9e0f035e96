"""From a block to equations: which rays take part, datum, observed centres; what cannot be adjusted is named."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri import of_known
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import RayStatus, ray_status
from aerotri.adjustment.rig_start import rig_start_values
from aerotri.adjustment.robust import STAGES
from aerotri.adjustment.scanning import motions_in_words
from aerotri.adjustment.shared_parameters import cameras_of_groups, group_of_images
from aerotri.adjustment.system import build_system, nothing_to_adjust
from aerotri.adjustment.unknowns import (
    ORIENTATION_ELEMENTS,
    StartValues,
    State,
    Unknowns,
)
from aerotri.conventions import InputError, counted
from aerotri.functional_model.atmosphere import corrected_image_points
from aerotri.observations import Block
from aerotri.observations.names import partnerless_in_words
from aerotri.observations.rigs import station_fault


class NoStartValuesError(InputError):
    """No photograph has start values, and none could be had."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A block ready to be adjusted: the system, the start state, the status of every ray, what to tell the user."""

    system: NormalSystem
    state: State
    ray_status: np.ndarray
    warnings: tuple[str, ...]


def prepare(block: Block, given_points: np.ndarray | None = None) -> Prepared:
    """Set up the adjustment of a block.

    Parameters
    ----------
    given_points : (N, 3) m, start values of points where known.

    Raises
    ------
    InputError
        For settings this version cannot honour, and when no photograph has start values.
    """
    check_settings(block)
    block, off = with_edits(block)
    start = rig_start_values(block, given_points)
    if not np.isfinite(start.centre).all(axis=1).any():
        raise NoStartValuesError(
            "no photograph has start values, and none sees four known points",
            "give X0, Y0, Z0, omega, phi, kappa of some photographs in images.csv, or more control points",
            file="images.csv",
        )
    status, warnings = ray_status(block, start, off)
    if not (status == RayStatus.USED).any():
        raise nothing_to_adjust("; ".join(warnings) or "there are none")
    measured = _freed_of_the_air(block, start)
    system, state = build_system(measured, start, status)
    lonely = partnerless_in_words(block) if block.settings.adjustment.datum == "control" else ()
    u = system.unknowns
    of_motion = motions_in_words(u.block, u.images, u.scanning)
    return Prepared(system, state, status, (*warnings, *lonely, *_held_in_words(u), *of_motion, *_mixed_in_words(u)))


def _held_in_words(unknowns: Unknowns) -> tuple[str, ...]:
    count, points = int(unknowns.control_held.sum()), int(unknowns.control_held.any(axis=1).sum())
    if not count:
        return ()
    held = counted(count, "coordinate", "coordinates")
    of_points = counted(points, "control point")
    return (f"{held} of {of_points} with σ = 0 held at the given value",)


def _mixed_in_words(unknowns: Unknowns) -> tuple[str, ...]:
    """That cameras share the parameters of a group."""
    block, images = unknowns.block, unknowns.images
    if "additional" not in unknowns.shared.kinds:
        return ()
    cameras = cameras_of_groups(block.images.camera[images], group_of_images(block)[images])
    mixed = max(cameras, key=lambda group: cameras[group])
    if cameras[mixed] == 1:
        return ()
    how = block.settings.adjustment.parameter_groups
    return (
        f"the photographs of group '{mixed}' have {cameras[mixed]} cameras, which share one set of additional "
        f'parameters (parameter_groups = "{how}"). That is right for cameras that err alike; '
        'parameter_groups = "camera" gives each its own',
    )


def _freed_of_the_air(block: Block, start: StartValues) -> Block:
    """The block with image points corrected for refraction and earth curvature, as its settings ask."""
    if block.settings.refraction == "off" and block.settings.earth_curvature == "off":
        return block
    ground = of_known.median(start.points[:, 2]) + start.origin[2]
    xy = corrected_image_points(block, start.rotation, start.centre + start.origin, ground)
    return replace(block, image_points=replace(block.image_points, xy=xy))


def check_settings(block: Block) -> None:
    """Refuse what is not available, rather than pass over it.

    Raises
    ------
    InputError
    """
    s = block.settings
    refused = [
        (s.adjustment.robust not in STAGES, f'robust = "{s.adjustment.robust}"', f"use {', '.join(STAGES)}"),
    ]
    for wrong, what, remedy in refused:
        if wrong:
            raise InputError(f"{what} is not available", remedy, file="block.toml")
    if s.adjustment.datum == "fixed" and not s.adjustment.datum_fixed:
        raise InputError(
            'datum = "fixed", but datum_fixed names no element',
            'give datum_fixed = ["PHOTOGRAPH:X0", …]',
            file="block.toml",
        )
    fault = station_fault(block.images, block.cameras, block.rigs)
    if fault is not None:
        raise InputError(fault.message, fault.remedy, file="images.csv")
    names = set(block.images.names.tolist())
    for image, element in s.adjustment.datum_fixed:
        if image not in names or element not in ORIENTATION_ELEMENTS:
            raise InputError(
                f"datum_fixed names '{image}:{element}', which is not an orientation element of the block",
                f"write PHOTOGRAPH:ELEMENT, the element one of {', '.join(ORIENTATION_ELEMENTS)}",
                file="block.toml",
            )
    unknown = set(s.adjustment.datum_points) - set(block.points.tolist())
    if unknown:
        raise InputError(
            f"datum_points names '{min(unknown)}', which is not a point of the block",
            "name points of image_points or control in datum_points",
            file="block.toml",
        )


def with_edits(block: Block) -> tuple[Block, np.ndarray]:
    """The block with the operator's decisions about control, and the rays (m,) bool that are switched off.

    `off` without a photograph takes out the coordinates of a control point, whose rays stay, or every ray of a point
    that is none.
    """
    off = np.zeros(len(block.image_points), dtype=bool)
    edits, control = block.edits, block.control
    if edits is None or not len(edits):
        return block, off
    xyz, is_check = control.xyz.copy(), control.is_check.copy()
    row = {int(point): k for k, point in enumerate(control.point)}
    for image, point, action in zip(edits.image.tolist(), edits.point.tolist(), edits.action.tolist(), strict=True):
        if action != "off":
            is_check[row[point]] = action == "check"
        elif image >= 0 or point not in row:
            off |= (block.image_points.point == point) & ((image < 0) | (block.image_points.image == image))
        else:
            xyz[row[point]] = np.nan
    return replace(block, control=replace(control, xyz=xyz, is_check=is_check)), off
