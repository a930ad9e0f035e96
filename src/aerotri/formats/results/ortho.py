"""An orthophoto for machines: ortho.json, and the photographs and seams of seams.gpkg."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.observations import Block
from aerotri.rasters.mosaics import outlines_of
from aerotri.terrain.ortho.make import OrthoOutcome
from aerotri.vectors.geopackage_writer import Layer, write_geopackage
from aerotri.version import __version__

QUANTILES = {"median": 0.5, "q90": 0.9, "q95": 0.95, "max": 1.0}


@dataclass(frozen=True, eq=False)
class MarkedPoint:
    """A control or check point that lies in the orthophoto.

    Parameters
    ----------
    name, role : as in control.csv. xy : (2,) m. column, row : broken numbers, (0, 0) the corner of the first cell.
    sigma : m, of the orthophoto there; NaN where it has no photograph.
    """

    name: str
    role: str
    xy: np.ndarray
    column: float
    row: float
    sigma: float


def marked_points(outcome: OrthoOutcome, block: Block) -> list[MarkedPoint]:
    """The control and check points within an orthophoto that have X and Y."""
    grid, coarse, found = outcome.grid, outcome.candidates.grid, []
    control = block.control
    for point, xyz, is_check in zip(control.point.tolist(), control.xyz, control.is_check.tolist(), strict=True):
        column, row = float(grid.column(xyz[0])) + 0.5, float(grid.row(xyz[1])) + 0.5
        if not (0.0 <= column < grid.columns and 0.0 <= row < grid.rows):
            continue
        at = int(coarse.row(xyz[1]) + 0.5), int(coarse.column(xyz[0]) + 0.5)
        sigma = float(outcome.accuracy.total[at])
        role = "check" if is_check else "control"
        found.append(MarkedPoint(str(block.points[point]), role, xyz[:2], column, row, sigma))
    return found


def ortho_json(outcome: OrthoOutcome, block: Block, surface: str, resampling: str) -> dict[str, Any]:
    """The content of ortho.json."""
    o, g, a, c = outcome, outcome.grid, outcome.accuracy, outcome.choice
    area = g.cell_x * g.cell_y
    covered = int(o.cells.sum())
    return {
        "aerotri": __version__, "block": str(block.name), "crs": block.crs, "surface": surface, "cell_m": g.cell_x,
        "columns": g.columns, "rows": g.rows, "bands": o.bands, "pixel_type": o.dtype, "gsd_m": o.gsd,
        "resampling": resampling, "tiles_resumed": o.resumed, "of_one_adjustment": a.same,
        "area_m2": {
            "surface": o.heights * area, "orthophoto": covered * area,
            "without_photograph": (o.heights - covered) * area, "other_photograph": o.hidden * area,
            "bridged": o.bridged * area,
        },
        "sigma_m": {
            "total": _quantiles(a.total), "surface": None if a.surface is None else _quantiles(a.surface),
            "orientation": _quantiles(a.orientation), "image": _quantiles(a.image),
            "relative": None if a.relative is None else _quantiles(a.relative),
        },
        "viewing_angle_deg": _quantiles(np.degrees(np.arctan(a.tangent))),
        "seams": {
            "length_m": c.length * o.candidates.grid.cell_x, "difference": _number(c.seam),
            "length_of_best_m": c.length_of_best * o.candidates.grid.cell_x,
            "difference_of_best": _number(c.seam_of_best), "cell_m": o.candidates.grid.cell_x,
        },
        "balance": {"difference_before": _number(o.balance.before), "difference_after": _number(o.balance.after)},
        "points": [
            {
                "point": p.name, "role": p.role, "X": float(p.xy[0]), "Y": float(p.xy[1]), "column": p.column,
                "row": p.row, "sigma": _number(p.sigma),
            }
            for p in marked_points(outcome, block)
        ],
        "photographs": [
            {
                "number": k, "photograph": str(name), "area_m2": int(cells) * area, "gain": gain.tolist(),
                "offset": offset.tolist(), "difference": _number(left),
            }
            for k, (name, cells, gain, offset, left) in enumerate(
                zip(o.photographs.names, o.cells, o.balance.gain, o.balance.offset, o.balance.left, strict=True)
            )
        ],
    }  # fmt: skip


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _quantiles(values: np.ndarray) -> dict[str, float | None]:
    known = values[np.isfinite(values)]
    return {name: float(np.quantile(known, q)) if known.size else None for name, q in QUANTILES.items()}


def write_seams(path: Path, outcome: OrthoOutcome, crs: str | None) -> None:
    """Write where every photograph is used, and the seams between two of them, on the coarse grid."""
    from shapely.geometry import MultiPolygon, Polygon

    grid, number, names = outcome.candidates.grid, outcome.choice.number, outcome.photographs.names
    polygons = {
        k: MultiPolygon([Polygon(g["coordinates"][0], g["coordinates"][1:]) for g in parts])
        for k, parts in outlines_of(number, grid).items()
    }
    used = sorted(polygons)
    areas = Layer(
        "photographs", "MULTIPOLYGON", [polygons[k] for k in used],
        {"number": used, "photograph": [str(names[k]) for k in used], "area_m2": [polygons[k].area for k in used]},
    )  # fmt: skip
    pairs, lines = seam_lines(outcome)
    seams = Layer(
        "seams", "MULTILINESTRING", lines,
        {"photograph_1": [str(names[a]) for a, _ in pairs], "photograph_2": [str(names[b]) for _, b in pairs],
         "length_m": [line.length for line in lines]},
    )  # fmt: skip
    write_geopackage(path, [areas, seams], crs)


def seam_lines(outcome: OrthoOutcome) -> tuple[list[tuple[int, int]], list[Any]]:
    """Pairs of photographs, and the lines on which they meet (shapely), along sides of coarse cells."""
    from shapely import MultiLineString, get_parts, line_merge, multilinestrings

    grid, number = outcome.candidates.grid, outcome.choice.number
    sides, keys = [], []
    for one, other, across in ((np.s_[:, :-1], np.s_[:, 1:], True), (np.s_[:-1], np.s_[1:], False)):
        i, j = np.nonzero((number[one] != number[other]) & (number[one] >= 0) & (number[other] >= 0))
        x, y = grid.left + j * grid.cell_x, grid.top - i * grid.cell_y
        first = np.column_stack([x + grid.cell_x, y] if across else [x, y - grid.cell_y])
        last = np.column_stack([x + grid.cell_x, y - grid.cell_y])
        sides.append(np.stack([first, last], axis=1))
        keys.append(np.sort(np.column_stack([number[one][i, j], number[other][i, j]]), axis=1))
    side, key = np.concatenate(sides), np.concatenate(keys)
    pairs = [(int(a), int(b)) for a, b in np.unique(key, axis=0)]
    merged = (line_merge(multilinestrings(list(side[(key == pair).all(axis=1)]))) for pair in pairs)
    return pairs, [MultiLineString([np.array(part.coords) for part in get_parts(one)]) for one in merged]
