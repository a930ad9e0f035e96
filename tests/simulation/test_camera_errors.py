"""Image errors by physics and by parameters: size, seams, what the parameter sets make of them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import dmc_heads, parameter_set
from aerotri.functional_model.additional_parameters.ultracam_d import tile_of
from aerotri.functional_model.orientation_patterns import orientation_patterns
from aerotri.simulation import read_spec, simulate, true_image_errors
from aerotri.simulation.camera_errors import dmc, rms_mm, ultracam_d
from aerotri.simulation.camera_errors.lens import random_lens
from aerotri.simulation.camera_spec import CameraSpec
from aerotri.simulation.cameras import block_camera
from places import PROJECT

BLOCKS = PROJECT / "blocks"
SEAMS_X = np.array([3877 - 5750, 7623 - 5750]) * 0.009
SEAMS_Y = np.array([3750 - 2543, 3750 - 4957]) * 0.009


def camera(preset, **changes):
    return block_camera("cam", CameraSpec.model_validate({"preset": preset, **changes}))


def grid(cam, n=80):
    """Nodes over the format that avoid the seams."""
    half = cam.half_format_mm
    x, y = np.meshgrid(np.linspace(-half[0], half[0], n + 1) * 0.999, np.linspace(-half[1], half[1], n) * 0.999)
    return x.ravel(), y.ravel()


def physical(small_spec, preset, run=1, **keys):
    errors = {"physical": {"rms_um": 4.0, **keys}}
    spec = small_spec(camera={"cam": {"preset": preset, "errors": errors}})
    return true_image_errors(spec, run)["cam", ""]


@pytest.mark.parametrize("preset", ["ultracam_d", "dmc", "rmk_top_15", "p1"])
@pytest.mark.parametrize("rms_um", [2.0, 6.0])
def test_the_requested_rms_is_reached(small_spec, preset, rms_um):
    field = physical(small_spec, preset, rms_um=rms_um)
    d = field(*grid(camera(preset), 150))
    assert np.sqrt(np.mean(d**2)) == pytest.approx(rms_um * 1e-3, rel=0.03)
    assert rms_mm(field, camera(preset)) == pytest.approx(rms_um * 1e-3, rel=1e-12)
    assert np.abs(d).max() < 12 * rms_um * 1e-3


@pytest.mark.parametrize("preset", ["ultracam_d", "dmc", "rmk_top_15"])
def test_no_orientation_is_hidden_in_it(small_spec, preset):
    cam = camera(preset)
    x, y = grid(cam, 150)
    d = physical(small_spec, preset)(x, y).ravel()
    a = orientation_patterns(x, y, cam.focal_length_mm).reshape(-1, 6)
    fitted = a @ np.linalg.lstsq(a, d, rcond=None)[0]
    assert np.sqrt(np.mean(fitted**2)) < 0.05 * np.sqrt(np.mean(d**2))


def test_orientation_patterns_are_those_of_the_collinearity():
    """Numeric partials of a vertical photograph over flat ground, h = f."""
    x, y, f = np.array([12.0, -30.0]), np.array([-7.0, 21.0]), 101.4
    patterns = orientation_patterns(x, y, f)
    e = 1e-6
    rotation_x = np.array([[1, 0, 0], [0, np.cos(e), -np.sin(e)], [0, np.sin(e), np.cos(e)]])
    rotation_y = np.array([[np.cos(e), 0, np.sin(e)], [0, 1, 0], [-np.sin(e), 0, np.cos(e)]])
    for rotation, column, sign in ((rotation_x, 5, -1.0), (rotation_y, 4, 1.0)):
        u = rotation.T @ np.stack([x, y, np.full(2, -f)])
        moved = -f * u[:2] / u[2]
        np.testing.assert_allclose((moved - np.stack([x, y])).T / e, sign * patterns[:, :, column], rtol=1e-4)


def test_ultracam_d_jumps_at_the_seams_and_is_smooth_between(small_spec):
    field = physical(small_spec, "ultracam_d")
    y = np.linspace(-33.0, 33.0, 100)
    x = np.linspace(-51.0, 51.0, 100)
    e = 1e-6
    jumps = [field(np.full(100, s + e), y) - field(np.full(100, s - e), y) for s in SEAMS_X]
    jumps += [field(x, np.full(100, s + e)) - field(x, np.full(100, s - e)) for s in SEAMS_Y]
    for jump in jumps:
        assert np.sqrt(np.mean(jump**2)) > 0.3e-3
        assert np.abs(jump).max() < 20e-3
    # nowhere else: 10 µm apart within a tile
    cam = camera("ultracam_d")
    gx, gy = grid(cam)
    same = (tile_of(cam, gx, gy) == tile_of(cam, gx + 0.01, gy)) & (tile_of(cam, gx, gy) == tile_of(cam, gx, gy + 0.01))
    step = np.maximum(np.abs(field(gx + 0.01, gy) - field(gx, gy)), np.abs(field(gx, gy + 0.01) - field(gx, gy)))
    assert step[same].max() < 0.1e-3


def test_the_field_turns_with_the_flight_axis(small_spec):
    across = {"preset": "ultracam_d", "flight_axis": "+y", "errors": {"physical": {"rms_um": 4.0}}}
    turned = {**across, "flight_axis": "+x", "size_px": [7500, 11500]}
    plain = true_image_errors(small_spec(camera={"cam": across}), 1)["cam", ""]
    rotated = true_image_errors(small_spec(camera={"cam": turned}), 1)["cam", ""]
    x, y = grid(camera("ultracam_d"), 30)
    # +x along the flight: native across = −y of the image, native along = x of the image
    d, e = plain(x, y), rotated(y, -x)
    np.testing.assert_allclose(np.stack([-e[:, 1], e[:, 0]], 1), d, atol=1e-12)


def test_stitching_closes_the_overlaps():
    """Least squares with shifts: without noise the gaps to the master's tiles are zero in the mean."""
    cam = camera("ultracam_d")
    weights = {**ultracam_d.WEIGHTS, "stitching": 0.0}
    error = ultracam_d.ultracam_d_error(cam, weights, np.random.default_rng(3))
    for tile, onto in ultracam_d.STITCHING:
        places = [(other, *ultracam_d.overlap_points(cam, tile, other)) for other in onto]
        gaps = [
            error.of_tile(np.full(len(x), tile), x, y) - error.of_tile(np.full(len(x), o), x, y) for o, x, y in places
        ]
        gap = np.concatenate(gaps)
        np.testing.assert_allclose(gap.mean(axis=0), 0.0, atol=1e-12)
        assert np.sqrt(np.mean(gap**2)) > 0.05
    assert (error.stitching[[0, 2, 6, 8]] == 0.0).all()


def test_a_slave_tile_out_of_place_is_put_back():
    """A shift, turn or scale of a slave's CCD alone vanishes in the stitching; one of the master's does not."""
    cam = camera("ultracam_d")
    nothing = {key: 0.0 for key in ultracam_d.WEIGHTS}
    plain = ultracam_d.ultracam_d_error(cam, nothing, np.random.default_rng(0))
    x, y = grid(cam, 30)
    for tile, remains in ((1, False), (4, False), (0, True)):
        linear = np.zeros((9, 2, 3))
        linear[tile] = [[5e-3, 1e-4, -2e-4], [-3e-3, 2e-4, 1e-4]]
        shifted = ultracam_d.UltraCamDError(cam, plain.common, plain.cones, linear, plain.tilt, np.zeros((9, 4)))
        stitching = ultracam_d._stitch(shifted, 0.0, np.random.default_rng(0))
        placed = ultracam_d.UltraCamDError(cam, plain.common, plain.cones, linear, plain.tilt, stitching)
        assert (np.abs(placed(x, y)).max() > 1e-3) == remains


def test_dmc_heads_cover_their_quadrants_and_overlap():
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 82.944, 100), np.linspace(0.0, 46.08, 100)))
    for number, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        xi, eta, _ = dmc.in_head(120.0, np.full(len(u), number), sx * u, sy * v)
        spare = np.min([dmc_heads.HALF_FORMAT_MM[0] - np.abs(xi), dmc_heads.HALF_FORMAT_MM[1] - np.abs(eta)])
        # [D] this order of the tilts covers the quadrant with 1.2 mm to spare, the other with 0.3
        assert spare == pytest.approx(1.2, abs=0.1)
    assert all(len(px) > 100 for _, _, px, _ in dmc.overlap_points(camera("dmc")))
    axes = dmc_heads.head_rotation() @ np.array([0.0, 0.0, -1.0])
    assert -120.0 * axes[:2] / axes[2] == pytest.approx([34.4, 24.3], abs=0.06)
    x, y = grid(camera("dmc"))
    head = dmc.head_of(x, y)
    xi, eta, jacobian = dmc.in_head(120.0, head, x, y)
    e = 1e-5
    across = dmc.in_head(120.0, head, x + e, y)
    along = dmc.in_head(120.0, head, x, y + e)
    inverse = np.stack(
        [np.stack([across[0] - xi, along[0] - xi], 1), np.stack([across[1] - eta, along[1] - eta], 1)], 1
    )
    product = jacobian @ (inverse / e)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(2), product.shape), atol=1e-5)


def test_dmc_attitudes_are_stitched_away():
    cam = camera("dmc")
    weights = {**{key: 0.0 for key in dmc.WEIGHTS}, "pose": 1.0}
    error = dmc.dmc_error(cam, weights, np.random.default_rng(3))
    x, y = grid(cam, 30)
    design = orientation_patterns(x, y, 120.0).reshape(-1, 6)
    d = error(x, y).ravel()
    left = d - design @ np.linalg.lstsq(design, d, rcond=None)[0]
    assert np.abs(left).max() < 1e-6


def test_dmc_jumps_at_the_seams_of_the_heads(small_spec):
    field = physical(small_spec, "dmc")
    t, e = np.linspace(-40.0, 40.0, 50), 1e-6
    assert np.sqrt(np.mean((field(np.full(50, e), t) - field(np.full(50, -e), t)) ** 2)) > 0.2e-3
    assert np.abs(field(t + 1.0 + e, t * 0.5) - field(t + 1.0, t * 0.5)).max() < 1e-6


def test_film_is_smooth(small_spec):
    field = physical(small_spec, "rmk_top_15")
    x, y = grid(camera("rmk_top_15"))
    assert np.abs(field(x + 0.1, y) - field(x, y)).max() < 0.3e-3


def test_lens_error_has_the_size_of_its_kinds():
    half = (50.0, 30.0)
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 4000)) * np.array(half)[:, None]
    for kind in range(3):
        sizes = [0.0, 0.0, 0.0]
        sizes[kind] = 2.0
        lens = random_lens(half, *sizes, np.random.default_rng(4))
        assert np.sqrt(np.mean(lens(x, y) ** 2)) == pytest.approx(2.0, rel=0.1)
    # a purely radial error points along the radius
    lens = random_lens(half, 1.0, 0.0, 0.0, np.random.default_rng(4))
    d = lens(x, y)
    cross = (x - lens.axis[0]) * d[:, 1] - (y - lens.axis[1]) * d[:, 0]
    np.testing.assert_allclose(cross, 0.0, atol=1e-12)


def share(d, *bases):
    """Share of the variance that patterns take, and the RMS of what is left."""
    design = np.concatenate([b.reshape(-1, b.shape[-1]) for b in bases], axis=1)
    q = scipy.linalg.orth(design / np.linalg.norm(design, axis=0))
    left = d.ravel() - q @ (q.T @ d.ravel())
    return 1.0 - np.sum(left**2) / np.sum(d**2), np.sqrt(np.mean(left**2))


def test_bluh_and_tiles_represent_most_of_the_frederiksstad_camera_but_not_all():
    spec = read_spec(BLOCKS / "frederiksstad_ultracam" / "simulation.toml")
    cam = block_camera("ucd2", spec.camera["ucd2"])
    x, y = grid(cam, 120)
    d = true_image_errors(spec, 1)["ucd2", ""](x, y)
    orientation = orientation_patterns(x, y, cam.focal_length_mm)
    general = parameter_set("bluh", map(str, range(1, 13)), cam).basis(x, y)
    tiles = parameter_set("ultracam_d", map(str, range(42, 74)), cam).basis(x, y)
    alone, _ = share(d, orientation, general)
    tiles_alone, _ = share(d, orientation, tiles)
    both, left = share(d, orientation, general, tiles)
    # the findings of the paper: the general set shrinks, the tiles alone are not enough, both together nearly do
    assert 0.6 < alone < 0.9
    assert 0.5 < tiles_alone < 0.9
    assert max(alone, tiles_alone) + 0.05 < both < 0.98
    assert 0.5e-3 < left < 1.5e-3


def test_parameters_add_up_to_their_patterns(small_spec):
    values = {"bluh.3": 1e-5, "bluh.9": 2e-9, "ultracam_d.66": 3e-5}
    spec = small_spec(camera={"cam": {"errors": {"parameters": values, "brown": {"K1": 1e-8}}}})
    field = true_image_errors(spec, 1)["cam", ""]
    cam = camera("ultracam_d")
    x, y = np.array([-40.0, 3.0]), np.array([25.0, -20.0])
    s = 115.0 * np.sqrt(2.0) / cam.r_max_mm
    u, v = s * x, s * y
    b, r2 = np.arctan2(v, u), u * u + v * v
    expected = np.stack([-u * np.cos(2 * b), -v * np.cos(2 * b)], 1) * 1e-5 / s
    expected += np.stack([-u * (r2 - 16384), -v * (r2 - 16384)], 1) * 2e-9 / s
    expected -= np.stack([x, y], 1) * ((x * x + y * y) * 1e-8)[:, None]
    # the first point lies in the upper left tile, turned about its centre
    expected[0] += 3e-5 * np.array([-(25.0 - (3750 - 1336) * 0.009), -40.0 - (2004 - 5750) * 0.009])
    np.testing.assert_allclose(field(x, y), expected, atol=1e-15)


def test_a_camera_keeps_its_errors_when_it_has_a_seed(small_spec):
    x, y = grid(camera("ultracam_d"), 10)
    fixed = [physical(small_spec, "ultracam_d", run, seed=7)(x, y) for run in (1, 2)]
    free = [physical(small_spec, "ultracam_d", run)(x, y) for run in (1, 2)]
    np.testing.assert_array_equal(*fixed)
    assert np.abs(free[0] - free[1]).max() > 1e-3


def test_days_differ_by_the_change_asked_for(small_spec):
    errors = {"physical": {"rms_um": 4.0, "day_change_um": 0.5}}
    spec = small_spec(camera={"cam": {"errors": errors}}, flight={"days": 2})
    fields = true_image_errors(spec, 1)
    x, y = grid(camera("ultracam_d"))
    change = fields["cam", "1"](x, y) - fields["cam", "2"](x, y)
    assert np.sqrt(np.mean(change**2)) == pytest.approx(0.5e-3 * np.sqrt(2.0), rel=0.3)
    _, truth = simulate(spec, 1)
    assert [(s.camera, s.day) for s in truth.image_errors] == [("cam", "1"), ("cam", "2")]


@pytest.mark.parametrize(
    ("errors", "named"),
    [
        ({"parameters": {"bluh.13": 1.0}}, "bluh.13"),
        ({"parameters": {"blue.1": 1.0}}, "blue.1"),
        ({"physical": {"rms_um": 3.0, "weights": {"mirror": 1.0}}}, "mirror"),
        ({"physical": {"rms_um": 3.0, "weights": dict.fromkeys(ultracam_d.WEIGHTS, 0.0)}}, "weights"),
    ],
)
def test_wrong_errors_are_named(small_spec, errors, named):
    with pytest.raises(InputError, match=named):
        simulate(small_spec(camera={"cam": {"errors": errors}}), 1)


def test_parameters_of_another_camera_are_refused(small_spec):
    with pytest.raises(InputError, match="ultracam_d"):
        simulate(small_spec(camera={"cam": {"preset": "p1", "errors": {"parameters": {"ultracam_d.42": 1e-5}}}}), 1)
