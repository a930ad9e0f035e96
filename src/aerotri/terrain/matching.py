"""Pickets measured by matching, from coarse to fine.

The surface is found at every level of the pyramids on nodes of its own, within what the level above leaves open; on
photographs as they are the pickets are measured: the height of best correlation on the vertical line, then the shift of
the window in every other photograph by least squares, then the intersection of the rays. Where that fails a picket
steps aside, as in Tran (2007). What is measured is matched backwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import KDTree

from aerotri.conventions import SIGMA_PER_MAD, InputError
from aerotri.execution.threads import Threads
from aerotri.execution.work import Workplace
from aerotri.terrain import _picket_kernels as kernels
from aerotri.terrain._plan_kernels import LEAST_CORRELATION, Plan
from aerotri.terrain._search_kernels import find_heights
from aerotri.terrain.photographs import Photographs, Site
from aerotri.terrain.picket_status import PicketStatus
from aerotri.terrain.pickets import Area, MatchOptions, Models, Pickets, footprint, grid_nodes
from aerotri.terrain.prior import COARSE_NODES_PX, SPARE_PX, Prior, cleaned, first_prior
from aerotri.terrain.tiles import Tile, TileWork, do_tiles

STEP_PX, COARSE_STEP_PX = 0.5, 0.5
"""Posts of parallax between heights that are tried, in the finest and in coarser levels; chosen [C]: the peak of a
correlation is about two posts wide; wider steps miss it, narrower ones only take longer."""
MOST_STEPS = 400
"""Heights tried for a node at most; chosen [C]: 200 posts of parallax; it bounds memory where the prior height is all
but unknown."""
COARSE_WINDOW = 11
"""Side of a window in coarser levels, posts, odd; chosen [C]: smaller ones find texture that repeats, larger ones blur
relief that is already coarse."""
FINE_START = 0.4
"""Correlation of the search below which nothing is measured; chosen [C]: far below the threshold of a picket, as least
squares raises it; less wastes time on windows without texture."""
LONGEST_STEP_ASIDE = 0.4
"""How far a picket may move from its node, in intervals; chosen [C]: below a half, so that neighbouring nodes never
measure one place twice."""
FEWEST_MISFITS = 20
"""Y-parallaxes that σ0 of matching is taken from at least; chosen [C]: the NMAD of 20 is known to a quarter."""
NEAREST = 40
"""Neighbours among which one of the same two photographs is looked for; chosen [C]: of fewer often none is, more lie
too far away to share the error of the orientation."""
Report = Callable[[float], None]


def measure(
    photographs: Photographs, known: np.ndarray, options: MatchOptions, area: Area | None = None,
    models: Models | None = None, report: Report | None = None, at: Workplace | None = None,
) -> Pickets:  # fmt: skip
    """Measure pickets.

    Parameters
    ----------
    known : (k, 3) points of the ground in the CRS, such as the object points of the block: where heights are looked for
        at first.
    area : where; as far as photographs reach unless given. models : the pairs to be matched; any photographs without.
    report : called with the share that is done. at : where tiles are measured; None: in threads.

    Raises
    ------
    InputError
    TasksFailedError
        When tiles could not be measured.
    """
    at = at or Workplace(Threads(), Path())
    area = footprint(photographs) if area is None else area
    gsd = float(np.median(photographs.gsd))
    nodes = grid_nodes(area, options.interval)
    if not len(nodes):
        raise InputError(
            f"no ground point (picket) lies in the area at an interval of {options.interval:g} m",
            "choose a smaller interval",
        )
    levels = photographs.store.levels
    prior = first_prior(known, area, gsd, levels)
    work = [4.0**-k for k in range(levels)]
    done = 0.0
    for level in range(levels - 1, 0, -1):
        spacing = max(COARSE_NODES_PX * gsd * 2**level, options.interval / 4.0)

        def partly(share: float, level: int = level, done: float = done) -> None:
            if report is not None:
                report((done + share * work[level]) / sum(work))

        prior = _coarse_level(photographs, area, prior, level, spacing, gsd, options, models, partly, at)
        done += work[level]

    def last(share: float) -> None:
        if report is not None:
            report((done + share * work[0]) / sum(work))

    pickets = _fine_level(photographs, nodes, prior, gsd, options, models, last, at)
    return with_sigma0(pickets, options.window_px * gsd)


def _coarse_level(
    photographs: Photographs,
    area: Area,
    prior: Prior,
    level: int,
    spacing: float,
    gsd: float,
    options: MatchOptions,
    models: Models | None,
    report: Report,
    at: Workplace,
) -> Prior:
    x, y = (
        np.linspace(a, b, max(int(np.ceil((b - a) / spacing)) + 1, 3)) for a, b in zip(area.low, area.high, strict=True)
    )
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    heights, scores = np.full(len(nodes), np.nan), np.full(len(nodes), -1.0)
    ratio = np.full(len(nodes), np.nan)
    window = gsd * 2**level

    plan = Plan(COARSE_WINDOW, window, COARSE_STEP_PX, MOST_STEPS)
    work = TileWork(photographs, nodes, prior, level, window * COARSE_WINDOW, options, models, coarse_heights, plan)
    for own, found in do_tiles(work, at, report):
        heights[own], scores[own], ratio[own] = found
    shape = len(y), len(x)
    per_post = window / float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else np.nan
    if not np.isfinite(per_post):
        raise InputError("no two photographs show the same ground", "check the photographs and the area")
    z = cleaned(heights.reshape(shape), scores.reshape(shape), per_post, prior.at(nodes)[0].reshape(shape))
    relief = maximum_filter(z, 3) - minimum_filter(z, 3)
    return Prior(x, y, z, SPARE_PX * per_post / 2.0 + 0.5 * relief)


def _fine_level(
    photographs: Photographs,
    nodes: np.ndarray,
    prior: Prior,
    gsd: float,
    options: MatchOptions,
    models: Models | None,
    report: Report,
    at: Workplace,
) -> Pickets:
    n, m = len(nodes), 2 if models is not None else options.most_photographs
    out = Pickets(
        node=nodes, xyz=np.full((n, 3), np.nan), covariance=np.full((n, 3, 3), np.nan),
        status=np.ones(n, np.int8), tries=np.zeros(n, np.int16), photographs=np.full((n, m), -1, np.int32),
        correlation=np.full(n, np.nan), model=np.full(n, -1, np.int32), misfit=np.full(n, np.nan),
        names=photographs.names, sigma0=np.nan,
    )  # fmt: skip
    aside = steps_aside(options, gsd)
    plan = Plan(
        options.window_px, gsd, STEP_PX, MOST_STEPS, float(options.search_px), options.distinct, options.threshold,
        options.agreeing, options.largest_sigma_px, min(FINE_START, options.threshold),
    )  # fmt: skip

    work = TileWork(
        photographs, nodes, prior, 0, gsd * options.window_px + np.abs(aside).max(), options, models, fine_pickets,
        FineHow(aside, plan, m),
    )  # fmt: skip
    for own, found in do_tiles(work, at, report):
        out.status[own], out.tries[own] = found.status, found.tries
        out.correlation[own], out.model[own] = found.correlation, found.model
        rows = own[found.measured]
        out.xyz[rows], out.covariance[rows] = found.xyz, found.covariance
        out.photographs[rows], out.misfit[rows] = found.photographs, found.misfit
    return out


def coarse_heights(shared: TileWork, tile: Tile) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights of the nodes of a tile (n,) m, their correlations, and base over height of their photographs."""
    h, s = np.empty(len(tile.delta)), np.empty(len(tile.delta))
    find_heights(tile.view, tile.nodes, shared.how, h, s)
    return tile.site.place[2] + h, s, tile.base_ratios()


@dataclass(frozen=True, eq=False)
class FineHow:
    """Steps aside (t, 2) m, the plan of the kernels, and photographs of a picket at most."""

    aside: np.ndarray
    plan: Plan
    most: int


@dataclass(frozen=True, eq=False)
class FoundPickets:
    """Of the n nodes of a tile; m of them are measured.

    Parameters
    ----------
    status, tries, correlation, model : (n,) as of `Pickets`. measured : (n,) bool.
    xyz, covariance, photographs, misfit : (m, …) as of `Pickets`.
    """

    status: np.ndarray
    tries: np.ndarray
    correlation: np.ndarray
    model: np.ndarray
    measured: np.ndarray
    xyz: np.ndarray
    covariance: np.ndarray
    photographs: np.ndarray
    misfit: np.ndarray


def fine_pickets(shared: TileWork, tile: Tile) -> FoundPickets:
    """The pickets of a tile."""
    k, how = len(tile.own), shared.how
    found = kernels.MeasuredNodes(
        status=np.empty(k, np.int8), tries=np.zeros(k, np.int16), point=np.full((k, 3), np.nan),
        covariance=np.full((k, 3, 3), np.nan), used=np.zeros((k, how.most), bool), numbers=np.full((k, 4), np.nan),
        shifts=np.zeros((k, how.most, 6)),
    )  # fmt: skip
    curvatures = shared.prior.curvatures(shared.nodes[tile.own])
    kernels.measure_pickets(tile.view, tile.nodes, curvatures, how.aside, how.plan, found)
    measured = (found.status == PicketStatus.ACCEPTED) | (found.status >= PicketStatus.BACKWARD)
    points = found.point[measured]
    photographs, place = _packed(tile.chosen[measured], found.used[measured])
    first_shift = found.shifts[measured][np.arange(len(points)), place]
    return FoundPickets(
        found.status, found.tries, found.numbers[:, LEAST_CORRELATION], tile.model, measured,
        tile.site.from_delta(points), found.covariance[measured], photographs,
        _misfit(tile.site, points, photographs[:, :2], first_shift),
    )  # fmt: skip


def _packed(chosen: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The used photographs to the front, in their order, and the place (n,) of the second of them before."""
    order = np.argsort(~used, axis=1, kind="stable")
    packed = np.take_along_axis(chosen, order, axis=1)
    return np.where(np.take_along_axis(used, order, axis=1), packed, -1), order[:, 1]


def _misfit(site: Site, points: np.ndarray, pair: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(n,) what shifts (n, 6) of `kernels.turned_shift` are across the direction of parallax, over its σ."""
    lean = [(points[:, :2] - c[:, :2]) / (c[:, 2] - points[:, 2])[:, None] for c in (site.centres[p] for p in pair.T)]
    e = lean[1] - lean[0]
    e /= np.linalg.norm(e, axis=1)[:, None]
    across = e[:, 0] * shift[:, 1] - e[:, 1] * shift[:, 0]
    variance = e[:, 1] ** 2 * shift[:, 2] + e[:, 0] ** 2 * shift[:, 3] - 2.0 * e[:, 0] * e[:, 1] * shift[:, 4]
    return across / np.sqrt(np.maximum(variance, 1e-30))


def steps_aside(options: MatchOptions, gsd: float) -> np.ndarray:
    """(t, 2) m, offsets tried one after the other, the nearest first, the node itself before all."""
    step = options.aside_px * gsd
    reach = int(LONGEST_STEP_ASIDE * options.interval / step)
    at = step * np.arange(-reach, reach + 1)
    offsets = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    away = np.hypot(*offsets.T)
    order = np.argsort(away, kind="stable")
    return offsets[order[away[order] <= LONGEST_STEP_ASIDE * options.interval + 1e-9]][: options.most_aside + 1]


def with_sigma0(pickets: Pickets, apart: float) -> Pickets:
    """The pickets with covariances scaled by how large the y-parallaxes are.

    Those of an orientation that is off are the same for neighbours; what differs between pickets near one another of
    the same two photographs is matching. Medians keep gross errors out.

    Parameters
    ----------
    apart : m from which on windows have no pixels in common.
    """
    own = np.flatnonzero(pickets.accepted & np.isfinite(pickets.misfit))
    if len(own) < FEWEST_MISFITS:
        return pickets
    pair, plan = pickets.photographs[own, :2], pickets.xyz[own, :2]
    away, near = (np.asarray(found) for found in KDTree(plan).query(plan, min(NEAREST, len(own))))
    fits = (away >= apart) & (pair[near] == pair[:, None]).all(axis=2)
    has = fits.any(axis=1)
    if has.sum() < FEWEST_MISFITS:
        return pickets
    other = near[has, fits[has].argmax(axis=1)]
    difference = np.abs(pickets.misfit[own][has] - pickets.misfit[own][other])
    sigma0 = float(SIGMA_PER_MAD * np.median(difference) / np.sqrt(2.0))
    return replace(pickets, covariance=pickets.covariance * sigma0**2, sigma0=sigma0)
