"""result.gpkg through the libraries that others read it with: GDAL by pyogrio, and QGIS where it is installed."""

from __future__ import annotations

import os
import sqlite3
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import aerotri
from gis_blocks import in_crs
from places import PROJECT
from small_blocks import small_block

PYTHON_OF_QGIS = "/usr/bin/python3"


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """An adjustment, and the folder that holds its result.gpkg."""
    block, _ = small_block(5, "bluh:1-12")
    folder = tmp_path_factory.mktemp("gis")
    result = aerotri.adjust(replace(in_crs(block)), explain=False)
    result.save(folder / "result", plots=False)
    aerotri.export(folder / "result", folder / "out", "gpkg")
    return result, folder / "out" / "result.gpkg"


def test_gdal_reads_every_layer(exported):
    pyogrio = pytest.importorskip("pyogrio")
    result, path = exported
    adjusted = result.adjusted
    kinds = dict(pyogrio.list_layers(path).tolist())
    points = int(np.isfinite(adjusted.points.xyz).all(axis=1).sum())
    images = len(result.block.images)
    expected = {
        "footprints": (images, "MultiPolygon"), "projection_centres": (images, "Point Z"),
        "points": (points, "Point Z"),
    }  # fmt: skip
    for name, (count, kind) in expected.items():
        told = pyogrio.read_info(path, layer=name)
        assert (told["features"], kinds[name]) == (count, kind)
        assert told["crs"]
        assert "25832" in told["crs"] or "32632" in told["crs"] or "UTM" in told["crs"]
    _, _, geometry, columns = pyogrio.raw.read(path, layer="points", columns=["point", "sZ"])
    assert len(geometry) == points
    sigma = dict(zip(columns[0].tolist(), columns[1].tolist(), strict=True))
    for k in (0, len(adjusted.points.xyz) // 2):
        name = str(result.block.points[k])
        assert sigma[name] == pytest.approx(adjusted.points.sigma[k, 2], rel=1e-6)
    # every layer can be read as a whole, also those without a geometry
    for name in kinds:
        assert pyogrio.raw.read(path, layer=name, read_geometry=kinds[name] is not None)[0]["fields"].size > 0


def test_every_layer_has_a_style(exported):
    _, path = exported
    with sqlite3.connect(path) as base:
        layers = {name for (name,) in base.execute(
            "SELECT table_name FROM gpkg_contents WHERE data_type = 'features'")}  # fmt: skip
        styled = {name for (name,) in base.execute(
            "SELECT f_table_name FROM layer_styles WHERE useAsDefault = 1 AND styleQML LIKE '%<qgis%'")}  # fmt: skip
    assert layers <= styled


def has_qgis() -> bool:
    try:
        done = subprocess.run([PYTHON_OF_QGIS, "-c", "import qgis.core"], capture_output=True, timeout=120, env={})
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def test_qgis_draws_every_layer(exported, tmp_path):
    """The library of QGIS takes the styles of the file; the map is no empty sheet."""
    if not has_qgis():
        pytest.skip(f"QGIS is not installed for {PYTHON_OF_QGIS}")
    _, path = exported
    picture = tmp_path / "map.png"
    env = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "PYTHONPATH": ""}
    done = subprocess.run(
        [PYTHON_OF_QGIS, str(PROJECT / "tools" / "qgis_map.py"), str(path), str(picture), "--width", "700"],
        capture_output=True, text=True, timeout=300, env=env,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    told = {line.partition(":")[0] for line in done.stdout.splitlines() if " features, " in line}
    assert {"footprints", "points", "error_ellipses", "check_vectors"} <= told
    pixels = np.asarray(Image.open(picture).convert("L"))
    assert 0.01 < (pixels < 128).mean() < 0.5
