"""σ of single piles against a direct sum, and the terrain that hides ground from photographs."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri
from aerotri import InputError
from aerotri.planning.covariance import intersection_covariance, joint_covariance
from aerotri.planning.ground import Ground, level_ground
from aerotri.planning.sight import in_sight
from aerotri.simulation.projection import Rays

AREA = "POLYGON ((0 0, 200 0, 200 150, 0 150, 0 0))"
PILES = "MULTIPOLYGON (((30 30, 60 30, 60 60, 30 60, 30 30)), ((100 40, 180 45, 175 120, 110 130, 100 40)))"
ASKED = {"camera": "p1", "gsd": 0.03, "ground": 100.0, "tie_points": 60, "control": 5, "forward_overlap": 0.7}


@pytest.fixture(scope="module")
def plan():
    return aerotri.plan_flight(AREA, piles=PILES, **ASKED)


def test_sigma_of_a_pile_is_that_of_its_mean_height(plan):
    r = plan.record
    names = r.block.points.tolist()
    assert plan.piles["pile"].tolist() == ["1", "2"]
    assert sorted(plan.piles["area"].tolist()) == pytest.approx([900.0, 5987.5])
    for one in r.piles:
        rows = np.array([names.index(name) for name in one.points])
        assert len(rows) > 15
        whole = joint_covariance(r.block, r.expected.xyz, rows)[2::3, 2::3].sum()
        noise = intersection_covariance(r.block, r.expected.xyz, rows)[:, 2, 2].sum()
        assert one.sigma == pytest.approx(one.area * np.sqrt(whole - noise) / len(rows), rel=1e-9)
        assert one.measured == pytest.approx(one.area * np.sqrt(whole) / len(rows), rel=1e-9)
    # a larger pile is known less well, as a volume; not as a height
    small, large = sorted(r.piles, key=lambda one: one.area)
    assert large.sigma > small.sigma
    assert large.sigma / large.area < 1.2 * small.sigma / small.area


def test_the_map_is_that_of_the_area(plan):
    """Places of piles are no ground points of the map, and its numbers hardly change with them."""
    bare = aerotri.plan_flight(AREA, **ASKED)
    assert len(bare.ground_points) == len(plan.ground_points)
    assert not any(name.startswith("V") for name in plan.ground_points["point"].tolist())
    assert plan.summary["accuracy"]["sigma_z_95_m"] == pytest.approx(bare.summary["accuracy"]["sigma_z_95_m"], rel=0.1)
    assert bare.summary["piles"] == []
    assert "Single piles" not in bare.html()


def test_files_and_page(plan, tmp_path):
    plan.save(tmp_path / "plan")
    assert "Single piles" in (tmp_path / "plan" / "plan.html").read_text(encoding="utf-8")
    assert [one["sigma_m3"] for one in plan.summary["piles"]] == plan.piles["sigma"].tolist()


def test_an_area_of_several_polygons_has_piles():
    two = aerotri.plan_flight(PILES, **ASKED)
    assert two.piles["pile"].tolist() == ["1", "2"]


def test_a_pile_beside_the_photographs_is_refused():
    with pytest.raises(InputError, match="places of the pile 'the polygon given' lie in two photographs"):
        aerotri.plan_flight(AREA, piles="POLYGON ((3000 0, 3100 0, 3100 100, 3000 0))", **ASKED)


def wall(height: float) -> Ground:
    """Level ground at 0 m with a wall along x = 50 m, 4 m thick."""
    x = np.arange(0.0, 101.0, 1.0)
    z = np.zeros((101, 101))
    z[:, (x >= 48.0) & (x <= 52.0)] = height
    return Ground(z, 0.0, 0.0, 1.0, "wall")


def test_a_wall_hides_what_is_behind_it():
    """Against the geometry: a camera at (10, 50, 100) looks over a wall of 20 m."""
    centre = np.array([[10.0, 50.0, 100.0]])
    x = np.arange(54.0, 99.0, 1.0)
    points = np.column_stack([x, np.full(len(x), 50.0), np.zeros(len(x))])
    rays = Rays(np.zeros(len(x), np.int64), np.arange(len(x)), np.zeros((len(x), 2)))
    # the ray passes the far top edge, which goes down to 0 over the last metre of the grid: x = 52
    shadow = 52.0 + (52.0 - 10.0) * 20.0 / (100.0 - 20.0)
    clear = in_sight(wall(20.0), centre, points, rays)
    assert not clear[x < shadow - 1.5].any()
    assert clear[x > shadow + 1.5].all()
    assert in_sight(level_ground(0.0), centre, points, rays).all()
    assert in_sight(wall(20.0), centre, points[:0], rays.take(np.zeros(0, np.int64))).shape == (0,)


def test_from_above_nothing_is_hidden():
    points = np.column_stack([np.full(9, 60.0), np.linspace(10.0, 90.0, 9), np.zeros(9)])
    centre = points + [0.0, 0.0, 80.0]
    rays = Rays(np.arange(9), np.arange(9), np.zeros((9, 2)))
    assert in_sight(wall(40.0), centre, points, rays).all()


def test_hidden_ground_counts_as_not_seen(tmp_path):
    """A gorge of 60 m depth and 24 m width: its floor is in as many formats as the plain, and seen from fewer."""
    import rasterio
    from rasterio.transform import from_origin  # a DEM of another program

    x = np.arange(-300.0, 500.0, 2.0) + 1.0
    z = np.full((400, len(x)), 160.0)
    z[:, np.abs(x - 100.0) < 12.0] = 100.0
    path = tmp_path / "gorge.tif"
    with rasterio.open(path, "w", driver="GTiff", width=len(x), height=400, count=1, dtype="float64",
                       transform=from_origin(-300.0, 500.0, 2.0, 2.0)) as file:  # fmt: skip
        file.write(z, 1)
    asked = {name: value for name, value in ASKED.items() if name != "ground"} | {"gsd": 0.01, "side_overlap": 0.7}
    asked |= {"most_photographs": 5000, "control": 4}
    area = "POLYGON ((60 60, 140 60, 140 120, 60 120, 60 60))"
    seen = aerotri.plan_flight(area, dem=path, direction=0.0, **asked).record.seen
    floor = seen.places[:, 2] < 110.0
    assert floor.any()
    assert (seen.rays <= seen.framed).all()
    assert (seen.rays[~floor] == seen.framed[~floor]).mean() > 0.9
    assert (seen.rays[floor] < seen.framed[floor]).mean() > 0.5
    told = aerotri.plan_flight(area, dem=path, direction=0.0, rays=9, **asked).record.warnings
    assert any("the terrain hides" in text for text in told)
