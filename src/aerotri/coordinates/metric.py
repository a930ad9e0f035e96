"""A block out of degrees into metres, and whether positions lie where their CRS is meant to be used."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.blocks import frame_of_block
from aerotri.coordinates.georeference import area_of_use, is_projected, utm_on_datum
from aerotri.coordinates.local_frame import LocalFrame, local_frame
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block

if TYPE_CHECKING:
    from pyproj import Transformer

OUTSIDE_DEG = 1.0
"""Degrees beyond the area of use of a CRS that nobody is told of: strips beside a zone are common."""


def in_metres(block: Block, geoid: FilePath | None = None) -> tuple[Block, str]:
    """A block in a geographic CRS in the UTM zone of its datum, with the heights it has, and a sentence about it.

    Positions are transformed exactly, attitudes turn from geographic to grid north, σ from east and north to the axes
    of the grid; a σ of 0 stays 0.

    Raises
    ------
    InputError
        When a point has one of its plan coordinates alone.
    """
    if block.crs == "local" or is_projected(block.crs):
        return block, ""
    here = frame_of_block(block, geoid)
    flat, _, height = block.crs.partition("+")
    target = utm_on_datum(flat, *here.origin[:2])
    crs = f"{target}+{height}" if height else target
    transformer = _plan_transformer(flat, target)
    places = [block.control.xyz, block.images.centre] + ([] if block.gnss_ins is None else [block.gnss_ins.xyz])
    around = np.concatenate([_moved(xyz, transformer) for xyz in places])
    there = local_frame(crs, around, geoid, here.origin)
    control = block.control
    block = replace(
        block, crs=crs,
        control=replace(
            control, xyz=_moved(control.xyz, transformer), sigma=_turned_sigma(control.xyz, control.sigma, here, there)
        ),
        images=replace(
            block.images, centre=_moved(block.images.centre, transformer),
            angles=_turned(block.images.angles, block.images.centre, here, there, block.rotation),
        ),
        gnss_ins=None if block.gnss_ins is None else replace(
            block.gnss_ins, xyz=_moved(block.gnss_ins.xyz, transformer),
            sigma=_turned_sigma(block.gnss_ins.xyz, block.gnss_ins.sigma, here, there),
            angles=_turned(block.gnss_ins.angles, block.gnss_ins.xyz, here, there, block.rotation),
        ),
    )  # fmt: skip
    return block, f"the block is in {here.crs}, which counts in degrees: brought to {crs}, results are in metres there"


def outside_in_words(frame: LocalFrame) -> str:
    """A sentence where the middle of a block lies outside the area of use of its CRS; '' elsewhere."""
    lon, lat = (float(value) for value in frame.origin[:2])
    area = area_of_use(frame.crs)
    if area is None:
        return ""
    west, south, east, north = area
    beside = min(abs((lon - edge + 180.0) % 360.0 - 180.0) for edge in (west, east))
    within = west <= lon <= east if west <= east else lon >= west or lon <= east
    off = max(0.0 if within else beside, south - lat, lat - north)
    if off <= OUTSIDE_DEG:
        return ""
    zone = utm_on_datum("EPSG:4326", lon, lat)
    return (
        f"the positions lie at {_degrees(lon, 'EW')}, {_degrees(lat, 'NS')}, {off:.1f}° outside the area of use of "
        f"{frame.crs} ({_degrees(west, 'EW')} to {_degrees(east, 'EW')}, {_degrees(south, 'NS')} to "
        f"{_degrees(north, 'NS')}): is it the right zone, and are the coordinates in it? UTM there is {zone}"
    )


def _degrees(value: float, letters: str) -> str:
    return f"{abs(value):.2f}° {letters[value < 0.0]}"


def _plan_transformer(source: str, target: str):
    from pyproj import Transformer

    return Transformer.from_crs(source, target, always_xy=True, allow_ballpark=False)


def _moved(xyz: np.ndarray, transformer: Transformer) -> np.ndarray:
    """(n, 3) with the plan transformed; heights stay."""
    known = np.isfinite(xyz[:, :2])
    if (known.any(axis=1) & ~known.all(axis=1)).any():
        raise InputError("a point has its longitude or its latitude alone", "give both, or neither", "control.csv")
    out = xyz.copy()
    own = known.all(axis=1)
    out[own, 0], out[own, 1] = transformer.transform(xyz[own, 0], xyz[own, 1])
    return out


def _turn(places: np.ndarray, here: LocalFrame, there: LocalFrame) -> np.ndarray:
    """(n, 3, 3) from the axes of the geographic CRS at places to those of the projected one."""
    middle = here.from_local(np.zeros((1, 3)))[0]
    places = np.where(np.isfinite(places), places, middle)
    geographic = here.georeference.to_geographic(places)
    between = there.local_from_geocentric @ here.local_from_geocentric.T
    axes = there.axes_at(there.georeference.from_geographic(geographic))
    return np.swapaxes(axes, 1, 2) @ between @ here.axes_at(places)


def _turned(angles: np.ndarray, places: np.ndarray, here: LocalFrame, there: LocalFrame, order: str) -> np.ndarray:
    known = np.isfinite(angles)
    rotation = _turn(places, here, there) @ rotation_from_angles(np.where(known, angles, 0.0), order)
    return np.where(known, angles_from_rotation(rotation, order), np.nan)


def _turned_sigma(places: np.ndarray, sigma: np.ndarray, here: LocalFrame, there: LocalFrame) -> np.ndarray:
    turn = _turn(places, here, there)
    spread = np.sqrt(np.einsum("nij,nj->ni", turn**2, np.nan_to_num(sigma) ** 2))
    spread = np.where(sigma == 0.0, 0.0, spread)
    return np.where(np.isfinite(sigma), spread, np.nan)
