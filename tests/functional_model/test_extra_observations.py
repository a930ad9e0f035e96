"""GNSS, INS and conditions: numeric partials of every kind, single values by hand."""

import numpy as np
import pytest

from aerotri.functional_model.constraints import NO_BASIS, Constraint, ConstraintObservations, flat_basis
from aerotri.functional_model.observed_unknowns import (
    AttitudeObservations,
    CentreObservations,
    inverse_left_jacobian,
    left_jacobian,
)
from aerotri.functional_model.rotation import exponential, logarithm, rotation_from_angles


def situation():
    rng = np.random.default_rng(3)
    n = 4
    angles = rng.normal(0, 0.05, (n, 3)) + [0, 0, 1.5]
    return rng.normal(0, 100, (n, 3)) + [0, 0, 1000], rotation_from_angles(angles), angles, rng


def check_partials(observations, centre, rotation, shared):
    """Every partial of the prediction against central differences (a gap shrinks where a prediction grows)."""
    rows = observations.rows(centre, rotation, shared)
    h = 1e-5

    def gap(c, r, s):
        return observations.rows(c, r, s).gap

    for a in range(6):
        numeric = np.zeros_like(rows.gap)
        for sign in (1, -1):
            if a < 3:
                moved = gap(centre + sign * h * np.eye(3)[a], rotation, shared)
            else:
                moved = gap(centre, exponential(sign * h * np.eye(3)[a - 3]) @ rotation, shared)
            numeric -= sign * moved / (2 * h)
        np.testing.assert_allclose(rows.by_image[:, :, a], numeric, atol=2e-6 * max(1, np.abs(numeric).max()))
    dense = np.zeros((*rows.gap.shape, len(shared)))
    for g, columns in enumerate(rows.columns):
        for c, column in enumerate(columns):
            if column >= 0:
                dense[g, :, column] += rows.by_shared[g, :, c]
    for column in range(len(shared)):
        step = h * np.eye(len(shared))[column]
        numeric = -(gap(centre, rotation, shared + step) - gap(centre, rotation, shared - step)) / (2 * h)
        np.testing.assert_allclose(dense[:, :, column], numeric, atol=2e-6 * max(1, np.abs(numeric).max()))


def test_antenna_partials():
    centre, rotation, _, rng = situation()
    image = np.array([0, 2, 2, 3])
    columns = np.arange(6).reshape(2, 3)
    observed = CentreObservations(
        labels=np.array(list("abcd")), image=image, xyz=centre[image] + 1.0, inv_sigma=np.full((4, 3), 10.0),
        shift=columns[[0, 1, 1, 1]], drift=columns[[1, 0, 0, 0]], lever=np.array([6, 7, 8]),
        lever_arm=np.array([0.3, -0.2, 1.5]), offset=np.array([9, 9, 9, 9]), velocity=rng.normal(0, 50, (4, 3)),
        time=np.array([-1.0, 2.0, 0.5, 3.0]),
    )  # fmt: skip
    check_partials(observed, centre, rotation, rng.normal(0, 0.3, 10))


def test_antenna_by_hand():
    """κ = 90°: the lever arm along the image's x axis points north; 2 m of shift and 3 s of 0.1 m/s drift besides."""
    observed = CentreObservations(
        labels=np.array(["p"]), image=np.array([0]), xyz=np.array([[10.0, 20.0, 1000.0]]), inv_sigma=np.ones((1, 3)),
        shift=np.array([[0, -1, -1]]), drift=np.array([[-1, -1, 1]]), lever=np.full(3, -1),
        lever_arm=np.array([0.5, 0.0, 0.0]), offset=np.array([-1]), velocity=np.zeros((1, 3)), time=np.array([3.0]),
    )  # fmt: skip
    rotation = rotation_from_angles(np.array([[0.0, 0.0, np.pi / 2]]))
    rows = observed.rows(np.array([[7.0, 19.0, 999.0]]), rotation, np.array([2.0, 0.1]))
    np.testing.assert_allclose(rows.gap, [[10 - 7 - 2, 20 - 19 - 0.5, 1000 - 999 - 0.3]], atol=1e-12)


@pytest.mark.parametrize("order", ["omega-phi-kappa", "phi-omega-kappa"])
def test_attitude_partials(order):
    centre, rotation, _, rng = situation()
    image = np.array([0, 1, 3])
    angles = rng.normal(0, 0.2, (3, 3)) + [0.1, -0.1, 1.4]
    columns = np.arange(6).reshape(2, 3)
    observed = AttitudeObservations(
        labels=np.array(list("abc")), image=image, rotation=rotation_from_angles(angles, order), angles=angles,
        order=order, inv_sigma=np.full((3, 3), 1e4), boresight=columns[[0, 0, 0]],
        boresight_start=np.broadcast_to(exponential(np.array([0.5, -0.4, 2.0])), (3, 3, 3)), drift=columns[[1, 1, 1]],
        time=np.array([-1.0, 0.5, 2.0]),
    )  # fmt: skip
    check_partials(observed, centre, rotation, rng.normal(0, 0.02, 6))


def test_attitude_residual_is_in_angles_as_given():
    """At κ = 90° a wrong ω of the observation shows in ω, not in φ."""
    angles = np.array([[0.01, -0.02, np.pi / 2]])
    wrong = angles + [[0.001, 0.0, 0.0]]
    none = np.full((1, 3), -1)
    observed = AttitudeObservations(
        labels=np.array(["p"]), image=np.array([0]), rotation=rotation_from_angles(wrong), angles=wrong,
        order="omega-phi-kappa", inv_sigma=np.ones((1, 3)), boresight=none, boresight_start=np.eye(3)[None],
        drift=none, time=np.zeros(1),
    )  # fmt: skip
    gap = observed.rows(np.zeros((1, 3)), rotation_from_angles(angles), np.zeros(0)).gap
    np.testing.assert_allclose(gap, [[0.001, 0.0, 0.0]], atol=1e-7)


@pytest.mark.parametrize("size", [1e-7, 1e-3, 0.5, 2.5])
def test_left_jacobian(size):
    delta = size * np.array([0.6, -0.64, 0.48])
    np.testing.assert_allclose(left_jacobian(delta) @ inverse_left_jacobian(delta), np.eye(3), atol=1e-12)
    step = 1e-6 * np.array([0.3, 0.5, -0.8])
    turned = logarithm(exponential(delta + step) @ exponential(delta).T)
    np.testing.assert_allclose(turned, left_jacobian(delta) @ step, atol=1e-11)


def condition(kind, points, extra=(), **changes):
    count = len(points)
    centre, basis = flat_basis(points, kind) if kind in ("plane", "line") else NO_BASIS
    given = dict(value=0.0, sigma=0.01, axes=np.eye(3), centre=centre, basis=basis) | changes
    return Constraint(
        kind=kind, label=kind, columns=np.arange(3 * count).reshape(count, 3), extra=np.array(extra, dtype=int), **given
    )


@pytest.mark.parametrize("kind", ["vertical", "horizontal", "height_difference", "distance", "plane", "line"])
@pytest.mark.parametrize("curved", [False, True])
def test_condition_partials(kind, curved):
    centre, rotation, _, rng = situation()
    count = {"plane": 5, "line": 4, "height_difference": 2, "distance": 2}.get(kind, 3)
    points = rng.normal(0, 50, (count, 3))
    extra = {"plane": 3, "line": 4}.get(kind, 0)
    axes = exponential(np.array([1e-3, 2e-3, 0.0]))
    made = condition(kind, points, range(3 * count, 3 * count + extra), value=3.0, axes=axes, curved=curved)
    observations = ConstraintObservations((made,))
    shared = np.concatenate([points.ravel(), rng.normal(0, 0.1, extra)])
    assert observations.count == observations.rows(centre, rotation, shared).count
    # the drop of the curved earth is the same for a shift of a hundredth of a millimetre
    check_partials(observations, centre, rotation, shared)


def test_conditions_by_hand():
    tower = np.array([[10.0, 20.0, 100.0], [10.1, 19.8, 115.0]])
    rows = ConstraintObservations((condition("vertical", tower),)).rows(None, None, tower.ravel())
    np.testing.assert_allclose(rows.gap.ravel(), [-0.1, 0.2], atol=1e-12)
    rows = ConstraintObservations((condition("height_difference", tower, value=14.9),)).rows(None, None, tower.ravel())
    np.testing.assert_allclose(rows.gap.ravel(), [-0.1], atol=1e-12)
    far = np.array([[0.0, 0, 0], [3000.0, 4000.0, -1.0]])
    rows = ConstraintObservations((condition("distance", far, value=5000.0),)).rows(None, None, far.ravel())
    np.testing.assert_allclose(rows.gap.ravel(), [-1e-4], atol=1e-9)
    rows = ConstraintObservations((condition("horizontal", far, curved=True),)).rows(None, None, far.ravel())
    np.testing.assert_allclose(rows.gap.ravel(), [1.0 - 5000.0**2 / 2 / 6371000.0], atol=1e-9)


def test_points_on_plane_and_line_have_no_gap():
    rng = np.random.default_rng(1)
    uv = rng.normal(0, 30, (6, 2))
    plane = np.column_stack([uv, 5 + 0.1 * uv[:, 0] - 0.2 * uv[:, 1]])
    line = np.array([1.0, 2, 3]) + np.linspace(-5, 9, 5)[:, None] * np.array([0.3, -0.5, 0.2])
    for kind, points, extra in (("plane", plane, 3), ("line", line, 4)):
        made = condition(kind, points, range(3 * len(points), 3 * len(points) + extra))
        rows = ConstraintObservations((made,)).rows(None, None, np.concatenate([points.ravel(), np.zeros(extra)]))
        np.testing.assert_allclose(rows.gap, 0.0, atol=1e-12)
