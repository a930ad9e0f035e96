"""What users get wrong with given positions and angles, undone: functions from a block to the block as it may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from aerotri.conventions import EARTH_RADIUS_M
from aerotri.observations import Block

Change = Callable[[Block], Block]
Positions = Callable[[np.ndarray], np.ndarray]


def on_positions(sets: tuple[str, ...], change: Positions) -> Change:
    """The block with `change` of (k, 3) m made to some of its sets of positions: control, check, gnss, start."""

    def changed(block: Block) -> Block:
        control, gnss, images = block.control, block.gnss_ins, block.images
        xyz = control.xyz.copy()
        for name, own in (("control", ~control.is_check), ("check", control.is_check)):
            if name in sets and own.any():
                xyz[own] = change(xyz[own])
        if "gnss" in sets and gnss is not None:
            gnss = replace(gnss, xyz=change(gnss.xyz))
        if "start" in sets:
            images = replace(images, centre=change(images.centre))
        return replace(block, control=replace(control, xyz=xyz), gnss_ins=gnss, images=images)

    return changed


def on_angles(sets: tuple[str, ...], change: Positions) -> Change:
    """The block with `change` of (k, 3) rad ω, φ, κ made to the attitudes: ins, start angles."""

    def changed(block: Block) -> Block:
        gnss, images = block.gnss_ins, block.images
        if "ins" in sets and gnss is not None:
            gnss = replace(gnss, angles=change(gnss.angles))
        if "start angles" in sets:
            images = replace(images, angles=change(images.angles))
        return replace(block, gnss_ins=gnss, images=images)

    return changed


def on_image_points(change: Positions, images: np.ndarray | None = None) -> Change:
    """The block with `change` of (k, 2) mm made to the measurements of some photographs, or of all."""

    def changed(block: Block) -> Block:
        rays = block.image_points
        own = np.ones(len(rays), bool) if images is None else np.isin(rays.image, images)
        xy, sigma = rays.xy.copy(), rays.sigma
        xy[own] = change(xy[own])
        return replace(block, image_points=replace(rays, xy=xy, sigma=sigma))

    return changed


def one_after_the_other(*changes: Change) -> Change:
    """Several changes of a block in one."""

    def changed(block: Block) -> Block:
        for change in changes:
            block = change(block)
        return block

    return changed


def x_and_y_exchanged(xyz: np.ndarray) -> np.ndarray:
    """Columns 0 and 1 exchanged."""
    return xyz[:, [1, 0, *range(2, xyz.shape[1])]]


def negated(axis: int) -> Positions:
    """One column with the other sign."""

    def changed(xyz: np.ndarray) -> np.ndarray:
        return xyz * np.where(np.arange(xyz.shape[1]) == axis, -1.0, 1.0)

    return changed


def scaled(factor: float) -> Positions:
    """All columns times a factor."""
    return lambda values: values * factor


def scaled_heights(factor: float) -> Positions:
    """The heights times a factor."""
    return lambda xyz: xyz * [1.0, 1.0, factor]


def moved_along(steps: int, strip: np.ndarray | None = None) -> Positions:
    """Row k takes what stands in row k + steps, of its strip where `strip` (n,) is given; NaN beyond the ends."""

    def changed(xyz: np.ndarray) -> np.ndarray:
        found = np.full_like(xyz, np.nan)
        groups = [np.arange(len(xyz))] if strip is None else [np.flatnonzero(strip == s) for s in np.unique(strip)]
        for rows in groups:
            there = np.arange(len(rows)) + steps
            inside = (there >= 0) & (there < len(rows))
            found[rows[inside]] = xyz[rows[there[inside]]]
        return found

    return changed


def with_rows(rows: np.ndarray, values: np.ndarray) -> Positions:
    """Some rows with other values; NaN takes them out."""

    def changed(xyz: np.ndarray) -> np.ndarray:
        found = xyz.copy()
        found[rows] = values
        return found

    return changed


def plus(vector: np.ndarray) -> Positions:
    """A vector added to every row."""
    return lambda xyz: xyz + vector


def metres_of_degrees(order: tuple[int, int], degrees: np.ndarray, metres: np.ndarray) -> Positions:
    """Longitude and latitude in degrees as metres east and north, on a sphere.

    Enough to see whether they fit. A real transformation needs the CRS.

    Parameters
    ----------
    order : columns of longitude and latitude. degrees, metres : (2,) the same place in columns 0 and 1 of both.
    """
    lon0, lat0 = np.radians(degrees[list(order)])

    def changed(xyz: np.ndarray) -> np.ndarray:
        lon, lat = np.radians(xyz[:, order[0]]), np.radians(xyz[:, order[1]])
        east = metres[0] + EARTH_RADIUS_M * np.cos(lat0) * (lon - lon0)
        return np.column_stack([east, metres[1] + EARTH_RADIUS_M * (lat - lat0), xyz[:, 2]])

    return changed


def projected_degrees(order: tuple[int, int], crs: str) -> Positions:
    """Longitude and latitude in degrees (WGS 84) in the coordinates of a CRS; `order` of their columns."""
    from pyproj import Transformer

    return _plan_by(Transformer.from_crs("EPSG:4326", crs, always_xy=True), order)


def other_zone(crs: str, own: str) -> Positions:
    """Coordinates of one CRS in another."""
    from pyproj import Transformer

    return _plan_by(Transformer.from_crs(crs, own, always_xy=True), (0, 1))


def _plan_by(transformer: Any, order: tuple[int, int]) -> Positions:
    def changed(xyz: np.ndarray) -> np.ndarray:
        plan = np.column_stack(transformer.transform(xyz[:, order[0]], xyz[:, order[1]]))
        return np.column_stack([np.where(np.isfinite(plan), plan, np.nan), xyz[:, 2]])

    return changed


def could_be_degrees(xyz: np.ndarray) -> bool:
    """Whether plan positions lie in the range of longitude and latitude and close together, as of one block."""
    plan = xyz[np.isfinite(xyz[:, :2]).all(axis=1), :2]
    return len(plan) > 1 and bool(np.abs(plan).max() <= 180.0 and 0.0 < np.ptp(plan, axis=0).max() < 5.0)


def exchanged_angles(angles: np.ndarray) -> np.ndarray:
    """ω and φ exchanged."""
    return angles[:, [1, 0, 2]]


def turned_about(kappa: float, rows: np.ndarray | None = None) -> Positions:
    """κ of all or some rows with an angle (rad) added."""

    def changed(angles: np.ndarray) -> np.ndarray:
        found = angles.copy()
        found[slice(None) if rows is None else rows, 2] += kappa
        return found

    return changed
