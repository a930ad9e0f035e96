"""run and tiepoints: files called otherwise, lists in other rows, another frame and other units; the same result.

Features are found in every photograph by itself, and random samples are drawn with a stated seed in an order of what
the photographs show. So the tie points are the same, ray by ray and to the last digit, whatever files are called; and
what is adjusted from them is the same to 2e-7 σ by least squares. Strips are read off the order of the files' names and
are compared where that order stays, or is turned round.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from transformations import Similarity, about_z, by_names, largest_difference, numbers_of

import aerotri
from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.commands.tiepoints import TiePointOptions, run_tiepoints
from aerotri.coordinates import local_frame
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.assembly.placing import to_crs
from aerotri.formats.block.folder import read_block
from aerotri.formats.results.pickets import read_pickets
from aerotri.pipeline import adjust
from aerotri.rasters.grids import RasterReader
from rendered_photographs import Lists, copy_photographs, fly, write_gcp_list, write_positions
from small_blocks import with_adjustment

ALL = 2e-7
"""σ, by which results may differ: windows fit to some 0.005 px, so that σ0, and all that it scales, has two digits
fewer than coordinates have (2e-8 seen)."""
ROBUST = 1e-7
"""σ, of a robust adjustment: it ends where a step changes nothing by more than 0.01 σ, and of that step the seventh
digit hangs on the processor (6e-9 σ seen)."""
TURNED = 1e-5
"""σ, of a robust adjustment in a frame with other axes: damped steps are damped by axis, so that it goes another way,
and it ends where a step changes nothing by more than 0.01 σ."""
PICKETS = 1e-4
"""σ, of heights by matching, whose steps end at .005 of the spacing of the posts of a window (3e-6 seen)."""
ROUNDED = 5e-6
"""σ, where coordinates of 5e6 m, or degrees, are rounded to some 1e-9 m in files: 1e-7 of the σ of control, and ten
times that in normalised residuals of control that little else holds."""
RASTER = 1e-5
"""σ, of rasters: a cell has 32 bit."""
HEIGHT = 2.0**-17
"""m, from one number of 32 bit to the next between 64 and 128 m; the heights here are no greater."""
CACHE = "tie_point_cache"
FEATURES, SIGMA = 800, (0.02, 0.02, 0.03)
SHIFT = np.array([512.0, -256.0, 64.0])
NAMED = Lists({})


def renamed(flown):
    """Files in two folders, shuffled, with blanks and in Unicode; points called otherwise, sorted the other way."""
    names = {f: f"{'Ä b' if k % 2 else 'c'}/Foto {7 * k % 11} 東.tif" for k, f in enumerate(flown.files())}
    return names | {p: f"Punkt {500 - 7 * k}" for k, p in enumerate(flown.control_points())}


def turned_round(flown):
    """Files in the opposite order."""
    names = {f: f"IMG_{90 - k}.tif" for k, f in enumerate(flown.files())}
    return names | {p: f"{500 - 7 * k}" for k, p in enumerate(flown.control_points())}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("flown") / "photographs")


def tied(flown, here, lists, kept=None, columns="X,Y,Z", **stated):
    """The block folder made of photographs and lists; `kept`: a folder whose features and matches are there already."""
    here.mkdir(exist_ok=True)
    photographs = flown.photographs if not lists.names else copy_photographs(flown, here / "photographs", lists)
    out = here / "block"
    if kept is not None:
        shutil.copytree(kept / CACHE, out / CACHE)
    check = [lists.name(name) for name in flown.check_points()]
    options = TiePointOptions(
        gcp=str(write_gcp_list(flown, here / "gcp_list.txt", lists)),
        check=tuple(check if lists.seed is None else check[::-1]),
        positions=str(write_positions(flown, here / "positions.csv", lists, columns)),
        camera=CameraSpec(focal_length_mm=6.0, pixel_um=14.4),
        stated=Statements(control_sigma_m=tuple(lists.scale * s for s in SIGMA), **stated),
        features=FEATURES,
    )  # fmt: skip
    run_tiepoints(photographs, out, options, True)
    return out


@pytest.fixture(scope="module")
def before(flown, tmp_path_factory):
    """The block folder as everything is given first, and its adjustment."""
    out = tied(flown, tmp_path_factory.mktemp("before"), NAMED)
    return out, adjust(read_block(out))


def tie_points(block, names):
    """Every tie point as the set of its rays, with all digits, photographs by their old names."""
    old = {new: name for name, new in names.items()}
    rays, found = block.image_points, {}
    control = set(block.control.point.tolist())
    for image, point, xy in zip(rays.image.tolist(), rays.point.tolist(), rays.xy.tolist(), strict=True):
        if point not in control:
            name = str(block.images.names[image])
            found.setdefault(str(block.points[point]), set()).add((old.get(name, name), *xy))
    return {name: frozenset(own) for name, own in found.items()}


def assert_same(one, other, lists, frame, limit):
    """The same tie points under the same names, and results that differ by no more than so many σ."""
    assert tie_points(other.block, lists.names) == tie_points(one.block, {})
    changed = by_names(one.block, other.block, lists.names, frame)
    first, second = numbers_of(one, by_names(one.block, one.block)), numbers_of(other, changed)
    found = largest_difference(first, second)
    assert not {name: value for name, value in found.items() if not value <= limit}
    for name in ("status", "iterations", "redundancy", "statuses", "groups"):
        assert first.words[name] == second.words[name]
    np.testing.assert_allclose(
        other.block.image_points.sigma[changed.ray], one.block.image_points.sigma, rtol=max(limit, 1e-8)
    )
    for a, b in zip(one.block.cameras, other.block.cameras, strict=True):
        assert b.focal_length_mm == pytest.approx(a.focal_length_mm, rel=1e-9)


CASES = {
    "rows": (lambda flown: Lists({}, seed=1), Similarity.none()),
    "names": (lambda flown: Lists(renamed(flown), seed=2), Similarity.none()),
    "names turned round": (lambda flown: Lists(turned_round(flown), seed=3), Similarity.none()),
    "shift and unit": (lambda flown: Lists({}, seed=4, scale=10.0), Similarity(np.eye(3), SHIFT, 10.0)),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_tiepoints(flown, before, tmp_path, case):
    """Features of files of the same name are kept; of others they are found again."""
    make, frame = CASES[case]
    lists = replace(make(flown), frame=frame.points)
    out = tied(flown, tmp_path, lists, None if lists.names else before[0])
    block = read_block(out)
    one, other = (adjust(with_adjustment(given, robust="off")) for given in (read_block(before[0]), block))
    assert_same(one, other, lists, frame, ALL)
    assert_same(before[1], adjust(block), lists, frame, ROBUST)
    told, again = (json.loads((folder / "tiepoints.json").read_text()) for folder in (before[0], out))
    for key in ("photographs", "pairs", "tie_points", "rays", "points_per_photograph", "control", "check", "left_out"):
        assert again[key] == told[key], key
    assert again["median_residual_px"] == pytest.approx(told["median_residual_px"], rel=1e-9)
    if case != "names":
        strips = [strips_of(read_block(folder)) for folder in (before[0], out)]
        old = {new: name for name, new in lists.names.items()}
        assert {frozenset(old.get(n, n) for n in own) for own in strips[1]} == strips[0]


def test_tiepoints_in_a_turned_frame(flown, before, tmp_path):
    """Adjusted by least squares the same to 2e-7 σ; robustly to what the end of that leaves open."""
    frame = Similarity(about_z(37.0), SHIFT, 10.0)
    lists = Lists({}, seed=6, scale=10.0, frame=frame.points)
    block = read_block(tied(flown, tmp_path, lists, before[0]))
    one, other = (adjust(with_adjustment(given, robust="off")) for given in (read_block(before[0]), block))
    assert_same(one, other, lists, frame, ALL)
    assert_same(before[1], adjust(block), lists, frame, TURNED)


def strips_of(block):
    """The photographs of every strip."""
    strip, names = block.images.strip, block.images.names
    assert (strip != "").all()
    return {frozenset(names[strip == one].tolist()) for one in set(strip.tolist())}


def test_coordinates_of_another_system(flown, before, tmp_path):
    """Control and positions in metres of UTM, and in degrees: one block, in UTM."""
    local = local_frame("EPSG:32632", np.array([[500000.0, 5.3e6, 0.0]]))
    in_utm = Lists({}, crs="EPSG:32632", frame=local.from_local)
    degrees = replace(in_utm, crs="EPSG:4326", frame=lambda xyz: to_crs(local.from_local(xyz), "EPSG:32632",
                                                                        "EPSG:4326", None))  # fmt: skip
    found = []
    for lists, columns in ((in_utm, "X,Y,Z"), (degrees, "lon,lat,Z")):
        out = tied(flown, tmp_path / columns[:1], lists, before[0], columns, crs="EPSG:32632")
        found.append(adjust(read_block(out)))
    assert [result.block.crs for result in found] == ["EPSG:32632"] * 2
    assert_same(*found, in_utm, Similarity.none(), ROUNDED)


@pytest.fixture(scope="module")
def runs(flown, tmp_path_factory):
    """The whole chain, once with everything as it is and once with all of it changed; the frame is shifted."""
    found, middle = {}, np.round(np.median(flown.block.control.xyz[:, :2], axis=0))
    for name, lists, shift in (
        ("old", NAMED, np.zeros(3)),
        ("new", Lists(renamed(flown), frame=lambda xyz: xyz + SHIFT, seed=5), SHIFT),
    ):
        here = tmp_path_factory.mktemp(name)
        corners = middle + shift[:2] + np.array([[-15, -12], [14, -10], [12, 15], [-13, 11]])
        order = range(4) if name == "old" else (2, 1, 0, 3)
        ring = ", ".join("{} {}".format(*corners[k].tolist()) for k in (*order, order[0]))
        project = aerotri.run(
            copy_photographs(flown, here / "photographs", lists), here / "out",
            control=write_gcp_list(flown, here / "gcp_list.txt", lists), control_sigma_m=(0.02, 0.02, 0.03),
            check=[lists.name(check) for check in flown.check_points()],
            positions=write_positions(flown, here / "positions.csv", lists), focal_length_mm=6.0, pixel_um=14.4,
            interval=4.0, boundary=f"POLYGON (({ring}))", base="lowest", plots=False,
            further={"tie_points": {"features": FEATURES}, "terrain": {"plots": False}, "volume": {"plots": False}},
        )  # fmt: skip
        assert project.complete
        found[name] = (here / "out", lists)
    return found


def adjusted(folder):
    return reopened(folder / "result", Console(quiet=True)).result


def test_run_adjusts_the_same(runs):
    (one, _), (other, lists) = runs.values()
    assert_same(adjusted(one), adjusted(other), lists, Similarity(np.eye(3), SHIFT), ROBUST)
    verdicts = [json.loads((folder / "result" / "adjustment.json").read_text())["verdict"] for folder in (one, other)]
    assert verdicts[0] == verdicts[1] != "rejected"


def test_run_measures_the_same_terrain(runs):
    """The same nodes accepted, in the same photographs, at the same heights; the surface to what a cell holds."""
    (one, _), (other, lists) = runs.values()
    old = {new: name for name, new in lists.names.items()}
    tables = []
    for folder, names in ((one, {}), (other, old)):
        table = read_pickets(folder / "dtm" / "pickets.parquet")
        order = np.lexsort(table.node.T)
        own = [" ".join(sorted(names.get(p, p) for p in photographs)) for photographs in table.photographs]
        tables.append((table, order, np.array(own)))
    (a, i, seen), (b, j, again) = tables
    np.testing.assert_array_equal(a.node[i] - a.node[i].min(axis=0), b.node[j] - b.node[j].min(axis=0))
    np.testing.assert_array_equal(a.status[i], b.status[j])
    np.testing.assert_array_equal(seen[i], again[j])
    good = a.status[i] == "accepted"
    assert good.sum() > 100
    sigma = a.sigma[i][good]
    assert np.abs((b.xyz[j][good] - SHIFT - a.xyz[i][good]) / sigma).max() < PICKETS
    surfaces = []
    for folder in (one, other):
        with RasterReader(folder / "dtm" / "dsm.tif") as reader:
            surfaces.append(reader.read(0, 0, reader.grid.rows, reader.grid.columns).astype(float))
    difference = np.abs(surfaces[1] - SHIFT[2] - surfaces[0])
    assert np.array_equal(np.isfinite(surfaces[0]), np.isfinite(surfaces[1]))
    assert np.nanmax(difference) < 10.0 * RASTER * np.median(sigma[:, 2])


def test_run_computes_the_same_volume(runs):
    """A surface has 32 bit; where it and its base are rounded, both by HEIGHT at most, the volume changes with them."""
    one, other = (json.loads((folder / "volume" / "volume.json").read_text()) for folder, _ in runs.values())
    sigma = one["sigma"]["sigma_m3"]
    area = one["cut_area_m2"] + one["fill_area_m2"]
    assert abs(one["net_m3"] - other["net_m3"]) < 2.0 * HEIGHT * area
    for part, value in one["sigma"]["parts_m3"].items():
        assert abs(value - other["sigma"]["parts_m3"][part]) < RASTER * sigma, part
