"""Which observations data snooping takes out next, and which it takes in again: the rules of `snooping`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.unknowns import Unknowns
from aerotri.observations import AdjustmentSettings
from aerotri.statistics.outliers import MEDIAN_OF_NORMAL, spread
from aerotri.statistics.reliability import critical_value, noncentrality
from aerotri.strategies.switched_tests import AllTests, Switches, participants, photographs_of, ray_points

SAME_PHOTOGRAPH = 0.5
"""Share of the largest T of its photograph that a ray needs to be removed in the same round."""

NOT_SEPARABLE = 3.0
"""Difference of T², in units of the spread, below which two rays of a point, or two control points, cannot be told
apart."""

FEWEST_RAYS = 6
"""Rays that a photograph keeps, for its orientation needs three; one that had more than twice as many loses all rather
than be oriented by so few."""

RAYS_PER_CELL, MOST_CELLS = 100, 9
"""Rays a cell of the format has on average, and cells along a side at most [C]: the median of 200 values of |w| is
uncertain by 8 %; more cells follow errors of the camera better and judge each by fewer rays."""
SIGNIFICANT = 2.0
"""Standard deviations by which the spread in a cell of the format must exceed that of the block to count."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of |w|: of the rays (m,), and of control, positions and attitudes, to be switched off; the spread of w."""

    rays: np.ndarray
    datum: float
    spread: float


def limits_of(unknowns: Unknowns, tests: AllTests, switches: Switches) -> Limits:
    """The limits for the level and power of the block and the spread that the tests themselves have."""
    settings: AdjustmentSettings = unknowns.block.settings.adjustment
    rays = participants(unknowns, switches).rays
    scale = max(1.0, spread(tests.rays.w[rays & (tests.rays.joint > 0.0)]))
    z, datum = critical_value(settings.alpha), noncentrality(settings.alpha, settings.power)
    return Limits(z * _spread_by_cells(unknowns, tests.rays.w, rays, scale), datum * scale, scale)


def _spread_by_cells(unknowns: Unknowns, w: np.ndarray, taking_part: np.ndarray, scale: float) -> np.ndarray:
    """(m,) the spread of w in the cell of the format where a ray lies, that of the block where it is not larger."""
    block, rays = unknowns.block, unknowns.rays
    camera = block.images.camera[unknowns.images][rays.image]
    out = np.full(len(w), scale)
    for number, one in enumerate(block.cameras):
        own = np.flatnonzero(camera == number)
        cells = int(np.clip(np.sqrt(taking_part[own].sum() / RAYS_PER_CELL), 1, MOST_CELLS))
        place = (rays.xy[own] / np.array(one.half_format_mm) + 1.0) / 2.0 * cells
        column, row = np.clip(place.astype(int), 0, cells - 1).T
        cell = column * cells + row
        ends = np.cumsum(np.bincount(cell, minlength=cells * cells))
        for inside in np.split(own[np.argsort(cell, kind="stable")], ends[:-1]):
            size = np.abs(w[inside[taking_part[inside]]])
            # the median of |w| is uncertain by 1.17/√n of itself [L]
            limit = scale * (1.0 + SIGNIFICANT * 1.17 / np.sqrt(max(size.size, 1)))
            if size.size and np.median(size) / MEDIAN_OF_NORMAL > limit:
                out[inside] = np.median(size) / MEDIAN_OF_NORMAL
    return out


@dataclass(frozen=True, eq=False)
class _Sizes:
    """Joint tests T of what may go, 0 for the rest; the largest in every point (P,) and photograph (n,)."""

    rays: np.ndarray
    control: np.ndarray
    extras: tuple[np.ndarray, ...]
    in_point: np.ndarray
    in_image: np.ndarray


def to_remove(system: NormalSystem, tests: AllTests, switches: Switches, frozen: Switches, single: bool) -> Switches:
    """What to take out next; nothing when no test is beyond its limit.

    Parameters
    ----------
    frozen : what must stay. single : one observation only, be the others ever so far away from it.
    """
    u, limits = system.unknowns, limits_of(system.unknowns, tests, switches)
    point, image = ray_points(u), u.rays.image
    taking_part = participants(u, switches).rays
    sizes = _sizes(system, tests, switches, frozen)
    blamed = (tests.control.largest > limits.datum) & (sizes.control >= sizes.in_point) & (sizes.control > 0.0)
    may_go = _may_go(u, taking_part) & (sizes.rays > 0.0)
    chosen = may_go & (tests.rays.largest > limits.rays) & ~blamed[point]
    chosen &= sizes.rays >= np.maximum(sizes.in_point[point], SAME_PHOTOGRAPH * sizes.in_image[image])
    if single:
        chosen &= sizes.rays >= sizes.rays[chosen].max(initial=0.0)
    hit = np.zeros(len(u.points), dtype=bool)
    hit[point[chosen]] = True
    near = sizes.rays**2 >= sizes.in_point[point] ** 2 - NOT_SEPARABLE * limits.spread**2
    chosen |= hit[point] & near & may_go
    chosen |= taking_part & _lost(u, taking_part, chosen)[image]
    around = _largest(point[taking_part], sizes.in_image[image[taking_part]], len(u.points))
    tied = np.sum(sizes.control**2 >= sizes.control.max() ** 2 - NOT_SEPARABLE * limits.spread**2) > 1
    datum = _worst_of_datum(system, tests, sizes, blamed & (sizes.control >= around) & ~tied, limits)
    return datum if single and datum.any() else replace(datum, rays=chosen)


def to_return(system: NormalSystem, tests: AllTests, switches: Switches, returned: Switches) -> Switches:
    """What is switched off, would be within its limit, and was not `returned` before."""
    limits = limits_of(system.unknowns, tests, switches)
    off = switches.combined(returned, lambda on, before: ~on & ~before)
    return Switches(
        off.rays & (tests.rays.largest <= limits.rays) & (tests.rays.joint > 0.0),
        off.control & (tests.control.largest <= limits.datum) & (tests.control.joint > 0.0),
        tuple(gone & (t.largest <= limits.datum) for gone, t in zip(off.extras, tests.extras, strict=True)),
    )


def _sizes(system: NormalSystem, tests: AllTests, switches: Switches, frozen: Switches) -> _Sizes:
    u = system.unknowns
    point, image, n = ray_points(u), u.rays.image, len(u.images)
    taking_part = participants(u, switches).rays
    rays = np.where(taking_part & ~frozen.rays, tests.rays.joint, 0.0)
    control = np.where(switches.control & ~frozen.control, tests.control.joint, 0.0)
    extras = tuple(
        np.where(on & ~stays, test.joint, 0.0)
        for test, on, stays in zip(tests.extras, switches.extras, frozen.extras, strict=True)
    )
    in_image = _largest(image, np.maximum(rays, np.where(taking_part, control[point], 0.0)), n)
    for extra, joint in zip(system.extras, extras, strict=True):
        in_image = np.maximum(in_image, _largest(photographs_of(extra), joint, n))
    return _Sizes(rays, control, extras, _largest(point, rays, len(u.points)), in_image)


def _may_go(unknowns: Unknowns, taking_part: np.ndarray) -> np.ndarray:
    """(m,) rays whose photographs, and points that conditions tie together, keep enough rays without them."""
    point, image = ray_points(unknowns), unknowns.rays.image
    per_image = np.bincount(image[taking_part], minlength=len(unknowns.images))
    per_point = np.bincount(point[taking_part], minlength=len(unknowns.points))
    enough = (unknowns.kept < 0) | (per_point > 2)
    return taking_part & ((per_image > FEWEST_RAYS) | _expendable(unknowns))[image] & enough[point]


def _expendable(unknowns: Unknowns) -> np.ndarray:
    """(n,) photographs that had rays enough to be left out altogether when most of them are wrong."""
    return np.bincount(unknowns.rays.image, minlength=len(unknowns.images)) > 2 * FEWEST_RAYS


def _lost(unknowns: Unknowns, taking_part: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """(n,) photographs that the removal of the rays chosen leaves with too few."""
    image, n = unknowns.rays.image, len(unknowns.images)
    gone, left = np.bincount(image[chosen], minlength=n), np.bincount(image[taking_part & ~chosen], minlength=n)
    return _expendable(unknowns) & (gone > 0) & (left <= FEWEST_RAYS)


def _worst_of_datum(
    system: NormalSystem, tests: AllTests, sizes: _Sizes, control: np.ndarray, limits: Limits
) -> Switches:
    """The largest of the control points (P,) and of the positions and attitudes that may go, alone."""
    none = Switches.none_of(system)
    options = [np.where(control, sizes.control, 0.0)]
    for extra, joint, test in zip(system.extras, sizes.extras, tests.extras, strict=True):
        image = photographs_of(extra)
        may_go = (test.largest > limits.datum) & (joint >= sizes.in_image[image])
        options.append(np.where(may_go, joint, 0.0))
    largest = [option.max(initial=0.0) for option in options]
    number = int(np.argmax(largest))
    if largest[number] == 0.0:
        return none
    chosen = np.arange(len(options[number])) == np.argmax(options[number])
    if number == 0:
        return replace(none, control=chosen)
    return replace(none, extras=tuple(chosen if k == number - 1 else rows for k, rows in enumerate(none.extras)))


def _largest(index: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) the largest of the values with each index, 0 where there is none."""
    out = np.zeros(count)
    np.maximum.at(out, index, values)
    return out
