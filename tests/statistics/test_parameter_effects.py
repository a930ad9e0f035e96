"""Parameters left out: the check points move as an adjustment without them moves them."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.pipeline import adjust, adjust_keeping_system
from aerotri.statistics.parameter_effects import parameter_effects
from small_blocks import small_block, with_adjustment

ERRORS = {"bluh.1": 2e-5, "bluh.9": 1e-8, "ultracam_d.50": 4e-3}
SPEC = "bluh:1-4+9,ultracam_d:50-52"


def effects_of(check_points=30, change=None):
    camera = {"ucd": {"preset": "ultracam_d", "errors": {"parameters": ERRORS}}}
    control = {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": check_points}
    block, _ = small_block(3, SPEC, camera=camera, control=control)
    block = block if change is None else change(block)
    found = adjust_keeping_system(block)
    factor = found.system.factorise(found.solution.equations)
    return block, found.local, parameter_effects(found.local, found.system, found.solution, factor)


@pytest.fixture(scope="module")
def case():
    return effects_of()


def test_as_an_adjustment_without_them(case):
    block, adjusted, effects = case
    np.testing.assert_array_equal(effects.difference, adjusted.check.difference)
    by_label = {one.label: one for one in effects.left_out}
    assert list(by_label) == ["all", "bluh", "ultracam_d", *adjusted.parameters.names[-8:]]
    without = {"all": "none", "bluh": "ultracam_d:50-52", "ultracam_d": "bluh:1-4+9",
               "bluh.1": "bluh:2-4+9,ultracam_d:50-52", "ultracam_d.50": "bluh:1-4+9,ultracam_d:51+52"}  # fmt: skip
    for label, spec in without.items():
        again = adjust(with_adjustment(block, additional_parameters=parse_parameters(spec)))
        moved = again.check.difference - adjusted.check.difference
        np.testing.assert_allclose(
            by_label[label].difference - effects.difference, moved, atol=0.02 * np.abs(moved).max(), err_msg=label
        )


def test_what_acts_helps_and_what_does_not_makes_no_difference(case):
    _, _, effects = case
    by_label = {one.label: one for one in effects.left_out}
    assert by_label["all"].verdict == "helps"
    assert by_label["ultracam_d.52"].verdict == "no difference"
    # there without a doubt, and nothing that the ground would notice
    assert by_label["ultracam_d.50"].t > 10.0
    assert by_label["ultracam_d.50"].verdict == "no difference"
    assert by_label["bluh.9"].verdict == "helps"
    assert np.isnan(by_label["bluh"].t)


def test_too_few_check_points_say_so():
    _, _, effects = effects_of(check_points=3)
    assert {one.verdict for one in effects.left_out} == {"too few check points"}


def test_none_without_check_points_or_in_an_inner_datum():
    assert effects_of(check_points=0)[2] is None
    block, _ = small_block(3, SPEC)
    found = adjust_keeping_system(with_adjustment(block, datum="inner"))
    factor = found.system.factorise(found.solution.equations)
    assert parameter_effects(found.local, found.system, found.solution, factor) is None


def test_nodes_of_a_grid_are_left_out_together():
    block, _ = small_block(3, "bluh:1+9,legendre:6x6")
    found = adjust_keeping_system(block)
    factor = found.system.factorise(found.solution.equations)
    effects = parameter_effects(found.local, found.system, found.solution, factor)
    assert [one.label for one in effects.left_out] == ["all", "bluh", "legendre", "bluh.1", "bluh.9"]


def test_points_in_any_order(case):
    """Points are numbered as their table has them, and adjusted in another order."""

    def reversed_points(block):
        last, rays, control = len(block.points) - 1, block.image_points, block.control
        return replace(
            block, points=block.points[::-1], image_points=replace(rays, point=last - rays.point),
            control=replace(control, point=last - control.point),
        )  # fmt: skip

    _, _, effects = case
    _, _, found = effects_of(change=reversed_points)
    for one, other in zip(effects.left_out, found.left_out, strict=True):
        assert other.label == one.label
        np.testing.assert_allclose(other.difference, one.difference, atol=1e-9)
        assert other.worse == pytest.approx(one.worse, rel=1e-6)
