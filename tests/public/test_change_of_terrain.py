"""Change of terrain models: what the adjustment adds to σ is no noise of the cells."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest
import shapely
from pyarrow import parquet

import aerotri
from aerotri import InputError
from aerotri.formats.results.pickets import NUMBERS, read_pickets
from aerotri.public.terrain import TerrainModel
from aerotri.public.terrain_noise import noise_of_terrain
from aerotri.public.volume_sigma import MeasuredSurface
from aerotri.rasters.surface_files import write_surface
from aerotri.terrain.surface import grid_over, surface_of

INTERVAL, MATCHING, INTERPOLATION, ADJUSTMENT = 2.0, 0.03, 0.02, 5.0
AREA = shapely.box(10, 10, 50, 50)


def terrain_folder(folder, seed, key, matching=MATCHING):
    """As `aerotri dtm` writes it: a level surface of pickets with noise, all moved by an adjustment that is poor."""
    folder.mkdir()
    x, y = (one.ravel() for one in np.meshgrid(np.arange(0.0, 61.0, INTERVAL), np.arange(0.0, 61.0, INTERVAL)))
    xyz = np.column_stack([x, y, 100.0 + np.random.default_rng(seed).normal(0.0, matching, len(x))])
    variance, shared = np.full(len(x), matching**2), np.full(len(x), ADJUSTMENT**2)
    found = surface_of(xyz, variance, INTERVAL, grid_over(xyz[:, :2], 1.0), (), INTERPOLATION, shared)
    write_surface(folder / "dsm.tif", found.z, found.sigma, found.grid, "EPSG:25832", "DSM Z, m")
    columns = dict.fromkeys(NUMBERS, np.full(len(x), 0.01)) | {"node_X": x, "node_Y": y, "X": x, "Y": y, "Z": xyz[:, 2]}
    columns |= {"sZ": np.sqrt(variance + shared), "sZ_matching": np.sqrt(variance)}
    table = {name: pa.array(values) for name, values in columns.items()}
    table |= {"photographs": pa.array([["1", "2"]] * len(x)), "status": pa.array(["accepted"] * len(x))}
    parquet.write_table(pa.table(table), folder / "pickets.parquet")
    record = {"interval_m": INTERVAL, "sigma_Z_m": {"interpolation": INTERPOLATION}, "adjustment": key}
    (folder / "dtm.json").write_text(json.dumps(record), encoding="utf-8")
    return folder


def of_cells(weights):
    """m, σ of a cell without the adjustment, by the weights of its corners."""
    own = np.sum(np.square(weights))
    return np.sqrt(own * MATCHING**2 + 2.0 * (1.0 - own) * INTERPOLATION**2)


def test_errors_of_one_adjustment_are_not_in_the_level_of_detection(tmp_path):
    pair = [terrain_folder(tmp_path / str(seed), seed, "one") for seed in (1, 2)]
    found = aerotri.change(*pair, area=AREA)
    inside = found.record.sigma[5:-5, 5:-5]
    # cells at a picket, and those halfway between two
    usual = np.sqrt(2.0) * np.array([of_cells([1.0]), of_cells([0.5, 0.5])])
    assert {round(value, 5) for value in np.unique(inside.round(6)).tolist()} <= {round(v, 5) for v in usual.tolist()}
    v = found.summary["volumes"][0]
    assert abs(v["net_m3"]) < 4.0 * v["sigma_net_m3"] < 20.0
    assert found.record.volumes[0].parts["net"]["adjustment"] == 0.0
    assert found.summary["noise_length_m"] == pytest.approx(INTERVAL)


def test_of_two_adjustments_sigma_stands_in_their_part(tmp_path):
    pair = [terrain_folder(tmp_path / key, 1, key) for key in ("one", "other")]
    parts = aerotri.change(*pair, area=AREA).record.volumes[0].parts["net"]
    assert parts["adjustment"] == pytest.approx(np.sqrt(2.0) * ADJUSTMENT * AREA.area, rel=1e-4)
    assert parts["noise"] < 10.0


def test_stable_ground_takes_it_away(tmp_path):
    pair = [terrain_folder(tmp_path / key, seed, key) for seed, key in ((1, "one"), (2, "other"))]
    stable = shapely.difference(shapely.box(0, 0, 60, 60), AREA)
    found = aerotri.change(*pair, area=AREA, stable=stable, align="height")
    assert found.summary["level_of_detection_m"] < 0.2
    assert 0.7 < found.summary["alignment"]["noise_factor"] < 1.4


def test_volumes_of_terrain_scatter_as_stated(tmp_path):
    """Neighbouring cells lie between the same pickets: their noise is one."""
    over = []
    for seed in range(24):
        pair = [terrain_folder(tmp_path / f"{seed}_{k}", 2 * seed + k, "one") for k in (0, 1)]
        v = aerotri.change(*pair, area=AREA).summary["volumes"][0]
        over.append(v["net_m3"] / v["sigma_net_m3"])
    # pickets have no error of interpolation here: σ may be larger than what is there, not smaller
    assert 0.4 < np.sqrt(np.mean(np.square(over))) < 1.48


def test_a_surface_that_does_not_tell_them_apart_says_so(tmp_path):
    pair = [terrain_folder(tmp_path / str(seed), seed, "one") for seed in (1, 2)]
    (pair[0] / "pickets.parquet").unlink()
    (pair[1] / "dtm.json").unlink()
    notes = aerotri.change(*pair, area=AREA).summary["warnings"]
    assert sum("does not tell noise of the cells from what all cells share" in note for note in notes) == 2


def test_a_damaged_record_is_named(tmp_path):
    pair = [terrain_folder(tmp_path / str(seed), seed, "one") for seed in (1, 2)]
    (pair[0] / "dtm.json").write_text('{"interval_m": -1, "sigma_Z_m": {"interpolation": 0.1}}', encoding="utf-8")
    with pytest.raises(InputError, match=r"dtm.json.*not possible"):
        aerotri.change(*pair)


def test_a_model_in_memory_tells_the_same_as_its_folder(tmp_path):
    folder = terrain_folder(tmp_path / "dtm", 1, "one")
    table = read_pickets(folder / "pickets.parquet")
    covariance = np.zeros((len(table.xyz), 3, 3))
    covariance[:, 2, 2] = table.sigma_matching[:, 2] ** 2
    pickets = SimpleNamespace(accepted=table.accepted, xyz=table.xyz, covariance=covariance)
    record = SimpleNamespace(pickets=pickets, interval=INTERVAL, interpolation=INTERPOLATION)
    held, read = (
        noise_of_terrain(MeasuredSurface(given))
        for given in (TerrainModel(cast(Any, record), "block", "EPSG:25832", "one"), folder)
    )
    assert held is not None
    assert read is not None
    grid = grid_over(table.xyz[:, :2], 1.0)
    np.testing.assert_array_equal(held.sigma(grid), read.sigma(grid))


def test_ground_has_no_noise_of_points_on_objects(tmp_path):
    """dtm.tif is made without them: under an object σ is that of what is bridged."""
    folder = terrain_folder(tmp_path / "built", 1, "one")
    table = read_pickets(folder / "pickets.parquet")
    on = (np.abs(table.xyz[:, :2] - 30.0) < 7.0).all(axis=1)
    ground = surface_of(
        table.xyz[~on], table.sigma_matching[~on, 2] ** 2, 18.0, grid_over(table.xyz[:, :2], 1.0), (), INTERPOLATION
    )
    write_surface(folder / "dtm.tif", ground.z, ground.sigma, ground.grid, "EPSG:25832", "DTM Z, m")
    content = parquet.read_table(folder / "pickets.parquet")
    raised = pa.array(np.where(on, table.xyz[:, 2] + 6.0, table.xyz[:, 2]))
    parquet.write_table(content.set_column(content.column_names.index("Z"), "Z", raised), folder / "pickets.parquet")
    for name, expected in (("dtm.tif", int((~on).sum())), ("dsm.tif", len(on))):
        noise = noise_of_terrain(MeasuredSurface(folder / name))
        assert noise is not None
        assert len(noise.xyz) == expected
    noise = noise_of_terrain(MeasuredSurface(folder / "dtm.tif"))
    assert noise is not None
    np.testing.assert_allclose(noise.sigma(ground.grid), ground.sigma, rtol=1e-6)
