"""Marks of control and check points cut out of photographs: the right pixels, the right places, what is not shown."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import aerotri
from aerotri import InputError
from aerotri.cli.app import invoke
from aerotri.conventions import px_from_mm
from aerotri.formats.block.folder import write_block
from aerotri.report import mark_pictures as module
from aerotri.report.mark_pictures import SIZE, mark_pictures

SPEC = Path(__file__).parents[2] / "blocks" / "drone_site" / "simulation.toml"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A block of small photographs, adjusted; and photographs that are black but for a white pixel at every mark."""
    block = aerotri.simulate(SPEC, seed=3).block
    folder = tmp_path_factory.mktemp("marks") / "photographs"
    folder.mkdir()
    rays, camera = block.image_points, block.cameras[0]
    at = np.floor(px_from_mm(rays.xy, camera.size_px, camera.pixel_mm)).astype(int)
    known = np.isin(rays.point, block.control.point)
    for image, name in enumerate(block.images.names.tolist()):
        pixels = np.zeros((camera.size_px[1], camera.size_px[0]), np.uint16)
        column, row = at[known & (rays.image == image)].T
        pixels[np.clip(row, 0, pixels.shape[0] - 1), np.clip(column, 0, pixels.shape[1] - 1)] = 4000
        Image.fromarray(pixels).save(folder / f"{Path(name).stem}.tif")
    return aerotri.adjust(block, explain=False), folder


def pixels_of(cut):
    content = base64.b64decode(cut.picture.removeprefix("data:image/jpeg;base64,"))
    return np.asarray(Image.open(io.BytesIO(content)).convert("L")).astype(int)


def test_the_mark_is_in_the_middle(flown):
    result, folder = flown
    found = mark_pictures(result.adjusted, [folder])
    block = result.block
    known = np.isin(block.image_points.point, block.control.point)
    assert sum(len(one.cut_outs) for one in found.points) == known.sum()
    assert not found.notes
    cuts = [cut for one in found.points for cut in one.cut_outs]
    middle = SIZE // 2
    around = []
    for cut in cuts:
        pixels = pixels_of(cut)
        assert pixels.shape == (SIZE, SIZE)
        assert np.floor(cut.measured).tolist() == [middle, middle]
        assert pixels[middle, middle] > 150
        around.append(pixels[middle - 3 : middle + 4, middle - 3 : middle + 4])
    # of all marks together the middle pixel alone is bright: none is a pixel off
    mean = np.mean(around, axis=0)
    mean[3, 3] = 0.0
    assert mean.max() < 80


def test_adjusted_place_and_order(flown):
    result, folder = flown
    found = mark_pictures(result.adjusted, [folder])
    largest = [one.largest for one in found.points]
    assert largest == sorted(largest, reverse=True)
    for one in found.points:
        assert one.largest == pytest.approx(max(abs(w) for cut in one.cut_outs for w in cut.w))
        for cut in one.cut_outs:
            # y of the residual points up, rows down
            shift = np.subtract(cut.adjusted, cut.measured)
            assert shift == pytest.approx([cut.v_px[0], -cut.v_px[1]])
    roles = {one.point: one.role for one in found.points}
    names = result.block.points[result.adjusted.check.point].tolist()
    assert names
    assert all(roles[name] == "check" for name in names if name in roles)


def test_what_is_not_shown_is_told(flown, tmp_path, monkeypatch):
    result, folder = flown
    files = sorted(folder.iterdir())
    Image.new("L", (10, 10)).save(tmp_path / files[0].name)
    found = mark_pictures(result.adjusted, [tmp_path, *files[2:]])
    text = " ".join(found.notes)
    assert "has 10 × 10 pixels, its camera" in text
    assert "Not found: 1 photograph" in text
    monkeypatch.setattr(module, "MOST", 5)
    few = mark_pictures(result.adjusted, [folder])
    assert sum(len(one.cut_outs) for one in few.points) == 5
    assert "The first 5 of" in few.notes[0]
    with pytest.raises(InputError, match="is not there"):
        result.save(tmp_path / "result", photographs=tmp_path / "none")


def test_on_the_page(flown, tmp_path):
    result, folder = flown
    result.save(tmp_path / "result", photographs=folder)
    page = (tmp_path / "result" / "report.html").read_text(encoding="utf-8")
    marks = int((np.isin(result.block.image_points.point, result.block.control.point)).sum())
    assert page.count("data:image/jpeg;base64,") == marks
    # many: folded, one fold a point
    assert marks > module.OPEN
    assert not re.search(r"<details open", page)
    result.save(tmp_path / "bare")
    assert 'id="marks"' not in (tmp_path / "bare" / "report.html").read_text(encoding="utf-8")


def test_command(flown, tmp_path):
    result, folder = flown
    write_block(result.block, tmp_path / "block")
    assert not invoke(["adjust", str(tmp_path / "block"), "--out", str(tmp_path / "out"), "--photos", str(folder)])
    assert 'id="marks"' in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="is not there"):
        invoke(["adjust", str(tmp_path / "block"), "--out", str(tmp_path / "o2"), "--photos", str(tmp_path / "x")])


def test_without_control_there_is_no_section(flown):
    result, folder = flown
    block = result.block
    bare = replace(block, control=block.control.empty(), gnss_ins=None)
    adjusted = replace(result.adjusted, block=bare, control=_none(result.adjusted.control),
                       check=_none(result.adjusted.check))  # fmt: skip
    found = mark_pictures(adjusted, [folder])
    assert found.points == ()
    assert found.notes == ()


def _none(points):
    nothing = slice(0, 0)
    return replace(
        points, point=points.point[nothing], difference=points.difference[nothing], sigma=points.sigma[nothing],
        r=points.r[nothing], w=points.w[nothing], rays=points.rays[nothing],
    )  # fmt: skip
