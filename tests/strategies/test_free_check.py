"""Tie points or control: the verdict on planted errors, and the distribution of the test where there are none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from aerotri.diagnosis.free_verdict import in_words, suspect_text
from aerotri.pipeline import adjust
from aerotri.strategies.free_check import check_free, free_block
from aerotri.strategies.free_stages import CONTROL, FREE, POSITIONS
from small_blocks import small_block, with_adjustment

GNSS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.0, 0.0, 0.0], "lever_arm_m": [0.2, -0.3, 1.1]}}


@pytest.fixture(scope="module")
def block():
    return small_block(1, "bluh:1-4")[0]


@pytest.fixture(scope="module")
def flown():
    """With observed positions that need no shift."""
    found = small_block(2, **GNSS)[0]
    return replace(found, settings=replace(found.settings, gnss=replace(found.settings.gnss, shift="off")))


def moved_control(block, number, axis, metres):
    xyz = block.control.xyz.copy()
    row = np.flatnonzero(~block.control.is_check)[number]
    xyz[row, axis] += metres
    name = str(block.points[block.control.point[row]])
    return replace(block, control=replace(block.control, xyz=xyz)), name


def with_image_points(block, **changes):
    return replace(block, image_points=replace(block.image_points, **changes))


def test_clean_block_fits(block):
    check = check_free(block, adjust)
    assert check.verdict == "fits"
    assert [stage.name for stage in check.stages] == [FREE, CONTROL]
    assert check.stages[1].added == int(np.isfinite(check.similarity.residual).sum())
    assert check.stages[1].redundancy - check.stages[0].redundancy == check.stages[1].added - 7
    assert check.stages[1].suspects == ()
    assert check.similarity.redundancy == check.stages[1].added - 7
    assert np.nanmax(np.abs(check.similarity.residual)) < 0.5
    assert "The control fits the tie points" in in_words(check)


def test_growth_is_as_fisher_says():
    """Over 8 clean blocks Σ ratio·Δr follows χ² of ΣΔr (r_free is large); the a-priori σ are right."""
    total = freedom = 0.0
    for seed in range(40, 48):
        stages = check_free(small_block(seed, "bluh:1-4")[0], adjust).stages
        added = stages[1].redundancy - stages[0].redundancy
        total, freedom = total + stages[1].ratio * added, freedom + added
    assert chi2.ppf(0.0005, freedom) < total < chi2.ppf(0.9995, freedom)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_one_control_point_off_by_a_metre(block, axis):
    bad, name = moved_control(block, 3, axis, 1.0)
    check = check_free(bad, adjust)
    assert check.verdict == "control"
    first = check.stages[1].suspects[0]
    assert (first.kind, first.name, first.component) == ("control", name, "XYZ"[axis])
    assert first.error == pytest.approx(1.0, abs=0.4)
    assert check.stages[0].sigma0 == pytest.approx(1.0, abs=0.1)
    assert f"Look first at {name}: given {'XYZ'[axis]} too large by" in in_words(check)


def test_gross_errors_in_rays(block):
    rng = np.random.default_rng(0)
    xy = block.image_points.xy.copy()
    rows = rng.choice(len(xy), 20, replace=False)
    xy[rows] += rng.choice([-1.0, 1.0], (20, 2)) * 0.06
    check = check_free(with_image_points(block, xy=xy), adjust)
    assert check.verdict == "tie points"
    assert check.tie_points_poor
    assert check.beyond >= 15
    points = {str(block.points[block.image_points.point[row]]) for row in rows}
    assert {suspect.name.split(" in ")[0] for suspect in check.stages[0].suspects} <= points
    assert "The tie points themselves do not fit" in in_words(check)


def test_both_wrong(block):
    xy = block.image_points.xy.copy()
    xy[::60, 0] += 0.05
    bad, _ = moved_control(with_image_points(block, xy=xy), 3, 0, 5.0)
    check = check_free(bad, adjust)
    assert check.verdict == "both"


@pytest.mark.parametrize("factor", [3.0])
def test_control_counts_in_metres_whatever_the_image_sigma(block, factor):
    """A wrong a-priori σ of the image points moves σ̂0, not the verdict on control."""
    bad, name = moved_control(block, 3, 0, 1.0)
    for one in (block, bad):
        right = check_free(one, adjust)
        wrong = check_free(with_image_points(one, sigma=factor * one.image_points.sigma), adjust)
        assert wrong.stages[0].sigma0 == pytest.approx(right.stages[0].sigma0 / factor, rel=1e-3)
        assert wrong.stages[1].ratio == pytest.approx(right.stages[1].ratio, rel=2e-3)
        assert wrong.stages[1].fits == right.stages[1].fits
    assert wrong.stages[1].suspects[0].name == name


def test_height_only_and_plan_only_control(block):
    control = block.control
    xyz, sigma = control.xyz.copy(), control.sigma.copy()
    own = np.flatnonzero(~control.is_check)
    for row, axes in ((own[0], [0, 1]), (own[1], [2])):
        xyz[row, axes], sigma[row, axes] = np.nan, np.nan
    check = check_free(replace(block, control=replace(control, xyz=xyz, sigma=sigma)), adjust)
    assert check.verdict == "fits"
    assert check.similarity.redundancy == check.stages[1].added - 7
    assert np.isnan(check.similarity.residual).sum() == 3


def test_positions_off_together_are_named_as_such(flown):
    assert check_free(flown, adjust).verdict == "fits"
    raised = replace(flown, gnss_ins=replace(flown.gnss_ins, xyz=flown.gnss_ins.xyz + [0.0, 0.0, 1.0]))
    check = check_free(raised, adjust)
    assert check.verdict == "positions"
    assert [stage.fits for stage in check.stages[1:]] == [True, False]
    np.testing.assert_allclose(check.position_offset, [0.0, 0.0, 1.0], atol=0.1)
    assert "On average they lie" in in_words(check)
    assert "Look first at" not in in_words(check), "control that fitted the tie points is not to blame"


def test_one_position_off_is_named(flown):
    xyz = flown.gnss_ins.xyz.copy()
    xyz[5, 1] += 2.0
    check = check_free(replace(flown, gnss_ins=replace(flown.gnss_ins, xyz=xyz)), adjust)
    name = str(flown.images.names[flown.gnss_ins.image[5]])
    first = check.stages[-1].suspects[0]
    assert (first.kind, first.name, first.component) == ("projection centres", name, "Y")
    assert f"Look first at {name}: observed Y too large by" in in_words(check)


def test_positions_without_control(flown):
    check_only = replace(flown, control=replace(flown.control, is_check=np.ones(len(flown.control), dtype=bool)))
    check = check_free(check_only, adjust)
    assert [stage.name for stage in check.stages] == [FREE, POSITIONS]
    assert check.verdict == "fits"
    assert check.similarity is None


def test_what_only_holds_is_not_tested(block):
    """Seven coordinates of control: nothing is gained, nothing tested."""
    control = block.control
    own = np.flatnonzero(~control.is_check)
    xyz, sigma = control.xyz.copy(), control.sigma.copy()
    is_check = np.ones(len(control), dtype=bool)
    # first and third corner whole, another one in height
    is_check[own[[0, 2, -1]]] = False
    xyz[own[-1], :2], sigma[own[-1], :2] = np.nan, np.nan
    check = check_free(replace(block, control=replace(control, xyz=xyz, sigma=sigma, is_check=is_check)), adjust)
    assert check.verdict == "not tested"
    assert "Nothing tests the control" in in_words(check)
    assert check.stages[1].redundancy == check.stages[0].redundancy


def test_too_little_control_says_so_and_keeps_the_free_result(block):
    is_check = np.ones(len(block.control), dtype=bool)
    is_check[np.flatnonzero(~block.control.is_check)[0]] = False
    check = check_free(replace(block, control=replace(block.control, is_check=is_check)), adjust)
    assert check.verdict == "control"
    assert check.stages[0].status == "converged"
    assert check.stages[1].status == "rank deficient"
    assert "has no result (rank deficient" in in_words(check)


def test_no_free_block(block):
    """Two photographs that share four points only: nothing free about it."""
    rays = block.image_points
    common = np.intersect1d(rays.point[rays.image == 0], rays.point[rays.image == 1])
    keep = np.isin(rays.image, [0, 1]) & np.isin(rays.point, common[:4])
    few = replace(block, image_points=replace(rays, image=rays.image[keep], point=rays.point[keep], xy=rays.xy[keep],
                                              sigma=rays.sigma[keep]))  # fmt: skip
    check = check_free(with_adjustment(few, additional_parameters=()), adjust)
    assert check.verdict == "failed"
    assert "give no block" in in_words(check)


def test_full_adjustment_is_used_where_it_is_the_same(block):
    calls = []

    def counted(one):
        calls.append(one)
        return adjust(one)

    full = adjust(block)
    check = check_free(block, counted, full)
    assert check.sigma0_full == full.outcome.sigma0
    scale = check.stages[0].sigma0
    assert len(calls) == (1 if abs(scale - 1.0) < 0.01 else 2)


def test_free_block_is_held_by_nothing(flown):
    free = free_block(flown)
    assert free.gnss_ins is None
    assert free.settings.adjustment.datum == "minimal"
    assert np.isfinite(free.images.centre).all()


def test_suspects_in_words(block):
    bad, name = moved_control(block, 2, 1, -0.8)
    text = suspect_text(check_free(bad, adjust).stages[1].suspects[0])
    assert text.startswith(f"{name}: given Y too small by 0.")
    assert " m (w " in text


def test_robust_weights_are_the_same_in_every_stage(block):
    """Gross errors turned down do not disturb the test of control: clean control fits, a wrong point is named."""
    rng = np.random.default_rng(5)
    xy = block.image_points.xy.copy()
    rows = rng.choice(len(xy), len(xy) // 20, replace=False)
    xy[rows] += rng.choice([-1.0, 1.0], (len(rows), 2)) * 0.03
    robust = with_adjustment(with_image_points(block, xy=xy), robust="huber")
    check = check_free(robust, adjust, adjust(robust))
    assert check.robust
    assert check.verdict == "tie points"
    assert check.stages[1].ratio < check.stages[1].limit
    bad, name = moved_control(robust, 3, 0, 1.0)
    wrong = check_free(bad, adjust)
    assert wrong.verdict == "both"
    assert wrong.stages[1].suspects[0].name == name
