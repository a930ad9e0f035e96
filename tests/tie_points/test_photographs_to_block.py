"""Rendered photographs and a list of control points, files alone: block, adjustment, check points."""

from __future__ import annotations

import csv
import inspect
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aerotri.commands.adjust import run_adjust
from aerotri.commands.console import Console
from aerotri.commands.tiepoints import TiePointOptions, run_tiepoints
from aerotri.conventions import InputError, px_from_mm
from aerotri.coordinates import local_frame
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.block.folder import read_block
from aerotri.formats.files.photograph_files import match_files
from aerotri.rasters.images import create_image
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.rendering import RenderOptions, make_scene, render

SPEC = {
    "name": "rendered",
    "camera": {"cam": {"size_px": [480, 360], "pixel_um": 12.0, "focal_length_mm": 6.0,
                       "errors": {"lens": {"k1": -0.04}, "interior": {"focal_length_mm": 0.05}}}},
    "flight": {"gsd_m": 0.2, "strips": 2, "images_per_strip": 3, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
               "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [2.0, 2.0, 2.0]},
    "terrain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 5.0, "wavelength_m": 120.0},
    "tie_points": {"per_image": 20, "probability": 0.9, "sigma_um": 1.2},
    "control": {"distance_bases": 1.0, "sigma_m": [0.02, 0.02, 0.03], "check_points": 15},
}  # fmt: skip
MARK_SIGMA_PX = 0.1


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Photographs and gcp_list.txt of a small block, and its check points."""
    folder = tmp_path_factory.mktemp("rendered")
    spec = parse_spec(SPEC)
    block, truth = simulate(spec, 3)
    scene, rays = make_scene(spec, 3, block, truth, RenderOptions()), block.image_points
    (folder / "photographs").mkdir()
    for number, name in enumerate(block.images.names.tolist()):
        image = render(scene, number)
        with create_image(folder / "photographs" / f"{name}.tif", 480, 360, 1, "uint16") as writer:
            writer.write(0, image[None])
    camera, control = block.cameras[0], dict(zip(block.control.point.tolist(), block.control.xyz, strict=True))
    lines = ["EPSG:32632"]
    frame = local_frame("EPSG:32632", np.array([[500000.0, 5.3e6, 0.0]]))
    for image, point, xy in zip(rays.image.tolist(), rays.point.tolist(), rays.xy, strict=True):
        if point in control:
            column, row = px_from_mm(xy[None], camera.size_px, camera.pixel_mm)[0] - 0.5
            place = " ".join(f"{value:.4f}" for value in frame.from_local(control[point][None])[0])
            lines.append(f"{place} {column:.3f} {row:.3f} {block.images.names[image]}.tif {block.points[point]}")
    (folder / "gcp_list.txt").write_text("\n".join(lines) + "\n")
    check = block.points[block.control.point[block.control.is_check]]
    return folder, tuple(name for name in check.tolist() if any(line.endswith(f" {name}") for line in lines))


def options(files, **changes) -> TiePointOptions:
    settings = {
        "gcp": str(files[0] / "gcp_list.txt"),
        "check": files[1],
        "camera": CameraSpec(focal_length_mm=6.0, pixel_um=12.0),
        "stated": Statements(control_sigma_m=(0.02, 0.02, 0.03)),
        "mark_sigma_px": MARK_SIGMA_PX,
        "points": 300,
        "features": 2000,
    }
    return TiePointOptions(**(settings | changes))


@pytest.fixture(scope="module")
def tied(files):
    out = files[0] / "block"
    run_tiepoints(files[0] / "photographs", out, options(files), True)
    return out


def test_check_points_within_their_standard_deviations(files, tied):
    """From files alone: normalised differences of check points have an RMS below 1.5."""
    assert run_adjust(tied, files[0] / "result", None, None, None, False, True) == 0
    with (files[0] / "result" / "check.csv").open() as file:
        w = np.array([[float(row[key]) for key in ("wX", "wY", "wZ")] for row in csv.DictReader(file)])
    assert len(w) >= 10
    assert np.sqrt((w**2).mean(axis=0)).max() < 1.5
    assert np.abs(w).max() < 4.0
    outcome = json.loads((files[0] / "result" / "adjustment.json").read_text())
    assert 0.7 < outcome["sigma0"] < 1.4
    (camera,) = outcome["cameras"]
    assert camera["focal_length_mm"] == pytest.approx(6.05, abs=4.0 * camera["s_focal_length_mm"])


def test_block_says_what_was_given(files, tied):
    block = read_block(tied)
    assert block.crs == "EPSG:32632"
    assert len(block.images) == 6
    assert sorted(block.points[block.control.point[block.control.is_check]]) == sorted(files[1])
    content = json.loads((tied / "tiepoints.json").read_text())
    assert content["left_out"] == []
    assert content["tie_points"] + len(block.control) == len(block.points)
    assert content["rays_per_point"] > 3.0
    assert content["median_residual_px"] < 0.3


def test_the_same_again_with_and_without_what_is_kept(files, tied, tmp_path):
    """The same block to the last bit, from nothing and from features and matches on disk."""
    first = {name: (tied / name).read_bytes() for name in ("images.csv", "image_points.csv", "control.csv")}
    fresh = tmp_path / "fresh"
    run_tiepoints(files[0] / "photographs", fresh, options(files), True)
    kept = fresh / "tie_point_cache" / "features" / "1_001.tif.npz"
    state = kept.stat().st_mtime_ns
    assert {name: (fresh / name).read_bytes() for name in first} == first
    run_tiepoints(files[0] / "photographs", fresh, options(files), True)
    assert {name: (fresh / name).read_bytes() for name in first} == first
    assert kept.stat().st_mtime_ns == state


def test_control_can_be_marked(files, tied):
    """Predicted and marked places agree to a pixel; the page brings every piece, and the list it begins with."""
    with (tied / "control_marks" / "predicted.csv").open() as file:
        rows = list(csv.DictReader(file))
    known = [row for row in rows if row["marked_column"]]
    off = [[float(row[a]) - float(row[f"marked_{a}"]) for a in ("column", "row")] for row in known]
    assert len(known) > 20
    assert np.abs(off).max() < 1.0
    page = (tied / "control_marks" / "marking.html").read_text()
    assert page.count("<figure>") == len(rows) == len(list((tied / "control_marks" / "pieces").iterdir()))
    assert re.search(r'const crs = "EPSG:32632"', page)
    assert "://" not in page


def with_changed_list(files, tied, tmp_path, change):
    """The photographs tied again with what was found, on a list whose rows (words) are changed."""
    lines = (files[0] / "gcp_list.txt").read_text().splitlines()
    rows = change([line.split() for line in lines[1:]])
    (tmp_path / "gcp_list.txt").write_text("\n".join([lines[0], *(" ".join(row) for row in rows)]) + "\n")
    shutil.copytree(tied / "tie_point_cache", tmp_path / "out" / "tie_point_cache")
    given = options(files, gcp=str(tmp_path / "gcp_list.txt"))
    code = run_tiepoints(files[0] / "photographs", tmp_path / "out", given, False)
    return code, json.loads((tmp_path / "out" / "tiepoints.json").read_text())


def control_of(rows, files):
    """Names of the control points that are no check points and have three marks, in their order."""
    names = [row[6] for row in rows]
    return [name for name in dict.fromkeys(names) if name not in files[1] and names.count(name) > 2]


def test_a_wrong_point_and_a_wrong_mark_are_named(files, tied, tmp_path, capsys):
    """One point typed 80 m off, one mark at another detail: the others place the block where it was."""
    wrong = {}

    def change(rows):
        names = control_of(rows, files)
        wrong["point"], wrong["mark"] = names[0], names[1]
        mark = next(row for row in rows if row[6] == names[1])
        mark[3], wrong["image"] = str(float(mark[3]) + 60.0), mark[5]
        return [[str(float(row[0]) + 80.0), *row[1:]] if row[6] == names[0] else row for row in rows]

    code, content = with_changed_list(files, tied, tmp_path, change)
    assert code == 0
    placement = content["placement"]
    points = {point["name"]: point for point in placement["points"]}
    assert placement["fits"]
    assert [name for name, point in points.items() if not point["used"]] == [wrong["point"]]
    assert abs(points[wrong["point"]]["offset_m"][0] + 80.0) < 2.0
    assert points[wrong["point"]]["misfit_sigma"] > 4.0
    said = " ".join(content["doubts"])
    assert f"not used to place the block: {wrong['point']} (8" in said
    assert f"control point {wrong['mark']}: its mark in {wrong['image'].removesuffix('.tif')}" in said
    assert set(content["doubts"]) <= set(content["messages"])
    told = capsys.readouterr().out
    assert re.search(rf"^{wrong['point']} .*σ  no: more than 4 σ$", told, re.MULTILINE)
    one, other = (read_block(folder).images.centre for folder in (tied, tmp_path / "out"))
    assert np.abs(one - other).max() < 1.0


def test_a_list_that_does_not_belong_has_no_place(files, tied, tmp_path, capsys):
    """Names exchanged all round: said first, exit code 1, and the block is there to be looked at."""

    def change(rows):
        names = [name for name in dict.fromkeys(row[6] for row in rows) if name not in files[1]]
        place = {name: next(row[:3] for row in rows if row[6] == name) for name in names}
        after = dict(zip(names, np.random.default_rng(1).permutation(names).tolist(), strict=True))
        return [[*place[after[row[6]]], *row[3:]] if row[6] in after else row for row in rows]

    code, content = with_changed_list(files, tied, tmp_path, change)
    assert code == 1
    assert not content["placement"]["fits"]
    assert content["placement"]["problem"] == content["doubts"][0]
    assert "no place that can be trusted" in capsys.readouterr().err
    assert len(read_block(tmp_path / "out").images) == 6


def test_points_without_marks_are_predicted_only(files, tied, tmp_path):
    """A list of coordinates: nothing holds the block but what else there is, and the pieces are there to mark in."""
    block = read_block(tied)
    rows = ["point,X,Y,Z,sX,sY,sZ", *(f"{block.points[p]},{x},{y},{z},0.1,0.1,0.1" for p, (x, y, z) in zip(
        block.control.point, block.control.xyz.tolist(), strict=True))]  # fmt: skip
    (tmp_path / "control.csv").write_text("\n".join(rows) + "\n")
    places = [f"{name},{x},{y},{z},1,1,1" for name, (x, y, z) in zip(
        block.images.names, block.images.centre.tolist(), strict=True)]  # fmt: skip
    (tmp_path / "positions.csv").write_text("\n".join(["image,X,Y,Z,sX,sY,sZ", *places]) + "\n")
    given = options(
        files, gcp=str(tmp_path / "control.csv"), check=(), positions=str(tmp_path / "positions.csv"),
        stated=Statements(crs="EPSG:32632"),
    )  # fmt: skip
    shutil.copytree(tied / "tie_point_cache", tmp_path / "out" / "tie_point_cache")
    run_tiepoints(files[0] / "photographs", tmp_path / "out", given, True)
    made = read_block(tmp_path / "out")
    assert len(made.control) == len(block.control)
    assert not np.isin(made.image_points.point, made.control.point).any()
    with (tmp_path / "out" / "control_marks" / "predicted.csv").open() as file:
        assert sum(1 for _ in file) > 20


def test_bad_input_is_named(files, tmp_path):
    """Before anything is computed."""
    with pytest.raises(InputError, match=r"1_001\.tif.*focal length.*--focal-length-mm"):
        run_tiepoints(files[0] / "photographs", tmp_path / "out", options(files, camera=CameraSpec()), True)
    with pytest.raises(InputError, match="--check K99"):
        run_tiepoints(files[0] / "photographs", tmp_path / "out2", options(files, check=("K99",)), True)
    with pytest.raises(InputError, match="--control-sigma-m"):
        run_tiepoints(files[0] / "photographs", tmp_path / "out2", options(files, stated=Statements()), True)
    assert not (tmp_path / "out2").exists()
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="0 photographs"):
        run_tiepoints(tmp_path / "empty", tmp_path / "out3", options(files), True)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        run_tiepoints(files[0] / "photographs", tmp_path / "full", options(files), True)


def test_photographs_that_say_nothing(files, tmp_path):
    """Without features, and damaged: told with the remedy, or the name of the file."""
    for name in ("black", "cut"):
        (tmp_path / name).mkdir()
    for number in range(2):
        Image.new("L", (300, 200), 7).save(tmp_path / "black" / f"{number}.jpg")
        noise = np.random.default_rng(number).integers(0, 255, (200, 300), np.uint8)
        Image.fromarray(noise).save(tmp_path / "cut" / f"{number}.jpg")
    whole = (tmp_path / "cut" / "1.jpg").read_bytes()
    (tmp_path / "cut" / "1.jpg").write_bytes(whole[: len(whole) // 2])
    alone = options(files, gcp="", check=())
    with pytest.raises(InputError, match="no two photographs have matches"):
        run_tiepoints(tmp_path / "black", tmp_path / "out", alone, True)
    with pytest.raises(InputError, match=r"1\.jpg: cannot be read"):
        run_tiepoints(tmp_path / "cut", tmp_path / "out2", alone, True)


def test_subfolders_blanks_and_a_list_without_crs(files, tmp_path):
    """Photographs in two folders, two of them of one name; marks of names with blanks; dtm and imgeo find them."""
    from aerotri.commands.imgeo import ImgeoOptions, run_imgeo
    from aerotri.commands.results import reopened
    from aerotri.formats.files.photograph_files import files_of
    from aerotri.public.terrain import terrain_plan
    from aerotri.terrain.settings import TerrainSettings

    folder, photographs = tmp_path / "flight", sorted((files[0] / "photographs").iterdir())
    called = {}
    for number, path in enumerate(photographs):
        name = f"day {number // 3 + 1}/photo {number % 3}.tif"
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, folder / name)
        called[path.name] = name
    lines = (files[0] / "gcp_list.txt").read_text().splitlines()
    renamed = [lines[0]]
    for line in lines[1:]:
        *numbers, image, point = line.split()
        renamed.append(f'{" ".join(numbers)} "{called[image]}" "point {point}"')
    (tmp_path / "gcp_list.txt").write_text("\n".join(renamed) + "\n")
    check = tuple(f"point {name}" for name in files[1])
    out = folder / "made" / "block"
    run_tiepoints(folder, out, options(files, gcp=str(tmp_path / "gcp_list.txt"), check=check), True)
    block = read_block(out)
    assert sorted(block.images.names.tolist()) == sorted(called.values())
    names = set(block.points[block.control.point].tolist())
    assert set(check) < names
    # what was made in the folder is no photograph
    assert len(files_of(folder, (".tif", ".jpg"))) == len(photographs)
    assert run_adjust(out, tmp_path / "result", None, None, None, False, True) == 0
    calibration = reopened(tmp_path / "result", Console(quiet=True))
    assert len(terrain_plan(calibration, [folder], TerrainSettings())[0].rows) == len(photographs)
    run_imgeo(tmp_path / "result", [folder / "day 1", folder / "day 2"], tmp_path / "ideal", ImgeoOptions(), True)
    written = (tmp_path / "ideal").rglob("photo*.tif")
    assert {path.relative_to(tmp_path / "ideal").as_posix() for path in written} == set(called.values())


def test_two_files_of_one_photograph(tmp_path):
    for name in ("a/one.tif", "b/one.tif"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_bytes(b"")
    paths = [tmp_path / "a" / "one.tif", tmp_path / "b" / "one.tif"]
    assert match_files(paths, np.array(["b/one.tif", "a/one.tif"])).tolist() == [1, 0]
    with pytest.raises(InputError, match="both called as photograph"):
        match_files(paths, np.array(["one.tif"]))


def photographs_of_exif():
    """Two photographs that know where they are, as far as it is asked for here."""
    from aerotri.tie_points.photographs import PhotographSet

    place = np.array([[9.0, 48.0, 500.0], [9.0005, 48.0, 500.0]])
    return PhotographSet(
        (Path("a.jpg"), Path("b.jpg")), np.array(["a.jpg", "b.jpg"]), (), np.zeros(2, int), place,
        np.full((2, 3), np.nan), np.zeros(2, bool),
    )  # fmt: skip


def test_time_column():
    """Seconds of the day on which the first photograph was taken; empty where EXIF says none."""
    from dataclasses import replace

    day = 16975 * 86400.0
    known = replace(photographs_of_exif(), time=np.array([day + 59519.0, np.nan]))
    assert known.time_column(np.ones(2, bool))["time"].tolist() == ["59519", ""]
    over_midnight = replace(known, time=np.array([day + 86399.5, day + 86401.0]))
    assert over_midnight.time_column(np.ones(2, bool))["time"].tolist() == ["86399.5", "86401"]
    assert photographs_of_exif().time_column(np.ones(2, bool)) == {}


@pytest.mark.parametrize(("shift", "crs"), [(0.0, "EPSG:32632"), (3e6, "local")])
def test_control_without_crs_keeps_positions(shift, crs, tmp_path):
    """EXIF is WGS 84: control near the photographs in their UTM zone is in it; what lies elsewhere is not."""
    from aerotri.formats.foreign.pix4d import read_pix4d_gcp
    from aerotri.tie_points.given import Given, crs_of, positions_in

    (tmp_path / "gcp.csv").write_text(f"P1,{500010.0 + shift},5316600,450\nP2,{500050.0 + shift},5316700,451\n")
    photographs, given = photographs_of_exif(), Given(control=read_pix4d_gcp(tmp_path / "gcp.csv"))
    assert crs_of(photographs, given) == crs
    positions, said = positions_in(photographs, given, crs)
    assert "gcp.csv names no" in said[0] or "gcp.csv names none" in said[0]
    assert (positions is None) == (crs == "local")
    if positions is not None:
        np.testing.assert_allclose(positions.xyz[0, :2], [500000.0, 5316300.0], atol=1000.0)


def test_heights_of_a_flight_are_worded_once():
    """EXIF counts from sea level, and the block names no system: message, import.json and pages say the same of it."""
    from aerotri.coordinates.crs_names import heights_in_words
    from aerotri.report.documents.words import Words
    from aerotri.report.head import crs_rows
    from aerotri.tie_points.given import Given, positions_in

    said = positions_in(photographs_of_exif(), Given(), "EPSG:32632")[1]
    words = heights_in_words("EPSG:32632")
    assert words == "system not named"
    assert any("count from sea level" in text and words in text for text in said)
    assert crs_rows(Words("en"), "EPSG:32632")[1][1] == words
    assert crs_rows(Words("en"), "EPSG:25832+7837")[1][1] == heights_in_words("EPSG:25832+7837") == "DHHN2016 height"
    assert heights_in_words("local") == ""


def test_orientations_name_the_system_of_the_block(tmp_path):
    from aerotri.formats.foreign.orientation_list import read_orientation_list
    from aerotri.tie_points.given import Given, crs_of

    (tmp_path / "opk.txt").write_text("# CRS: EPSG:25832\nP1 500000 5316300 900 0 0 0\n")
    given = Given(orientation=read_orientation_list(tmp_path / "opk.txt"))
    assert crs_of(photographs_of_exif(), given) == "EPSG:25832"


def test_positions_in_place_of_exif_are_said():
    from aerotri.formats.assembly.parts import PositionList, no_sigma
    from aerotri.tie_points.given import Given, positions_in

    listed = PositionList(Path("places.csv"), np.array(["a.jpg"]), no_sigma(1), no_sigma(1), no_sigma(1))
    positions, said = positions_in(photographs_of_exif(), Given(positions=listed), "EPSG:32632")
    assert positions is listed
    assert said == ("positions of places.csv are used in place of those in EXIF of 2 photographs",)


def test_exif_without_altitude():
    """Longitude and latitude still choose neighbours and the zone; why they are no positions is said."""
    from dataclasses import replace

    from aerotri.formats.text.notes import kind_of_note
    from aerotri.tie_points.given import Given, approximate_places, crs_of, positions_in

    whole = photographs_of_exif()
    flat = replace(whole, lon_lat_height=whole.lon_lat_height * [1.0, 1.0, np.nan])
    partly = replace(whole, lon_lat_height=np.vstack([whole.lon_lat_height[:1], flat.lon_lat_height[1:]]))
    for photographs, known, named in ((flat, None, "a.jpg, b.jpg"), (partly, ["a.jpg"], "b.jpg")):
        assert crs_of(photographs, Given()) == "EPSG:32632"
        positions, said = positions_in(photographs, Given(), "EPSG:32632")
        assert (None if positions is None else positions.images.tolist()) == known
        assert f"({named}) without an altitude in EXIF" in said[0]
        assert kind_of_note(said[0]) == "left behind"
        places = approximate_places(photographs, positions, Given())
        np.testing.assert_allclose(places[1, :2] - places[0, :2], [37.3, 0.0], atol=0.2)


def test_marking_page_is_named(files, tmp_path, capsys):
    """Without a mark there is still something to do, and a page to do it on."""
    lines = (files[0] / "gcp_list.txt").read_text().splitlines()
    points = {line.split()[-1]: line.split()[:3] for line in lines[1:]}
    table = ["name,X,Y,Z", *(",".join([name, *place]) for name, place in points.items())]
    (tmp_path / "control.csv").write_text("\n".join(table) + "\n")
    given = options(files, gcp=str(tmp_path / "control.csv"), check=())
    run_tiepoints(files[0] / "photographs", tmp_path / "block", given, False)
    assert str(tmp_path / "block" / "control_marks" / "marking.html") in capsys.readouterr().out
    assert (tmp_path / "block" / "control_marks" / "marking.html").is_file()


def test_the_same_from_python(files, tied, tmp_path, capsys):
    """The verb of the package gives the block of the command, and what it says is one JSON."""
    import aerotri

    found = aerotri.tie_points(
        files[0] / "photographs", control=files[0] / "gcp_list.txt", check=files[1], focal_length_mm=6.0, pixel_um=12.0,
        control_sigma_m=(0.02, 0.02, 0.03), mark_sigma_px=MARK_SIGMA_PX, points=300, features=2000,
        cache=tied / "tie_point_cache",
    )  # fmt: skip
    assert found.left_out == ()
    assert found.points.shape == (len(found.block.points), 3)
    folder = found.save(tmp_path / "block")
    for name in ("images.csv", "image_points.csv", "control.csv", "control_marks/predicted.csv"):
        assert (folder / name).read_bytes() == (tied / name).read_bytes()
    assert "<td>EPSG:32632</td>" in found._repr_html_()
    capsys.readouterr()
    run_tiepoints(files[0] / "photographs", tied, options(files), True)
    told, kept = (json.loads(text) for text in (capsys.readouterr().out, (folder / "tiepoints.json").read_text()))
    assert told["rays"] == kept["rays"]
    used = {one["key"]: one for one in kept["settings"]}
    assert used["control"] == {"key": "control", "value": "gcp_list.txt", "unit": "", "origin": "given"}
    assert used["control_sigma_m"] == {"key": "control_sigma_m", "value": [0.02, 0.02, 0.03], "unit": "m",
                                       "origin": "given"}  # fmt: skip
    assert used["seed"]["origin"] == used["crs"]["origin"] == "default"
    left = inspect.signature(aerotri.tie_points).parameters.keys() - used.keys()
    assert left == {"photographs", "project", "cache", "executor", "progress"}
    assert told["marking_page"] == str(tied / "control_marks" / "marking.html")


def test_control_that_nobody_marked_is_in_the_block_to_be_marked(files, tied, tmp_path):
    """With its σ; it changes nothing of the rest, and its names are told."""
    import aerotri

    lines = (files[0] / "gcp_list.txt").read_text().splitlines()
    points = {line.split()[-1]: line.split()[:3] for line in lines[1:]}
    table = ["name,X,Y,Z", *(",".join([name, *place]) for name, place in points.items())]
    (tmp_path / "control.csv").write_text("\n".join(table) + "\n")
    found = aerotri.tie_points(
        files[0] / "photographs", control=tmp_path / "control.csv", focal_length_mm=6.0, pixel_um=12.0,
        control_sigma_m=(0.02, 0.02, 0.03), points=300, features=2000, cache=tied / "tie_point_cache",
    )  # fmt: skip
    block = found.block
    assert set(found.unmarked) == set(points)
    assert set(block.points[block.control.point].tolist()) == set(points)
    assert not np.isin(block.image_points.point, block.control.point).any()
    assert found.points.shape == (len(block.points), 3)
    again = read_block(found.save(tmp_path / "block"))
    assert len(again.control) == len(points)


def test_stated_values_in_place_of_exif_are_said(tmp_path):
    """The focal length of EXIF is not lost without a word; the same value, rounded, is no other one."""
    from PIL import Image

    from aerotri.formats.foreign.exif import EXIF_IFD
    from aerotri.tie_points.photographs import StatedCamera, find_photographs

    for name, focal in (("a.jpg", 8.8), ("b.jpg", 8.8)):
        image = Image.new("RGB", (80, 60))
        exif = image.getexif()
        exif.get_ifd(EXIF_IFD).update({37386: focal, 41989: 24})
        image.save(tmp_path / name, exif=exif)
    said = find_photographs(tmp_path, StatedCamera((), 6.0, None)).messages
    assert said == ("--focal-length-mm 6 is used in place of 8.8 mm in EXIF of 2 photographs",)
    assert find_photographs(tmp_path, StatedCamera((), 8.8, None)).messages == ()


def test_positions_of_rtk():
    """Kinds of solution and the heights' system are said; WGS 84 of EXIF is taken as the datum of the block."""
    from dataclasses import replace

    from aerotri.formats.assembly.assemble import Statements
    from aerotri.tie_points.given import Given, positions_in

    quality = np.array(["fixed", "single point"])
    photographs = replace(photographs_of_exif(), quality=quality, ellipsoidal=np.array([True, False]))
    positions, said = positions_in(photographs, Given(stated=Statements(crs="EPSG:25832")), "EPSG:25832")
    assert positions is not None
    np.testing.assert_allclose(positions.xyz[0], [500000.0, 5316300.7, 500.0], atol=1.0)
    text = " ".join(said)
    assert "of RTK: 1 fixed, 1 single point" in text
    assert "sea level" in text
    assert "EPSG:25832 names no system of heights" in text
