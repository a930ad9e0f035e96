"""`aerotri compare`: a surface against a control surface."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import InputError
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.rasters.grids import Grid
    from aerotri.terrain.compare import Comparison, Heights

OWN_NAMES = ("compare.json", "difference.tif", "plots")
CELLS = 1000
LARGEST_HELD = 64_000_000
"""Cells of a raster that is held as a whole; a larger one is read part by part."""
BYTES_OF_CELL = 64
"""Of the grid of differences: places, heights of both, and what the statistics sort."""
CLOUDS, RASTERS = (".las", ".laz"), (".tif", ".tiff", ".asc", ".img", ".vrt")


def run_compare(
    test: Path, control: Path, out: Path | None, method: str, align: str, cell: float | None, plots: bool, as_json: bool
) -> None:
    """Compare and write; arguments as on the command line."""
    from aerotri.terrain.compare import ALIGNMENTS, METHODS

    for name, value, known in (("method", method, METHODS), ("align", align, ALIGNMENTS)):
        if value not in known:
            raise InputError(f"--{name} '{value}' is not known", f"choose one of {', '.join(known)}")
    console = Console(quiet=as_json)
    target = out or Path(f"{test.resolve().stem}_comparison")
    refuse_foreign_folder(target, "compare.json")
    console.progress("reading")
    with ExitStack() as stack:
        found, crs = _compared(test, control, method, align, cell, stack, console)
    grid = found.grid
    content = comparison_json(found, test.name, control.name, method)
    _write(target, found, content, f"{test.name} − {control.name}", crs, plots)
    if as_json:
        print(json.dumps(content, indent=2, ensure_ascii=False))
        return
    s = found.statistics
    lines = [
        f"{s.count} cells of {grid.cell_x:g} m compared, {100 * found.coverage:.1f} % of the control covered; {method}",
        f"bias {s.bias:+.3f} m, median {s.median:+.3f}, RMSE {s.rmse:.3f}, σ {s.std:.3f}, NMAD {s.nmad:.3f}, "
        f"LE90 {s.le90:.3f}, largest {s.max:.3f} m",
    ]
    console.lines([*lines, *([found.alignment_text] if found.alignment_text else []), f"Written to {target}"])


def _compared(
    test: Path, control: Path, method: str, align: str, cell: float | None, stack: ExitStack, console: Console
) -> tuple[Comparison, int | None]:
    """The comparison, and the code of its CRS where that is known."""
    from aerotri.rasters.grids import cache_limited
    from aerotri.terrain.compare import compare

    stack.enter_context(cache_limited())
    target = _common_crs(test, control)
    (one, area, cells, crs), (other, control_area, control_cells, control_crs) = (
        _surface(p, stack, target, console) for p in (test, control)
    )
    if crs is not None and control_crs is not None and crs != control_crs:
        raise InputError(f"is in EPSG:{crs}, the control in EPSG:{control_crs}", "bring them into one CRS", test)
    grid = _common_grid(area, control_area, cell or max(cells, control_cells))
    console.progress("comparing")
    found = compare(
        one, other, grid, method, align, lambda done, count: console.work("comparing", done / count)
    )  # fmt: skip
    return found, crs or control_crs


def _common_crs(*paths: Path) -> str | None:
    """Where a raster that does not count in metres is brought to: the CRS of the other one, else None."""
    from aerotri.rasters.grids import RasterReader
    from aerotri.rasters.metric import metric_crs_for, units_of

    wanted = None
    for path in paths:
        file = path / "dsm.tif" if path.is_dir() else path
        if file.suffix.lower() not in RASTERS or not file.is_file():
            continue
        with RasterReader(file) as reader:
            if units_of(reader).plan == "metre":
                if reader.epsg is not None:
                    return f"EPSG:{reader.epsg}"
            else:
                wanted = wanted or metric_crs_for(reader)
    return wanted


def _surface(
    path: Path, stack: ExitStack, crs: str | None, console: Console
) -> tuple[Heights, np.ndarray, float, int | None]:
    """A surface, (2, 2) m what it covers, its typical cell in m, and the code of its CRS.

    Parameters
    ----------
    crs : 'EPSG:n' that a raster in degrees or feet is brought to; None: the UTM zone.
    """
    from aerotri.formats.results.pickets import read_pickets
    from aerotri.formats.results.point_cloud import read_point_cloud, refuse_cloud_units
    from aerotri.rasters.metric import MetricReader
    from aerotri.terrain.compare import FileHeights, PointHeights, RasterHeights

    if path.is_dir():
        path = path / "dsm.tif"
    if not path.is_file():
        raise InputError("there is no such file", "give a GeoTIFF, LAZ, or pickets.parquet", path)
    if path.suffix.lower() in RASTERS:
        reader = stack.enter_context(MetricReader(path, target=crs))
        if reader.note:
            console.note(reader.note)
        g = reader.grid
        if g.rows * g.columns > LARGEST_HELD:
            left, bottom, right, top = g.bounds
            return FileHeights(reader), np.array([[left, bottom], [right, top]]), g.cell_x, reader.epsg
        z, epsg = reader.read(0, 0, g.rows, g.columns).astype(float), reader.epsg
        known_rows, known_columns = np.isfinite(z).any(axis=1), np.isfinite(z).any(axis=0)
        if not known_rows.any():
            raise InputError("has no data", "give a raster with heights", path)
        rows, columns = np.flatnonzero(known_rows)[[0, -1]], np.flatnonzero(known_columns)[[0, -1]]
        area = np.array([[g.x(columns[0]), g.y(rows[1])], [g.x(columns[1]), g.y(rows[0])]], dtype=float)
        return RasterHeights(g, z), area, g.cell_x, epsg
    if path.suffix.lower() in CLOUDS:
        xyz = read_point_cloud(path)[0]
        refuse_cloud_units(path)
    elif path.suffix.lower() == ".parquet":
        table = read_pickets(path)
        xyz = table.xyz[table.accepted]
    else:
        raise InputError("is of no known kind", "give a GeoTIFF, LAZ, or pickets.parquet", path)
    try:
        surface = PointHeights.of(xyz)
    except InputError as error:
        raise InputError(error.message, error.remedy, path) from error
    area = np.array([xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)])
    return surface, area, float(np.sqrt(np.prod(area[1] - area[0]) / len(xyz))), None


def _common_grid(one: np.ndarray, other: np.ndarray, cell: float) -> Grid:
    """Cells whose centres are multiples of the cell, where both reach."""
    from aerotri.terrain.surface import grid_over

    low, high = np.maximum(one[0], other[0]), np.minimum(one[1], other[1])
    if (low >= high).any():
        raise InputError("the surfaces have no place in common", "check their coordinate systems")
    return grid_over(np.array([low, high]), max(cell, float((high - low).max()) / (10 * CELLS)), BYTES_OF_CELL)


def comparison_json(found: Comparison, test: str, control: str, method: str) -> dict[str, Any]:
    """The content of compare.json."""
    from aerotri.version import __version__

    a = found.alignment
    moved = None
    if a is not None:
        moved = {"kind": a.kind, "shift_m": a.shift.tolist(), "rotation_rad": a.rotation.tolist(),
                 "about_m": a.middle.tolist()}  # fmt: skip
    return {
        "aerotri": __version__, "test": test, "control": control, "method": method, "cell_m": found.grid.cell_x,
        "difference_m": asdict(found.statistics), "coverage": found.coverage, "alignment": moved,
    }  # fmt: skip


def _write(target: Path, found: Comparison, content: dict[str, Any], title: str, epsg: int | None, plots: bool) -> None:
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.rasters.grids import write_raster

    with atomic_folder(target, own=OWN_NAMES) as folder:
        crs = None if epsg is None else f"EPSG:{epsg}"
        write_raster(folder / "difference.tif", found.difference, found.grid, crs, "test − control, m")
        if plots:
            from aerotri.report.plots.rendering import save_plots
            from aerotri.report.plots.terrain import plot_comparison

            save_plots({"difference": plot_comparison(found, title)}, folder / "plots")
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "compare.json").write_text(text + "\n", encoding="utf-8")
