"""Control, GNSS and photographs that contradict one another as a whole, though each fits by itself."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.diagnosis import findings
from aerotri.diagnosis.common_motion import of_common_motion
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.pipeline import adjust_keeping_system
from aerotri.results.common_motion import CHANCE, SUSPECTED, CommonMotion
from aerotri.results.control_heights import BOWL, NAMES, SPLIT
from aerotri.statistics.control_heights import control_heights
from dense_algebra import TINY
from small_blocks import small_block, with_adjustment

WHITE = {"sigma_m": [0.03, 0.03, 0.05]}


def block_with_gnss(seed=3, change=None, shift="off", **navigation):
    """A faultless block with GNSS, its control changed by `change(xyz from the middle)`."""
    block = small_block(seed, gnss=WHITE, **navigation, **TINY)[0]
    block = with_adjustment(block, additional_parameters=parse_parameters("none"))
    block = replace(block, settings=replace(block.settings, gnss=replace(block.settings.gnss, shift=shift)))
    if change is None:
        return block
    control = block.control
    own, xyz = ~control.is_check, control.xyz.copy()
    xyz[own] += change(xyz[own] - xyz[own].mean(axis=0))
    return replace(block, control=replace(control, xyz=xyz))


def tilted(off):
    return np.stack([0.0 * off[:, 0], 0.0 * off[:, 0], 2.0 * off[:, 0] / np.ptp(off[:, 0])], axis=1)


def in_grid(off):
    return off * np.array([-1e-3, -1e-3, 0.0])


def turned(off):
    return 1e-3 * np.stack([-off[:, 1], off[:, 0], 0.0 * off[:, 0]], axis=1)


@pytest.mark.parametrize(
    ("change", "words", "shift"),
    [(tilted, "tilted by", "off"), (in_grid, "in scale", "block"), (turned, "turned in plan", "off")],
)
def test_a_contradiction_is_said(change, words, shift):
    result = aerotri.adjust(block_with_gnss(change=change, shift=shift))
    assert result.verdict != "accepted"
    assert any(words in reason for reason in result.reasons)


@pytest.mark.parametrize(("change", "words"), [(tilted, "tilted by"), (turned, "turned in plan")])
def test_control_against_positions_and_attitudes(change, words):
    """Neither of the two is turned against the other."""
    ins = {"sigma_deg": [0.005, 0.005, 0.01]}
    reasons = aerotri.adjust(block_with_gnss(change=change, ins=ins)).reasons
    assert any("contradict GNSS and INS: the positions and attitudes are" in text and words in text for text in reasons)
    assert not adjust_keeping_system(block_with_gnss(ins=ins)).local.common_motion.counts


def test_its_size():
    """A scale of −1000 ppm of the control is +1000 ppm of the positions against it, within its σ."""
    motion = adjust_keeping_system(block_with_gnss(change=in_grid, shift="block")).local.common_motion
    assert abs(motion.scale - 1e-3) < 4.0 * motion.scale_sigma
    assert motion.scale_sigma < 3e-4


@pytest.mark.parametrize("shift", ["off", "block"])
def test_faultless_blocks_do_not_contradict_themselves(shift):
    """Their probabilities are spread evenly between 0 and 1."""
    motions = [adjust_keeping_system(block_with_gnss(seed, shift=shift)).local.common_motion for seed in range(1, 7)]
    assert all(not motion.counts for motion in motions)
    p = np.array([[motion.p_tilt, motion.p_turn, motion.p_scale] for motion in motions])
    assert 0.2 < np.median(p) < 0.8
    assert p.min() > CHANCE


def test_without_positions_there_is_none():
    assert adjust_keeping_system(replace(block_with_gnss(), gnss_ins=None)).local.common_motion is None


def rounded(block, step, sigma):
    control = block.control
    own, xyz, stated = ~control.is_check, control.xyz.copy(), control.sigma.copy()
    xyz[own] = np.round(xyz[own] / step) * step
    stated[own] = sigma
    return replace(block, control=replace(control, xyz=xyz, sigma=stated))


@pytest.mark.parametrize(("step", "sigma", "said"), [(1.0, 0.05, True), (1.0, 0.5, False), (0.01, 0.02, False)])
def test_coordinates_with_too_few_digits(step, sigma, said):
    result = aerotri.adjust(rounded(block_with_gnss(), step, sigma))
    assert any("are rounded to" in reason for reason in result.reasons) == said


def test_what_control_alone_cannot_show():
    """A note on the page, of a block that is accepted."""
    result = aerotri.adjust(replace(block_with_gnss(), gnss_ins=None))
    notes = [f for f in findings(result.record.local) if f.quantity == "what this block cannot show"]
    assert len(notes) == 1
    assert "height of the pole" in notes[0].says
    assert notes[0].grade == "accepted"


def test_what_control_and_gnss_cannot_show():
    """A tilt that is too small to count is told as what may stay hidden, and one that is large counts."""
    found = adjust_keeping_system(block_with_gnss()).local
    motion = found.common_motion
    note = next(f for f in findings(found) if f.quantity == "what this block cannot show")
    assert "map grid" in note.says
    assert "shadows" in note.says
    along_x, along_y = motion.detectable_tilt_m
    assert f"against GNSS below {along_x:.2g} m along X, or {along_y:.2g} m along Y" in note.says
    assert 3.0 < along_x / (motion.turn_sigma[1] * motion.extent[0]) < 5.0
    assert motion.detectable_tilt_m.max() < 2.0


def test_a_tilt_has_the_sigma_of_its_direction():
    """Of a long block: the tilt about its length is hardly known, that along it is."""
    sigma, extent = np.array([1e-3, 1e-5, 1e-5]), np.array([3000.0, 300.0, 0.0])

    def motion(about_x, about_y, correlation=0.0):
        turn = np.array([about_x, about_y, 0.0])
        return CommonMotion(turn, sigma, 0.0, 1e-5, 1e-9, 0.5, 0.5, extent, tilt_correlation=correlation)

    assert motion(0.0, 1e-4).tilt_m == pytest.approx((0.3, 0.03))
    assert motion(1e-3, 0.0).tilt_m == pytest.approx((0.3, 0.3))
    assert motion(0.0, 0.0).detectable_tilt_m[1] == pytest.approx(10.0 * motion(0.0, 0.0).detectable_tilt_m[0])
    # about equal turns: by a sample of turns with this correlation
    turn = np.array([2e-2, 2e-3])
    covariance = np.array([[1e-6, 0.6e-8], [0.6e-8, 1e-10]])
    sample = np.random.default_rng(1).multivariate_normal(turn, covariance, 100_000)
    spread = np.std(np.hypot(*(sample * [300.0, 3000.0]).T))
    assert motion(*turn, correlation=0.6).tilt_m[1] == pytest.approx(spread, rel=0.02)


def test_of_faultless_blocks_one_in_a_hundred_is_suspected():
    """Three tests together."""
    assert pytest.approx(0.01) == 3.0 * SUSPECTED


def test_a_tilt_that_may_be_chance_is_told_without_a_doubt():
    found = adjust_keeping_system(block_with_gnss()).local
    motion = replace(found.common_motion, p_tilt=0.5 * (CHANCE + SUSPECTED))
    said = [f for f in of_common_motion(replace(found, common_motion=motion)) if "tilted by" in f.says]
    assert [(f.level, f.grade) for f in said] == [("attention", "accepted")]


SMALL = TINY | {"control": {"distance_bases": 2.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8}}
"""With heights enough for two groups."""


def with_heights(seed, change):
    """A block held by control alone, heights of its control changed by `change(xyz from the middle, names)` m."""
    block, _ = small_block(seed, **SMALL)
    control = block.control
    own, xyz = ~control.is_check, control.xyz.copy()
    off = xyz[own] - xyz[own].mean(axis=0)
    xyz[own, 2] += change(off)
    return replace(block, control=replace(control, xyz=xyz))


def every_second(off):
    return 0.8 * (np.arange(len(off)) % 2 == 0)


def bent(off):
    distance = np.linalg.norm(off[:, :2], axis=1)
    return 2.0 * (distance / distance.max()) ** 2


def nothing(off):
    return 0.0 * off[:, 0]


@pytest.mark.parametrize(("change", "words"), [(every_second, "fall into two groups"), (bent, "like a bowl")])
def test_heights_of_control_that_contradict_the_photographs(change, words):
    """Though a block held by control alone follows them."""
    result = aerotri.adjust(with_heights(2, change))
    assert result.verdict != "accepted"
    assert any(words in reason for reason in result.reasons)


def heights_of(block):
    found = adjust_keeping_system(block)
    factor = found.system.factorise(found.solution.equations)
    return control_heights(found.system, found.solution, factor, found.local.outcome.sigma0)


@pytest.mark.parametrize(
    ("change", "kind", "size"), [(every_second, SPLIT, 0.8), (bent, BOWL, 2.0), (None, NAMES, 0.8)]
)
def test_size_of_a_pattern(change, kind, size):
    """Within its σ; by names where half of the points have another beginning."""
    block = with_heights(2, change or every_second)
    if change is None:
        block = renamed(block)
    pattern = next(one for one in heights_of(block).patterns if one.kind == kind)
    assert abs(abs(pattern.size) - size) < 4.0 * pattern.sigma
    assert pattern.sigma < 0.3 * size
    assert pattern.p < CHANCE


def renamed(block):
    """Every second control point with another beginning of its name."""
    points, own = block.points.astype(object), block.control.point[~block.control.is_check]
    points[own[::2]] = [f"high_{k}" for k in range(len(own[::2]))]
    return replace(block, points=points.astype(str))


def test_heights_of_faultless_blocks():
    """Their probabilities are spread evenly between 0 and 1."""
    found = [heights_of(with_heights(seed, nothing)) for seed in range(1, 7)]
    p = np.array([one.p for one in found])
    assert 0.1 < np.median(p) < 0.9
    assert p.min() > CHANCE
    assert all(pattern.p > CHANCE for one in found for pattern in one.patterns)
