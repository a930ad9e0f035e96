"""The response of a volume to the adjustment: numeric partials, identities, image errors integrated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.unknowns import Step
from aerotri.conventions import InputError
from aerotri.deformation.error_parameters import shared_columns
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import covariance_of, deform_points, pair_model
from aerotri.functional_model._kernels import INTERIOR, linearise_ray, predict_ray
from aerotri.pipeline import adjust_keeping_system
from aerotri.volume.functionals import tin_heights, tin_volume
from aerotri.volume.parts import Measured, Part
from aerotri.volume.pickets import Pickets, pickets_where_seen
from aerotri.volume.response import control_response, covariance, respond, systematic
from aerotri.volume.shared import difference_part, summed_part
from small_blocks import small_block, with_adjustment


def test_gradient_of_a_tin_volume(hill):
    """All three coordinates of single pickets moved by a centimetre."""
    pickets, triangles, boundary = hill
    value, functional = tin_volume(pickets.xyz, triangles, boundary)
    rng = np.random.default_rng(0)
    biggest = np.argsort(-np.abs(functional.gradient[:, 2]))[:40]
    edge = np.flatnonzero((functional.gradient[:, 2] > 0) & (functional.gradient[:, 2] < 100.0))[:20]
    for k in rng.choice(np.concatenate([biggest, edge]), 25, replace=False):
        for axis in range(3):
            moved = []
            for sign in (1.0, -1.0):
                xyz = pickets.xyz.copy()
                xyz[k, axis] += sign * 0.01
                moved.append(tin_volume(xyz, triangles, boundary)[0])
            numeric = (moved[0] - moved[1]) / 0.02
            assert numeric == pytest.approx(functional.gradient[k, axis], rel=1e-5, abs=1e-3)
    assert value == pytest.approx(functional.gradient[:, 2] @ pickets.xyz[:, 2], rel=1e-12)


def intersect(calibration, pickets, state, xy, basis):
    """Pickets from rays corrected for the parameters of `state`: Gauss–Newton written out, rays by rays."""
    u = calibration.system.unknowns
    row_of = {int(image): row for row, image in enumerate(u.images)}
    interior = u.interior(state)
    points = pickets.xyz - u.origin
    prediction, by_eo, by_in = np.empty(2), np.empty((2, 6)), np.empty((2, INTERIOR))
    for k in range(len(points)):
        rays = range(pickets.start[k], pickets.start[k + 1])
        for _ in range(6):
            a, gap = [], []
            for r in rays:
                i = row_of[int(pickets.image[r])]
                by_pt = np.empty((2, 3))
                linearise_ray(state.rotation[i], state.centre[i], points[k], interior[u.lens.of_image[i]], 0.0, 0.0,
                              prediction, by_eo, by_pt, by_in, INTERIOR)  # fmt: skip
                a.append(by_pt / pickets.sigma_mm[r])
                gap.append((xy[r] - basis[r] @ state.shared - prediction) / pickets.sigma_mm[r])
            points[k] += np.linalg.lstsq(np.concatenate(a), np.concatenate(gap), rcond=None)[0]
    return points + u.origin


def measured_now(calibration, pickets):
    """What the rays of the pickets measure at the solution, and the columns of the additional parameters there."""
    u, state = calibration.system.unknowns, calibration.solution.state
    row_of = {int(image): row for row, image in enumerate(u.images)}
    errors = restitution_of(calibration).errors[0]
    columns = shared_columns(calibration)
    xy, basis = np.empty((len(pickets.image), 2)), np.zeros((len(pickets.image), 2, len(state.shared)))
    interior = u.interior(state)
    for k in range(len(pickets)):
        for r in range(pickets.start[k], pickets.start[k + 1]):
            i = row_of[int(pickets.image[r])]
            predict_ray(state.rotation[i], state.centre[i], pickets.xyz[k] - u.origin,
                        interior[u.lens.of_image[i]], 0.0, 0.0, xy[r])  # fmt: skip
    basis[:, :, columns] = errors.partials(xy)
    return xy + np.einsum("nap,p->na", basis, state.shared), basis


@pytest.fixture(scope="module")
def numeric(calibration, hill):
    pickets, triangles, boundary = hill
    few = pickets.take(np.arange(60))
    gradient = tin_volume(pickets.xyz, triangles, boundary)[1].gradient[:60]
    return few, gradient, *measured_now(calibration, few)


def test_partials_by_orientation_and_parameters_are_the_numeric_ones(calibration, numeric):
    pickets, gradient, xy, basis = numeric
    state, system = calibration.solution.state, calibration.system
    response = respond(calibration, pickets, gradient)
    n, s = len(system.unknowns.images), len(system.unknowns.shared)

    def volume(images, shared):
        moved = system.unknowns.advance(state, Step(images, shared, np.zeros_like(state.points)))
        return float(np.sum(gradient * intersect(calibration, pickets, moved, xy, basis)))

    used = np.unique([int(np.flatnonzero(system.unknowns.images == i)[0]) for i in pickets.image])
    rng = np.random.default_rng(1)
    for _ in range(12):
        i, element = int(rng.choice(used)), int(rng.integers(6))
        step = np.zeros((n, 6))
        step[i, element] = 0.01 if element < 3 else 1e-5
        found = (volume(step, np.zeros(s)) - volume(-step, np.zeros(s))) / (2.0 * step[i, element])
        size = np.abs(response.unknowns[: 6 * n].reshape(-1, 6)[:, element]).max()
        assert found == pytest.approx(response.unknowns[6 * i + element], rel=2e-4, abs=1e-4 * size)
    for column in rng.choice(s, 14, replace=False):
        step = np.zeros(s)
        step[column] = 1e-4 / max(np.abs(basis[:, :, column]).max(), 1e-12)
        found = (volume(np.zeros((n, 6)), step) - volume(np.zeros((n, 6)), -step)) / (2.0 * step[column])
        # additional parameters go through nodes with bilinear values between them
        size = np.abs(response.unknowns[6 * n :] * step[column]).max()
        assert found * step[column] == pytest.approx(response.unknowns[6 * n + column] * step[column],
                                                     rel=2e-3, abs=1e-3 * size)  # fmt: skip


def point_cofactor(calibration, pickets, k):
    """(3, 3) m² of a picket intersected with orientation that is known."""
    u, state = calibration.system.unknowns, calibration.solution.state
    rows, interior = [], u.interior(state)
    prediction, by_eo, by_in = np.empty(2), np.empty((2, 6)), np.empty((2, INTERIOR))
    for r in range(pickets.start[k], pickets.start[k + 1]):
        i, by_pt = int(np.flatnonzero(u.images == pickets.image[r])[0]), np.empty((2, 3))
        linearise_ray(state.rotation[i], state.centre[i], pickets.xyz[k] - u.origin, interior[u.lens.of_image[i]],
                      0.0, 0.0, prediction, by_eo, by_pt, by_in, INTERIOR)  # fmt: skip
        rows.append(by_pt / pickets.sigma_mm[r])
    a = np.concatenate(rows)
    return np.linalg.inv(a.T @ a)


def test_variance_is_that_of_the_dense_inverse(calibration, hill):
    """cᵀQc with the columns of the inverse that c touches; and noise by dense normal equations of single pickets."""
    pickets, triangles, boundary = hill
    gradient = tin_volume(pickets.xyz, triangles, boundary)[1].gradient
    response = respond(calibration, pickets, gradient)
    factor = calibration.system.factorise(calibration.solution.equations)
    touched = np.flatnonzero(response.unknowns)
    q = factor.columns(touched)[touched]
    c = response.unknowns[touched]
    assert response.variance == pytest.approx(calibration.result.outcome.sigma0**2 * c @ q @ c, rel=1e-9)
    dense = 0.0
    for k in np.argsort(-np.abs(gradient[:, 2]))[:5]:
        one = respond(calibration, pickets.take(np.array([k])), gradient[k : k + 1])
        dense += one.noise
        assert one.noise == pytest.approx(gradient[k] @ point_cofactor(calibration, pickets, k) @ gradient[k], rel=1e-9)
    assert 0.0 < dense < response.noise


def test_two_functionals_and_their_sum(calibration, hill):
    """Var(a + b) = Var a + Var b + 2·Cov(a, b); noise adds up where the functionals share no picket."""
    pickets, triangles, boundary = hill
    gradient = tin_volume(pickets.xyz, triangles, boundary)[1].gradient
    left = pickets.xyz[:, 0] < np.median(pickets.xyz[:, 0])
    parts = [np.where(side[:, None], gradient, 0.0) for side in (left, ~left)]
    a, b, both = (respond(calibration, pickets, g) for g in (*parts, gradient))
    assert a.variance + b.variance + 2.0 * covariance(calibration, a, b) == pytest.approx(both.variance, rel=1e-9)
    assert a.noise + b.noise == pytest.approx(both.noise, rel=1e-9)


def test_mean_height_and_profile(calibration, hill):
    """σ of a mean height is that of the volume over the area; a single height has the noise of its picket."""
    pickets, triangles, boundary = hill
    functional = tin_volume(pickets.xyz, triangles, boundary)[1]
    volume = respond(calibration, pickets, functional.gradient)
    mean = respond(calibration, pickets, functional.gradient / boundary.area)
    assert np.sqrt(mean.variance) * boundary.area == pytest.approx(np.sqrt(volume.variance), rel=1e-9)
    at = pickets.xyz[5:6, :2]
    value, one = tin_heights(pickets.xyz, triangles, at, np.ones(1))
    assert value == pytest.approx(pickets.xyz[5, 2], abs=1e-6)
    assert np.flatnonzero(np.abs(one.gradient[:, 2]) > 1e-6).tolist() == [5]


def test_uncorrected_image_errors_of_one_point_are_the_deformation_of_its_model(calibration):
    """dZ of single points against the exact deformation, both variants; σ against that of the deformation."""
    restitution = {variant: restitution_of(calibration, variant) for variant in ("free", "absorbed")}
    models = {variant: pair_model(restitution[variant], ("left", "right"), (8, 9)) for variant in restitution}
    xyz = calibration.local.points.xyz
    seen = np.flatnonzero(np.isfinite(deform_points(models["free"], xyz).d[:, 2]))[:25]
    assert len(seen) > 10
    for variant, model in models.items():
        exact, q = deform_points(model, xyz[seen]).d, covariance_of(model, xyz[seen])
        for k, row in enumerate(seen):
            pickets = Pickets(xyz[row : row + 1], np.array([0, 2]), np.array([8, 9]), np.full(2, 0.003), np.ones(1))
            for axis in range(3):
                gradient = np.eye(3)[axis][None]
                found = systematic(calibration, respond(calibration, pickets, gradient), variant)
                assert found.value == pytest.approx(exact[k, axis], rel=0.02, abs=2e-3)
                assert found.sigma == pytest.approx(np.sqrt(q[k, axis, axis]), rel=0.05, abs=3e-4)


def test_a_million_cells(calibration):
    """Every cell takes part: the sum over cells is the volume of the boundary."""
    middle = np.nanmedian(calibration.result.points.xyz, axis=0)
    x, y = np.meshgrid(middle[0] + np.arange(-60.0, 60.0, 0.5), middle[1] + np.arange(60.0, -60.0, -0.5))
    xyz = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, middle[2])])
    pickets, seen = pickets_where_seen(calibration, xyz, 0.003)
    assert seen.all()
    gradient = np.zeros_like(xyz)
    gradient[:, 2] = 0.25
    fine = respond(calibration, pickets, gradient)
    coarse_xyz = xyz.reshape(240, 240, 3)[::8, ::8].reshape(-1, 3) + (1.75, -1.75, 0.0)
    coarse = np.zeros_like(coarse_xyz)
    coarse[:, 2] = 16.0
    few, _ = pickets_where_seen(calibration, coarse_xyz, 0.003, noise_share=np.full(len(coarse), 1 / 64))
    together = respond(calibration, few, coarse)
    assert together.variance == pytest.approx(fine.variance, rel=0.02)
    assert together.noise == pytest.approx(fine.noise, rel=0.02)


def test_every_place_has_as_many_photographs_as_it_was_measured_in(calibration):
    middle = np.nanmedian(calibration.result.points.xyz, axis=0)
    xyz = middle + np.random.default_rng(3).uniform(-40.0, 40.0, (60, 3)) * (1.0, 1.0, 0.0)
    most, _ = pickets_where_seen(calibration, xyz, 0.003, np.full(60, 20))
    available = np.diff(most.start)
    assert available.max() <= 8  # the nearest count, however many measured a cell
    assert available.max() > 2
    wanted = np.resize([0, 2, 3, 4], 60)
    pickets, seen = pickets_where_seen(calibration, xyz, 0.003, wanted)
    assert seen.all()
    np.testing.assert_array_equal(np.diff(pickets.start), np.minimum(np.maximum(wanted, 2), available))
    for n in range(60):
        own, all_of = (p.image[p.start[n] : p.start[n + 1]] for p in (pickets, most))
        np.testing.assert_array_equal(own, all_of[: len(own)])


def test_inner_datum_leaves_what_moves_the_block_out(hill):
    """In the inner datum the variance of a mean height is below that in a minimal one, and independent of the held
    coordinates: the S-transformation of the dense case."""
    block, _ = small_block(3, "bluh:1-12")
    results = {}
    for datum in ("minimal", "inner"):
        calibration = adjust_keeping_system(with_adjustment(block, datum=datum))
        middle = np.nanmedian(calibration.result.points.xyz, axis=0)
        xyz = middle + np.random.default_rng(2).uniform(-150.0, 150.0, (50, 3)) * (1.0, 1.0, 0.05)
        pickets, _ = pickets_where_seen(calibration, xyz, 0.003)
        gradient = np.zeros((len(pickets), 3))
        gradient[:, 2] = 1.0 / len(pickets)
        results[datum] = respond(calibration, pickets, gradient).variance
    assert 0.0 < results["inner"] < results["minimal"]


def test_response_to_control_is_numeric(calibration, hill):
    """Heights of control points moved by σ/3 and the block adjusted anew."""
    few = hill[0].take(np.arange(80))
    gradient = np.zeros((80, 3))
    gradient[:, 2] = 1.0 / 80
    response = respond(calibration, few, gradient)
    block, u = calibration.result.block, calibration.system.unknowns
    found = control_response(calibration, response)
    control = np.flatnonzero(~block.control.is_check)
    strongest = control[np.argsort([-abs(found[int(np.flatnonzero(u.points == p)[0]), 2])
                                    for p in block.control.point[control]])[:2]]  # fmt: skip
    xy, basis = measured_now(calibration, few)
    for k in strongest:
        heights = []
        for sign in (1.0, -1.0):
            xyz = block.control.xyz.copy()
            xyz[k, 2] += sign * 0.02
            again = adjust_keeping_system(replace(block, control=replace(block.control, xyz=xyz)))
            shift = again.system.unknowns.origin - u.origin
            state = again.solution.state
            state = replace(state, centre=state.centre + shift)
            heights.append(np.mean(intersect(calibration, few, state, xy, basis)[:, 2]))
        row = int(np.flatnonzero(u.points == block.control.point[k])[0])
        assert (heights[0] - heights[1]) / 0.04 == pytest.approx(found[row, 2], rel=0.02)


def test_a_point_whose_rays_do_not_meet_is_named_by_its_place(calibration, hill):
    """After sorting, or of a raster, its number says nothing."""
    pickets = hill[0]
    one = pickets.take(np.arange(3))
    image = np.concatenate(
        [one.image[: one.start[1]], np.repeat(one.image[one.start[1]], 2), one.image[one.start[2] :]]
    )
    count = [one.start[1], 2, len(one.image) - one.start[2]]
    wrong = replace(one, start=np.append(0, np.cumsum(count)), image=image, sigma_mm=np.full(len(image), 0.003))
    (x, y), name = one.xyz[1, :2], calibration.local.block.images.names[one.image[one.start[1]]]
    with pytest.raises(InputError) as error:
        respond(calibration, wrong, np.ones((3, 3)))
    assert f"X {x:.2f}, Y {y:.2f}" in str(error.value)
    assert f"'{name}', '{name}'" in str(error.value)


def test_a_volume_without_points_responds_to_nothing(calibration, hill):
    """As of piles whose fills have no height each: no measurement has a weight in their sum."""
    pickets = hill[0]
    nothing = respond(calibration, pickets.take(np.arange(0)), np.zeros((0, 3)))
    assert (nothing.variance, nothing.model, nothing.noise, nothing.error) == (0.0, 0.0, 0.0, 0.0)
    assert not nothing.unknowns.any()
    assert nothing.by_orientation.shape == (len(calibration.system.unknowns.images), 6)
    measured = Measured(pickets, np.zeros((len(pickets), 3)))
    part = Part(calibration, nothing, None, len(pickets), len(pickets.image), 0.0, measured)
    for found in (summed_part([part, part], True), difference_part(summed_part([part], True), part, True)[0]):
        assert found.response.variance == 0.0
        assert found.lasting_variance == 0.0
