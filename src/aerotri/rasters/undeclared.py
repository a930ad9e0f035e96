"""Cells without data that a file of heights does not declare: one value, again and again, behind a cliff everywhere.

Holes are filled with 0, -9999 or 32767 by many programs, and a file that says nothing of it has a pit of that depth.
What tells them from ground is not their height but their edge: a lake meets its shore somewhere, a hole never does.
"""

from __future__ import annotations

import numpy as np

from aerotri.conventions import InputError
from aerotri.rasters.grids import RasterReader

SAMPLE = 1000
"""Rows and columns of the sample in which a repeated value is sought [C]."""
FEWEST = 10
"""Cells of one value in the sample that are looked at [C]: fewer do little harm, and two may be equal by chance."""
USUAL = (0.0, -32768.0, -32767.0, 32767.0, 65535.0, -1.0)
WINDOW, WINDOWS = 256, 16
"""Cells along a side of the pieces that are read whole, and how many at most [C]."""
CLIFF_M, STEEP = 3.0, 10.0
"""Lowest step at the edges of holes, in m and in steps between neighbours elsewhere (95 %) [C]: a shore, or the foot of
a wall, has lower ones somewhere."""


def refuse_undeclared_no_data(reader: RasterReader, metre: float) -> None:
    """Refuse a file without a value for no data in which one value looks like it.

    Parameters
    ----------
    metre : metres in the unit that the reader's values count in.

    Raises
    ------
    InputError
    """
    if reader.no_data is not None or reader.is_masked:
        return
    sample, rows, columns = reader.sampled(SAMPLE)
    known = sample[np.isfinite(sample)]
    if len(known) < FEWEST:
        return
    for value in (float(known.min()), float(known.max())):
        if not _is_usual(value):
            continue
        there = sample == value
        rest = known[known != value]
        if (
            there.sum() < FEWEST
            or len(rest) < FEWEST
            or not _stands_apart(reader, value, there, (rows, columns), metre)
        ):
            continue
        low, high, unit = float(rest.min()), float(rest.max()), "m" if metre == 1.0 else f"units of {metre:.7g} m"
        raise InputError(
            f"has cells of exactly {value:.10g} {unit} among heights of {low:.4g} to {high:.4g} {unit}, and cliffs "
            "around them everywhere: they look like cells without data, which the file does not declare",
            f"declare them: gdal_edit.py -a_nodata {value:.10g} {reader.path.name}; if they are heights, declare a "
            "value that does not occur, such as -a_nodata -9999",
            reader.path,
        )


def _is_usual(value: float) -> bool:
    """Whether programs fill holes with this value: 0, nines, or a limit of a type of numbers."""
    return value in USUAL or abs(value) > 1e5 or set(f"{abs(value):.10g}") == {"9"}


def _stands_apart(
    reader: RasterReader, value: float, there: np.ndarray, at: tuple[np.ndarray, np.ndarray], metre: float
) -> bool:
    """Whether all cells of a value lie behind cliffs, as far as pieces around some of them show.

    Parameters
    ----------
    there : of a sample, cells with this value. at : rows and columns of the sample in the raster.
    """
    places = np.argwhere(there)
    chosen = places[np.unique(np.linspace(0, len(places) - 1, WINDOWS).astype(int))]
    at_edge, elsewhere = [], []
    for i, j in chosen.tolist():
        top, left = int(at[0][i]) - WINDOW // 2, int(at[1][j]) - WINDOW // 2
        piece = reader.read(top, left, WINDOW, WINDOW).astype(float)
        for one, other in ((piece[:, 1:], piece[:, :-1]), (piece[1:], piece[:-1])):
            step = np.abs(one - other)
            inside = (one == value).astype(int) + (other == value)
            at_edge.append(step[(inside == 1) & np.isfinite(step)])
            elsewhere.append(step[(inside == 0) & np.isfinite(step)])
    edges, steps = np.concatenate(at_edge), np.concatenate(elsewhere)
    if not len(edges) or not len(steps):
        return False
    return float(edges.min()) > max(CLIFF_M / metre, STEEP * float(np.quantile(steps, 0.95)))
