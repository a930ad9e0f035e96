"""BINGO image coordinates: the real file, and what is wrong with others."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample

from aerotri.conventions import InputError
from aerotri.formats.foreign.bingo import format_in_name, is_bingo, read_bingo, write_bingo

SMALL = """\
a.jpg H_40.0_30.0

1 1.5 -2.25
GCP_1 -3 4e0
-99
b.jpg H_40.0_30.0
1 0.5 +.25
-99
"""


def test_the_real_file(shared_data):
    """Counts of the file: 581 heads, 108 226 rows of three words, among them 135 of the 14 ground points."""
    rays = read_bingo(shared_data("cu_sbr_p1") / "tp_bingo.txt")
    assert (len(rays.images), len(rays.image), len(rays.points)) == (581, 108226, 13953)
    assert set(rays.cameras.tolist()) == {"H_34.99999_23.32763"}
    assert rays.images[0] == "DJI_20211224092312_0125"
    assert rays.points[rays.point[0]] == "1203"
    np.testing.assert_array_equal(rays.xy[0], [10.33879, 1.80670])
    ground = np.char.startswith(rays.points, "GCP_")
    assert (ground.sum(), ground[rays.point].sum()) == (14, 135)
    assert np.abs(rays.xy).max() < 17.5


def test_real_file_comes_back(shared_data, tmp_path):
    path = shared_data("cu_sbr_p1") / "tp_bingo.txt"
    rays = read_bingo(path)
    camera = replace(oriented_sample().block.cameras[0], name="H_34.99999_23.32763")
    sample = oriented_sample().block
    images = replace(
        sample.images, names=rays.images, camera=np.zeros(581, int), centre=np.full((581, 3), np.nan),
    )  # fmt: skip
    points = replace(sample.image_points, image=rays.image, point=rays.point, xy=rays.xy, sigma=np.ones_like(rays.xy))
    block = replace(sample, cameras=(camera,), images=images, points=rays.points, image_points=points)
    write_bingo(block, tmp_path / "again.txt")
    again = read_bingo(tmp_path / "again.txt")
    np.testing.assert_array_equal(again.xy, rays.xy)
    assert again.points[again.point].tolist() == rays.points[rays.point].tolist()
    assert again.images[again.image].tolist() == rays.images[rays.image].tolist()


def test_small(tmp_path):
    (tmp_path / "small.txt").write_text(SMALL)
    rays = read_bingo(tmp_path / "small.txt")
    assert rays.images.tolist() == ["a.jpg", "b.jpg"]
    assert rays.image.tolist() == [0, 0, 1]
    assert rays.points[rays.point].tolist() == ["1", "GCP_1", "1"]
    np.testing.assert_array_equal(rays.xy, [[1.5, -2.25], [-3, 4], [0.5, 0.25]])
    assert rays.unit == "mm"
    assert is_bingo(tmp_path / "small.txt")
    assert format_in_name("H_40.0_30.0") == (40.0, 30.0)
    assert format_in_name("P1") is None


def test_what_is_lost_is_said(tmp_path):
    block = oriented_sample().block
    assert write_bingo(block, tmp_path / "out.txt") == (
        "could not be carried over: 1 camera, except the name",
        "could not be carried over: 4 orientations",
        "could not be carried over: 3 control points",
        "could not be carried over: 1 check point",
        "could not be carried over: the standard deviations of 4 ground points (control and check)",
        "could not be carried over: 4 observations of GNSS and INS",
    )
    again = read_bingo(tmp_path / "out.txt")
    np.testing.assert_allclose(again.xy, block.image_points.xy, rtol=0, atol=5.1e-7)
    names = replace(block.images, names=np.array(["a b", "c", "d", "e"]))
    with pytest.raises(InputError, match="has a blank in its name, which BINGO cannot hold"):
        write_bingo(replace(block, images=names), tmp_path / "bad.txt")


WRONG = {
    "empty": ("", None, "is empty"),
    "no head": ("1 2 3\n", 1, "does not end"),
    "head of one word": (SMALL.replace("a.jpg H_40.0_30.0", "a.jpg"), 1, "begins no photograph"),
    "row too short": (SMALL.replace("1 1.5 -2.25", "1 1.5"), 3, "has 2 entries"),
    "row too long": (SMALL.replace("1 1.5 -2.25", "1 1.5 2 3"), 3, "has 4 entries"),
    "no end": (SMALL[:-4], 7, "photograph 'b.jpg' does not end"),
    "end missing": (SMALL.replace("-99\nb", "b"), 5, "has 2 entries"),
    "not a number": (SMALL.replace("-2.25", "2,25"), 3, "image coordinate '2,25' is not a number"),
    "underscore": (SMALL.replace("-2.25", "2_2"), 3, "'2_2'"),
    "nan": (SMALL.replace("-2.25", "nan"), 3, "'nan' is not a number"),
    "far": (SMALL.replace("-2.25", "2e9"), 3, "outside of any image"),
    "photograph twice": (SMALL.replace("b.jpg", "a.jpg"), 6, "photograph 'a.jpg' is there twice, first in line 1"),
    "point twice": (SMALL.replace("GCP_1", "1"), 4, "twice in photograph 'a.jpg', first in line 3"),
    "control character": (SMALL.replace("GCP_1", "G\x00"), 4, "cannot be the name of a point"),
    "nothing measured": ("a.jpg cam\n-99\n", 1, "holds no image points"),
    "not utf-8": (SMALL.replace("GCP", "GÖP").encode("latin-1"), 4, "is not UTF-8"),
}


@pytest.mark.parametrize(("content", "line", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, content, line, says):
    path = tmp_path / "bad.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_bingo(path)
    assert caught.value.line == line
    assert caught.value.remedy
