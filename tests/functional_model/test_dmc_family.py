"""DMC 29–41, 74–80 of models.md 3: head geometry, single points, seams, what depends on what."""

import numpy as np
import pytest
from test_additional_parameters import orientation_columns

from aerotri.functional_model.additional_parameters import dmc, dmc_heads, parameter_set
from aerotri.functional_model.additional_parameters.native_frame import native_from_image
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Camera
from family_cameras import DMC_INTERIOR, camera_for

CAMERA = camera_for("dmc")
HALF = CAMERA.half_format_mm
F = 120.0


def quadrant_grid(n=60):
    return (g.ravel() for g in np.meshgrid(np.linspace(0, HALF[0], n), np.linspace(0, HALF[1], n)))


def format_grid(nx, ny):
    """Cell centres, none on a seam."""
    x, y = ((2 * (np.arange(n) + 0.5) / n - 1) * h for n, h in zip((nx, ny), HALF, strict=True))
    return (g.ravel() for g in np.meshgrid(x, y))


def pattern(item, x, y, camera=CAMERA):
    return parameter_set("dmc", [item], camera).basis(np.atleast_1d(x), np.atleast_1d(y))[:, :, 0]


def test_format():
    np.testing.assert_allclose(HALF, (82.944, 46.08))


def test_head_axis_and_coverage():
    """Axes at (±34.4, ±24.3) mm; this order of the tilts covers the quadrant with 1.2 mm to spare, the other 0.3."""
    np.testing.assert_allclose(dmc_heads.in_head(np.array([34.4]), np.array([24.3]), F), [[0, 0]], atol=0.04)
    x, y = quadrant_grid()
    half = np.array(dmc_heads.HALF_FORMAT_MM)
    spare = half - np.abs(dmc_heads.in_head(x, y, F)).max(axis=0)
    assert spare.min() == pytest.approx(1.25, abs=0.02)
    assert pytest.approx(162.6 / 49.53, rel=3e-4) == dmc.HEAD_SCALE
    other = rotation_from_angles(np.array([dmc_heads.TILT_ALONG, -dmc_heads.TILT_ACROSS, 0.0]), "omega-phi-kappa")
    u = np.stack([x, y, np.full_like(x, -F)], axis=-1) @ other
    assert (half - np.abs(-F * u[:, :2] / u[:, 2:]).max(axis=0)).min() == pytest.approx(0.31, abs=0.02)


def test_head_jacobian_is_the_derivative():
    x, y = quadrant_grid(9)
    h = 1e-4
    xi_eta = dmc_heads.in_head(x, y, F)
    inverse = np.stack(
        [
            (dmc_heads.in_head(x + h, y, F) - dmc_heads.in_head(x - h, y, F)) / (2 * h),
            (dmc_heads.in_head(x, y + h, F) - dmc_heads.in_head(x, y - h, F)) / (2 * h),
        ],
        axis=-1,
    )
    np.testing.assert_allclose(dmc_heads.jacobian(xi_eta, F) @ inverse, np.tile(np.eye(2), (len(x), 1, 1)), atol=1e-8)


def test_heads_are_mirror_images():
    """R_H = Ry(−sx·16°)·Rx(+sy·11°) of every quadrant against the folded head: the radial pattern of 74–77."""
    x, y = format_grid(14, 8)
    folded, _ = dmc.radial(dmc_heads.in_head(np.abs(x), np.abs(y), F), F)
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        own = (np.sign(x) == sx) & (np.sign(y) == sy)
        angles = np.array([sy * dmc_heads.TILT_ALONG, -sx * dmc_heads.TILT_ACROSS, 0.0])
        rotation = rotation_from_angles(angles, "phi-omega-kappa")
        u = np.stack([x[own], y[own], np.full(own.sum(), -F)], axis=-1) @ rotation
        xi_eta, h = -F * u[:, :2] / u[:, 2:], 1e-5
        direction = -(dmc.HEAD_SCALE**2 * np.sum(xi_eta**2, axis=1) - 16384)[:, None] * xi_eta

        def to_image(head, rotation=rotation):
            w = np.column_stack([head, np.full(len(head), -F)]) @ rotation.T
            return -F * w[:, :2] / w[:, 2:]

        step = h * direction / np.abs(direction).max()
        moved = (to_image(xi_eta + step) - to_image(xi_eta - step)) / (2 * h) * np.abs(direction).max()
        np.testing.assert_allclose(moved, folded[own] * (sx, sy), rtol=1e-6, atol=0.05)


def test_stitching():
    """Test value of models.md: ω = (−.1887, −.2704, −.0264), seam RMS 28.1 → .87."""
    omega = dmc.stitching(F, *HALF)
    np.testing.assert_allclose(omega, (-0.1887, -0.2704, -0.0264), atol=6e-5)
    along, zero = np.linspace(0, 1, 41), np.zeros(41)
    before, after = [], []
    for x, y, component in ((zero, along * HALF[1], 0), (along * HALF[0], zero, 1)):
        xi_eta = dmc_heads.in_head(x, y, F)
        before.append(dmc.stitched_focal_change(xi_eta, F, (0.0, 0.0, 0.0))[0][:, component])
        after.append(dmc.stitched_focal_change(xi_eta, F, omega)[0][:, component])
    assert np.sqrt(np.mean(np.square(before))) == pytest.approx(28.1, abs=0.05)
    assert np.sqrt(np.mean(np.square(after))) == pytest.approx(0.87, abs=0.005)


def test_butterfly_leaves_nothing_to_the_orientation():
    x, y = format_grid(60, 40)
    d = pattern("79", x, y).ravel()
    orientation = orientation_columns(x, y, F).reshape(-1, 6)
    cosines = d @ orientation / np.linalg.norm(d) / np.linalg.norm(orientation, axis=0)
    np.testing.assert_allclose(np.delete(cosines, 2), 0.0, atol=1e-12)
    # the scale is taken out on a grid of 61 × 41 points that reaches the edges and so weighs them a little more
    assert abs(cosines[2]) < 0.07
    edge_x, edge_y = (
        g.ravel() for g in np.meshgrid(np.linspace(-HALF[0], HALF[0], 61), np.linspace(-HALF[1], HALF[1], 41))
    )
    assert np.sum(pattern("79", edge_x, edge_y) * np.column_stack([edge_x, edge_y])) == pytest.approx(0.0, abs=1e-6)


def test_butterfly_lies_in_the_general_parameters():
    """96 % of its variance, orientation included."""
    x, y = format_grid(60, 40)
    d = pattern("79", x, y).ravel()
    general = parameter_set("bluh", LINEAR_FAMILIES["bluh"].items, CAMERA).basis(x, y).reshape(-1, 12)
    design = np.hstack([general, orientation_columns(x, y, F).reshape(-1, 6)])
    design /= np.linalg.norm(design, axis=0)
    left = d - design @ np.linalg.lstsq(design, d, rcond=None)[0]
    assert 1.0 - left @ left / (d @ d) == pytest.approx(0.96, abs=0.005)


def test_single_points_by_hand():
    """34 x and 35 y in the upper right quadrant, then counter-clockwise; 30–33 along the flight, zero at 32 mm."""
    at = {0: (20.0, 40.0), 1: (-20.0, 40.0), 2: (-20.0, -40.0), 3: (20.0, -40.0)}
    chosen = parameter_set("dmc", dmc.FAMILY.all_items, CAMERA)
    for quadrant, (x, y) in at.items():
        basis = dict(zip(chosen.items, chosen.basis(np.array([x]), np.array([y]))[0].T, strict=True))
        np.testing.assert_allclose(basis[str(30 + quadrant)], (0.0, 1600.0 - 1280.0))
        np.testing.assert_allclose(basis[str(34 + 2 * quadrant)], (-x * y, 0.0))
        np.testing.assert_allclose(basis[str(35 + 2 * quadrant)], (0.0, -x * y))
        acting = {item for item, column in basis.items() if column.any()}
        own = {30 + quadrant, 34 + 2 * quadrant, 35 + 2 * quadrant, 74 + quadrant, 79}
        assert acting == {str(item) for item in own}
    np.testing.assert_allclose(pattern("30", 5.0, 32.0), [[0, 0]], atol=1e-12)
    np.testing.assert_allclose(pattern("32", -5.0, -32.0), [[0, 0]], atol=1e-12)


def test_common_radial_is_the_sum():
    x, y = format_grid(30, 20)
    total = sum(pattern(item, x, y) for item in dmc.RADIAL)
    np.testing.assert_allclose(pattern("80", x, y), total, atol=1e-9)
    assert parameter_set("dmc", ["80"], CAMERA).terms(x, y).index.shape == (len(x), 1)


def test_radial_vanishes_on_the_axis_and_at_its_circle():
    """Zero where the head looks and where s_H·ρ = 128 mm."""
    f, rho = F, 128.0 / dmc.HEAD_SCALE
    rotation = dmc_heads.head_rotation()
    for xi, eta in ((0.0, 0.0), (rho, 0.0), (rho * 0.96, -rho * 0.28)):
        w = rotation @ (xi, eta, -f)
        x, y = -f * w[:2] / w[2]
        assert 0 < x < HALF[0]
        assert 0 < y < HALF[1]
        np.testing.assert_allclose(pattern("74", x, y), [[0, 0]], atol=1e-7)
    assert np.abs(pattern("80", *format_grid(40, 24))).max() > 1e5


def test_34_to_41_are_continuous_at_the_seams():
    chosen = parameter_set("dmc", dmc.ORIENTATION, CAMERA)
    along = np.linspace(-40, 40, 17)
    tiny = np.full(17, 1e-9)
    for one, other in (((-tiny, along), (tiny, along)), ((along, -tiny), (along, tiny))):
        np.testing.assert_allclose(chosen.basis(*one), chosen.basis(*other), atol=1e-6)


def test_rank_over_flat_ground():
    """30–41, 74–77, 79 with the orientation of a photograph and BLUH 1–12: of full rank."""
    x, y = format_grid(60, 40)
    special = parameter_set("dmc", dmc.FAMILY.all_items, CAMERA).basis(x, y).reshape(-1, 17)
    general = parameter_set("bluh", LINEAR_FAMILIES["bluh"].items, CAMERA).basis(x, y).reshape(-1, 12)
    common = pattern("80", x, y).reshape(-1, 1)
    orientation = orientation_columns(x, y, F).reshape(-1, 6)
    for columns, rank in (
        ((special, orientation), 23),
        ((special, orientation, general), 35),
        ((special, orientation, general, common), 35),
    ):
        design = np.hstack(columns)
        assert np.linalg.matrix_rank(design / np.linalg.norm(design, axis=0), tol=1e-6) == rank


@pytest.mark.parametrize("flight_axis", ["+x", "-x", "-y"])
def test_flight_axis_turns_the_heads(flight_axis):
    x, y = format_grid(10, 6)
    turned = parameter_set("dmc", dmc.FAMILY.all_items, camera_for("dmc", flight_axis))
    native = parameter_set("dmc", dmc.FAMILY.all_items, CAMERA)
    turn = native_from_image(turned.camera)
    image = turn.T @ np.stack([x, y])
    expected = np.einsum("ia,nak->nik", turn.T, native.basis(x, y))
    np.testing.assert_allclose(turned.basis(*image), expected, atol=1e-6)
    flight = {"x": 0, "y": 1}[flight_axis[1]]
    assert not turned.basis(*image)[:, 1 - flight, :4].any()


def test_centre_offset_against_exact_projection():
    """29: a head displaced by P29 along x, in an image made for the mean height of the ground."""
    h0, offset = np.array([1000.0, 1000.0]), 0.08
    above, x = np.array([60.0, -90.0]), np.array([50.0, -30.0])
    ground = x * (h0 - above) / F
    sign = np.sign(x)
    seen = F * (ground - sign * offset) / (h0 - above) + F * sign * offset / h0
    d = dmc.centre_offset(CAMERA, x, np.array([10.0, 10.0]), h0, above) * offset
    np.testing.assert_allclose(d[:, 0], seen - x, atol=1e-12)
    np.testing.assert_allclose(d[:, 1], d[:, 0] * sign)


def test_centre_offset_turns_with_the_flight_axis():
    camera = camera_for("dmc", "+x")
    turn = native_from_image(camera)
    image = turn.T @ (50.0, 10.0)
    h0, above = np.array([1000.0]), np.array([60.0])
    d = dmc.centre_offset(camera, image[:1], image[1:], h0, above)[0]
    native = dmc.centre_offset(CAMERA, np.array([50.0]), np.array([10.0]), h0, above)[0]
    np.testing.assert_allclose(d, turn.T @ native)


def test_a_reduced_copy_of_the_image_keeps_the_patterns():
    small = Camera("small", "dmc", (6912, 3840), 24.0, DMC_INTERIOR, flight_axis="+y")
    x, y = format_grid(10, 6)
    one, other = (parameter_set("dmc", dmc.FAMILY.all_items, camera).basis(x, y) for camera in (CAMERA, small))
    np.testing.assert_allclose(one, other)
