"""Additional parameters: one contract for all families, then what each family promises."""

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import FAMILIES, brown, parameter_set, parse_parameters, ultracam_d
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES
from aerotri.observations import Camera, Prior

INTERIOR = {name: Prior(value, fixed=True) for name, value in (("focal_length_mm", 101.4), ("x0_mm", 0), ("y0_mm", 0))}


def camera_for(family: str, flight_axis: str = "+y", size=(11500, 7500), pixel_um=9.0) -> Camera:
    model = LINEAR_FAMILIES[family].CAMERA_MODEL or "frame"
    if flight_axis[1] == "x":
        size = size[::-1]
    return Camera("cam", model, size, pixel_um, INTERIOR, flight_axis=flight_axis)


def full_set(family: str, flight_axis: str = "+y"):
    return parameter_set(family, LINEAR_FAMILIES[family].ITEMS, camera_for(family, flight_axis))


def inner_points(camera: Camera, n=400, seed=1):
    """Image points clear of tile seams and of the axes, where patterns are smooth."""
    rng = np.random.default_rng(seed)
    half = np.array(camera.half_format_mm)
    xy = rng.uniform(-0.98, 0.98, (n, 2)) * half
    native = xy @ ultracam_d.native_from_image(camera).T
    pixel = ultracam_d.native_pixel_mm(camera)
    seams_x = (ultracam_d.SEAM_COLUMNS - ultracam_d.SENSOR_SIZE_PX[0] / 2) * pixel
    seams_y = (ultracam_d.SENSOR_SIZE_PX[1] / 2 - ultracam_d.SEAM_ROWS) * pixel
    clear = (np.abs(native[:, :1] - seams_x).min(axis=1) > 0.01) & (np.abs(native[:, 1:] - seams_y).min(axis=1) > 0.01)
    return xy[clear].T


@pytest.mark.parametrize("family", LINEAR_FAMILIES)
@pytest.mark.parametrize("flight_axis", ["+x", "-x", "+y", "-y"])
def test_partials_are_the_derivatives(family, flight_axis):
    chosen = full_set(family, flight_axis)
    x, y = inner_points(chosen.camera)
    analytic, h = chosen.partials(x, y), 1e-5
    numeric = np.stack(
        [
            (chosen.basis(x + h, y) - chosen.basis(x - h, y)) / (2 * h),
            (chosen.basis(x, y + h) - chosen.basis(x, y - h)) / (2 * h),
        ],
        axis=-1,
    )
    scale = np.abs(analytic).max(axis=(0, 1, 3))[:, None] + 1e-12
    np.testing.assert_allclose(analytic / scale, numeric / scale, atol=1e-7)


@pytest.mark.parametrize("family", LINEAR_FAMILIES)
def test_contract(family):
    module, chosen = LINEAR_FAMILIES[family], full_set(family)
    assert chosen.names == tuple(f"{family}.{item}" for item in module.ITEMS)
    assert set(module.MARK) <= set("PLDC")
    assert len(module.REFERENCE) > 10
    x, y = inner_points(chosen.camera, 30)
    basis = chosen.basis(x, y)
    assert basis.shape == (len(x), 2, len(module.ITEMS))
    assert np.isfinite(chosen.basis(np.zeros(1), np.zeros(1))).all()
    for k in (0, len(module.ITEMS) // 2, len(module.ITEMS) - 1):
        alone = parameter_set(family, [module.ITEMS[k]], chosen.camera)
        np.testing.assert_array_equal(alone.basis(x, y)[:, :, 0], basis[:, :, k])
    assert chosen.basis(np.zeros(0), np.zeros(0)).shape == (0, 2, len(module.ITEMS))


def test_bluh_by_hand():
    """Table 1 of paper 003 at x = 30, y = −40 mm of a film camera, where s = 1 and r = 50 mm."""
    film = Camera("film", "frame", (23000, 23000), 10.0, INTERIOR)
    basis = parameter_set("bluh", [str(k) for k in range(1, 13)], film).basis(np.array([30.0]), np.array([-40.0]))[0]
    b = np.arctan2(-40.0, 30.0)
    expected = np.array(
        [
            (40.0, -30.0),
            (-30.0, -40.0),
            (-30 * np.cos(2 * b), 40 * np.cos(2 * b)),
            (-30 * np.sin(2 * b), 40 * np.sin(2 * b)),
            (-30 * 0.6, 40 * 0.6),
            (-30 * -0.8, 40 * -0.8),
            (-40 * 50 * 0.6, -30 * 50 * 0.6),
            (-40 * 50 * -0.8, -30 * 50 * -0.8),
            (-30 * (2500.0 - 16384.0), 40 * (2500.0 - 16384.0)),
            (-30 * np.sin(50 * 0.049087), 40 * np.sin(50 * 0.049087)),
            (-30 * np.sin(50 * 0.098174), 40 * np.sin(50 * 0.098174)),
            (-30 * np.sin(4 * b), 40 * np.sin(4 * b)),
        ]
    ).T
    np.testing.assert_allclose(basis, expected, rtol=3e-5)


def test_bluh_is_normalised_to_the_film_format():
    """The same relative place gives the same relative displacement, whatever the format."""
    film, small = (Camera("c", "frame", (n, n), 10.0, INTERIOR) for n in (23000, 5000))
    items = LINEAR_FAMILIES["bluh"].ITEMS
    one = parameter_set("bluh", items, film).basis(np.array([46.0]), np.array([23.0])) / 115.0
    other = parameter_set("bluh", items, small).basis(np.array([10.0]), np.array([5.0])) / 25.0
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_bluh_is_single_valued_across_the_axes():
    """A plain arctan(y/x) would make 6 and 8 jump at x = 0."""
    chosen = full_set("bluh")
    y = np.array([20.0, -20.0])
    left, right = chosen.basis(np.full(2, -1e-9), y), chosen.basis(np.full(2, 1e-9), y)
    scale = np.abs(chosen.basis(*inner_points(chosen.camera))).max(axis=(0, 1))
    np.testing.assert_allclose(left / scale, right / scale, atol=1e-7)


def test_bluh_and_brown_identities():
    """[D, models.md 2] P1 = 3x·(x, y) + pattern 8; P2 = 3y·(x, y) − pattern 7; K1 ↔ −P9 plus a scale (s = 1)."""
    film = Camera("film", "frame", (23000, 23000), 10.0, INTERIOR)
    chosen = parameter_set("bluh", LINEAR_FAMILIES["bluh"].ITEMS, film)
    x, y = inner_points(film)
    bluh = {item: chosen.basis(x, y)[:, :, k] for k, item in enumerate(chosen.items)}
    correction = dict(zip(brown.ITEMS, np.moveaxis(-brown.basis(x, y), 2, 0), strict=True))
    xy = np.column_stack([x, y])
    np.testing.assert_allclose(correction["P1"], 3 * x[:, None] * xy + bluh["8"], rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(correction["P2"], 3 * y[:, None] * xy - bluh["7"], rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(correction["K1"], -bluh["9"] + 16384.0 * xy, rtol=1e-10, atol=1e-6)


def orientation_columns(x, y, f):
    """The six directions in which a change of orientation moves image points over flat ground."""
    dx = [np.ones_like(x), np.zeros_like(x), x, -y, f + x * x / f, x * y / f]
    dy = [np.zeros_like(x), np.ones_like(x), y, x, x * y / f, f + y * y / f]
    return np.stack([np.stack(dx, -1), np.stack(dy, -1)], axis=1)


def test_bluh_5_and_6_are_weak_by_nature():
    """models.md 2: the six orientation directions take 92–97 % of their variance."""
    chosen = full_set("bluh")
    half = chosen.camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 41), np.linspace(-half[1], half[1], 41)))
    orientation = orientation_columns(x, y, 101.4).reshape(-1, 6)
    basis = chosen.basis(x, y).reshape(-1, 12)
    left = basis - orientation @ np.linalg.lstsq(orientation, basis, rcond=None)[0]
    taken = 1.0 - np.sum(left**2, axis=0) / np.sum(basis**2, axis=0)
    assert 0.92 <= taken[4] <= 0.97
    assert 0.92 <= taken[5] <= 0.97
    assert (np.delete(taken, [4, 5, 8]) < 0.92).all()


def test_ultracam_tiles_single_points():
    """Tile and patterns of single pixels, by hand: tile centres at columns 2004, 5750, 9496, rows 1336, 3750, 6164."""
    chosen = full_set("ultracam_d")
    column, row = np.array([100.0, 5750.0, 3876.0, 3878.0, 11400.0]), np.array([200.0, 3750.0, 2542.0, 2544.0, 7400.0])
    x, y = (column - 5750.0) * 0.009, (3750.0 - row) * 0.009
    tiles = ultracam_d.tile_of(chosen.camera, x, y)
    np.testing.assert_array_equal(tiles, [0, 4, 0, 4, 8])
    basis = chosen.basis(x, y)
    np.testing.assert_array_equal(basis[1], 0.0)
    np.testing.assert_array_equal(basis[3], 0.0)
    dx, dy = (100.0 - 2004.0) * 0.009, (1336.0 - 200.0) * 0.009
    item = {name: k for k, name in enumerate(chosen.items)}
    np.testing.assert_allclose(basis[0][:, item["42"]], [dx, dy], atol=1e-12)
    np.testing.assert_allclose(basis[0][:, item["50"]], [1.0, 0.0])
    np.testing.assert_allclose(basis[0][:, item["58"]], [0.0, 1.0])
    np.testing.assert_allclose(basis[0][:, item["66"]], [-dy, dx], atol=1e-12)
    assert np.count_nonzero(basis[0].any(axis=0)) == 4
    last = [k for k in range(32) if basis[4][:, k].any()]
    assert [chosen.items[k] for k in last] == ["49", "57", "65", "73"]


def test_ultracam_flight_axis_turns_the_sensor():
    """A point in the upper left tile of the native frame, seen in an image turned by 90°: patterns turn with it."""
    native, turned = full_set("ultracam_d", "+y"), full_set("ultracam_d", "+x")
    at = np.array([[-40.0], [20.0]])
    turn = ultracam_d.native_from_image(turned.camera)
    image = turn.T @ at
    expected = np.einsum("ia,nak->nik", turn.T, native.basis(*at))
    np.testing.assert_allclose(turned.basis(*image), expected, atol=1e-12)


def test_ultracam_rank_of_one_photograph():
    """models.md 3 [D]: nine tiles × 4 patterns and 6 orientation columns over flat ground have rank 38."""
    camera = camera_for("ultracam_d")
    half = camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 60), np.linspace(-half[1], half[1], 60)))
    tile = ultracam_d.tile_of(camera, x, y)
    offset = np.column_stack([x, y]) - ultracam_d.tile_centres_mm(camera)[tile]
    columns = []
    for k in range(9):
        own = (tile == k).astype(float)
        zero = np.zeros_like(own)
        columns += [
            np.concatenate([own * offset[:, 0], own * offset[:, 1]]),
            np.concatenate([own, zero]),
            np.concatenate([zero, own]),
            np.concatenate([-own * offset[:, 1], own * offset[:, 0]]),
        ]
    orientation = orientation_columns(x, y, 101.4)
    design = np.column_stack([*columns, *[np.concatenate([o[:, 0], o[:, 1]]) for o in np.moveaxis(orientation, 2, 0)]])
    assert np.linalg.matrix_rank(design / np.linalg.norm(design, axis=0), tol=1e-9) == 38


def test_parse_parameters():
    assert parse_parameters("none") == ()
    assert parse_parameters("bluh:1-3+12,ultracam_d:42") == (("bluh", ("1", "2", "3", "12")), ("ultracam_d", ("42",)))
    assert parse_parameters(["brown:K1+P1", "brown:K2"]) == (("brown", ("K1", "K2", "P1")),)
    assert parse_parameters("bluh:all") == parse_parameters("bluh:1-12") == parse_parameters("bluh")


@pytest.mark.parametrize("spec", ["blu:1", "bluh:0", "bluh:1-13", "bluh:+", "bluh:1--3", "brown:K9", "bluh:", ":1"])
def test_parse_parameters_refuses(spec):
    if spec == "bluh:":
        assert parse_parameters(spec) == parse_parameters("bluh:all")
        return
    with pytest.raises(InputError):
        parse_parameters(spec)


def test_family_of_another_camera_is_refused():
    with pytest.raises(InputError, match="camera model 'ultracam_d'"):
        parameter_set("ultracam_d", ["42"], camera_for("bluh"))


def test_all_families_are_listed():
    assert {"bluh", "ultracam_d", "brown", "lens"} <= set(FAMILIES)
