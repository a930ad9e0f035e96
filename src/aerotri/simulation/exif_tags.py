"""What a drone writes into a photograph beside the pixels: camera, focal length, and position with its σ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerotri.formats.foreign import exif
from aerotri.observations import Camera

if TYPE_CHECKING:
    from PIL.Image import Exif

MAKER = "aerotri simulate"
NORMAL, MM = 1, 4
"""Orientation as it was taken; the unit of the resolution of the focal plane."""
ELLIPSOIDAL = 2
"""Reference of the altitude: from the ellipsoid, upwards [L: CIPA DC-008, Exif 3.0]."""
ORIENTATION = 274
SECOND_DECIMALS = 6
"""Of seconds of arc: 0.03 mm on the ground."""


@dataclass(frozen=True, eq=False)
class GnssFix:
    """A position as GNSS gave it: (3,) longitude and latitude in degrees with the ellipsoidal height, and (3,) σ, m."""

    lon_lat_height: np.ndarray
    sigma_m: np.ndarray


def exif_of(camera: Camera, fix: GnssFix | None) -> Exif:
    """The tags of a photograph, for Pillow to write.

    Parameters
    ----------
    camera : as it is known, not as it is. fix : None where there is no GNSS.
    """
    from PIL.Image import Exif

    tags = Exif()
    tags[exif.MAKE], tags[exif.MODEL], tags[ORIENTATION] = MAKER, camera.name, NORMAL
    own = tags.get_ifd(exif.EXIF_IFD)
    own[exif.FOCAL_LENGTH] = camera.focal_length_mm
    own[exif.EXIF_WIDTH], own[exif.EXIF_HEIGHT] = camera.size_px
    own[exif.FOCAL_PLANE_X_RESOLUTION] = own[exif.FOCAL_PLANE_X_RESOLUTION + 1] = 1.0 / camera.pixel_mm
    own[exif.FOCAL_PLANE_UNIT] = MM
    if fix is not None:
        _add_position(tags.get_ifd(exif.GPS_IFD), fix)
    return tags


def _add_position(gps: dict[int, object], fix: GnssFix) -> None:
    lon, lat, height = fix.lon_lat_height.tolist()
    gps[exif.LATITUDE_REF], gps[exif.LONGITUDE_REF] = "N" if lat >= 0.0 else "S", "E" if lon >= 0.0 else "W"
    gps[exif.LATITUDE], gps[exif.LONGITUDE] = _sexagesimal(abs(lat)), _sexagesimal(abs(lon))
    gps[exif.ALTITUDE_REF] = bytes([ELLIPSOIDAL + (height < 0.0)])
    gps[exif.ALTITUDE] = round(abs(height), 4)
    gps[exif.ERROR] = round(float(fix.sigma_m[:2].max()), 4)


def _sexagesimal(value: float) -> tuple[float, float, float]:
    whole, minute = int(value), int((value * 60.0) % 60.0)
    return float(whole), float(minute), round(((value - whole) * 60.0 - minute) * 60.0, SECOND_DECIMALS)


def xmp_of(fix: GnssFix) -> bytes:
    """The XMP packet that carries σ of longitude, latitude and height, m, by the names that drones use."""
    east, north, up = (f"{value:.4f}" for value in fix.sigma_m.tolist())
    return (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        '<rdf:Description xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" '
        f'drone-dji:RtkStdLon="{east}" drone-dji:RtkStdLat="{north}" drone-dji:RtkStdHgt="{up}"/>'
        "</rdf:RDF></x:xmpmeta>"
    ).encode()
