"""Refraction by a standard atmosphere and the curvature of the earth, as corrections of image coordinates.

Both act in the vertical plane through the ray. Seen from the nadir, a point that lies at the angle α is displaced along
its direction from the nadir; for a vertical photograph that is radial from the principal point, for a tilted one the
nadir direction comes from the rotation matrix. ``measured = ideal + displacement``, evaluated at the measured position.

Refraction [D] In a plane layered atmosphere n·sin α is constant along the ray, so the angle at the camera is too large
by dα = K·tan α, K = 1/(H − h)·∫(n(z) − n(H)) dz from the ground h to the camera H. With n − 1 proportional to the
density and the atmosphere at rest, ∫ρ dz = (p(h) − p(H))/g, and with the pressure of the standard atmosphere K is
closed; its numbers are those of Saastamoinen's formula [L]. On a vertical photograph dr = K·(r + r³/c²) [L]. The K of
the Manual of Photogrammetry, 2410e-6·H/(H² − 6H + 250) over sea level, H in km, agrees within 5 % from 6 to 12 km; at
1 km it is a fifth smaller than what rays traced through the standard atmosphere give.

Earth curvature [D] of a frame whose X, Y are distances along the ground and whose Z are heights, as of a block without
a CRS: the ray is met with a sphere. To first order dr = −(H − h)·r³/(2·R·c²) [L].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerotri.conventions import EARTH_RADIUS_M, InputError
from aerotri.observations import Block

GRAVITY = 9.80665
"""m/s² [L: ISO 2533, the standard atmosphere, also below]."""
GAS_CONSTANT = 287.05287
"""J/(kg·K), of dry air."""
SEA_LEVEL_PRESSURE = 101325.0
"""Pa."""
SEA_LEVEL_TEMPERATURE = 288.15
"""K."""
LAPSE_RATE = 0.0065
"""K/m, up to the tropopause."""
TROPOPAUSE_M = 11000.0
"""m, above which the temperature stays constant [L: ISO 2533, up to 20 km]."""
REFRACTIVITY = 2.26e-4
"""m³/kg: (n − 1)/ρ of air in visible light; 277·10⁻⁶ at sea level [L: Gladstone and Dale]."""
STEEPEST_COS = np.cos(np.radians(80.0))
"""Rays flatter than 80° off the nadir are refused: layers are no longer plane for them."""


def standard_atmosphere(height_m: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """Pressure and density of the standard atmosphere [L: ISO 2533], up to 20 km.

    Parameters
    ----------
    height_m : any shape, above sea level.

    Returns
    -------
    Pressure in Pa and density in kg/m³.
    """
    height = np.asarray(height_m, dtype=float)
    temperature = SEA_LEVEL_TEMPERATURE - LAPSE_RATE * np.minimum(height, TROPOPAUSE_M)
    pressure = SEA_LEVEL_PRESSURE * (temperature / SEA_LEVEL_TEMPERATURE) ** (GRAVITY / (GAS_CONSTANT * LAPSE_RATE))
    above = np.maximum(height - TROPOPAUSE_M, 0.0)
    pressure = pressure * np.exp(-GRAVITY * above / (GAS_CONSTANT * temperature))
    return pressure, pressure / (GAS_CONSTANT * temperature)


def refraction_constant(flying_height_m: np.ndarray | float, ground_height_m: np.ndarray | float) -> np.ndarray:
    """K of dα = K·tan α, rad.

    Parameters
    ----------
    flying_height_m, ground_height_m : heights above sea level of camera and ground; shapes that go together.

    Raises
    ------
    InputError
        Where the camera is not above the ground.
    """
    flying, ground = np.broadcast_arrays(np.asarray(flying_height_m, float), np.asarray(ground_height_m, float))
    _check_heights(flying, ground)
    pressure_above, density_above = standard_atmosphere(flying)
    pressure_below, _ = standard_atmosphere(ground)
    mean_density = (pressure_below - pressure_above) / (GRAVITY * (flying - ground))
    return REFRACTIVITY * (mean_density - density_above)


def refraction_mm(
    xy_from_principal_point: np.ndarray,
    focal_length_mm: float,
    flying_height_m: np.ndarray | float,
    ground_height_m: np.ndarray | float,
    nadir: np.ndarray | None = None,
) -> np.ndarray:
    """Displacement of image points by refraction: away from the nadir.

    Parameters
    ----------
    xy_from_principal_point : (n, 2) mm, measured.
    focal_length_mm : principal distance.
    flying_height_m, ground_height_m : above sea level, scalars or (n,).
    nadir : (3,) or (n, 3) unit vectors to the nadir in the camera frame, −(third row of R); None: a vertical
        photograph.

    Returns
    -------
    (n, 2) mm; ideal = measured − displacement.
    """
    k = refraction_constant(flying_height_m, ground_height_m)
    return _displacement(
        xy_from_principal_point, focal_length_mm, nadir, lambda tangent: np.tan(np.arctan(tangent) - k * tangent)
    )


def earth_curvature_mm(
    xy_from_principal_point: np.ndarray,
    focal_length_mm: float,
    flying_height_m: np.ndarray | float,
    ground_height_m: np.ndarray | float,
    nadir: np.ndarray | None = None,
) -> np.ndarray:
    """Displacement of image points by the curvature of the earth: towards the nadir. Arguments as `refraction_mm`."""
    flying, ground = np.asarray(flying_height_m, float), np.asarray(ground_height_m, float)
    _check_heights(*np.broadcast_arrays(flying, ground))

    def on_the_map(tangent: np.ndarray) -> np.ndarray:
        angle = np.arctan(tangent)
        at_ground = np.sin(angle) * (EARTH_RADIUS_M + flying) / (EARTH_RADIUS_M + ground)
        if (at_ground >= 1.0).any():
            raise InputError("a ray passes over the horizon", _REMEDY_OBLIQUE, file="block.toml")
        along_ground = (EARTH_RADIUS_M + ground) * (np.arcsin(at_ground) - angle)
        return along_ground / (flying - ground)

    return _displacement(xy_from_principal_point, focal_length_mm, nadir, on_the_map)


def corrected_image_points(
    block: Block,
    rotation: np.ndarray,
    centre: np.ndarray,
    ground_height_m: np.ndarray | float,
    up: np.ndarray | None = None,
) -> np.ndarray:
    """Image points freed of what the block's settings name: refraction = 'standard', earth_curvature = 'on'.

    Orientations of start values are good enough: a degree of tilt or 1 % of the flying height changes the correction
    by a few per cent of itself, which is some µm.

    Parameters
    ----------
    rotation : (n, 3, 3) of the photographs, camera → object.
    centre : (n, 3) m; of it only the height enters, above sea level.
    ground_height_m : one for all, or (m,) for every ray, above sea level.
    up : (n, 3) unit vectors, the vertical of every photograph in the object frame; None: the Z axis.

    Returns
    -------
    (m, 2) mm, in the order of the rays; rays of photographs without orientation stay as they are.

    Raises
    ------
    InputError
        When the ground is not below a photograph, or a ray is flatter than 80° off the nadir; for a fisheye.
    """
    rays = block.image_points
    xy = rays.xy.copy()
    up = np.tile([0.0, 0.0, 1.0], (len(centre), 1)) if up is None else up
    down = -np.einsum("nji,nj->ni", rotation, up)
    ground = np.broadcast_to(np.asarray(ground_height_m, dtype=float), (len(rays),))
    effects = []
    if block.settings.refraction != "off":
        effects.append(refraction_mm)
    if block.settings.earth_curvature != "off":
        effects.append(earth_curvature_mm)
    oriented = np.isfinite(centre[:, 2]) & np.isfinite(down).all(axis=1)
    camera = block.images.camera[rays.image]
    for index, cam in enumerate(block.cameras):
        own = np.flatnonzero((camera == index) & oriented[rays.image])
        if cam.is_fisheye and effects:
            raise InputError(
                f"camera '{cam.name}' is a fisheye: refraction and earth curvature are for perspective cameras",
                'set refraction and earth_curvature to "off"',
                file="block.toml",
            )
        image, principal_point = rays.image[own], np.array(cam.principal_point_mm)
        for effect in effects:
            bar = xy[own] - principal_point
            xy[own] -= effect(bar, cam.focal_length_mm, centre[image, 2], ground[own], down[image])
    return xy


_REMEDY_OBLIQUE = 'these corrections are for aerial photographs: set refraction and earth_curvature to "off"'


def _check_heights(flying: np.ndarray, ground: np.ndarray) -> None:
    wrong = ~(flying > ground)
    if wrong.any():
        raise InputError(
            f"a camera at height {flying[wrong][0]:.1f} m is not above the ground at {ground[wrong][0]:.1f} m",
            _REMEDY_OBLIQUE,
            file="block.toml",
        )


def _displacement(
    xy: np.ndarray, focal_length_mm: float, nadir: np.ndarray | None, ideal_tangent: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Measured minus ideal position, where `ideal_tangent` gives the tangent of the ideal angle off the nadir.

    A ray is nadir·cos α + across·sin α; its ideal direction has the same `across`.
    """
    xy = np.asarray(xy, dtype=float)
    nadir = np.array([0.0, 0.0, -1.0]) if nadir is None else np.asarray(nadir, dtype=float)
    ray = np.column_stack([xy, np.full(len(xy), -focal_length_mm)])
    along = np.sum(ray * nadir, axis=-1)
    flat = ~(along > STEEPEST_COS * np.linalg.norm(ray, axis=1))
    if flat.any():
        raise InputError(f"{flat.sum()} rays are flatter than 80° off the nadir", _REMEDY_OBLIQUE, file="block.toml")
    across = ray / along[:, None] - nadir
    tangent = np.linalg.norm(across, axis=1)
    # tan'/tan is smooth and 1 + small at the nadir, where its parts vanish
    at_nadir = tangent < 1e-9
    ratio = np.where(at_nadir, 1.0, ideal_tangent(tangent) / np.where(at_nadir, 1.0, tangent))
    ideal = nadir + ratio[:, None] * across
    return xy + focal_length_mm * ideal[:, :2] / ideal[:, 2:]
