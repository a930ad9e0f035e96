"""Image coordinates: single known values, and the image error at the measured position."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.simulation import simulate, true_image_errors

NO_NOISE = {"sigma_um": 0.0, "stated_sigma_um": 2.0}
PHYSICAL = {"cam": {"errors": {"physical": {"rms_um": 5.0}}}}
PARAMETERS = {
    "cam": {
        "errors": {
            "parameters": {
                "bluh.1": 2e-5,
                "bluh.7": 4e-8,
                "bluh.11": -3e-5,
                "ultracam_d.42": 5e-5,
                "ultracam_d.51": 4e-3,
            },
            "brown": {"K1": 2e-8},
        }
    }
}


def collinear(angles, centre, point, c):
    """Textbook collinearity with the nine cosines of ω, φ, κ written out (object → image)."""
    w, p, k = angles
    sw, cw, sp, cp, sk, ck = np.sin(w), np.cos(w), np.sin(p), np.cos(p), np.sin(k), np.cos(k)
    m11, m12, m13 = cp * ck, sw * sp * ck + cw * sk, -cw * sp * ck + sw * sk
    m21, m22, m23 = -cp * sk, -sw * sp * sk + cw * ck, cw * sp * sk + sw * ck
    m31, m32, m33 = sp, -sw * cp, cw * cp
    dx, dy, dz = point - centre
    q = m31 * dx + m32 * dy + m33 * dz
    return -c * (m11 * dx + m12 * dy + m13 * dz) / q, -c * (m21 * dx + m22 * dy + m23 * dz) / q


def ideal_positions(block, truth, order="omega-phi-kappa"):
    """Ideal positions of all rays, ray by ray."""
    rays = block.image_points
    xy = np.empty((len(rays), 2))
    for i in range(len(rays)):
        image, point = rays.image[i], rays.point[i]
        c, x0, y0 = truth.interior[block.images.camera[image]]
        x, y = collinear(truth.angles[image], truth.centre[image], truth.points[point], c)
        xy[i] = x + x0, y + y0
    return xy


def test_error_free_coordinates_are_collinear(small_spec):
    spec = small_spec(
        camera={"cam": {"errors": {"interior": {"focal_length_mm": 0.02, "x0_mm": 0.01, "y0_mm": -0.03}}}},
        flight={"attitude_sigma_deg": [2.0, 2.0, 5.0], "position_sigma_m": [20.0, 20.0, 10.0], "heading_deg": 50.0},
        terrain={"kind": "undulating", "height_m": 300.0, "relief_rms_m": 40.0},
        tie_points=NO_NOISE,
        control={"distance_bases": 3.0, "image_sigma_um": 0.0},
    )
    block, truth = simulate(spec, 3)
    assert truth.interior[0] == pytest.approx([101.42, 0.01, -0.03])
    assert block.cameras[0].focal_length_mm == 101.4
    assert np.ptp(truth.points[:, 2]) > 50.0
    np.testing.assert_allclose(block.image_points.xy, ideal_positions(block, truth), rtol=0, atol=1e-9)


def test_one_point_under_a_phi_omega_kappa_block(small_spec):
    """The other order: R = Ry(φ)·Rx(ω)·Rz(κ), multiplied out for one ray."""
    spec = small_spec(rotation="phi-omega-kappa", flight={"attitude_sigma_deg": [3.0, 3.0, 3.0]}, tie_points=NO_NOISE)
    block, truth = simulate(spec, 3)
    ray = 17
    image, point = block.image_points.image[ray], block.image_points.point[ray]
    w, p, k = truth.angles[image]
    ry = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    rx = np.array([[1, 0, 0], [0, np.cos(w), -np.sin(w)], [0, np.sin(w), np.cos(w)]])
    rz = np.array([[np.cos(k), -np.sin(k), 0], [np.sin(k), np.cos(k), 0], [0, 0, 1]])
    u = (ry @ rx @ rz).T @ (truth.points[point] - truth.centre[image])
    np.testing.assert_allclose(block.image_points.xy[ray], -101.4 * u[:2] / u[2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("camera", [PHYSICAL, PARAMETERS], ids=["physical", "parameters"])
@pytest.mark.parametrize("axis", ["+y", "-x"])
def test_measured_less_the_image_error_is_ideal(small_spec, camera, axis):
    own = {"cam": {**camera["cam"], "flight_axis": axis}}
    if axis == "-x":
        own["cam"]["size_px"] = [7500, 11500]
    spec = small_spec(camera=own, tie_points={**NO_NOISE, "per_image": 300.0})
    block, truth = simulate(spec, 3)
    field = true_image_errors(spec, 3)["cam", ""]
    x, y = block.image_points.xy.T
    d = field(x, y)
    assert np.sqrt(np.mean(d**2)) > 1e-3
    np.testing.assert_allclose(block.image_points.xy - d, ideal_positions(block, truth), rtol=0, atol=1e-9)


def test_a_strong_lens_is_solved_too(small_spec):
    """Half a millimetre of distortion at the corner of a small camera."""
    spec = small_spec(
        camera={"cam": {"preset": "p1", "errors": {"brown": {"K1": 4e-5, "P1": 1e-5}, "interior": {"x0_mm": 0.05}}}},
        tie_points=NO_NOISE,
    )
    block, truth = simulate(spec, 3)
    field = true_image_errors(spec, 3)["cam", ""]
    d = field(*block.image_points.xy.T)
    assert np.abs(d).max() > 0.2
    np.testing.assert_allclose(block.image_points.xy - d, ideal_positions(block, truth), rtol=0, atol=1e-9)
    # d = −Δ counts from the true principal point: K1·r³ and P1 at one ray
    x, y = block.image_points.xy[5] - np.array([0.05, 0.0])
    r2 = x * x + y * y
    expected = -np.array([x * r2 * 4e-5 + 1e-5 * (r2 + 2 * x * x), y * r2 * 4e-5 + 2e-5 * x * y])
    np.testing.assert_allclose(d[5], expected, rtol=1e-12)


def test_a_forward_lens_acts_on_the_direction(small_spec):
    spec = small_spec(
        camera={"cam": {"preset": "p1", "lens": {"k1": {}}, "errors": {"lens": {"k1": -0.05, "p2": 0.001}}}},
        tie_points=NO_NOISE,
    )
    block, truth = simulate(spec, 3)
    a, b = (ideal_positions(block, truth) / 35.0).T
    rho2 = a * a + b * b
    x = 35.0 * (a * (1 - 0.05 * rho2) + 0.001 * (rho2 + 2 * a * a))
    y = 35.0 * (b * (1 - 0.05 * rho2) + 2 * 0.001 * a * b)
    np.testing.assert_allclose(block.image_points.xy, np.stack([x, y], 1), rtol=0, atol=1e-9)
    assert block.cameras[0].lens["k1"].kind == "free"
    assert truth.parameter_names == ("lens.k1", "lens.p2")


def test_points_fill_the_format_and_stay_inside(small_spec):
    spec = small_spec(camera=PHYSICAL, tie_points={"per_image": 400.0, "margin_px": 20.0})
    block, _ = simulate(spec, 3)
    half = np.array(block.cameras[0].half_format_mm)
    largest = np.abs(block.image_points.xy).max(axis=0)
    assert (largest <= half - 0.18 + 0.012).all()
    assert (largest > half - 1.0).all()


def test_no_visible_ray_is_missed(small_spec):
    """With probability 1 every point is measured wherever it falls well inside the format: found by brute force."""
    spec = small_spec(
        flight={"attitude_sigma_deg": [3.0, 3.0, 3.0]},
        terrain={"kind": "undulating", "relief_rms_m": 60.0},
        tie_points={**NO_NOISE, "probability": 1.0},
    )
    block, truth = simulate(spec, 5)
    half = np.array(block.cameras[0].half_format_mm) - 20 * 0.009
    rays = set(zip(block.image_points.image.tolist(), block.image_points.point.tolist(), strict=True))
    expected = set()
    for image in range(len(block.images)):
        for point in range(len(block.points)):
            xy = collinear(truth.angles[image], truth.centre[image], truth.points[point], 101.4)
            if (np.abs(xy) <= half).all():
                expected.add((image, point))
    assert rays == expected
