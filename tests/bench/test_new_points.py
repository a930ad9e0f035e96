"""New tie, control and check points of the bench: in the journal, in the next adjustment, taken back by undo."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block


@pytest.fixture
def again(bench):
    """Marks of a tie point of the block, of which a new point is made at the same places."""
    block = bench.records.block
    point = int(np.argmax(np.bincount(block.image_points.point)))
    rays = bench.point(point)["rays"]
    return list(zip(rays["image"], map(tuple, rays["px"]), strict=True)), bench.records.xyz[point]


def test_new_tie_point_is_where_its_marks_meet(bench, again):
    marks, xyz = again
    for image, px in marks[:2]:
        said = bench.measuring.mark(image, "new 1", px)
    assert [(one["kind"], one["name"]) for one in said["changes"]] == [("new", "new 1")] * 2
    bench.adjust()
    bench.wait()
    assert bench.state()["job"]["error"] == ""
    found = bench.records.xyz[bench.records.block.points.tolist().index("new 1")]
    assert found == pytest.approx(xyz, abs=1.0)
    assert bench.measuring.edits()["changes"] == []


@pytest.mark.parametrize(("action", "is_check"), [("new_control", False), ("new_check", True)])
def test_new_control_is_in_the_block_until_it_is_taken_back(bench, again, action, is_check):
    marks, xyz = again
    given = (*xyz.tolist(), 0.02, 0.02, 0.03)
    said = bench.measuring.give("new 2", action, given)
    assert [(one["kind"], one["name"]) for one in said["changes"]] == [(action, "new 2")]
    for image, px in marks:
        bench.measuring.mark(image, "new 2", px)
    block = read_block(bench.places.block)
    row = block.points[block.control.point].tolist().index("new 2")
    assert block.control.xyz[row] == pytest.approx(xyz, abs=1e-4)
    assert block.control.sigma[row] == pytest.approx([0.02, 0.02, 0.03])
    assert bool(block.control.is_check[row]) is is_check
    bench.adjust()
    bench.wait()
    assert bench.measuring.edits()["changes"] == []
    control = bench.records.block.points[bench.records.block.control.point].tolist()
    assert np.isfinite(bench.records.differences[control.index("new 2")]).all()
    for _ in range(len(marks) + 1):
        bench.measuring.undo()
    block = read_block(bench.places.block)
    assert "new 2" not in block.points.tolist()
    assert not bench.measuring.edits()["can_undo"]


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("", (1.0, 2.0, 3.0, 0.1, 0.1, 0.1), "needs a name"),
        ("new", (1.0, 2.0, 3.0, 0.1, 0.0, 0.1), "not above 0"),
        ("new", (1.0, 2.0, 3.0), "not above 0"),
    ],
)  # fmt: skip
def test_points_that_cannot_be(bench, name, given, message):
    with pytest.raises(InputError, match=message):
        bench.measuring.give(name, "new_control", given)
    block = bench.records.block
    with pytest.raises(InputError, match="already"):
        bench.measuring.give(str(block.points[block.control.point[0]]), "new_control", (1.0, 2.0, 3.0, 0.1, 0.1, 0.1))
    assert not bench.places.bench.exists()


def test_row_without_a_coordinate_is_told_with_its_line(bench, again):
    bench.measuring.give("new 3", "new_control", (1.0, 2.0, 3.0, 0.1, 0.1, 0.1))
    path = bench.places.block / "edits.csv"
    path.write_text(path.read_text().replace(",3.00000,0.1", ",,0.1"))
    with pytest.raises(InputError, match=r"edits\.csv:2: X, Y, Z or their σ are missing"):
        read_block(bench.places.block)
