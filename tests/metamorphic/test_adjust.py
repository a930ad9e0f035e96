"""The same measurements in other rows, under other names, in another frame: the same adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from transformations import about_z, both, largest_difference, moved, numbers_of, permuted, renamed, same

from aerotri.functional_model.additional_parameters import AUTO, parse_parameters
from aerotri.observations import GnssSettings
from aerotri.observations.block import Edits
from aerotri.pipeline import adjust, choosing
from small_blocks import ERRING, small_block, with_adjustment

ALL = 1e-9
"""σ, by which results may differ: rounding makes some 1e-10 of it."""
STEPS = 1e-6
"""σ, where the datum is that of start values which are intersected: points that near-parallel rays give are rounded to
some 1e-9 m, and the datum with them."""
GNSS = {"gnss": {"sigma_m": [0.05, 0.05, 0.05], "shift_sigma_m": [0.3, 0.3, 0.3]}}
INS = {"ins": {"sigma_deg": [0.005, 0.005, 0.005], "boresight_deg": [0.1, 0.2, 0.3]}}
MANY_CONTROL = {"control": {"distance_bases": 1.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8}}
NO_START = {"start_values": {"kind": "none"}}
GROSS = {"gross_errors": {"fraction": 0.03}}

ROWS = both(permuted(2), renamed)
FRAME = both(permuted(3), moved(about_z(37.0), [300.5, -200.25, 64.0], 10.0))
SHIFT = both(permuted(3), moved(np.eye(3), [300.5, -200.25, 64.0]))


def with_gnss(block, **settings):
    return replace(block, settings=replace(block.settings, gnss=GnssSettings(**settings)))


def with_edits(block):
    """Rays switched off, a control point made a check point, another one taken out."""
    rays, control = block.image_points, block.control.point[~block.control.is_check]
    edits = Edits(
        np.array([rays.image[7], rays.image[90], -1, -1]),
        np.array([rays.point[7], rays.point[90], control[0], control[1]]),
        np.array(["off", "off", "check", "off"]),
        np.array(["", "", "doubtful", ""]),
    )
    return replace(block, edits=edits)


def incomplete_control(block):
    """Control points without height, and without plan."""
    xyz, sigma = block.control.xyz.copy(), block.control.sigma.copy()
    for rows, axes in ((slice(1, None, 4), slice(2, 3)), (slice(2, None, 4), slice(0, 2))):
        xyz[rows, axes] = sigma[rows, axes] = np.nan
    return replace(block, control=replace(block.control, xyz=xyz, sigma=sigma))


def robust(name):
    return lambda: with_adjustment(small_block(3, **GROSS)[0], robust=name)


def parameters(spec, **settings):
    return lambda: with_adjustment(small_block(3, spec, **ERRING)[0], **settings)


CASES = {
    "plain": lambda: small_block(3)[0],
    "additional parameters": parameters("bluh:1-12,ultracam_d:42-73"),
    "grid": parameters("legendre:3x3"),
    "brown": parameters("brown:K1+K2+P1+P2"),
    "selection": parameters("bluh:1-12,ultracam_d:42-48", parameter_selection="on"),
    "huber": robust("huber"),
    "danish": robust("danish"),
    "cauchy": robust("cauchy"),
    "adaptive": robust("adaptive"),
    "data snooping": robust("data-snooping"),
    "towers": lambda: small_block(3, towers={"height_m": 30.0})[0],
    "edits": lambda: with_edits(small_block(3)[0]),
    "incomplete control": lambda: incomplete_control(small_block(3)[0]),
    "GNSS, shift of strips": lambda: with_gnss(small_block(3, **GNSS)[0], shift="strip"),
    "GNSS, drift of strips": lambda: with_gnss(small_block(3, **GNSS)[0], shift="strip", drift="strip"),
    "from control": lambda: small_block(3, **NO_START, **MANY_CONTROL)[0],
    "from the track": lambda: with_gnss(small_block(3, **NO_START, **GNSS)[0], shift="block"),
}


@pytest.mark.parametrize("case", CASES)
def test_same_result(case):
    block = CASES[case]()
    before = numbers_of(adjust(block), same(block))
    for name, change in {"rows and names": ROWS, "frame": FRAME}.items():
        changed = change(block)
        after = numbers_of(adjust(changed.block), changed)
        assert_same(before, after, ALL, f"{case}, {name}", changed.frame.scale, changed.frame.turned)


def assert_same(before, after, limit, what, scale=1.0, turned=False):
    found = largest_difference(before, after)
    beyond = {name: value for name, value in found.items() if not value <= limit}
    assert not beyond, what
    # sentences may say lengths; control is tested axis by axis, so that a turned frame suspects other points
    unlike = {"warnings": scale != 1.0, "blunders": turned}
    for name, words in before.words.items():
        if not unlike.get(name, False):
            assert after.words[name] == words, what


@pytest.mark.parametrize("datum", ["minimal", "inner"])
def test_free_network(datum):
    """With start values of the points to the millimetre as exact as any; else the start values are the limit."""
    block = with_adjustment(small_block(3)[0], datum=datum)
    before = adjust(block)
    start = np.round(before.points.xyz, 3)
    from_start = numbers_of(adjust(block, given_points=start), same(block))
    for change in (ROWS, SHIFT):
        changed = change(block)
        moved_start = np.empty_like(start)
        moved_start[changed.point] = changed.frame.points(start)
        after = numbers_of(adjust(changed.block, given_points=moved_start), changed)
        assert_same(from_start, after, ALL, datum)
        assert_same(numbers_of(before, same(block)), numbers_of(adjust(changed.block), changed), STEPS, datum)


def test_attitudes():
    """ω, φ, κ with σ of their own are statements about the axes of the frame, which is shifted but not turned."""
    block = small_block(3, **GNSS, **INS)[0]
    block = replace(block, settings=replace(block.settings, ins=replace(block.settings.ins, drift="strip")))
    before = numbers_of(adjust(block), same(block))
    for change in (ROWS, SHIFT):
        changed = change(block)
        assert_same(before, numbers_of(adjust(changed.block), changed), ALL, "INS")


def test_variance_components():
    """The traces of large groups are sampled at random, of places that no order of rows or names moves."""
    block = with_adjustment(small_block(3)[0], variance_components="on")
    one = adjust(block)
    before = numbers_of(one, same(block))
    for change in (ROWS, SHIFT):
        changed = change(block)
        two = adjust(changed.block)
        assert_same(before, numbers_of(two, changed), 10.0 * ALL, "variance components")
        assert two.components is not None
        for component, other in zip(one.components.components, two.components.components, strict=True):
            assert other.freedom == pytest.approx(component.freedom, rel=1e-7)


def few_sets(monkeypatch, order=1):
    """The choice among four sets, in their order or the other way round."""
    specs = ("none", "bluh:1-12", "brown", "ebner")[::order]
    monkeypatch.setattr(choosing, "sets_to_choose_from", lambda block: tuple(parse_parameters(spec) for spec in specs))


def test_parameters_chosen_by_the_program(monkeypatch):
    """`--parameters auto`: the same set for the same reason, from sets tried in any order."""
    block = with_adjustment(small_block(3, **ERRING)[0], additional_parameters=AUTO)
    few_sets(monkeypatch)
    before = numbers_of(adjust(block), same(block))
    (chosen,) = (said for said in before.words["notes"] if "additional parameters chosen" in said)
    assert "chosen: none" not in chosen
    for name, change in {"rows and names": ROWS, "shift": SHIFT}.items():
        few_sets(monkeypatch, -1)
        changed = change(block)
        assert_same(before, numbers_of(adjust(changed.block), changed), ALL, name)


def test_general_turn():
    """A frame turned about any axis: Z is nothing else than X and Y where no σ says so."""
    block = small_block(3, parameters="bluh:1-4", control={"distance_bases": 2.0, "sigma_m": [0.03, 0.03, 0.03]})[0]
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    before, changed = numbers_of(adjust(block), same(block)), moved(turn, [100.0, 50.0, -30.0])(block)
    assert_same(before, numbers_of(adjust(changed.block), changed), ALL, "turned", turned=True)


def test_units_of_image_sigma():
    """Standard deviations twice as large, of everything: σ0 is half, all else the same."""
    block = small_block(3, "bluh:1-4", **GNSS)[0]
    control, rays, gnss = block.control, block.image_points, block.gnss_ins
    doubled = replace(
        block, control=replace(control, sigma=2.0 * control.sigma),
        image_points=replace(rays, sigma=2.0 * rays.sigma), gnss_ins=replace(gnss, sigma=2.0 * gnss.sigma),
    )  # fmt: skip
    one, two = adjust(block), adjust(doubled)
    assert two.outcome.sigma0 == pytest.approx(one.outcome.sigma0 / 2.0, rel=1e-9)
    np.testing.assert_allclose(two.points.xyz, one.points.xyz, atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(two.points.sigma, one.points.sigma, rtol=1e-8)


def test_parse_is_blind_to_order():
    """Parameters named in another order are the same parameters."""
    block = small_block(3, "bluh:1-6,ultracam_d:42-50", **ERRING)[0]
    other = with_adjustment(block, additional_parameters=parse_parameters("ultracam_d:50+42-49,bluh:6+1-5"))
    assert_same(numbers_of(adjust(block), same(block)), numbers_of(adjust(other), same(other)), ALL, "order")
