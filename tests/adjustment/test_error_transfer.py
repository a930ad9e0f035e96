"""Parameters of one set that say the image errors of another."""

import numpy as np
import pytest

from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.error_transfer import with_image_errors
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.system import build_system
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.pipeline import adjust_keeping_system
from small_blocks import ERRING, small_block, with_adjustment


@pytest.fixture(scope="module")
def adjusted():
    """An adjusted block with a polynomial of the image errors, and the status of its rays."""
    block = small_block(4, "legendre:4x4", **ERRING)[0]
    return adjust_keeping_system(block)


def started(adjusted, parameters: str):
    """The same block with another set, where the first one ended."""
    system, ended = adjusted.system, adjusted.solution.state
    block = with_adjustment(system.unknowns.block, additional_parameters=parse_parameters(parameters))
    status = np.full(len(block.image_points.image), 3)
    status[system.unknowns.rays.source] = 0
    new, start = build_system(block, start_values_at(system.unknowns, ended), status)
    return new, with_shared(new.unknowns, system.unknowns, start, ended)


def rms_um(system, state) -> float:
    residual = system.right_side(state, LEAST_SQUARES).residual
    return 1e3 * float(np.sqrt(np.mean(residual**2)))


def test_same_set_stays(adjusted):
    """Identity: the parameters come back, whatever they start from."""
    new, start = started(adjusted, "legendre:4x4")
    ended = adjusted.solution.state
    additional = np.array([kind == "additional" for kind in new.unknowns.shared.kinds])
    found = with_image_errors(new, start, adjusted.system, ended)
    np.testing.assert_allclose(found.shared, ended.shared, rtol=0.0, atol=1e-9 * np.abs(ended.shared).max())
    from_zero = with_image_errors(
        new, type(start)(start.centre, start.rotation, start.points, np.where(additional, 0.0, start.shared)),
        adjusted.system, ended,
    )  # fmt: skip
    np.testing.assert_allclose(from_zero.shared, ended.shared, rtol=0.0, atol=1e-7 * np.abs(ended.shared).max())


def test_set_that_contains_the_other(adjusted):
    """A larger polynomial says the same image errors: the residuals are those of the adjustment."""
    new, start = started(adjusted, "legendre:5x5")
    shared = np.where([kind == "additional" for kind in new.unknowns.shared.kinds], 0.0, start.shared)
    empty = type(start)(start.centre, start.rotation, start.points, shared)
    found = with_image_errors(new, empty, adjusted.system, adjusted.solution.state)
    there = adjusted.system.right_side(adjusted.solution.state, LEAST_SQUARES).residual
    here = new.right_side(found, LEAST_SQUARES).residual
    np.testing.assert_allclose(here, there, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("parameters", ["gruen", "collocation:9x7", "lens:k1+k2+k3+p1+p2"])
def test_other_sets_come_nearer(adjusted, parameters):
    """What a set can say of the errors it starts with; the rest is left to the adjustment."""
    new, start = started(adjusted, parameters)
    ended = rms_um(adjusted.system, adjusted.solution.state)
    found = with_image_errors(new, start, adjusted.system, adjusted.solution.state)
    assert rms_um(new, found) < rms_um(new, start)
    if parameters != "lens:k1+k2+k3+p1+p2":
        assert rms_um(new, found) - ended < 0.5 * (rms_um(new, start) - ended)


def test_without_parameters_nothing_changes(adjusted):
    new, start = started(adjusted, "none")
    held = all(kind != "interior" for kind in new.unknowns.shared.kinds)
    found = with_image_errors(new, start, adjusted.system, adjusted.solution.state)
    assert (found is start) == held
