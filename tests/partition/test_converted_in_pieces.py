"""Files of other programs converted into parts piece by piece: the files of `convert` and then `divide`."""

import struct
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.assembly import bulk
from aerotri.formats.convert import write_any
from aerotri.formats.foreign import colmap, colmap_pieces, section_pieces
from small_blocks import LONG_FLIGHT, small_block

SIGMAS = {"control_sigma_m": (0.02, 0.02, 0.04)}
PATB = SIGMAS | {"camera_size": (12000, 8000), "pixel_um": 9.0}


@pytest.fixture(scope="module")
def flown():
    """A block whose points have names that are numbers, and its true points."""
    block, truth = small_block(seed=4, flight=LONG_FLIGHT)
    names = np.arange(7, 7 + 3 * len(block.points), 3).astype(str)
    return replace(block, points=names), truth.points


@pytest.fixture
def small_pieces(monkeypatch):
    """Pieces of few photographs, and a sample of every third point."""
    monkeypatch.setattr(colmap_pieces, "PIECE_RAYS", 50)
    monkeypatch.setattr(colmap_pieces, "PIECE_BYTES", 2000)
    monkeypatch.setattr(section_pieces, "PIECE_BYTES", 900)
    monkeypatch.setattr(bulk, "SAMPLE_RAYS", 400)


@pytest.fixture
def never_whole(monkeypatch):
    """That a model is read whole is an error."""

    def refuse(*given, **named):
        raise AssertionError("the model is read whole")

    for reader in ("_rays_of", "_points_of"):
        monkeypatch.setattr(colmap, reader, refuse)


def control_file(block, folder):
    """A list of the control points of a block, with one that nobody measured."""
    names, xyz = block.points[block.control.point].tolist(), block.control.xyz.tolist()
    rows = [f"{n},{x!r},{y!r},{z!r}" for n, (x, y, z) in zip([*names, "never"], [*xyz, xyz[0]], strict=True)]
    folder.mkdir(exist_ok=True)
    (folder / "control.csv").write_text("point,X,Y,Z\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return folder / "control.csv"


def files_of(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def both_ways(source, place, **stated):
    """Files of the two ways to parts, and what was said; folders of the same name give blocks of the same name."""
    said = aerotri.convert(aerotri.read(source, name="flight", **stated), place / "one" / "flight")
    aerotri.divide(place / "one" / "flight", place / "two" / "flight", parts=3)
    found = aerotri.convert_parts(source, place / "three" / "flight", parts=3, **stated)
    return files_of(place / "two" / "flight"), files_of(place / "three" / "flight"), said, found


def write_model(flown, folder, form="colmap"):
    block, points = flown
    write_any(block, folder, form, points)
    return folder


@pytest.mark.parametrize("form", ["colmap", "colmap-text"])
def test_a_colmap_model_gives_the_same_files(form, flown, tmp_path, small_pieces):
    model = write_model(flown, tmp_path / "model", form)
    control = control_file(flown[0], tmp_path / "lists")
    expected, found, whole, said = both_ways(model, tmp_path, control=control, pixel_um=9.0, **SIGMAS)
    read = aerotri.read(model, control=control, pixel_um=9.0, **SIGMAS)
    assert sum(name.endswith("image_points.parquet") for name in expected) == 3
    assert found == expected
    assert any("start values of object points" in text for text in said)
    assert "control.csv: 1 point is not measured: 'never'" in said
    assert any("image points fit the given orientations" in text for text in said)
    # all rays of control points are in the sample
    assert set(whole) <= set(said)
    assert [t for t in said if "of control points" in t] == [t for t in read.messages if "of control points" in t]


def test_a_model_is_never_held(flown, tmp_path, small_pieces, never_whole):
    model, control = write_model(flown, tmp_path / "model"), control_file(flown[0], tmp_path / "lists")
    aerotri.convert_parts(model, tmp_path / "parts", parts=3, control=control, pixel_um=9.0, **SIGMAS)
    found = aerotri.adjust_parts(tmp_path / "parts", tmp_path / "result", plots=False)
    assert (found.status, len(found.parts)) == ("converged", 3)


def test_marks_of_control_from_a_list_are_added(flown, tmp_path, small_pieces):
    """Image points of control that the model does not have, in a list of IGN."""
    block, _ = flown
    rows, marks = ["point,X,Y,Z"], []
    for k in range(3):
        rows.append(f"G{k}," + ",".join(map(repr, block.control.xyz[k].tolist())))
        for ray in np.flatnonzero(block.image_points.point == block.control.point[k])[:3].tolist():
            px = px_from_mm(block.image_points.xy[ray], block.cameras[0].size_px, block.cameras[0].pixel_mm).tolist()
            marks.append(f"G{k} {block.images.names[block.image_points.image[ray]]} {px[0]!r} {px[1]!r}")
    (tmp_path / "control.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (tmp_path / "marks.mes").write_text("\n".join(marks) + "\n", encoding="utf-8")
    model = write_model(flown, tmp_path / "model")
    stated = {"control": tmp_path / "control.csv", "image_points": [tmp_path / "marks.mes"], "pixel_um": 9.0}
    stated |= {"image_sigma_px": 0.4, **SIGMAS}
    expected, found, _, _ = both_ways(model, tmp_path, **stated)
    assert found == expected
    result = aerotri.adjust_parts(tmp_path / "three" / "flight", tmp_path / "result", plots=False).folder
    names = [line.split(",")[0] for line in (result / "control.csv").read_text(encoding="utf-8").splitlines()[1:]]
    assert sorted(names) == ["G0", "G1", "G2"]
    # a mark that the model has already
    first = block.image_points
    point, image = block.points[first.point[0]], block.images.names[first.image[0]]
    (tmp_path / "marks.mes").write_text("\n".join([*marks, f"{point} {image} 5 5"]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=f"point '{point}' in photograph '{image}' is measured in another file"):
        aerotri.convert_parts(model, tmp_path / "again", parts=3, **stated)


def test_repeated_measurements_are_left_out_and_counted(flown, tmp_path, small_pieces):
    model, control = write_model(flown, tmp_path / "model"), control_file(flown[0], tmp_path / "lists")
    images = bytearray((model / "images.bin").read_bytes())
    name = images.index(b"\0", 8 + 64)
    first, second = name + 9 + 16, name + 9 + 24 + 16
    images[second : second + 8] = images[first : first + 8]
    (model / "images.bin").write_bytes(images)
    said = aerotri.convert_parts(model, tmp_path / "p", parts=3, control=control, pixel_um=9.0, **SIGMAS)
    assert "left out: 1 repeated measurement of a point in the same image" in said
    expected, found, _, _ = both_ways(model, tmp_path, control=control, pixel_um=9.0, **SIGMAS)
    assert found == expected


def test_damaged_models_are_refused_by_name(flown, tmp_path, small_pieces):
    model, control = write_model(flown, tmp_path / "model"), control_file(flown[0], tmp_path / "lists")
    whole = {path.name: path.read_bytes() for path in model.iterdir()}

    def wrong(file, content, message):
        (model / file).write_bytes(content)
        with pytest.raises(InputError, match=message):
            aerotri.convert_parts(model, tmp_path / "parts", parts=3, control=control, **SIGMAS)
        assert not (tmp_path / "parts").exists()
        (model / file).write_bytes(whole[file])

    images, points = whole["images.bin"], whole["points3D.bin"]
    wrong("images.bin", images[:-5], "announces more than it holds")
    wrong("images.bin", images[:4], "announces more than it holds")
    wrong("points3D.bin", points[:-5], "announces more than it holds")
    wrong("points3D.bin", struct.pack("<Q", 0), "belong to object point .*, which there is not")
    wrong("points3D.bin", points[:16] + struct.pack("<d", np.inf) + points[24:], "lies at no possible place")
    wrong("cameras.bin", whole["cameras.bin"][:-4], "announces more than it holds")


def test_a_text_model_of_another_hand_is_refused_with_a_way_out(flown, tmp_path, small_pieces):
    model, control = write_model(flown, tmp_path / "model", "colmap-text"), control_file(flown[0], tmp_path / "lists")
    path = model / "images.txt"
    lines = path.read_text(encoding="utf-8").split("\n")
    row = next(k for k, line in enumerate(lines) if line and not line.startswith("#")) + 1
    lines[row] = lines[row].replace(lines[row].split()[0], "x", 1)
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read in pieces") as caught:
        aerotri.convert_parts(model, tmp_path / "parts", parts=3, control=control, **SIGMAS)
    assert "aerotri divide" in caught.value.remedy


def test_patb_gives_the_same_files(flown, tmp_path, small_pieces):
    """The meaning of the matrices is settled by the sample."""
    write_any(flown[0], tmp_path / "files", "patb")
    expected, found, _, said = both_ways(tmp_path / "files", tmp_path, **PATB)
    assert found == expected
    assert any("rotations are camera-to-object" in text for text in said)
    assert aerotri.adjust_parts(tmp_path / "three" / "flight", tmp_path / "result", plots=False).status == "converged"


def test_bingo_gives_the_same_files(flown, tmp_path, small_pieces):
    block, _ = flown
    write_any(block, tmp_path / "files" / "points.txt", "bingo")
    write_any(block, tmp_path / "patb", "patb")
    camera = {"camera_name": block.cameras[0].name, "focal_length_mm": block.cameras[0].focal_length_mm}
    stated = PATB | camera | {"control": control_file(block, tmp_path / "lists")}
    stated |= {"orientation": tmp_path / "patb" / "block.ori", "patb_rotation": "camera-to-object"}
    expected, found, _, _ = both_ways(tmp_path / "files" / "points.txt", tmp_path, **stated)
    assert found == expected


def test_errors_far_down_a_file_name_their_line(flown, tmp_path, small_pieces):
    write_any(flown[0], tmp_path / "files", "patb")
    path = tmp_path / "files" / "block.im"
    lines = path.read_text(encoding="utf-8").split("\n")
    heads = [0] + [k + 1 for k, line in enumerate(lines[:-2]) if line.split() == ["-99"]]

    def wrong(changed, message, line):
        path.write_text("\n".join(changed), encoding="utf-8")
        with pytest.raises(InputError, match=message) as caught:
            aerotri.convert_parts(tmp_path / "files", tmp_path / "parts", parts=3, **PATB)
        assert caught.value.line == line

    at = heads[-1] + 2
    wrong([*lines[:at], lines[at].rsplit(" ", 1)[0] + " x", *lines[at + 1 :]], "is not a number", at + 1)
    name = lines[heads[0]].split()[0]
    again = heads[-1]
    wrong([*lines[:again], lines[again].replace(lines[again].split()[0], name), *lines[again + 1 :]],
          f"photograph '{name}' is there twice, first in line 1", again + 1)  # fmt: skip
    wrong(lines[:-2], "does not end", None if not lines else len(lines) - 2)


def test_other_formats_are_refused_with_a_way_out(flown, tmp_path):
    block, points = flown
    write_any(block, tmp_path / "bundle", "bundler", points)
    with pytest.raises(InputError, match="is of the format bundler, which is not read in pieces") as caught:
        aerotri.convert_parts(tmp_path / "bundle", tmp_path / "parts", parts=3)
    assert "aerotri convert SOURCE --out BLOCK; aerotri divide BLOCK" in caught.value.remedy
    write_any(block, tmp_path / "block")
    with pytest.raises(InputError, match="is a block folder"):
        aerotri.convert_parts(tmp_path / "block", tmp_path / "parts", parts=3)


def test_what_parts_cannot_have_is_refused_before_anything_is_written(flown, tmp_path):
    model = write_model(flown, tmp_path / "model")
    with pytest.raises(InputError, match='datum = "minimal" of a block in parts'):
        aerotri.convert_parts(model, tmp_path / "parts", parts=3)
    assert not (tmp_path / "parts").exists()


def test_the_command(flown, tmp_path, capsys):
    from aerotri.cli.app import invoke

    model, control = write_model(flown, tmp_path / "model"), control_file(flown[0], tmp_path / "lists")
    stated = ["--control", str(control), "--control-sigma-m", "0.02,0.02,0.04", "--pixel-um", "9", "--parts", "3"]
    out = str(tmp_path / "parts")
    assert invoke(["convert", str(model), "--out", out, *stated]) == 0
    said = capsys.readouterr().out
    assert "3 parts of" in said
    assert f"Written to {out}: aerotri adjust {out}" in said
    assert len(list((tmp_path / "parts" / "parts").iterdir())) == 3
    with pytest.raises(InputError, match="--to colmap does not go with --parts"):
        invoke(["convert", str(model), "--out", str(tmp_path / "other"), "--to", "colmap", *stated])
