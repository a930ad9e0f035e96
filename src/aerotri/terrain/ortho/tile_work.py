"""The tiles of an orthophoto as tasks: made where they are not there yet, and kept as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.execution.work import Executor, Work
from aerotri.rasters.grids import Grid, cache_limited
from aerotri.terrain.ortho.tile_files import OrthoTiles
from aerotri.terrain.ortho.tiles import Sources, Tile, make_tile

Place = tuple[int, int, Grid]
"""First row and column of a tile, and its cells."""
BYTES_OF_TILE = 400_000_000
"""Memory of a process that makes a tile, without the photographs that it keeps: 24 million cells of the surface around
it with what bounds them, and the tile itself."""


@dataclass(frozen=True, eq=False)
class OrthoWork:
    """What all tiles share, and where they are kept."""

    sources: Sources
    kept: OrthoTiles


def kept_tile(shared: OrthoWork, place: Place) -> tuple[bool, Tile | None]:
    """Whether a tile was there, and what it is; made and kept where it was not."""
    row, column, own = place
    was_there, tile = shared.kept.read(row, column, (own.rows, own.columns))
    if not was_there:
        tile = make_tile(shared.sources, row, column, own)
        shared.kept.write(row, column, tile)
    return was_there, tile


def do_tile(shared: OrthoWork, place: Place) -> int:
    """Make a tile that is not there yet; 1 where it was."""
    with cache_limited():
        return int(kept_tile(shared, place)[0])


def do_tiles(
    shared: OrthoWork, places: Sequence[Place], executor: Executor, report: Callable[[float], None]
) -> int:  # fmt: skip
    """Make the tiles that are not there yet; how many were.

    Raises
    ------
    InputError, TasksFailedError
    """
    kept = OrthoTiles(shared.kept.folder.absolute())
    work = Work(
        do_tile, OrthoWork(_without_colours(shared.sources), kept), places,
        [f"tile at row {row}, column {column}" for row, column, _ in places], "tiles", kept.folder,
        BYTES_OF_TILE + shared.sources.pixels.most_bytes, "run the command again: tiles that are done are kept",
    )  # fmt: skip
    return sum(executor.run(work, report))


def _without_colours(sources: Sources) -> Sources:
    """Without what only the choice of photographs needs, most of what other processes would read."""
    c = sources.candidates
    none = np.zeros((0, 0, 0), np.float32)
    return replace(
        sources,
        candidates=replace(
            c, cost=none, column=none, row=none, value=none[None], detail=none, z=none.reshape(0, 0)
        ),
    )  # fmt: skip
