"""A block folder divided with its image points read piece by piece: the files of the block that is held whole."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.block import folder as block_folder
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.text import table_pieces
from aerotri.functional_model.interior import fit_fiducials
from aerotri.observations.block import Fiducials, ImagePoints
from aerotri.partition import ray_files
from small_blocks import LONG_FLIGHT, small_block, with_adjustment

POSITIONS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08]}}
READ = block_folder.read_image_points


@pytest.fixture(scope="module")
def block():
    """Rays in any order, a σ for each, names with a comma, control that nobody measured."""
    whole, _ = small_block(seed=4, flight=LONG_FLIGHT, **POSITIONS)
    rays, drawn = whole.image_points, np.random.default_rng(1)
    order = drawn.permutation(len(rays))
    sigma = 0.002 * drawn.uniform(0.5, 2.0, (len(rays), 2))
    shuffled = ImagePoints(rays.image[order], rays.point[order], rays.xy[order], sigma)
    names = np.array([f"{name}, ö" if k % 3 == 0 else name for k, name in enumerate(whole.points)])
    control, extra = whole.control, np.array(["never measured"])
    control = replace(
        control,
        point=np.append(control.point, len(names)),
        xyz=np.vstack([control.xyz, control.xyz[:1]]),
        sigma=np.vstack([control.sigma, control.sigma[:1]]),
        is_check=np.append(control.is_check, False),
    )
    return with_adjustment(
        replace(whole, points=np.append(names, extra), image_points=shuffled, control=control), model_part="off"
    )


@pytest.fixture
def small_pieces(monkeypatch):
    """Pieces of some ten rows."""
    monkeypatch.setattr(table_pieces, "PIECE_BYTES", 900)
    monkeypatch.setattr(table_pieces, "PIECE_ROWS", 13)


@pytest.fixture
def never_whole(monkeypatch):
    """That image points are read whole is an error."""
    monkeypatch.setattr(block_folder, "read_image_points", refuse)


def refuse(*given, **named):
    raise AssertionError("the image points are read whole")


def files_of(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def divided(source, folder, parts=3, tables="csv"):
    return files_of(aerotri.divide(source, folder, parts=parts, tables=tables))


@pytest.mark.parametrize("kept", ["csv", "parquet"])
@pytest.mark.parametrize("tables", ["csv", "parquet"])
def test_files_are_those_of_the_whole(kept, tables, block, tmp_path, small_pieces, monkeypatch):
    write_block(block, tmp_path / "block", tables=kept)
    # as it is read: points in the order of their first image point
    expected = divided(read_block(tmp_path / "block"), tmp_path / "whole", tables=tables)
    assert sum(name.endswith(f"image_points.{tables}") for name in expected) == 3
    monkeypatch.setattr(block_folder, "read_image_points", refuse)
    assert divided(tmp_path / "block", tmp_path / "pieces", tables=tables) == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == ["block", "pieces", "whole"]


def test_more_parts_than_files_can_be_open(block, tmp_path, small_pieces, monkeypatch):
    """A file that was closed holds one stream after the other."""
    write_block(block, tmp_path / "block")
    expected = divided(tmp_path / "block", tmp_path / "open")
    monkeypatch.setattr(ray_files, "MOST_OPEN", 2)
    assert divided(tmp_path / "block", tmp_path / "closed") == expected


def test_its_adjustment_is_that_of_the_whole(block, tmp_path, small_pieces):
    write_block(block, tmp_path / "block")
    aerotri.divide(tmp_path / "block", tmp_path / "pieces", parts=3)
    aerotri.divide(read_block(tmp_path / "block"), tmp_path / "whole", parts=3)
    found, expected = (
        aerotri.adjust_parts(tmp_path / name, tmp_path / f"{name}_result", plots=False) for name in ("pieces", "whole")
    )
    assert (found.status, found.sigma0) == ("converged", expected.sigma0)


def test_scanned_film_keeps_its_marks(tmp_path, small_pieces, never_whole):
    """Fiducial marks and what follows from them go with the photographs."""
    plain, _ = small_block(seed=4, flight=LONG_FLIGHT)
    camera = plain.cameras[0]
    half = np.array(camera.half_format_mm)
    calibrated = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    marks = {f"F{k}": tuple(xy) for k, xy in enumerate(calibrated.tolist())}
    camera = replace(camera, fiducials=marks, interior_orientation="affine")
    n = len(plain.images)
    px = np.concatenate([calibrated / camera.pixel_mm * [1.0, -1.0] + 3000.0 + 7.0 * k for k in range(n)])
    fiducials = Fiducials(np.repeat(np.arange(n), 4), np.array([*marks] * n), px)
    fits = {k: fit_fiducials(px[4 * k : 4 * k + 4], calibrated, "affine", str(k)) for k in range(n)}
    block = replace(plain, cameras=(camera,), fiducials=fiducials, interior_fits=fits)
    write_block(block, tmp_path / "block")
    aerotri.divide(tmp_path / "block", tmp_path / "parts", parts=3)
    row = {name: k for k, name in enumerate(block.images.names)}
    rays = {(row[i], p): xy for i, p, xy in zip(
        block.images.names[block.image_points.image], block.points[block.image_points.point], block.image_points.xy,
        strict=True)}  # fmt: skip
    seen = 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(block_folder, "read_image_points", READ)
        for folder in sorted((tmp_path / "parts" / "parts").iterdir()):
            part = read_block(folder)
            assert sorted(part.interior_fits) == list(range(len(part.images)))
            for i, p, xy in zip(part.image_points.image, part.image_points.point, part.image_points.xy, strict=True):
                np.testing.assert_allclose(xy, rays[row[part.images.names[i]], part.points[p]], atol=1e-9)
                seen += 1
    assert seen == len(rays)


def written(block, folder, change):
    """The folder with its CSV of image points changed, line by line."""
    write_block(block, folder)
    path = folder / "image_points.csv"
    path.write_text("\n".join(change(path.read_text(encoding="utf-8").splitlines())) + "\n", encoding="utf-8")
    return folder


def test_errors_far_down_the_table_name_their_line(block, tmp_path, small_pieces, never_whole):
    def wrong(name, change, message, line):
        with pytest.raises(InputError, match=message) as caught:
            aerotri.divide(written(block, tmp_path / name, change), tmp_path / f"{name}_parts", parts=3)
        assert caught.value.line == line
        assert not (tmp_path / f"{name}_parts").exists()

    first, *_ = written(block, tmp_path / "right", lambda lines: lines).joinpath("image_points.csv").open()
    assert first.startswith("image,point,x,y")
    wrong("unknown", lambda lines: [*lines[:900], "nowhere," + lines[900].partition(",")[2], *lines[901:]],
          "photograph 'nowhere' is not in the table images", 901)  # fmt: skip
    count = len((tmp_path / "right" / "image_points.csv").read_text(encoding="utf-8").splitlines())
    wrong("again", lambda lines: ["# comment", *lines, "", lines[5]], "is there twice, first in line 7", count + 3)
    wrong("cells", lambda lines: [*lines[:800], lines[800] + ",1", *lines[801:]], "the row has 7 cells", 801)
    wrong("number", lambda lines: [*lines[:700], lines[700].replace(lines[700].split(",")[-1], "x"), *lines[701:]],
          "is not a number", 701)  # fmt: skip
    wrong("none", lambda lines: lines[:1], "holds no image points", None)


def test_a_parquet_file_names_the_row(block, tmp_path, small_pieces, never_whole):
    rays = block.image_points
    point, image = rays.point.copy(), rays.image.copy()
    point[-1], image[-1] = point[3], image[3]
    write_block(replace(block, image_points=replace(rays, point=point, image=image)), tmp_path / "b", tables="parquet")
    with pytest.raises(InputError, match=rf"row {len(rays)}: point '.*' is there twice, first in row 4"):
        aerotri.divide(tmp_path / "b", tmp_path / "parts", parts=3)


def test_a_block_whose_settings_follow_from_all_image_points_is_read_whole(block, tmp_path, small_pieces):
    write_block(block, tmp_path / "block")
    toml = tmp_path / "block" / "block.toml"
    lines = [line for line in toml.read_text(encoding="utf-8").splitlines() if "image_sigma_um" not in line]
    toml.write_text("\n".join(lines), encoding="utf-8")
    expected = divided(read_block(tmp_path / "block"), tmp_path / "whole")
    assert divided(tmp_path / "block", tmp_path / "pieces") == expected


def test_decisions_are_refused_by_name(block, tmp_path, small_pieces):
    write_block(block, tmp_path / "block")
    row = f'"{block.points[0]}"' if "," in block.points[0] else block.points[0]
    (tmp_path / "block" / "edits.csv").write_text(f"image,point,action,reason\n,{row},off,doubtful\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"edits\.csv of a block in parts is not available"):
        aerotri.divide(tmp_path / "block", tmp_path / "parts", parts=3)
