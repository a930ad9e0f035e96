"""A dense surface for machines: dsm.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.terrain.dense.bare_ground import BRIDGED, MEASURED, BareGround
from aerotri.terrain.dense.coverage import shown_area
from aerotri.terrain.dense.lasting import LASTING_PX, lasting_errors
from aerotri.terrain.dense.measure import DenseOutcome
from aerotri.version import __version__


def dense_json(outcome: DenseOutcome, block: str, crs: str, ground: BareGround | None = None) -> dict[str, Any]:
    """The content of dsm.json."""
    o = outcome
    sigma, matching, shared, left, count = (np.concatenate(part) for part in zip(*_samples(o), strict=True))
    noise = o.shared_cells * o.grid.cell_x if np.isfinite(o.shared_cells) else None
    gsd = float(np.median(o.photographs.gsd))
    lasting, length = lasting_errors(o.pixel, gsd * 2**o.level)
    area, shown = o.cells * o.grid.cell_x * o.grid.cell_y, shown_area(o)
    return {
        "aerotri": __version__, "block": block, "crs": crs, "photographs": len(o.photographs),
        "gsd_m": gsd, "cell_m": o.grid.cell_x,
        "cells": {"all": o.grid.rows * o.grid.columns, "measured": o.cells},
        "area_m2": area, "shown_area_m2": shown, "coverage": area / shown,
        "pairs": len(np.unique(np.sort(o.pairs, axis=1), axis=0)), "tiles": len(o.windows), "tiles_resumed": o.resumed,
        "photographs_mean": float(count.mean()),
        "sigma_Z_m": {
            "median": float(np.median(sigma)), "matching": float(np.median(matching)),
            "adjustment": float(np.median(shared)), "relative": float(np.median(np.hypot(matching, left))),
            "adjustment_relative": float(np.median(left)),
        },
        "noise_length_m": noise,
        "matching_shared": {"sigma_Z_m": lasting, "length_m": length, "parallax_px": LASTING_PX},
        "y_parallax_px": {
            "median": float(np.median(np.abs(o.across_px))), "largest": float(np.abs(o.across_px).max(initial=0.0)),
        },
        "ground": None if ground is None else _ground(ground),
    }  # fmt: skip


def _ground(ground: BareGround) -> dict[str, Any]:
    measured = bridged = 0
    for _, tile in ground.tiles():
        measured += int((tile.source == MEASURED).sum())
        bridged += int((tile.source == BRIDGED).sum())
    law = ground.law
    bridge = {"sigma_at_1_m": law.at_1_m, "power": law.power, "discs": law.discs}
    return {"measured": measured, "bridged": bridged, "widest_object_m": ground.widest, "bridge": bridge}


def _samples(o: DenseOutcome) -> list[tuple[np.ndarray, ...]]:
    """σ, that of matching, of the adjustment, of it after a similarity, and photographs, of some of the cells."""
    found = []
    # one step for all tiles: else those with few cells would count more than others
    every = max(-(-o.cells // MOST_SAMPLES), 1)
    for window, tile in o.files.read_all(list(o.windows)):
        row, column = np.nonzero(np.isfinite(tile.z))
        # copies: a view of every so many cells would keep all of them
        row, column = row[::every].copy(), column[::every].copy()
        if len(row):
            grid = o.grid.window(window.row, window.column, window.rows, window.columns)
            shared, left = o.shared.over(grid)[row, column], o.shared.relative_over(grid)[row, column]
            matching = tile.sigma[row, column].astype(float)
            found.append((np.hypot(matching, shared), matching, shared, left, tile.count[row, column]))
    return found


MOST_SAMPLES = 1_000_000
"""Cells that medians are taken of, spread over all tiles; chosen [C]: a median is then sure to a five-hundredth of a
spread."""
