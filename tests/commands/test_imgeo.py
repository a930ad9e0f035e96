"""`aerotri imgeo` as a user meets it: files in, files out, one line of error."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import rasterio

from aerotri.commands.adjust import run_adjust
from aerotri.commands.imgeo import ImgeoOptions, run_imgeo
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.solution import read_solution
from aerotri.image_errors import image_groups, systematic_errors
from aerotri.observations import Block
from aerotri.pipeline import reopen
from aerotri.simulation import parse_spec, simulate
from small_blocks import small_spec, with_adjustment

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
SIZE = (575, 375)


def small_block(**adjustment) -> Block:
    camera = {
        "preset": "ultracam_d",
        "size_px": list(SIZE),
        "pixel_um": 180.0,
        "errors": {"physical": {"rms_um": 90.0}},
    }
    tables = small_spec(camera={"ucd": camera | {"interior": {"x0_mm": {"sigma": 0.01}}}})
    tables["flight"] = tables["flight"] | {"gsd_m": 2.0, "days": 2}
    tables["tie_points"] = {"per_image": 60, "probability": 0.9, "sigma_um": 20.0}
    block, _ = simulate(parse_spec(tables), 1)
    return with_adjustment(block, **adjustment)


def adjusted_folder(block, folder):
    write_block(block, folder / "block")
    assert run_adjust(folder / "block", folder / "result", None, None, None, False, True) == 0
    return folder / "result"


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    parameters = (("bluh", tuple(str(i) for i in range(1, 13))), ("ultracam_d", tuple(str(i) for i in range(42, 74))))
    return adjusted_folder(small_block(additional_parameters=parameters), tmp_path_factory.mktemp("one"))


@pytest.fixture(scope="module")
def by_day(tmp_path_factory):
    block = small_block(additional_parameters=(("bluh", ("1", "2", "9")),), parameter_groups="day")
    return adjusted_folder(block, tmp_path_factory.mktemp("two"))


def photograph(path, size=SIZE):
    pixels = np.random.default_rng(1).integers(0, 4000, (1, size[1], size[0])).astype(np.uint16)
    with rasterio.open(path, "w", driver="GTiff", width=size[0], height=size[1], count=1, dtype="uint16") as file:
        file.write(pixels)
    return path


def correction_table(path):
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def test_everything_is_written(result, tmp_path, capsys):
    source = photograph(tmp_path / "1_003.tif")
    run_imgeo(result, [source], tmp_path / "out", ImgeoOptions(), False)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "1_003.tif", "camera.toml", "cameras.txt", "correction.csv", "correction.tif", "ideal_cameras.txt",
        "imgeo.json",
    ]  # fmt: skip
    record = json.loads((tmp_path / "out" / "imgeo.json").read_text(encoding="utf-8"))
    assert record["sign"] == "measured = ideal + d; corrected = measured - d"
    assert record["photographs"][0]["written"] == "1_003.tif"
    (group,) = record["groups"]
    assert 20.0 < group["d_rms_um"] < group["d_max_um"]
    for nearest in group["nearest"]:
        assert 1.0 < nearest["remaining_rms_um"] < group["d_rms_um"]
    assert "nearest OpenCV model leaves" in capsys.readouterr().out
    with rasterio.open(tmp_path / "out" / "1_003.tif") as made, rasterio.open(source) as old:
        assert made.shape == old.shape
        assert (made.read() != old.read()).any()
    # once more into the same folder
    run_imgeo(result, [source], tmp_path / "out", ImgeoOptions("lanczos", "deflate"), True)
    printed = json.loads(capsys.readouterr().out)
    assert printed["resampling"] == "lanczos"


def test_correction_is_the_field_with_its_sigma(result, tmp_path):
    run_imgeo(result, [], tmp_path / "out", ImgeoOptions(), True)
    adjusted = reopen(read_block(result / "block"), read_solution(result / "solution.npz")).result
    rows = correction_table(tmp_path / "out" / "correction.csv")
    assert {row["tile"] for row in rows} == {str(k) for k in range(9)}
    at = np.array([[float(row[k]) for k in ("x", "y", "dx", "dy", "sx", "sy")] for row in rows])
    inner = (np.abs(at[:, 0]) < 51.0) & (np.abs(at[:, 1]) < 33.0)
    # the table rounds to 0.1 nm, which may lie on the other side of a seam: nodes off the seams
    counts = [sum(a[:2].tolist() == b[:2].tolist() for b in at) for a in at[::7]]
    keep = np.flatnonzero(inner[::7] & (np.array(counts) == 1)) * 7
    d, covariance = systematic_errors(adjusted, "ucd", *at[keep, :2].T)
    near = np.abs(at[keep, 2:4] - d).max(axis=1) < 1e-6
    assert near.mean() > 0.9
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(at[keep, 4:][near], sigma[near], atol=2e-7)
    with rasterio.open(tmp_path / "out" / "correction.tif") as raster:
        assert raster.count == 2
        assert raster.tags()["SIGN"] == "measured = ideal + d; corrected = measured - d"
        assert raster.descriptions == ("dx mm", "dy mm")
        x, y = raster.xy(20, 31)
        value = [raster.read(k)[20, 31] for k in (1, 2)]
    d, _ = systematic_errors(adjusted, "ucd", np.array([x]), np.array([y]))
    np.testing.assert_allclose(value, d[0], atol=1e-7)


def test_ideal_camera_and_colmap_cameras(result, tmp_path):
    run_imgeo(result, [], tmp_path / "out", ImgeoOptions(), True)
    camera = tomllib.loads((tmp_path / "out" / "camera.toml").read_text(encoding="utf-8"))["camera"]["ucd"]
    record = json.loads((tmp_path / "out" / "imgeo.json").read_text(encoding="utf-8"))["groups"][0]
    assert camera["focal_length_mm"] == record["focal_length_mm"]
    assert camera["principal_point_mm"] == [record["x0_mm"], record["y0_mm"]]
    assert record["x0_mm"] != 0.0
    # a block with this camera is read again
    block = read_block(result / "block")
    text = (result / "block" / "block.toml").read_text(encoding="utf-8")
    folder = tmp_path / "ideal_block"
    shutil.copytree(result / "block", folder)
    start, end = text.index("[camera.ucd]"), text.index("[stochastic]")
    ideal = (tmp_path / "out" / "camera.toml").read_text(encoding="utf-8")
    (folder / "block.toml").write_text(text[:start] + ideal + "\n" + text[end:], encoding="utf-8")
    again = read_block(folder).cameras[0]
    assert again.size_px == block.cameras[0].size_px
    assert not again.brown
    lines = (tmp_path / "out" / "cameras.txt").read_text(encoding="utf-8").splitlines()
    assert [line.split()[1] for line in lines if not line.startswith("#")] == ["OPENCV"]
    pycolmap = pytest.importorskip("pycolmap")
    for name, model in (("cameras.txt", "OPENCV"), ("ideal_cameras.txt", "SIMPLE_PINHOLE")):
        place = tmp_path / name[:-4]
        place.mkdir()
        shutil.copy(tmp_path / "out" / name, place / "cameras.txt")
        for other in ("images.txt", "points3D.txt"):
            (place / other).write_text("")
        read = pycolmap.Reconstruction(place).cameras[1]
        assert read.model.name == model
        assert (read.width, read.height) == SIZE


def test_groups_have_their_own_fields(by_day, tmp_path):
    """Photographs of two days: each is corrected by its own parameters."""
    adjusted = reopen(read_block(by_day / "block"), read_solution(by_day / "solution.npz")).result
    groups = {group.name: group for group in image_groups(adjusted.block)}
    assert set(groups) == {"1", "2"}
    names = [adjusted.block.images.names[np.flatnonzero(groups[day].images)[0]] for day in ("1", "2")]
    files = [photograph(tmp_path / f"{name}.tif") for name in names]
    run_imgeo(by_day, files, tmp_path / "out", ImgeoOptions(), True)
    record = json.loads((tmp_path / "out" / "imgeo.json").read_text(encoding="utf-8"))
    assert [p["group"] for p in record["photographs"]] == ["1", "2"]
    assert {g["correction_raster"] for g in record["groups"]} == {"correction_1.tif", "correction_2.tif"}
    assert [g["ideal_camera"] for g in record["groups"]] == ["ucd 1", "ucd 2"]
    with rasterio.open(tmp_path / "out" / files[0].name) as one, rasterio.open(tmp_path / "out" / files[1].name) as two:
        assert (one.read() != two.read()).any()
    assert {row["group"] for row in correction_table(tmp_path / "out" / "correction.csv")} == {"1", "2"}
    stranger = photograph(tmp_path / "test_flight.tif")
    run_imgeo(by_day, [stranger], tmp_path / "more", ImgeoOptions(group="2"), True)
    with (
        rasterio.open(tmp_path / "more" / "test_flight.tif") as made,
        rasterio.open(tmp_path / "out" / files[1].name) as two,
    ):
        np.testing.assert_array_equal(made.read(), two.read())


def test_what_cannot_be_done_is_said_before_anything_is_written(result, by_day, tmp_path):
    good = photograph(tmp_path / "1_003.tif")
    twin = tmp_path / "twin"
    twin.mkdir()
    other = photograph(twin / "1_003.tif")
    stranger = photograph(tmp_path / "stranger.tif")
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "mine.txt").write_text("mine")
    out = tmp_path / "out"
    for match, folder, files, target, options in (
        ("no photograph of the block", result, [good, stranger], out, ImgeoOptions()),
        ("no group", result, [stranger], out, ImgeoOptions(group="x")),
        ("both called as photograph", result, [good, other], out, ImgeoOptions()),
        ("no such file", result, [tmp_path / "1_004.tif"], out, ImgeoOptions()),
        ("is 20 × 30 pixels", result, [good, photograph(tmp_path / "1_002.tif", (20, 30))], out, ImgeoOptions()),
        ("holds other files", result, [good], foreign, ImgeoOptions()),
        ("resampling 'x'", result, [good], out, ImgeoOptions(resampling="x")),
        ("compression 'jpeg'", result, [good], out, ImgeoOptions(compression="jpeg")),
        ("holds no adjustment", tmp_path, [good], out, ImgeoOptions()),
    ):
        with pytest.raises(InputError, match=match):
            run_imgeo(folder, files, target, options, True)
        assert not out.exists()


def test_own_input_is_never_overwritten(result, tmp_path):
    run_imgeo(result, [], tmp_path / "out", ImgeoOptions(), True)
    source = photograph(tmp_path / "out" / "1_003.tif")
    before = source.read_bytes()
    with pytest.raises(InputError, match="overwritten by its own correction"):
        run_imgeo(result, [source], tmp_path / "out", ImgeoOptions(), True)
    assert source.read_bytes() == before


def test_damaged_photograph_leaves_no_half_written_file(result, tmp_path):
    source = photograph(tmp_path / "1_003.tif")
    source.write_bytes(source.read_bytes()[:200_000])
    with pytest.raises(InputError, match=r"^\S*1_003.tif: cannot be read"):
        run_imgeo(result, [source], tmp_path / "out", ImgeoOptions(), True)
    left = [p.name for p in (tmp_path / "out").iterdir()]
    assert "1_003.tif" not in left
    assert not any("tmp" in name for name in left)


def test_not_converged_is_refused(tmp_path):
    block = small_block()
    write_block(block, tmp_path / "block")
    with_limit = replace(block.settings, adjustment=replace(block.settings.adjustment, max_iterations=1))
    write_block(replace(block, settings=with_limit), tmp_path / "short")
    assert run_adjust(tmp_path / "short", tmp_path / "result", None, None, None, False, True) == 1
    with pytest.raises(InputError, match="not converged"):
        run_imgeo(tmp_path / "result", [], tmp_path / "out", ImgeoOptions(), True)


def test_command_line(result, tmp_path):
    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "aerotri.cli", "imgeo", *map(str, arguments)],
            capture_output=True, text=True, timeout=1200, check=False,
        )  # fmt: skip

    source = photograph(tmp_path / "1_003.tif", (300, 375))
    done = run(result, source, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert f"aerotri: {source}: is 300 × 375 pixels large, camera 'ucd' has 575 × 375" in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.strip().splitlines()[-1].startswith(f"aerotri: {source}: is 300")
