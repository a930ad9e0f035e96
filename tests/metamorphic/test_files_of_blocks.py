"""The same block out of other files: split, in other rows, carried through other formats; the same adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from transformations import both, by_names, largest_difference, numbers_of, permuted, renamed, same, with_names

from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.assembly.oriented import oriented_block
from aerotri.formats.assembly.project import Request, read_project
from aerotri.formats.block.folder import write_block
from aerotri.formats.convert import read_any, write_any, write_oriented
from aerotri.formats.foreign.bingo import write_bingo
from aerotri.formats.foreign.metashape import write_metashape
from aerotri.formats.foreign.pix4d import write_pix4d_gcp, write_pix4d_geo
from aerotri.functional_model.additional_parameters import AUTO, parse_parameters
from aerotri.pipeline import adjust, choosing
from small_blocks import small_block, with_adjustment

ALL = 1e-9
"""σ, by which results of files that say the same may differ."""
GNSS = {"gnss": {"sigma_m": [0.05, 0.05, 0.05], "shift_sigma_m": [0.0, 0.0, 0.0]}}


def plain_names(block):
    """The block with names that every format takes: BINGO and PAT-B have no blanks, COLMAP and PAT-B numbers."""
    names = {name: str(1000 + k) for k, name in enumerate(block.points.tolist())}
    return with_names(block, names | {name: str(1 + k) for k, name in enumerate(block.images.names.tolist())})


@pytest.fixture(scope="module")
def measured():
    """A block with GNSS, its orientation and points adjusted, and the numbers of that adjustment."""
    block = plain_names(small_block(3, **GNSS)[0])
    result = adjust(block)
    return block, result, numbers_of(result, same(block))


def rays_of(block, keep):
    """The block with some of its rays, all its names as they were."""
    rays = block.image_points
    return replace(block, image_points=type(rays)(rays.image[keep], rays.point[keep], rays.xy[keep], rays.sigma[keep]))


def camera_of(block):
    camera = block.cameras[0]
    return CameraSpec(
        name=camera.name, size_px=camera.size_px, pixel_um=camera.pixel_um,
        focal_length_mm=camera.focal_length_mm, flight_axis=camera.flight_axis,
    )  # fmt: skip


def written_lists(block, result, folder, parts):
    """Lists of what was measured, the image points in as many files as there are parts (rows of rays)."""
    folder.mkdir()
    for number, keep in enumerate(parts):
        write_bingo(rays_of(block, keep), folder / f"{number}.txt")
    write_metashape(oriented_block(block, result.points.xyz), folder / "opk.txt")
    write_pix4d_gcp(block, folder / "gcp.csv")
    write_pix4d_geo(block, folder / "geo.csv")
    return folder


def assembled(folder, count, like, order=1):
    """The block of these lists, the image points' files in this order or the other way round."""
    files = [str(folder / f"{k}.txt") for k in range(count)][::order]
    check = tuple(like.points[like.control.point[like.control.is_check]].tolist())
    return read_project(
        Request(
            files[0], "made", tuple(files[1:]), str(folder / "opk.txt"), str(folder / "geo.csv"),
            str(folder / "gcp.csv"), camera_of(like), Statements(), check, image_sigma_um=2.0,
        )
    ).block  # fmt: skip


def turned_round(path):
    """The rows of a list with a head, last first."""
    head, *rows = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join([head, *rows[::-1]]), encoding="utf-8")


def assert_same(before, result, changed, limit, what):
    found = largest_difference(before, numbers_of(result, changed))
    beyond = {name: value for name, value in found.items() if not value <= limit}
    assert not beyond, what


def test_image_points_in_several_files(measured, tmp_path):
    """By photographs, by points and at random, read first to last and last to first; lists in another order too."""
    block, result, _ = measured
    rays = block.image_points
    whole = assembled(written_lists(block, result, tmp_path / "whole", [np.arange(len(rays))]), 1, block)
    before = numbers_of(adjust(whole), same(whole))
    rng = np.random.default_rng(8)
    keys = {"photographs": rays.image % 3, "points": rays.point % 3, "rays": rng.integers(3, size=len(rays))}
    for name, key in keys.items():
        parts = [rng.permutation(np.flatnonzero(key == k)) for k in range(3)]
        folder = written_lists(block, result, tmp_path / name, parts)
        turned_round(folder / "gcp.csv")
        turned_round(folder / "geo.csv")
        for order in (1, -1):
            split = assembled(folder, 3, block, order)
            assert len(split.image_points) == len(rays)
            assert_same(before, adjust(split), by_names(whole, split), ALL, name)


def test_parameters_chosen_for_split_files(measured, tmp_path, monkeypatch):
    """`--parameters auto` for a block whose image points come from three files."""
    block, result, _ = measured
    sets = tuple(parse_parameters(spec) for spec in ("none", "bluh:1-12", "ebner"))
    monkeypatch.setattr(choosing, "sets_to_choose_from", lambda block: sets)
    rows = np.arange(len(block.image_points))
    rng = np.random.default_rng(9)
    found = []
    for name, parts in {"whole": [rows], "split": [rng.permutation(rows[rows % 3 == k]) for k in range(3)]}.items():
        read = assembled(written_lists(block, result, tmp_path / name, parts), len(parts), block)
        found.append(with_adjustment(read, additional_parameters=AUTO))
    whole, split = found
    before, changed = numbers_of(adjust(whole), same(whole)), by_names(whole, split)
    after = adjust(split)
    assert_same(before, after, changed, ALL, "split")
    assert sorted(after.outcome.warnings) == before.words["warnings"]
    assert list(after.outcome.notes) == before.words["notes"]
    assert any("additional parameters chosen" in said for said in after.outcome.notes)


@pytest.mark.parametrize("tables", ["csv", "parquet"])
def test_block_folders_carry_everything(measured, tmp_path, tables):
    """Rows in another order and other names, written and read."""
    block, _, before = measured

    def written_and_read(given):
        write_block(given, tmp_path / "block", tables)
        return by_names(given, read_any(tmp_path / "block")[0])

    changed = both(both(permuted(4), renamed), written_and_read)(block)
    assert_same(before, adjust(changed.block), changed, ALL, tables)


def with_the_rest_of(block, read):
    """What was read, with what its format does not hold (σ, control, GNSS, settings, camera) from the block itself."""
    to_image = {name: k for k, name in enumerate(block.images.names.tolist())}
    to_point = {name: k for k, name in enumerate(block.points.tolist())}
    rays = read.image_points
    image = np.array([to_image[name] for name in read.images.names.tolist()])
    point = np.array([to_point[name] for name in read.points.tolist()])
    images = block.images
    centre, angles = images.centre.copy(), images.angles.copy()
    centre[image], angles[image] = read.images.centre, read.images.angles
    xy = type(rays)(image[rays.image], point[rays.point], rays.xy, np.full_like(rays.xy, 0.002))
    return replace(block, images=replace(images, centre=centre, angles=angles), image_points=xy)


FORMATS = {
    # text with every digit of a number: conversions to pixels and back round to 1e-12 mm or so
    "colmap-text": 1e-7,
    "colmap": 1e-7,
    "bundler": 1e-7,
    "opensfm": 1e-7,
    "bal": 1e-7,
    # six decimals of a millimetre are 2.5e-4 of an observation's σ
    "bingo": 2e-3,
    "patb": 2e-3,
}


@pytest.mark.parametrize("name", FORMATS)
def test_there_and_back(measured, tmp_path, name):
    block, result, before = measured
    oriented = oriented_block(block, result.points.xyz)
    target = tmp_path / ("model.txt" if name in ("bal", "bingo") else "model")
    if name == "bingo":
        write_any(block, target, name)
    else:
        write_oriented(oriented, target, name)
    if name in ("bingo", "patb"):
        orientation = "" if name == "patb" else str(tmp_path / "opk.txt")
        write_metashape(oriented, tmp_path / "opk.txt")
        stated = Statements(patb_rotation="camera-to-object", control_sigma_m=(0.03, 0.03, 0.05))
        read = read_project(Request(str(target), "made", (), orientation, camera=camera_of(block), stated=stated)).block
    else:
        read, _ = read_any(target)
    again = with_the_rest_of(block, in_millimetres(numbered_like(block, read), block))
    assert len(again.image_points) == len(block.image_points)
    assert_same(before, adjust(again), by_names(block, again), FORMATS[name], name)


def numbered_like(block, read):
    """Names where the format has numbers from 0 in the order of the block: of points in Bundler, of both in BAL."""
    images, points = (
        np.array([own[int(k)] for k in given]) if "0" in given else given
        for own, given in ((block.images.names, read.images.names), (block.points, read.points))
    )
    return replace(read, images=replace(read.images, names=images), points=points)


def in_millimetres(read, block):
    """Image points of a format that knows no size of a pixel."""
    scale = block.cameras[0].focal_length_mm / read.cameras[0].focal_length_mm
    rays = read.image_points
    return replace(read, image_points=type(rays)(rays.image, rays.point, scale * rays.xy, rays.sigma))
