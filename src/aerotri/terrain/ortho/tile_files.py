"""Tiles of an orthophoto as files, so that a run that was ended goes on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.kept_arrays import kept_arrays
from aerotri.terrain.ortho.tiles import Tile

FIELDS = ("colours", "number", "counts", "bridged")


@dataclass(frozen=True)
class OrthoTiles:
    """The tiles in a folder."""

    folder: Path

    def path(self, row: int, column: int) -> Path:
        """Where the tile with that first cell is, or will be."""
        return self.folder / f"ortho_{row}_{column}.npz"

    def write(self, row: int, column: int, tile: Tile | None) -> None:
        """Write a tile whole or not at all; None where there is nothing to see."""
        path = self.path(row, column)
        part = path.with_suffix(".part")
        nothing = np.zeros((0, 0, 0), np.uint8)
        with part.open("wb") as file:
            if tile is None:
                np.savez(file, colours=nothing)
            else:
                np.savez(
                    file, colours=tile.colours, number=tile.number, counts=np.array([tile.heights, tile.hidden]),
                    bridged=np.zeros((0, 0), bool) if tile.bridged is None else tile.bridged,
                )  # fmt: skip
        os.replace(part, path)

    def read(self, row: int, column: int, shape: tuple[int, int]) -> tuple[bool, Tile | None]:
        """Whether a tile is there and whole, and what it is.

        Parameters
        ----------
        shape : rows and columns that it must have.
        """
        held = kept_arrays(self.path(row, column))
        if held is not None and held.keys() == {"colours"} and not held["colours"].size:
            return True, None
        if held is None or held.keys() != set(FIELDS):
            return False, None
        colours, number, counts, bridged = (held[name] for name in FIELDS)
        if colours.shape[1:] != shape or number.shape != shape or counts.shape != (2,):
            return False, None
        kept = bridged if bridged.size else None
        return True, Tile(row, column, colours, number, int(counts[0]), int(counts[1]), kept)
