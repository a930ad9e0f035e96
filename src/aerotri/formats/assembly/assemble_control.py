"""Control and check points added to a block from a list of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.formats.assembly import placing
from aerotri.formats.assembly.assemble import Statements, given_or_stated, padded, refuse_local
from aerotri.formats.assembly.parts import PointList, Reading, no_sigma
from aerotri.formats.text.notes import taken
from aerotri.observations import Block, Control
from aerotri.observations.names import in_words, prefix_of, quoted, under_prefix

HEIGHTS = ("crs", "ellipsoidal")


def with_control(reading: Reading, given: PointList, stated: Statements, may_be_unmeasured: bool = False) -> Reading:
    """Control points, beside those there are.

    Parameters
    ----------
    may_be_unmeasured : whether a list of which no point is measured will do.

    Raises
    ------
    InputError
        When none of them is measured, one is there already, a standard deviation is missing, or the axes are exchanged.
    """
    block = reading.block
    if not len(given.points):
        raise InputError("holds no points", "give a row for every point", given.path)
    place = {name: i for i, name in enumerate(block.points.tolist())}
    names = np.array([under_prefix(name, stated.control_prefix, place) for name in given.points.tolist()], dtype=str)
    measured = np.array([name in place for name in names.tolist()], bool)
    if len(block.image_points) and not measured.any() and not may_be_unmeasured:
        others = block.points.astype(str).tolist()
        prefix = prefix_of(given.points.astype(str).tolist(), others)
        remedy = "use the same names"
        if prefix is not None:
            remedy = f"state what stands before them: --control-prefix {quoted(prefix)}"
        raise InputError(f"none of its points is measured: {in_words(names.tolist(), others)}", remedy, given.path)
    messages = [*reading.messages, *given.messages]
    if not measured.all() and measured.any() and len(block.image_points):
        others = np.setdiff1d(block.points, names[measured]).astype(str).tolist()
        missing = in_words(names[~measured].tolist(), others)
        messages.append(
            f"{given.path.name}: {counted(int((~measured).sum()), 'point is', 'points are')} not measured: {missing}"
        )
    for name in names.tolist():
        place.setdefault(name, len(place))
    point = np.array([place[name] for name in names.tolist()], dtype=np.int64)
    twice = np.isin(point, block.control.point)
    if twice.any():
        message = f"point '{names[np.flatnonzero(twice)[0]]}' has coordinates already, from another file"
        raise InputError(message, "keep the row in one of the files", given.path)
    observed = no_sigma(0) if block.gnss_ins is None else block.gnss_ins.xyz
    flown = np.vstack([block.images.centre, observed])
    xyz, said = _in_block(block, given, stated, flown)
    messages += said
    placing.refuse_heights(names, xyz[:, 2], block.crs, placing.HIGHEST_GROUND_M, given.path)
    in_use = xyz[measured] if measured.any() else xyz
    placing.refuse_far_off(in_use, observed, given.path)
    placing.refuse_far_off(in_use, block.images.centre, given.path, may_be_free=True)
    known = np.isfinite(xyz)
    sigma = np.where(known, given.sigma, 1.0)
    sigma = np.where(known, given_or_stated(sigma, stated.control_sigma_m, given.path, "--control-sigma-m"), np.nan)
    old, points = block.control, np.array(list(place), dtype=str)
    both = Control(
        np.concatenate([old.point, point]),
        np.vstack([old.xyz, xyz]),
        np.vstack([old.sigma, sigma]),
        np.concatenate([old.is_check, given.is_check]),
    )
    start = None if reading.points is None else padded(reading.points, len(points))
    return Reading(replace(block, points=points, control=both), start, tuple(messages))


def _in_block(
    block: Block, given: PointList, stated: Statements, flown: np.ndarray
) -> tuple[np.ndarray, tuple[str, ...]]:  # fmt: skip
    """(k, 3) coordinates in the block's CRS, and what to say of it; flown (n, 3) m, where the photographs are."""
    if stated.control_heights not in HEIGHTS:
        raise InputError(
            f"--control-heights '{stated.control_heights}' is not possible", f"give {' or '.join(HEIGHTS)}"
        )
    if given.crs:
        refuse_local(block, given.crs, given.path)
        return placing.near_in_crs(given.xyz, given.crs, block.crs, stated.geoid, flown, given.path)
    if "ellipsoidal" in (stated.control_heights, given.heights) and "+" in block.crs:
        xyz = placing.from_ellipsoidal_heights(given.xyz, block.crs, stated.geoid)
        return xyz, (taken(f"{given.path.name}: ellipsoidal heights were brought to those of {block.crs}"),)
    if stated.control_heights == "ellipsoidal":
        raise InputError(
            f"--control-heights ellipsoidal is not needed: {block.crs} names no system of heights to bring them to",
            "leave the option out, or name the height system in --crs, such as EPSG:25832+7837",
        )
    return given.xyz, ()


def with_check_points(reading: Reading, names: tuple[str, ...], prefix: str = "") -> Reading:
    """As `block_with_check_points`, of what was read."""
    return replace(reading, block=block_with_check_points(reading.block, names, prefix))


def block_with_check_points(block: Block, names: Sequence[str], prefix: str = "") -> Block:
    """The block with control points made check points.

    Parameters
    ----------
    names : of them, with or without the prefix.

    Raises
    ------
    InputError
        For a name that is no control point.
    """
    if not names:
        return block
    control = block.points[block.control.point]
    is_check = block.control.is_check.copy()
    for name in names:
        own = np.flatnonzero(np.isin(control, [name, prefix + name, name.removeprefix(prefix)]))
        if not len(own):
            known = ", ".join(control[:8].tolist())
            raise InputError(f"--check {name}: there is no such control point", f"known are {known}")
        is_check[own] = True
    return replace(block, control=replace(block.control, is_check=is_check))
