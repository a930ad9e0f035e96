"""Pickets: heights measured on a grid by matching, from coarse to fine.

The surface is found at every level of the pyramids on nodes of its own, within what the level above leaves open; on
photographs as they are the pickets are measured: the height of best correlation on the vertical line, then the shift of
the window in every other photograph by least squares, then the intersection of the rays. Where that fails a picket
steps aside, as in Tran (2007). What is measured is matched backwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator, RegularGridInterpolator
from scipy.ndimage import distance_transform_edt, gaussian_filter, maximum_filter, median_filter, minimum_filter
from scipy.spatial import KDTree

from aerotri.adjustment.parallel import thread_count
from aerotri.conventions import InputError
from aerotri.terrain import _kernels as kernels
from aerotri.terrain.photographs import Photographs, Site, site_at

STATUS = ("accepted", "not seen", "low correlation", "at the end of the heights", "no texture along the base",
          "backward", "ambiguous", "neighbours", "peak or pit")  # fmt: skip
"""What became of a node, by its number; from 'backward' on it is an error picket."""
FIRST_ERROR = 5
NEIGHBOURS, PEAK = 7, 8
COARSE_NODES_PX = 8
TILE_NODES = 40
LARGEST_TILE_PX = 1500
STEP_PX, COARSE_STEP_PX = 0.5, 0.5
MOST_STEPS = 400
SPARE_PX = 4.0
"""Posts of parallax by which a height is looked for about the one of the level above."""
COARSE_WINDOW = 11
COARSE_CORRELATION, FINE_START = 0.5, 0.5
OUTLIER_PX = 3.0
LONGEST_STEP_ASIDE = 0.4
STEEPEST = 1.5
CURVATURE_NODES = 2.0
NMAD, FEWEST_MISFITS, NEAREST = 1.4826, 20, 40
Report = Callable[[float], None]


@dataclass(frozen=True)
class MatchOptions:
    """How pickets are measured.

    Parameters
    ----------
    interval : m between pickets.
    window_px : posts a side of a window, odd. threshold : correlation from which a match counts.
    edge : share of the format at its edge that is not used.
    most_photographs : that take part in a picket, the most upright ones.
    largest_sigma_px : of a parallax, from the texture of the window.
    search_px : posts searched along the rays when matching backwards. distinct : share of the best correlation that
        no other place there may reach.
    aside_px, most_aside : steps aside, posts, and how many.
    """

    interval: float
    window_px: int = 17
    threshold: float = 0.90
    edge: float = 0.10
    most_photographs: int = 5
    largest_sigma_px: float = 0.3
    search_px: float = 16.0
    distinct: float = 0.9
    aside_px: float = 8.0
    most_aside: int = 24


@dataclass(frozen=True, eq=False)
class Area:
    """Rectangle (2,) … (2,) m in the CRS."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True, eq=False)
class Models:
    """Pairs of photographs that are the only ones to be matched.

    Parameters
    ----------
    pairs : (k, 2) into the photographs. middles : (k, 2) m, middles of their bases in the CRS.
    """

    pairs: np.ndarray
    middles: np.ndarray


@dataclass(frozen=True, eq=False)
class Pickets:
    """What became of n nodes.

    Parameters
    ----------
    node : (n, 2) m, planned. xyz : (n, 3) in the CRS, NaN where nothing was measured.
    covariance : (n, 3, 3) m², of matching: σ̂0² of the rays of all pickets is in it.
    status : (n,) number in `STATUS`. tries : (n,) steps aside.
    photographs : (n, m) into `names`, −1 where there are fewer; the first is the reference.
    correlation : (n,) lowest of the rays, or the best there was.
    model : (n,) number of the model, −1 where photographs were chosen freely.
    misfit : (n,) y-parallax of the first two photographs over the σ that texture and grey values let expect.
    names : of the photographs. sigma0 : of the rays over the same σ.
    """

    node: np.ndarray
    xyz: np.ndarray
    covariance: np.ndarray
    status: np.ndarray
    tries: np.ndarray
    photographs: np.ndarray
    correlation: np.ndarray
    model: np.ndarray
    misfit: np.ndarray
    names: np.ndarray
    sigma0: float

    def __len__(self) -> int:
        return len(self.node)

    @property
    def accepted(self) -> np.ndarray:
        """(n,) bool."""
        return self.status == 0

    @property
    def errors(self) -> np.ndarray:
        """(n,) bool, measured and found to be in error."""
        return self.status >= FIRST_ERROR

    @property
    def sigma(self) -> np.ndarray:
        """(n, 3) m, of matching."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


@dataclass(frozen=True, eq=False)
class Prior:
    """Where to look: heights (ny, nx) m on nodes x rising and y rising, and how far about them."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    spare: np.ndarray

    def at(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights (n,) m, slopes (n, 2) and half ranges (n,) m."""
        by_y, by_x = np.gradient(self.z, self.y, self.x)
        found = self._between(xy, self.z, by_x, by_y, self.spare)
        return found[:, 0], np.clip(found[:, 1:3], -STEEPEST, STEEPEST), found[:, 3]

    def curvatures(self, xy: np.ndarray) -> np.ndarray:
        """(n,) 1/m, RMS of the second derivatives by x and by y around places (n, 2)."""
        by_y, by_x = np.gradient(self.z, self.y, self.x)
        second = np.gradient(by_x, self.x, axis=1), np.gradient(by_y, self.y, axis=0)
        mean_square = gaussian_filter(0.5 * (second[0] ** 2 + second[1] ** 2), CURVATURE_NODES)
        return np.sqrt(self._between(xy, mean_square)[:, 0])

    def _between(self, xy: np.ndarray, *tables: np.ndarray) -> np.ndarray:
        place = np.column_stack([np.clip(xy[:, 1], self.y[0], self.y[-1]), np.clip(xy[:, 0], self.x[0], self.x[-1])])
        return RegularGridInterpolator((self.y, self.x), np.stack(tables, axis=-1))(place)


def measure(
    photographs: Photographs, known: np.ndarray, options: MatchOptions, area: Area | None = None,
    models: Models | None = None, report: Report | None = None,
) -> Pickets:  # fmt: skip
    """Measure pickets.

    Parameters
    ----------
    known : (k, 3) points of the ground in the CRS, such as the object points of the block: where heights are looked for
        at first.
    area : where; as far as photographs reach unless given. models : the pairs to be matched; any photographs without.
    report : called with the share that is done.

    Raises
    ------
    InputError
    """
    area = footprint(photographs) if area is None else area
    gsd = float(np.median(photographs.gsd))
    nodes = grid_nodes(area, options.interval)
    if not len(nodes):
        raise InputError(f"no picket lies in the area at an interval of {options.interval:g} m", "choose a smaller one")
    levels = photographs.store.levels
    prior = _first_prior(known, area, gsd, levels, options)
    work = [4.0 ** -k for k in range(levels)]
    done = 0.0
    for level in range(levels - 1, 0, -1):
        spacing = max(COARSE_NODES_PX * gsd * 2**level, options.interval / 4.0)

        def partly(share: float, level: int = level, done: float = done) -> None:
            if report is not None:
                report((done + share * work[level]) / sum(work))

        prior = _coarse_level(photographs, area, prior, level, spacing, gsd, options, models, partly)
        done += work[level]

    def last(share: float) -> None:
        if report is not None:
            report((done + share * work[0]) / sum(work))

    pickets = _fine_level(photographs, nodes, prior, gsd, options, models, last)
    return with_sigma0(pickets, options.window_px * gsd)


def grid_nodes(area: Area, interval: float) -> np.ndarray:
    """(n, 2) whole multiples of the interval in an area, row by row: two sets of photographs get the same nodes."""
    x, y = (
        interval * np.arange(np.ceil(low / interval - 1e-9), np.floor(high / interval + 1e-9) + 1)
        for low, high in zip(area.low, area.high, strict=True)
    )
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def footprint(photographs: Photographs) -> Area:
    """What the photographs show at the mean height of the ground."""
    half = photographs.sensor[:, :2] / photographs.sensor[:, 2:]
    corners = []
    for sx, sy in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        c, x0, y0 = photographs.orientation.interior.T
        ray = np.column_stack([sx * half[:, 0] - x0, sy * half[:, 1] - y0, -c])
        ray = np.einsum("nij,nj->ni", photographs.orientation.rotation, ray)
        down = np.where(ray[:, 2] < 0.0, ray[:, 2], np.nan)
        height = photographs.centres[:, 2] - photographs.ground
        reach = np.clip(np.abs(height / down), 0.0, 5.0 * height / c)
        corners.append(photographs.centres[:, :2] + ray[:, :2] * reach[:, None])
    all_corners = np.concatenate(corners)
    all_corners = all_corners[np.isfinite(all_corners).all(axis=1)]
    return Area(all_corners.min(axis=0), all_corners.max(axis=0))


def _first_prior(known: np.ndarray, area: Area, gsd: float, levels: int, options: MatchOptions) -> Prior:
    """From points of the ground: their heights, and as much about them as they differ."""
    known = known[np.isfinite(known).all(axis=1)]
    if len(known) < 3:
        raise InputError("the block has fewer than three object points", "adjust a block with tie points")
    low, high = np.percentile(known[:, 2], [0.5, 99.5])
    size = area.high - area.low
    spacing = max(size.max() / 60.0, COARSE_NODES_PX * gsd * 2 ** (levels - 1))
    x, y = (np.linspace(a, b, max(int((b - a) / spacing) + 1, 3)) for a, b in zip(area.low, area.high, strict=True))
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    z = LinearNDInterpolator(known[:, :2], known[:, 2])(nodes)
    nearest = NearestNDInterpolator(known[:, :2], known[:, 2])(nodes)
    z = gaussian_filter(np.where(np.isfinite(z), z, nearest).reshape(len(y), len(x)), 1.0)
    spare = np.full(z.shape, 0.75 * (high - low) + SPARE_PX * gsd * 2 ** (levels - 1) / 0.3)
    return Prior(x, y, z, spare)


def _coarse_level(photographs, area: Area, prior: Prior, level: int, spacing: float, gsd: float, options, models,
                  report: Report) -> Prior:  # fmt: skip
    x, y = (
        np.linspace(a, b, max(int(np.ceil((b - a) / spacing)) + 1, 3)) for a, b in zip(area.low, area.high, strict=True)
    )
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    heights, scores = np.full(len(nodes), np.nan), np.full(len(nodes), -1.0)
    ratio = np.full(len(nodes), np.nan)
    window = gsd * 2**level

    def one(tile: _Tile) -> None:
        h, s = np.empty(len(tile.delta)), np.empty(len(tile.delta))
        kernels.find_heights(
            tile.view, tile.delta, tile.slopes, tile.ranges, tile.chosen, COARSE_WINDOW, window, COARSE_STEP_PX,
            MOST_STEPS, h, s,
        )  # fmt: skip
        heights[tile.own], scores[tile.own] = tile.site.place[2] + h, s
        ratio[tile.own] = tile.base_ratios()

    _run(photographs, nodes, prior, level, window * COARSE_WINDOW, options, models, one, report)
    shape = len(y), len(x)
    per_post = window / float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else np.nan
    if not np.isfinite(per_post):
        raise InputError("no two photographs show the same ground", "check the photographs and the area")
    z = _cleaned(heights.reshape(shape), scores.reshape(shape), per_post, prior.at(nodes)[0].reshape(shape))
    relief = maximum_filter(z, 3) - minimum_filter(z, 3)
    return Prior(x, y, z, SPARE_PX * per_post / 2.0 + 0.5 * relief)


def _cleaned(z: np.ndarray, score: np.ndarray, per_post: float, prior: np.ndarray) -> np.ndarray:
    """Heights without outliers and holes; where hardly anything was found those of the level above."""
    good = np.isfinite(z) & (score > COARSE_CORRELATION)
    if not good.any():
        return prior
    for size in (5, 3):
        offset = _filled(z - prior, good)
        off = np.abs(offset - median_filter(offset, size)) > OUTLIER_PX * per_post
        good &= ~off
        if not good.any():
            return prior
    offset = median_filter(_filled(z - prior, good), 3)
    away = distance_transform_edt(~good)
    return prior + np.where(good, offset, gaussian_filter(offset, 1.0) * np.exp(-np.asarray(away) / 20.0))


def _filled(values: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Values with those that are not good taken from the nearest good one."""
    place = distance_transform_edt(~good, return_distances=False, return_indices=True)
    return values[tuple(np.asarray(place))]


@dataclass(frozen=True, eq=False)
class _Tile:
    """Nodes near one another, with all that kernels need: `own` are their numbers, the rest is in Δ of the site."""

    own: np.ndarray
    site: Site
    view: tuple
    delta: np.ndarray
    slopes: np.ndarray
    ranges: np.ndarray
    chosen: np.ndarray
    model: np.ndarray

    def base_ratios(self) -> np.ndarray:
        """(n,) base over height of the first two photographs; NaN where there are none."""
        c, d = self.site.centres, self.delta
        both = self.chosen[:, 1] >= 0
        a, b = c[self.chosen[:, 0]], c[self.chosen[:, 1]]
        plan = np.hypot(*(a[:, :2] - b[:, :2]).T)
        return np.where(both, plan / np.maximum(0.5 * (a[:, 2] + b[:, 2]) - d[:, 2], 1e-9), np.nan)


def _tiles(nodes: np.ndarray, reach: float) -> Iterator[np.ndarray]:
    """Numbers of the nodes of every square of side `reach`."""
    cell = np.floor((nodes - nodes.min(axis=0)) / reach).astype(np.int64)
    key = cell[:, 1] * (cell[:, 0].max() + 1) + cell[:, 0]
    order = np.argsort(key, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(key[order])) + 1)


def _run(photographs: Photographs, nodes, prior: Prior, level: int, reach: float, options: MatchOptions, models,
         one: Callable[[_Tile], None], report: Report) -> None:  # fmt: skip
    """Do something to all tiles, in threads."""
    gsd = float(np.median(photographs.gsd)) * 2**level
    spacing = np.sqrt(np.ptp(nodes[:, 0]) * np.ptp(nodes[:, 1]) / max(len(nodes), 1)) or gsd
    parts = list(_tiles(nodes, min(TILE_NODES * max(spacing, gsd), LARGEST_TILE_PX * gsd)))

    def work(own: np.ndarray) -> None:
        tile = _make_tile(photographs, nodes[own], own, prior, level, reach, options, models)
        if (tile.chosen[:, 0] >= 0).any():
            one(tile)

    with ThreadPoolExecutor(thread_count()) as pool:
        for k, _ in enumerate(pool.map(work, parts)):
            report((k + 1) / len(parts))


def _make_tile(photographs: Photographs, nodes, own, prior: Prior, level: int, reach, options, models) -> _Tile:
    z, slopes, spare = prior.at(nodes)
    middle = 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))
    site = site_at(photographs, *middle.tolist())
    delta = np.column_stack([nodes, z]) - site.place
    ranges = np.column_stack([delta[:, 2] - spare, delta[:, 2] + spare])
    low, high = delta.min(axis=0), delta.max(axis=0)
    low[2], high[2] = ranges[:, 0].min(), ranges[:, 1].max()
    view = site.view(level, low, high, options.edge, reach)
    shown = np.flatnonzero(view[5][:, 3] > 0)
    number = np.full(len(nodes), -1)
    if models is not None:
        chosen = np.full((len(nodes), 2), -1)
        known = np.isin(models.pairs, shown).all(axis=1)
        kept = np.flatnonzero(known)
        kernels.choose_models(
            view, delta, models.pairs[kept], models.middles[kept] - site.place[:2], chosen, number
        )  # fmt: skip
        number = np.where(number >= 0, kept[number] if len(kept) else -1, -1)
    else:
        chosen = np.full((len(nodes), options.most_photographs), -1)
        kernels.choose_photographs(view, delta, shown, options.most_photographs, chosen)
    return _Tile(own, site, view, delta, slopes, ranges, chosen, number)


def _fine_level(photographs, nodes, prior: Prior, gsd: float, options: MatchOptions, models, report) -> Pickets:
    n, m = len(nodes), 2 if models is not None else options.most_photographs
    out = Pickets(
        node=nodes, xyz=np.full((n, 3), np.nan), covariance=np.full((n, 3, 3), np.nan),
        status=np.ones(n, np.int8), tries=np.zeros(n, np.int16), photographs=np.full((n, m), -1, np.int32),
        correlation=np.full(n, np.nan), model=np.full(n, -1, np.int32), misfit=np.full(n, np.nan),
        names=photographs.names, sigma0=np.nan,
    )  # fmt: skip
    aside = steps_aside(options, gsd)
    settings = (STEP_PX, float(MOST_STEPS), options.search_px, options.distinct)
    limits = np.array([options.threshold, options.largest_sigma_px, min(FINE_START, options.threshold)])

    def one(tile: _Tile) -> None:
        k = len(tile.own)
        status, tries = np.empty(k, np.int8), np.zeros(k, np.int16)
        points, covariance = np.full((k, 3), np.nan), np.full((k, 3, 3), np.nan)
        used, numbers, shifts = np.zeros((k, m), bool), np.full((k, 4), np.nan), np.zeros((k, m, 6))
        kernels.measure_pickets(
            tile.view, tile.delta, tile.slopes, prior.curvatures(nodes[tile.own]), tile.ranges, tile.chosen, aside,
            options.window_px, gsd, settings, limits, (status, tries, points, covariance, used, numbers, shifts),
        )  # fmt: skip
        measured = (status == 0) | (status >= FIRST_ERROR)
        out.status[tile.own], out.tries[tile.own] = status, tries
        out.correlation[tile.own], out.model[tile.own] = numbers[:, 2], tile.model
        rows = tile.own[measured]
        out.xyz[rows], out.covariance[rows] = tile.site.from_delta(points[measured]), covariance[measured]
        out.photographs[rows], place = _packed(tile.chosen[measured], used[measured])
        first_shift = shifts[measured][np.arange(len(rows)), place]
        out.misfit[rows] = _misfit(tile.site, points[measured], out.photographs[rows, :2], first_shift)

    _run(photographs, nodes, prior, 0, gsd * options.window_px + np.abs(aside).max(), options, models, one, report)
    return out


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
    sigma0 = float(NMAD * np.median(difference) / np.sqrt(2.0))
    return replace(pickets, covariance=pickets.covariance * sigma0**2, sigma0=sigma0)
