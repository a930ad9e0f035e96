"""Every command run once on small blocks: the files it writes and what it prints, for all tests of the reference."""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from aerotri.cli.app import invoke
from aerotri.formats.block.folder import write_block
from aerotri.rasters.grids import RasterReader
from gis_blocks import in_crs, plain_block
from rendered_photographs import Lists, fly, write_gcp_list, write_positions
from small_blocks import LONG_FLIGHT, small_block, with_adjustment
from ten_photographs import ten_photographs

ROLLING = """
name = "rolling"
[camera.cam]
size_px = [4000, 3000]
pixel_um = 2.4
focal_length_mm = 8.8
[camera.cam.rolling_shutter]
readout_ms = 30.0
[flight]
gsd_m = 0.02
strips = 2
images_per_strip = 5
end_lap = 0.8
side_lap = 0.6
speed_m_s = 8.0
[tie_points]
per_image = 40
sigma_um = 0.8
[control]
distance_bases = 3
sigma_m = [0.01, 0.01, 0.015]
[gnss]
sigma_m = [0.02, 0.02, 0.03]
"""
RIGGED = """
name = "rigged"
[camera.nadir]
size_px = [6000, 4000]
pixel_um = 4.0
focal_length_mm = 25.0
[camera.side]
size_px = [6000, 4000]
pixel_um = 4.0
focal_length_mm = 35.0
[flight]
gsd_m = 0.1
strips = 2
images_per_strip = 4
end_lap = 0.7
side_lap = 0.5
attitude_sigma_deg = [1.0, 1.0, 2.0]
[tie_points]
per_image = 40
probability = 0.9
sigma_um = 2.0
[control]
distance_bases = 3.0
[start_values]
kind = "perturbed"
[rig.frame]
reference = "nadir"
[rig.frame.camera.side]
position_m = [0.05, 0.0, 0.02]
rotation_deg = [0.0, 30.0, 90.0]
position_sigma_m = [0.005, 0.005, 0.005]
"""
TINY = """
name = "tiny"
[camera.cam]
preset = "ultracam_d"
size_px = [575, 375]
pixel_um = 180.0
[flight]
gsd_m = 1.0
strips = 1
images_per_strip = 3
end_lap = 0.6
heading_deg = 30.0
[terrain]
kind = "undulating"
height_m = 100.0
relief_rms_m = 10.0
wavelength_m = 400.0
[tie_points]
per_image = 60
probability = 0.9
sigma_um = 9.0
[control]
distance_bases = 1.0
sigma_m = [0.05, 0.05, 0.05]
[adjustment]
additional_parameters = ["bluh:1-2"]
"""
"""Three photographs in a strip, small enough to be rendered in a second."""
WITH_START = """
[start_values]
kind = "perturbed"
position_sigma_m = 1.0
angle_sigma_deg = 0.01
"""
"""Parts need orientations to begin with."""


@dataclass(frozen=True)
class Written:
    """Folders of all commands by the place the reference names, and what was printed by command."""

    folder: Path
    places: dict[str, tuple[Path, ...]]
    printed: dict[str, tuple[object, ...]]


class _Runs:
    """Runs command lines and keeps what they print."""

    def __init__(self, folder: Path):
        self.folder, self.printed = folder, {}

    def __call__(self, name: str, *arguments: object, out: str = "") -> Path:
        target = self.folder / out
        words = [*name.split(), *map(str, arguments), *(("--out", str(target)) if out else ()), "--json"]
        stream = io.StringIO()
        with contextlib.redirect_stdout(stream):
            assert invoke(words) == 0, words
        printed = json.loads(stream.getvalue())
        self.printed[name] = (*self.printed.get(name, ()), printed)
        return target


@pytest.fixture(scope="session")
def written(tmp_path_factory) -> Written:
    """What every command writes; some 30 s, most of them for tie points and image matching of real size."""
    return _written(tmp_path_factory.mktemp("written"))


def _adjustments(run: _Runs) -> tuple[Path, Path]:
    """A block with GNSS, INS, groups of photographs and σ estimated; the same without parameters."""
    block = ten_photographs()
    settings = replace(block.settings, gnss=replace(block.settings.gnss, shift="block"))
    grouped = with_adjustment(
        replace(block, settings=settings), additional_parameters=(("brown", ("K1",)),), parameter_groups="strip",
        variance_components="on",
    )  # fmt: skip
    write_block(grouped, run.folder / "grouped")
    write_block(block, run.folder / "plain")
    first = run("adjust", run.folder / "grouped", "--check-free", out="first")
    return first, run("adjust", run.folder / "plain", "--no-plots", "--parameters", "bluh:1-2", out="second")


def _written(folder: Path) -> Written:
    run = _Runs(folder)
    first, second = _adjustments(run)
    run("diff", first, second)
    (folder / "tiny.toml").write_text(TINY)
    tiny = run("simulate", folder / "tiny.toml", "--render", "--seed", "3", out="tiny")
    result = run("adjust", tiny, "--no-plots", out="result")
    (folder / "tiny_parts.toml").write_text(TINY + WITH_START)
    run("simulate", folder / "tiny_parts.toml", "--parts", 2, out="tiny_parts")
    (folder / "rigged.toml").write_text(RIGGED)
    rigged = run("simulate", folder / "rigged.toml", "--seed", "3", out="rigged")
    of_rig = run("adjust", rigged, "--no-plots", out="rig_result")
    (folder / "rolling.toml").write_text(ROLLING)
    rolling = run("simulate", folder / "rolling.toml", "--seed", "3", out="rolling")
    of_shutter = run("adjust", rolling, "--no-plots", out="rolling_result")
    toml = (rigged / "block.toml").read_text().replace('constraint = "rigid"', 'constraint = "weighted"')
    (rigged / "block.toml").write_text(toml)
    of_weighted = run("adjust", rigged, "--no-plots", out="weighted_result")
    photographs = tiny / "photographs"
    pairs = run("dtm", result, photographs, "--interval", "20", "--pairs", out="dtm")
    dense = run("dsm", result, photographs, out="dsm")
    run("demcor", result, pairs / "dsm.tif", "--models", pairs / "model.tif", out="corrected/NAME.tif")
    ortho = run("ortho", result, photographs, pairs, out="ortho")
    model = run("deform", result, "--end-lap", "0.6", out="model")
    whole = run("deform", result, out="whole")
    imgeo = run("imgeo", result, next(photographs.glob("*.tif")), out="ideal")
    compared = run("compare", pairs / "dtm.tif", pairs / "dsm.tif", "--align", "shift", out="compared")
    stable = "POLYGON ((-1e6 -1e6, 1e6 -1e6, 1e6 1e6, -1e6 1e6, -1e6 -1e6))"
    clouds = run("change", dense / "dsm.laz", dense / "dsm.laz", "--registration", 0.01, out="clouds")
    changed = run("change", dense, dense, "--stable", stable, "--align", "height", out="changed")
    piles = run("volume", dense, "--boundary", _two_polygons(folder, dense / "dsm.tif"), "--density", 1.8, out="piles")
    halves = run("halves", second, "--division", "photographs", "--division", "strips", out="halves")
    write_block(in_crs(plain_block()), folder / "placed")
    placed = run("adjust", folder / "placed", "--no-plots", out="placed_result")
    for to in ("gpkg", "geoparquet", "stac"):
        exported = run("export", placed, "--to", to, "--flown", "2026-05-17", out="exported")
    for source, words in ((placed, ()), (placed, ("--document", "calibration")), (piles, ()), (changed, ())):
        run("export", source, "--to", "pdf", *words, out="exported")
    stated = run("accuracy", second, "--class-horizontal", 10, out="accuracy")
    sets = run("compare-parameters", folder / "plain", "--set", "none", "--set", "brown:K1", "--folds", "2", out="sets")
    # the independent model knows no attitudes
    write_block(ten_photographs(navigated=False), folder / "unnavigated")
    unnavigated = run(
        "adjust", folder / "unnavigated", "--no-plots", "--parameters", "bluh:1-2", out="unnavigated_result"
    )
    checked = run("crosscheck", unnavigated, out="checked")
    write_block(small_block(1, "brown:K1", flight=LONG_FLIGHT)[0], folder / "long")
    run("adjust", run("divide", folder / "long", "--parts", 2, out="in_parts"), out="parts_result")
    run("init", folder / "begun")
    run("check", folder / "plain")
    run("explain", "points.csv", "sZ")
    run("parameters", "--family", "brown", out="drawn")
    run("convert", tiny, "--to", "bal", out="tiny_bal.txt")
    run("predict volume", "--height", 1500, "--length", 9000, "--width", 3600, "--bridging", 3600)
    run("predict attitude", "--tolerance", 1, "--thickness", 5)
    run("predict picket-interval", "--gsd", 0.1)
    run("predict picket-interval", "--pilot", result, "--photographs", photographs)
    where = "SRID=25832;POLYGON ((500000 5800000, 500080 5800000, 500080 5800060, 500000 5800000))"
    planned = run(
        "plan", where, "--camera", "p1", "--gsd", 0.02, "--ground", 100, "--target", "asprs 9cm", out="planned"
    )
    project = _project(run)
    places = {
        "block folder": (tiny, folder / "plain", project / "block"), "block of convert": (project / "block",),
        "result of adjust": (first, second, result, of_rig, of_weighted, of_shutter),
        "folder of compare-parameters": (sets,), "folder of halves": (halves,),
        "folder of accuracy": (stated,), "folder of deform": (model, whole),
        "folder of demcor": (folder / "corrected",), "folder of imgeo": (imgeo,), "folder of crosscheck": (checked,),
        "folder of dtm": (pairs, project / "dtm"), "folder of dsm": (dense,), "folder of compare": (compared,),
        "folder of change": (changed, clouds), "folder of export": (exported,),
        "folder of plan": (planned,), "folder of volume": (project / "volume", piles), "folder of ortho": (ortho,),
        "truth of simulate": (tiny / "truth", rigged / "truth", rolling / "truth"),
        "photographs of simulate": (photographs,), "block of tiepoints": (project / "block",),
        "control_marks of tiepoints": (project / "block" / "control_marks",), "folder of run": (project,),
        "folder of parameters": (folder / "drawn",), "folder of divide": (folder / "in_parts", folder / "tiny_parts"),
    }  # fmt: skip
    return Written(folder, places, run.printed)


def _two_polygons(folder: Path, surface: Path) -> Path:
    """Two halves of the middle of a surface."""
    with RasterReader(surface) as reader:
        left, bottom, right, top = reader.grid.bounds
    x, y, half = (left + right) / 2.0, (bottom + top) / 2.0, 0.15 * min(right - left, top - bottom)
    rings = [[(a, y - half), (b, y - half), (b, y + half), (a, y + half), (a, y - half)]
             for a, b in ((x - half, x), (x, x + half))]  # fmt: skip
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}} for ring in rings
    ]
    path = folder / "two.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def _project(run: _Runs) -> Path:
    """Everything from six photographs to a volume."""
    flown = fly(run.folder / "flown")
    x, y = flown.positions[:, :2].mean(axis=0)
    pile = run.folder / "pile.wkt"
    pile.write_text(f"POLYGON (({x - 8} {y - 8}, {x + 8} {y - 8}, {x + 8} {y + 8}, {x - 8} {y + 8}, {x - 8} {y - 8}))")
    gcp = write_gcp_list(flown, run.folder / "gcp_list.txt", Lists({}))
    positions = write_positions(flown, run.folder / "positions.csv", Lists({}))
    return run(
        "run", flown.photographs, "--gcp", gcp, "--positions", positions, "--control-sigma-m", 0.02,
        "--focal-length-mm", 6, "--pixel-um", 14.4, "--boundary", pile, "--parameters", "brown:K1",
        out="project",
    )  # fmt: skip
