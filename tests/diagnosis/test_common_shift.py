"""A shift that all positions share: found without an adjustment of its own, and only where there is one."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.common_shift import common_shift_in_words
from aerotri.pipeline import adjust_keeping_system
from aerotri.results.common_shift import CommonShift
from aerotri.statistics.common_shift import common_shift
from small_blocks import small_block

WHITE = {"sigma_m": [0.5, 0.5, 0.8]}
SHIFT_M = (1.5, -2.0, 3.0)


def _gnss(block, moved=(0.0, 0.0, 0.0), **settings):
    """The block with all positions moved, and other settings of them."""
    gnss = replace(block.settings.gnss, **settings)
    observed = replace(block.gnss_ins, xyz=block.gnss_ins.xyz + np.array(moved))
    return replace(block, gnss_ins=observed, settings=replace(block.settings, gnss=gnss))


def _found(block):
    found = adjust_keeping_system(block)
    factor = found.system.factorise(found.solution.equations)
    return common_shift(found.system, found.solution, factor, found.local.outcome.sigma0), found


def test_it_is_what_the_adjustment_with_a_shift_finds():
    """Value and σ, and the warning that names it."""
    block = small_block(3, gnss=WHITE)[0]
    shift, found = _found(_gnss(block, SHIFT_M))
    parameters = adjust_keeping_system(_gnss(block, SHIFT_M, shift="block")).local.parameters
    rows = [parameters.names.tolist().index(f"gnss.shift_{axis}") for axis in "XYZ"]
    np.testing.assert_allclose(shift.shift, parameters.value[rows], rtol=0.01)
    # σ0 is larger where the shift is left to the residuals
    ratio = shift.sigma / parameters.sigma[rows]
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.01)
    assert shift.p < 1e-6
    said, outcome = common_shift_in_words(shift), found.local.outcome
    assert said in outcome.warnings
    assert 'shift = "block"' in said
    assert outcome.verdict == "doubtful"
    assert said in outcome.reasons


def test_white_noise_is_no_shift():
    for seed in (1, 2, 3):
        shift, found = _found(small_block(seed, gnss=WHITE)[0])
        assert shift.p > 0.001
        assert not any("shifted against" in said for said in found.local.outcome.warnings)


@pytest.mark.parametrize("case", ["no control", "an unknown already", "no positions"])
def test_where_there_is_nothing_to_hold_it_against(case):
    block = small_block(3, gnss=WHITE)[0]
    if case == "no control":
        block = replace(
            block, control=replace(block.control, is_check=np.ones(len(block.control.is_check), dtype=bool))
        )
    elif case == "no positions":
        block = replace(block, gnss_ins=None)
    else:
        block = _gnss(block, shift="block")
    assert _found(block)[0] is None


def test_chance_is_told_from_a_shift():
    size = np.array([0.1, 0.0, 0.0]), np.full(3, 0.05)
    assert not common_shift_in_words(CommonShift(*size, 0.2))
    assert "less than 0.001 %" in common_shift_in_words(CommonShift(*size, 1e-9))
