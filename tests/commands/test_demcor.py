"""`aerotri demcor` as a user meets it: a DEM made with wrong models in, the truth out."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import rasterio

from aerotri.commands.console import Console
from aerotri.commands.deform import DeformOptions, run_deform
from aerotri.commands.demcor import run_demcor
from aerotri.commands.results import reopened
from aerotri.conventions import InputError
from aerotri.deformation import restitution_of
from aerotri.deformation.block_models import block_models, nearest_models, strip_pairs
from aerotri.deformation.model_grid import Places, mean_ground, pair_of
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.deformation.stereo_model import covariance_of, deform_points
from aerotri.public.dem import beside
from aerotri.rasters.grids import Grid, RasterReader, write_raster
from wrong_dems import Terrain, cells, middle_of, square_grid, write_dem, wrong_heights
from wrong_dems import beside as next_to

PAIR = ("2_003", "2_004")
N = 90


def demcor(result, dem, out, pair=None, models=None, table=None, orientation=None):
    assert run_demcor(result, dem, out, pair, models, table, orientation, True) == 0
    text = beside(out, "demcor.json").read_text(encoding="utf-8")
    assert "NaN" not in text
    return json.loads(text)


def values(path):
    with RasterReader(path) as reader:
        return reader.read(0, 0, reader.grid.rows, reader.grid.columns).astype(float)


class Wrong:
    """A DEM of 90 × 90 cells of 1 m over a slope, made with one model of a restitution."""

    def __init__(self, erring, of, folder, offset=(0.0, 0.0), pair=PAIR, **options):
        self.model = pair_of(of, erring, *pair)
        middle = middle_of(self.model)
        self.grid, self.terrain = square_grid(middle + offset, N, 1.0), Terrain(middle, mean_ground(erring))
        z, _, good = wrong_heights(self.model, self.terrain, cells(self.grid))
        self.z, self.good = z.reshape(N, N), ~next_to(~good.reshape(N, N))
        self.truth = self.terrain(cells(self.grid)).reshape(N, N)
        self.path = folder / "dem.tif"
        write_dem(self.path, self.grid, self.z, **options)
        assert self.good.mean() > 0.5
        assert np.abs(self.z - self.truth)[self.good].max() > 0.05


def restored(wrong, out):
    """Every cell within 1 mm of the truth."""
    return bool((np.abs(values(out) - wrong.truth)[wrong.good] < 1e-3).all())


@pytest.mark.parametrize("variant", ["free", "absorbed"])
def test_one_model(erring_result, erring, variant, tmp_path):
    wrong = Wrong(erring, restitution_of(erring, variant), tmp_path)
    out = tmp_path / "corrected.tif"
    content = demcor(erring_result, wrong.path, out, PAIR, orientation="absorbed" if variant == "absorbed" else None)
    assert restored(wrong, out)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "corrected.tif", "corrected_dZ.tif", "corrected_demcor.json", "corrected_sigma_dZ.tif", "dem.tif",
    ]  # fmt: skip
    assert content["variant"] == variant
    assert content["models"] == [list(PAIR)]
    assert content["cells"] == content["corrected"] == N * N
    dz, corrected = values(tmp_path / "corrected_dZ.tif"), values(out)
    expected = {"min": dz.min(), "max": dz.max(), "mean": dz.mean(), "rms": np.sqrt(np.mean(dz**2))}
    assert content["dZ"] == pytest.approx(expected, abs=1e-4)
    for when, z in (("before", values(wrong.path)), ("after", corrected)):
        assert content[when] == pytest.approx({"min": z.min(), "max": z.max(), "mean": z.mean()}, abs=1e-4)
    sigma = values(tmp_path / "corrected_sigma_dZ.tif")
    assert sigma.shape == (N, N)
    for i, j in ((3, 5), (40, 77), (88, 20)):
        point = np.array([[float(wrong.grid.x(j)), float(wrong.grid.y(i)), wrong.z[i, j]]])
        assert sigma[i, j] == pytest.approx(np.sqrt(covariance_of(wrong.model, point)[0, 2, 2]), rel=1e-5)
    assert content["sigma_dZ"]["mean"] == pytest.approx(sigma.mean(), rel=1e-5)
    assert content["seams"]["count"] == 0


def test_dem_made_with_another_adjustment(erring_result, erring, plain_result, tmp_path):
    """The paper's case: oriented without self-calibration, given as that result, or as its table of orientations."""
    other = calibrated_orientation(reopened(plain_result, Console(quiet=True)))
    wrong = Wrong(erring, restitution_of(erring, used=other), tmp_path)
    found = []
    for k, orientation in enumerate((plain_result, plain_result / "images.csv")):
        out = tmp_path / f"out{k}.tif"
        content = demcor(erring_result, wrong.path, out, PAIR, orientation=str(orientation))
        assert restored(wrong, out)
        assert content["variant"] == "given"
        found.append(values(out))
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)
    demcor(erring_result, wrong.path, tmp_path / "free.tif", PAIR)
    assert not restored(wrong, tmp_path / "free.tif")


def polygons(path, squares, epsg=None):
    """GeoJSON of axis-parallel rectangles (left, right, west, south, east, north)."""
    features = [
        {
            "type": "Feature",
            "properties": {"left": left, "right": right},
            "geometry": {"type": "Polygon", "coordinates": [[[w, s], [e, s], [e, n], [w, n], [w, s]]]},
        }
        for left, right, w, s, e, n in squares
    ]
    crs = {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{epsg}"}}} if epsg else {}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features, **crs}), encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", ["raster", "polygons"])
def test_map_of_models(erring_result, erring, kind, tmp_path):
    """A DEM pieced together: the map that deform writes, or polygons; the steps at its seams go."""
    of = restitution_of(erring, "absorbed")
    models = block_models(erring, of, strip_pairs(erring, of))
    middle = np.mean([m.middle for m in models if m.model.names[0].startswith("2_")], axis=0)
    grid, terrain = square_grid(middle, 200, 3.0), Terrain(middle, mean_ground(erring))
    xy = cells(grid)
    if kind == "raster":
        options = DeformOptions(spacing=6.0, variant="absorbed")
        assert run_deform(erring_result, options, tmp_path / "map", False, True) == 0
        chosen = tmp_path / "map" / "model.tif"
        with RasterReader(chosen) as reader:
            own = reader.grid
            n = reader.read(0, 0, own.rows, own.columns)
        number = n[np.rint(own.row(xy[:, 1])).astype(int), np.rint(own.column(xy[:, 0])).astype(int)]
        number = np.nan_to_num(number, nan=-1).astype(int)
    else:
        pairs = ({"2_003", "2_004"}, {"2_004", "2_005"})
        two = [k for k, m in enumerate(models) if set(m.model.names) in pairs]
        near = nearest_models(tuple(models[k] for k in two), Places(), np.column_stack([xy, terrain(xy)]))
        west = xy[:, 0] < middle[0]
        number = np.where(near < 0, -1, np.where(west, two[0], two[1]))
        w, s, e, t = grid.left, grid.top - 600.0, grid.left + 600.0, grid.top
        chosen = polygons(
            tmp_path / "map.geojson",
            [(*models[two[0]].model.names, w, s, middle[0], t), (*models[two[1]].model.names, middle[0], s, e, t)],
        )
    z, good = np.full(len(xy), np.nan), np.zeros(len(xy), bool)
    for k in np.unique(number[number >= 0]):
        rows = np.flatnonzero(number == k)
        z[rows], _, good[rows] = wrong_heights(models[k].model, terrain, xy[rows])
    good = ~next_to(~good.reshape(200, 200))
    write_dem(tmp_path / "dem.tif", grid, z.reshape(200, 200))
    content = demcor(erring_result, tmp_path / "dem.tif", tmp_path / "out.tif", models=chosen, orientation="absorbed")
    found = values(tmp_path / "out.tif")
    assert good.sum() > 8000
    # where two models meet, a cell's true place may lie in the other one: two cells beside a border prove nothing
    same = np.ones((200, 200), bool)
    for axis in (0, 1):
        for reach in (1, 2):
            same &= np.roll(number.reshape(200, 200), reach, axis) == number.reshape(200, 200)
            same &= np.roll(number.reshape(200, 200), -reach, axis) == number.reshape(200, 200)
    proof = good & same
    assert proof.sum() > 5000
    assert np.abs(found - terrain(xy).reshape(200, 200))[proof].max() < 1e-3
    seams = content["seams"]
    assert seams["count"] >= (3 if kind == "raster" else 1)
    assert seams["rms_before"] > 0.05
    assert seams["rms_after"] < 0.15 * seams["rms_before"]
    assert seams["worst"][0]["rms_after"] < seams["worst"][0]["rms_before"]


def test_kind_of_file_is_kept(erring_result, erring, tmp_path):
    """Type, no-data value, compression and tiles of the DEM; holes stay holes."""
    wrong = Wrong(erring, restitution_of(erring), tmp_path, dtype=np.float64, no_data=-32768.0,
                  options={"compress": "deflate", "predictor": 3})  # fmt: skip
    z = wrong.z.copy()
    z[10:14, 20:25] = np.nan
    write_dem(wrong.path, wrong.grid, z, np.float64, no_data=-32768.0, options={"compress": "deflate", "predictor": 3})
    before = wrong.path.read_bytes()
    content = demcor(erring_result, wrong.path, tmp_path / "out.tif", PAIR)
    assert content["no_data"] == 20
    assert wrong.path.read_bytes() == before
    with rasterio.open(tmp_path / "out.tif") as made, rasterio.open(wrong.path) as old:
        for name in ("dtypes", "nodata", "transform", "shape", "crs"):
            assert getattr(made, name) == getattr(old, name)
        assert made.profile["compress"] == "deflate"
        assert made.profile["tiled"]
        assert (made.read(1)[10:14, 20:25] == -32768.0).all()
    with rasterio.open(tmp_path / "out_dZ.tif") as dz:
        assert dz.descriptions == ("dZ taken off the DEM, m",)
        assert (dz.read(1)[10:14, 20:25] == -32768.0).all()


def test_what_cannot_be_done_is_said_and_nothing_is_written(erring_result, erring, plain_result, tmp_path):
    wrong = Wrong(erring, restitution_of(erring), tmp_path)
    far = tmp_path / "far.tif"
    write_raster(far, np.zeros((5, 5)), Grid(5, 5, 9e5, 9e5, 1.0, 1.0))
    empty = tmp_path / "empty.tif"
    write_raster(empty, np.full((5, 5), np.nan), square_grid(middle_of(wrong.model), 5, 1.0))
    nameless = polygons(tmp_path / "nameless.geojson", [("", "2_004", 0, 0, 1, 1)])
    stranger = polygons(tmp_path / "stranger.geojson", [("2_003", "9_999", 0, 0, 1, 1)])
    half = tmp_path / "half.csv"
    half.write_text("image,X0,Y0,Z0,omega,phi,kappa\n2_003,0,0,1000,0,0,0\n", encoding="utf-8")
    out = tmp_path / "out.tif"
    before = sorted(p.name for p in tmp_path.iterdir())
    for match, result, dem, pair, models, orientation in (
        ("either --pair or --models", erring_result, wrong.path, None, None, None),
        ("either --pair or --models", erring_result, wrong.path, PAIR, nameless, None),
        ("no photograph '9_999'", erring_result, wrong.path, ("2_003", "9_999"), None, None),
        ("no photograph '9_999'", erring_result, wrong.path, None, stranger, None),
        ("no attribute 'left' or 'right'", erring_result, wrong.path, None, nameless, None),
        ("lies outside the models", erring_result, far, PAIR, None, None),
        ("has no data", erring_result, empty, PAIR, None, None),
        ("is no raster", erring_result, nameless, PAIR, None, None),
        ("no such file or result", erring_result, wrong.path, PAIR, None, "nowhere.csv"),
        ("'2_004' is not oriented", erring_result, wrong.path, PAIR, None, str(half)),
        ("has no image errors", plain_result, wrong.path, PAIR, None, None),
        ("holds no adjustment", tmp_path, wrong.path, PAIR, None, None),
    ):
        with pytest.raises(InputError, match=match):
            run_demcor(result, dem, out, pair, models, None, orientation, True)
        assert sorted(p.name for p in tmp_path.iterdir()) == before
    with pytest.raises(InputError, match="source and target are the same"):
        run_demcor(erring_result, wrong.path, wrong.path, PAIR, None, None, None, True)


def test_command_line(erring_result, erring, tmp_path):
    wrong = Wrong(erring, restitution_of(erring), tmp_path)

    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "aerotri.cli", "demcor", str(erring_result), "dem.tif", *arguments],
            capture_output=True, text=True, timeout=1200, check=False, cwd=tmp_path,
        )  # fmt: skip

    done = run("--pair", *PAIR, "--out", "out.tif")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(
        "8100 of 8100 cells corrected, 0 without data, 0 outside the models; 1 model, "
        "photographs oriented with additional parameters\n"
    )
    assert restored(wrong, tmp_path / "out.tif")
    old = (tmp_path / "out.tif").read_bytes()
    (tmp_path / "dem.tif").write_bytes((tmp_path / "dem.tif").read_bytes()[:9000])
    done = run("--pair", *PAIR, "--out", "out.tif")
    assert done.returncode == 2
    assert done.stderr.startswith("aerotri: dem.tif: cannot be read")
    assert done.stderr.count("\n") == 1
    assert (tmp_path / "out.tif").read_bytes() == old
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "dem.tif", "out.tif", "out_dZ.tif", "out_demcor.json", "out_sigma_dZ.tif",
    ]  # fmt: skip


def test_models_of_the_dem_are_those_that_were_flown(erring, erring_result, tmp_path):
    """Left and right exchanged are the same model; another pair is not."""
    wrong = Wrong(erring, restitution_of(erring), tmp_path)
    demcor(erring_result, wrong.path, tmp_path / "turned.tif", PAIR[::-1])
    assert restored(wrong, tmp_path / "turned.tif")
    demcor(erring_result, wrong.path, tmp_path / "other.tif", ("2_002", "2_004"))
    assert not restored(wrong, tmp_path / "other.tif")
    point = np.array([[*middle_of(wrong.model), mean_ground(erring)]])
    assert np.isfinite(deform_points(wrong.model, point).d).all()
