"""Pickets on rendered photographs: heights normalised by their σ, holes where there is nothing to match."""

from dataclasses import replace

import numpy as np
import pytest
from rendered_blocks import Rendered, write_photograph

from aerotri.conventions import InputError
from aerotri.rasters.images import open_photograph
from aerotri.terrain.dtm import TerrainPlan, chosen_rows, make_terrain_model, models_of
from aerotri.terrain.error_pickets import with_error_pickets
from aerotri.terrain.matching import measure, steps_aside
from aerotri.terrain.photographs import PyramidStore, read_pyramid, sixteen_bits
from aerotri.terrain.pickets import Area, MatchOptions, Models, grid_nodes


def off(rendered: Rendered, pickets, own) -> np.ndarray:
    return pickets.xyz[own, 2] - rendered.truth(pickets.xyz[own])


def test_heights_are_right_within_their_sigma(rendered, pickets):
    """Normalised errors: mean and variance in the 99.9 % bands of the effective number of pickets; single values too.

    Windows of neighbouring pickets do not overlap by more than a third: half the pickets count as independent.
    """
    own = pickets.accepted
    d = off(rendered, pickets, own)
    assert own.sum() > 1200
    assert np.abs(d).max() < 0.25
    z = d / pickets.sigma[own, 2]
    n = own.sum() / 2
    assert abs(z.mean()) < 3.3 / np.sqrt(n) + 0.15
    assert 0.8 < z.std() < 1.25
    assert (np.abs(z) > 5.0).mean() < 0.001
    assert np.median(pickets.sigma[own, 2]) < 0.06


def test_no_gross_error_passes_the_threshold(rendered, pickets):
    """At 0.90 every accepted height is right to a quarter of a pixel of parallax, 1.1 m of height."""
    assert (np.abs(off(rendered, pickets, pickets.accepted)) > 1.1).sum() == 0
    assert pickets.correlation[pickets.accepted].min() >= 0.90


def test_pickets_stand_on_their_nodes_with_their_photographs(rendered, pickets):
    own = pickets.accepted & (pickets.tries == 0)
    assert np.abs(pickets.xyz[own, :2] - pickets.node[own]).max() < 0.5
    multiples = pickets.node / 12.0
    np.testing.assert_allclose(multiples, np.round(multiples), atol=1e-9)
    rays = (pickets.photographs[pickets.accepted] >= 0).sum(axis=1)
    assert rays.min() >= 2
    assert rays.max() >= 3
    centres = rendered.calibration.result.images.centre
    row = np.flatnonzero(own)[300]
    shown = pickets.photographs[row][pickets.photographs[row] >= 0]
    away = np.hypot(*(centres[:, :2] - pickets.xyz[row, :2]).T)
    assert set(shown) == set(np.argsort(away)[: len(shown)])


def test_covariance_is_that_of_rays(rendered, pickets):
    """σ of X, Y and Z stand to each other as base and height let expect; the covariance is one."""
    own = pickets.accepted
    assert np.linalg.eigvalsh(pickets.covariance[own]).min() > 0.0
    assert 2.0 < np.median(pickets.sigma[own, 2] / pickets.sigma[own, 0]) < 12.0


def painted(rendered: Rendered, folder, change):
    """The block with photographs in which the pixels that show a piece of ground are changed."""
    folder.mkdir()
    paths = []
    from aerotri.terrain.photographs import site_at

    site = site_at(rendered.photographs(), 0.0, 0.0)
    for k, path in enumerate(rendered.paths):
        with open_photograph(path) as photograph:
            pixels = photograph.read(0, photograph.rows)[0].copy()
        column, row = np.meshgrid(np.arange(pixels.shape[1]) + 0.5, np.arange(pixels.shape[0]) + 0.5)
        half_c, half_r, per_mm = rendered.photographs().sensor[k]
        c, x0, y0 = site.photos[0, k, 12:15]
        ray = np.stack([(column - half_c) / per_mm - x0, (half_r - row) / per_mm - y0, np.full(column.shape, -c)])
        rotation = rendered.photographs().orientation.rotation[k]
        ray = np.tensordot(rotation, ray, 1)
        centre = rendered.photographs().centres[k]
        height = np.full(column.shape, 100.0)
        for _ in range(12):
            x, y = (centre[a] + ray[a] / ray[2] * (height - centre[2]) for a in range(2))
            height = rendered.scene.terrain.height(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        paths.append(write_photograph(folder / path.name, change(pixels, x, y, np.random.default_rng(k))))
    return replace(rendered, paths=tuple(paths))


POND, DARK, FIELD = (-100.0, 60.0), (110.0, -60.0), (0.0, -150.0)


def ponds(pixels, x, y, rng):
    """Water that glitters anew in every photograph, a shadow without light, rows of plants two metres apart."""
    out = pixels.astype(float)
    noise = rng.normal(0.0, 1.0, out.shape)
    pond, dark, field = (np.hypot(x - px, y - py) < 45.0 for px, py in (POND, DARK, FIELD))
    out[pond] = 14000.0 + 1500.0 * noise[pond]
    out[dark] = np.clip(300.0 + 60.0 * noise[dark], 0.0, None)
    rows = 16000.0 + 5000.0 * np.sin(2 * np.pi * (0.7 * x + 0.71 * y) / 6.0)
    out[field] = (rows + 40.0 * noise)[field]
    return np.clip(np.rint(out), 0, 65535).astype(np.uint16)


def test_water_dark_and_repetitive_ground_give_holes_and_no_peaks(rendered, tmp_path):
    changed = painted(rendered, tmp_path / "ponds", ponds)
    found = measure(changed.photographs(), rendered.calibration.result.points.xyz, MatchOptions(interval=12.0))
    found = with_error_pickets(found, 4.5)
    own = found.accepted
    for place in (POND, DARK, FIELD):
        inside = np.hypot(*(found.node - place).T) < 30.0
        assert inside.sum() >= 15
        assert own[inside].sum() <= 0.1 * inside.sum()
    # the painted edges are sharp to a pixel, 4.5 m of height: nothing is off by more
    away = np.abs(off(rendered, found, own))
    assert away.max() < 5.0
    assert (away > 1.1).mean() < 0.01
    outside = np.ones(len(found), bool)
    for place in (POND, DARK, FIELD):
        outside &= np.hypot(*(found.node - place).T) > 70.0
    assert own[outside & (found.status != 1)].mean() > 0.97


def test_pickets_step_aside(rendered, tmp_path):
    """A blot as wide as a window hides a node: its picket stands beside it, and is right there."""

    def blots(pixels, x, y, rng):
        out = pixels.copy()
        noise = rng.integers(0, 40000, out.shape).astype(np.uint16)
        blot = (np.abs(x) < 6.0) & (np.abs(y) < 6.0)
        out[blot] = noise[blot]
        return out

    changed = painted(rendered, tmp_path / "blots", blots)
    area = Area(np.array([-60.0, -60.0]), np.array([60.0, 60.0]))
    options = MatchOptions(interval=60.0)
    found = measure(changed.photographs(), rendered.calibration.result.points.xyz, options, area)
    node = np.flatnonzero((found.node == 0.0).all(axis=1))[0]
    assert found.accepted[node]
    assert found.tries[node] > 0
    assert 6.0 < np.hypot(*found.xyz[node, :2]) <= 0.4 * 60.0 + 1.0
    assert abs(off(rendered, found, [node])[0]) < 0.3


def test_steps_aside_go_outwards_and_stay_between_the_nodes():
    offsets = steps_aside(MatchOptions(interval=50.0, aside_px=4.0, most_aside=24), 1.0)
    away = np.hypot(*offsets.T)
    assert len(offsets) == 25
    assert away[0] == 0.0
    assert (np.diff(away) >= 0.0).all()
    assert away.max() <= 20.0


def test_errors_are_found_by_neighbours_and_as_peaks(rendered, pickets):
    """Pickets moved by 8 m and more are found, and of the others hardly any."""
    rng = np.random.default_rng(5)
    rows = rng.choice(np.flatnonzero(pickets.accepted), 40, replace=False)
    xyz = pickets.xyz.copy()
    xyz[rows, 2] += rng.choice([-1.0, 1.0], 40) * rng.uniform(8.0, 40.0, 40)
    found = with_error_pickets(replace(pickets, xyz=xyz), 4.5)
    assert found.errors[rows].mean() >= 0.95
    others = np.setdiff1d(np.flatnonzero(pickets.accepted), rows)
    assert found.errors[others].mean() < 0.01


def test_models_of_pairs_and_subsets(rendered):
    calibration = rendered.calibration
    assert chosen_rows(calibration, "odd").tolist() in ([0, 2], [1, 3])
    both = np.concatenate([chosen_rows(calibration, name) for name in ("odd", "even")])
    assert sorted(both.tolist()) == [0, 1, 2, 3]
    photographs = rendered.photographs()
    models = models_of(calibration, photographs)
    assert np.abs(np.diff(models.pairs, axis=1)).max() == 1
    assert len(models.pairs) == 3
    found = measure(photographs, calibration.result.points.xyz, MatchOptions(interval=40.0), None, models)
    own = found.accepted
    assert own.sum() > 50
    assert set(found.model[own]) <= {0, 1, 2}
    for k in np.flatnonzero(own):
        assert set(found.photographs[k]) == set(models.pairs[found.model[k]])
    assert np.abs(off(rendered, found, own)).max() < 0.3


def test_y_parallax_does_not_pull_the_height(rendered):
    """A photograph moved across the base by half a pixel: heights change as a model does, not from window to window."""
    photographs = rendered.photographs()
    pair = photographs.centres[:2, :2]
    base = (pair[1] - pair[0]) / np.hypot(*(pair[1] - pair[0]))
    moved = photographs.orientation.centre.copy()
    moved[1, :2] += 0.5 * np.array([-base[1], base[0]])
    orientation = replace(photographs.orientation, centre=moved)
    other = replace(photographs, orientation=orientation, centres=photographs.places.from_local(moved))
    models = Models(np.array([[0, 1]]), pair.mean(axis=0)[None])
    known, options = rendered.calibration.result.points.xyz, MatchOptions(interval=24.0)
    found = [measure(p, known, options, None, models) for p in (photographs, other)]
    own = found[0].accepted & found[1].accepted & (found[0].tries == 0) & (found[1].tries == 0)
    assert own.sum() > 80
    change = found[1].xyz[own, 2] - found[0].xyz[own, 2]
    plan = np.column_stack([np.ones(own.sum()), found[0].node[own] / 100.0])
    design = np.column_stack([plan, plan[:, 1:] ** 2, plan[:, 1] * plan[:, 2]])
    change -= design @ np.linalg.lstsq(design, change, rcond=None)[0]
    # a twentieth of a pixel of parallax is 0.2 m
    assert change.std() < 0.06


def test_grid_nodes_are_the_same_for_overlapping_areas():
    one = grid_nodes(Area(np.array([-13.0, 3.0]), np.array([31.0, 22.0])), 10.0)
    np.testing.assert_array_equal(one, [[-10, 10], [0, 10], [10, 10], [20, 10], [30, 10], [-10, 20], [0, 20], [10, 20],
                                        [20, 20], [30, 20]])  # fmt: skip


def test_pyramid_levels_are_means_of_four(tmp_path):
    pixels = np.arange(12 * 10, dtype=np.uint8).reshape(10, 12)
    levels = read_pyramid(write_photograph(tmp_path / "a.tif", pixels), (12, 10), 2)
    assert sixteen_bits(levels[0])[3, 4] == 256 * int(pixels[3, 4])
    assert levels[1][2, 1] == 64 * pixels[4:6, 2:4].astype(int).sum()
    with pytest.raises(InputError, match="its camera has"):
        read_pyramid(tmp_path / "a.tif", (10, 12), 1)


def test_terrain_model_has_sigma_of_matching_and_adjustment(rendered):
    plan = TerrainPlan(np.arange(4), rendered.paths, interval=16.0)
    found = make_terrain_model(rendered.calibration, plan)
    known = np.isfinite(found.dsm.z)
    x, y = found.dsm.grid.x(np.arange(found.dsm.grid.columns)), found.dsm.grid.y(np.arange(found.dsm.grid.rows))
    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    d = (found.dsm.z.ravel() - rendered.scene.terrain.height(cells))[known.ravel()]
    z = d / found.dsm.sigma[known]
    assert 0.5 < 1.4826 * np.median(np.abs(z)) < 1.6
    assert found.interpolation == pytest.approx(np.std(d), rel=0.6)
    assert (found.adjustment[found.pickets.accepted] >= 0.0).all()
    with pytest.raises(InputError, match="no ground point"):
        make_terrain_model(rendered.calibration, replace(plan, area=Area(np.array([1.0, 1.0]), np.array([2.0, 2.0]))))


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
def test_pyramids_beyond_the_memory_allowed_are_read_again(tmp_path, kind):
    rng = np.random.default_rng(5)
    pixels = [rng.integers(0, 255, (64, 96)).astype(kind) for _ in range(3)]
    paths = [write_photograph(tmp_path / f"{k}.tif", p) for k, p in enumerate(pixels)]
    times = 256 if kind == "uint8" else 1
    store = PyramidStore(paths, [(96, 64)] * 3, 3, most_bytes=3 * 64 * 96 * np.dtype(kind).itemsize)
    for k in (0, 1, 0, 2, 1):
        np.testing.assert_array_equal(sixteen_bits(store.level(k, 0)), pixels[k].astype(np.uint16) * times)
        half = pixels[k].reshape(32, 2, 48, 2).sum(axis=(1, 3), dtype=np.int64) * times
        np.testing.assert_array_equal(store.level(k, 1), (half + 2) // 4)
        assert store._bytes <= 3 * 64 * 96 * np.dtype(kind).itemsize
    assert 3 < store.reads < 12
    assert PyramidStore(paths, [(96, 64)] * 3, 3).level(2, 2).shape == (16, 24)
