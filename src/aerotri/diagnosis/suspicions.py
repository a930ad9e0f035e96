"""What looks wrong in a block before it is adjusted: sentences, each with what to look at."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from aerotri.conventions import counted
from aerotri.diagnosis.finding import some
from aerotri.diagnosis.inventory import Inventory
from aerotri.observations import Block
from aerotri.observations.names import alike, in_words, partnerless_in_words

FEW_POINTS = 4
"""Image points that a photograph needs for its six elements, one to spare [C]."""
SMALL_PART = 0.25
"""Share of the half format that the outermost image point of a camera should reach [C]: photographs are measured up to
their edges, and a wrong unit or size is off by far more."""
FEWEST_PLACES = 8
"""Image points of a camera that tell what part of its format is measured [C]: two photographs with four each."""
APART = 3.0
"""Distance of control from the photographs in plan, in the size of the larger of the two areas, from which it is asked
whether both are in one system [C]."""
UNLIKE, FEWEST_SPANNING = 20.0, 3
"""Ratio of the areas that control and photographs span, in length, from which their units are asked for, and control
points that span an area [C]: of control in one corner alone the question is worth it too."""
HALF_CIRCLE = {"degrees": 180.0, "gon": 200.0, "radians": np.pi}
"""A turn of 180° in the units of angles."""
NEAR_HALF = 0.05
"""Difference from a half circle, in half circles, up to which two strips count as flown in opposite directions."""
SMALLEST_PIXEL_UM = 0.3
"""Below the wavelength of light; the smallest pixels of sensors have 0.5 µm."""
LARGE_SIGMA = 0.02
"""σ of a control point in the extent of all, from which its unit is asked for [C]: control from a map 1:50 000 over a
single photograph stays below."""
FEWEST_IN_STRIP = 3
"""Photographs of a strip that tell its direction."""


def suspicions(block: Block, found: Inventory, angle_unit: str) -> tuple[str, ...]:
    """Sentences about what looks wrong.

    Parameters
    ----------
    found : what the block holds. angle_unit : 'degrees', 'gon' or 'radians', in which its files have the angles.
    """
    return (
        *partnerless_in_words(block),
        *_lonely(block, found),
        *_apart(found),
        *_alike(block),
        *_places(block),
        *_units(block),
        *_angle_unit(block, angle_unit),
    )


def suspicions_of_lists(block: Block) -> tuple[str, ...]:
    """Sentences about places and units of what was put together: the same for every command that reads lists.

    Start values of photographs may be in axes of their own, so places are compared with GNSS positions alone.
    """
    return (*(() if block.gnss_ins is None else _places(block)), *_units(block))


def _units(block: Block) -> tuple[str, ...]:
    """Sentences about what seems to be in another unit."""
    return (*_formats(block), *_pixels(block), *_control_sigma(block))


def _lonely(block: Block, found: Inventory) -> list[str]:
    """Photographs with too few image points, points of one photograph."""
    said, rays = [], block.image_points
    if found.without_image_points:
        names = some(np.array(found.without_image_points))
        said.append(f"{counted(len(found.without_image_points), 'photograph')} without image points ({names})")
    count = np.bincount(rays.image, minlength=len(block.images))
    few = np.flatnonzero((count > 0) & (count < FEW_POINTS))
    if len(few):
        said.append(
            f"{counted(len(few), 'photograph')} with fewer than {FEW_POINTS} image points "
            f"({some(block.images.names[few])})"
        )
    of_point = np.bincount(rays.point, minlength=len(block.points))
    single = np.setdiff1d(np.flatnonzero(of_point == 1), block.control.point)
    if len(single):
        names = block.points[single].astype(str).tolist()
        others = block.points[of_point > 1].astype(str).tolist()
        said.append(f"{counted(len(single), 'point')} measured in one photograph only: {in_words(names, others)}")
    return said


def _apart(found: Inventory) -> list[str]:
    """Strips and parts of the block that no point ties to the others."""
    said = [
        f"strip '{strip.name}' has no point in common with another strip"
        for strip in found.strips
        if len(found.strips) > 1 and not strip.common_points
    ]
    if len(found.parts) > 1:
        sizes = ", ".join(str(len(part)) for part in found.parts[:5]) + (" …" if len(found.parts) > 5 else "")
        first = some(np.array(found.parts[1]))
        said.append(
            f"the block falls into {len(found.parts)} parts without common points, of {sizes} photographs ({first})"
        )
    return said


def _alike(block: Block) -> list[str]:
    """Names that differ only in what people write in two ways."""
    said = []
    for names, what in ((block.images.names, "photographs"), (block.points, "points")):
        groups = alike(names.astype(str).tolist())
        if groups:
            shown = "; ".join(", ".join(f"'{name}'" for name in group) for group in groups[:3])
            more = f" and {len(groups) - 3} more" if len(groups) > 3 else ""
            said.append(f"names of {what} look alike: {shown}{more}: are they the same?")
    return said


def _pixels(block: Block) -> list[str]:
    """Pixels smaller than any sensor has."""
    return [
        f"camera '{camera.name}' has pixels of {camera.pixel_um:.3g} µm: pixel_um is in micrometres, is it in "
        "millimetres here?"
        for camera in block.cameras
        if camera.pixel_um < SMALLEST_PIXEL_UM
    ]


def _control_sigma(block: Block) -> list[str]:
    """σ of control and check points that are large against the area they span."""
    control = block.control
    there = np.isfinite(control.xyz[:, :2]).all(axis=1)
    span = float(np.hypot(*np.ptp(control.xyz[there, :2], axis=0))) if there.any() else 0.0
    large = np.isfinite(control.xyz) & (control.sigma > LARGE_SIGMA * span)
    if not span > 0.0 or not large.any():
        return []
    names = some(block.points[control.point[large.any(axis=1)]])
    return [
        f"σ of control or check points of up to {control.sigma[large].max():.4g} m ({names}), where all lie within "
        f"{span:.4g} m: is σ in metres?"
    ]


def _places(block: Block) -> list[str]:
    """Control and check points against where the photographs were taken: another system, X and Y exchanged, heights."""
    flown = block.images.centre if block.gnss_ins is None else block.gnss_ins.xyz
    where = "start values of the photographs" if block.gnss_ins is None else "GNSS positions"
    above = flown[np.isfinite(flown[:, :2]).all(axis=1)]
    said = []
    for is_check, what in ((False, "control lies"), (True, "check points lie")):
        xyz = block.control.xyz[block.control.is_check == is_check]
        ground = xyz[np.isfinite(xyz[:, :2]).all(axis=1)]
        if not len(ground) or len(above) < 2:
            continue
        if _distance(ground, above) > APART:
            away = float(np.hypot(*(np.median(ground[:, :2], axis=0) - np.median(above[:, :2], axis=0))))
            turned = _distance(ground[:, [1, 0, 2]], above) <= APART
            why = "X and Y of one of the two look exchanged" if turned else "are both in the same coordinate system?"
            said.append(f"{what} {away:.4g} m from the {where}: {why}")
        elif not is_check:
            said += [*_spans(ground, above, where), *_heights(ground[:, 2], above[:, 2], where)]
    return said


def _spans(ground: np.ndarray, above: np.ndarray, where: str) -> list[str]:
    """Areas of quite different size: one of the lists is in another unit, or the control lies in one corner."""
    one, other = (float(np.hypot(*np.ptp(xyz[:, :2], axis=0))) for xyz in (ground, above))
    if len(ground) < FEWEST_SPANNING or min(one, other) <= 0.0 or 1.0 / UNLIKE < one / other < UNLIKE:
        return []
    return [f"control spans {one:.3g} m, the {where} {other:.3g} m: are both in metres?"]


def _distance(ground: np.ndarray, above: np.ndarray) -> float:
    """How far apart the middles are in plan, in the size of the larger area."""
    size = max(float(np.ptp(xyz[:, :2], axis=0).max()) for xyz in (ground, above))
    away = np.median(ground[:, :2], axis=0) - np.median(above[:, :2], axis=0)
    return float(np.hypot(*away)) / size if size > 0.0 else 0.0


def _heights(ground: np.ndarray, above: np.ndarray, what: str) -> list[str]:
    ground, above = ground[np.isfinite(ground)], above[np.isfinite(above)]
    if not len(ground) or not len(above) or np.median(above) > np.median(ground):
        return []
    heights = f"{np.median(above):.4g} m, control at {np.median(ground):.4g} m"
    return [f"the {what} are at {heights}, not above it: are both heights of the same kind?"]


def _formats(block: Block) -> list[str]:
    """Image points that fill only the middle of their format, or one place of it, as millimetres read as pixels do."""
    said, rays = [], block.image_points
    camera = block.images.camera[rays.image]
    for number, one in enumerate(block.cameras):
        own = camera == number
        if not own.any() or one.fiducials:
            continue
        place = rays.xy[own] / np.array(one.half_format_mm)
        reach, spread = float(np.abs(place).max()), float(np.ptp(place, axis=0).max()) / 2.0
        if min(reach, spread) < SMALL_PART and len(place) >= FEWEST_PLACES:
            said.append(
                f"the image points of camera '{one.name}' fill {100.0 * min(reach, spread):.2g} % of its format: check "
                "image_unit, size_px and pixel_um"
            )
    return said


def _angle_unit(block: Block, unit: str) -> list[str]:
    """κ of strips flown in opposite directions differs by half a circle: in which unit it does, the angles are."""
    images, own = block.images, HALF_CIRCLE[unit]
    centre, angles = images.centre, images.angles
    if block.gnss_ins is not None:
        centre, angles = centre.copy(), angles.copy()
        rows = block.gnss_ins.image
        for target, values in ((centre, block.gnss_ins.xyz), (angles, block.gnss_ins.angles)):
            target[rows] = np.where(np.isfinite(values), values, target[rows])
    # as the file has them
    kappa = angles[:, 2] / np.pi * own
    strips = np.asarray(images.strip)
    flown = []
    for name in dict.fromkeys(strips.tolist()):
        rows = np.flatnonzero((strips == name) & np.isfinite(centre[:, :2]).all(axis=1) & np.isfinite(kappa))
        if name and len(rows) >= FEWEST_IN_STRIP:
            along = centre[rows[-1], :2] - centre[rows[0], :2]
            flown.append((along / max(float(np.hypot(*along)), 1e-9), float(np.median(kappa[rows]))))
    fits = dict.fromkeys(HALF_CIRCLE, 0)
    opposite = [(a, b) for (u, a), (v, b) in pairwise(flown) if float(u @ v) < -0.9]
    for a, b in opposite:
        for name, half in HALF_CIRCLE.items():
            turn = abs((b - a + half) % (2.0 * half) - half)
            fits[name] += abs(turn / half - 1.0) < NEAR_HALF
    best = max(fits, key=lambda name: fits[name])
    if not opposite or fits[unit] or fits[best] < max(1, len(opposite) // 2):
        return []
    return [f"κ of strips flown in opposite directions differs by half a circle in {best}, but angle_unit says {unit}"]
