"""`aerotri volume`: a volume, how sure it is, and the page about it."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import InputError
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.rasters.grids import Grid, RasterReader
    from aerotri.rasters.metric import MetricReader
    from aerotri.report.plots.volume import ThicknessMap
    from aerotri.volume.accuracy import VolumeSigma
    from aerotri.volume.bases import Base
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.compute import SectionPlan, Volumes
    from aerotri.volume.settings import SigmaOptions

OWN_NAMES = ("volume.json", "thickness.tif", "sections.csv", "plots", "volume.html")
MOST_MAP_CELLS = 500


@dataclass(frozen=True)
class VolumeInput:
    """What to compute, as on the command line."""

    dtm: Path
    base: str
    boundary: str | None
    method: str
    adjustment: Path | None
    pickets: Path | None
    base_adjustment: Path | None
    base_pickets: Path | None = None


def run_volume(
    given: VolumeInput, plan: SectionPlan, sigma_options: SigmaOptions, out: Path | None, plots: bool, as_json: bool
) -> int:
    """Exit code of the command; arguments as on the command line."""
    from aerotri.deformation.absorbed import AbsorptionFailedError

    console = Console(quiet=as_json)
    _check(given)
    target = out or Path(f"{given.dtm.stem}_volume")
    refuse_foreign_folder(target, "volume.json")
    try:
        content = _computed(given, plan, sigma_options, target, plots, console)
    except AbsorptionFailedError as failure:
        console.failure(str(failure))
        return 1
    if as_json:
        print(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        console.lines([*summary(content), f"Written to {target}"])
    return 0


def summary(content: dict[str, Any]) -> list[str]:
    """The outcome in lines."""
    c, s = content, content["sigma"]
    sure = "" if s is None else f" ± {s['sigma_m3']:.4g} (1 σ)"
    lines = [
        f"net {c['net_m3']:.6g} m³{sure}: cut {c['cut_m3']:.6g}, fill {c['fill_m3']:.6g}; {c['method']}, over "
        f"{c['base']['name']}, {c['boundary']['area_m2']:.6g} m² inside {c['boundary']['name']}"
    ]
    if s is not None:
        lines.append("σ by part, m³: " + ", ".join(f"{name} {v:.4g}" for name, v in s["parts_m3"].items()))
        if s["curvature"] is not None:
            lines.append(
                f"ground expected beyond straight lines between heights: {s['curvature']['value_m3']:+.4g} ± "
                f"{s['curvature']['sigma_m3']:.2g} m³, not in the volume, counted in σ as interpolation"
            )
        where = "in the volume" if s["systematic"]["in_the_volume"] else "corrected for, would be"
        for one in s["systematic"]["variants"]:
            lines.append(
                f"systematic, {one['variant']} orientation: {where} {one['value_m3']:+.4g} ± {one['sigma_m3']:.2g} m³"
            )
    lines += [f"  {one['method']:<24} net {one['net_m3']:.6g} m³" for one in c["methods"]]
    return lines + [f"note: {text}" for text in c["warnings"]]


def _check(given: VolumeInput) -> None:
    if given.adjustment is None and (given.pickets or given.base_adjustment or given.base_pickets):
        raise InputError(
            "--pickets, --base-pickets and --base-adjustment belong to --adjustment", "give the adjustment"
        )


def _computed(
    given: VolumeInput, plan: SectionPlan, sigma_options: SigmaOptions, target: Path, plots: bool, console: Console
) -> dict[str, Any]:
    """Compute and write; returns the content of volume.json."""
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.rasters.grids import RasterWriter, cache_limited
    from aerotri.rasters.metric import MetricReader
    from aerotri.volume.bases import parse_base
    from aerotri.volume.boundary import boundary_of_grid, read_boundary
    from aerotri.volume.compute import compute_volumes
    from aerotri.volume.outcome_json import Sources, volume_json
    from aerotri.volume.sums import cells_within

    with cache_limited(), ExitStack() as stack:
        reader = stack.enter_context(MetricReader(given.dtm, target=_crs_of_result(given.adjustment)))
        boundary = boundary_of_grid(reader.grid) if given.boundary is None else read_boundary(
            given.boundary, reader.epsg)  # fmt: skip
        others: list[MetricReader] = []

        def opened(path: str) -> MetricReader:
            others.append(stack.enter_context(_other(path, reader)))
            return others[-1]

        base = parse_base(given.base, reader, boundary, opened)
        row, column, rows, columns = cells_within(reader.grid, boundary)
        if not rows or not columns:
            raise InputError("the boundary does not meet the surface", "check the CRS of both", given.dtm)
        part = reader.grid.window(row, column, rows, columns)
        with atomic_folder(target, own=OWN_NAMES) as folder:
            thumbnail = _Thumbnail(part)
            with RasterWriter(folder / "thickness.tif", part, crs=reader.crs,
                              options={"compress": "deflate"}) as writer:  # fmt: skip
                writer.describe("surface − base, m")

                def keep(window) -> None:
                    inside = np.where(window.part > 0.0, window.thickness, np.nan)
                    thumbnail.add(window.row - row, window.column - column, inside)
                    writer.write(window.row - row, window.column - column, inside.astype(np.float32))

                volumes = compute_volumes(reader, base, boundary, given.method, plan, keep,
                                          lambda what, k, n: console.work(what, k / n, f"{k} of {n}"))  # fmt: skip
            sigma = _sigma(given, reader, base, boundary, sigma_options, console)
            sources = Sources(given.dtm.name, "" if reader.epsg is None else f"EPSG:{reader.epsg}",
                              *("" if p is None else p.name for p in (given.adjustment, given.pickets)))  # fmt: skip
            content = volume_json(volumes, base, boundary, sources, sigma)
            said = (reader.note, *(other.note for other in others), boundary.note)
            content["warnings"] = [*(text for text in said if text), *content["warnings"]]
            _write_sections(folder / "sections.csv", volumes)
            if plots:
                console.progress("plots")
                _draw(folder, content, volumes, reader, base, boundary, thumbnail.map())
            text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
            (folder / "volume.json").write_text(text + "\n", encoding="utf-8")
    return content


def _crs_of_result(result: Path | None) -> str | None:
    """The plan CRS of a result's block, None where there is no result or it is local."""
    import tomllib

    from aerotri.rasters.grids import horizontal_crs

    if result is None:
        return None
    try:
        content = tomllib.loads((result / "block" / "block.toml").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return horizontal_crs(str(content.get("crs", "local")))


def _other(path: str, reader: RasterReader) -> MetricReader:
    """The raster of a base, in the CRS of the surface."""
    from aerotri.rasters.metric import MetricReader

    other = MetricReader(path, target=None if reader.epsg is None else f"EPSG:{reader.epsg}")
    if other.epsg is not None and reader.epsg is not None and other.epsg != reader.epsg:
        raise InputError(f"is in EPSG:{other.epsg}, the surface in EPSG:{reader.epsg}", "bring it into one CRS", path)
    return other


def _sigma(
    given: VolumeInput, reader: RasterReader, base: Base, boundary: Boundary, options: SigmaOptions, console: Console
) -> VolumeSigma | None:
    from aerotri.commands.results import reopened
    from aerotri.commands.volume_parts import base_calibration, surface_part
    from aerotri.public.models import check_crs
    from aerotri.volume.accuracy import volume_sigma
    from aerotri.volume.bases import SurfaceBase

    if given.adjustment is None:
        return None
    calibration = reopened(given.adjustment, console)
    check_crs(calibration, reader.epsg, given.dtm)
    console.progress("σ of the volume")
    part = surface_part(calibration, reader, given.pickets, boundary, base, options)
    below, notes = None, ()
    if isinstance(base, SurfaceBase):
        other, notes = base_calibration(given, calibration, console)
        if other is not None:
            below = surface_part(other, base.surface, given.base_pickets, boundary, None, options)
    elif given.base_adjustment is not None or given.base_pickets is not None:
        raise InputError(
            "--base-adjustment and --base-pickets need a surface as base", "give its raster as --base"
        )
    sigma = volume_sigma(reader, base, boundary, part, below, options)
    return replace(sigma, notes=(*notes, *sigma.notes))


def _write_sections(path: Path, volumes: Volumes) -> None:
    import csv

    s = volumes.sections
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["station_m", "cut_area_m2", "fill_area_m2", "cut_length_m", "fill_length_m",
                         "no_data_length_m"])  # fmt: skip
        writer.writerows([float(at), *map(float, row)] for at, row in zip(s.station, s.sums, strict=True))


class _Thumbnail:
    """Means of the thickness over so many cells that a map has a few hundred a side."""

    def __init__(self, grid: Grid):
        self._factor = max(1, -(-max(grid.rows, grid.columns) // MOST_MAP_CELLS))
        self._grid = grid.coarser(self._factor)
        self._sum = np.zeros((self._grid.rows, self._grid.columns))
        self._count = np.zeros_like(self._sum)

    def add(self, row: int, column: int, values: np.ndarray) -> None:
        known = np.isfinite(values)
        i, j = np.nonzero(known)
        at = (row + i) // self._factor, (column + j) // self._factor
        np.add.at(self._sum, at, values[known])
        np.add.at(self._count, at, 1.0)

    def map(self) -> ThicknessMap:
        from aerotri.report.plots.volume import ThicknessMap

        with np.errstate(invalid="ignore", divide="ignore"):
            return ThicknessMap(self._grid, self._sum / self._count)


def _draw(
    folder: Path, content: dict[str, Any], volumes: Volumes, reader: RasterReader, base: Base, boundary: Boundary,
    thickness: ThicknessMap,
) -> None:  # fmt: skip
    from aerotri.report.pages.volume import write_volume_page
    from aerotri.report.plots.rendering import save_plots
    from aerotri.report.plots.volume import plot_budget, plot_section_areas, plot_section_profiles, plot_thickness
    from aerotri.volume.sections import chosen_profiles

    figures = {"thickness": plot_thickness(thickness, boundary, volumes, content)}
    if content["sigma"] is not None:
        figures["budget"] = plot_budget(content)
    figures["section_areas"] = plot_section_areas(volumes.sections, content["dtm"])
    figures["section_profiles"] = plot_section_profiles(
        chosen_profiles(reader, base, boundary, volumes.sections), content["dtm"]
    )
    rendered = save_plots(figures, folder / "plots")
    write_volume_page(content, rendered, folder / "volume.html")
