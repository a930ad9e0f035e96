"""What control points say of σ: against adjustments without them, on simulated blocks, and by Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.diagnosis.moving_errors import control_in_words
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.statistics.control_evidence import (
    along_model,
    control_equations,
    left_out_over_sigma,
    scale_of_model,
)
from small_blocks import small_block


@pytest.fixture(scope="module")
def found():
    """A block of six control points, and what these say."""
    block = small_block(4, control={"positions": [[x, y] for x in (0.1, 0.5, 0.9) for y in (0.2, 0.8)],
                                    "sigma_m": [0.03, 0.03, 0.05], "check_points": 0})[0]  # fmt: skip
    adjustment = adjust_keeping_system(block)
    factor = adjustment.system.factorise(adjustment.solution.equations)
    return adjustment, factor, control_equations(adjustment.system, adjustment.solution, factor)


def test_points_left_out_are_those_of_adjustments_without_them(found):
    """R_II⁻¹·r_I, and its σ, for every control point made a check point."""
    adjustment, _, equations = found
    block, local = adjustment.result.block, adjustment.local
    rest, squares = np.eye(len(equations.rows)) - equations.cofactors, []
    names = block.points[adjustment.system.unknowns.points[equations.rows]]
    for name in dict.fromkeys(names.tolist()):
        own = np.flatnonzero(names == name)
        check = aerotri.adjust(aerotri.edit(block, check=[name]), explain=False).adjusted.check
        miss = np.linalg.solve(rest[np.ix_(own, own)], equations.residual[own]) / equations.weight[own]
        # r is given less adjusted
        assert -miss == pytest.approx(check.difference[0], rel=0.05, abs=0.002)
        inverse = np.linalg.inv(rest[np.ix_(own, own)])
        squares.extend((inverse @ equations.residual[own]) ** 2 / np.diagonal(inverse))
    expected = np.sqrt(np.mean(squares)) / local.outcome.sigma0
    assert left_out_over_sigma(equations, np.zeros_like(rest), local.outcome.sigma0) == pytest.approx(expected)
    assert adjustment.result.model_part.control.left_out == pytest.approx(expected)


def test_control_worse_than_stated_is_told():
    """Six points with errors five times their σ: contradictions, and a sentence."""
    layout = {"positions": [[x, y] for x in (0.1, 0.5, 0.9) for y in (0.2, 0.8)], "check_points": 0}
    block, _ = small_block(4, control={**layout, "sigma_m": [0.1, 0.1, 0.1]})
    wrong = replace(block, control=replace(block.control, sigma=block.control.sigma / 5.0))
    right, result = (aerotri.adjust(one, explain=False).adjusted for one in (block, wrong))
    assert right.model_part.control.p > 1e-3
    control = result.model_part.control
    assert control.p < 1e-6
    assert control.left_out > 2.0
    said = control_in_words(control)
    assert "left out in turn" in said.lower()
    assert said in result.outcome.warnings


def test_without_control_nothing_is_scaled():
    assert scale_of_model(np.zeros(4), np.ones(4), 7.0) == pytest.approx(1.0)
    assert scale_of_model(np.full(4, 100.0), np.full(4, 0.5), 7.0) < 0.6
    assert scale_of_model(np.full(4, 1.0), np.full(4, 30.0), 7.0) > 2.0


@pytest.mark.parametrize("freedom", [4, 12])
def test_total_sigma_holds_95_of_100_whatever_control_says(freedom):
    """Model errors of a size γ ~ ν/χ²; control of three modes shows some of it: the scaled σ hold the truth."""
    rng, inside, sizes = np.random.default_rng(freedom), [], []
    power = np.array([0.5, 3.0, 10.0])
    widening = (2.776445 / 1.959964) ** 2 if freedom == 4 else (2.178813 / 1.959964) ** 2
    for _ in range(800):
        gamma = freedom / rng.chisquare(freedom)
        squares = (1.0 + gamma * power) * rng.normal(size=3) ** 2
        variance = widening * scale_of_model(power, squares, freedom)
        inside.append(abs(rng.normal() * np.sqrt(gamma)) < 1.959964 * np.sqrt(variance))
        sizes.append(variance)
    # 99.9 % of such a count lie within 0.026
    assert np.mean(inside) == pytest.approx(0.95, abs=0.026)
    assert np.std(np.log(sizes)) > 0.1


def test_residuals_of_control_are_white_where_sigma_is_right():
    """Mean square of the whitened contradictions over simulated blocks."""
    squares = []
    for seed in range(1, 7):
        adjustment = adjust_keeping_system(small_block(seed)[0])
        factor = adjustment.system.factorise(adjustment.solution.equations)
        equations = control_equations(adjustment.system, adjustment.solution, factor)
        nothing = np.zeros_like(equations.cofactors)
        squares.extend(along_model(equations, nothing, adjustment.local.outcome.sigma0)[1])
    bound = 3.3 * np.sqrt(2.0 / len(squares))
    assert np.mean(squares) == pytest.approx(1.0, abs=bound)
