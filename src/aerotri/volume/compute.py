"""A volume by every method, with what the user should know of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError, in_digits
from aerotri.volume.bases import Base, Surface, SurfaceBase
from aerotri.volume.boundary import Boundary
from aerotri.volume.quantity import Volume, no_data_note
from aerotri.volume.sections import Sections, cross_sections, section_volume
from aerotri.volume.settings import METHOD, METHODS, RULES, SECTIONS, SectionPlan
from aerotri.volume.sums import RasterVolumes, Window, raster_volumes

DEFAULT_SECTIONS = 20
"""Intervals between sections where no spacing is given, along the boundary's extent; more where cells are finer."""
SPREAD = 0.005
"""Share of cut + fill by which methods may differ before the user is told."""
LOWEST_LAND, HIGHEST_LAND = -500.0, 9000.0
"""m, heights of land and of open pits lie between; the user is told of others [C]."""


@dataclass(frozen=True, eq=False)
class Volumes:
    """The volumes of a surface over a base inside a boundary.

    Parameters
    ----------
    chosen : the one that counts. by_method : all of them. sections : the cross sections behind the rules.
    lowest, highest : m, extremes of surface − base; NaN where nothing is known. warnings : sentences.
    """

    chosen: Volume
    by_method: tuple[Volume, ...]
    sections: Sections
    lowest: float
    highest: float
    warnings: tuple[str, ...]


def compute_volumes(
    surface: Surface,
    base: Base,
    boundary: Boundary,
    method: str = METHOD,
    plan: SectionPlan = SECTIONS,
    keep: Callable[[Window], None] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Volumes:
    """All methods side by side.

    Parameters
    ----------
    method : the one that counts, of `METHODS`.
    keep : takes every window, for a map of the thickness. progress : takes (what, done, of).

    Raises
    ------
    InputError
        When there is nothing inside the boundary, or nothing by the method that counts.
    """
    if method not in METHODS:
        raise InputError(f"there is no method '{method}'", f"choose one of {', '.join(METHODS)}")

    def told(what: str) -> Callable[[int, int], None]:
        return lambda done, count: progress(what, done, count) if progress is not None else None

    rasters = raster_volumes(surface, base, boundary, keep, told("window"))
    if rasters.cells.area <= 0.0:
        raise InputError("no height is known inside the boundary", "check the boundary, the base and their CRS")
    spacing = _default_spacing(surface, boundary, plan.azimuth) if plan.spacing is None else plan.spacing
    sections = cross_sections(surface, base, boundary, spacing, plan.azimuth, told("section"))
    found = (rasters.prisms, rasters.cells, *(section_volume(sections, rule) for rule in RULES))
    chosen = found[METHODS.index(method)]
    if chosen.area <= 0.0:
        raise InputError(
            f"no four neighbouring cells inside the boundary have heights of surface and base, and method '{method}' "
            "needs them", "take the method grid (--method grid), which counts every cell by itself, or fill the holes",
        )  # fmt: skip
    said = (
        no_data_note(chosen), _impossible(rasters.of_surface, "the surface"),
        _impossible(rasters.of_base, f"the base ({base.name})", isinstance(base, SurfaceBase)),
        _spread(found, chosen), _coarse(surface, boundary),
    )  # fmt: skip
    warnings = [text for text in said if text]
    return Volumes(chosen, found, sections, *_extremes(rasters), tuple(warnings))


def _extremes(rasters: RasterVolumes) -> tuple[float, float]:
    known = np.isfinite(rasters.lowest)
    return (rasters.lowest, rasters.highest) if known else (np.nan, np.nan)


def _default_spacing(surface: Surface, boundary: Boundary, azimuth: float) -> float:
    """The extent along the azimuth over an even multiple of three, so that every rule fits."""
    a = np.radians(azimuth)
    along = np.concatenate(boundary.rings) @ np.array([np.sin(a), np.cos(a)])
    length = float(along.max() - along.min())
    cell = min(surface.grid.cell_x, surface.grid.cell_y)
    count = 6 * max(1, round(min(max(DEFAULT_SECTIONS, length / (10.0 * cell)), 120.0) / 6.0))
    return length / count


def _spread(found: tuple[Volume, ...], chosen: Volume) -> str:
    """How far the other methods are off, in words; '' when they agree."""
    size = chosen.cut + chosen.fill
    worst = max(found, key=lambda v: abs(v.net - chosen.net))
    if abs(worst.net - chosen.net) <= SPREAD * size:
        return ""
    return (
        f"the methods differ: {worst.method} gives {in_digits(worst.net, 6)} m³ net, {chosen.method} "
        f"{in_digits(chosen.net, 6)} m³; sections closer together, or a finer surface, bring them together"
    )


def _impossible(heights: tuple[float, float], what: str, is_raster: bool = True) -> str:
    """What heights that land does not have may come from; '' where there are none.

    Parameters
    ----------
    heights : m, lowest and highest inside the boundary. what : surface or base, in words.
    """
    low, high = heights
    if low >= LOWEST_LAND and high <= HIGHEST_LAND:
        return ""
    file = "does its file state its value for no data (gdal_edit.py -a_nodata VALUE FILE) and its unit?"
    return (
        f"{what} has heights from {in_digits(low, 6)} to {in_digits(high, 6)} m inside the boundary, and land lies "
        f"between {LOWEST_LAND:g} and {HIGHEST_LAND:g} m: {file if is_raster else 'are they right, and in metres?'}"
    )


def _coarse(surface: Surface, boundary: Boundary) -> str:
    cells = boundary.area / (surface.grid.cell_x * surface.grid.cell_y)
    return "" if cells >= 100.0 else f"the boundary holds {cells:.0f} cells only: its shape outweighs the heights"
