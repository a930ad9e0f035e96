"""demcor, dtm and volume with results of other rows and names, in another frame, from tables in other rows."""

from __future__ import annotations

import json
import shutil
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from transformations import both, moved, permuted, renamed, same
from typer.testing import CliRunner

from aerotri.cli import app
from aerotri.commands.adjust import run_adjust
from aerotri.commands.demcor import run_demcor
from aerotri.commands.dtm import run_dtm
from aerotri.commands.volume import VolumeInput, run_volume
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.pickets import read_pickets
from aerotri.pipeline import adjust
from aerotri.public.dem import beside
from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.terrain.settings import TerrainSettings
from aerotri.volume.settings import SectionPlan, SigmaOptions
from small_blocks import ERRING, small_block

SHIFT = np.array([512.0, -256.0, 64.0])
"""m; rasters have 32 bit, in which heights that are multiples of 1/1024 m are exact, shifted too."""
ROWS = both(permuted(5), renamed)
CHANGES = {"old": same, "new": both(ROWS, moved(np.eye(3), SHIFT))}
ALL = 1e-9
"""σ, by which numbers may differ."""
RASTER = 1e-5
"""σ, of rasters: a cell has 32 bit, some 1e-7 of a correction of σ's size."""
N, CELL = 60, 2.0


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """By what was changed, a result folder and the change; and the middle of the block."""
    here = tmp_path_factory.mktemp("surfaces")
    block = small_block(3, "bluh:1-12", **ERRING)[0]
    found = {}
    for number, (name, change) in enumerate(CHANGES.items()):
        changed = change(block)
        found[name] = (adjusted(changed.block, here / str(number)), changed)
    return found, np.round(np.median(block.images.centre[:, :2], axis=0)), adjust(block)


def adjusted(block, folder):
    """The result folder of a block."""
    write_block(block, folder / "block")
    assert run_adjust(folder / "block", folder / "result", None, None, None, False, True) == 0
    return folder / "result"


def raster(path, middle, z):
    half = CELL * N / 2.0
    write_raster(path, z, Grid(N, N, middle[0] - half, middle[1] + half, CELL, CELL))
    return path


def hill(x, y):
    return np.round(1024.0 * (100.0 + 12.0 * np.exp(-(x**2 + y**2) / (2.0 * 20.0**2)))) / 1024.0


def offsets():
    at = CELL * (np.arange(N) - (N - 1) / 2.0)
    return np.meshgrid(at, -at)


def values(path):
    with RasterReader(path) as reader:
        return reader.read(0, 0, reader.grid.rows, reader.grid.columns).astype(float)


def polygons(path, parts, models):
    features = [
        {"type": "Feature", "properties": {"left": a, "right": b}, "geometry": shapely.geometry.mapping(part)}
        for part, (a, b) in zip(parts, models, strict=True)
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def assert_close(one, other, sigma, limit, what):
    assert np.array_equal(np.isfinite(one), np.isfinite(other)), what
    assert np.nanmax(np.abs(one - other) / sigma) <= limit, what


@pytest.mark.parametrize("kind", ["pair", "map"])
def test_demcor(made, tmp_path, kind):
    """A pair, and a map of two models whose polygons stand in another order."""
    results, _, solved = made
    centre = solved.images.centre[solved.block.images.names == "2_003"][0]
    middle = np.round(centre[:2]) + [20.0, 15.0]
    found = {}
    for name in CHANGES:
        result, changed = results[name]
        here = tmp_path / ("old" if name == "old" else "new")
        here.mkdir()
        at = middle + changed.frame.shift[:2]
        dem = raster(here / "dem.tif", at, hill(*offsets()) + changed.frame.shift[2])
        models = [tuple(changed.name(p) for p in pair) for pair in (("2_003", "2_004"), ("2_002", "2_003"))]
        halves = [shapely.box(at[0], at[1] - 90, at[0] + 90, at[1] + 90),
                  shapely.box(at[0] - 90, at[1] - 90, at[0], at[1] + 90)]  # fmt: skip
        order = 1 if name == "old" else -1
        given = polygons(here / "models.geojson", halves[::order], models[::order]) if kind == "map" else None
        pair = models[0] if kind == "pair" else None
        assert run_demcor(result, dem, here / "out.tif", pair, given, None, None, True) == 0
        found[name] = [values(beside(here / "out.tif", part)) for part in ("dZ.tif", "sigma_dZ.tif")]
    (dz, sigma), (other, other_sigma) = found.values()
    assert np.abs(dz[np.isfinite(dz)]).max() > 1e-3
    assert_close(dz, other, sigma, RASTER, "dZ")
    assert_close(sigma, other_sigma, sigma, RASTER, "σ")


def pickets_table(path, xyz, names, order, sigma):
    import pyarrow as pa

    columns = {
        "X": xyz[order, 0], "Y": xyz[order, 1], "Z": xyz[order, 2], "photographs": [names[k] for k in order],
        "sZ_matching": sigma[order], "status": ["accepted"] * len(order),
    }  # fmt: skip
    pq.write_table(pa.table(columns), path)
    return path


RINGS = ([[0, 0], [0, -45], [40, -35], [50, 20], [10, 48], [-30, 30], [-42, -20]], [[-5, 0], [5, 2], [1, 8]])


def boundary(middle, turned):
    """A polygon with a hole, its corners as they are, or from another one on and the other way round."""
    rings = [np.array(ring, float)[1 if k == 0 else 0 :] + middle for k, ring in enumerate(RINGS)]
    if turned:
        rings = [np.roll(ring, 2, axis=0)[::-1] for ring in rings]
    return shapely.Polygon(rings[0], [rings[1]]).wkt


VOLUMES = {
    "level": {"base": "level:100"},
    "spline": {"base": "boundary"},
    "plane": {"base": "plane"},
    "lowest": {"base": "lowest"},
    "surface": {"base": "before.tif", "both": True},
    "pickets": {"base": "level:100", "pickets": True},
}


@pytest.mark.parametrize("case", VOLUMES)
def test_volume(made, tmp_path, case):
    results, middle, _ = made
    what = VOLUMES[case]
    found = {}
    for name in CHANGES:
        result, changed = results[name]
        here = tmp_path / ("old" if name == "old" else "new")
        here.mkdir()
        shift = changed.frame.shift
        at = middle + shift[:2]
        dtm = raster(here / "dtm.tif", at, hill(*offsets()) + shift[2])
        raster(here / "before.tif", at, np.full((N, N), 99.0) + shift[2])
        base = what["base"]
        base = str(here / base) if base.endswith(".tif") else f"level:{100.0 + shift[2]}" if ":" in base else base
        pickets = None
        if what.get("pickets"):
            pickets = picket_file(here / "pickets.parquet", result, at, shift[2], name != "old")
        given = VolumeInput(dtm, base, boundary(at, name != "old"), "prisms", result, pickets,
                            result if what.get("both") else None)  # fmt: skip
        options = SigmaOptions(base_sigma=0.02, boundary_sigma=0.3)
        assert run_volume(given, SectionPlan(10.0, 20.0), options, here / "out", False, True) == 0
        found[name] = json.loads((here / "out" / "volume.json").read_text())
    one, other = found.values()
    sigma = one["sigma"]["sigma_m3"]
    ratio = {"net": abs(one["net_m3"] - other["net_m3"]) / sigma}
    for part, value in one["sigma"]["parts_m3"].items():
        ratio[part] = abs(value - other["sigma"]["parts_m3"][part]) / sigma
    for a, b in zip(one["methods"], other["methods"], strict=True):
        ratio[a["method"]] = abs(a["net_m3"] - b["net_m3"]) / sigma
    # the spline solves a system whose condition takes four digits of the places of its nodes
    limit = 1e-7 if case == "spline" else ALL
    assert not {k: v for k, v in ratio.items() if not v < limit}


def picket_file(path, result, middle, lift, turned):
    """Every third cell as a picket in the photographs that see it, rows and photographs in another order."""
    from aerotri.commands.console import Console
    from aerotri.commands.results import reopened
    from aerotri.volume.pickets import pickets_where_seen

    rng = np.random.default_rng(3)
    plan = rng.uniform(-58.0, 58.0, (900, 2))
    xyz = np.column_stack([plan + middle, np.round(hill(*plan.T), 2) + lift])
    calibration = reopened(result, Console(quiet=True))
    pickets, seen = pickets_where_seen(calibration, xyz, 0.003)
    assert seen.all()
    names = calibration.result.block.images.names
    own = [sorted(names[pickets.image[a:b]].tolist(), reverse=turned) for a, b in pairwise(pickets.start)]
    order = np.random.default_rng(4).permutation(len(xyz)) if turned else np.arange(len(xyz))
    return pickets_table(path, xyz, own, order, rng.uniform(0.03, 0.08, len(xyz)))


PLAN = """
name = "tiny"
camera.cam = { preset = "ultracam_d", size_px = [575, 375], pixel_um = 180.0 }
flight = { gsd_m = 1.0, strips = 1, images_per_strip = 3, end_lap = 0.6, heading_deg = 30.0 }
terrain = { kind = "undulating", height_m = 100.0, relief_rms_m = 10.0, wavelength_m = 400.0 }
tie_points = { per_image = 60, probability = 0.9, sigma_um = 9.0 }
control = { distance_bases = 1.0, sigma_m = [0.05, 0.05, 0.05] }
"""


def test_dtm(tmp_path):
    """Three rendered photographs and their block, under the same names in other rows, and under other names."""
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    done = CliRunner().invoke(app, ["simulate", str(tmp_path / "plan.toml"), "--out", str(tmp_path / "flown"),
                                    "--seed", "3", "--render"])  # fmt: skip
    assert done.exit_code == 0
    flown = read_block(tmp_path / "flown")
    found = {}
    for number, (name, change) in enumerate({"old": same, "rows": permuted(5), "rows and names": ROWS}.items()):
        here = tmp_path / str(number)
        changed = change(flown)
        (here / "photographs").mkdir(parents=True)
        for path in (tmp_path / "flown" / "photographs").iterdir():
            shutil.copy(path, here / "photographs" / f"{changed.name(path.stem)}.tif")
        result = adjusted(changed.block, here)
        settings = TerrainSettings(interval=10.0, area=(-70.0, -70.0, 70.0, 70.0))
        assert run_dtm(result, [here / "photographs"], here / "dtm", settings, False, True) == 0
        table = read_pickets(here / "dtm" / "pickets.parquet")
        found[name] = (in_order(table, changed), values(here / "dtm" / "dsm.tif"))
    (table, dsm), *others = found.values()
    own = table["status"] == "accepted"
    assert own.sum() > 100
    for other, surface in others:
        for column in ("node", "status", "photographs"):
            np.testing.assert_array_equal(other[column], table[column])
        assert_close(table["xyz"][own], other["xyz"][own], table["sigma"][own], ALL, "X, Y, Z")
        assert_close(table["sigma"][own], other["sigma"][own], table["sigma"][own], ALL, "σ")
        assert_close(dsm, surface, np.median(table["sigma"][own, 2]), 10.0 * RASTER, "surface")


def in_order(table, changed):
    """The pickets of a file by their nodes, photographs by their old names."""
    old = {new: name for name, new in changed.names.items()}
    names = np.array([" ".join(sorted(old.get(p, p) for p in own)) for own in table.photographs])
    order = np.lexsort(table.node.T)
    columns = {"node": table.node, "status": table.status, "xyz": table.xyz, "sigma": table.sigma, "photographs": names}
    return {name: np.asarray(values)[order] for name, values in columns.items()}
