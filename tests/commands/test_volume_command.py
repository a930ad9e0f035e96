"""`aerotri volume` as a user meets it: numbers, σ with its parts, the page, one line of error."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import shapely

from aerotri.commands.adjust import run_adjust
from aerotri.commands.volume import VolumeInput, run_volume
from aerotri.conventions import InputError
from aerotri.formats.block.folder import write_block
from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.volume.accuracy import PARTS
from aerotri.volume.settings import SectionPlan, SigmaOptions
from small_blocks import small_block

CELL, COUNT = 4.0, 80


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A hill of 12 m on a level of 100 m, in the middle of an adjusted block; a circle around it."""
    folder = tmp_path_factory.mktemp("volume")
    block, truth = small_block(5, "bluh:1-12")
    write_block(block, folder / "block")
    assert run_adjust(folder / "block", folder / "result", None, None, None, False, True) == 0
    middle = np.round(np.median(truth.centre[:, :2], axis=0))
    half = CELL * COUNT / 2.0
    grid = Grid(COUNT, COUNT, middle[0] - half, middle[1] + half, CELL, CELL)
    x, y = np.meshgrid(grid.x(np.arange(COUNT)) - middle[0], grid.y(np.arange(COUNT)) - middle[1])
    z = 100.0 + 12.0 * np.exp(-(x**2 + y**2) / (2.0 * 35.0**2))
    write_raster(folder / "dtm.tif", z, grid)
    write_raster(folder / "before.tif", np.full_like(z, 100.0), grid)
    (folder / "circle.wkt").write_text(shapely.Point(*middle).buffer(130.0).wkt)
    return folder


TRUE_VOLUME = 2.0 * np.pi * 35.0**2 * 12.0 * (1.0 - np.exp(-(130.0**2) / (2.0 * 35.0**2)))


def given(place, base="level:100", **changes):
    chosen = {"boundary": str(place / "circle.wkt"), "method": "prisms", "adjustment": place / "result",
              "pickets": None, "base_adjustment": None} | changes  # fmt: skip
    return VolumeInput(place / "dtm.tif", base, **chosen)


def run(place, out, what, options=None, plots=False):
    assert run_volume(what, SectionPlan(10.0, 20.0), options or SigmaOptions(), out, plots, True) == 0
    return json.loads((out / "volume.json").read_text())


def test_the_number_its_parts_and_the_page(place, tmp_path):
    options = SigmaOptions(base_sigma=0.02, boundary_sigma=0.5)
    content = run(place, tmp_path / "out", given(place), options, plots=True)
    assert content["net_m3"] == pytest.approx(TRUE_VOLUME, rel=0.01)
    for one in content["methods"]:
        assert one["net_m3"] == pytest.approx(TRUE_VOLUME, rel=0.01)
    sigma = content["sigma"]
    assert list(sigma["parts_m3"]) == list(PARTS)
    assert sigma["sigma_m3"] == pytest.approx(np.sqrt(sum(v**2 for v in sigma["parts_m3"].values())))
    assert all(v > 0.0 for v in sigma["parts_m3"].values())
    assert sigma["parts_m3"]["base"] == pytest.approx(0.02 * content["boundary"]["area_m2"])
    # heights of a block with 10 cm pixels: centimetres of mean height, not metres
    assert 0.005 < sigma["parts_m3"]["adjustment"] / content["boundary"]["area_m2"] < 0.3
    page = (tmp_path / "out" / "volume.html").read_text()
    assert page.count("<img") == 4
    assert "±" in page
    with RasterReader(tmp_path / "out" / "thickness.tif") as reader:
        z = reader.read(0, 0, reader.grid.rows, reader.grid.columns)
    assert np.nanmax(z) == pytest.approx(12.0, abs=0.1)
    assert np.isnan(z[0, 0])
    lines = (tmp_path / "out" / "sections.csv").read_text().splitlines()
    assert len(lines) == 1 + content["sections"]["count"]


def test_a_stated_sigma_of_the_base_takes_the_place_of_what_the_ground_tells(place, tmp_path):
    judged = run(place, tmp_path / "judged", given(place, "boundary"))
    stated = run(place, tmp_path / "stated", given(place, "boundary"), SigmaOptions(base_sigma=0.02))
    assert stated["sigma"]["parts_m3"]["base"] == pytest.approx(0.02 * stated["boundary"]["area_m2"])
    assert any("estimated from the ground outside" in text for text in judged["warnings"])
    assert not any("estimated from the ground outside" in text for text in stated["warnings"])


def test_two_surfaces_of_one_adjustment_cancel_what_they_share(place, tmp_path):
    """The hill over the ground: what tilts and lifts both is gone, what is left is the height of the hill."""
    one = run(place, tmp_path / "one", given(place))
    both = run(place, tmp_path / "both", given(place, str(place / "before.tif"), base_adjustment=place / "result"))
    assert both["net_m3"] == pytest.approx(one["net_m3"], rel=1e-6)
    single, double = (c["sigma"]["parts_m3"]["adjustment"] for c in (one, both))
    assert double < 0.05 * single
    assert any("come from one adjustment" in text for text in both["warnings"])
    # two measurements of every place: the noise does not cancel
    noise = [c["sigma"]["parts_m3"]["matching"] for c in (one, both)]
    assert noise[1] == pytest.approx(np.sqrt(2.0) * noise[0], rel=0.01)


@pytest.mark.parametrize("stated", [True, False])
def test_a_surface_over_itself_has_no_volume_and_no_sigma(place, tmp_path, stated):
    what = given(place, str(place / "dtm.tif"), base_adjustment=place / "result" if stated else None)
    content = run(place, tmp_path / "out", what)
    assert content["net_m3"] == 0.0
    assert content["sigma"]["sigma_m3"] == pytest.approx(0.0, abs=1e-9)
    for one in content["sigma"]["systematic"]["variants"]:
        assert one["value_m3"] == pytest.approx(0.0, abs=1e-9)


def test_the_adjustment_of_a_base_is_told_by_the_file_beside_it(place, tmp_path):
    """As `aerotri dtm` writes it: the same, another, none."""
    from aerotri.commands.console import Console
    from aerotri.commands.results import reopened
    from aerotri.volume.shared import adjustment_key

    key = adjustment_key(reopened(place / "result", Console(quiet=True)))
    wanted = run(place, tmp_path / "stated", given(place, str(place / "before.tif"), base_adjustment=place / "result"))
    free = run(place, tmp_path / "free", given(place, str(place / "before.tif")))
    for name, text, like, says in (
        ("same", json.dumps({"adjustment": key}), wanted, "with the same adjustment"),
        ("other", json.dumps({"adjustment": "0"}), free, "with another adjustment"),
        ("damaged", "[", free, "counts as free of error"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "before.tif").write_bytes((place / "before.tif").read_bytes())
        (tmp_path / name / "dtm.json").write_text(text)
        content = run(place, tmp_path / name / "out", given(place, str(tmp_path / name / "before.tif")))
        assert content["sigma"]["parts_m3"] == pytest.approx(like["sigma"]["parts_m3"], rel=1e-9), name
        assert any(says in note for note in content["warnings"]), name


def test_without_an_adjustment_there_is_no_sigma(place, tmp_path):
    content = run(place, tmp_path / "out", given(place, "boundary", adjustment=None))
    assert content["sigma"] is None
    # the spline follows the foot of the hill
    assert content["net_m3"] == pytest.approx(TRUE_VOLUME, rel=0.02)


def test_pickets_of_a_file(place, tmp_path):
    """As `aerotri dtm` writes them; their own σ of height replaces that of the block."""
    import pyarrow as pa
    from pyarrow import parquet

    from aerotri.commands.console import Console
    from aerotri.commands.results import reopened
    from aerotri.volume.pickets import pickets_where_seen

    calibration = reopened(place / "result", Console(quiet=True))
    with RasterReader(place / "dtm.tif") as reader:
        grid = reader.grid
        z = reader.read(0, 0, COUNT, COUNT)
    row, column = np.meshgrid(np.arange(2, COUNT, 3), np.arange(2, COUNT, 3), indexing="ij")
    xyz = np.column_stack([grid.x(column.ravel()), grid.y(row.ravel()), z[row.ravel(), column.ravel()]])
    pickets, seen = pickets_where_seen(calibration, xyz, 0.003)
    assert seen.all()
    names = calibration.result.block.images.names[pickets.image].reshape(-1, 2).astype(str).tolist()

    def written(sigma):
        table = pa.table({"X": xyz[:, 0], "Y": xyz[:, 1], "Z": xyz[:, 2], "photographs": names,
                          "sZ_matching": np.full(len(xyz), sigma), "status": ["accepted"] * len(xyz)})  # fmt: skip
        parquet.write_table(table, tmp_path / f"{sigma}.parquet")
        content = run(place, tmp_path / f"out{sigma}", given(place, pickets=tmp_path / f"{sigma}.parquet"))
        return content["sigma"]["parts_m3"]

    fine, coarse = written(0.05), written(0.10)
    assert coarse["matching"] == pytest.approx(2.0 * fine["matching"], rel=1e-9)
    assert coarse["adjustment"] == pytest.approx(fine["adjustment"], rel=1e-9)
    # pickets of equal weight and σ: σ·area/√n, about
    area = np.pi * 130.0**2
    assert fine["matching"] == pytest.approx(0.05 * area / np.sqrt(area / 144.0), rel=0.1)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"boundary": "POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))"}, "not valid"),
        ({"boundary": "POLYGON ((1e7 0, 1.1e7 0, 1.1e7 1e6, 1e7 0))"}, "does not meet|no height|no raster"),
        ({"method": "guess"}, "no method 'guess'"),
        ({"adjustment": None, "base_adjustment": "x"}, "belong to --adjustment"),
    ],
)
def test_bad_input_is_one_line(place, tmp_path, changes, says):
    with pytest.raises(InputError, match=says):
        run_volume(given(place, **changes), SectionPlan(), SigmaOptions(), tmp_path / "out", False, True)
    assert not (tmp_path / "out").exists()


def test_from_the_shell(place, tmp_path):
    command = [sys.executable, "-m", "aerotri.cli", "volume", str(place / "dtm.tif"), "--base", "level:x"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert done.stderr.strip().count("\n") == 0
    assert "--base 'level:x' is not understood" in done.stderr
