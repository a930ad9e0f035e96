"""Tables of the photographs: their residuals, and their positions against the given ones."""

from __future__ import annotations

import numpy as np

from aerotri.report.tables.adjustment import Column, Table, table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.photograph_residuals import PhotographResiduals
from aerotri.statistics.position_differences import PositionDifferences

WORST = 15
"""Photographs that are listed; chosen [C] as the weakest ones."""


def photograph_residuals_table(found: PhotographResiduals, adjusted: AdjustedBlock) -> Table:
    """The photographs with the largest residuals, and all of them together."""
    rows = found.worst_first[:WORST]
    used = np.isfinite(found.ratio)
    return table(
        "Photographs with the largest residuals",
        (Column("photograph"), [*adjusted.block.images.names[rows].tolist(), "all"]),
        (Column("rays", "", "d"), [*found.rays[rows].tolist(), int(found.rays[used].sum())]),
        (Column("RMS x", "px", ".2f"), [*found.rms_px[rows, 0].tolist(), float(found.rms_all_px[0])]),
        (Column("RMS y", "px", ".2f"), [*found.rms_px[rows, 1].tolist(), float(found.rms_all_px[1])]),
        (Column("σ / σ of all", "", ".2f"), [*found.ratio[rows].tolist(), 1.0]),
        (Column("limit", "", ".2f"), [*found.limit[rows].tolist(), None]),
        (Column("beyond chance"), ["yes" if one else "no" for one in found.beyond[rows].tolist()] + ["–"]),
    )


def positions_table(found: PositionDifferences | None, adjusted: AdjustedBlock) -> Table:
    """Offset, drift and size of the differences adjusted − given; no rows where there are no given positions."""
    if found is None:
        return Table("Positions, adjusted − given", (Column("coordinate"),), ())
    absolute = np.where(np.isfinite(found.difference), np.abs(found.difference), -1.0)
    worst = absolute.argmax(axis=0)
    known = found.count > 0
    offset, drift = found.offset, found.drift
    largest = found.difference[worst, np.arange(3)]
    with np.errstate(invalid="ignore", divide="ignore"):
        given = np.sqrt(np.nanmean(np.where(np.isfinite(found.difference), found.sigma, np.nan)[:, known] ** 2, axis=0))
    sigma = np.full(3, np.nan)
    sigma[known] = given
    names = adjusted.block.images.names[found.image[worst]]
    return table(
        "Positions, adjusted − given",
        (Column("coordinate"), ["X", "Y", "Z"]),
        (Column("photographs", "", "d"), found.count),
        (Column("mean (offset)", "m", "+.3f"), offset[0]),
        (Column("σ of the mean", "m", ".3f"), offset[1]),
        (Column("RMS", "m", ".3f"), found.rms),
        (Column("σ given", "m", ".3f"), sigma),
        (Column("drift", "mm/min", "+.1f"), 1e3 * drift[0]),
        (Column("σ of the drift", "mm/min", ".1f"), 1e3 * drift[1]),
        (Column("largest", "m", "+.3f"), largest),
        (Column("at"), [str(name) if there else "–" for name, there in zip(names, known, strict=True)]),
    )
