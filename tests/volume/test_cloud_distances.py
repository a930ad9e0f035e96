"""Distances of point clouds (M3C2) against what was put in, and against the definition written out."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely

import aerotri
from aerotri import InputError
from aerotri.cli.app import invoke
from aerotri.volume.change.clouds import LEVEL, Cloud, Scales, cloud_distances, core_points, registration_of

SCALES = Scales(cylinder=1.0, normal=2.0, reach=3.0)
CORNER = np.array([500_000.0, 5_900_000.0, 300.0])
SLOPE = np.radians(35.0)
UP = np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])


def slope(seed: int, noise: float, shift: float = 0.0, density: float = 60.0, size: float = 12.0) -> np.ndarray:
    """Points (n, 3) of a plane of 35°, with noise along its normal, moved along it."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.0, size, (2, int(density * size**2)))
    plane = np.column_stack([a * np.cos(SLOPE), b, -a * np.sin(SLOPE)])
    return CORNER + plane + (shift + rng.normal(0.0, noise, len(a)))[:, None] * UP


def inner(xyz: np.ndarray) -> np.ndarray:
    """Core points with whole cylinders."""
    u = xyz - CORNER
    a = u[:, 0] * np.cos(SLOPE) - u[:, 2] * np.sin(SLOPE)
    return xyz[(a > 2.0) & (a < 10.0) & (u[:, 1] > 2.0) & (u[:, 1] < 10.0)]


def test_a_shift_along_the_normal_is_found_with_its_sigma():
    """Normals, mean and RMS of error over σ; without any change five in a hundred are beyond the level."""
    first = slope(1, 0.05)
    core = inner(first)[::8]
    for shift in (0.0, 0.4, -1.7):
        found = cloud_distances(Cloud(first, None), Cloud(slope(2, 0.08, shift), None), core, SCALES)
        assert np.degrees(np.arccos(found.normal @ UP)).max() < 6.0
        z = (found.distance - shift) / found.sigma
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.15)
        if shift == 0.0:
            assert np.mean(np.abs(found.distance) > found.level(0.0)) == pytest.approx(0.05, abs=0.03)
            assert found.level(0.01) == pytest.approx(LEVEL * (found.sigma + 0.01))


def test_as_the_definition_says():
    """Every core point by itself, written out; points with covariances."""
    rng = np.random.default_rng(3)
    clouds = []
    for seed in (4, 5):
        xyz = slope(seed, 0.3, 0.5 * (seed - 4), density=60.0)
        root = rng.normal(0.0, 0.03, (len(xyz), 3, 3))
        c = root @ np.swapaxes(root, 1, 2)
        entries = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        clouds.append(Cloud(xyz, np.column_stack([c[:, i, j] for i, j in entries])))
    core = inner(clouds[0].xyz)[:15]
    found = cloud_distances(*clouds, core, Scales(1.0, 1.6, 0.8))
    for k, place in enumerate(core):
        near = clouds[0].xyz[np.linalg.norm(clouds[0].xyz - place, axis=1) <= 0.8] - place
        n = np.linalg.eigh(np.cov(near.T))[1][:, 0]
        n *= np.sign(n[2])
        np.testing.assert_allclose(found.normal[k], n, atol=1e-6)
        means, variance, few = [], 0.0, False
        for cloud in clouds:
            u = cloud.xyz - place
            along = u @ n
            own = (np.linalg.norm(u - along[:, None] * n, axis=1) <= 0.5) & (np.abs(along) <= 0.8)
            few |= own.sum() < 4
            means.append(along[own].mean())
            xx, yy, zz, xy, xz, yz = cloud.covariance[own].mean(axis=0)
            variance += n @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ n
        if few:
            assert np.isnan(found.distance[k])
            continue
        assert found.distance[k] == pytest.approx(means[1] - means[0], abs=1e-7)
        assert found.sigma[k] == pytest.approx(np.sqrt(variance), rel=1e-6)


def test_command_reads_covariances_and_writes(tmp_path):
    """Two clouds of `dsm`'s kind: σ from the points; a heap is found, stable ground tells the registration."""
    clouds = []
    for seed in (11, 12):
        rng = np.random.default_rng(seed)
        xy = rng.uniform(0.0, 20.0, (20_000, 2))
        heap = (0.5 if seed == 12 else 0.0) * (np.linalg.norm(xy - 10.0, axis=1) < 3.0)
        clouds.append(CORNER + np.column_stack([xy, heap + rng.normal(0.0, 0.02, len(xy))]))
        write_cloud(tmp_path / f"{seed}.laz", clouds[-1], 0.02)
    stable = "POLYGON((500000 5900000, 500020 5900000, 500020 5900004, 500000 5900004, 500000 5900000))"
    given = [str(tmp_path / "11.laz"), str(tmp_path / "12.laz"), "--stable", stable, "--spacing", "1"]
    assert invoke(["change", *given, "--out", str(tmp_path / "out")]) == 0
    record = json.loads((tmp_path / "out" / "cloud_change.json").read_text(encoding="utf-8"))
    assert (record["sigma_from"], record["crs"]) == ("points", "EPSG:25832")
    assert record["sigma_m"] == pytest.approx(0.02 * np.sqrt(2.0), rel=1e-3)
    assert abs(record["stable"]["mean_m"]) < 0.01
    table = pq.read_table(tmp_path / "out" / "distances.parquet")
    x, y, distance, beyond = (table[name].to_numpy() for name in ("X", "Y", "distance", "beyond"))
    away = np.hypot(x - CORNER[0] - 10.0, y - CORNER[1] - 10.0)
    assert distance[away < 2.0] == pytest.approx(0.5, abs=0.05)
    assert beyond[away < 2.0].all()
    assert not beyond[away > 4.5].any()
    assert (tmp_path / "out" / "plots" / "distances.png").stat().st_size > 10_000
    assert "beyond the level of detection" in (tmp_path / "out" / "change.html").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="--area, --noise-length: of surfaces"):
        invoke(["change", *given, "--area", stable, "--out", str(tmp_path / "other")])
    with pytest.raises(InputError, match="--spacing: of point clouds"):
        invoke(["change", str(tmp_path / "a.tif"), str(tmp_path / "b.tif"), "--spacing", "1"])


def write_cloud(path, xyz, sigma):
    import laspy
    from pyproj import CRS

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = CORNER, np.full(3, 0.001)
    header.add_extra_dims([laspy.ExtraBytesParams(f"sigma_{axis}", "f4") for axis in "xyz"])
    header.add_crs(CRS.from_epsg(25832))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    for axis in "xyz":
        cloud[f"sigma_{axis}"] = np.full(len(xyz), sigma, np.float32)
    cloud.write(str(path))


def test_what_makes_no_sense_is_refused(tmp_path):
    flat = slope(13, 0.01, density=5.0)
    for match, given, options in (
        ("do not meet", (flat, flat + 500.0), {}),
        ("cylinder -1 m", (flat, flat), {"cylinder": -1.0}),
        ("a registration of -1 m", (flat, flat), {"registration": -1.0}),
        ("no array", (flat[:, :2], flat), {}),
        ("has 2 points", (flat[:2], flat), {}),
        ("one place", (np.repeat(flat[:1], 9, axis=0), flat), {}),
        ("no place with a distance", (flat, flat), {"stable": shapely.box(0, 0, 1, 1)}),
        ("is no point cloud", (tmp_path / "a.tif", flat), {}),
    ):
        with pytest.raises(InputError, match=match):
            aerotri.cloud_change(*given, **options)


def test_where_a_cloud_is_missing_there_is_no_distance():
    first, second = slope(6, 0.02), slope(7, 0.02)
    core = inner(first)[::20]
    second = second[second[:, 1] < CORNER[1] + 6.0]
    found = cloud_distances(Cloud(first, None), Cloud(second, None), core, SCALES)
    without = core[:, 1] > CORNER[1] + 7.0
    assert np.isnan(found.distance[without]).all()
    assert np.isfinite(found.distance[core[:, 1] < CORNER[1] + 5.0]).all()
    line = np.column_stack([np.linspace(0, 5, 50), np.zeros((50, 2))])
    assert np.isnan(cloud_distances(Cloud(line, None), Cloud(line, None), line, SCALES).normal).all()


def test_core_points_are_spread():
    xyz = slope(8, 0.05)
    rows = core_points(xyz, 1.0)
    assert len(np.unique(rows)) == len(rows)
    cube = np.floor(xyz - xyz.min(axis=0))
    assert len(rows) == len(np.unique(cube, axis=0))
    assert core_points(xyz[:1], 1.0).tolist() == [0]


def test_stable_ground_tells_the_registration():
    first = slope(9, 0.02)
    core = inner(first)[::10]
    found = cloud_distances(Cloud(first, None), Cloud(slope(10, 0.02, 0.06), None), core, SCALES)
    mean, excess = registration_of(found, np.ones(len(core), bool))
    assert mean == pytest.approx(0.06, abs=0.003)
    assert excess == pytest.approx(0.06, abs=0.003)
    assert np.isnan(registration_of(found, np.zeros(len(core), bool))).all()
