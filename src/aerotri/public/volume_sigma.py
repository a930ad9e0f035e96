"""What the surfaces of a volume were measured with, as far as it is known, and the σ that follows from it."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.conventions import FilePath, InputError
from aerotri.public.models import check_crs
from aerotri.public.stated import StatedAdjustment
from aerotri.public.surfaces import Surface, as_surface
from aerotri.public.table import Table
from aerotri.public.terrain import PICKETS
from aerotri.public.terrain import RECORD as TERRAIN
from aerotri.volume.settings import LAYER, Layer

if TYPE_CHECKING:
    from aerotri.public.surfaces import Reader, SurfaceLike
    from aerotri.results.adjustment import Adjustment as Record
    from aerotri.volume.accuracy import VolumeSigma
    from aerotri.volume.bases import Base
    from aerotri.volume.bases import Surface as Heights
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.parts import Part
    from aerotri.volume.settings import SigmaOptions


@dataclass(frozen=True, eq=False)
class MeasuredSurface:
    """A surface, and what it was measured with as far as it is stated.

    Parameters
    ----------
    given : the surface. adjustment : None where not stated.
    pickets : the points measured, pickets.parquet or its table; None: those of a terrain model, in memory or in the
        folder it was written to, else not known.
    layer : of a terrain model: with objects or without.
    """

    given: SurfaceLike
    adjustment: StatedAdjustment | None = None
    pickets: FilePath | Table | None = None
    layer: Layer = LAYER

    @cached_property
    def surface(self) -> Surface:
        """The heights."""
        return as_surface(self.given, self.layer)

    @property
    def is_model(self) -> bool:
        """Whether it is a terrain model in memory, which knows its pickets and its adjustment."""
        return not isinstance(self.given, Surface | str | os.PathLike)

    @property
    def points(self) -> FilePath | Table | None:
        """The points measured: as stated, or those of a terrain model, in memory or in its folder."""
        if self.pickets is not None or isinstance(self.given, Surface):
            return self.pickets
        if not isinstance(self.given, str | os.PathLike):
            return self.given.pickets
        beside = Path(self.given) / PICKETS
        return beside if beside.is_file() else None

    @property
    def name_of_points(self) -> str:
        """As it stands in results; '' where there are none."""
        points = self.points
        if isinstance(points, Table):
            return points.name
        return "" if points is None else Path(points).name

    @property
    def key(self) -> str:
        """Of the adjustment it was measured with: that `aerotri dtm` wrote beside it; '' where nothing says so."""
        if not isinstance(self.given, Surface | str | os.PathLike):
            return self.given.adjustment
        path = self.surface.path
        try:
            content = None if path is None else json.loads((path.parent / TERRAIN).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return ""
        return str(content.get("adjustment", "")) if isinstance(content, dict) else ""

    def is_same(self, other: MeasuredSurface) -> bool:
        """Whether both are one file, or one surface in memory."""
        one, two = self.surface.path, other.surface.path
        if one is None or two is None:
            return self.surface.source is other.surface.source
        return one.resolve() == two.resolve()


def sigma_of_volume(
    top: MeasuredSurface, below: MeasuredSurface | None, reader: Reader, base: Base, boundary: Boundary,
    options: SigmaOptions,
) -> tuple[VolumeSigma, tuple[str, ...]]:  # fmt: skip
    """σ of a volume whose surface has an adjustment, and doubts about the adjustments, in sentences.

    Parameters
    ----------
    below : the surface that is the base, None where the base is another one. reader : of the surface.

    Raises
    ------
    InputError
    """
    from aerotri.volume.accuracy import volume_sigma
    from aerotri.volume.bases import SurfaceBase
    from aerotri.volume.shared import adjustment_key

    stated = top.adjustment
    if stated is None:
        raise InputError("the surface has no adjustment", "state the one it was measured with")
    doubts = [stated.doubt]
    check_crs(stated.record, reader.epsg, reader.path)
    part = surface_part(stated.record, reader, top.points, boundary, base, options)
    other, notes = None, ()
    if below is not None and isinstance(base, SurfaceBase):
        record, notes = adjustment_of_base(top, below, stated.record)
        if below.adjustment is not None and record is not stated.record:
            doubts.append(below.adjustment.doubt)
        if record is not None:
            other = surface_part(record, base.surface, below.points, boundary, None, options)
    if top.is_model and top.key != adjustment_key(stated.record):
        notes = (f"{top.surface.label} was measured with another adjustment than the one stated", *notes)
    sigma = volume_sigma(reader, base, boundary, part, other, options)
    return replace(sigma, notes=(*notes, *sigma.notes)), tuple(text for text in doubts if text)


def adjustment_of_base(
    top: MeasuredSurface, below: MeasuredSurface, record: Record
) -> tuple[Record | None, tuple[str, ...]]:
    """The adjustment that the base's surface comes from, None where nobody says so, and sentences about it.

    That is the one stated; else that of the surface where the base is the same surface, or where `aerotri dtm` wrote
    beside the base that it comes from the same adjustment.

    Parameters
    ----------
    record : adjustment of the surface.
    """
    from aerotri.volume.shared import adjustment_key

    if below.adjustment is not None:
        return (record if below.adjustment.is_same(top.adjustment) else below.adjustment.record), ()
    if below.is_same(top):
        return record, ()
    name = below.surface.label
    if below.pickets is not None:
        return record, (f"{name} is taken to come from the adjustment of the surface, as no other is given",)
    stated = below.key
    if stated == adjustment_key(record):
        return record, (f"{name} was measured with the same adjustment, {TERRAIN} beside it says",)
    if stated:
        return None, (f"{name} was measured with another adjustment: --base-adjustment names it",)
    return None, ()


def surface_part(
    record: Record, heights: Heights, points: FilePath | Table | None, boundary: Boundary, base: Base | None,
    options: SigmaOptions,
) -> Part:  # fmt: skip
    """The share of a surface in σ: of the points it was measured at where they are known, else of all its cells.

    Raises
    ------
    InputError
        When the points make no surface, or no photograph sees it.
    """
    from aerotri.formats.results.pickets import measured_pickets
    from aerotri.formats.text.parquet import load_parquet
    from aerotri.volume.parts import part_of_cells, part_of_measured

    if points is None:
        return part_of_cells(record, heights, boundary, base, options)
    if isinstance(points, Table):
        measured = measured_pickets(points.to_arrow())
    else:
        measured = measured_pickets(load_parquet(Path(points)), Path(points))
    return part_of_measured(record, measured, boundary, base, options)
