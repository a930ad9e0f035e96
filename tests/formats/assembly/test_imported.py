"""What an import took, assumed and left behind: import.json, and five lines on the screen."""

from __future__ import annotations

import json

import jsonschema
import numpy as np
import pytest

import aerotri
from aerotri.cli.app import invoke
from aerotri.formats.text.notes import Note, assumed, kind_of_note
from aerotri.reference.files import described_files
from aerotri.reference.schemas import schema_of

CAMERA = ("--camera-size", "4000x3000", "--pixel-um", "2.4", "--focal-length-mm", "8.8")
RAYS = """P01 100 c
K1 1.0 2.0
T1 -1.0 0.5
T2 2.0 -0.5
-99
P02 100 c
K1 0.5 2.0
T1 -1.5 0.5
T2 1.5 -0.5
-99
"""
CONTROL = """# units are what the crew writes
name,Easting (ft),Northing (ft),Elevation (ft),code,quality,crew,day
K1,1640420,19028871,328.084,GP,1,A,3
K9,1640430,19028881,328.084,GP,1,A,3
"""
POSITIONS = "image,X,Y,Z\nP01,500000,5800000,200\nP02,500020,5800000,200\nP03,500040,5800000,200\n"


@pytest.fixture
def lists(tmp_path):
    (tmp_path / "rays.txt").write_text(RAYS)
    (tmp_path / "points.csv").write_text(CONTROL)
    (tmp_path / "places.csv").write_text(POSITIONS)
    return tmp_path


def converted(lists, capsys, *more):
    out = lists / "block"
    words = ["convert", f"bingo:{lists / 'rays.txt'}", "--out", out, "--control", lists / "points.csv",
             "--positions", lists / "places.csv", "--crs", "EPSG:25832", "--control-sigma-m", 0.02,
             "--positions-sigma-m", 0.05, *CAMERA, *more]  # fmt: skip
    assert invoke([str(word) for word in words]) == 0
    return out, capsys.readouterr().out


def test_five_lines_and_a_file(lists, capsys):
    """Every sentence of the import stands under its kind; the screen has five lines, long lists are shortened."""
    out, printed = converted(lists, capsys)
    lines = [line for line in printed.splitlines() if line.split(":")[0] in ("Read", "Taken", "Assumed", "Left behind")]
    assert [line.split(":")[0] for line in lines] == ["Read", "Taken", "Assumed", "Left behind"]
    assert printed.splitlines()[-5:-1] == lines
    assert printed.splitlines()[-1] == f"Written to {out}"
    assert "rays.txt (bingo, BINGO); places.csv (csv); points.csv (csv)" in lines[0]
    assert "2 photographs, 1 camera, 6 image points of 3 points, 2 control points, 2 GNSS positions" in lines[1]
    content = json.loads((out / "import.json").read_text(encoding="utf-8"))
    jsonschema.validate(content, schema_of(next(one for one in described_files() if one.name == "import.json")))
    assert [one["path"] for one in content["sources"]] == [
        str(lists / name) for name in ("rays.txt", "places.csv", "points.csv")
    ]
    assert (content["taken"]["control_points"], content["taken"]["gnss_positions"]) == (2, 2)
    assert [note for note in content["taken"]["notes"] if "Elevation (ft)" in note]
    assert [note for note in content["assumed"] if "assumed as 1 pixel" in note]
    left = " ".join(content["left_behind"])
    assert "code, quality, crew, day" in left
    assert "P03" in left
    assert [note for note in content["remarks"] if "K9" in note]


def test_more_notes_than_lines_are_counted(lists, capsys):
    """Four columns in feet are four notes; three are shown with the counts."""
    text = CONTROL.replace("code,quality", "sX (mm),code").replace("GP,1,", "20,GP,")
    (lists / "points.csv").write_text(text)
    out, printed = converted(lists, capsys)
    taken = next(line for line in printed.splitlines() if line.startswith("Taken:"))
    assert taken.endswith("; and 2 more, see import.json")
    assert len(json.loads((out / "import.json").read_text(encoding="utf-8"))["taken"]["notes"]) == 4


def test_python_has_the_same(lists):
    read = aerotri.read(f"bingo:{lists / 'rays.txt'}", camera_size=(4000, 3000), pixel_um=2.4, focal_length_mm=8.8)
    assert read.imported.assumed == tuple(text for text in read.messages if "assumed" in text)
    assert read.imported.sources[0].format == "bingo"
    said = aerotri.convert(read, lists / "block")
    assert said == ()
    assert json.loads((lists / "block" / "import.json").read_text())["assumed"] == list(read.imported.assumed)
    aerotri.convert(read.block, lists / "block")
    assert not (lists / "block" / "import.json").exists()


def test_a_note_is_a_text():
    note = assumed("a pixel counts as 1 µm")
    assert note == "a pixel counts as 1 µm"
    assert isinstance(note, Note)
    assert json.dumps([note]) == json.dumps([str(note)])
    assert (kind_of_note(note), kind_of_note(str.__str__(note))) == ("assumed", "")
    assert kind_of_note("left out: 3 image points") == "left behind"


@pytest.mark.parametrize(("stated", "replaced"), [(100.0, True), (8.8, False)])
def test_principal_distance_in_place_of_that_of_the_file(tmp_path, stated, replaced):
    """The heads of PAT-B name 8.8 mm, in µm."""
    rows = "\n".join(f"{name} 8800\nK1 1000 2000\nT1 -1000 500\n-99" for name in ("P01", "P02"))
    (tmp_path / "rays.im").write_text(rows + "\n")
    read = aerotri.read(tmp_path / "rays.im", camera_size=(4000, 3000), pixel_um=2.4, focal_length_mm=stated)
    about = "the principal distance of the camera, 100 mm, is used in place of 8.8 mm in the image points"
    assert (about in read.imported.taken) == replaced


def test_values_beside_cameras_of_files_are_refused(tmp_path):
    """--focal-length-mm without a size describes no camera, and replaces none without a word."""
    from aerotri.formats.assembly.camera_spec import CameraSpec, cameras_of
    from aerotri.observations import Camera, Prior

    interior = {"focal_length_mm": Prior(100.0), "x0_mm": Prior(0.0), "y0_mm": Prior(0.0)}
    found = (Camera("uce", "frame", (4000, 3000), 2.4, interior),)
    for spec in (CameraSpec(focal_length_mm=8.8), CameraSpec(name="other")):
        with pytest.raises(aerotri.InputError, match=r"the files describe their cameras \(uce\)"):
            cameras_of(spec, found, np.zeros(0, str), np.zeros(0))
    assert cameras_of(CameraSpec(), found, np.zeros(0, str), np.zeros(0)) == found


def test_extra_columns_of_gcp_list_are_named(tmp_path):
    from aerotri.formats.foreign.odm import read_odm_gcp

    rows = ("EPSG:32632", "500000 5300000 10 5 6 a.jpg K1 0.9 note", "500000 5300000 10 7 8 b.jpg K1")
    (tmp_path / "gcp_list.txt").write_text("\n".join(rows) + "\n")
    said = read_odm_gcp(tmp_path / "gcp_list.txt").messages
    assert said == ("gcp_list.txt: what follows the known columns in 1 row was not carried over",)


def test_every_format_names_its_program():
    """A reader that is added names the program behind it, unless many write such lists."""
    from aerotri.formats.assembly import kinds
    from aerotri.formats.assembly.imported import program_of
    from aerotri.formats.convert import READERS

    names = {*READERS, *kinds.RAYS, *kinds.ORIENTATIONS, *kinds.POSITIONS, *kinds.CONTROL}
    assert {name for name in names if not program_of(name)} == {"csv", "opk-csv", "opk-list"}
