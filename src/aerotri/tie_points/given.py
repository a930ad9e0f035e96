"""What is given beside the photographs: coordinate system, positions, control, orientations; the block with them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from aerotri.adjustment.ray_status import some_names
from aerotri.conventions import counted
from aerotri.coordinates.georeference import is_projected, utm_crs
from aerotri.crs_text import plan_of
from aerotri.formats.assembly import assemble, placing
from aerotri.formats.assembly.assemble_control import with_check_points, with_control
from aerotri.formats.assembly.names_match import match_photographs
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, Reading, no_sigma
from aerotri.formats.assembly.timed import SINGLE, in_words
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.observations import Block
from aerotri.tie_points.photographs import PhotographSet
from aerotri.tie_points.settings import DEFAULTS

NEAR_M = 20_000.0
"""Distance from the photographs within which coordinates are taken for those of their UTM zone."""
EXIF_SIGMA_M = (5.0, 5.0, 10.0)
"""Standard deviations of a position that does not say how good it is: hand-held GNSS [C]."""


@dataclass(frozen=True, eq=False)
class Given:
    """What the user gives beside the photographs.

    Parameters
    ----------
    stated : CRS, geoid, standard deviations. positions : in place of EXIF. control, check : control points and the
        names of those that are check points. orientation : in place of a first orientation.
    mark_sigma_px : of the image points of control.
    """

    stated: assemble.Statements = field(default_factory=assemble.Statements)
    positions: PositionList | None = None
    control: PointList | None = None
    check: tuple[str, ...] = ()
    orientation: OrientationList | None = None
    mark_sigma_px: float = DEFAULTS.mark_sigma_px


def crs_of(photographs: PhotographSet, given: Given) -> str:
    """As stated, else of the control, positions or orientations; UTM where geographic, 'local' without any."""
    if given.stated.crs:
        return placing.known_crs(given.stated.crs)
    lists = [part for part in (given.control, given.positions, given.orientation) if part is not None]
    known = photographs.in_plan
    utm = utm_crs(*photographs.lon_lat_height[known, :2].T) if known.any() else ""
    told = placing.system_of_lists(lists)
    if told:
        # longitude and latitude of a list may be exchanged: photographs know better in which zone they lie
        in_degrees = not any(part.crs and is_projected(plan_of(part.crs)) for part in lists)
        return utm if utm and in_degrees else told
    if not utm:
        return "local"
    coordinates = [part.centre if isinstance(part, OrientationList) else part.xyz for part in lists]
    return utm if all(_lie_near(photographs.lon_lat_height[known], utm, xyz) for xyz in coordinates) else "local"


def _lie_near(lon_lat_height: np.ndarray, crs: str, xyz: np.ndarray) -> bool:
    """Whether coordinates (n, 3) without a named system may be in this one: near where the photographs are in it."""
    flown = placing.to_crs(lon_lat_height, "EPSG:4326", crs, None)[:, :2].mean(axis=0)
    plan = xyz[np.isfinite(xyz[:, :2]).all(axis=1), :2]
    return bool(len(plan)) and bool((np.hypot(*(plan - flown).T) < NEAR_M).all())


def positions_in(photographs: PhotographSet, given: Given, crs: str) -> tuple[PositionList | None, tuple[str, ...]]:
    """Positions in the CRS of the block, from a list or from EXIF."""
    if given.positions is not None:
        return given.positions, _about_list(photographs, given.positions)
    known = np.flatnonzero(np.isfinite(photographs.lon_lat_height).all(axis=1))
    without = _about_heights(photographs)
    if not len(known):
        return None, without
    if crs == "local":
        control = given.control
        why = "the block has none" if control is None else f"{control.path.name} names none and is not in UTM"
        about = f"positions of EXIF were left out for want of a coordinate system: {why}; state it with --crs"
        return None, (left_behind(about), *without)
    xyz = photographs.lon_lat_height[known]
    flat = placing.to_crs(xyz, placing.datum_of_base(xyz, placing.WGS84, plan_of(crs)), plan_of(crs), None)
    said = [*without]
    first = given.control or given.orientation
    if first is not None and not getattr(first, "crs", "") and not given.stated.crs:
        about = f"{crs}, in which it lies where the photographs were taken, is taken; state another with --crs"
        said.append(assumed(f"{first.path.name} names no coordinate system: {about}"))
    flat, heights_said = _with_heights(flat, photographs.ellipsoidal[known], crs, given)
    said += (*heights_said, *_about_rtk(photographs, known))
    stated = given.stated.positions_sigma_m
    sigma = photographs.sigma_m[known]
    if stated is None and np.isnan(sigma).any():
        about = "positions of EXIF do not say how good they are: σ {:g}, {:g}, {:g} m taken".format(*EXIF_SIGMA_M)
        said.append(assumed(about))
    sigma = np.where(np.isnan(sigma), np.array(stated or EXIF_SIGMA_M), sigma)
    path = photographs.paths[0].parent
    return PositionList(path, photographs.names[known], flat, sigma, no_sigma(len(known))), tuple(said)


def _with_heights(
    xyz: np.ndarray, ellipsoidal: np.ndarray, crs: str, given: Given
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Positions of EXIF with the heights of the CRS, and what to say of these.

    Parameters
    ----------
    xyz : (n, 3), X and Y in the CRS. ellipsoidal : (n,) bool, whether the height counts from the ellipsoid.
    """
    said = []
    if not ellipsoidal.all():
        some = "" if not ellipsoidal.any() else f" of {int((~ellipsoidal).sum())} photographs"
        said.append(placing.about_sea_level(f"EXIF{some}", crs))
    if ellipsoidal.any() and "+" in crs:
        xyz = xyz.copy()
        xyz[ellipsoidal] = placing.from_ellipsoidal_heights(xyz[ellipsoidal], crs, given.stated.geoid)
        said.append(taken(f"ellipsoidal heights of EXIF were brought to those of {crs}"))
    elif ellipsoidal.any():
        said.append(placing.about_ellipsoidal("EXIF", crs))
    return xyz, tuple(said)


def _about_rtk(photographs: PhotographSet, known: np.ndarray) -> tuple[str, ...]:
    """What to say of the solutions of a drone with RTK, of photographs (k,)."""
    if photographs.quality is None or not (photographs.quality[known] != "").any():
        return ()
    quality = photographs.quality[known]
    said = f"positions of EXIF are of RTK: {in_words(quality)}"
    if (quality == SINGLE).any():
        said += "; those of a single point get the σ that these have, whatever XMP states"
    return (taken(said),)


def _about_list(photographs: PhotographSet, positions: PositionList) -> tuple[str, ...]:
    """What to say of positions of a list that stand in place of those of EXIF."""
    many = counted(int(photographs.in_plan.sum()), "photograph")
    about = f"positions of {positions.path.name} are used in place of those in EXIF of {many}"
    return (taken(about),) if photographs.in_plan.any() else ()


def _about_heights(photographs: PhotographSet) -> tuple[str, ...]:
    """What to say of photographs whose EXIF tells longitude and latitude, and no height."""
    rows = np.flatnonzero(photographs.in_plan & np.isnan(photographs.lon_lat_height[:, 2]))
    if not len(rows):
        return ()
    names = some_names(photographs.names[rows], "photograph")
    return (
        left_behind(
            f"{names} without an altitude in EXIF: longitude and latitude tell neighbours and the UTM zone, and are no "
            "observed positions, which need a height; give these with --positions"
        ),
    )


def approximate_places(photographs: PhotographSet, positions: PositionList | None, given: Given) -> np.ndarray:
    """(n, 3) where photographs are, for the choice of neighbours alone; of EXIF where that tells more of them."""
    found = no_sigma(len(photographs))
    for names, xyz in (
        *(((positions.images, positions.xyz),) if positions is not None else ()),
        *(((given.orientation.images, given.orientation.centre),) if given.orientation is not None else ()),
    ):
        index = match_photographs(names, photographs.names)[0]
        found[index[index >= 0]] = xyz[index >= 0]
    in_plan = photographs.in_plan
    if in_plan.sum() > np.isfinite(found[:, :2]).all(axis=1).sum():
        known = photographs.lon_lat_height[in_plan]
        found = no_sigma(len(photographs))
        found[in_plan] = placing.to_crs(known, "EPSG:4326", utm_crs(*known[:, :2].T), None)
    return found


def complete(reading: Reading, given: Given, crs: str, positions: PositionList | None) -> Reading:
    """The block with its CRS, positions, and what is marked of the control."""
    reading = assemble.with_crs(reading, "" if crs == "local" else crs)
    if given.orientation is not None and is_observed(given.stated):
        reading = assemble.with_orientations(reading, given.orientation, given.stated)
    elif positions is not None:
        reading = assemble.with_positions(reading, positions, given.stated)
    control = given.control
    if control is not None and control.rays is not None and len(control.rays.image):
        reading = assemble.with_rays(reading, control.rays, given.mark_sigma_px)
        reading = with_control(reading, control, given.stated)
        reading = with_check_points(reading, given.check)
    elif control is not None:
        about = left_behind(f"{control.path.name}: its points are not marked yet, so not in use")
        reading = replace(reading, messages=(*reading.messages, about))
    return _with_datum(reading)


def with_unmarked_control(reading: Reading, given: Given) -> Reading:
    """The block with control points that nobody has marked, so that they can be marked in it.

    Without σ they stay outside, as without marks nothing has asked for it.
    """
    control = given.control
    if control is None or (control.rays is not None and len(control.rays.image)):
        return reading
    known = np.isfinite(control.xyz)
    if given.stated.control_sigma_m is None and not np.isfinite(control.sigma[known]).all():
        return reading
    return with_check_points(with_control(reading, control, given.stated, may_be_unmeasured=True), given.check)


def unmarked_points(control: PointList | None) -> tuple[str, ...]:
    """Names of the control points that are marked in no photograph."""
    if control is None:
        return ()
    rays = control.rays
    marked = set() if rays is None else set(rays.points[rays.point].tolist())
    return tuple(str(name) for name in control.points.tolist() if name not in marked)


def _with_datum(reading: Reading) -> Reading:
    """Without positions and control the datum is minimal."""
    block, settings = reading.block, reading.block.settings
    if block.gnss_ins is None and not is_held_by_control(block):
        settings = replace(settings, adjustment=replace(settings.adjustment, datum="minimal"))
    return replace(reading, block=replace(block, settings=settings))


def is_held_by_control(block: Block) -> bool:
    return int(np.isfinite(block.control.xyz[~block.control.is_check]).all(axis=1).sum()) >= 3


def is_observed(stated: assemble.Statements) -> bool:
    """Whether orientations are observations beside start values."""
    return stated.orientation_sigma_m is not None or stated.orientation_sigma_deg is not None
