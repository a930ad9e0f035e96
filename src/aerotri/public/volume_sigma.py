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

import numpy as np

from aerotri.conventions import FilePath, InputError, real_path
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
    from aerotri.volume.accuracy import PileSigma, VolumeSigma
    from aerotri.volume.bases import Base, SurfaceBase
    from aerotri.volume.bases import Surface as Heights
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.cell_noise import CellNoise
    from aerotri.volume.counted import Counted
    from aerotri.volume.parts import Part
    from aerotri.volume.piles import Pile
    from aerotri.volume.quantity import Volume
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
            return noise_of_dense(self.given, self.layer)
        return noise_of_file(self.surface.path, stack)

    def is_same(self, other: MeasuredSurface) -> bool:
        """Whether both are one file, or one surface in memory."""
        one, two = self.surface.path, other.surface.path
        if one is None or two is None:
            return self.surface.source is other.surface.source
        return real_path(one) == real_path(two)


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
        check_crs(stated.record, self.reader.plan, self.reader.path)
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

        missing = [one.adjustment.missing for one in (self.top, self.below) if one is not None and one.adjustment]
        notes = (*dict.fromkeys(text for text in missing if text), *self._below[1])
        if self.top.is_model and self.top.key != adjustment_key(self.record):
            return (f"{self.top.surface.label} was measured with another adjustment than the one stated", *notes)
        return notes

    def _shares(self, base: Base, boundary: Boundary, counted: Counted | None) -> tuple[Part, Part | None]:
        from aerotri.volume.bases import SurfaceBase

        noise, options = self._noise, self.options
        part = surface_part((self.record, self.reader, self.top.points), boundary, base, options, noise[0], counted)
        if self.below is None or not isinstance(base, SurfaceBase) or self._below[0] is None:
            return part, None
        lower = (self._below[0], base.surface, self.below.points)
        of_lower = None if counted is None else self._counted_below(counted, base)
        return part, surface_part(lower, boundary, None, options, noise[1], of_lower)

    def _counted_below(self, counted: Counted, base: SurfaceBase, net: PileSigma | None = None) -> Counted:
        """What counts, of the surface that is the base; net : of both, where a side counts."""
        from aerotri.volume.bases import SurfaceBase
        from aerotri.volume.counted import Counted
        from aerotri.volume.shared import places_apart

        known = None if self.below is None or self.below.points is None else base.surface
        upper = SurfaceBase(self.reader.path.name, self.reader)
        found = Counted(upper, -counted.sign, counted.spread, known)
        if net is None or net.base_part is None:
            return found
        apart = places_apart(net.part, net.base_part)
        return replace(found, noise=net.part.noise_at(apart), apart=apart)

    def _net(self, base: Base, boundary: Boundary, volume: Volume) -> PileSigma:
        """Of all that is known inside a boundary."""
        from aerotri.volume.accuracy import PileSigma, volume_sigma
        from aerotri.volume.counted import Counted

        holes = volume.no_data_area > 0.0
        counted = Counted(base, known=self.reader if self.top.points is not None else None) if holes else None
        shares = self._shares(base, boundary, counted)
        region = shares[0].region
        area = boundary.area if region is None else region.area
        return PileSigma(*shares, area, volume_sigma(self.reader, base, boundary, *shares, self.options))

    def _side(self, net: PileSigma, base: Base, boundary: Boundary, of: tuple[int, float]) -> PileSigma:
        """Of the cut (1) or the fill (−1), with σ of the height along the line between them."""
        from aerotri.volume.counted import Counted
        from aerotri.volume.shared import places_apart

        sign, spread = of
        other = net.base_part
        noise = 0.0 if other is None else other.noise_at(places_apart(net.part, other))
        return self._counting(net, Counted(base, sign, spread, self._known_of(net), noise=noise), boundary)

    def _spread(self, net: PileSigma, base: Base, boundary: Boundary) -> float:
        """m, σ of the height over the base along the line between cut and fill, the same error all along it."""
        from aerotri.volume.counted import Counted

        along = net
        if net.spread > 0.0:
            found = self._counting(net, Counted(base, known=self._known_of(net), band=net.spread), boundary)
            along = found if found.area > 0.0 else net
        return float(np.hypot(along.spread, self.options.base_sigma))

    def _known_of(self, net: PileSigma) -> Reader | None:
        """Where a surface of points has heights, if not everywhere."""
        return self.reader if self.top.points is not None and net.part.region is not None else None

    def _counting(self, net: PileSigma, counted: Counted, boundary: Boundary) -> PileSigma:
        """What of a volume counts."""
        from aerotri.volume.accuracy import PileSigma, volume_sigma
        from aerotri.volume.bases import SurfaceBase

        base = counted.other
        if net.part.side is None:
            raise ValueError("what counts of a part was asked for already")
        part, other = net.part.side(counted), None
        if net.base_part is not None and net.base_part.side is not None and isinstance(base, SurfaceBase):
            other = net.base_part.side(self._counted_below(counted, base, net))
        region = part.region
        area = 0.0 if region is None else region.area
        return PileSigma(part, other, area, volume_sigma(self.reader, base, boundary, part, other, self.options))

    def _all(self, base: Base, boundary: Boundary, volume: Volume) -> tuple[PileSigma, list[PileSigma | None]]:
        """Of the net volume, and of cut and fill; None where there is none."""
        net = self._net(base, boundary, volume)
        if volume.cut > 0.0 and volume.fill > 0.0:
            spread = self._spread(net, base, boundary)
            return net, [self._side(net, base, boundary, (sign, spread)) for sign in (1, -1)]
        return net, [net, None] if volume.cut > 0.0 else [None, net]

    def of_one(self, base: Base, boundary: Boundary, volume: Volume) -> VolumeSigma:
        """σ of the volume inside a boundary, and of its cut and fill.

        Raises
        ------
        InputError
        """
        net, sides = self._all(base, boundary, volume)
        found = _with_sides(net.sigma, [None if one is None else one.sigma for one in sides])
        return replace(found, notes=(*self._notes, *found.notes))

    def of_piles(self, piles: Sequence[Pile]) -> tuple[list[VolumeSigma], VolumeSigma]:
        """σ of every volume, and of their sum; of cut and fill too.

        Raises
        ------
        InputError
        """
        from aerotri.volume.accuracy import sum_sigma

        found = [self._all(one.base, one.boundary, one.volumes.chosen) for one in piles]
        each = [_with_sides(net.sigma, [None if one is None else one.sigma for one in sides]) for net, sides in found]
        total = sum_sigma([net for net, _ in found], self.options)
        of_sides: list[VolumeSigma | None] = []
        for k in range(2):
            own = [sides[k] for _, sides in found]
            some = [one for one in own if one is not None]
            same = all(one is net for one, (net, _) in zip(own, found, strict=True))
            of_sides.append(total if same else sum_sigma(some, self.options) if some else None)
        total = _with_sides(total, of_sides)
        return each, replace(total, notes=(*self._notes, *total.notes))


def _with_sides(net: VolumeSigma, sides: Sequence[VolumeSigma | None]) -> VolumeSigma:
    """σ of a net volume with those of its cut and its fill."""
    from aerotri.volume.accuracy import SideSigma

    cut, fill = (SideSigma.of(one, net) for one in sides)
    return replace(net, sides=(cut, fill))


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
    of: tuple[Record, Heights, FilePath | Table | None], boundary: Boundary, base: Base | None, options: SigmaOptions,
    noise: CellNoise, counted: Counted | None = None,
) -> Part:  # fmt: skip
    """The share of a surface in σ: of the points it was measured at where they are known, else of all its cells.

    Parameters
    ----------
    of : its adjustment, its heights and its points, None where not known.
    noise : what is known of that of the cells. counted : what of it counts; None: all.

    Raises
    ------
    InputError
        When the points make no surface, or no photograph sees it.
    """
    from aerotri.formats.results.pickets import measured_pickets
    from aerotri.formats.text.parquet import load_parquet
    from aerotri.volume.parts import part_of_cells, part_of_measured

    record, heights, points = of
    if points is None:
        return part_of_cells(record, heights, boundary, base, options, noise, counted)
    if isinstance(points, Table):
        measured = measured_pickets(points.to_arrow())
    else:
        measured = measured_pickets(load_parquet(Path(points)), Path(points))
    return part_of_measured(record, measured, boundary, base, options, counted)
