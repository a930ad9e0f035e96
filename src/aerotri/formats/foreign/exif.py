"""What photographs say of themselves: size, camera, focal length and position, from EXIF and XMP (read by Pillow).

EXIF's altitude counts from sea level (references 0 and 1) or from the ellipsoid (2 and 3). Where a drone knows the
standard deviations of its position, they stand in its XMP (``RtkStdLon`` …) or in GPSHPositioningError. Heights of a
drone with RTK count from the ellipsoid; ``RtkFlag`` is the kind of its solution.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.timed import FIXED, FLOAT, NONE, SINGLE, true_sigma
from aerotri.formats.foreign.dji_mrk import QUALITY

FORMATS = ("JPEG", "TIFF")
EXIF_IFD, GPS_IFD = 0x8769, 0x8825
"""Numbers of tags, here and below [L: CIPA DC-008, Exif 2.32]."""
MAKE, MODEL = 271, 272
"""Maker and model of the camera."""
FOCAL_LENGTH, FOCAL_LENGTH_35MM = 37386, 41989
"""mm; the second is that of a lens that shows as much on 35 mm film."""
FOCAL_PLANE_X_RESOLUTION, FOCAL_PLANE_UNIT = 41486, 41488
"""Pixels a unit on the sensor, and the number of that unit."""
EXIF_WIDTH, EXIF_HEIGHT = 40962, 40963
"""Pixels of the photograph as it was taken."""
UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}
"""Millimetres of the units of the focal plane's resolution."""
TAKEN, FRACTION = 36867, 37521
"""When the photograph was taken, and digits after the seconds."""
LATITUDE_REF, LATITUDE, LONGITUDE_REF, LONGITUDE, ALTITUDE_REF, ALTITUDE, ERROR = 1, 2, 3, 4, 5, 6, 31
"""Of the GPS directory; the last is the horizontal positioning error, m."""
LONG_SIDE_35MM = 36.0
"""Long side of the frame that a focal length 'in 35 mm film' belongs to [C]; some makers mean the diagonal."""


@dataclass(frozen=True, eq=False)
class PhotographTags:
    """What one photograph says.

    Parameters
    ----------
    size_px : columns, rows, of the file itself.
    make, model : of the camera, '' where not said.
    focal_length_mm : None where not said. pixel_um : size of a pixel of this file, None where it does not follow.
    lon_lat_height : (3,) degrees and m, NaN where not said.
    ellipsoidal : whether the height is said to count from the ellipsoid.
    sigma_m : (3,) east, north, up, NaN where not said.
    time : s since the beginning of 1970, by the clock of the camera, NaN where not said.
    quality : the kind of solution of a drone with RTK, as in `timed`; '' where not said.
    """

    size_px: tuple[int, int]
    make: str
    model: str
    focal_length_mm: float | None
    pixel_um: float | None
    lon_lat_height: np.ndarray
    ellipsoidal: bool
    sigma_m: np.ndarray
    time: float = float("nan")
    quality: str = ""


def read_exif(path: FilePath) -> PhotographTags:
    """The tags of a photograph; one without any has its size.

    Raises
    ------
    InputError
        When the file is no image that can be opened.
    """
    from PIL import Image, UnidentifiedImageError

    path = Path(path)
    try:
        with Image.open(path, formats=FORMATS) as image:
            exif = image.getexif()
            own, gps = dict(exif.get_ifd(EXIF_IFD)), dict(exif.get_ifd(GPS_IFD))
            plain, size, xmp = dict(exif), image.size, _xmp(image)
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        return _without_tags(path, error)
    own = plain | own
    focal = _number(own.get(FOCAL_LENGTH))
    lon_lat_height, ellipsoidal = _position(gps)
    quality, by_rtk = _rtk(xmp)
    return PhotographTags(
        size_px=(int(size[0]), int(size[1])),
        make=_text(plain.get(MAKE)),
        model=_text(plain.get(MODEL)),
        focal_length_mm=focal,
        pixel_um=_pixel_um(own, size, focal),
        lon_lat_height=lon_lat_height,
        ellipsoidal=ellipsoidal or by_rtk,
        sigma_m=true_sigma(_sigma(gps, xmp)[None], np.array([quality]))[0],
        time=_time(own),
        quality=quality,
    )


def _time(own: dict[int, Any]) -> float:
    """s since the beginning of 1970 by the clock of the camera, with the fraction of a second where it is told."""
    try:
        taken = datetime.strptime(_text(own.get(TAKEN)), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    except ValueError:
        return float("nan")
    fraction = _text(own.get(FRACTION)).strip()
    return taken.timestamp() + (float(f"0.{fraction}") if fraction.isdecimal() else 0.0)


def _without_tags(path: Path, error: Exception) -> PhotographTags:
    """Some TIFF files are beyond Pillow, but not beyond GDAL: their size alone."""
    from aerotri.rasters.images import open_photograph

    if not path.is_file():
        raise InputError("there is no such file", "give a photograph, TIFF or JPEG", path) from error
    with open_photograph(path) as photograph:
        size = photograph.columns, photograph.rows
    unknown = np.full(3, np.nan)
    return PhotographTags(size, "", "", None, None, unknown, False, unknown)


def _number(value: Any) -> float | None:
    """A positive finite number, None for everything else."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if np.isfinite(number) and number > 0.0 else None


def _text(value: Any) -> str:
    return str(value).replace("\0", "").strip() if isinstance(value, str) else ""


def _pixel_um(tags: dict[int, Any], size: tuple[int, int], focal_mm: float | None) -> float | None:
    """Size of a pixel: of the focal plane's resolution, which counts pixels as they were taken, else of 35 mm film."""
    per_unit, unit = _number(tags.get(FOCAL_PLANE_X_RESOLUTION)), UNIT_MM.get(tags.get(FOCAL_PLANE_UNIT, 2))
    taken = [_number(tags.get(key)) for key in (EXIF_WIDTH, EXIF_HEIGHT)]
    if per_unit is not None and unit is not None and None not in taken:
        return 1e3 * unit / per_unit * max(t for t in taken if t is not None) / max(size)
    equivalent = _number(tags.get(FOCAL_LENGTH_35MM))
    if equivalent is None or focal_mm is None:
        return None
    return 1e3 * LONG_SIDE_35MM * focal_mm / equivalent / max(size)


def _position(gps: dict[int, Any]) -> tuple[np.ndarray, bool]:
    """Longitude, latitude, height, NaN where one is missing, and whether the height is ellipsoidal.

    A height alone says nothing; longitude and latitude without a height do.
    """
    unknown = np.full(3, np.nan)
    try:
        lat = _degrees(gps[LATITUDE]) * (-1.0 if _text(gps[LATITUDE_REF]).upper() == "S" else 1.0)
        lon = _degrees(gps[LONGITUDE]) * (-1.0 if _text(gps[LONGITUDE_REF]).upper() == "W" else 1.0)
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return unknown, False
    if not np.isfinite([lon, lat]).all() or abs(lat) > 90.0 or abs(lon) > 180.0 or (lat == 0.0 and lon == 0.0):
        return unknown, False
    height, ellipsoidal = _height(gps)
    return np.array([lon, lat, height]), ellipsoidal


def _height(gps: dict[int, Any]) -> tuple[float, bool]:
    """m, NaN where there is none, and whether it is ellipsoidal."""
    try:
        height = float(gps[ALTITUDE])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return float("nan"), False
    if not np.isfinite(height):
        return float("nan"), False
    reference = gps.get(ALTITUDE_REF, 0)
    code = reference[0] if isinstance(reference, bytes) and reference else reference
    return (-height if code in (1, 3) else height), code in (2, 3)


def _degrees(value: Any) -> float:
    degree, minute, second = (float(part) for part in value)
    return degree + minute / 60.0 + second / 3600.0


def _xmp(image: Any) -> str:
    packet = image.info.get("xmp", b"")
    return packet.decode("utf-8", "replace") if isinstance(packet, bytes) else str(packet)


def _rtk(xmp: str) -> tuple[str, bool]:
    """The kind of solution of DJI's drones with RTK, and whether the height comes from it.

    Such heights count from the ellipsoid, whatever EXIF's reference says [D: they equal those of the .MRK]. Newer
    drones say where a height comes from (AltitudeType); of older ones it is that of RTK where RTK had a solution.
    """
    flag = re.search(r'RtkFlag\s*(?:=\s*"|>)\s*\+?(\d{1,3})', xmp)
    quality = QUALITY.get(int(flag[1]), "") if flag is not None else ""
    # without RTK the position is that of the drone's own GNSS all the same
    quality = SINGLE if quality == NONE else quality
    source = re.search(r'AltitudeType\s*(?:=\s*"|>)\s*(\w+)', xmp)
    return quality, quality in (FIXED, FLOAT) if source is None else source[1].lower() == "rtkalt"


def _sigma(gps: dict[int, Any], xmp: str) -> np.ndarray:
    """(3,) m: of RTK, else the horizontal error with one and a half times as much for the height [C]."""
    found = [re.search(rf'RtkStd{axis}\s*(?:=\s*"|>)\s*\+?([0-9.eE-]+)', xmp) for axis in ("Lon", "Lat", "Hgt")]
    values = [None if f is None else _number(f[1]) for f in found]
    if None not in values:
        return np.array(values, dtype=float)
    error = _number(gps.get(ERROR))
    return np.full(3, np.nan) if error is None else error * np.array([1.0, 1.0, 1.5])
