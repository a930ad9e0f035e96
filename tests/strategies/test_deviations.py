"""Parameters that differ from group to group: the likelihood against dense algebra, known sizes found again."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.deviations import size_mm
from aerotri.adjustment.track import with_named_strips
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.functional_model.additional_parameters import parameter_set
from aerotri.observations import Block, DeviationSettings
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.strategies.deviation_estimation import ReducedToGroups
from dense_algebra import TINY, dense_design
from small_blocks import small_block, with_adjustment

PARAMETERS = "bluh:9+3"


def in_strips(block: Block, kind: str = "independent", **known: float) -> Block:
    deviations = DeviationSettings(kind, {f"bluh.{name[1:]}": size for name, size in known.items()} or None)
    block = with_adjustment(block, parameter_groups="strip", model_part="off")
    return replace(block, settings=replace(block.settings, deviations=deviations))


def with_changes(block: Block, size_um: float, seed: int) -> tuple[Block, np.ndarray]:
    """The block with bluh.9 of another size in every strip; the sizes (µm)."""
    names, strip = np.unique(block.images.strip.astype(str), return_inverse=True)
    change = np.random.default_rng(seed).normal(0.0, size_um, len(names))
    camera, rays = block.cameras[0], block.image_points
    pattern = parameter_set("bluh", ("9",), camera).basis(*rays.xy.T)[:, :, 0] / size_mm(camera, "bluh.9")
    xy = rays.xy + 1e-3 * change[strip[rays.image], None] * pattern
    return replace(block, image_points=replace(rays, xy=xy)), change


def reduced_of(found) -> ReducedToGroups:
    factor = found.system.factorise(found.solution.equations)
    return ReducedToGroups.of(found.system, found.solution, factor)


@pytest.mark.parametrize("kind", ["independent", "walk"])
def test_likelihood_against_dense_algebra(kind):
    """−2 ln L up to a constant from the covariance of all observations, means and other unknowns projected out."""
    block = in_strips(small_block(3, PARAMETERS, **TINY)[0], kind, b9=1.0, b3=0.7)
    found = adjust_keeping_system(block)
    reduced, state, u = reduced_of(found), found.solution.state, found.system.unknowns
    design = dense_design(found)
    columns = 6 * len(u.images) + np.concatenate([one.columns for one in reduced.deviations])
    observed = (np.delete(design, columns, axis=1) != 0.0).any(axis=1)
    a, others = design[observed][:, columns], np.delete(design[observed], columns, axis=1)
    m = [len(one.groups) for one in reduced.deviations]
    ends = np.cumsum([0, *m])
    means = np.stack([a[:, i:j].sum(axis=1) for i, j in itertools.pairwise(ends)], axis=1)
    others = np.concatenate([others[:, (others != 0.0).any(axis=0)], means], axis=1)
    left = np.linalg.svd(others / np.linalg.norm(others, axis=0), full_matrices=True)[0][:, others.shape[1] :]
    residual = (found.solution.equations.residual * u.rays.inv_sigma).ravel()
    given = [
        np.sqrt(u.prior_weight[p, axis]) * (u.prior_xyz[p, axis] - state.points[p, axis])
        for p, axis in zip(*np.nonzero(u.prior_weight), strict=True)
    ]
    y = left.T @ (np.concatenate([residual, given]) + a @ state.shared[columns - 6 * len(u.images)])
    seen = left.T @ a

    def covariance(count: int, size: float) -> np.ndarray:
        steps = np.tril(np.ones((count, count)))[:, 1:] if kind == "walk" else np.eye(count)
        return size**2 * steps @ steps.T

    def dense(sizes: tuple[float, float]) -> float:
        k = np.zeros((len(columns), len(columns)))
        for one, i, j, size in zip(reduced.deviations, ends[:-1], ends[1:], sizes, strict=True):
            k[i:j, i:j] = covariance(j - i, 1e-3 * size / one.size_mm)
        v = np.eye(len(y)) + seen @ k @ seen.T
        return len(y) * np.log(y @ np.linalg.solve(v, y)) + np.linalg.slogdet(v)[1]

    cases = [(1.0, 0.7), (0.1, 0.1), (5.0, 0.02), (0.01, 8.0)]
    ours = np.array([reduced.deviance(2.0 * np.log(np.array(case)))[0] for case in cases])
    expected = np.array([dense(case) for case in cases])
    assert reduced.freedom == pytest.approx(len(y))
    np.testing.assert_allclose(ours - ours[0], expected - expected[0], atol=1e-4)


def test_derivatives_of_the_likelihood():
    found = adjust_keeping_system(in_strips(with_changes(small_block(4, PARAMETERS)[0], 2.0, 4)[0], b9=1.0, b3=0.5))
    reduced, x, h = reduced_of(found), np.array([0.3, -1.0]), 1e-4
    slopes = reduced.deviance(x)[1]
    for k in range(2):
        step = h * np.eye(2)[k]
        numeric = (reduced.deviance(x + step)[0] - reduced.deviance(x - step)[0]) / (2.0 * h)
        assert slopes[k] == pytest.approx(numeric, rel=1e-4, abs=1e-4)


def test_large_deviations_are_free_groups_and_small_ones_a_common_set():
    block = with_changes(small_block(5, PARAMETERS)[0], 2.0, 5)[0]
    free = adjust(with_adjustment(block, parameter_groups="strip", model_part="off"))
    common = adjust(with_adjustment(block, parameter_groups="block", model_part="off"))
    loose, tight = adjust(in_strips(block, b9=1e5, b3=1e5)), adjust(in_strips(block, b9=1e-4, b3=1e-4))
    np.testing.assert_allclose(loose.points.xyz, free.points.xyz, atol=1e-6)
    np.testing.assert_allclose(tight.points.xyz, common.points.xyz, atol=1e-5)
    assert tight.parameters.value[0] == pytest.approx(common.parameters.value[0], rel=1e-3)
    assert len(tight.parameters) == len(free.parameters)


def test_changes_from_strip_to_strip_are_found_and_their_size():
    """Twelve strips: the size is known to a quarter; where nothing changes, nothing is found."""
    flight = {"flight": {"gsd_m": 0.1, "strips": 12, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.4}}
    block = small_block(6, "bluh:9+3", **flight)[0]
    changed, change = with_changes(block, 2.0, 6)
    found = adjust(in_strips(changed)).deviations
    sizes = {one.name: one.sigma_um for one in found.found}
    assert found.needed
    assert found.p < 1e-6
    assert sizes["bluh.9"] == pytest.approx(change.std(ddof=1), rel=0.4)
    assert sizes["bluh.3"] < 0.3
    assert "differ between the groups" in found.sentence
    assert "bluh.9" in found.sentence
    quiet = adjust(in_strips(block)).deviations
    assert not quiet.needed
    assert quiet.total_um < 0.5
    assert "one set serves all photographs" in quiet.sentence


def test_a_result_reopens_with_the_sizes_found(tmp_path):
    found = adjust_keeping_system(in_strips(with_changes(small_block(7, PARAMETERS)[0], 2.0, 7)[0], "walk"))
    write_block(found.result.block, tmp_path / "block")
    write_solution(tmp_path / "solution.npz", found.system, found.solution, found.local)
    again = reopen(read_block(tmp_path / "block"), read_solution(tmp_path / "solution.npz"))
    assert again.result.block.settings.deviations == found.result.block.settings.deviations
    np.testing.assert_allclose(again.result.points.covariance, found.result.points.covariance, rtol=1e-6)
    assert again.result.deviations.ratio == pytest.approx(found.result.deviations.ratio, rel=1e-3, abs=1e-3)
    assert again.result.deviations.kind == "walk"


def test_strips_without_names_are_found_from_the_track():
    block = in_strips(small_block(8, PARAMETERS)[0])
    images = block.images
    unnamed = replace(block, images=replace(images, strip=np.full(len(images), "", dtype=object)))
    found = with_named_strips(unnamed).images.strip
    pairs = set(zip(found.tolist(), images.strip.tolist(), strict=True))
    assert len(pairs) == len(set(images.strip.tolist())) == len(set(found.tolist()))
    nowhere = replace(unnamed, images=replace(unnamed.images, centre=np.full((len(images), 3), np.nan)))
    with pytest.raises(InputError, match="names no strips"):
        with_named_strips(nowhere)
    assert with_named_strips(block) is block


def test_size_of_a_pattern():
    """[D] Of K1 on a square of half width h: the mean of r⁶ is h⁶·(2/7 + 2/5)."""
    camera = replace(small_block(1)[0].cameras[0], size_px=(1000, 1000))
    h = camera.half_format_mm[0]
    assert size_mm(camera, "brown.K1") == pytest.approx(h**3 * np.sqrt(2.0 / 7.0 + 2.0 / 5.0), rel=0.02)
