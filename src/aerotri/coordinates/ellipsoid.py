"""Places on WGS 84 earth-centred and back, and lengths of degrees: for positions of GNSS, whatever the block's CRS."""

from __future__ import annotations

import numpy as np

A_M, FLATTENING = 6378137.0, 1.0 / 298.257223563
"""Half axis and flattening of WGS 84 [L: NIMA TR8350.2]."""
ECCENTRICITY_2 = FLATTENING * (2.0 - FLATTENING)
ITERATIONS = 6
"""Steps of the height above the ellipsoid; each gains more than two digits up to the height of satellites [D]."""


def to_geocentric(place: np.ndarray) -> np.ndarray:
    """(n, 3) m of longitude, latitude, degrees, and ellipsoidal height (n, 3)."""
    lon, lat, height = np.radians(place[:, 0]), np.radians(place[:, 1]), place[:, 2]
    normal = A_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(lat) ** 2)
    plan = (normal + height) * np.cos(lat)
    up = (normal * (1.0 - ECCENTRICITY_2) + height) * np.sin(lat)
    return np.column_stack([plan * np.cos(lon), plan * np.sin(lon), up])


def from_geocentric(xyz: np.ndarray) -> np.ndarray:
    """(n, 3) longitude, latitude, degrees, and ellipsoidal height; the inverse of `to_geocentric`."""
    x, y, z = xyz.T
    plan = np.hypot(x, y)
    lat = np.arctan2(z, plan * (1.0 - ECCENTRICITY_2))
    for _ in range(ITERATIONS):
        normal = A_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(lat) ** 2)
        lat = np.arctan2(z + ECCENTRICITY_2 * normal * np.sin(lat), plan)
    normal = A_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(lat) ** 2)
    # of both ways to the height, this one is exact at the poles too
    height = plan * np.cos(lat) + z * np.sin(lat) - normal * (1.0 - ECCENTRICITY_2 * np.sin(lat) ** 2)
    return np.column_stack([np.degrees(np.arctan2(y, x)), np.degrees(lat), height])


def east_north_up(place: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rows east, north and up at places (n, 3), in earth-centred axes."""
    lon, lat = np.radians(place[:, 0]), np.radians(place[:, 1])
    zero = np.zeros_like(lon)
    east = np.column_stack([-np.sin(lon), np.cos(lon), zero])
    up = np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    return np.stack([east, np.cross(up, east), up], axis=1)


def metres_of_units(place: np.ndarray) -> np.ndarray:
    """(n, 3) m east, north, up of a degree of longitude, a degree of latitude and a metre of height, at places."""
    lat, height = np.radians(place[:, 1]), place[:, 2]
    root = np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(lat) ** 2)
    normal, meridian = A_M / root, A_M * (1.0 - ECCENTRICITY_2) / root**3
    one = np.radians(1.0)
    return np.column_stack([(normal + height) * np.cos(lat) * one, (meridian + height) * one, np.ones_like(lat)])
