"""edits.csv as a journal: later rows overrule earlier ones, `undo` takes back, marks change the image points."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError, mm_from_px
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.block.journal import standing_rows

HEAD = "time,image,point,action,column,row,old_column,old_row,reason\n"


def journal(*rows: str) -> dict[str, str]:
    return {"edits.csv": HEAD + "".join(f"2026-01-01T00:00:00,{row}\n" for row in rows)}


def ray(block, image: str, point: str) -> np.ndarray:
    rays = block.image_points
    own = (block.images.names[rays.image] == image) & (block.points[rays.point] == point)
    return rays.xy[own]


def px(block, column: float, row: float) -> np.ndarray:
    camera = block.cameras[0]
    return mm_from_px(np.array([[column, row]]), camera.size_px, camera.pixel_mm)


def test_mark_moves_a_ray_and_keeps_its_sigma(small_block):
    before, after = read_block(small_block()), read_block(small_block(journal("a,p1,mark,4000.25,3000.5,1,2,")))
    assert ray(after, "a", "p1") == pytest.approx(px(after, 4000.25, 3000.5), abs=1e-9)
    assert len(after.image_points) == len(before.image_points)
    np.testing.assert_array_equal(after.image_points.sigma, before.image_points.sigma)
    assert after.edits is None


def test_mark_sets_a_ray_of_a_known_and_of_a_new_point(small_block):
    before = read_block(small_block())
    after = read_block(small_block(journal("b,p9,mark,100,200,,,", "b,new one,mark,300,400,,,")))
    assert len(after.image_points) == len(before.image_points) + 2
    assert ray(after, "b", "p9") == pytest.approx(px(after, 100, 200), abs=1e-9)
    assert ray(after, "b", "new one") == pytest.approx(px(after, 300, 400), abs=1e-9)
    assert after.points.tolist() == [*before.points.tolist(), "new one"]
    assert np.isfinite(after.image_points.sigma).all()


def test_remove_takes_a_ray_out_and_undo_brings_it_back(small_block):
    before = read_block(small_block())
    removed = read_block(small_block(journal("a,p1,remove,,,,,blurred")))
    assert len(ray(removed, "a", "p1")) == 0
    assert len(removed.image_points) == len(before.image_points) - 1
    again = read_block(small_block(journal("a,p1,remove,,,,,blurred", ",,undo,,,,,")))
    np.testing.assert_array_equal(again.image_points.xy, before.image_points.xy)


def test_later_rows_overrule_earlier_ones(small_block):
    rows = ("a,p1,off,,,,,one", "a,p1,off,,,,,two", ",p1,check,,,,,three", ",p1,on,,,,,four", "a,p2,off,,,,,five")
    edits = read_block(small_block(journal(*rows))).edits
    assert edits is not None
    assert edits.reason.tolist() == ["two", "five"]


def test_off_of_a_ray_removed_later_says_nothing(small_block):
    block = read_block(small_block(journal("a,p1,off,,,,,", "a,p1,remove,,,,,")))
    assert block.edits is None


def test_block_of_a_journal_is_written_as_it_is_in_the_end(small_block, tmp_path):
    block = read_block(small_block(journal("a,p1,mark,4000,3000,,,", "a,p2,off,,,,,twice")))
    write_block(block, tmp_path / "again")
    again = read_block(tmp_path / "again")
    assert ray(again, "a", "p1") == pytest.approx(ray(block, "a", "p1"), abs=1e-9)
    assert again.edits is not None
    assert again.edits.reason.tolist() == ["twice"]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("a,p1,mark,,,,,", "without column and row"),
        ("a,p1,mark,1e6,10,,,", "lies outside of the photograph"),
        (",p1,mark,10,10,,,", "without a photograph"),
        ("c,p1,mark,10,10,,,", "photograph 'c' is not in the table"),
        (",,undo,,,,,", "undo takes nothing back"),
        ("a,,mark,10,10,,,", "point is empty"),
        ("a,p1,move,10,10,,,", "action = 'move'"),
    ],
)
def test_rows_that_mean_nothing_are_told_with_their_line(small_block, row, message):
    with pytest.raises(InputError, match=message) as caught:
        read_block(small_block(journal(row)))
    assert "edits.csv:2" in str(caught.value)


def test_standing_rows():
    assert standing_rows(["off", "mark", "undo", "undo", "mark"]) == [4]
    assert standing_rows(["off", "undo", "undo"]) is None
    assert standing_rows([]) == []
