"""The verdict: faultless blocks pass it, worthless ones do not."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from aerotri.commands.adjust import run_adjust
from aerotri.commands.diff import run_diff
from aerotri.diagnosis import findings, judge
from aerotri.diagnosis.finding import SIGNIFICANCE
from aerotri.diagnosis.verdict import RULES
from aerotri.formats.block.folder import write_block
from aerotri.pipeline import AdjustmentFailedError, adjust, adjust_keeping_system
from aerotri.report.pages.adjustment import report_html
from aerotri.results.adjusted_block import Outcome
from small_blocks import small_block
from ten_photographs import (
    ten_photographs,
    with_attitudes,
    with_control,
    with_focal_length,
    with_image_points,
    with_kappa_turned,
    with_names_rotated,
    with_positions,
    with_strips_apart,
    without_start_values,
)

SEEDS = 30


def with_few_control(seed):
    """Three control points, the others check points: they share the errors of the three."""
    block = ten_photographs(seed, navigated=False)
    control = replace(block.control, is_check=np.arange(len(block.control)) >= 3)
    return replace(block, control=control)


def with_gnss_alone(seed):
    """All control as check points: they share the errors of GNSS."""
    block = ten_photographs(seed)
    return replace(block, control=replace(block.control, is_check=np.full(len(block.control), True)))


FAULTLESS = {
    "GNSS, INS and control": ten_photographs,
    "control": lambda seed: ten_photographs(seed, navigated=False),
    "three control points": with_few_control,
    "GNSS and INS": with_gnss_alone,
    "no start values": lambda seed: without_start_values(ten_photographs(seed, navigated=False)),
}


@pytest.mark.parametrize("make", FAULTLESS.values(), ids=FAULTLESS)
def test_faultless_blocks_are_accepted(make):
    """None of 30 is rejected, and no more doubtful than the rules' probability of error; 2 s on an idle processor."""
    verdicts = [adjust(make(seed)).outcome.verdict for seed in range(SEEDS)]
    assert verdicts.count("rejected") == 0
    assert verdicts.count("doubtful") <= binom.ppf(0.999, SEEDS, len(RULES) * SIGNIFICANCE)


def first_lifted(xyz):
    """One control point 10 m too high."""
    return xyz + [0.0, 0.0, 10.0] * (np.arange(len(xyz)) == 0)[:, None]


def doubled(xyz):
    """Two control points at one place."""
    return xyz[[0, 0, *range(2, len(xyz))]]


def gon_for_degrees(angles):
    return angles * 10.0 / 9.0


def controlled(seed):
    return ten_photographs(seed, navigated=False)


def free(seed):
    return without_start_values(controlled(seed))


REJECTED = {
    "x and y of one photograph negated": lambda s: with_image_points(ten_photographs(s), 3, lambda xy: -xy),
    "all x mirrored": lambda s: with_image_points(ten_photographs(s), None, lambda xy: xy * [-1.0, 1.0]),
    "focal length over ten": lambda s: with_focal_length(ten_photographs(s), 0.1),
    "positions shifted by one": lambda s: with_positions(ten_photographs(s), lambda xyz: np.roll(xyz, 1, axis=0)),
    "two control points at one place": lambda s: with_control(ten_photographs(s), doubled),
    "control below the ground": lambda s: with_control(ten_photographs(s), lambda xyz: xyz * [1.0, 1.0, -1.0]),
    "gon for degrees": lambda s: with_attitudes(ten_photographs(s), gon_for_degrees),
    "GNSS 10 m too high": lambda s: with_positions(ten_photographs(s), lambda xyz: xyz + [0.0, 0.0, 10.0]),
    "names of one photograph rotated": lambda s: with_names_rotated(ten_photographs(s), 4),
    "strips without a common point": lambda s: with_strips_apart(free(s)),
    "control twice, no start values": lambda s: with_control(free(s), doubled),
}
NOT_ACCEPTED = {
    "one control point 10 m off": lambda s: with_control(controlled(s), first_lifted),
    "one of control and GNSS 10 m off": lambda s: with_control(ten_photographs(s), first_lifted),
    "focal length + 10 %": lambda s: with_focal_length(controlled(s), 1.1),
    "names rotated, no start values": lambda s: with_names_rotated(free(s), 4),
}


def outcome_of(block) -> Outcome:
    try:
        return adjust(block).outcome
    except AdjustmentFailedError as failure:
        return failure.outcome


@pytest.mark.parametrize("name", [*REJECTED, *NOT_ACCEPTED])
def test_worthless_blocks_are_not_accepted(name):
    """Everything that converged without a word before; each with a reason."""
    for seed in (1, 2):
        outcome = outcome_of((REJECTED | NOT_ACCEPTED)[name](seed))
        assert outcome.verdict == "rejected" or (name in NOT_ACCEPTED and outcome.verdict == "doubtful")
        assert outcome.reasons
        assert all(outcome.reasons)


@pytest.mark.parametrize("made", [ten_photographs, controlled])
def test_kappa_turned_as_a_start_is_replaced_or_told(made):
    """Tie points tell start angles that are wrong; observed angles that are wrong stay a reason."""
    outcome = outcome_of(with_kappa_turned(made(1)))
    said = " ".join((*outcome.warnings, *outcome.reasons, outcome.message))
    assert "kappa" in said


def test_strips_that_gnss_and_ins_hold_need_no_common_point():
    assert adjust(with_strips_apart(ten_photographs())).outcome.verdict == "accepted"


def shifted(block, shift):
    gnss = replace(block.settings.gnss, shift=shift)
    return replace(block, settings=replace(block.settings, gnss=gnss))


def test_a_shift_of_gnss_beyond_its_sigma_is_a_reason():
    """As is what it hangs on; the same positions without a shift speak by their residuals."""
    block = with_positions(ten_photographs(), lambda xyz: xyz + [0.0, 0.0, 10.0])
    outcome = adjust(shifted(with_focal_length(block, 1.0, sigma=0.05), "block")).outcome
    assert outcome.verdict == "doubtful"
    assert any("GNSS shift in Z (block) is +9." in reason for reason in outcome.reasons)
    assert any("its correlation with the principal distance is" in reason for reason in outcome.reasons)
    assert adjust(shifted(ten_photographs(), "block")).outcome.verdict == "accepted"


def test_a_free_principal_distance_far_from_the_stated_one_is_doubtful():
    """24 for 35 mm with shifts to take it up: everything fits."""
    block = with_focal_length(ten_photographs(), 24.0 / 35.0, sigma=None)
    outcome = adjust(shifted(block, "strip")).outcome
    assert outcome.sigma0 < 1.1
    assert outcome.verdict != "accepted"
    assert any("nothing holds it" in reason for reason in outcome.reasons)
    near = with_focal_length(ten_photographs(), 0.97, sigma=None)
    assert adjust(near).outcome.verdict == "accepted"


def test_a_weighted_principal_distance_is_held_against_its_sigma():
    block = with_focal_length(ten_photographs(), 1.003, sigma=0.01)
    outcome = adjust(block).outcome
    assert any("focal_length_mm of camera ucd changed" in reason for reason in outcome.reasons)


def test_a_held_control_point_that_is_wrong_is_named():
    """σ = 0 leaves no residual: its reason is what the other observations say of it."""
    block = with_control(ten_photographs(), lambda xyz: xyz + [0.0, 0.0, 0.8] * (np.arange(len(xyz)) == 2)[:, None])
    block = replace(block, control=replace(block.control, sigma=np.zeros_like(block.control.sigma)))
    reasons = " ".join(adjust(block).outcome.reasons)
    assert "Z of control point C03 disagrees with the rest by -0." in reasons


def test_the_worst_single_observation_is_named():
    def one_off(xyz):
        return xyz + [1.0, 0.0, 0.0] * (np.arange(len(xyz)) == 6)[:, None]

    block = with_positions(ten_photographs(), one_off)
    reasons = adjust(block).outcome.reasons
    assert any(f"X of the position of photograph {block.images.names[6]} disagrees" in reason for reason in reasons)


def test_rays_without_weight_count_as_gross_errors():
    adjusted = adjust(ten_photographs())
    for share, verdict in ((0.1, "accepted"), (0.2, "doubtful"), (0.5, "rejected")):
        weight = np.where(np.arange(len(adjusted.rays.weight)) % 10 < 10 * share, 0.05, 1.0)
        found = judge(replace(adjusted, rays=replace(adjusted.rays, weight=weight)))
        assert found.level == verdict
        assert any("rays were taken for gross errors" in reason for reason in found.reasons) == (verdict != "accepted")


def test_variance_components_are_judged_at_the_given_orientations():
    """The rounds begin at what was adjusted before, and the way from the positions given must not be lost by it."""
    block = ten_photographs()
    adjustment = replace(block.settings.adjustment, variance_components="on")
    images = replace(block.images, centre=block.images.centre + [0.0, 0.0, 620.0])
    outcome = adjust(replace(block, images=images, settings=replace(block.settings, adjustment=adjustment))).outcome
    assert outcome.verdict == "doubtful"
    assert any("photographs were moved by up to 6" in reason for reason in outcome.reasons)


def test_an_adjustment_that_failed_is_rejected():
    block = controlled(1)
    block = replace(block, control=replace(block.control, is_check=np.full(len(block.control), True)))
    with pytest.raises(AdjustmentFailedError) as failed:
        adjust(block)
    assert failed.value.outcome.verdict == "rejected"
    assert failed.value.outcome.reasons == (failed.value.outcome.message,)


def test_no_light_is_good_of_sigma_that_mean_nothing():
    """Check points within σ computed from a σ₀ of hundreds agree with nothing."""
    adjusted = adjust(with_image_points(ten_photographs(), 3, lambda xy: -xy))
    assert adjusted.outcome.verdict == "rejected"
    lights = [f for f in findings(adjusted) if f.quantity.endswith("at check points")]
    assert lights
    assert all(f.level == "attention" for f in lights)
    page = report_html(adjusted, {})
    assert "as the σ say" not in page
    assert page.index("Rejected.") < page.index('id="adjusted"')
    assert page.index("σ₀ is") < page.index('id="adjusted"')
    faultless = adjust(ten_photographs())
    asking = sum(f.level == "attention" for f in findings(faultless))
    said = f"{asking} of the numbers" if asking else "Nothing speaks against this result"
    assert said in report_html(faultless, {})


def test_every_reason_stands_among_the_findings():
    """One set of rules: what the report lights up is what the verdict says."""
    adjusted = adjust(with_control(controlled(1), first_lifted))
    told = [f.reason for f in findings(adjusted) if f.grade != "accepted"]
    assert sorted(told) == sorted(judge(adjusted).reasons)
    assert all(f.level == "attention" for f in findings(adjusted) if f.grade != "accepted")


def adjust_folder(block, folder):
    write_block(block, folder / "block")
    return run_adjust(folder / "block", folder / "result", None, None, None, False, True)


def test_rejected_is_written_and_exit_1(tmp_path, capsys):
    assert adjust_folder(with_image_points(ten_photographs(), 3, lambda xy: -xy), tmp_path) == 1
    written = json.loads((tmp_path / "result" / "adjustment.json").read_text())
    assert written == json.loads(capsys.readouterr().out) | {"timings_s": written["timings_s"]}
    assert written["verdict"] == "rejected"
    assert written["reasons"]
    assert (tmp_path / "result" / "points.csv").is_file()


def test_doubtful_is_exit_0_and_said_wherever_it_is_read(tmp_path, capsys):
    """By the verdict first, by diff, and in results of versions that did not judge."""
    doubtful, good = tmp_path / "doubtful", tmp_path / "good"
    assert adjust_folder(with_control(controlled(1), first_lifted), doubtful) == 0
    assert adjust_folder(controlled(1), good) == 0
    solution = good / "result" / "solution.npz"
    with np.load(solution) as saved:
        older = {name: saved[name] for name in saved.files if name not in ("verdict", "reasons")}
    np.savez_compressed(solution, **older)
    capsys.readouterr()
    assert run_diff(doubtful / "result", good / "result", 3, False) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("first is doubtful: C01 is off by")
    assert lines[2] == "second is accepted"
    assert run_adjust(doubtful / "block", doubtful / "again", None, None, None, False, False) == 0
    said = capsys.readouterr().out
    assert said.startswith("verdict: doubtful\n")
    assert "  because C01 is off by" in said
    assert "because σ₀ is 3.6" in said


def test_shift_of_gnss_is_off_unless_it_is_asked_for():
    block = small_block(1, gnss={"sigma_m": [0.05, 0.05, 0.08]})[0]
    assert type(block.settings.gnss)().shift == "off"
    assert not any("gnss" in str(name) for name in adjust(block).parameters.names)
    given = adjust_keeping_system(small_block(1, gnss={"sigma_m": [0.05] * 3, "shift_sigma_m": [0.3] * 3})[0])
    assert given.result.outcome.verdict == "doubtful"
