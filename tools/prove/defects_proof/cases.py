"""Pairs of blocks: what a lack leaves free, and the same block with just enough to determine it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from aerotri import Block, with_settings
from aerotri import observations as obs
from defects_proof.flights import (
    Flight,
    corners,
    flown,
    measured,
    only_rays,
    rays_of,
    with_camera,
    with_control,
    with_gnss,
    with_points,
)

FREE_FOCAL = {"focal_length_mm": obs.Prior(100.0)}
FREE_POINT = {"x0_mm": obs.Prior(0.0), "y0_mm": obs.Prior(0.0)}


@dataclass(frozen=True)
class Case:
    """One block of the proof.

    Parameters
    ----------
    name : of the pair. free : how many directions are free, 0 for the twin. words : must be in what is said.
    """

    name: str
    free: int
    words: str
    block: Block


def cases(seed: int) -> Iterator[Case]:
    """All pairs with the random numbers of one seed."""
    for pair in PAIRS:
        yield from pair(seed)


def _first_pairs(seed: int) -> Iterator[Case]:
    block = flown(Flight(seed=seed))
    c = corners(block, 6)
    three = with_control(with_control(block, c[:2]), c[2:3], "Z")
    yield Case("no control", 7, "X, Y, Z, ω, φ, κ, scale", block)
    yield Case("no control", 0, "", three)
    yield Case("one control point", 4, "ω", with_control(block, c[:1]))
    yield Case("one control point", 0, "", three)
    yield Case("two control points", 1, "a combination of", with_control(block, c[:2]))
    yield Case("two control points", 0, "", three)
    yield Case("no height control", 1, "Z", with_control(block, c[:4], "XY"))
    yield Case("no height control", 0, "", with_control(with_control(block, c[:4], "XY"), c[4:5], "Z"))
    yield Case("height control only", 3, "X, Y, κ", with_control(block, c[:4], "Z"))
    plan_of_two = with_control(with_control(block, c[:4], "Z"), c[4:6])
    yield Case("height control only", 0, "", plan_of_two)
    yield Case("free network", 0, "", with_settings(block, datum="inner"))
    yield Case("free network, minimal", 0, "", with_settings(block, datum="minimal"))


def _flat_heights(seed: int) -> Iterator[Case]:
    block = flown(Flight(relief=0.0, seed=seed))
    c = corners(block, 6)
    plan = with_control(block, c[1:4], "XY")
    yield Case("no height control, flat ground", 3, "Z, ω, φ", with_control(plan, c[:1], "XY"))
    yield Case("no height control, flat ground", 0, "", with_control(with_control(plan, c[4:6], "Z"), c[:1]))


def _on_a_line(seed: int) -> Iterator[Case]:
    block = flown(Flight(seed=seed))
    c = corners(block, 6)
    xyz = block.control.xyz.copy()
    others = np.flatnonzero(rays_of(block) >= 4)
    others = others[~np.isin(others, c)][:2]
    for row, share in zip(others, (0.25, 0.75), strict=True):
        xyz[row] = xyz[c[0]] + share * (xyz[c[1]] - xyz[c[0]])
    block = with_points(replace(block, image_points=measured(block.images, xyz)), block.points, xyz)
    line = with_control(block, np.concatenate([c[:2], others]))
    yield Case("control on a straight line", 1, "a combination of", line)
    yield Case("control on a straight line", 0, "", with_control(line, c[2:3], "Z"))
    for off in (100.0, 10.0, 1.0):
        bent = xyz.copy()
        bent[others[0], 2] += off
        rays = measured(block.images, bent)
        near = with_points(replace(block, image_points=rays), block.points, bent)
        yield Case(f"control {off:g} m off a straight line", 0, "", with_control(near, np.append(c[:2], others)))


def _strips_apart(seed: int) -> Iterator[Case]:
    block = flown(Flight(seed=seed))
    north = (block.images.strip == "s1")[block.image_points.image]
    point, count = block.image_points.point, len(block.points)
    of_south, of_north = np.bincount(point[~north], minlength=count), np.bincount(point[north], minlength=count)
    ties = np.flatnonzero((of_south >= 2) & (of_north >= 2))
    ties = ties[np.argsort(block.control.xyz[ties, 0])]
    for name, tied, free in (
        ("strips without ties", ties[:0], 7),
        ("strips tied by one point", ties[:1], 4),
        ("strips tied by two points", ties[[0, -1]], 1),
    ):
        # what both strips see belongs to one of them, but for the ties
        lost = np.where(point % 2 == 0, ~north, north) & ((of_south > 0) & (of_north > 0))[point]
        apart = only_rays(block, ~lost | np.isin(point, tied))
        held = with_control(apart, _triangle(apart, "s0"))
        yield Case(name, free, "not determined", held)
        yield Case(name, 0, "", with_control(held, _triangle(apart, "s1")))


def _triangle(block: Block, strip: str) -> np.ndarray:
    """Three points far apart that this strip sees at least twice, and no other."""
    own = (block.images.strip == strip)[block.image_points.image]
    point, count = block.image_points.point, len(block.points)
    rows = np.flatnonzero(
        (np.bincount(point[own], minlength=count) >= 2) & (np.bincount(point[~own], minlength=count) == 0)
    )
    xy = block.control.xyz[rows, :2]
    first, second = int(np.argmin(xy[:, 0])), int(np.argmax(xy[:, 0]))
    along, off = xy[second] - xy[first], xy - xy[first]
    third = int(np.argmax(np.abs(along[0] * off[:, 1] - along[1] * off[:, 0])))
    return rows[[first, second, third]]


def _few_rays(seed: int) -> Iterator[Case]:
    block = flown(Flight(seed=seed))
    block = with_control(block, corners(block, 4))
    rays, last = block.image_points, len(block.images) - 1
    other = np.bincount(rays.point[rays.image != last], minlength=len(block.points))
    good = rays.point[(rays.image == last) & (other[rays.point] >= 2)]
    xy = flown(Flight(seed=seed)).control.xyz[good, :2]
    far = good[[int(np.argmin(xy[:, 1])), int(np.argmax(xy[:, 1])), int(np.argmax(xy[:, 0]))]]
    for count, free in ((1, 4), (2, 2)):
        keep = (rays.image != last) | np.isin(rays.point, far[:count])
        yield Case(f"a photograph with {count} point{'s' if count > 1 else ''}", free, "p007", only_rays(block, keep))
        keep = (rays.image != last) | np.isin(rays.point, far)
        yield Case(f"a photograph with {count} point{'s' if count > 1 else ''}", 0, "", only_rays(block, keep))


def _models(seed: int) -> Iterator[Case]:
    block = flown(Flight(strips=1, per_strip=2, seed=seed))
    both = np.flatnonzero(rays_of(block) == 2)
    xyz = block.control.xyz
    order = both[np.argsort(xyz[both, 1])]
    spread = order[np.unique(np.linspace(0, len(order) - 1, 7).astype(int))]
    rng = np.random.default_rng(seed)
    five = rng.permutation(spread)[:5]
    for count, free in ((4, 1), (5, 0)):
        chosen = np.isin(block.image_points.point, five[:count])
        model = with_settings(only_rays(block, chosen), datum="minimal")
        yield Case("a model of two photographs", free, "not determined" if free else "", model)


def _interior(seed: int) -> Iterator[Case]:
    level = flown(Flight(strips=2, relief=0.0, tilt=0.0, wander=0.0, seed=seed))
    control = with_control(level, corners(level, 4))
    for name, priors, free in (("free c, flat ground", FREE_FOCAL, 1), ("free x0 and y0, flat ground", FREE_POINT, 2)):
        yield Case(name, free, "mm (cam)", with_camera(control, **priors))
        yield Case(name, 0, "", with_gnss(with_camera(control, **priors)))
    moved = with_camera(with_gnss(control, shift="block"), **FREE_FOCAL)
    yield Case("free c, flat ground, GNSS with a shift", 1, "focal_length_mm (cam)", moved)
    hilly = flown(Flight(relief=200.0, tilt=0.0, wander=0.0, seed=seed))
    hilly = with_camera(with_gnss(with_control(hilly, corners(hilly, 4)), shift="block"), **FREE_FOCAL)
    yield Case("free c, flat ground, GNSS with a shift", 0, "", hilly)


def _parameters(seed: int) -> Iterator[Case]:
    block = flown(Flight(seed=seed))
    block = with_control(block, corners(block, 6))
    for name, chosen, free, enough in (
        ("two families that say the same", "ebner:all,gruen:all", 9, "ebner:all"),
        ("parameters and the turn of every photograph", "ebner:1-2,bluh:1-2", 1, "bluh:1-2"),
    ):
        yield Case(name, free, "not determined", with_settings(block, parameters=chosen))
        yield Case(name, 0, "", with_settings(block, parameters=enough))


def _gnss(seed: int) -> Iterator[Case]:
    straight = flown(Flight(strips=2, wander=0.0, seed=seed))
    c = corners(straight, 6)
    one = with_control(straight, c[:1])
    yield Case("GNSS with a shift per strip, parallel strips", 4, "X, Y, Z", with_gnss(straight, shift="strip"))
    yield Case(
        "GNSS with a shift per strip, parallel strips", 0, "", with_gnss(with_control(one, c[2:3]), shift="strip")
    )
    yield Case("… and one control point", 1, "ω", with_gnss(one, shift="strip"))
    yield Case("… and one control point", 0, "", with_gnss(with_control(one, c[2:3]), shift="strip"))
    yield Case("GNSS with a shift, no control", 3, "X, Y, Z", with_gnss(straight, shift="block"))
    yield Case("GNSS with a shift, no control", 0, "", with_gnss(one, shift="block"))
    strip = flown(Flight(strips=1, per_strip=5, wander=0.0, seed=seed))
    away = corners(strip, 3)[2:3]
    yield Case("GNSS of one straight strip", 1, "a combination of", with_gnss(strip))
    yield Case("GNSS of one straight strip", 0, "", with_gnss(with_control(strip, away)))
    drifting = with_gnss(straight, shift="strip", drift="strip")
    yield Case("GNSS with shift and drift per strip", 7, "X, Y, Z, ω, φ, κ, scale", drifting)
    enough = with_control(one, c[1:5])
    yield Case("GNSS with shift and drift per strip", 0, "", with_gnss(enough, shift="strip", drift="strip"))


def _conditions(seed: int) -> Iterator[Case]:
    block = flown(Flight(seed=seed))
    c = corners(block, 6)
    true = block.control.xyz
    one = with_control(block, c[:1])
    distance = obs.Constraints(
        np.array(["distance"]), (c[1:3],), np.array([np.linalg.norm(true[c[1]] - true[c[2]])]), np.array([0.05])
    )
    yield Case("one control point and a distance", 3, "κ", replace(one, constraints=distance))
    direction = with_control(with_control(one, c[3:4], "YZ"), c[5:6], "Z")
    yield Case("one control point and a distance", 0, "", replace(direction, constraints=distance))
    heights = obs.Constraints(
        np.array(["height_difference"] * 2), (c[[0, 1]], c[[0, 2]]), true[c[1:3], 2] - true[c[0], 2], np.full(2, 0.05)
    )
    yield Case("one control point and level points", 2, "κ", replace(one, constraints=heights))
    plan = with_control(one, c[3:4], "XY")
    yield Case("one control point and level points", 0, "", replace(plan, constraints=heights))


PAIRS: tuple[Callable[[int], Iterator[Case]], ...] = (
    _first_pairs, _flat_heights, _on_a_line, _strips_apart, _few_rays, _models, _interior, _parameters, _gnss,
    _conditions,
)  # fmt: skip
