"""From a CRS to longitude, latitude and ellipsoidal height, and back, by PROJ; a missing geoid grid is an error.

Coordinates of a CRS come in the order X, Y, Z: easting and northing, or longitude and latitude in degrees, then the
height. A CRS without a vertical part has ellipsoidal heights [C]; a compound CRS has the heights that its vertical part
says, for which PROJ needs a grid, or a geoid file takes its place. Never a height without its grid.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import FilePath, InputError, real_path

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

CRS_PATTERN = re.compile(r"EPSG:\d+(\+\d+)?", re.IGNORECASE)
CRS_REMEDY = 'give crs as "EPSG:n", or "EPSG:n+m" with m the height system'


@dataclass(frozen=True, eq=False)
class Georeference:
    """A CRS tied to its ellipsoid.

    Parameters
    ----------
    crs : as given. is_projected : X, Y in metres, else longitude and latitude in degrees.
    geoid : the geoid file in use, None when PROJ finds the heights by itself.
    horizontal : X, Y → longitude, latitude in degrees.
    vertical : longitude, latitude, height → the same with the ellipsoidal height; None when the height is that already.
    geocentric : longitude, latitude in degrees, ellipsoidal height → earth-centred X, Y, Z in metres.
    """

    crs: str
    is_projected: bool
    geoid: Path | None
    horizontal: Transformer
    vertical: Transformer | None
    geocentric: Transformer

    def to_geographic(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) longitude, latitude in degrees, ellipsoidal height in metres.

        Raises
        ------
        InputError
            Where the CRS or the geoid grid does not reach.
        """
        lon, lat = self.horizontal.transform(xyz[:, 0], xyz[:, 1])
        height = xyz[:, 2]
        if self.vertical is not None:
            height = self.vertical.transform(lon, lat, height)[2]
        return self._checked(np.column_stack([lon, lat, height]), xyz)

    def from_geographic(self, lon_lat_h: np.ndarray) -> np.ndarray:
        """(n, 3) coordinates of the CRS; the inverse of `to_geographic`."""
        x, y = self.horizontal.transform(lon_lat_h[:, 0], lon_lat_h[:, 1], direction="INVERSE")
        height = lon_lat_h[:, 2]
        if self.vertical is not None:
            height = self.vertical.transform(lon_lat_h[:, 0], lon_lat_h[:, 1], height, direction="INVERSE")[2]
        return self._checked(np.column_stack([x, y, height]), lon_lat_h)

    def to_geocentric(self, lon_lat_h: np.ndarray) -> np.ndarray:
        """(n, 3) m, earth-centred, of longitude, latitude and ellipsoidal height."""
        return np.column_stack(self.geocentric.transform(*lon_lat_h.T))

    def from_geocentric(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) longitude, latitude in degrees, ellipsoidal height; the inverse of `to_geocentric`."""
        return np.column_stack(self.geocentric.transform(*xyz.T, direction="INVERSE"))

    def _checked(self, found: np.ndarray, given: np.ndarray) -> np.ndarray:
        wrong = np.flatnonzero(~np.isfinite(found).all(axis=1))
        if not len(wrong):
            return found
        place = ", ".join(f"{value:.10g}" for value in given[wrong[0]])
        outside_grid = self.vertical is not None and np.isfinite(found[wrong[0], :2]).all()
        if outside_grid:
            grid = "the geoid grid" if self.geoid is None else f"the geoid grid {self.geoid.name}"
            raise InputError(f"({place}) lies outside {grid}", "give a grid that covers the block: --geoid FILE")
        raise InputError(
            f"({place}) lies outside the range of {self.crs}", "correct the coordinates or the crs", file="block.toml"
        )


def georeference(crs: str, around: np.ndarray, geoid: FilePath | None = None) -> Georeference:
    """Tie a CRS to its ellipsoid.

    Parameters
    ----------
    crs : 'EPSG:n' or compound 'EPSG:n+m', projected or geographic, in metres or degrees.
    around : (n, 2) or (n, 3) finite coordinates in the CRS, the area for which height transformations are looked up.
    geoid : a geoid grid that PROJ can read (GeoTIFF, GTX); heights of the CRS are then heights above it.

    Raises
    ------
    InputError
        When the CRS is unknown or of a kind that cannot carry a block, and when a grid is missing.
    """
    from pyproj import Transformer

    whole = read_crs(crs)
    flat = whole.sub_crs_list[0] if whole.is_compound else whole
    geographic = _checked_geographic(crs, whole, flat)
    horizontal = Transformer.from_crs(flat.to_2d(), geographic.to_2d(), always_xy=True, allow_ballpark=False)
    if geoid is not None:
        vertical = _geoid_file(Path(geoid), crs, whole)
    elif whole.is_compound:
        lon, lat = horizontal.transform(around[:, 0], around[:, 1])
        vertical = _known_heights(crs, whole, geographic, lon, lat)
    else:
        vertical = None
    geod = geographic.get_geod()
    if geod is None:
        raise InputError(f"crs {crs} ({whole.name}) has no ellipsoid", CRS_REMEDY, file="block.toml")
    cart = f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +a={geod.a!r} +b={geod.b!r}"
    return Georeference(
        crs=crs,
        is_projected=flat.is_projected,
        geoid=None if geoid is None else Path(geoid),
        horizontal=horizontal,
        vertical=vertical,
        geocentric=Transformer.from_pipeline(cart),
    )


def utm_crs(lon: np.ndarray, lat: np.ndarray) -> str:
    """'EPSG:n' of the UTM zone on WGS 84 in which the middle of places lies, (n,) degrees each."""
    middle_lon = float(np.degrees(np.angle(np.exp(1j * np.radians(lon)).mean())))
    zone = int((middle_lon + 180.0) // 6.0) % 60 + 1
    return f"EPSG:{(32600 if np.mean(lat) >= 0.0 else 32700) + zone}"


def utm_on_datum(crs: str, lon: float, lat: float) -> str:
    """'EPSG:n' of the UTM zone at a place on the datum of a CRS, on WGS 84 where that has none."""
    from pyproj.aoi import AreaOfInterest
    from pyproj.database import query_utm_crs_info

    whole = read_crs(crs)
    geographic = (whole.sub_crs_list[0] if whole.is_compound else whole).geodetic_crs
    name = "WGS 84" if geographic is None else geographic.name
    area = AreaOfInterest(lon, lat, lon, lat)
    found = query_utm_crs_info(datum_name=name, area_of_interest=area) if name != "WGS 84" else []
    # others count north before east or belong to one realisation, which their longer names say
    found.sort(key=lambda one: len(one.name))
    return f"EPSG:{found[0].code}" if found else utm_crs(np.array([lon]), np.array([lat]))


def area_of_use(crs: str) -> tuple[float, float, float, float] | None:
    """West, south, east, north in degrees; None where PROJ knows none."""
    whole = read_crs(crs)
    area = (whole.sub_crs_list[0] if whole.is_compound else whole).area_of_use
    return None if area is None else (area.west, area.south, area.east, area.north)


def is_projected(crs: str) -> bool:
    """Whether a CRS counts in metres of a plane.

    Raises
    ------
    InputError
        When PROJ does not know it.
    """
    whole = read_crs(crs)
    return bool((whole.sub_crs_list[0] if whole.is_compound else whole).is_projected)


def read_crs(crs: str) -> CRS:
    """The system of a code, or of a definition (WKT).

    Raises
    ------
    InputError
        When it is not understood or not known.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if not CRS_PATTERN.fullmatch(crs) and "[" not in crs:
        raise InputError(f"crs '{crs[:80]}' is not understood", CRS_REMEDY, file="block.toml")
    try:
        return CRS.from_user_input(crs)
    except CRSError:
        raise InputError(f"crs '{crs}' is not known to PROJ", CRS_REMEDY, file="block.toml") from None


def _checked_geographic(crs: str, whole: CRS, flat: CRS) -> CRS:
    """The geographic system below a CRS. Refused: geocentric and vertical systems, feet, gon, depths, Paris."""
    geographic = flat.geodetic_crs
    if geographic is None or not (flat.is_projected or flat.is_geographic):
        raise InputError(f"crs {crs} ({whole.name}) is neither projected nor geographic", CRS_REMEDY, file="block.toml")
    for number, axis in enumerate(whole.axis_info):
        wanted = "degree" if flat.is_geographic and number < 2 else "metre"
        if axis.unit_name != wanted:
            raise InputError(
                f"crs {crs} ({whole.name}) counts {axis.name} in {axis.unit_name}",
                f"transform coordinates and their σ to a CRS in {wanted}s{_example(crs, flat)}",
                file="block.toml",
            )
        if axis.direction == "down":
            raise InputError(f"crs {crs} counts depths", "transform the block to heights", file="block.toml")
    meridian = geographic.prime_meridian
    if meridian is not None and meridian.longitude != 0.0:
        raise InputError(
            f"crs {crs} ({whole.name}) counts longitudes from {meridian.name}",
            "transform the block to a CRS on Greenwich",
            file="block.toml",
        )
    return geographic


def _example(crs: str, flat: CRS) -> str:
    """A CRS in metres at the same place, in words."""
    area = flat.area_of_use
    if area is None or not flat.is_projected:
        return ""
    source = crs.partition("+")[0]
    target = utm_on_datum(source, (area.west + area.east) / 2.0, (area.south + area.north) / 2.0)
    return f", such as {target}: cs2cs {source} {target}"


def _geoid_file(path: Path, crs: str, whole: CRS) -> Transformer:
    """Longitude, latitude in degrees, height above the geoid of a grid file → ellipsoidal height.

    The grid is entered with the longitude and latitude of the block's own datum. Where that is not the datum of the
    grid, the undulation belongs to a place up to 200 m away, some millimetres.
    """
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    if not whole.is_compound and len(whole.axis_info) == 3:
        raise InputError(
            f"a geoid is given, but crs {crs} ({whole.name}) has ellipsoidal heights",
            "leave out --geoid, or name the height system in crs",
            file="block.toml",
        )
    if not path.is_file():
        raise InputError(f"the geoid grid {path} is missing", "give an existing file: --geoid FILE")
    if "," in str(real_path(path)) or '"' in str(real_path(path)):
        raise InputError(f"PROJ cannot open {path}: its name has a comma or a quotation mark", "rename the file")
    shift = f'+proj=vgridshift +grids="{real_path(path)}" +multiplier=1'
    units = "+step +proj=unitconvert +xy_in=deg +xy_out=rad +step {} +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    try:
        return Transformer.from_pipeline("+proj=pipeline " + units.format(shift))
    except ProjError:
        raise InputError(
            f"{path} cannot be read as a geoid grid",
            "give a vertical grid that PROJ reads, for example from cdn.proj.org",
        ) from None


def _known_heights(crs: str, whole: CRS, geographic: CRS, lon: np.ndarray, lat: np.ndarray) -> Transformer:
    """Longitude, latitude, height → ellipsoidal height by the best transformation PROJ knows for the area.

    Only the best one will do: a lesser one would silently shift every height by the difference.
    """
    from pyproj.aoi import AreaOfInterest
    from pyproj.crs import CompoundCRS
    from pyproj.transformer import TransformerGroup

    source = CompoundCRS(whole.name, [geographic.to_2d(), whole.sub_crs_list[1]])
    there = np.isfinite(lon) & np.isfinite(lat)
    area = None
    if there.any():
        corners = (lon[there].min(), lat[there].min(), lon[there].max(), lat[there].max())
        area = AreaOfInterest(*(float(value) for value in corners))
    with warnings.catch_warnings():
        # pyproj warns about the missing grid that the error below names
        warnings.simplefilter("ignore")
        group = TransformerGroup(
            source,
            geographic.to_3d(),
            always_xy=True,
            allow_ballpark=False,
            area_of_interest=area,  # pyright: ignore[reportArgumentType]
        )
    if group.best_available and group.transformers:
        return group.transformers[0]
    missing = [g.short_name for o in group.unavailable_operations[:1] for g in o.grids if not g.available]
    if missing:
        raise InputError(
            f"the heights of {crs} ({whole.name}) need the geoid grid {' and '.join(missing)}, which is missing",
            f"give it as --geoid FILE, or install it with `projsync --file {missing[0]}`",
        )
    raise InputError(
        f"PROJ knows no way from the heights of {crs} ({whole.name}) to the ellipsoid",
        "give the geoid as --geoid FILE",
    )
