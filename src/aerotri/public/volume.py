"""A volume between a surface and a base, and how sure it is."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.crs_text import height_system, heights_of, refuse_other_system, same_system, system_in_words
from aerotri.formats.files.spool import Spool
from aerotri.observations.project import Project
from aerotri.public.argument_types import with_checked_types
from aerotri.public.ground_of_block import off_the_ground
from aerotri.public.places import place_in_words
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.projects import project_of
from aerotri.public.stated import StatedAdjustment
from aerotri.public.used_arguments import used_arguments
from aerotri.public.volume_result import THICKNESS, MeasuredVolume
from aerotri.public.volume_sigma import MeasuredSurface, SigmaOfVolumes
from aerotri.results.head import Head
from aerotri.volume.settings import (
    BASE,
    BOUNDARIES_FROM,
    LAYER,
    LAYERS,
    METHOD,
    SECTIONS,
    SIGMA,
    BoundaryFrom,
    Density,
    Layer,
    Method,
    SectionPlan,
    SigmaOptions,
)

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from aerotri.public.adjustment import Adjustment
    from aerotri.public.surfaces import Reader, SurfaceLike
    from aerotri.public.table import Table
    from aerotri.volume.accuracy import StatedSigma, VolumeSigma
    from aerotri.volume.bases import Base
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.compute import Volumes
    from aerotri.volume.piles import Pile
    from aerotri.volume.thickness import ThicknessMap


@with_checked_types
def volume(
    surface: SurfaceLike,
    boundary: BaseGeometry | Mapping[str, BaseGeometry] | FilePath | None = None,
    *,
    layer: Layer = LAYER,
    base: SurfaceLike | float = BASE,
    method: Method = METHOD,
    section_spacing: float | None = SECTIONS.spacing,
    azimuth: float = SECTIONS.azimuth,
    adjustment: Adjustment | FilePath | None = None,
    pickets: Table | FilePath | None = None,
    base_adjustment: Adjustment | FilePath | None = None,
    base_pickets: Table | FilePath | None = None,
    matching_sigma_um: float | None = SIGMA.matching_sigma_um,
    matching_window: float | None = SIGMA.matching_window_m,
    base_sigma: float = SIGMA.base_sigma,
    boundary_sigma: float = SIGMA.boundary_sigma,
    boundary_from: BoundaryFrom = SIGMA.boundary_from,
    corrected: bool = SIGMA.corrected,
    density: float | None = None,
    density_sigma: float = 0.0,
    project: FilePath | None = None,
    scratch: FilePath | None = None,
    progress: ProgressLike = None,
) -> MeasuredVolume:
    """The volume between a surface and a base, cut and fill, by several methods; with an adjustment its σ.

    Parameters
    ----------
    surface : raster of heights; or what `aerotri.terrain` returned, or the folder it was written to, whose pickets
        are used for σ; or what `aerotri.dense_surface` returned, or its folder: σ and noise length of its cells count.
    boundary : file of polygons (GeoPackage, GeoJSON, Shapefile, FlatGeobuf, KML, DXF or WKT), WKT text, a shapely
        polygon, or polygons by their names; the whole surface where None. Several polygons, and the parts of one
        feature, are piles: each is measured by itself, with a base of its own, and their sum has a σ that knows what
        they share.
    layer : which surface of these: 'dsm' with objects (a pile is one), or 'dtm', the ground alone.
    base : height in m, 'level:H', 'plane:X,Y,Z;X,Y,Z;X,Y,Z', 'plane' (fitted to the boundary), 'boundary' (spline
        through it), 'lowest' (level of its lowest point), or another surface.
    method : the one that counts; all are computed.
    section_spacing : m between cross sections; a round number where None.
    azimuth : degrees from north, in which sections follow one another.
    adjustment : result the surface was measured with; without it there is no σ, only what the σ stated of base,
        boundary and density make of it (`summary["stated_sigma"]`).
    pickets : pickets.parquet or its table; without, every cell is taken for a point that was measured.
    base_adjustment : result of a base that is a surface.
    base_pickets : pickets of a base that is a surface.
    matching_sigma_um : µm, σ of an image coordinate of a picket; that of the adjustment where None.
    matching_window : m, side of the matching window on the ground; its cells share noise. None: the noise length of a
        dense surface, 0 of others.
    base_sigma : m, σ of the height of the base, common to all of it; it takes the place of what the ground around a
        spline through the boundary says.
    boundary_sigma : m, σ of either coordinate of a corner of the boundary.
    boundary_from : 'survey', where the boundary is known in space, as from a plan or measured on the ground; 'product',
        where it was drawn on the surface or the orthophoto of the same adjustment: it moves with them.
    corrected : the photographs were corrected for their image errors.
    density : t/m³, of all that is inside the boundary: gives tonnes.
    density_sigma : t/m³, its σ, common to all piles.
    project : block, or result of an adjustment, whose [project] stands at the head of page and file; that of the
        adjustment or of the surface where None.
    scratch : folder for the raster of the thickness until it is saved; the temporary one of the system where None.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    MeasuredVolume

    Raises
    ------
    InputError
        For a setting that makes no sense, files that cannot be read, or surfaces and boundary that do not meet.

    Examples
    --------
    >>> import aerotri, numpy as np
    >>> hill = aerotri.Surface.of_array(100.0 + np.full((20, 20), 3.0), left=0.0, top=40.0, cell=2.0)
    >>> found = aerotri.volume(hill, "POLYGON ((10 10, 30 10, 30 30, 10 30, 10 10))", base=100.0)
    >>> f"{found.net:.1f} m³ on {found.area:.1f} m²"
    '1200.0 m³ on 400.0 m²'
    """
    _refuse_contradictions(adjustment, pickets, base_adjustment, base_pickets)
    if layer not in LAYERS:
        raise InputError(f"there is no layer '{layer}'", f"choose one of {', '.join(LAYERS)}")
    if boundary_from not in BOUNDARIES_FROM:
        raise InputError(
            f"a boundary from '{boundary_from}' is not known", f"choose one of {', '.join(BOUNDARIES_FROM)}"
        )
    if adjustment is None and boundary_from != SIGMA.boundary_from:
        raise InputError(
            f"boundary_from='{boundary_from}' belongs to an adjustment",
            "give the adjustment that the surface was measured with: without σ it has no effect",
        )
    top, below = MeasuredSurface(surface, _stated(adjustment), pickets, layer), None
    if is_surface(base):
        below = MeasuredSurface(base, _stated(base_adjustment), base_pickets, layer)
    elif base_adjustment is not None or base_pickets is not None:
        raise InputError("base_adjustment and base_pickets need a surface as base", "give its raster as base")
    options = SigmaOptions(
        matching_sigma_um, matching_window, base_sigma=base_sigma, boundary_sigma=boundary_sigma, corrected=corrected,
        boundary_from=boundary_from,
    )  # fmt: skip
    if density is None and density_sigma != 0.0:
        raise InputError("density_sigma belongs to a density", "give the density, tonnes per cubic metre")
    known = None if density is None else Density(density, density_sigma)
    plan, whose = SectionPlan(section_spacing, azimuth), project_of(project, adjustment, surface)
    settings = used_arguments(
        volume,
        {"layer": layer, "base": base, "method": method, "section_spacing": section_spacing, "azimuth": azimuth,
         "matching_sigma_um": matching_sigma_um, "matching_window": matching_window, "base_sigma": base_sigma,
         "boundary_sigma": boundary_sigma, "boundary_from": boundary_from, "corrected": corrected,
         "density": density, "density_sigma": density_sigma},
        UNITS,
    )  # fmt: skip
    asked = _Asked(top, below, base, boundary, method, plan, options, known, whose, settings)
    with stage_report(progress) as report, ExitStack() as stack:
        return _compute(asked, Spool(scratch), stack, report)


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is to be computed, as stated."""

    top: MeasuredSurface
    below: MeasuredSurface | None
    base: SurfaceLike | float
    boundary: BaseGeometry | Mapping[str, BaseGeometry] | FilePath | None
    method: Method
    plan: SectionPlan
    options: SigmaOptions
    density: Density | None = None
    project: Project = field(default_factory=Project)
    settings: list[dict[str, Any]] = field(default_factory=list)


UNITS = {
    "section_spacing": "m", "azimuth": "°", "matching_sigma_um": "µm", "matching_window": "m", "base_sigma": "m",
    "boundary_sigma": "m", "density": "t/m³", "density_sigma": "t/m³",
}  # fmt: skip


def is_surface(base: SurfaceLike | float) -> TypeGuard[SurfaceLike]:
    """Whether a base is a surface: neither told in words nor by its height."""
    from aerotri.volume.bases import is_raster

    return is_raster(base) if isinstance(base, str) else not isinstance(base, int | float)


def _refuse_contradictions(
    adjustment: Adjustment | FilePath | None,
    pickets: Table | FilePath | None,
    base_adjustment: Adjustment | FilePath | None,
    base_pickets: Table | FilePath | None,
) -> None:
    if adjustment is None and not (pickets is None and base_adjustment is None and base_pickets is None):
        raise InputError("pickets, base_pickets and base_adjustment belong to an adjustment", "give the adjustment")


def _stated(adjustment: Adjustment | FilePath | None) -> StatedAdjustment | None:
    return None if adjustment is None else StatedAdjustment(adjustment)


def _compute(asked: _Asked, spool: Spool, stack: ExitStack, report: StageReport) -> MeasuredVolume:
    from aerotri.formats.results.adjusted import adjusted_json
    from aerotri.formats.results.volume import Sources, pile_json, volume_json
    from aerotri.rasters.grids import cache_limited
    from aerotri.rasters.metric import refuse_stretched
    from aerotri.volume.bases import PilesBase
    from aerotri.volume.boundary import outline_notes
    from aerotri.volume.piles import total_of_piles
    from aerotri.volume.sections import chosen_profiles

    top, below = asked.top, asked.below
    stack.enter_context(cache_limited())
    reader = stack.enter_context(top.surface.reader(top.adjustment.crs if top.adjustment else None))
    refuse_stretched(reader)
    boundary = _boundary(asked.boundary, reader)
    _refuse_apart(boundary, reader)
    others: list[Reader] = []
    base = _base(asked.base, below, reader, boundary, stack, others)
    systems = [text for other in others for text in _systems_in_words(reader, other)]
    systems += [
        off_the_ground(one, side.adjustment.record)
        for one, side in zip((reader, *others), (top, below), strict=False)
        if side is not None and side.adjustment is not None
    ]
    piles = _piles(asked, base, reader, boundary)
    if base is None:
        base = PilesBase(tuple(one.boundary for one in piles), tuple(one.base for one in piles))
    volumes, thickness = _volumes(reader, base, boundary, asked, spool, report)
    if piles:
        volumes = total_of_piles(volumes, piles)
    sigma, notes = None, ()
    sigmas: list[VolumeSigma | None] = [None] * len(piles)
    each_stated, stated = _stated_alone(asked, base, reader, boundary, piles)
    if top.adjustment is not None:
        report.stage("σ of the volume", None)
        finder = SigmaOfVolumes(top, below, reader, asked.options, stack)
        if piles:
            each, sigma = finder.of_piles(piles)
            sigmas = [*each]
        else:
            sigma = finder.of_one(base, boundary, volumes.chosen)
        notes = finder.doubts
    crs = reader.system
    measured_with = (top.adjustment.name, top.name_of_points) if top.adjustment else ("", "")
    sources = Sources(reader.path.name, crs, *measured_with)
    head = Head(asked.project, crs)
    content = head.as_dict() | volume_json(volumes, base, boundary, sources, sigma, asked.density, stated)
    content["piles"] = [
        pile_json(one, own, asked.density, own_stated)
        for one, own, own_stated in zip(piles, sigmas, each_stated, strict=True)
    ]
    content["adjusted"] = None if top.adjustment is None else adjusted_json(top.adjustment.record.result)
    content["base"]["follows_surface"] = _follows(asked.base)
    content["settings"] = asked.settings
    outlines = outline_notes(boundary, min(reader.grid.cell_x, reader.grid.cell_y)) if _follows(asked.base) else ()
    silent = "" if any(other.system for other in others) else _without_crs(top, reader)
    crs_notes = (reader.note, silent, *(other.note for other in others), *systems, boundary.note, *outlines)
    content["warnings"] = [*(text for text in crs_notes if text), *content["warnings"]]
    profiles = chosen_profiles(reader, base, boundary, volumes.sections)
    return MeasuredVolume(volumes, boundary, content, thickness, profiles, spool, notes, head)


def _stated_alone(
    asked: _Asked, base: Base, reader: Reader, boundary: Boundary, piles: list[Pile]
) -> tuple[Sequence[StatedSigma | None], StatedSigma | None]:
    """What is stated about base and boundary makes of σ, of every pile and of all; None with an adjustment."""
    from aerotri.volume.accuracy import stated_sigma, stated_sum

    if asked.top.adjustment is not None:
        return [None] * len(piles), None
    if not piles:
        return [], stated_sigma(reader, base, boundary, asked.options)
    each = [stated_sigma(reader, one.base, one.boundary, asked.options) for one in piles]
    return each, stated_sum(each)


def _without_crs(top: MeasuredSurface, reader: Reader) -> str:
    """What is taken for granted of a file that says no CRS, where no adjustment says that the block is local; or ''."""
    if top.surface.path is None or top.adjustment is not None or reader.system:
        return ""
    return f"{reader.path.name} does not say its coordinate system; X, Y and heights are taken for metres"


def _follows(base: SurfaceLike | float) -> bool:
    """Whether a base follows from the surface along the boundary."""
    from aerotri.volume.bases import WORDS

    return isinstance(base, str) and base in WORDS


def _refuse_apart(boundary: Boundary, reader: Reader) -> None:
    """Refuse polygons that lie beside the surface.

    Raises
    ------
    InputError
    """
    import shapely

    edges = reader.grid.bounds
    for name, polygon in boundary.piles or ((boundary.name, boundary.polygon),):
        if not shapely.intersects(polygon, shapely.box(*edges)):
            where = f" ({system_in_words(reader.system)})" if reader.system else ""
            note = f"; {boundary.note}" if boundary.note else ""
            raise InputError(
                f"'{name}' does not meet the surface: it lies at {place_in_words(polygon.bounds)}, the "
                f"surface{where} at {place_in_words(edges)}{note}", "check the CRS of both", reader.path,
            )  # fmt: skip


def _piles(asked: _Asked, base: Base | None, reader: Reader, boundary: Boundary) -> list[Pile]:
    """Every polygon of the boundary by itself; base : of all, None where each has one that follows from its outline."""
    from aerotri.volume.bases import parse_base
    from aerotri.volume.boundary import boundary_of
    from aerotri.volume.compute import compute_volumes
    from aerotri.volume.piles import Pile

    found: list[Pile] = []
    for name, polygon in boundary.piles:
        own = replace(boundary_of(polygon, name), beside=boundary.polygon)
        try:
            below = parse_base(str(asked.base), reader, own) if base is None else base
            volumes = compute_volumes(reader, below, own, asked.method, asked.plan)
        except InputError as error:
            raise InputError(f"pile '{name}': {error.message}", error.remedy, error.file or reader.path) from error
        found.append(Pile(name, own, below, volumes))
    return found


def _boundary(stated: BaseGeometry | Mapping[str, BaseGeometry] | FilePath | None, reader: Reader) -> Boundary:
    from shapely.geometry.base import BaseGeometry

    from aerotri.volume.boundary import boundary_of_grid, boundary_of_parts, boundary_of_piles, read_boundary

    if stated is None:
        return boundary_of_grid(reader.grid)
    if isinstance(stated, BaseGeometry):
        return boundary_of_parts(stated, "the polygon given")
    if isinstance(stated, Mapping):
        if not stated:
            raise InputError("no polygon is given", "give a polygon for every name")
        return boundary_of_piles([(str(name), polygon) for name, polygon in stated.items()], "the polygons given")
    return read_boundary(os.fspath(stated), reader.plan)


def _base(
    stated: SurfaceLike | float, below: MeasuredSurface | None, reader: Reader, boundary: Boundary, stack: ExitStack,
    others: list[Reader],
) -> Base | None:  # fmt: skip
    """The base, None where every pile has its own.

    The raster of one that is a surface is open as long as the stack, in the CRS of the surface.
    """
    from aerotri.rasters.height_systems import height_system_in_words
    from aerotri.rasters.metric import refuse_stretched
    from aerotri.volume.bases import SurfaceBase, level, parse_base

    if isinstance(stated, int | float):
        return level(float(stated))
    if below is None and boundary.piles and _follows(stated):
        return None
    if below is None:
        try:
            return parse_base(str(stated), reader, boundary)
        except InputError as error:
            if not _follows(stated):
                raise
            raise InputError(error.message, error.remedy, reader.path) from error
    other = stack.enter_context(below.surface.reader(reader.plan or None))
    refuse_other_system(other.plan, reader.plan, "the surface", other.path)
    heights, own = (heights_of(one.system) for one in (other, reader))
    if heights and own and not same_system(height_system(heights), height_system(own)):
        message = (f"its heights are in {height_system_in_words(heights)}, those of {reader.path.name} in "
                   f"{height_system_in_words(own)}")  # fmt: skip
        raise InputError(message, "bring them into one system of heights", other.path)
    refuse_stretched(other)
    others.append(other)
    return SurfaceBase(below.surface.label, other)


def _systems_in_words(reader: Reader, other: Reader) -> list[str]:
    """What is taken for granted where one of surface and base does not say its systems."""
    said = []
    for one, second in ((reader, other), (other, reader)):
        if second.plan and not one.plan:
            said.append(f"{one.path.name} has no CRS; it is taken for {system_in_words(second.plan)}, as "
                        f"{second.path.name} is")  # fmt: skip
        if heights_of(second.system) and not heights_of(one.system):
            said.append(f"{one.path.name} does not say in which system its heights are; they are taken for those of "
                        f"{second.path.name}, {system_in_words(second.system)}")  # fmt: skip
    return said


def _volumes(
    reader: Reader, base: Base, boundary: Boundary, asked: _Asked, spool: Spool, report: StageReport
) -> tuple[Volumes, ThicknessMap]:
    """All methods, the raster of the thickness on the way, and its map."""
    from aerotri.rasters.grids import RasterWriter
    from aerotri.rasters.surface_files import make_cloud_optimised
    from aerotri.volume.compute import compute_volumes
    from aerotri.volume.sums import Window, cells_within
    from aerotri.volume.thickness import ThicknessMeans

    row, column, rows, columns = cells_within(reader.grid, boundary)
    if not rows or not columns:
        raise InputError("the boundary does not meet the surface", "check the CRS of both", reader.path)
    part = reader.grid.window(row, column, rows, columns)
    means = ThicknessMeans(part)
    # heights that the file has in feet are in metres here
    crs = reader.system if heights_of(reader.system) else reader.crs
    with RasterWriter(spool.folder / THICKNESS, part, crs=crs, options={"compress": "deflate"}) as writer:
        writer.describe("surface − base, m")

        def keep(window: Window) -> None:
            inside = np.where(window.part > 0.0, window.thickness, np.nan)
            means.add(window.row - row, window.column - column, inside)
            writer.write(window.row - row, window.column - column, inside.astype(np.float32))

        volumes = compute_volumes(reader, base, boundary, asked.method, asked.plan, keep, report.counted)
    make_cloud_optimised(spool.folder / THICKNESS)
    spool.refuse_full()
    return volumes, means.map()
