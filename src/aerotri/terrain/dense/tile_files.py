"""Tiles of a surface as files, so that memory does not grow with the block and a run that was ended goes on."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.kept_arrays import kept_arrays
from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.joining import SIDES, joined
from aerotri.terrain.dense.tile_surface import TileRim, TileSurface

RIM = ("above", "below", "before", "behind")
FIELDS = ("z", "sigma", "members", "photographs", "factor", "pairs", "across", "shared_cells", "pixel", *RIM)


@dataclass(frozen=True)
class TileWindow:
    """Cells of a grid: first row and column, size."""

    row: int
    column: int
    rows: int
    columns: int


def tile_windows(grid: Grid, side: int) -> list[TileWindow]:
    """Tiles of a grid, rows to and fro, so that neighbours in the list are neighbours on the ground."""
    found = []
    for n, row in enumerate(range(0, grid.rows, side)):
        columns = range(0, grid.columns, side)
        for column in columns if n % 2 == 0 else reversed(columns):
            found.append(TileWindow(row, column, min(side, grid.rows - row), min(side, grid.columns - column)))
    return found


@dataclass(frozen=True)
class TileFiles:
    """The tiles of one level in a folder; side : cells of a tile, but for the last of a row or column."""

    folder: Path
    level: int
    side: int

    def path(self, window: TileWindow) -> Path:
        """Where a tile is, or will be."""
        return self._path(window.row, window.column)

    def _path(self, row: int, column: int) -> Path:
        return self.folder / f"level{self.level}_{row}_{column}.npz"

    def write(self, window: TileWindow, tile: TileSurface) -> None:
        """Write a tile whole or not at all."""
        path = self.path(window)
        # a tile may be measured twice at the same time, where a worker is held for lost
        part = path.with_suffix(f".{uuid.uuid4().hex}.part")
        with part.open("wb") as file:
            np.savez(
                file, z=tile.z, sigma=tile.sigma.astype(np.float32),
                members=tile.members.astype(np.min_scalar_type(int(tile.members.max(initial=0)))),
                photographs=tile.photographs.astype(np.int64), factor=np.array(tile.factor),
                pairs=tile.pairs.astype(np.int64), across=tile.across.astype(np.float64),
                shared_cells=np.array(tile.shared_cells), pixel=np.array(tile.pixel),
                **{name: getattr(tile.rim, name) for name in RIM},
            )  # fmt: skip
        os.replace(part, path)

    def read(self, window: TileWindow) -> TileSurface | None:
        """A tile that is there and whole; None otherwise."""
        parts = kept_arrays(self.path(window))
        if parts is None or parts.keys() != set(FIELDS) or parts["z"].shape != (window.rows, window.columns):
            return None
        return TileSurface(
            parts["z"], parts["sigma"], parts["members"], parts["photographs"], float(parts["factor"]), parts["pairs"],
            parts["across"], float(parts["shared_cells"]), float(parts["pixel"]), TileRim(*(parts[r] for r in RIM)),
        )  # fmt: skip

    def read_joined(self, window: TileWindow) -> TileSurface | None:
        """A tile that goes over into its neighbours, as far as these are there; None where it is not there itself."""
        tile = self.read(window)
        if tile is None:
            return None
        rims = {}
        for down, right in SIDES:
            row, column = window.row + down * self.side, window.column + right * self.side
            parts = kept_arrays(self._path(row, column), RIM)
            if parts is not None:
                rims[down, right] = TileRim(*(parts[name] for name in RIM))
        return joined(tile, rims)

    def remove_unfinished(self) -> None:
        """Remove what killed workers left of tiles."""
        for part in self.folder.glob(f"level{self.level}_*.part"):
            part.unlink(missing_ok=True)

    def read_all(self, windows: list[TileWindow]) -> Iterator[tuple[TileWindow, TileSurface]]:
        """Tiles one after the other, each going over into its neighbours; all must be there."""
        for window in windows:
            tile = self.read_joined(window)
            if tile is None:
                raise FileNotFoundError(self.path(window))
            yield window, tile
