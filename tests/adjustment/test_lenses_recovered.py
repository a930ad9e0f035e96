"""Fisheyes and wide lenses recovered from simulated truth: errors over σ near N(0, 1), what is held stays."""

from dataclasses import replace

import pytest

from aerotri.conventions import InputError
from aerotri.image_errors import image_groups
from aerotri.image_errors.error_function import error_function
from aerotri.observations import Prior
from aerotri.pipeline import adjust
from normalised_errors import assert_normal
from small_blocks import small_block, with_adjustment

SEEDS = range(200, 208)
WRONG = {"focal_length_mm": 0.01, "x0_mm": 0.02, "y0_mm": -0.01}
FLIGHT = {
    "gsd_m": 0.1, "strips": 2, "images_per_strip": 4, "end_lap": 0.75, "side_lap": 0.5,
    "cross_strips": [{"position": 0.5, "images": 3}], "attitude_sigma_deg": [1.0, 1.0, 2.0],
    "position_sigma_m": [1.0, 1.0, 1.0],
}  # fmt: skip
GROUND = {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 8.0, "wavelength_m": 300.0}
CASES = {
    "fisheye": ("fisheye", 9.0, {"k1": -0.03, "k2": 0.004, "p1": 3e-4, "p2": -2e-4}, {}),
    "metashape": ("perspective", 12.0, {"k1": -0.05, "k4": 0.004, "b1": 1e-3, "b2": -2e-3}, {}),
    "rational": ("perspective", 12.0, {"k1": 0.3, "k2": 0.05, "q1": 0.35, "q2": 0.07}, {"q1": 0.35, "q2": 0.07}),
}
"""Projection, focal length, true lens and what of it is stated and held."""


def block_of(case: str, seed: int):
    projection, focal, true, held = CASES[case]
    free = [name for name in true if name not in held]
    stated = {name: {"value": value, "fixed": True} for name, value in held.items()}
    # start values a fifth off
    stated |= {name: {"value": 0.8 * true[name]} for name in free}
    camera = {
        "model": "frame", "size_px": [4000, 3000], "pixel_um": 5.0, "focal_length_mm": focal, "projection": projection,
        "interior": {name: {} for name in WRONG}, "lens": stated, "errors": {"lens": true, "interior": WRONG},
    }  # fmt: skip
    parameters = "lens:" + "+".join(free)
    tie_points = {"per_image": 40, "probability": 1.0, "sigma_um": 1.0}
    return small_block(seed, parameters, camera={"wide": camera}, flight=FLIGHT, terrain=GROUND, tie_points=tie_points)


@pytest.mark.parametrize("case", CASES)
def test_lens_is_recovered(case):
    runs = []
    for seed in SEEDS:
        block, truth = block_of(case, seed)
        result = adjust(block)
        assert result.outcome.status == "converged"
        known = dict(zip(truth.parameter_names, truth.parameter_values, strict=True))
        c, x0, y0 = truth.interior[0]
        known |= {"focal_length_mm": c, "x0_mm": x0, "y0_mm": y0}
        p = result.parameters
        z = {str(name): (p.value[k] - known[str(name)]) / p.sigma[k] for k, name in enumerate(p.names)}
        assert set(z) == {*WRONG, *(f"lens.{name}" for name in CASES[case][2] if name not in CASES[case][3])}
        runs.append((z, result.outcome.vtpv, result.outcome.redundancy))
    assert_normal(runs, case)


def test_a_wrong_projection_does_not_pass():
    """The same fisheye block, known lens and focal length, adjusted as a fisheye and as a perspective camera."""
    block, _ = block_of("fisheye", 1)
    own = block.cameras[0]
    held = {name: Prior(value, fixed=True) for name, value in CASES["fisheye"][2].items()}
    interior = {name: Prior(prior.value + WRONG[name], fixed=True) for name, prior in own.interior.items()}
    known = with_adjustment(
        replace(block, cameras=(replace(own, interior=interior, lens=held),)), additional_parameters=()
    )
    wrong = replace(known, cameras=(replace(known.cameras[0], projection="perspective"),))
    right = adjust(known).outcome
    assert right.sigma0 < 1.1
    assert adjust(wrong).outcome.sigma0 > 10.0


def test_what_does_not_know_a_fisheye_refuses_it():
    result = adjust(block_of("fisheye", 1)[0])
    (group,) = image_groups(result.block)
    with pytest.raises(InputError, match="is a fisheye"):
        error_function(result, group)
