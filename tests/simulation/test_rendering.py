"""Rendered photographs: they show every point where the block says it is measured."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError, px_from_mm
from aerotri.image_errors.tile_grid import seams_px
from aerotri.simulation import parse_spec, read_spec, simulate
from aerotri.simulation.camera_errors import ImageError
from aerotri.simulation.projection import Photographs
from aerotri.simulation.rendering import RenderOptions, Scene, _first_met, make_scene, render, rendered_rows
from aerotri.simulation.rendering_texture import Texture
from aerotri.simulation.terrain import Terrain
from small_blocks import small_spec

PLAIN = RenderOptions(contrast=0.0, noise=0.0, targets=True)
UCD = {"preset": "ultracam_d", "size_px": [575, 375], "pixel_um": 180.0}
DMC = {"preset": "dmc", "size_px": [576, 320], "pixel_um": 288.0}
FILM = {"preset": "rmk_top_15", "size_px": [400, 400], "pixel_um": 575.0}
LENS = {"model": "frame", "size_px": [500, 400], "pixel_um": 40.0, "focal_length_mm": 20.0}


def simulated(camera, errors, seed=1, **changes):
    tables = small_spec(camera={"cam": camera | {"errors": errors}}, **changes)
    tables["flight"] = tables["flight"] | {"gsd_m": 1.0, "images_per_strip": 4, "cross_strips": []}
    tables["tie_points"] = {"per_image": 20, "probability": 0.9, "sigma_um": 0.0, "stated_sigma_um": 2.0}
    tables["control"] = {"distance_bases": 1.5, "sigma_m": [0.03] * 3, "check_points": 12}
    spec = parse_spec(tables)
    return spec, *simulate(spec, seed)


def centroids(image, places, level, reach=8):
    found = np.full(places.shape, np.nan)
    for k, place in enumerate(places):
        c, r = np.floor(place).astype(int)
        window = image[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1].astype(float) - level
        if window.shape == (2 * reach + 1, 2 * reach + 1):
            y, x = np.indices(window.shape)
            found[k] = [np.sum(window * x), np.sum(window * y)] / window.sum() + np.array([c, r]) - reach + 0.5
    return found


@pytest.mark.parametrize(
    ("camera", "errors"),
    [
        (UCD, {"physical": {"rms_um": 120.0}}),
        (UCD | {"flight_axis": "-x", "size_px": [375, 575]}, {"physical": {"rms_um": 120.0}}),
        (DMC, {"physical": {"rms_um": 150.0}}),
        (FILM, {"physical": {"rms_um": 300.0}, "brown": {"K1": -1e-6}, "interior": {"x0_mm": 0.4, "y0_mm": -0.3}}),
        (LENS, {"lens": {"k1": -0.08, "k2": 0.03, "p1": 1e-3}, "interior": {"focal_length_mm": 0.1}}),
    ],
    ids=["ultracam_d", "turned", "dmc", "film", "lens"],
)
def test_points_lie_where_they_are_measured(camera, errors):
    """Discs on the ground, the noise-free image points of the block: 0.02 px, through everything between them."""
    spec, block, truth = simulated(camera, errors)
    scene, rays, made = make_scene(spec, 1, block, truth, PLAIN), block.image_points, block.cameras[0]
    assert "lens" in errors or max(np.abs(sample.d).max() for sample in truth.image_errors) > 0.5 * made.pixel_mm
    off = []
    for image in (0, 5, 10):
        own = (rays.image == image) & np.isin(rays.point, block.control.point)
        places = px_from_mm(rays.xy[own], made.size_px, made.pixel_mm)
        apart = np.array([np.sort(np.hypot(*(places - p).T))[1] > 25 for p in places])
        for k, seams in enumerate(seams_px(made)):
            apart &= (np.abs(places[:, k, None] - seams) > 9).all(axis=1)
        off.append((centroids(render(scene, image), places, PLAIN.mean) - places)[apart])
    off = np.concatenate(off)
    off = off[np.isfinite(off).all(axis=1)]
    assert len(off) > 12
    assert np.abs(off).max() < 0.02


def test_texture_is_the_same_from_everywhere():
    """Any window of the lattice holds the same coefficients; mean 0, RMS 1; detail down to the finest nodes."""
    texture = Texture(0.5, 3)
    whole = texture.lattice(np.array([-200.0, -100.0]), np.array([900.0, 800.0]))
    part = texture.lattice(np.array([-13.3, 250.1]), np.array([77.0, 301.0]))
    i, j = part.row - whole.row, part.column - whole.column
    same = whole.values[i : i + part.values.shape[0], j : j + part.values.shape[1]]
    np.testing.assert_allclose(part.values, same, atol=1e-5)
    # coefficients vary a little more than the surface they span
    assert abs(whole.values.mean()) < 0.35
    assert 0.8 < whole.values.std() < 1.6
    differences = np.diff(whole.values, axis=1).std()
    assert 0.3 < differences < 1.2
    other = Texture(0.5, 4).lattice(np.array([-13.3, 250.1]), np.array([77.0, 301.0]))
    assert abs(np.corrcoef(other.values.ravel(), part.values.ravel())[0, 1]) < 0.5


def test_two_photographs_show_the_same_ground():
    """Neighbours resampled onto each other's ground correlate: the texture hangs on the ground, not on the image."""
    spec, block, truth = simulated(UCD, {})
    scene = make_scene(spec, 1, block, truth, RenderOptions(noise=0.0))
    left, right = render(scene, 1).astype(float), render(scene, 2).astype(float)
    rays = block.image_points
    both = np.intersect1d(rays.point[rays.image == 1], rays.point[rays.image == 2])
    assert len(both) >= 3
    camera, correlations = block.cameras[0], []
    for point in both:
        patches = []
        for k, image in ((1, left), (2, right)):
            row = (block.image_points.image == k) & (block.image_points.point == point)
            c, r = np.round(px_from_mm(block.image_points.xy[row], camera.size_px, camera.pixel_mm)[0] - 0.5).astype(
                int
            )
            patches.append(image[r - 10 : r + 11, c - 10 : c + 11])
        if all(patch.shape == (21, 21) for patch in patches):
            correlations.append(np.corrcoef(patches[0].ravel(), patches[1].ravel())[0, 1])
    assert np.median(correlations) > 0.8


def test_same_seed_same_photograph(monkeypatch):
    spec, block, truth = simulated(UCD, {"physical": {"rms_um": 60.0}})
    scene = make_scene(spec, 1, block, truth)
    first = render(scene, 3)
    monkeypatch.setenv("AEROTRI_THREADS", "1")
    np.testing.assert_array_equal(render(scene, 3), first)
    shares = []
    rows = list(rendered_rows(scene, 3, shares.append))
    assert [r for r, _ in rows] == [0, 256]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    np.testing.assert_array_equal(np.concatenate([part for _, part in rows]), first)
    assert first.dtype == np.uint16
    assert (render(replace(scene, seed=2), 3) != first).mean() > 0.9


def test_noise_and_blur():
    spec, block, truth = simulated(UCD, {})
    sharp = make_scene(spec, 1, block, truth, RenderOptions(noise=0.0, blur_px=0.0))
    blurred = make_scene(spec, 1, block, truth, RenderOptions(noise=0.0, blur_px=1.5))
    noisy = make_scene(spec, 1, block, truth, RenderOptions(noise=80.0, blur_px=0.0))
    a, b, c = (render(scene, 0).astype(float) for scene in (sharp, blurred, noisy))
    from scipy.ndimage import gaussian_filter

    # within a tile: over a seam either tile is blurred for itself
    np.testing.assert_allclose(b[20:100, 20:160], gaussian_filter(a, 1.5, truncate=4.0)[20:100, 20:160], atol=2.5)
    assert np.std(c - a) == pytest.approx(80.0, rel=0.02)
    flat = render(make_scene(spec, 1, block, truth, RenderOptions(noise=0.0, contrast=0.0)), 0)
    assert (flat == 16000).all()
    assert a.std() / a.mean() > 0.1


def test_each_day_has_its_own_camera():
    changes = {"flight": small_spec()["flight"] | {"days": 2}}
    spec, block, truth = simulated(UCD, {"physical": {"rms_um": 60.0, "day_change_um": 60.0}}, **changes)
    scene = make_scene(spec, 1, block, truth)
    days = block.images.columns["day"]
    assert set(days) == {"1", "2"}
    assert len({id(field) for field in scene.fields}) == 2
    for day in ("1", "2"):
        assert len({id(field) for field, d in zip(scene.fields, days, strict=True) if d == day}) == 1


def test_views_that_meet_no_ground_are_refused():
    spec, block, truth = simulated(UCD, {})
    scene = make_scene(spec, 1, block, truth)
    up = np.diag([1.0, -1.0, -1.0])
    orientation = scene.photographs
    turned = Photographs(orientation.centre, orientation.rotation @ up, orientation.camera, orientation.cameras)
    with pytest.raises(InputError, match="horizon"):
        render(replace(scene, photographs=turned), 0)
    wild = replace(scene.terrain, amplitude=scene.terrain.amplitude * 60.0, wave_number=scene.terrain.wave_number * 9.0)
    with pytest.raises(InputError, match="terrain hides itself"):
        render(replace(scene, terrain=wild), 0)


def test_rays_end_on_the_first_roof_wall_or_ground():
    """A house 20 m high, seen from 100 m beside and above it: single rays by hand; ground as without houses."""
    none = np.zeros(0)
    house = np.array([[0.0, 0.0, 10.0, 10.0, 20.0]])
    town = Terrain(0.0, np.zeros((0, 2)), none, none, houses=house)
    np.testing.assert_array_equal(town.height(np.array([[0.0, 4.0], [5.1, 0.0]])), [20.0, 0.0])
    np.testing.assert_array_equal(town.ground(np.array([[0.0, 4.0]])), [0.0])
    centre = np.array([-100.0, 0.0, 100.0])
    towards = np.array([[-60.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, 20.0], [22.0, 0.0, 0.0], [40.0, 0.0, 0.0]])
    slope = (towards - centre)[:, :2] / (towards - centre)[:, 2:]
    found = _first_met(town, np.repeat(centre[None], len(slope), axis=0), slope)
    # ground before the house; its wall; its roof; the roof again, for the ground behind it; ground beyond the shadow
    np.testing.assert_allclose(found, [[-60.0, 0.0], [-5.0, 0.0], [0.0, 2.0], [-2.4, 0.0], [40.0, 0.0]], atol=1e-3)


def test_seam_jumps_by_the_difference_of_the_tiles():
    """A tile that is shifted by two pixels shows at the seam what its neighbour shows two pixels further on."""
    shift = 2 * 0.18
    spec, block, truth = simulated(UCD, {"parameters": {"ultracam_d.57": shift}})
    options = RenderOptions(noise=0.0, blur_px=0.0)
    scene = make_scene(spec, 1, block, truth, options)
    perfect = replace(scene, fields=tuple(ImageError(()) for _ in scene.fields))
    taken, ideal = render(scene, 2).astype(float), render(perfect, 2).astype(float)
    columns, rows = (int(np.ceil(s[-1] - 0.5)) for s in seams_px(block.cameras[0]))
    np.testing.assert_allclose(taken[rows:, columns:-2], ideal[rows:, columns - 2 : -4], atol=12.0)
    np.testing.assert_array_equal(taken[:rows, :columns], ideal[:rows, :columns])


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_command_writes_photographs_and_forgets_older_ones(tmp_path):
    import rasterio

    from aerotri.commands.simulate import run_simulate

    plan = tmp_path / "plan.toml"
    plan.write_text(
        """
name = "tiny"
camera.ucd = { preset = "ultracam_d", size_px = [575, 375], pixel_um = 180.0 }
flight = { gsd_m = 1.0, strips = 1, images_per_strip = 3 }
tie_points = { per_image = 12, sigma_um = 2.0 }
""",
        encoding="utf-8",
    )
    out = tmp_path / "block"
    run_simulate(plan, out, 1, False, RenderOptions(), ("1_002",))
    assert sorted(p.name for p in (out / "photographs").iterdir()) == ["1_002.tif", "rendered.json"]
    spec = read_spec(plan)
    scene: Scene = make_scene(spec, 1, *simulate(spec, 1))
    with rasterio.open(out / "photographs" / "1_002.tif") as file:
        assert file.dtypes == ("uint16",)
        np.testing.assert_array_equal(file.read(1), render(scene, 1))
    assert json.loads((out / "photographs" / "rendered.json").read_text())["seed"] == 1
    (out / "photographs" / "notes.txt").write_text("mine")
    run_simulate(plan, out, 2, True)
    assert [p.name for p in (out / "photographs").iterdir()] == ["notes.txt"]
    with pytest.raises(InputError, match="no photograph '9'"):
        run_simulate(plan, out, 1, False, RenderOptions(), ("9",))
