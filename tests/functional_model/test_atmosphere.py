"""Refraction against rays traced through air, earth curvature against points on a sphere, both for tilted cameras."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.functional_model.atmosphere import (
    EARTH_RADIUS_M,
    corrected_image_points,
    earth_curvature_mm,
    refraction_constant,
    refraction_mm,
    standard_atmosphere,
)
from aerotri.functional_model.rotation import rotation_from_angles
from synthetic import make_adjusted_block

FOCAL = 100.5


def index_of_refraction(step_m: float = 5.0, top_m: float = 14000.0):
    """Heights and n of air at rest, integrated from 15 °C and 1013.25 hPa; n − 1 = 292.6e-6·p/p0·273.15 K/T."""
    height = np.arange(0.0, top_m + step_m, step_m)
    temperature = 288.15 - 0.0065 * np.minimum(height, 11000.0)
    scale = 9.80665 / (287.05 * temperature)
    log_pressure = -np.concatenate([[0.0], np.cumsum(0.5 * (scale[1:] + scale[:-1]) * step_m)])
    return height, 1.0 + 292.6e-6 * np.exp(log_pressure) * 273.15 / temperature


def traced_angle(apparent: float, flying_m: float, ground_m: float) -> float:
    """True angle off the nadir of a ray that leaves the camera at the apparent one, by Snell's law on spheres."""
    height, index = index_of_refraction()
    z = np.linspace(flying_m, ground_m, 4001)
    n, r = np.interp(z, height, index), EARTH_RADIUS_M + z
    # n·r·sin(zenith angle) is constant; the angle at the earth's centre grows by tan(zenith angle)·dr/r
    sine = n[0] * r[0] * np.sin(apparent) / (n * r)
    slope = np.tan(np.arcsin(sine)) / r
    turned = np.sum(0.5 * (slope[1:] + slope[:-1]) * -np.diff(r))
    across, down = r[-1] * np.sin(turned), r[0] - r[-1] * np.cos(turned)
    return float(np.arctan2(across, down))


@pytest.mark.parametrize("flying_m", [500.0, 1500.0, 4000.0, 9000.0, 13000.0])
@pytest.mark.parametrize("ground_m", [0.0, 350.0])
def test_constant_against_traced_rays(flying_m, ground_m):
    """Within 3 %, and a few 1e-8 rad, for angles up to 45°."""
    k = refraction_constant(flying_m, ground_m)
    for apparent in np.radians([5.0, 25.0, 45.0]):
        bent = apparent - traced_angle(apparent, flying_m, ground_m)
        assert k * np.tan(apparent) == pytest.approx(bent, rel=0.03, abs=3e-8)


@pytest.mark.parametrize(("flying_km", "ground_km"), [(1.0, 0.0), (3.0, 0.5), (6.0, 1.0), (10.0, 2.0)])
def test_constant_against_saastamoinen(flying_km, ground_km):
    """K = 2335/(H − h)·((1 − 0.02257h)^5.256 − (1 − 0.02257H)^5.256) − 277.0·(1 − 0.02257H)^4.256, µrad and km."""
    above, below = 1.0 - 0.02257 * flying_km, 1.0 - 0.02257 * ground_km
    published = 2335.0 / (flying_km - ground_km) * (below**5.256 - above**5.256) - 277.0 * above**4.256
    assert refraction_constant(1e3 * flying_km, 1e3 * ground_km) == pytest.approx(1e-6 * published, rel=4e-3)


@pytest.mark.parametrize("flying_km", [6.0, 9.0, 12.0])
def test_constant_against_the_manual_of_photogrammetry(flying_km):
    """K = 2410·H/(H² − 6H + 250), of the ARDC atmosphere over ground at sea level: within 5 %."""
    manual = 2410e-6 * flying_km / (flying_km**2 - 6.0 * flying_km + 250.0)
    assert refraction_constant(1e3 * flying_km, 0.0) == pytest.approx(manual, rel=0.05)


def test_standard_atmosphere_at_tabulated_heights():
    """ISO 2533: 898.75 hPa and 1.1116 kg/m³ at 1000 m, 540.20 and 0.7361 at 5000 m, 193.30 and 0.3108 at 12 000 m."""
    pressure, density = standard_atmosphere(np.array([0.0, 1000.0, 5000.0, 12000.0]))
    np.testing.assert_allclose(pressure / 100.0, [1013.25, 898.75, 540.20, 193.30], rtol=2e-4)
    np.testing.assert_allclose(density, [1.2250, 1.1116, 0.7361, 0.3108], rtol=3e-4)


def test_vertical_photograph():
    """dr = K·(r + r³/c²), outward; curvature −(H − h)·r³/(2·R·c²), inward; both radial."""
    xy = np.random.default_rng(1).uniform(-60, 60, (50, 2))
    r = np.hypot(*xy.T)[:, None]
    k = refraction_constant(3000.0, 200.0)
    np.testing.assert_allclose(refraction_mm(xy, FOCAL, 3000.0, 200.0), k * (r + r**3 / FOCAL**2) * xy / r, rtol=1e-4)
    first_order = -2800.0 * r**3 / (2.0 * EARTH_RADIUS_M * FOCAL**2) * xy / r
    np.testing.assert_allclose(earth_curvature_mm(xy, FOCAL, 3000.0, 200.0), first_order, rtol=5e-3)
    np.testing.assert_array_equal(refraction_mm(np.zeros((1, 2)), FOCAL, 3000.0, 200.0), 0.0)


def through_camera(directions, rotation):
    u = directions @ rotation
    return -FOCAL * u[:, :2] / u[:, 2:]


ATTITUDE = rotation_from_angles(np.radians([12.0, -17.0, 130.0]))


def test_refraction_of_a_tilted_photograph():
    """Rays in all azimuths, bent in their vertical planes in space, then seen by the tilted camera."""
    azimuth, apparent = (a.ravel() for a in np.meshgrid(np.linspace(0.1, 6.2, 9), np.radians([4.0, 17.0, 33.0])))
    true = np.array([traced_angle(a, 4000.0, 300.0) for a in apparent])

    def seen(angle):
        off_nadir = [np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), -np.cos(angle)]
        return through_camera(np.stack(off_nadir, axis=-1), ATTITUDE)

    measured, ideal = seen(apparent), seen(true)
    displacement = refraction_mm(measured, FOCAL, 4000.0, 300.0, -ATTITUDE[2])
    np.testing.assert_allclose(displacement, measured - ideal, rtol=0.03, atol=2e-6)
    assert np.abs(measured - ideal).max() > 2e-3


def test_earth_curvature_of_a_tilted_photograph():
    """Points on a sphere, seen as they are and as the map has them: distance along the ground and height."""
    rng = np.random.default_rng(2)
    height, ground = 6000.0, 250.0
    distance, azimuth = rng.uniform(0, 5000, 40), rng.uniform(0, 2 * np.pi, 40)
    level = EARTH_RADIUS_M + ground
    angle = distance / level
    across, down = level * np.sin(angle), (EARTH_RADIUS_M + height) - level * np.cos(angle)
    true = np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), -down])
    on_map = np.column_stack([distance * np.cos(azimuth), distance * np.sin(azimuth), np.full(40, ground - height)])
    measured, ideal = through_camera(true, ATTITUDE), through_camera(on_map, ATTITUDE)
    displacement = earth_curvature_mm(measured, FOCAL, height, ground, -ATTITUDE[2])
    np.testing.assert_allclose(displacement, measured - ideal, atol=1e-9)
    assert np.abs(measured - ideal).max() > 5e-3


def small_adjusted(**settings):
    block = make_adjusted_block(strips=2, per_strip=3, n_points=60, parameters="none").block
    return replace(block, settings=replace(block.settings, **settings))


def test_corrected_points_of_a_block():
    """Both effects about the principal point and the nadir of each photograph; nothing when switched off."""
    block = small_adjusted(refraction="standard", earth_curvature="on")
    rotation, centre = rotation_from_angles(block.images.angles), block.images.centre
    corrected = corrected_image_points(block, rotation, centre, 120.0)
    rays, focal = block.image_points, block.cameras[0].focal_length_mm
    for k in (0, len(rays) // 2, len(rays) - 1):
        i = rays.image[k]
        xy, nadir, flying = rays.xy[k : k + 1], -rotation[i][2], centre[i, 2]
        xy = xy - refraction_mm(xy, focal, flying, 120.0, nadir)
        xy = xy - earth_curvature_mm(xy, focal, flying, 120.0, nadir)
        np.testing.assert_allclose(corrected[k], xy[0], atol=1e-12)
    off = small_adjusted()
    np.testing.assert_array_equal(corrected_image_points(off, rotation, centre, 120.0), rays.xy)


def test_photographs_without_orientation_stay():
    block = small_adjusted(refraction="standard")
    rotation, centre = rotation_from_angles(block.images.angles), block.images.centre.copy()
    rotation[2], centre[2] = np.nan, np.nan
    corrected = corrected_image_points(block, rotation, centre, np.full(len(block.image_points), 120.0))
    changed = (corrected != block.image_points.xy).all(axis=1)
    np.testing.assert_array_equal(changed, block.image_points.image != 2)


def test_another_vertical():
    """Far from the origin of a topocentric frame the vertical is not the Z axis."""
    block = small_adjusted(refraction="standard")
    rotation, centre = rotation_from_angles(block.images.angles), block.images.centre
    turn = rotation_from_angles(np.array([0.008, -0.005, 0.0]))
    turned = corrected_image_points(block, turn @ rotation, centre, 120.0, np.tile(turn[:, 2], (len(centre), 1)))
    np.testing.assert_allclose(turned, corrected_image_points(block, rotation, centre, 120.0), atol=1e-12)


def test_what_no_aerial_photograph_has():
    xy = np.array([[0.0, 50.0]])
    with pytest.raises(InputError, match="not above the ground"):
        refraction_mm(xy, FOCAL, 100.0, 120.0)
    with pytest.raises(InputError, match="not above the ground"):
        earth_curvature_mm(xy, FOCAL, 100.0, np.nan)
    with pytest.raises(InputError, match="80°"):
        refraction_mm(0.1 * xy, FOCAL, 1000.0, 0.0, np.array([0.0, 1.0, 0.0]))
    with pytest.raises(InputError, match="horizon"):
        earth_curvature_mm(np.array([[0.0, 500.0]]), FOCAL, 400e3, 0.0)
