"""Every family found again: a simulated camera with its patterns as image error, adjusted with the same family."""

import numpy as np
import pytest

from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters
from aerotri.pipeline import adjust
from aerotri.simulation import parse_spec, simulate
from small_blocks import small_spec, with_adjustment

RMS_MM = 0.002


def simulated(spec: str, seed: int):
    """A block whose camera has parameters of 2 µm each, drawn at random, and their true values by name."""
    choice = parse_parameters(spec)
    content = small_spec(camera={"cam": {"preset": "dmc" if "dmc" in spec else "ultracam_d"}})
    content["tie_points"]["per_image"] = 120
    camera = simulate(parse_spec(content), seed)[0].cameras[0]
    rng = np.random.default_rng(seed)
    x, y = (rng.uniform(-0.97, 0.97, (400, 2)) * camera.half_format_mm).T
    values: dict[str, float] = {}
    for family, items in choice:
        chosen = parameter_set(family, items, camera)
        size = np.sqrt(np.mean(chosen.basis(x, y) ** 2, axis=(0, 1)))
        values |= dict(zip(chosen.names, (rng.normal(size=len(size)) * RMS_MM / size).tolist(), strict=True))
    content["camera"]["cam"]["errors"] = {"parameters": values}
    block, _ = simulate(parse_spec(content), seed)
    return with_adjustment(block, additional_parameters=choice), values


@pytest.mark.parametrize(
    "spec", ["dmc", "dmc:30-41+79+80", "ebner", "gruen", "fourier", "legendre:3x2", "chebyshev", "bluh,dmc"]
)
def test_recovered(spec):
    """Errors over their σ as a normal deviate has them: 99.9 % bounds on their RMS, which correlation widens."""
    block, values = simulated(spec, seed=3)
    adjusted = adjust(block)
    p = adjusted.parameters
    own = p.kinds == "additional"
    assert adjusted.outcome.status == "converged"
    assert set(p.names[own]) == set(values)
    z = (p.value[own] - [values[name] for name in p.names[own]]) / p.sigma[own]
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.7
    assert np.abs(z).max() < 4.0
    assert 0.9 < adjusted.outcome.sigma0 < 1.1
