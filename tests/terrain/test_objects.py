"""Houses on rendered ground: the DSM shows them, the DTM goes on below, and says how well it knows what it fills."""

import numpy as np
import pytest
from rendered_blocks import CAMERA, write_photograph

from aerotri.pipeline import adjust_keeping_system
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.rendering import RenderOptions, make_scene, render
from aerotri.terrain.dtm import TerrainPlan, make_terrain_model
from aerotri.terrain.pickets import Area
from small_blocks import small_spec

HOUSES = (
    (-22.0, -20.0, 12.0, 14.0, 5.0), (18.0, -18.0, 14.0, 10.0, 7.0), (-15.0, 20.0, 10.0, 10.0, 4.0),
    (20.0, 22.0, 8.0, 14.0, 6.0),
)  # fmt: skip


@pytest.fixture(scope="module")
def built_up(tmp_path_factory):
    """The terrain model of a piece of ground with houses, and the ground."""
    folder = tmp_path_factory.mktemp("houses")
    tables = small_spec(camera={"cam": CAMERA})
    flight = {"gsd_m": 0.3, "strips": 1, "images_per_strip": 4, "end_lap": 0.8, "cross_strips": []}
    attitude = {"attitude_sigma_deg": [0.3, 0.3, 1.0], "position_sigma_m": [1.0, 1.0, 1.0]}
    tables["flight"] = tables["flight"] | flight | attitude
    ground = {"kind": "undulating", "height_m": 20.0, "relief_rms_m": 1.0, "wavelength_m": 120.0}
    tables["terrain"] = ground | {"houses": HOUSES}
    tables["tie_points"] = {"per_image": 60, "probability": 0.9, "sigma_um": 9.0, "margin_px": 5.0}
    tables["control"] = {"distance_bases": 1.0, "sigma_m": [0.01] * 3}
    spec = parse_spec(tables)
    block, truth = simulate(spec, 2)
    scene = make_scene(spec, 2, block, truth, RenderOptions(noise=200.0))
    paths = tuple(write_photograph(folder / f"{name}.tif", render(scene, k)) for k, name in enumerate(scene.names))
    area = Area(np.array([-35.0, -35.0]), np.array([35.0, 35.0]))
    plan = TerrainPlan(np.arange(4), paths, interval=1.5, cell=1.0, area=area, window_px=9)
    return make_terrain_model(adjust_keeping_system(block), plan), scene.terrain


def cells(surface) -> tuple[np.ndarray, tuple[int, int]]:
    grid = surface.grid
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return np.column_stack([x.ravel(), y.ravel()]), surface.z.shape


def beside(xy: np.ndarray) -> np.ndarray:
    """(n,) m to the nearest wall, negative on a roof."""
    return np.min([(np.abs(xy - h[:2]) - 0.5 * np.array(h[2:4])).max(axis=1) for h in HOUSES], axis=0)


def test_roofs_are_in_the_dsm_and_the_ground_below_them_in_the_dtm(built_up):
    found, town = built_up
    xy, shape = cells(found.dsm)
    ground, surface, away = (v.reshape(shape) for v in (town.ground(xy), town.height(xy), beside(xy)))
    known = np.isfinite(found.dsm.z)
    assert known.mean() > 0.9
    # windows of nine posts reach 1.35 m to every side
    roofs, open_ground = known & (away < -2.5), known & (away > 3.0)
    assert roofs.sum() > 100
    assert np.abs(found.dsm.z - surface)[roofs | open_ground].max() < 0.6
    # below roofs and beside walls, where the DSM is wrong by metres, the DTM goes on within its σ
    beside_walls = known & (np.abs(away) < 1.0)
    assert np.quantile(np.abs(found.dsm.z - surface)[beside_walls], 0.9) > 1.5
    error, sigma = found.dtm.z - ground, found.dtm.sigma
    for part in (roofs, beside_walls, open_ground):
        there = part & np.isfinite(error)
        assert there.sum() > 0.99 * part.sum()
        assert np.abs(error[there]).max() < 0.5
        assert 0.3 < np.sqrt(np.mean((error[there] / sigma[there]) ** 2)) < 1.3


def test_pickets_on_houses_are_no_ground(built_up):
    found, _ = built_up
    own = found.pickets.accepted
    xy, ground = found.pickets.xyz[own, :2], found.ground[own]
    away, inner = beside(xy), np.abs(xy).max(axis=1) < 33.0
    assert not ground[away < 0.0].any()
    assert ground[(away > 3.0) & inner].mean() > 0.95


def test_away_from_houses_both_surfaces_are_one(built_up):
    found, _ = built_up
    same = np.isfinite(found.dtm.z) & (np.abs(found.dtm.z - found.dsm.z) < 1e-9)
    xy, shape = cells(found.dsm)
    inner = (beside(xy) > 6.0) & (np.abs(xy).max(axis=1) < 32.0)
    assert same[inner.reshape(shape)].mean() > 0.95
    assert not (np.isfinite(found.dtm.z) & ~np.isfinite(found.dsm.z)).any()
