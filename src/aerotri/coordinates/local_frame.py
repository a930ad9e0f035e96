"""The local topocentric frame of a block: a tangent plane to the ellipsoid, in which image rays are straight.

[L] Longitude, latitude and ellipsoidal height → earth-centred coordinates → a rotation and a shift. The origin lies on
the ellipsoid near the middle of the block; z is the ellipsoidal normal there, and x and y are turned about it to the
axes of the CRS at the origin [C]: grid east and grid north, or east and north of a geographic CRS. So coordinates, σ
and angles in the frame differ from those in the CRS by what changes over the block only.

Angles of photographs in a CRS belong to the axes of the CRS at the projection centre: grid east, grid north and the
ellipsoidal normal, all at that place [C]. Neither the scale of the projection nor the earth's curvature enters them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.georeference import CRS_REMEDY, Georeference, georeference

STEP_M = 100.0
"""Half width of the differences that give derivatives of a projection: errors of truncation and rounding ~ 1e-10."""
ORIGIN_STEP_DEG = 0.001
"""Longitude and latitude of an origin are rounded to this."""


@dataclass(frozen=True, eq=False)
class LocalFrame:
    """A local topocentric frame and its CRS.

    Parameters
    ----------
    georeference : the CRS.
    origin : (3,) longitude, latitude in degrees, ellipsoidal height in metres.
    origin_geocentric : (3,) m.
    local_from_geocentric : (3, 3) rotation from the earth-centred axes to those of the frame.
    """

    georeference: Georeference
    origin: np.ndarray
    origin_geocentric: np.ndarray
    local_from_geocentric: np.ndarray

    @property
    def crs(self) -> str:
        return self.georeference.crs

    @property
    def geoid(self) -> Path | None:
        return self.georeference.geoid

    def to_local(self, xyz: np.ndarray) -> np.ndarray:
        """Coordinates in the frame.

        Parameters
        ----------
        xyz : (n, 3) in the CRS: m, or degrees of longitude and latitude and m.

        Returns
        -------
        (n, 3) m; a row with a NaN stays NaN as a whole.
        """
        return _finite_rows(self._to_local, xyz)

    def from_local(self, xyz: np.ndarray) -> np.ndarray:
        """Coordinates in the CRS of (n, 3) m in the frame; the inverse of `to_local`."""
        return _finite_rows(self._from_local, xyz)

    def axes_at(self, xyz: np.ndarray) -> np.ndarray:
        """Axes of the CRS at places: grid east, grid north and the ellipsoidal normal, as columns in the frame.

        R_local = axes · R_crs for the attitude of a photograph there. Of a projection that is not conformal the
        nearest right-angled axes are taken.

        Parameters
        ----------
        xyz : (n, 3) in the CRS.

        Returns
        -------
        (n, 3, 3) rotations, NaN where a place is.
        """
        axes = np.full((len(xyz), 3, 3), np.nan)
        there = np.isfinite(xyz).all(axis=1)
        geographic = self.georeference.to_geographic(np.asarray(xyz, dtype=float)[there])
        enu = self.local_from_geocentric @ _east_north_up(geographic)
        if self.georeference.is_projected:
            plan_by_enu = self.plan_partials(geographic)
            turn = np.arctan2(plan_by_enu[:, 1, 0] - plan_by_enu[:, 0, 1], plan_by_enu[:, 0, 0] + plan_by_enu[:, 1, 1])
            enu = enu @ _about_z(-turn)
        axes[there] = enu
        return axes

    def crs_per_local(self, xyz_local: np.ndarray) -> np.ndarray:
        """Partials of CRS coordinates by coordinates in the frame, for covariances: C_crs = J·C_local·Jᵀ.

        Scale of the projection, convergence, tilt of the vertical and slope of the geoid are in it. A geographic CRS
        has σ in metres along east, north and up [C]: there J is a rotation.

        Parameters
        ----------
        xyz_local : (n, 3) m in the frame.

        Returns
        -------
        (n, 3, 3), NaN where a place is.
        """
        xyz_local = np.asarray(xyz_local, dtype=float)
        if not self.georeference.is_projected:
            return np.swapaxes(self.axes_at(self.from_local(xyz_local)), 1, 2)
        columns = []
        for axis in range(3):
            step = STEP_M * np.eye(3)[axis]
            columns.append((self.from_local(xyz_local + step) - self.from_local(xyz_local - step)) / (2.0 * STEP_M))
        return np.stack(columns, axis=-1)

    def _to_local(self, xyz: np.ndarray) -> np.ndarray:
        geocentric = self.georeference.to_geocentric(self.georeference.to_geographic(xyz))
        return (geocentric - self.origin_geocentric) @ self.local_from_geocentric.T

    def _from_local(self, xyz: np.ndarray) -> np.ndarray:
        geocentric = xyz @ self.local_from_geocentric + self.origin_geocentric
        return self.georeference.from_geographic(self.georeference.from_geocentric(geocentric))

    def plan_partials(self, geographic: np.ndarray) -> np.ndarray:
        """(n, 2, 2) partials of X, Y of the CRS by metres east and north on the ellipsoid's tangent plane."""
        place, enu = self.georeference.to_geocentric(geographic), _east_north_up(geographic)
        columns = []
        for axis in range(2):
            ends = []
            for sign in (1.0, -1.0):
                moved = self.georeference.from_geocentric(place + sign * STEP_M * enu[:, :, axis])
                ends.append(self.georeference.horizontal.transform(*moved[:, :2].T, direction="INVERSE"))
            columns.append((np.array(ends[0]) - np.array(ends[1])) / (2.0 * STEP_M))
        return np.stack(columns, axis=-1).transpose(1, 0, 2)


def local_frame(
    crs: str, around: np.ndarray, geoid: FilePath | None = None, origin: np.ndarray | None = None
) -> LocalFrame:
    """The local frame of a block.

    Parameters
    ----------
    crs : 'EPSG:n' or compound 'EPSG:n+m'; see `georeference`.
    around : (n, 3) coordinates of the block in the CRS, NaN where not known.
    geoid : a geoid grid for the heights, where PROJ does not have it.
    origin : (3,) the origin of an earlier frame, as `LocalFrame.origin` has it; None: the middle of `around`.

    Raises
    ------
    InputError
        When the CRS is of no use, a grid is missing, or nothing is known of the block's place.
    """
    around = np.asarray(around, dtype=float)
    around = around[np.isfinite(around[:, :2]).all(axis=1)]
    if not len(around):
        raise InputError(
            "nothing in the block has coordinates in its CRS, so its place is not known",
            "give control points, projection centres or GNSS positions",
            file="block.toml",
        )
    reference = georeference(crs, around, geoid)
    if origin is None:
        lon, lat = reference.horizontal.transform(around[:, 0], around[:, 1])
        if not (np.isfinite(lon).all() and np.isfinite(lat).all()):
            raise InputError(
                f"a position of the block lies outside {crs}", "check the coordinates and crs", file="block.toml"
            )
        origin = _middle(np.radians(lon), np.radians(lat))
    return _frame(reference, np.asarray(origin, dtype=float))


def topocentric_frame(crs: str, origin: np.ndarray, geoid: FilePath | None = None) -> LocalFrame:
    """The frame that others have around a place: east, true north and the ellipsoidal normal there.

    Parameters
    ----------
    crs, geoid : see `local_frame`.
    origin : (3,) longitude, latitude in degrees, ellipsoidal height in metres.

    Raises
    ------
    InputError
        When the CRS is of no use there, or a grid is missing.
    """
    origin = np.asarray(origin, dtype=float)
    plain = georeference(crs.partition("+")[0], np.zeros((0, 3)))
    place = plain.from_geographic(origin[None])
    if not np.isfinite(place).all():
        raise InputError(f"longitude {origin[0]:.9g}, latitude {origin[1]:.9g} lies outside {crs}", CRS_REMEDY)
    reference = georeference(crs, place, geoid)
    return LocalFrame(reference, origin, reference.to_geocentric(origin[None])[0], _east_north_up(origin[None])[0].T)


def _middle(lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
    """(3,) rounded longitude and latitude of the mean direction (mean longitudes fail at the date line), height 0."""
    x, y, z = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]).mean(axis=1)
    middle = np.degrees([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])
    return np.append(np.round(middle / ORIGIN_STEP_DEG) * ORIGIN_STEP_DEG, 0.0)


def _frame(reference: Georeference, origin: np.ndarray) -> LocalFrame:
    enu = _east_north_up(origin[None])[0]
    frame = LocalFrame(reference, origin, reference.to_geocentric(origin[None])[0], enu.T)
    if not reference.is_projected:
        return frame
    partials = frame.plan_partials(origin[None])[0]
    if not np.isfinite(partials).all() or np.linalg.det(partials) <= 0.0:
        raise InputError(
            f"crs {reference.crs} is left-handed or does not reach the block", CRS_REMEDY, file="block.toml"
        )
    place = reference.from_geographic(origin[None])
    return replace(frame, local_from_geocentric=frame.axes_at(place)[0].T @ enu.T)


def _finite_rows(function: Callable[[np.ndarray], np.ndarray], xyz: np.ndarray) -> np.ndarray:
    """`function` of the rows that are known; the others NaN, since no coordinate is independent of the others."""
    xyz = np.asarray(xyz, dtype=float)
    out = np.full(xyz.shape, np.nan)
    there = np.isfinite(xyz).all(axis=1)
    if there.any():
        out[there] = function(xyz[there])
    return out


def _east_north_up(lon_lat_h: np.ndarray) -> np.ndarray:
    """(n, 3, 3) east, north and the ellipsoidal normal as columns, in earth-centred axes [L]."""
    lon, lat = np.radians(lon_lat_h[:, 0]), np.radians(lon_lat_h[:, 1])
    zero = np.zeros_like(lon)
    east = np.stack([-np.sin(lon), np.cos(lon), zero], axis=-1)
    north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)], axis=-1)
    up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    return np.stack([east, north, up], axis=-1)


def _about_z(angle: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotations about the third axis."""
    matrix = np.zeros((len(angle), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = np.cos(angle)
    matrix[:, 1, 0], matrix[:, 0, 1] = np.sin(angle), -np.sin(angle)
    matrix[:, 2, 2] = 1.0
    return matrix
