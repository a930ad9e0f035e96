"""What the surfaces of a volume were measured with, as far as it is known, and the σ that follows from it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.conventions import FilePath, InputError
from aerotri.public.dense import RECORD as DENSE
from aerotri.public.dense import DenseSurface
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
    from aerotri.volume.cell_noise import CellNoise
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
            return None if isinstance(self.given, DenseSurface) else self.given.pickets
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
        """Of the adjustment it was measured with: that `dtm` or `dsm` wrote beside it; '' where nothing says so."""
        if not isinstance(self.given, Surface | str | os.PathLike):
            return self.given.adjustment
        path = self.surface.path
        if path is None:
            return ""
        for name in (TERRAIN, DENSE):
            try:
                content = json.loads((path.parent / name).read_text(encoding="utf-8"))
            except (OSError, ValueError):
                continue
            return str(content.get("adjustment", "")) if isinstance(content, dict) else ""
        return ""

    def noise(self, stack: ExitStack) -> CellNoise:
        """What a dense surface says of the noise of its cells; its rasters are open as long as the stack.

        Raises
        ------
        InputError
            When its files cannot be read, or do not belong together.
        """
        from aerotri.public.cell_noise import noise_of_dense, noise_of_file

        if isinstance(self.given, DenseSurface):
            return noise_of_dense(self.given)
        return noise_of_file(self.surface.path, stack)

    def is_same(self, other: MeasuredSurface) -> bool:
        """Whether both are one file, or one surface in memory."""
        one, two = self.surface.path, other.surface.path
        if one is None or two is None:
            return self.surface.source is other.surface.source
        return one.resolve() == two.resolve()


@dataclass(frozen=True, eq=False)
class SigmaOfVolumes:
    """Finds σ of the volumes of a surface that has an adjustment.

    Parameters
    ----------
    top : the surface. below : the surface that is the base, None where the base is another one.
    reader : of the surface. stack : keeps rasters open.
    """

    top: MeasuredSurface
    below: MeasuredSurface | None
    reader: Reader
    options: SigmaOptions
    stack: ExitStack

    @cached_property
    def record(self) -> Record:
        """The adjustment of the surface."""
        stated = self.top.adjustment
        if stated is None:
            raise InputError("the surface has no adjustment", "state the one it was measured with")
        check_crs(stated.record, self.reader.epsg, self.reader.path)
        return stated.record

    @cached_property
    def _below(self) -> tuple[Record | None, tuple[str, ...]]:
        return (None, ()) if self.below is None else adjustment_of_base(self.top, self.below, self.record)

    @cached_property
    def _noise(self) -> tuple[CellNoise, CellNoise]:
        from aerotri.volume.cell_noise import NO_NOISE

        return self.top.noise(self.stack), NO_NOISE if self.below is None else self.below.noise(self.stack)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Doubts about the adjustments, in sentences."""
        found = [self.top.adjustment.doubt] if self.top.adjustment is not None else []
        if self.below is not None and self.below.adjustment is not None and self._below[0] is not self.record:
            found.append(self.below.adjustment.doubt)
        return tuple(text for text in found if text)

    @property
    def _notes(self) -> tuple[str, ...]:
        from aerotri.volume.shared import adjustment_key

        notes = self._below[1]
        if self.top.is_model and self.top.key != adjustment_key(self.record):
            return (f"{self.top.surface.label} was measured with another adjustment than the one stated", *notes)
        return notes

    def _shares(self, base: Base, boundary: Boundary) -> tuple[Part, Part | None]:
        from aerotri.volume.bases import SurfaceBase

        noise, options = self._noise, self.options
        part = surface_part(self.record, self.reader, self.top.points, boundary, base, options, noise[0])
        if self.below is None or not isinstance(base, SurfaceBase) or self._below[0] is None:
            return part, None
        other = surface_part(self._below[0], base.surface, self.below.points, boundary, None, options, noise[1])
        return part, other

    def of_one(self, base: Base, boundary: Boundary) -> VolumeSigma:
        """σ of the volume inside a boundary.

        Raises
        ------
        InputError
        """
        from aerotri.volume.accuracy import volume_sigma

        found = volume_sigma(self.reader, base, boundary, *self._shares(base, boundary), self.options)
        return replace(found, notes=(*self._notes, *found.notes))

    def of_piles(self, piles: Sequence[tuple[Base, Boundary]]) -> tuple[list[VolumeSigma], VolumeSigma]:
        """σ of every volume, and of their sum.

        Raises
        ------
        InputError
        """
        from aerotri.volume.accuracy import PileSigma, sum_sigma, volume_sigma

        each: list[PileSigma] = []
        for base, boundary in piles:
            shares = self._shares(base, boundary)
            sigma = volume_sigma(self.reader, base, boundary, *shares, self.options)
            each.append(PileSigma(*shares, boundary.area, sigma))
        total = sum_sigma(each, self.options)
        return [one.sigma for one in each], replace(total, notes=(*self._notes, *total.notes))


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
    options: SigmaOptions, noise: CellNoise,
) -> Part:  # fmt: skip
    """The share of a surface in σ: of the points it was measured at where they are known, else of all its cells.

    Parameters
    ----------
    noise : what is known of that of the cells.

    Raises
    ------
    InputError
        When the points make no surface, or no photograph sees it.
    """
    from aerotri.formats.results.pickets import measured_pickets
    from aerotri.formats.text.parquet import load_parquet
    from aerotri.volume.parts import part_of_cells, part_of_measured

    if points is None:
        return part_of_cells(record, heights, boundary, base, options, noise)
    if isinstance(points, Table):
        measured = measured_pickets(points.to_arrow())
    else:
        measured = measured_pickets(load_parquet(Path(points)), Path(points))
    return part_of_measured(record, measured, boundary, base, options)
