"""The collinearity equations: numeric partials, an independent single value, identities."""

import numpy as np
import pytest

from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise, predict
from aerotri.functional_model.rotation import (
    angles_from_rotation,
    exponential,
    logarithm,
    rotation_from_angles,
    small_rotation_per_angle,
)

BROWN = [1e-6, -2e-10, 3e-15, 2e-6, -3e-6, 1e-4, -2e-4]
LENS = [0.05, -0.02, 1e-3, -2e-3, 0.01, 4e-3, 0.03, -0.01, 5e-3, 2e-3, -1e-3, 3e-3, -4e-3]
INTERIOR = np.array([101.4, 0.2, -0.1, *BROWN, *LENS, 0.0])


@pytest.fixture(params=["perspective", "fisheye"])
def rays(request):
    interior = INTERIOR.copy()
    interior[-1] = request.param == "fisheye"
    rng = np.random.default_rng(7)
    n, m = 4, 30
    angles = rng.normal(0, 0.3, (n, 3)) + [0, 0, 1.0]
    centre = rng.uniform(0, 200, (n, 3)) + [0, 0, 1000]
    points = np.column_stack([rng.uniform(-200, 400, (m, 2)), rng.uniform(0, 100, m)])
    image, point = rng.integers(0, n, m), np.arange(m)
    return dict(
        rotation=rotation_from_angles(angles),
        centre=centre,
        points=points,
        interior=interior[None],
        image=image,
        point=point,
        lens_row=np.zeros(m, int),
        xy=rng.uniform(-40, 40, (m, 2)),
    )


def _difference(rays, change, step):
    plus, minus = change(step), change(-step)
    return (predict(**(rays | plus)) - predict(**(rays | minus))) / (2 * step)


def test_partials_by_point_and_centre(rays):
    partials = linearise(**rays)
    for axis in range(3):
        shift = np.eye(3)[axis]
        by_point = _difference(rays, lambda h, s=shift: {"points": rays["points"] + h * s}, 1e-3)
        by_centre = _difference(rays, lambda h, s=shift: {"centre": rays["centre"] + h * s}, 1e-3)
        np.testing.assert_allclose(partials.by_point[:, :, axis], by_point, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(partials.by_orientation[:, :, axis], by_centre, rtol=1e-6, atol=1e-8)


def test_partials_by_small_rotation(rays):
    partials = linearise(**rays)
    for axis in range(3):

        def turned(h, axis=axis):
            return {"rotation": exponential(h * np.eye(3)[axis]) @ rays["rotation"]}

        numeric = _difference(rays, turned, 1e-6)
        np.testing.assert_allclose(partials.by_orientation[:, :, 3 + axis], numeric, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("column", range(len(INTERIOR_COLUMNS) - 1), ids=INTERIOR_COLUMNS[:-1])
def test_partials_by_interior(rays, column):
    partials = linearise(**rays)
    step = max(abs(INTERIOR[column]), 1e-15) * 1e-3

    def changed(h):
        interior = rays["interior"].copy()
        interior[0, column] += h
        return {"interior": interior}

    numeric = _difference(rays, changed, step)
    np.testing.assert_allclose(
        partials.by_interior[:, :, column], numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max()
    )


def test_prediction_shared_by_both(rays):
    np.testing.assert_allclose(linearise(**rays).prediction, predict(**rays), rtol=1e-14, atol=1e-13)


def test_single_value_by_hand():
    """A vertical photograph at 1000 m turned by κ = 90°, c = 100 mm: the point 100 m to the north falls at x = +10 mm.

    With κ = 90° the image x axis points north (R = Rz(90°): first column (0, 1, 0)).
    """
    interior = np.zeros((1, len(INTERIOR_COLUMNS)))
    interior[0, :3] = 100.0, 0.25, -0.5
    rotation = rotation_from_angles(np.array([[0.0, 0.0, np.pi / 2]]))
    zero = np.zeros(1, int)
    got = predict(
        rotation, np.array([[0.0, 0, 1000]]), np.array([[0.0, 100, 0]]), interior, zero, zero, zero, np.zeros((1, 2))
    )
    np.testing.assert_allclose(got, [[10.25, -0.5]], atol=1e-12)


def test_brown_identity_corrected_equals_measured_plus_correction():
    """prediction = ideal + d with d = −Δ, so a measured point that equals ideal − Δ has no residual."""
    interior = np.zeros((1, len(INTERIOR_COLUMNS)))
    interior[0, 0], interior[0, 3] = 100.0, 1e-6
    measured = np.array([[10.0, 20.0]])
    correction = measured * 1e-6 * 500.0
    ideal = measured + correction
    point = np.array([[ideal[0, 0], ideal[0, 1], -100.0]])
    zero = np.zeros(1, int)
    got = predict(np.eye(3)[None], np.zeros((1, 3)), point, interior, zero, zero, zero, measured)
    np.testing.assert_allclose(got, measured, atol=1e-12)


@pytest.mark.parametrize("order", ["omega-phi-kappa", "phi-omega-kappa"])
@pytest.mark.parametrize("off", [0.0, 1e-16, 1e-12, 1e-8, -1e-8, 1e-4])
def test_angles_of_horizontal_axes_give_the_rotation_back(order, off):
    """At and beside ±90° of the middle angle first and last cannot be told apart; together they are right."""
    middle = 1 if order == "omega-phi-kappa" else 0
    angles = np.random.default_rng(2).uniform(-3.0, 3.0, (20, 3))
    angles[:, middle] = np.repeat([np.pi / 2 - off, -np.pi / 2 + off], 10)
    exact = rotation_from_angles(angles, order)
    exact[np.abs(exact) < 1e-15] = 0.0
    again = rotation_from_angles(angles_from_rotation(exact, order), order)
    np.testing.assert_allclose(again, exact, atol=2e-15)


@pytest.mark.parametrize("order", ["omega-phi-kappa", "phi-omega-kappa"])
def test_angles_round_trip_and_partials(order):
    rng = np.random.default_rng(1)
    angles = rng.uniform(-1.4, 1.4, (50, 3))
    rotation = rotation_from_angles(angles, order)
    np.testing.assert_allclose(angles_from_rotation(rotation, order), angles, atol=1e-14)
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, 1, 2), np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-14
    )
    e = small_rotation_per_angle(angles, order)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        plus, minus = rotation_from_angles(angles + step, order), rotation_from_angles(angles - step, order)
        delta = logarithm(plus @ np.swapaxes(minus, 1, 2)) / 2e-6
        np.testing.assert_allclose(e[:, :, axis], delta, atol=1e-8)


def test_rotation_orders_by_hand():
    """ω = 90° then φ = 90°: Rx(90°)·Ry(90°) and Ry(90°)·Rx(90°) written out."""
    quarter = np.array([np.pi / 2, np.pi / 2, 0.0])
    np.testing.assert_allclose(rotation_from_angles(quarter), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(
        rotation_from_angles(quarter, "phi-omega-kappa"), [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], atol=1e-15
    )


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi - 1e-9])
def test_logarithm_inverts_exponential(size):
    axis = np.array([0.6, -0.64, 0.48])
    np.testing.assert_allclose(logarithm(exponential(size * axis)), size * axis, atol=1e-12)
