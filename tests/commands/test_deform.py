"""`aerotri deform` as a user meets it: rasters, numbers and pictures of one model or of the block."""

from __future__ import annotations

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

from aerotri.commands.deform import DeformOptions, run_deform
from aerotri.conventions import InputError
from aerotri.deformation import absorbed, restitution_of
from aerotri.deformation.model_grid import mean_ground, pair_of
from aerotri.deformation.stereo_model import covariance_of, deform_points
from aerotri.rasters.grids import Grid, RasterReader, write_raster

PAIR = ("2_003", "2_004")


def deformed(result, out, capsys, plots=False, **options):
    """deform.json, which is what is printed."""
    capsys.readouterr()
    assert run_deform(result, DeformOptions(**options), out, plots, True) == 0
    printed = json.loads(capsys.readouterr().out)
    text = (out / "deform.json").read_text(encoding="utf-8")
    assert json.loads(text) == printed
    assert "NaN" not in text
    return printed


def raster(path):
    with RasterReader(path) as reader:
        return reader.read(0, 0, reader.grid.rows, reader.grid.columns).astype(float), reader.grid, reader.plan


def test_pair_as_flown(erring_result, erring, tmp_path, capsys):
    """Rasters node by node against the model itself; numbers of the JSON against the rasters."""
    content = deformed(erring_result, tmp_path / "out", capsys, plots=True, pair=PAIR, spacing=20.0)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        ".aerotri-files", "dX.tif", "dY.tif", "dZ.tif", "deform.json", "plots", "sigma_dX.tif", "sigma_dY.tif",
        "sigma_dZ.tif",
    ]  # fmt: skip
    plots = {p.name for p in (tmp_path / "out" / "plots").iterdir()}
    assert plots == {"contours.png", "contours.svg", "profiles.png", "profiles.svg"}
    assert (content["kind"], content["pair"], content["variant"]) == ("pair", list(PAIR), "free")
    model = pair_of(restitution_of(erring), erring, *PAIR)
    values = {what: raster(tmp_path / "out" / f"{what}.tif") for what in ("dX", "dY", "dZ", "sigma_dX", "sigma_dZ")}
    grid = values["dZ"][1]
    seen = np.argwhere(np.isfinite(values["dZ"][0]))
    assert content["nodes"] == len(seen) > 500
    for i, j in np.random.default_rng(1).choice(seen, 8):
        point = np.array([[float(grid.x(j)), float(grid.y(i)), mean_ground(erring)]])
        d, sigma = deform_points(model, point).d[0], np.sqrt(np.diagonal(covariance_of(model, point)[0]))
        found = [values[what][0][i, j] for what in values]
        np.testing.assert_allclose(found, [*d, sigma[0], sigma[2]], atol=2e-6)
    for what in values:
        v = values[what][0][np.isfinite(values[what][0])]
        expected = {"min": v.min(), "max": v.max(), "mean": v.mean(), "rms": np.sqrt(np.mean(v**2))}
        assert content[what] == pytest.approx(expected, abs=1e-6)
    geometry = content["base_m"], content["height_m"], content["base_mm"]
    assert content["h_over_b"] == pytest.approx(geometry[1] / geometry[0])
    assert content["cm_per_um"] == pytest.approx(0.1 * geometry[1] / geometry[2])


def test_stated_end_lap_in_both_variants(erring_result, tmp_path, capsys):
    found = {}
    for variant in ("free", "absorbed"):
        content = deformed(
            erring_result, tmp_path / variant, capsys, end_lap=0.663, gsd=0.09, spacing=10.0, variant=variant
        )
        assert content["kind"] == "normal case"
        assert content["variant"] == variant
        assert content["h_over_b"] == pytest.approx(4.46, abs=0.005)
        assert content["gsd_m"] == pytest.approx(0.09)
        values, grid, system = raster(tmp_path / variant / "dZ.tif")
        assert system == ""
        assert (grid.cell_x, grid.cell_y) == (10.0, 10.0)
        found[variant] = values
    assert np.nanmax(np.abs(found["free"] - found["absorbed"])) > 0.1


def test_block_and_the_map_of_its_models(erring_result, erring, tmp_path, capsys):
    content = deformed(erring_result, tmp_path / "out", capsys, plots=True, spacing=40.0, variant="absorbed")
    assert (tmp_path / "out" / "plots" / "block.png").stat().st_size > 10_000
    with (tmp_path / "out" / "models.csv").open(newline="", encoding="utf-8") as file:
        models = list(csv.DictReader(file))
    assert [(m["left"], m["right"]) for m in models] == [(m["left"], m["right"]) for m in content["models"]]
    number, dz = raster(tmp_path / "out" / "model.tif")[0], raster(tmp_path / "out" / "dZ.tif")[0]
    np.testing.assert_array_equal(np.isfinite(number), np.isfinite(dz))
    for k, model in enumerate(content["models"]):
        assert (number == k).sum() == model["nodes"]
    with (tmp_path / "out" / "seams.csv").open(newline="", encoding="utf-8") as file:
        seams = list(csv.DictReader(file))
    assert len(seams) == content["seams"]["count"] > 10
    nodes, rms = (np.array([float(seam[key]) for seam in seams]) for key in ("nodes", "rms"))
    assert content["seams"]["rms"] == pytest.approx(np.sqrt(np.sum(nodes * rms**2) / nodes.sum()))
    # neighbours in their strip, from west to east whichever way it was flown
    names, east = erring.result.block.images.names.tolist(), erring.result.images.centre[:, 0]
    for model in content["models"]:
        (strip, left), (other, right) = (model[side].split("_") for side in ("left", "right"))
        assert strip == other
        assert abs(int(left) - int(right)) == 1
        assert east[names.index(model["left"])] < east[names.index(model["right"])]


def test_ground_from_a_dem(erring_result, erring, tmp_path, capsys):
    """Every node has the height of the DEM; where the DEM has none there is no node."""
    model = pair_of(restitution_of(erring), erring, *PAIR)
    middle, level = model.true.centre.mean(axis=0), mean_ground(erring)
    grid = Grid(80, 80, middle[0] - 1000.0, middle[1] + 1000.0, 25.0, 25.0)
    z = level + 0.2 * (grid.x(np.arange(80)) - middle[0]) + np.zeros((80, 1))
    z[44:48, 40:44] = np.nan
    write_raster(tmp_path / "dem.tif", z, grid)
    content = deformed(erring_result, tmp_path / "out", capsys, pair=PAIR, dem=tmp_path / "dem.tif", spacing=20.0)
    assert content["ground"] == "DEM dem.tif"
    dz, nodes, _ = raster(tmp_path / "out" / "dZ.tif")
    x, y = np.meshgrid(nodes.x(np.arange(nodes.columns)), nodes.y(np.arange(nodes.rows)))
    hole = (x > grid.x(40)) & (x < grid.x(43)) & (y < grid.y(44)) & (y > grid.y(47))
    assert hole.sum() >= 9
    assert np.isnan(dz[hole]).all()
    for i, j in np.random.default_rng(2).choice(np.argwhere(np.isfinite(dz)), 6):
        point = np.array([[x[i, j], y[i, j], level + 0.2 * (x[i, j] - middle[0])]])
        assert dz[i, j] == pytest.approx(deform_points(model, point).d[0, 2], abs=1e-5)


def test_older_deformation_is_replaced_and_notes_are_kept(erring_result, tmp_path, capsys):
    out = tmp_path / "out"
    deformed(erring_result, out, capsys, spacing=60.0)
    (out / "notes.txt").write_text("mine")
    deformed(erring_result, out, capsys, end_lap=0.6, spacing=60.0)
    assert "notes.txt" in {p.name for p in out.iterdir()}
    assert not (out / "model.tif").exists()
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        run_deform(erring_result, DeformOptions(end_lap=0.6), foreign, False, True)


def test_what_cannot_be_done_is_said_before_anything_is_written(erring_result, plain_result, tmp_path):
    dem = tmp_path / "dem.tif"
    write_raster(dem, np.zeros((4, 4)), Grid(4, 4, 9e4, 9e4, 10.0, 10.0))
    for match, result, options in (
        ("both given", erring_result, DeformOptions(pair=PAIR, end_lap=0.6)),
        ("no variant 'x'", erring_result, DeformOptions(variant="x")),
        ("flat ground", erring_result, DeformOptions(end_lap=0.6, dem=dem)),
        ("belong to --end-lap", erring_result, DeformOptions(pair=PAIR, gsd=0.1)),
        ("end lap 66.3", erring_result, DeformOptions(end_lap=66.3)),
        ("no photograph '9_999'", erring_result, DeformOptions(pair=("2_003", "9_999"))),
        ("no parameter group 'x'", erring_result, DeformOptions(end_lap=0.6, group="x")),
        ("no node", erring_result, DeformOptions(pair=PAIR, dem=dem)),
        ("holds no adjustment", tmp_path, DeformOptions(end_lap=0.6)),
        ("has no image errors", plain_result, DeformOptions(end_lap=0.6)),
    ):
        with pytest.raises(InputError, match=match):
            run_deform(result, options, tmp_path / "out", False, True)
        assert not (tmp_path / "out").exists()


def test_orientation_that_cannot_be_had_is_told(erring_result, tmp_path, monkeypatch, capsys):
    """Without parameters the block may not hold: that is the adjustment's failure, not the user's."""

    def failing(*_):
        raise absorbed.AbsorptionFailedError("the adjustment without additional parameters is not converged")

    # the package has a function of the module's name
    monkeypatch.setattr(sys.modules["aerotri.deformation.restitution"], "absorbed_orientation", failing)
    options = DeformOptions(end_lap=0.6, variant="absorbed")
    assert run_deform(erring_result, options, tmp_path / "out", False, False) == 1
    told = "aerotri: the adjustment without additional parameters is not converged"
    # a first run says before that it compiles
    assert capsys.readouterr().err.splitlines()[-1] == told
    assert not (tmp_path / "out").exists()


def test_command_line(erring_result, tmp_path):
    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "aerotri.cli", "deform", str(erring_result), *arguments],
            capture_output=True, text=True, timeout=1200, check=False, cwd=tmp_path,
        )  # fmt: skip

    done = run("--pair", *PAIR, "--spacing", "50", "--no-plots")
    assert done.returncode == 0
    assert done.stdout.startswith("pair 2_003, 2_004, photographs oriented with additional parameters, ")
    assert "σ of dZ" in done.stdout
    assert (tmp_path / "result_deformation" / "dZ.tif").is_file()
    done = run("--pair", "2_003", "2_003")
    assert done.returncode == 2
    assert done.stderr.endswith("aerotri: '2_003' is named twice — a model needs two photographs\n")
