"""The cross-check agrees where ours is right, on simulated blocks of every kind and on real data."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.crosscheck import LIMIT, crosscheck
from aerotri.crosscheck import paper_check as paper_check_module
from aerotri.crosscheck.freed import as_adjusted, used_rays
from aerotri.crosscheck.outcome_json import crosscheck_json
from aerotri.crosscheck.paper_block import paper_block
from aerotri.crosscheck.paper_check import check_with_paper
from aerotri.crosscheck.paper_system import solve_normal_equations
from aerotri.formats.foreign.dbat import read_dbat
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Prior
from aerotri.observations.block import Edits
from aerotri.pipeline import adjust, adjust_keeping_system
from aerotri.report.plots.crosscheck import crosscheck_table, plot_crosscheck
from small_blocks import small_block, with_adjustment

ALL = "bluh:1-12,ultracam_d:42-73"


def assert_agrees(check, count=None):
    assert check.status == "agrees", check.reason
    assert check.max < LIMIT
    assert abs(check.vtpv_difference) < 1e-9
    if count is not None:
        assert (check.observations, check.unknowns) == count


def with_interior(block, **priors):
    camera = block.cameras[0]
    return replace(block, cameras=(replace(camera, interior={**camera.interior, **priors}),))


@pytest.fixture(scope="module")
def adjusted():
    return adjust(small_block(1, ALL)[0])


def test_self_calibrated_block_agrees_both_ways(adjusted):
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    result = crosscheck(adjusted, adjust)
    colmap, paper = result.checks
    assert_agrees(paper, (adjusted.outcome.observations, adjusted.outcome.unknowns))
    assert {d.kind for d in paper.differences} == {
        "projection centres", "orientation angles", "object points", "additional parameters",
    }  # fmt: skip
    assert next(d for d in paper.differences if d.kind == "additional parameters").count == 44
    assert_agrees(colmap)
    assert colmap.covariance is not None
    assert colmap.covariance.sigma < 1e-6
    assert colmap.covariance.correlation < 1e-6
    assert result.verdict == "agrees"
    assert result.sentence.startswith("agrees — pycolmap: max |Δ|/σ")


def test_without_pyceres_the_independent_model_is_solved_by_scipy(adjusted, monkeypatch):
    monkeypatch.setattr(paper_check_module, "_solve", solve_normal_equations)
    check = check_with_paper(adjusted, adjust)
    assert_agrees(check)
    assert check.solver == "SciPy"
    assert any("pyceres" in note for note in check.notes)


@pytest.mark.parametrize("datum", ["minimal", "inner"])
def test_free_blocks_agree(datum):
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    block = with_adjustment(small_block(2, "bluh:1-4")[0], datum=datum)
    result = crosscheck(adjust(block), adjust)
    for check in result.checks:
        assert_agrees(check)
    assert result.checks[0].covariance.sigma < 1e-5


def test_freed_camera_and_brown_with_other_angles():
    """c, x0, y0 and Brown's parameters free, weighted and not; phi-omega-kappa; single σ."""
    changes = {
        "rotation": "phi-omega-kappa",
        "camera": {"p1": {"preset": "p1", "errors": {"brown": {"K1": 5e-6, "P1": 3e-6}}}},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 80.0, "wavelength_m": 400.0},
    }
    block, _ = small_block(3, "brown:K1+K2+P1+P2+b1", **changes)
    block = with_interior(block, focal_length_mm=Prior(35.02, 0.05), x0_mm=Prior(0.0), y0_mm=Prior(0.01))
    sigma = block.image_points.sigma * np.random.default_rng(3).uniform(0.5, 2.0, block.image_points.sigma.shape)
    block = replace(block, image_points=replace(block.image_points, sigma=sigma))
    result = adjust(block)
    check = check_with_paper(result, adjust)
    assert_agrees(check, (result.outcome.observations, result.outcome.unknowns))
    assert {"interior orientation", "additional parameters"} < {d.kind for d in check.differences}


def test_forward_lens_is_colmaps_own():
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    errors = {"lens": {"k1": -0.05, "k2": 0.01, "p1": 1e-4, "p2": -2e-4}}
    block, _ = small_block(4, "lens:k1+k2+p1+p2", camera={"p1": {"preset": "p1", "errors": errors}})
    result = crosscheck(adjust(block), adjust)
    for check in result.checks:
        assert_agrees(check)
    assert "COLMAP's own model" in result.checks[0].notes[0]


def test_observed_projection_centres_with_lever_arm_shift_and_drift():
    gnss = {
        "sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.5, 0.5, 0.5], "drift_sigma_m_s": [1e-3, 1e-3, 1e-3],
        "lever_arm_m": [0.2, -0.3, 1.1],
    }  # fmt: skip
    result = adjust(small_block(5, "bluh:1-2", gnss=gnss)[0])
    check = check_with_paper(result, adjust)
    assert_agrees(check, (result.outcome.observations, result.outcome.unknowns))
    assert next(d for d in check.differences if d.kind == "GNSS shifts and drifts").count == 24


def test_robust_adjustment_is_checked_with_its_final_weights():
    gross = {"fraction": 0.03, "range_sigma": [10.0, 60.0]}
    block = with_adjustment(small_block(6, gross_errors=gross)[0], robust="huber")
    check = check_with_paper(adjust(block), adjust)
    assert_agrees(check)
    assert "final weights" in check.notes[0]


def test_photographs_taken_at_the_singularity_of_the_angles():
    """A block turned so that φ = 90°: the independent model puts a constant rotation behind its angles."""
    block, _ = small_block(7)
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    rotation = turn @ rotation_from_angles(block.images.angles)
    images = replace(block.images, centre=block.images.centre @ turn.T, angles=angles_from_rotation(rotation))
    control = replace(block.control, xyz=block.control.xyz @ turn.T, sigma=np.full_like(block.control.sigma, 0.03))
    check = check_with_paper(adjust(replace(block, images=images, control=control)), adjust)
    assert_agrees(check)


def test_what_has_no_independent_formula_is_said(adjusted):
    refracted = replace(adjusted.block, settings=replace(adjusted.block.settings, refraction="standard"))
    unknown_family = with_adjustment(adjusted.block, additional_parameters=(("collocation", ("2x2_x_0_0",)),))
    for block, word in ((refracted, "refraction"), (unknown_family, "collocation.2x2_x_0_0")):
        check = check_with_paper(replace(adjusted, block=block), adjust)
        assert check.status == "not available"
        assert word in check.reason


def test_block_in_a_crs_with_refraction():
    """Checked in the frame of its adjustment, its image points freed of what the peers do not know."""
    block, _ = small_block(8, "bluh:1-4")
    shift = np.array([400000.0, 5500000.0, 0.0])
    images = replace(block.images, centre=block.images.centre + shift)
    control = replace(block.control, xyz=block.control.xyz + shift)
    settings = replace(block.settings, refraction="standard")
    block = replace(block, images=images, control=control, settings=settings, crs="EPSG:25832")
    adjustment = adjust_keeping_system(block)
    checkable = as_adjusted(adjustment.local, adjustment.system.unknowns.block)
    for check in crosscheck(checkable, adjust).checks:
        if check.compared:
            assert_agrees(check)


def test_a_parameter_that_was_removed_stays_out():
    """As a selection would leave it: still among the parameters, with status 'removed'."""
    result = adjust(small_block(10, "bluh:1-4")[0])
    fewer = adjust(with_adjustment(result.block, additional_parameters=(("bluh", ("1", "2", "4")),)))
    p, rows = result.parameters, np.array([0, 1, 3])
    value, status, covariance = np.zeros(4), p.status.copy(), np.full((4, 4), np.nan)
    value[rows], status[2] = fewer.parameters.value, "removed"
    covariance[np.ix_(rows, rows)] = fewer.parameters.covariance
    parameters = replace(p, value=value, status=status, covariance=covariance)
    check = check_with_paper(replace(fewer, block=result.block, parameters=parameters), adjust)
    assert_agrees(check, (fewer.outcome.observations, fewer.outcome.unknowns))


def test_the_operators_decisions_count():
    """Control taken out, and a check point made control, in the independent model alone: seen in the observations."""
    block, _ = small_block(9)
    result = adjust(block)
    first, check_point = int(block.control.point[0]), int(block.control.point[block.control.is_check][0])
    texts = np.array(["off", "control"]), np.array(["", ""])
    edits = Edits(np.array([-1, -1]), np.array([first, check_point]), *texts)
    paper = paper_block(replace(block, edits=edits), used_rays(result), np.ones(len(block.image_points)), np.zeros(3))
    rows = {int(p): k for k, p in enumerate(paper.points)}
    assert not paper.point_inv_sigma[rows[first]].any()
    assert paper.point_inv_sigma[rows[check_point]].all()


def test_table_plot_and_json(adjusted):
    result = crosscheck(adjusted, adjust)
    table = crosscheck_table(result)
    assert len(table) >= 5
    assert all(row[-1] in ("agrees", "not available") for row in table.rows)
    figure = plot_crosscheck(result)
    assert len(figure.axes) == sum(bool(check.differences) for check in result.checks)
    content = crosscheck_json(result)
    assert content["verdict"] == "agrees"
    assert content["checks"][1]["differences"][0]["max"] < LIMIT
    assert len(content["checks"]) == 2


def test_strasbourg(shared_data):
    """Real data, two classes of σ, a control point seen once (targets.md 1)."""
    result = adjust(read_dbat(shared_data("dbat_sxb")))
    check = check_with_paper(result, adjust)
    assert_agrees(check, (2434, 1173))
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    from aerotri.crosscheck.colmap_check import check_with_colmap

    colmap = check_with_colmap(result, adjust)
    assert_agrees(colmap)
    assert colmap.covariance.agrees
    assert any("one σ" in note for note in colmap.notes)
