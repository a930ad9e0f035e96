"""Self-calibrated small blocks, adjusted once for all tests of this folder."""

import independent
import pytest

from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.pipeline import adjust_keeping_system
from small_blocks import ERRING, small_block, with_adjustment


@pytest.fixture(scope="session")
def calibration():
    """With all parameters of the UltraCamD, of a camera that errs by physics."""
    return adjust_keeping_system(small_block(3, "bluh:1-12,ultracam_d:42-73", **ERRING)[0])


@pytest.fixture(scope="session")
def few_parameters(calibration):
    """The same block with the parameters that `independent` has written out."""
    chosen = parse_parameters(independent.SPEC)
    return adjust_keeping_system(with_adjustment(calibration.result.block, additional_parameters=chosen))


@pytest.fixture(scope="session")
def pair(calibration):
    """Names of two photographs that follow one another in the middle strip."""
    names = [str(name) for name in calibration.local.block.images.names]
    return names[8], names[9]
