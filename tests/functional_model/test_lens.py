"""The forward lens: against OpenCV and COLMAP, its partials, its inverse, identities, and the fisheye."""

import cv2
import numpy as np
import pytest

from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.collinearity import FIRST_LENS, INTERIOR_COLUMNS, linearise, predict

BENT = {"k1": 0.05, "k2": -0.02, "p1": 1e-3, "p2": -2e-3, "k3": 0.01, "k4": 4e-3, "q1": 0.03, "q2": -0.01, "q3": 5e-3,
        "sx": 2e-3, "sy": -1e-3, "b1": 3e-3, "b2": -4e-3}  # fmt: skip
FOCAL_PX = np.array([1000.0, 1000.0])


def _interior(values, fisheye, c=1000.0):
    row = np.zeros((1, len(INTERIOR_COLUMNS)))
    row[0, 0], row[0, FIRST_LENS:] = c, lens.vector(values, fisheye)
    return row


def _directions(largest_deg, seed=3, count=200):
    """(count, 3) points about the camera, x right, y up, z backwards, up to an angle off the axis."""
    rng = np.random.default_rng(seed)
    theta, turn = np.radians(rng.uniform(0, largest_deg, count)), rng.uniform(0, 2 * np.pi, count)
    unit = np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), -np.cos(theta)], axis=1)
    return unit * rng.uniform(1.0, 50.0, count)[:, None]


def _predicted(points, interior):
    row = np.zeros(len(points), int)
    place = np.arange(len(points))
    return predict(np.eye(3)[None], np.zeros((1, 3)), points, interior, row, place, row, np.zeros((len(points), 2)))


def _upside_down(values):
    """The same lens in a frame whose y points down."""
    return [-value if name in ("p1", "sy") else value for name, value in values.items()]


FLIP = np.array([1.0, -1.0, -1.0])


def test_fisheye_is_opencvs():
    values = {"k1": 0.03, "k2": -0.01, "k3": 2e-3, "k4": -3e-4}
    points = _directions(85.0)
    camera = np.diag([*FOCAL_PX, 1.0])
    theirs, _ = cv2.fisheye.projectPoints(
        (points * FLIP)[:, None], np.zeros(3), np.zeros(3), camera, np.array([0.03, -0.01, 2e-3, -3e-4])
    )
    np.testing.assert_allclose(_predicted(points, _interior(values, True)) * [1, -1], theirs[:, 0], atol=1e-9)


def test_rational_model_and_thin_prism_are_opencvs():
    values = {name: BENT[name] for name in ("k1", "k2", "p1", "p2", "k3", "q1", "q2", "q3")}
    coefficients = np.array([*_upside_down(values), 2e-3, 0.0, 1e-3, 0.0])
    points = _directions(50.0)
    theirs, _ = cv2.projectPoints(points * FLIP, np.zeros(3), np.zeros(3), np.diag([*FOCAL_PX, 1.0]), coefficients)
    ours = _predicted(points, _interior(values | {"sx": 2e-3, "sy": -1e-3}, False))
    np.testing.assert_allclose(ours * [1, -1], theirs[:, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("model", "names"),
    [
        ("FULL_OPENCV", ("k1", "k2", "p1", "p2", "k3", "q1", "q2", "q3")),
        ("OPENCV_FISHEYE", ("k1", "k2", "k3", "k4")),
        ("THIN_PRISM_FISHEYE", ("k1", "k2", "p1", "p2", "k3", "k4", "sx", "sy")),
    ],
)
def test_models_are_colmaps(model, names):
    pycolmap = pytest.importorskip("pycolmap")
    values = {name: BENT[name] for name in names}
    params = [*FOCAL_PX, 0.0, 0.0, *_upside_down(values)]
    camera = pycolmap.Camera(model=model, width=100, height=100, params=params)
    points = _directions(60.0)
    theirs = np.array([camera.img_from_cam(point) for point in points * FLIP])
    ours = _predicted(points, _interior(values, "FISHEYE" in model))
    np.testing.assert_allclose(ours * [1, -1], theirs, atol=1e-9)


def test_metashapes_polynomial_by_hand():
    """x' = x·(1 + k4·r⁸), u = f·x' + B1·x' + B2·y', v = f·y', y down: B2 turns its sign with y."""
    x, y, k4, b1, b2 = 0.4, -0.3, 0.02, 2.5, -1.5
    radial = 1 + k4 * (x * x + y * y) ** 4
    expected = [1000 * x * radial + b1 * x * radial + b2 * y * radial, 1000 * y * radial]
    ours = _predicted(np.array([[x, -y, -1.0]]), _interior({"k4": k4, "b1": b1 / 1000, "b2": -b2 / 1000}, False))
    np.testing.assert_allclose(ours[0] * [1, -1], expected, atol=1e-10)


@pytest.mark.parametrize("largest_deg", [1e-4, 0.5, 120.0])
def test_ideal_fisheye_is_equidistant(largest_deg):
    points = _directions(largest_deg)
    theta = np.arctan2(np.hypot(points[:, 0], points[:, 1]), -points[:, 2])
    ours = _predicted(points, _interior({}, True))
    np.testing.assert_allclose(np.hypot(*ours.T), 1000.0 * theta, rtol=1e-12)
    np.testing.assert_allclose(np.arctan2(*ours.T), np.arctan2(*points[:, :2].T), atol=1e-12)


def test_partials_of_a_fisheye_from_the_axis_to_behind():
    points = np.concatenate([_directions(0.02, count=20), _directions(0.6, count=20), _directions(115.0, count=60)])
    row, place, zero = np.zeros(len(points), int), np.arange(len(points)), np.zeros((len(points), 2))
    interior = _interior({"k1": 0.03, "p1": 1e-3, "b2": 2e-3}, True)
    partials = linearise(np.eye(3)[None], np.zeros((1, 3)), points, interior, row, place, row, zero)
    for axis in range(3):
        step = 1e-5 * np.eye(3)[axis]
        numeric = (_predicted(points + step, interior) - _predicted(points - step, interior)) / 2e-5
        np.testing.assert_allclose(partials.by_point[:, :, axis], numeric, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("fisheye", [False, True])
def test_kernel_and_arrays_say_the_same(fisheye):
    points = _directions(70.0 if fisheye else 45.0)
    a, b = (points[:, :2] / -points[:, 2:]).T
    ours = lens.distort(a, b, lens.vector(BENT, fisheye))
    np.testing.assert_allclose(1000.0 * ours, _predicted(points, _interior(BENT, fisheye)), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("fisheye", [False, True])
def test_undistort_inverts(fisheye):
    points = _directions(80.0 if fisheye else 40.0)
    tangent = points[:, :2] / -points[:, 2:]
    vector = lens.vector(BENT, fisheye)
    back = lens.undistort(lens.distort(*tangent.T, vector), vector)
    np.testing.assert_allclose(back, tangent, rtol=1e-11, atol=1e-13)


def test_undistort_names_what_no_direction_has():
    folded = lens.vector({"k1": -0.3})  # ρ(1 − 0.3ρ²) is largest at 0.70
    got = lens.undistort(np.array([[0.6, 0.0], [0.8, 0.0], [5.0, 1.0]]), folded)
    assert np.isfinite(got[0]).all()
    assert np.isnan(got[1:]).all()
    beyond = lens.undistort(np.array([[1.5, 0.0], [1.6, 0.0]]), lens.vector({}, True))
    assert np.isfinite(beyond[0]).all()
    assert np.isnan(beyond[1]).all()


@pytest.mark.parametrize("place", range(len(lens.ITEMS)), ids=lens.ITEMS)
def test_patterns_and_slopes_are_the_partials(place):
    a, b = np.random.default_rng(2).uniform(-0.6, 0.6, (2, 40))
    vector, step = lens.vector(BENT), 1e-6 * np.eye(len(lens.COLUMNS))[place]
    numeric = (lens.bend(a, b, vector + step) - lens.bend(a, b, vector - step)) / 2e-6
    np.testing.assert_allclose(lens.patterns(a, b, vector)[:, :, place], numeric, atol=1e-8)
    by_a = (lens.bend(a + 1e-6, b, vector) - lens.bend(a - 1e-6, b, vector)) / 2e-6
    by_b = (lens.bend(a, b + 1e-6, vector) - lens.bend(a, b - 1e-6, vector)) / 2e-6
    np.testing.assert_allclose(lens.slopes(a, b, vector), np.stack([by_a, by_b], axis=-1), atol=1e-8)


def test_without_parameters_nothing_is_bent():
    a, b = np.random.default_rng(2).uniform(-0.6, 0.6, (2, 40))
    np.testing.assert_array_equal(lens.distort(a, b, lens.vector({})), np.stack([a, b], axis=1))
