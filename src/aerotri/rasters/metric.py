"""Rasters of heights brought to metres: out of degrees or feet, by bilinear interpolation.

What is in metres already is read as it is. Heights count in what the vertical part of the CRS says, else in what the
file calls the unit of its band, else in metres; a plan in feet leaves that open, and the file has to say it. Where both
say it, they have to agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.crs_text import heights_of, plan_of, with_heights
from aerotri.rasters.grids import NO_DATA, Grid, RasterReader
from aerotri.rasters.height_systems import metric_height_system
from aerotri.rasters.undeclared import refuse_undeclared_no_data

if TYPE_CHECKING:
    from pyproj import CRS
    from rasterio.windows import Window

    from aerotri.rasters.held import HeldRaster

METRE = 1.0
"""Factor of heights that are in metres already."""
_SPELLINGS = {
    METRE: "m metre metres meter meters",
    0.1: "dm decimetre decimetres decimeter decimeters",
    0.01: "cm centimetre centimetres centimeter centimeters",
    0.001: "mm millimetre millimetres millimeter millimeters",
    1000.0: "km kilometre kilometres kilometer kilometers",
    0.3048: "ft foot feet international_foot",
    1200.0 / 3937.0: "us_survey_foot us-ft ftus us_survey_feet",
}
UNITS = {name.replace("_", mark): factor for factor, names in _SPELLINGS.items() for name in names.split()
         for mark in "_ "}  # fmt: skip
"""Metres of the units a band may name."""
NO_UNIT = ("", "unknown", "none")
"""What a band says that states no unit."""
MOST_STRETCHED = 0.02
"""Share by which a projection may change areas, 1 % in length [C]: UTM stays below 0.2 % in its zone and 1.1 % 6°
from its meridian, Lambert-93 below 0.6 %; Web Mercator is beyond it from 8.1° of latitude on."""
SAME_UNIT = 1e-5
"""Share by which two units may differ that are taken for one: files say 'ft' of both feet, 2e-6 apart [C]."""
UNIT_REMEDY = 'say it in the file: gdal_edit.py -units "US survey foot" FILE, or -units m'


@dataclass(frozen=True)
class RasterUnits:
    """What a raster counts in.

    Parameters
    ----------
    plan : 'metre', or the unit of its X. height : metres in its unit of height, None where nobody says.
    crs : its name and code, in words.
    """

    plan: str
    height: float | None
    crs: str

    @property
    def is_metric(self) -> bool:
        return self.plan == "metre" and self.height == METRE


class MetricReader(RasterReader):
    """A raster in metres, whatever its file counts in.

    Parameters
    ----------
    target : 'EPSG:n' in metres, where it is to be brought to when its own does not count metres; None: the UTM zone.

    Attributes
    ----------
    note : a sentence about what was done, '' where nothing was.

    Raises
    ------
    InputError
        When the unit of the heights is not known.
    """

    note = ""

    def __init__(self, path: FilePath, band: int = 1, target: str | None = None):
        super().__init__(path, band)
        self._target = target
        self._source: Any = None
        self._factor, self._heights = METRE, ""
        try:
            units = units_of(self)
            if band == 1:
                refuse_undeclared_no_data(self, units.height or METRE)
            self._bring_to_metres(units, target)
        except InputError:
            self._file.close()
            raise

    def __reduce__(self) -> tuple[Any, ...]:
        return MetricReader, (self.path.absolute(), self.band, self._target)

    @property
    def is_brought(self) -> bool:
        """Whether its plan was brought to another system."""
        return self._source is not None

    @property
    def system(self) -> str:
        """As of `RasterReader`; heights stay on their datum where they, or the plan, were brought to metres."""
        stated = super().system
        heights = heights_of(stated) or self._heights
        if not stated or not heights:
            return stated
        metric = metric_height_system(heights)
        # heights that were in feet of a system without a code are in metres of one that has no name
        return with_heights(stated, metric) if metric.isdigit() or self._factor == METRE else plan_of(stated)

    def _bring_to_metres(self, units: RasterUnits, target: str | None) -> None:
        if units.is_metric:
            return
        if units.height is None:
            raise InputError(
                f"is in {units.crs}, which counts in {units.plan}, and does not say what its heights count in",
                UNIT_REMEDY, self.path,
            )  # fmt: skip
        self._factor = units.height
        said = []
        if units.plan != "metre":
            target = target or metric_crs_for(self)
            self._warp(target)
            said.append(
                f"brought from {units.crs}, which counts in {units.plan}, to {target} by bilinear interpolation, cells "
                f"of {self.grid.cell_x:.4g} m"
            )
        if self._factor != METRE:
            said.append(f"heights multiplied by {self._factor:.10g} to metres")
            self.dtype = np.dtype(np.float64)
        self.note = f"{self.path.name}: {'; '.join(said)}"

    def _warp(self, target: str) -> None:
        """Read through GDAL's warper from now on."""
        from rasterio.enums import Resampling
        from rasterio.errors import RasterioError
        from rasterio.vrt import WarpedVRT

        no_data = NO_DATA if self.no_data is None else self.no_data
        try:
            warped = WarpedVRT(self._file, crs=target, resampling=Resampling.bilinear, nodata=no_data, dtype="float64")
        except RasterioError as error:
            raise InputError(f"cannot be brought to {target}: {error}", "check its CRS", self.path) from error
        self._heights = heights_of(super().system)
        self._source, self._file = self._file, warped
        t = warped.transform
        self.grid = Grid(warped.height, warped.width, t.c, t.f, t.a, -t.e)
        self.no_data, self.crs, self.options = no_data, warped.crs, {}
        self.dtype, self._masked = np.dtype(np.float64), False

    def _values(self, window: Window) -> np.ndarray:
        values = super()._values(window)
        return values if self._factor == METRE else values * self._factor

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        super().__exit__(kind, error, trace)
        if self._source is not None:
            self._source.close()


def units_of(reader: RasterReader) -> RasterUnits:
    """What a raster counts in; one without a CRS counts in metres, as local blocks do.

    Raises
    ------
    InputError
        When its heights count in a unit that is not known.
    """
    if reader.crs is None:
        of_band = _unit_of_band(reader)
        return RasterUnits("metre", METRE if of_band is None else of_band, "no CRS")
    whole = _crs_of(reader)
    if whole is None:
        of_band = _unit_of_band(reader)
        return RasterUnits("metre", METRE if of_band is None else of_band, "a CRS of its own")
    flat = whole.sub_crs_list[0] if whole.is_compound else whole
    axis = flat.axis_info[0] if flat.axis_info else None
    plan = "metre" if axis is None or (axis.unit_name in UNITS and UNITS[axis.unit_name] == METRE) else axis.unit_name
    up = whole.axis_info[2:] if len(whole.axis_info) == 3 else []
    height = _unit_of_heights(reader, up[0].unit_name, up[0].unit_conversion_factor) if up else _unit_of_band(reader)
    if height is None and (flat.is_geographic or plan == "metre"):
        height = METRE
    code = flat.to_epsg()
    return RasterUnits(plan, height, flat.name if code is None else f"EPSG:{code} ({flat.name})")


def _unit_of_heights(reader: RasterReader, name: str, metres: float) -> float:
    """Metres in the unit of heights of a CRS, name and metres; the band, where it states one, has to agree."""
    # files bring along the unit of their CRS as that of the band, whatever it is called
    of_band = metres if reader.stated_unit == name.lower() else _unit_of_band(reader)
    if of_band is not None and abs(of_band / metres - 1.0) > SAME_UNIT:
        raise InputError(
            f"its values count in '{reader.stated_unit}' by the unit of the band, and in '{name}' by its CRS",
            f'where the CRS is right, say so: gdal_edit.py -units "{name}" FILE; where the band is right, bring the '
            "values into the unit of the CRS first: gdal_calc.py", reader.path,
        )  # fmt: skip
    return metres


def _unit_of_band(reader: RasterReader) -> float | None:
    """Metres in the unit that the file states for its values, None where it states none."""
    named = reader.stated_unit
    if named in NO_UNIT:
        return None
    if named not in UNITS:
        raise InputError(f"its values count in '{named}', a unit that is not known", UNIT_REMEDY, reader.path)
    return UNITS[named]


def refuse_other_units(reader: RasterReader) -> None:
    """Refuse a raster that does not count in metres, where it is to be written in its own cells.

    Raises
    ------
    InputError
    """
    units = units_of(reader)
    if units.is_metric:
        return
    if reader.crs is None:
        raise InputError(
            f"its heights do not count in metres but in '{reader.stated_unit}'",
            f'bring them to metres first: gdal_calc.py -A IN --allBands=A --calc="A*{units.height:.10g}" --outfile OUT',
            reader.path,
        )
    if units.plan == "metre":
        raise InputError(f"is in {units.crs}, with heights that do not count in metres",
                         "bring them to metres first: gdal_calc.py, or gdalwarp -t_srs with a height system in metres",
                         reader.path)  # fmt: skip
    target = metric_crs_for(reader)
    raise InputError(
        f"is in {units.crs}, which counts in {units.plan}",
        f"bring it to metres first: gdalwarp -r bilinear -t_srs {target} IN OUT", reader.path,
    )  # fmt: skip


def refuse_plan_not_in_metres(crs: str, name: str) -> None:
    """Refuse heights in memory whose CRS, 'EPSG:n', does not count in metres: their cells are taken for metres.

    Raises
    ------
    InputError
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        whole = CRS.from_user_input(crs)
    except CRSError:
        return
    flat = whole.sub_crs_list[0] if whole.is_compound else whole
    axis = flat.axis_info[0] if flat.axis_info else None
    if axis is not None and UNITS.get(axis.unit_name) != METRE:
        raise InputError(
            f"{name} is in {crs} ({flat.name}), which counts in {axis.unit_name}",
            "save it as a GeoTIFF and give the file, which is brought to metres; or bring it to metres before",
        )


def metric_target(readers: Sequence[MetricReader | HeldRaster]) -> str | None:
    """'EPSG:n' that several rasters can be brought to, the first of theirs in metres; None where none states one.

    Where no file has been in metres, the system that the first of them was brought to.
    """
    plans = [(reader, reader.plan) for reader in readers]
    own = [plan for reader, plan in plans if plan and not (isinstance(reader, MetricReader) and reader.is_brought)]
    return next(iter(own or [plan for _, plan in plans if plan]), None)


def refuse_stretched(reader: RasterReader | HeldRaster) -> None:
    """Refuse a raster whose projection stretches areas, as Web Mercator does: volumes are in metres of the projection.

    Raises
    ------
    InputError
        When an area in the middle of the raster is wrong by more than `MOST_STRETCHED`.
    """
    from pyproj import CRS, Proj
    from pyproj.exceptions import CRSError, ProjError

    if reader.crs is None:
        return
    try:
        whole = CRS.from_user_input(reader.crs if isinstance(reader.crs, str) else reader.crs.to_wkt())
        flat = whole.sub_crs_list[0] if whole.is_compound else whole
        if not flat.is_projected:
            return
        left, bottom, right, top = reader.grid.bounds
        projection = Proj(flat)
        # its own inverse: degrees from Greenwich, whatever meridian and unit the system counts from and in
        place = projection((left + right) / 2.0, (bottom + top) / 2.0, inverse=True)
        scale = float(projection.get_factors(*place).areal_scale)
    except (CRSError, ProjError, AttributeError):
        # local, or a system that PROJ cannot say this of
        return
    if np.isfinite(scale) and abs(scale - 1.0) > MOST_STRETCHED:
        raise InputError(
            f"is in {flat.name}, in which 1 m² of ground counts as {scale:.3g} m² here",
            "bring it into UTM or a national system first: gdalwarp -r bilinear -t_srs EPSG:… IN OUT", reader.path,
        )  # fmt: skip


def metric_crs_for(reader: RasterReader) -> str:
    """'EPSG:n' of the UTM zone of the raster's middle, on its own datum where there is one, else on WGS 84."""
    from pyproj import Transformer
    from pyproj.aoi import AreaOfInterest
    from pyproj.database import query_utm_crs_info

    whole = _crs_of(reader)
    left, bottom, right, top = reader.grid.bounds
    x, y = (left + right) / 2.0, (bottom + top) / 2.0
    if whole is None:
        raise InputError("has no CRS that PROJ knows", "give it one: gdal_edit.py -a_srs", reader.path)
    flat = whole.sub_crs_list[0] if whole.is_compound else whole
    lon, lat = Transformer.from_crs(flat, "OGC:CRS84", always_xy=True).transform(x, y)
    if not np.isfinite([lon, lat]).all():
        raise InputError("lies outside the range of its CRS", "correct its georeference", reader.path)
    area = AreaOfInterest(lon, lat, lon, lat)
    geographic = flat.geodetic_crs
    for name in ("WGS 84" if geographic is None else geographic.name, "WGS 84"):
        found = query_utm_crs_info(datum_name=name, area_of_interest=area)
        if found:
            return f"EPSG:{found[0].code}"
    zone = int((lon + 180.0) // 6.0) % 60 + 1
    return f"EPSG:{(32600 if lat >= 0.0 else 32700) + zone}"


def _crs_of(reader: RasterReader) -> CRS | None:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        found = CRS.from_wkt(reader.crs.to_wkt())
    except (CRSError, AttributeError):
        return None
    return found if found.is_projected or found.is_geographic or found.is_compound else None


def is_metric_raster(path: FilePath) -> bool:
    """Whether a raster counts in metres already."""
    with RasterReader(Path(path)) as reader:
        return units_of(reader).is_metric
