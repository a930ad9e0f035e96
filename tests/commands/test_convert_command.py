"""`aerotri convert` as a user meets it: the documented commands for the real data, every target, errors."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from aerotri.commands.convert import camera_spec, run_convert, three_values
from aerotri.conventions import InputError
from aerotri.formats.assembly.project import Request, read_project
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.convert import TARGETS, detect_format
from aerotri.formats.foreign.metashape import read_metashape
from places import PROJECT
from small_blocks import small_block

PAGES = ("real_blocks.md", "data.md")
"""Of docs/validation, on which the commands for the public data sets stand."""


def documented(target: str) -> list[str]:
    """The arguments of the command of the documentation that writes `target`."""
    found = []
    for page in PAGES:
        text = (PROJECT / "docs" / "validation" / page).read_text(encoding="utf-8").replace("\\\n", " ")
        found += [shlex.split(line)[1:] for line in text.splitlines() if line.startswith("aerotri convert")]
    return next(words for words in found if words[words.index("--out") + 1] == target)


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "aerotri.cli", *map(str, arguments)],
        capture_output=True, text=True, timeout=1200, check=False,
    )  # fmt: skip


@pytest.fixture
def documented_run(shared_data, tmp_path):
    """Runs the documented command for a data set; the folder it wrote and its messages."""

    def convert(data_set: str, target: str) -> tuple[Path, list[str]]:
        folder = shared_data(data_set)
        words = [re.sub(rf"^{data_set}\b", str(folder), word) for word in documented(target)]
        words[words.index("--out") + 1] = str(tmp_path / target)
        done = run(*words, "--json")
        assert done.returncode == 0, done.stderr
        return tmp_path / target, json.loads(done.stdout)["messages"]

    return convert


def test_cu_sbr_p1(documented_run):
    """581 photographs, 108 226 rays, RTK positions and six control points in the order Northing, Easting."""
    folder, messages = documented_run("cu_sbr_p1", "p1")
    block = read_block(folder)
    assert (len(block.images), len(block.image_points), len(block.points)) == (581, 108226, 13953)
    assert block.crs == "EPSG:32647"
    camera = block.cameras[0]
    assert (camera.name, camera.size_px, camera.pixel_um, camera.focal_length_mm) == (
        "P1",
        (8192, 5460),
        4.27246,
        35.01,
    )
    assert [prior.kind for prior in camera.interior.values()] == ["free"] * 3
    np.testing.assert_array_equal(block.image_points.xy[0], [10.33879, 1.8067])
    np.testing.assert_allclose(block.image_points.sigma, 0.00213623)
    assert block.gnss_ins is not None
    assert len(block.gnss_ins) == 581
    np.testing.assert_array_equal(block.gnss_ins.sigma[0], [0.02, 0.02, 0.05])
    names = block.points[block.control.point].tolist()
    assert names == ["GCP_GCP02", "GCP_GCP10", "GCP_GCP11", "GCP_GCP13", "GCP_GCP15", "GCP_GCP24"]
    np.testing.assert_array_equal(block.control.xyz[0], [717429.126, 1606454.237, 3.4845])
    np.testing.assert_array_equal(block.control.sigma[0], [0.02, 0.02, 0.05])
    measured = np.bincount(block.image_points.point, minlength=len(block.points))
    assert measured[block.control.point].tolist() == [10, 9, 10, 10, 10, 10]
    assert block.settings.gnss.shift == "off"
    assert messages == ["gnss_positions.csv: 581 photographs are named with another folder or file ending"]


def test_ultracam_eagle_m3(documented_run):
    folder, messages = documented_run("ultracam_eagle_m3", "eagle")
    block = read_block(folder)
    assert (len(block.images), len(block.image_points), len(block.control)) == (7, 24, 3)
    assert block.gnss_ins is not None
    fit = [float(found[1]) for said in messages if (found := re.search(r"to ([\d.]+) px \(", said))]
    assert len(fit) == 2
    assert fit[0] < 0.15
    assert fit[1] < 0.7


def test_dmc_ngi(documented_run):
    folder, messages = documented_run("dmc_ngi", "dmc")
    block = read_block(folder, rays_needed=False)
    assert (len(block.images), len(block.image_points)) == (4, 0)
    assert messages == []
    done = run("adjust", folder)
    assert done.returncode == 2
    said = f"aerotri: {folder / 'image_points.csv'}: holds no image points — give a row for every measured point\n"
    assert done.stderr == said


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A small block, and its result."""
    place = tmp_path_factory.mktemp("convert")
    write_block(small_block(31)[0], place / "block")
    done = run("adjust", place / "block", "--out", place / "result", "--no-plots")
    assert done.returncode == 0, done.stderr
    return place


def _messages(request: Request, target: Path, to: str) -> tuple[str, ...]:
    """What was said of a conversion in this process."""
    out = StringIO()
    with redirect_stdout(out):
        run_convert(request, target, to, as_json=True)
    content = json.loads(out.getvalue())
    assert (content["target"], content["format"]) == (str(target), to)
    return tuple(content["messages"])


def test_every_target_of_a_result(folders):
    with pytest.raises(InputError, match="has no observed positions"):
        _messages(Request(str(folders / "result"), ""), folders / "none", "pix4d-geo")
    block = read_block(folders / "block")
    for to in (name for name in TARGETS if name not in ("pix4d-geo", "odm-gcp", "odm-geo")):
        target = folders / f"r_{to}"
        _messages(Request(str(folders / "result"), ""), target, to)
        assert target.exists()
    for to in ("block", "bal", "colmap", "bundler", "opensfm"):
        assert detect_format(folders / f"r_{to}") == to
    adjusted = np.loadtxt(folders / "result" / "images.csv", delimiter=",", skiprows=1, usecols=(3, 4, 5))
    found = read_metashape(folders / "r_metashape")
    np.testing.assert_allclose(found.centre, adjusted, rtol=0, atol=5.1e-7)
    again = read_project(Request(str(folders / "r_opensfm"), ""))
    assert re.search(r"fit the given orientations to 0\.\d+ px", again.messages[-1])
    assert len(again.block.images) == len(block.images)


def test_start_values_of_a_block_are_said_to_be_such(folders):
    said = _messages(Request(str(folders / "block"), ""), folders / "b_opk", "opk")
    assert "the orientations are those of the files, not adjusted" in said
    found = read_metashape(folders / "b_opk")
    np.testing.assert_allclose(found.centre, read_block(folders / "block").images.centre, rtol=0, atol=5.1e-7)


def test_what_a_result_does_not_take(folders):
    with pytest.raises(InputError, match="nothing can be added"):
        run_convert(Request(str(folders / "result"), "", control="x"), folders / "x", "block", False)
    with pytest.raises(InputError, match="source and target are the same"):
        run_convert(Request(str(folders / "block"), ""), folders / "block", "block", False)


def test_there_and_back_by_the_command(folders, tmp_path):
    """Measured in BINGO, oriented in PAT-B: together they are the block again."""
    done = run("convert", folders / "block", tmp_path / "points.txt", "--to", "bingo")
    assert done.returncode == 0, done.stderr
    assert run("convert", folders / "block", tmp_path / "patb", "--to", "patb").returncode == 0
    assert run("convert", folders / "block", tmp_path / "gcp.csv", "--to", "pix4d-gcp").returncode == 0
    block = read_block(folders / "block")
    camera = block.cameras[0]
    done = run(
        "convert", f"bingo:{tmp_path / 'points.txt'}", tmp_path / "again", "--control", tmp_path / "gcp.csv",
        "--orientation", tmp_path / "patb" / "block.ori", "--camera-size", "x".join(map(str, camera.size_px)),
        "--pixel-um", camera.pixel_um, "--focal-length-mm", camera.focal_length_mm, "--image-sigma-um", "2",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "rotations are camera-to-object" in done.stdout
    again = read_block(tmp_path / "again")
    assert again.name == "again"
    assert again.cameras[0].name == camera.name
    order = {name: i for i, name in enumerate(block.points.tolist())}
    assert set(again.points.tolist()) == set(order)
    key = block.image_points.image * 10**6 + block.image_points.point
    mine = (
        again.image_points.image * 10**6 + np.array([order[n] for n in again.points.tolist()])[again.image_points.point]
    )
    np.testing.assert_allclose(
        again.image_points.xy[np.argsort(mine)], block.image_points.xy[np.argsort(key)], rtol=0, atol=5.1e-7
    )
    np.testing.assert_allclose(again.images.centre, block.images.centre, rtol=0, atol=5.1e-6)
    assert run("convert", "bingo:nothing", tmp_path / "x").stderr.startswith("aerotri: nothing: there is no such file")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("{block}", "x", "--to", "bingo", "--camera-size", "8192"), "--camera-size '8192' is not a size in pixels"),
        (("{block}", "x", "--control-sigma-m", "1,2"), "--control-sigma-m 1,2"),
        (("{block}", "x", "--flight-axis", "up"), "--flight-axis 'up' is not an image axis"),
        (("{block}", "x", "--to", "pdf"), "'pdf' is not a format that is written — known are block, bal"),
    ],
)
def test_errors_are_one_line(folders, arguments, says):
    done = run("convert", *(word.format(block=folders / "block") for word in arguments))
    assert done.returncode == 2
    assert done.stderr.startswith(f"aerotri: {says}")
    assert len(done.stderr.splitlines()) == 1


def test_options():
    assert three_values("", "--x") is None
    assert three_values("0.1", "--x") == (0.1, 0.1, 0.1)
    assert three_values("1, 2,3e-1", "--x") == (1.0, 2.0, 0.3)
    for text in ("1,2,3,4", "1,-2,3", "a", "1,,3", "nan"):
        with pytest.raises(InputError, match="--x"):
            three_values(text, "--x")
    assert camera_spec(None, "", "8192x5460", None, None, None, False).size_px == (8192, 5460)
    assert camera_spec(None, "", " 8192 × 5460 ", None, None, "-x", True).free
    for text in ("0x5", "8192", "8192x", "1e3x5", "-5x5"):
        with pytest.raises(InputError, match="--camera-size"):
            camera_spec(None, "", text, None, None, None, False)
