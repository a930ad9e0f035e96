"""Nodes near one another with the crops of the photographs that show them, as tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.execution.work import Work, Workplace
from aerotri.terrain import _view_kernels as kernels
from aerotri.terrain._plan_kernels import Nodes
from aerotri.terrain.photographs import Photographs, Site, site_at
from aerotri.terrain.pickets import MatchOptions, Models
from aerotri.terrain.prior import Prior

TILE_NODES = 40
"""Nodes along a side of a tile; chosen [C]: fewer read the margins of the crops too often, more leave threads without
work."""
LARGEST_TILE_PX = 1500
"""Longest side of a tile in pixels of its level; chosen [C]: crops of 1500 × 1500 pixels, 4.5 MB, in up to 20
photographs and all threads fit into memory."""
BYTES_OF_TILE = 450_000_000
"""Memory of a process that measures tiles, without the photographs that it keeps: 0.4 GB were measured."""


@dataclass(frozen=True, eq=False)
class Tile:
    """Nodes near one another, with all that kernels need: `own` are their numbers, the rest is in Δ of the site."""

    own: np.ndarray
    site: Site
    view: kernels.View
    delta: np.ndarray
    slopes: np.ndarray
    ranges: np.ndarray
    chosen: np.ndarray
    model: np.ndarray

    @property
    def nodes(self) -> Nodes:
        """The nodes as kernels take them."""
        return Nodes(self.delta, self.slopes, self.ranges, self.chosen)

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


@dataclass(frozen=True, eq=False)
class TileWork:
    """What all tiles of a level share.

    Parameters
    ----------
    photographs : that are matched. nodes : (n, 2) m. prior : where heights are looked for. level : of the pyramids.
    reach : m by which windows reach beyond a tile. options, models : as of `matching.measure`.
    one : a function of a module, takes this and a tile. how : what else it needs.
    """

    photographs: Photographs
    nodes: np.ndarray
    prior: Prior
    level: int
    reach: float
    options: MatchOptions
    models: Models | None
    one: Callable[[TileWork, Tile], Any]
    how: Any


def do_tiles(shared: TileWork, at: Workplace, report: Callable[[float], None]) -> Iterator[tuple[np.ndarray, Any]]:
    """Numbers of the nodes of every tile that photographs show, and what was found for them.

    Raises
    ------
    InputError, TasksFailedError
    """
    nodes = shared.nodes
    gsd = float(np.median(shared.photographs.gsd)) * 2**shared.level
    spacing = np.sqrt(np.ptp(nodes[:, 0]) * np.ptp(nodes[:, 1]) / max(len(nodes), 1)) or gsd
    parts = list(_tiles(nodes, min(TILE_NODES * max(spacing, gsd), LARGEST_TILE_PX * gsd)))
    middles = [nodes[own].mean(axis=0) for own in parts]
    names = [f"tile about X {x:.0f}, Y {y:.0f} of level {shared.level}" for x, y in middles]
    memory = BYTES_OF_TILE + shared.photographs.store.most_bytes
    work = Work(do_tile, shared, parts, names, "tiles", at.folder, memory)
    for own, found in zip(parts, at.executor.run(work, report), strict=True):
        if found is not None:
            yield own, found


def do_tile(shared: TileWork, own: np.ndarray) -> Any:
    """What is found for some nodes; None where no photograph shows them."""
    tile = _make_tile(shared, own)
    return shared.one(shared, tile) if (tile.chosen[:, 0] >= 0).any() else None


def _make_tile(shared: TileWork, own: np.ndarray) -> Tile:
    nodes, options, models = shared.nodes[own], shared.options, shared.models
    z, slopes, spare = shared.prior.at(nodes)
    middle = 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))
    site = site_at(shared.photographs, *middle.tolist())
    delta = np.column_stack([nodes, z]) - site.place
    ranges = np.column_stack([delta[:, 2] - spare, delta[:, 2] + spare])
    low, high = delta.min(axis=0), delta.max(axis=0)
    low[2], high[2] = ranges[:, 0].min(), ranges[:, 1].max()
    view = site.view(shared.level, low, high, options.edge, shared.reach)
    shown = np.flatnonzero(view.crops[:, 3] > 0)
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
    return Tile(own, site, view, delta, slopes, ranges, chosen, number)
