"""Totals with the model part: functions of the unknowns, joint covariances, interior orientation, deformation."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from aerotri.deformation.restitution import restitution_of, sigma_in_words
from aerotri.formats.results.adjustment import adjustment_json, image_columns, parameter_columns, point_columns
from aerotri.image_errors import interior_elements, interior_model_sigmas, systematic_errors
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.public.covariance import covariance_of
from aerotri.report.tables.adjustment import cameras, weak_points
from aerotri.statistics.cluster_influence import known_part
from aerotri.statistics.covariance import cofactors
from aerotri.statistics.model_of_functions import known_root, model_of_functions
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.response import respond
from small_blocks import with_adjustment
from statistics_blocks import drone_block


@pytest.fixture(scope="module")
def moving():
    """A block whose lens errors change from strip to strip."""
    return adjust_keeping_system(drone_block(1, 2.0)[0])


@pytest.fixture(scope="module")
def resting():
    """The same without such errors."""
    return adjust_keeping_system(drone_block(1)[0])


def _functions(found):
    """Orientation of one photograph and all shared parameters as functions of the unknowns."""
    u = found.system.unknowns
    n = 6 * len(u.images)
    columns = np.concatenate([np.arange(6 * 20, 6 * 21), n + np.arange(len(u.shared))])
    c = np.zeros((n + len(u.shared), len(columns)))
    c[columns, np.arange(len(columns))] = 1.0
    return c, found.system.factorise(found.solution.equations).solve(c.copy())


def test_functions_that_are_unknowns_have_the_model_part_of_the_unknowns(moving):
    """The same noise is taken off: exactly here, by random sums in the tables."""
    c, solved = _functions(moving)
    found = model_of_functions(moving.system, moving.solution, moving.model, c[:, :3], solved[:, :3], 3)[0]
    expected = moving.local.images.model[moving.system.unknowns.images[20], :3, :3]
    assert found == pytest.approx(expected, rel=0.05, abs=0.05 * np.abs(expected).max())
    one = model_of_functions(moving.system, moving.solution, moving.model, c[:, :3], solved[:, :3])
    assert one.shape == (3, 1, 1)
    assert (one.ravel() <= np.diagonal(found) * (1.0 + 1e-9)).all()


def test_what_control_explains(moving):
    """CᵀQ·N_0·QC of the shared parameters is that of the tables, summed over all columns of the root of N_0."""
    system, solution = moving.system, moving.solution
    c, solved = _functions(moving)
    own = known_root(system, solution, solved)[:, 6:]
    expected = known_part(system, solution, system.factorise(solution.equations), most=10_000)[1]
    assert own.T @ own == pytest.approx(expected, rel=1e-6, abs=1e-9 * np.abs(expected).max())
    q = cofactors(system, solution.state, system.factorise(solution.equations), solution.estimator)
    assert (c.T @ solved)[6:, 6:] == pytest.approx(q.shared, rel=1e-6, abs=1e-9 * np.abs(q.shared).max())


def test_joint_covariance_has_the_totals_of_the_tables(moving):
    block, parameters = moving.result.block, moving.result.parameters
    names = [str(block.points[0]), f"{block.points[1]}:Z", str(block.images.names[20]), "brown.K1"]
    found = covariance_of(moving, names)
    assert found.total_sigma[:3] == pytest.approx(moving.result.points.total_sigma[0], rel=1e-9)
    assert found.total_sigma[3] == pytest.approx(moving.result.points.total_sigma[1, 2], rel=1e-9)
    assert found.total_sigma[4:10] == pytest.approx(moving.result.images.total_sigma[20], rel=1e-9)
    row = int(np.flatnonzero(parameters.names == names[-1])[0])
    assert found.total_sigma[-1] == pytest.approx(parameters.total_sigma[row], rel=1e-9)
    assert found.sigma[:3] == pytest.approx(moving.result.points.sigma[0], rel=1e-9)
    assert np.linalg.eigvalsh(found.model / np.outer(found.total_sigma, found.total_sigma)).min() > -1e-9
    assert "total σ" in found._repr_html_()


def test_interior_orientation_and_tables_have_totals(moving):
    block, camera = moving.result.block, moving.result.block.cameras[0]
    entry = adjustment_json(moving.result)["cameras"][0]
    model, sigma = interior_model_sigmas(moving.result, camera), interior_elements(moving.result, camera)[1]
    for k, name in enumerate(("focal_length_mm", "x0_mm", "y0_mm")):
        assert entry[f"m_{name}"] == pytest.approx(model[k])
        assert entry[f"t_{name}"] == pytest.approx(np.hypot(model[k], sigma[k]))
    assert "total σ" in [column.name for column in cameras(moving.result).columns]
    assert "total σZ" in [column.name for column in weak_points(moving.result).columns]
    assert len(block.cameras) == 1


def test_volume_has_a_part_of_the_model(moving, resting, monkeypatch):
    """How much higher the middle of the block is than its border; the part is the model part of the functional.

    But for what all photographs of the camera share, which is a part of its own.
    """
    monkeypatch.setattr(import_module("aerotri.volume.response"), "known_field", lambda _: None)
    for found in (moving, resting):
        xy = found.result.points.xyz[::40]
        pickets, seen = pickets_where_seen(found, xy, 1e-3)
        gradient = np.zeros((int(seen.sum()), 3))
        out = np.sum((xy[seen] - xy[seen].mean(axis=0))[:, :2] ** 2, axis=1)
        gradient[:, 2] = (out.mean() - out) / np.abs(out - out.mean()).sum()
        response = respond(found, pickets, gradient)
        assert (response.model > 0.0) == (found is moving)
        if found is moving:
            expected = model_of_functions(
                found.system, found.solution, found.model, response.unknowns[:, None], response.solved[:, None]
            )
            assert response.model == pytest.approx(float(expected[0, 0, 0]))


def test_deformation_and_image_errors_use_totals_and_say_why(moving, resting):
    restitution, plain = restitution_of(moving), restitution_of(resting)
    rows = np.flatnonzero(moving.local.parameters.kinds == "additional")
    p = moving.local.parameters
    assert restitution.covariance == pytest.approx((p.covariance + p.model)[np.ix_(rows, rows)])
    assert "from strip to strip" in sigma_in_words(restitution.variant, restitution.change)
    assert plain.change == ""
    group = str(p.groups[rows[0]])
    xy = np.array([10.0, -12.0]), np.array([5.0, 9.0])
    total = systematic_errors(moving.result, group, *xy)[1]
    noise = systematic_errors(
        replace(moving.result, parameters=replace(moving.result.parameters, model=None)), group, *xy
    )[1]
    assert (np.diagonal(total, axis1=1, axis2=2) > np.diagonal(noise, axis1=1, axis2=2)).all()


def test_without_moving_errors_nothing_changes(resting):
    """No model part is found: what `model_part = "off"` gives, to the last digit."""
    block = drone_block(1)[0]
    off = adjust_keeping_system(with_adjustment(block, model_part="off"))
    assert resting.model is None
    assert off.model is None
    for columns in (point_columns, image_columns, parameter_columns):
        one, other = columns(resting.result), columns(off.result)
        assert list(one) == list(other)
        for name in one:
            assert np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f"), name
    assert adjustment_json(resting.result)["cameras"] == adjustment_json(off.result)["cameras"]
    assert covariance_of(resting, [str(block.points[0])]).model is None
