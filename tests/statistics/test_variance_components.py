"""Variance components: recovery of simulated σ, the sums behind them, what is held, and the saved result."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from aerotri.formats.block_folder import read_block, write_block
from aerotri.formats.solution import read_solution, write_solution
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.statistics.observation_groups import group_fits, with_scaled_sigmas
from aerotri.statistics.residual_response import ResidualResponse, cross_redundancy
from aerotri.statistics.variance_components import VarianceComponents, chi_square_tests
from small_blocks import small_block, with_adjustment

FLIGHT = {
    "gsd_m": 0.1,
    "strips": 2,
    "images_per_strip": 5,
    "end_lap": 0.6,
    "side_lap": 0.5,
    "attitude_sigma_deg": [1.0, 1.0, 2.0],
    "position_sigma_m": [5.0, 5.0, 3.0],
    "days": 2,
}
TIES = {"per_image": 25, "probability": 0.9, "sigma_um": 3.0}
CONTROL = {"distance_bases": 1.3, "sigma_m": [0.15, 0.15, 0.25]}
GNSS = {"sigma_m": [0.25, 0.25, 0.25]}
CASES = {
    "photographs of two days, control, GNSS": (
        {"control": CONTROL, "gnss": GNSS},
        {
            "image points 1": 1.5, "image points 2": 0.6, "control plan": 1.7, "control height": 0.7,
            "GNSS plan": 0.6, "GNSS height": 1.6,
        },
    ),
    "INS, towers": (
        {
            "ins": {"sigma_deg": [0.012, 0.012, 0.012]},
            "towers": {"height_m": 25.0, "sigma_m": 0.1},
            "control": CONTROL | {"distance_bases": 2.0, "sigma_m": [0.02, 0.02, 0.02]},
        },
        {"image points": 0.7, "INS omega phi": 1.6, "INS kappa": 0.6, "constraints": 1.7},
    ),
}  # fmt: skip
SEEDS = range(300, 324)


def wrongly_stated(case: str, seed: int):
    """A block whose groups state their σ too large or too small by the factors of the case."""
    changes, wrong = CASES[case]
    block, _ = small_block(seed, flight=FLIGHT, tie_points=TIES, **changes)
    groups = "day" if "image points 1" in wrong else "camera"
    return with_scaled_sigmas(with_adjustment(block, parameter_groups=groups, variance_components="on"), wrong), wrong


@pytest.mark.parametrize("case", CASES)
def test_components_recover_the_simulated_sigma_within_their_own(case):
    """ln(σ̂/σ) in units of its σ, component by component: |mean| < 3.3/√n, variance in the 99.9 % χ² band."""
    z: dict[str, list[float]] = {}
    for seed in SEEDS:
        block, wrong = wrongly_stated(case, seed)
        result = adjust(block)
        assert result.components is not None
        assert result.components.settled
        assert result.outcome.sigma0 == pytest.approx(1.0, abs=0.01)
        for c in result.components.components:
            if c.group in wrong:
                assert not c.held, f"{seed}: {c.group} {c.held}"
                z.setdefault(c.group, []).append(np.log(c.factor * wrong[c.group]) / (c.factor_sigma / c.factor))
    assert set(z) == set(CASES[case][1])
    n = len(SEEDS)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    for name, values in z.items():
        assert abs(np.mean(values)) < 3.3 / np.sqrt(n), f"{name} is biased, mean z {np.mean(values):.2f}"
        assert low < np.mean(np.square(values)) < high, f"σ of {name} is wrong, mean z² {np.mean(np.square(values)):.2f}"
