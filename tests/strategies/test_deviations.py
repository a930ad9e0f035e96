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
from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters
from aerotri.observations import Block, DeviationSettings
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.strategies.deviation_estimation import LEAST, ReducedToGroups
from dense_algebra import TINY, dense_design
from rig_blocks import rig_block
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


def observed_gaps(found) -> np.ndarray:
    """Whitened misclosures of rays, control and GNSS, in the order of `dense_design`."""
    system, state, u = found.system, found.solution.state, found.system.unknowns
    gaps = [(found.solution.equations.residual * u.rays.inv_sigma).ravel()]
    rows, axes = np.nonzero(u.prior_weight)
    gaps.append((np.sqrt(u.prior_weight) * (u.prior_xyz - state.points))[rows, axes])
    gaps += [beside.gap[beside.inv_sigma > 0.0] for beside in system.whitened_rows(state)]
    return np.concatenate(gaps)


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
    y = left.T @ (observed_gaps(found) + a @ state.shared[columns - 6 * len(u.images)])
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


GNSS = {"gnss": {"sigma_m": [0.02, 0.02, 0.03]}}
INTERIOR = "bluh:3,interior"


def with_free_interior(block: Block, *held: str) -> Block:
    """The block with principal distance and principal point of its camera unknown."""
    camera = block.cameras[0]
    interior = {name: replace(prior, fixed=name in held) for name, prior in camera.interior.items()}
    return replace(block, cameras=(replace(camera, interior=interior),))


def tied_interior(block: Block, kind: str = "independent", **known: float) -> Block:
    """The block in strips whose interior orientation changes; sizes of c, x0, y0 where they are given."""
    sizes = {f"interior.{item}": size for item, size in known.items()}
    deviations = DeviationSettings(kind, sizes | {"bluh.3": 1e-3} if sizes else None)
    block = with_adjustment(block, parameter_groups="strip", model_part="off")
    return replace(block, settings=replace(block.settings, deviations=deviations))


def with_interior_changes(block: Block, um: tuple[float, float, float], seed: int) -> tuple[Block, np.ndarray]:
    """The block with other c, x0, y0 in every strip; their differences from the mean (strips, 3) mm."""
    names, strip = np.unique(block.images.strip.astype(str), return_inverse=True)
    change = 1e-3 * np.array(um) * np.random.default_rng(seed).normal(size=(len(names), 3))
    change -= change.mean(axis=0)
    camera, rays = block.cameras[0], block.image_points
    of_ray = change[strip[rays.image]]
    ideal = (rays.xy - camera.principal_point_mm) / camera.focal_length_mm
    return replace(block, image_points=replace(rays, xy=rays.xy + of_ray[:, 1:] + of_ray[:, :1] * ideal)), change


def test_changes_of_the_interior_orientation_are_what_other_values_of_it_do():
    """Partials by c, x0, y0 of a strip: differences of image points that another camera would measure."""
    block = small_block(1)[0]
    camera, h = block.cameras[0], 1e-4
    direction = np.random.default_rng(1).uniform(-0.4, 0.4, (50, 2))
    values = {name: camera.interior[name].value for name in ("focal_length_mm", "x0_mm", "y0_mm")}

    def measured(interior: dict[str, float]) -> np.ndarray:
        return interior["focal_length_mm"] * direction + [interior["x0_mm"], interior["y0_mm"]]

    basis = parameter_set("interior", ("c", "x0", "y0"), camera).basis(*measured(values).T)
    for k, name in enumerate(values):
        numeric = (measured(values | {name: values[name] + h}) - measured(values)) / h
        np.testing.assert_allclose(basis[:, :, k], numeric, atol=1e-9)


def test_interior_orientation_that_does_not_change_is_that_of_the_camera():
    """Size 0 is the adjustment without the family; the mean of the changes is 0 for any size."""
    block = with_free_interior(small_block(2, INTERIOR, **GNSS)[0])
    block = with_interior_changes(block, (10.0, 5.0, 5.0), 2)[0]
    none = adjust(with_adjustment(small_parameters(block, "bluh:3"), parameter_groups="block", model_part="off"))
    tight = adjust(tied_interior(block, c=1e-4, x0=1e-4, y0=1e-4))
    np.testing.assert_allclose(tight.points.xyz, none.points.xyz, atol=1e-4)
    np.testing.assert_allclose(tight.points.sigma, none.points.sigma, rtol=1e-3)
    assert tight.outcome.redundancy == none.outcome.redundancy
    loose = adjust(tied_interior(block, "walk", c=5.0, x0=5.0, y0=5.0)).parameters
    for item in ("c", "x0", "y0"):
        assert abs(loose.value[loose.names == f"interior.{item}"].mean()) < 1e-6


def small_parameters(block: Block, parameters: str) -> Block:
    return with_adjustment(block, additional_parameters=parse_parameters(parameters))


def test_changes_of_the_interior_orientation_are_found_with_gnss():
    flight = {"flight": {"gsd_m": 0.1, "strips": 10, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.4}}
    block = with_free_interior(small_block(3, INTERIOR, **flight, **GNSS)[0])
    block, change = with_interior_changes(block, (8.0, 8.0, 8.0), 3)
    result = adjust(tied_interior(block))
    p, by_name = result.parameters, {one.name: one for one in result.deviations.found}
    assert result.deviations.needed
    assert by_name["bluh.3"].sigma_um < 0.5
    strips = np.unique(block.images.strip.astype(str))
    z = []
    for k, item in enumerate(("c", "x0", "y0")):
        assert 1e3 * by_name[f"interior.{item}"].sigma == pytest.approx(1e3 * change[:, k].std(ddof=1), rel=0.7)
        rows = np.flatnonzero(p.names == f"interior.{item}")
        rows = rows[np.argsort(p.groups[rows].astype(str))]
        assert p.groups[rows].tolist() == strips.tolist()
        z.append((p.value[rows] - change[:, k]) / p.sigma[rows])
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_interior_orientation_likelihood_against_dense_algebra():
    """The camera's own c and x0 are unknown too: they are the mean."""
    block = with_free_interior(small_block(3, "interior:c+x0", **TINY, **GNSS)[0], "y0_mm")
    found = adjust_keeping_system(tied_interior(block, c=1.0, x0=3.0))
    reduced, state, u = reduced_of(found), found.solution.state, found.system.unknowns
    design = dense_design(found)
    columns = 6 * len(u.images) + np.concatenate([one.columns for one in reduced.deviations])
    observed = (np.delete(design, columns, axis=1) != 0.0).any(axis=1)
    a, others = design[observed][:, columns], np.delete(design[observed], columns, axis=1)
    others = others[:, (others != 0.0).any(axis=0)]
    left = np.linalg.svd(others / np.linalg.norm(others, axis=0), full_matrices=True)[0][:, others.shape[1] :]
    y = left.T @ (observed_gaps(found) + a @ state.shared[columns - 6 * len(u.images)])
    seen, ends = left.T @ a, np.cumsum([0, *(len(one.groups) for one in reduced.deviations)])

    def dense(sizes: tuple[float, float]) -> float:
        k = np.zeros((len(columns), len(columns)))
        for one, i, j, size in zip(reduced.deviations, ends[:-1], ends[1:], sizes, strict=True):
            k[i:j, i:j] = (1e-3 * size / one.size_mm) ** 2 * (np.eye(j - i) - 1.0 / (j - i))
        v = np.eye(len(y)) + seen @ k @ seen.T
        return len(y) * np.log(y @ np.linalg.solve(v, y)) + np.linalg.slogdet(v)[1]

    cases = [(1.0, 3.0), (0.1, 0.1), (5.0, 0.2), (0.02, 8.0)]
    ours = np.array([reduced.deviance(2.0 * np.log(np.array(case)))[0] for case in cases])
    expected = np.array([dense(case) for case in cases])
    assert reduced.freedom == pytest.approx(len(y))
    np.testing.assert_allclose(ours - ours[0], expected - expected[0], atol=1e-3)


@pytest.mark.parametrize(("kind", "groups"), [("free", "strip"), ("independent", "block")])
def test_changes_of_the_interior_orientation_need_groups_that_are_tied(kind, groups):
    block = with_adjustment(tied_interior(small_block(1, INTERIOR)[0], kind), parameter_groups=groups)
    with pytest.raises(InputError, match="changes of the interior orientation"):
        adjust(block)


def test_changes_of_the_interior_orientation_need_a_mean_that_may_differ_from_the_calibration():
    block = with_free_interior(small_block(1, INTERIOR)[0], "x0_mm")
    with pytest.raises(InputError, match="x0_mm of camera 'ucd', the mean of the groups, is held"):
        adjust(tied_interior(block))


def test_one_parameter_among_many_is_found():
    """bluh.9 changes and eleven others do not: a common size of all of them would hide it."""
    flight = {"flight": {"gsd_m": 0.1, "strips": 8, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.4}}
    block = with_changes(small_block(6, "bluh", **flight)[0], 0.6, 6)[0]
    found = adjust_keeping_system(in_strips(block))
    assert found.result.deviations.needed
    reduced = reduced_of(found)
    nine = [one.name for one in reduced.deviations].index("bluh.9")
    low = 2.0 * np.log(LEAST * block.settings.image_sigma_um)
    x = np.full(len(reduced.deviations), low)
    alone, other = reduced.alone(nine), x.copy()
    other[nine] = 0.0
    ours = alone.deviance(np.array([0.0]))[0] - alone.deviance(np.array([low]))[0]
    assert ours == pytest.approx(reduced.deviance(other)[0] - reduced.deviance(x)[0], abs=0.05)


def test_size_of_a_pattern():
    """[D] Of K1 on a square of half width h: the mean of r⁶ is h⁶·(2/7 + 2/5)."""
    camera = replace(small_block(1)[0].cameras[0], size_px=(1000, 1000))
    h = camera.half_format_mm[0]
    assert size_mm(camera, "brown.K1") == pytest.approx(h**3 * np.sqrt(2.0 / 7.0 + 2.0 / 5.0), rel=0.02)


def test_cameras_that_share_the_parameters_of_a_strip_are_named():
    """By camera each has its own and nothing is said; by strip the heads of a rig share a set."""
    block = with_adjustment(rig_block(2)[0], additional_parameters=parse_parameters("brown:K1"), model_part="off")
    said = {
        how: [w for w in adjust(with_adjustment(block, parameter_groups=how)).outcome.warnings if "share one set" in w]
        for how in ("camera", "strip")
    }
    assert not said["camera"]
    assert len(said["strip"]) == 1
    assert "have 5 cameras" in said["strip"][0]
