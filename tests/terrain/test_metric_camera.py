"""Real photographs with a surface others measured, from files to the comparison, by the commands alone."""

from __future__ import annotations

import json
import shutil

import pytest
from typer.testing import CliRunner

from aerotri.cli import app

GSD = 5.83
INTERVAL = 24.0
"""m, that of the DEM."""
AREA = -57500.0, -3729400.0, -55300.0, -3725400.0
"""Where the photographs of one strip overlap."""


def run(*arguments) -> dict:
    done = CliRunner().invoke(app, [str(word) for word in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout) if "--json" in arguments else {}


@pytest.mark.slow
def test_metric_camera_against_its_dem(shared_data, tmp_path):
    """data/dmc_ngi, mountains, base over height .5: with the orientation it came with, against the DEM it came with.

    The DEM has cells of 24 m, four pixels. Most nodes have two photographs: half of them
    reach 0.90, four fifths 0.80.
    """
    data = shared_data("dmc_ngi")
    (tmp_path / "photographs").mkdir()
    for path in data.glob("*_RGB.tif"):
        shutil.copy2(path, tmp_path / "photographs")
    photographs, block, result = (tmp_path / name for name in ("photographs", "block", "result"))
    given = ("--orientation", data / "camera_pos_ori.txt", "--camera", data / "config.yaml")
    held = ("--orientation-sigma-m", 0.05, "--orientation-sigma-deg", 5e-4)
    run("tiepoints", photographs, "--out", block, *given, *held)
    run("adjust", block, "--out", result, "--no-plots")
    for threshold, share, nmad in ((0.9, 0.45, 0.40), (0.8, 0.70, 0.36)):
        out = tmp_path / f"dtm_{threshold}"
        options = ("--interval", INTERVAL, "--threshold", threshold, "--area", *AREA)
        pickets = run("dtm", result, photographs, "--out", out, *options, "--no-plots", "--json")["pickets"]
        assert pickets["accepted"] > share * pickets["seen"]
        compared = ("--out", tmp_path / f"compared_{threshold}", "--no-plots", "--json")
        found = run("compare", out / "dsm.tif", data / "dem.tif", *compared)["difference_m"]
        assert abs(found["median"]) < 0.2 * GSD
        assert found["nmad"] < nmad * GSD
        assert found["rmse"] < 2.0 * nmad * GSD
    # dense: cells of two pixels; the DEM's own errors are in the difference
    area = ("--area", *AREA, "--no-plots", "--json")
    dense = run("dsm", result, photographs, "--out", tmp_path / "dsm", *area)
    compared = ("--out", tmp_path / "compared", "--no-plots", "--json")
    found = run("compare", tmp_path / "dsm" / "dsm.tif", data / "dem.tif", *compared)["difference_m"]
    assert abs(found["median"]) < 0.2 * GSD
    assert found["nmad"] < 0.55 * GSD
    assert 0.8 < found["rmse"] / dense["sigma_Z_m"]["median"] < 1.5
