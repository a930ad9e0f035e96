"""Pipes, devices, loops of links, links to nothing and folders where a file is to be read: refused at once, by name."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerotri.cli import app
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block
from aerotri.formats.block.writer import write_block
from small_blocks import small_block

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes, devices and links as on POSIX systems")

KINDS = ("pipe", "device", "loop", "gone", "folder")
CAMERA = (
    "--camera-name", "drone", "--camera-size", "640x480", "--pixel-um", "7.5", "--focal-length-mm", "4.8",
    "--image-sigma-px", "0.1", "--flight-axis", "+y", "--crs", "EPSG:32632",
)  # fmt: skip
COMMANDS = {
    "volume of a surface": ("volume {} --base level:101 --out O --no-plots", ".tif"),
    "volume in GeoJSON": ("volume s.tif --boundary {} --base level:101 --out O --no-plots", ".geojson"),
    "volume in a GeoPackage": ("volume s.tif --boundary {} --base level:101 --out O --no-plots", ".gpkg"),
    "volume in a Shapefile": ("volume s.tif --boundary {} --base level:101 --out O --no-plots", ".shp"),
    "volume in WKT": ("volume s.tif --boundary {} --base level:101 --out O --no-plots", ".txt"),
    "compare": ("compare {} s.tif --out O --no-plots", ".laz"),
    "change": ("change {} s.tif --out O --no-plots", ".tif"),
    "rays": ("convert {} --out B", ".txt"),
    "XML": ("convert {} --out B", ".xml"),
    "control": ("convert rays.txt --out B --control {} --control-sigma-m 0.01", ".csv"),
    "positions": ("convert rays.txt --out B --positions {}", ".csv"),
    "orientation": ("convert rays.txt --out B --orientation {}", ".txt"),
    "block": ("adjust {} --no-plots --out R", ".toml"),
    "check": ("check {}", ".toml"),
    "area": ("plan {} --camera dmc --gsd 0.1 --ground 100 --out P", ".geojson"),
}


def no_file(kind: str, path: Path) -> Path:
    """Something that is not a file, under a name that has the ending of one."""
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to(path if kind == "loop" else path.with_name("nowhere") / path.name)
    return path


@pytest.fixture
def soon():
    """What reads a pipe that nobody writes to waits for ever."""

    def stop(number, frame):
        raise TimeoutError("still reading")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_no_file_is_refused_by_name(command, kind, tmp_path, monkeypatch, soon):
    line, ending = COMMANDS[command]
    path = no_file(kind, tmp_path / f"{kind}{ending}")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rays.txt").write_text(
        "1_001 drone\n1 0.5 0.5\n2 -0.5 0.5\n-99\n1_002 drone\n1 0.4 0.5\n2 0.3 0.1\n-99\n"
    )
    _write_surface(tmp_path / "s.tif")
    words = [word.format(path.name) for word in line.split()]
    words += list(CAMERA) if words[0] == "convert" else []
    with pytest.raises(InputError) as told:
        CliRunner().invoke(app, words, catch_exceptions=False)
    assert path.name in str(told.value)


def _write_surface(path: Path) -> None:
    import numpy as np
    import rasterio
    from rasterio.transform import from_origin

    with rasterio.open(
        path, "w", driver="GTiff", width=20, height=20, count=1, dtype="float32", crs="EPSG:25832",
        transform=from_origin(500000.0, 5300000.0, 1.0, 1.0), nodata=-9999.0,
    ) as file:  # fmt: skip
        file.write(np.full((20, 20), 100.0, np.float32), 1)


@pytest.mark.parametrize("kind", ["pipe", "device", "loop", "gone"])
@pytest.mark.parametrize("table", ["edits", "control", "gnss_ins", "constraints", "images"])
def test_tables_of_a_block_that_are_no_files_are_refused(table, kind, tmp_path, soon):
    """A link to a drive that is not there: the decisions of the bench, and control, are not left out in silence."""
    block, _ = small_block(seed=4)
    folder = tmp_path / "block"
    write_block(block, folder)
    path = folder / f"{table}.csv"
    path.unlink(missing_ok=True)
    no_file(kind, path)
    with pytest.raises(InputError, match=table):
        read_block(folder)
    shutil.rmtree(folder)
