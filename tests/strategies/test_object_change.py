"""What sets of parameters do to the object, and that a flight without control is not bent by what nothing can tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.functional_model.additional_parameters import AUTO, parse_parameters
from aerotri.functional_model.rotation import exponential
from aerotri.pipeline import adjust_keeping_system, compare_parameters
from aerotri.pipeline.choosing import choose_parameters
from aerotri.results.parameter_comparison import Accuracy, AdjustedObject, ParameterComparison, SetOutcome
from aerotri.statistics.similarity import fit_similarity
from aerotri.strategies import parameter_sample
from aerotri.strategies.object_change import MOST_LEVERAGE, far_moved, leverage, object_of
from aerotri.strategies.parameter_choice import choose
from aerotri.strategies.parameter_comparison import set_name
from small_blocks import small_block, with_adjustment

LENS = "lens:k1+k2+k3+p1+p2"
FIXED_SETS = (LENS, "brown:K1+K2+K3+P1+P2", "bluh:1-12", "legendre:5x5")
DRONE = {
    "name": "flight",
    "camera": {"p4": {"model": "frame", "size_px": [5472, 3648], "pixel_um": 2.4, "focal_length_mm": 8.8}},
    "flight": {
        "gsd_m": 0.02, "strips": 3, "images_per_strip": 6, "end_lap": 0.8, "side_lap": 0.6,
        "attitude_sigma_deg": [1.0, 1.0, 2.0],
    },
    "terrain": {"kind": "undulating", "height_m": 5.0, "relief_rms_m": 2.0, "wavelength_m": 60.0},
    "tie_points": {"per_image": 90, "probability": 0.9, "sigma_um": 1.2},
    "gnss": {"sigma_m": [3.0, 3.0, 3.0]},
    "start_values": {"kind": "perturbed", "position_sigma_m": 0.5, "angle_sigma_deg": 0.05},
}  # fmt: skip
"""18 photographs at one height, without control, with positions of metres."""


def made_up(parameters: str, effective: float, bowl_m: float, image_mrad: float) -> SetOutcome:
    """A set of an object that is bent by a bowl, and of residuals that differ from those of 0 mrad by as much."""
    rng = np.random.default_rng(1)
    plan, rays = rng.uniform(-1.0, 1.0, (60, 2)), rng.normal(size=(240, 2)) / np.sqrt(2.0)
    xyz = np.column_stack([50.0 * plan, bowl_m * np.sum(plan**2, axis=1)])
    own = AdjustedObject(np.arange(60), xyz, np.full(60, 200.0), np.arange(240), 1e-3 * (5.0 + image_mrad) * rays)
    nowhere, choice = Accuracy.of(np.zeros((0, 3))), parse_parameters(parameters)
    name, sigma0 = set_name(choice), 1.0 - 0.1 * image_mrad
    return SetOutcome(
        name, choice, "converged", int(effective), effective, 0, sigma0, 1.0, 0.0, -effective, nowhere, nowhere,
        object=own,
    )  # fmt: skip


def test_leverage_of_a_bowl():
    """0.1 mrad in the rays move points by 2 cm at 200 m per rad; the bowl less its similarity is what is left."""
    flat, bent = made_up("none", 0, 0.0, 0.0), made_up("bluh:1-12", 12, 3.0, 0.1)
    xyz = bent.object.xyz
    fitted = fit_similarity(flat.object.xyz, xyz, np.ones_like(xyz)).residual
    left = np.sqrt(np.mean(np.sum(fitted**2, axis=1)))
    rays = np.sqrt(np.mean(np.sum((bent.object.residual - flat.object.residual) ** 2, axis=1)))
    assert leverage(flat, bent) == pytest.approx(left / (200.0 * rays), rel=0.01)
    turned = exponential(np.array([0.0, 0.0, 0.4]))
    moved = replace(bent, object=replace(bent.object, xyz=1.001 * xyz + 7.0))
    assert leverage(flat, moved) == pytest.approx(leverage(flat, bent), rel=0.01)
    both = [replace(o, object=replace(o.object, xyz=o.object.xyz @ turned.T)) for o in (flat, bent)]
    assert leverage(*both) == pytest.approx(leverage(flat, bent), rel=1e-9)


def test_too_few_points_say_nothing():
    flat, bent = made_up("none", 0, 0.0, 0.0), made_up("bluh:1-12", 12, 3.0, 0.1)
    few = replace(bent, object=replace(bent.object, point=bent.object.point + 50))
    assert np.isnan(leverage(flat, few))
    assert np.isnan(leverage(flat, replace(bent, object=None)))
    assert far_moved([flat, few]) == {}


def test_sets_are_held_against_smaller_ones_that_free_the_lens():
    none, lens = made_up("none", 0, 0.0, 0.0), made_up(LENS, 5, 3.0, 0.1)
    near, far = made_up("bluh:1-12", 12, 3.001, 0.2), made_up("legendre:5x5", 66, 0.0, 0.3)
    found = far_moved([far, near, lens, none])
    assert leverage(none, lens) > MOST_LEVERAGE
    assert set(found) == {"legendre:5x5"}
    assert found["legendre:5x5"].against in (lens.name, near.name)
    chosen = choose(ParameterComparison("b", (none, lens, near, far), 10, (), (), "off"))
    # the image points prefer the larger set, by BIC as well
    assert chosen.name == near.name
    assert "Not taken though they fit the image points better: legendre:5x5. They bend the block up to" in chosen.reason


def test_of_two_sets_that_contradict_each_other_the_farther_one_goes():
    """Seen in a flight of 1384 photographs: the larger one stayed close to the lens, and went for its size."""
    lens, unit = made_up(LENS, 5, 0.0, 0.0), leverage(made_up(LENS, 5, 0.0, 0.0), made_up("gruen", 44, 1.0, 0.1))
    far = made_up("legendre:5x5", 66, 0.9 * MOST_LEVERAGE / unit, 0.1)
    near = made_up(f"{LENS},collocation:13x9", 90, -0.8 * MOST_LEVERAGE / unit, 0.2)
    assert leverage(lens, near) < leverage(lens, far) < MOST_LEVERAGE < leverage(near, far)
    for order in ((lens, far, near), (near, far, lens)):
        assert set(far_moved(order)) == {far.name}


def test_reach_is_the_error_of_an_intersection():
    """A point moves by its reach where every ray errs by 1 rad: drawn directions, intersected with photographs held."""
    block = small_block(3)[0]
    a = adjust_keeping_system(block)
    own, u, state = object_of(a.system, a.solution), a.system.unknowns, a.solution.state
    rng, rays = np.random.default_rng(4), np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    for k in (0, len(own.point) // 2):
        row = int(np.flatnonzero(u.points == own.point[k])[0])
        away = state.points[row] - state.centre[u.rays.image[rays == row]]
        length = np.linalg.norm(away, axis=1)
        across = np.eye(3) - np.einsum("ki,kj->kij", away, away) / length[:, None, None] ** 2
        normals = np.sum(across / length[:, None, None] ** 2, axis=0)
        error = np.einsum("kij,nkj->nki", across, rng.normal(size=(4000, len(away), 3)))
        moved = np.linalg.solve(normals, np.einsum("nki,k->in", error, 1.0 / length)).T
        drawn = np.sqrt(np.mean(np.sum(moved**2, axis=1)) * len(away))
        assert own.reach[k] == pytest.approx(drawn, rel=0.06)


def errors(kind: str, xy: np.ndarray, image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(m, 2) mm, image errors of 1.2 µm that no set contains: bumps of the sensor, or a field of every photograph."""
    if kind == "bumps":
        d = np.zeros_like(xy)
        for _ in range(8):
            at, push = rng.uniform(-0.9, 0.9, 2) * (6.6, 4.4), rng.normal(size=2)
            d += push * np.exp(-np.sum(((xy - at) / 0.9) ** 2, axis=1))[:, None]
    else:
        n = int(image.max()) + 1
        waves, phases = rng.normal(0.0, 0.3, (n, 2, 20, 2)), rng.uniform(0.0, 2.0 * np.pi, (n, 2, 20))
        angle = np.einsum("mawk,mk->maw", waves[image], xy) + phases[image]
        d = np.cos(angle).mean(axis=2)
    return 1.2e-3 * d / np.sqrt(np.mean(d**2))


def flight(seed: int, kind: str) -> tuple[aerotri.Block, np.ndarray]:
    """A flight without control, with an unknown lens; and its object points (N, 3) m."""
    made = aerotri.simulate(DRONE, seed=seed)
    rays, rng = made.block.image_points, np.random.default_rng(seed)
    xy = rays.xy
    r2 = np.sum((xy / 8.8) ** 2, axis=1)
    lens = xy * (rng.normal(0.0, 2e-3, 2) @ [r2, r2**2])[:, None]
    moved = replace(rays, xy=xy + lens + errors(kind, xy, rays.image, rng))
    return aerotri.with_settings(replace(made.block, image_points=moved), robust="huber"), made.truth.points


def shape_error(block: aerotri.Block, truth: np.ndarray, parameters: str) -> float:
    """m, RMS of the points of three rays after a similarity onto the truth, by the public way."""
    block = aerotri.with_settings(block, parameters=parameters, model_part="off")
    points = aerotri.adjust(block, explain=False).adjusted.points
    seen = points.rays >= 3
    fitted = fit_similarity(points.xyz[seen], truth[seen], np.ones((int(seen.sum()), 3)))
    return float(np.sqrt(np.mean(np.sum(fitted.residual**2, axis=1))))


@pytest.mark.parametrize("kind", ["bumps", "photographs"])
def test_a_flight_without_control_keeps_its_shape(kind):
    """The set chosen by default does about as well as the best one, which only the truth can name."""
    ratios = []
    for seed in (1, 2):
        block, truth = flight(seed, kind)
        best = min(shape_error(block, truth, spec) for spec in FIXED_SETS)
        ratios.append(shape_error(block, truth, "auto") / best)
    assert np.exp(np.mean(np.log(ratios))) < 1.4
    assert max(ratios) < 2.5


def test_a_part_that_control_does_not_hold_is_no_sample(monkeypatch):
    """Control in the corners alone, no positions: the photographs around one of them have no datum of their own."""
    monkeypatch.setattr(parameter_sample, "MOST_PHOTOGRAPHS", 8)
    block = small_block(7, control={"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05]})[0]
    given = block.control
    place = given.xyz[:, :2] - given.xyz[:, :2].mean(axis=0)
    corners = sorted({int(np.argmax(place @ way)) for way in ([1, 1], [1, -1], [-1, 1], [-1, -1])})
    off = np.setdiff1d(np.arange(len(given.point)), corners)
    block = aerotri.edit(block, off=block.points[given.point[off]].astype(str).tolist())
    choice = choose_parameters(with_adjustment(block, additional_parameters=AUTO))
    assert any(outcome.converged for outcome in choice.compared.outcomes)
    assert "chosen" in choice.chosen.reason


def test_compared_sets_know_their_object():
    compared = compare_parameters(small_block(3)[0], [parse_parameters(spec) for spec in ("none", "bluh:1-12")])
    none, bluh = compared.outcomes
    assert 0.0 < leverage(none, bluh) < MOST_LEVERAGE
