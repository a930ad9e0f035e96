"""Bundler v0.3: conventions on a file computed by hand, there and back, damaged files."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import CAMERA, oriented_sample, prediction

from aerotri.conventions import InputError
from aerotri.formats.foreign.bundler import is_bundler, read_bundler, write_bundler
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Prior

# two cameras look down from 10 over the origin and over (1, 0), the third is not oriented
BUNDLE = """\
# Bundle file v0.3
3 2
100 0.1 0
1 0 0
0 1 0
0 0 1
0 0 -10
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
100 0.1 0
1 0 0
0 1 0
0 0 1
-1 0 -10
1 2 0
255 0 0
2 0 5 10.05 20.1 2 7 1 2
0.5 0 1
0 255 0
2 0 6 5.5 0 2 8 -5.5 0
"""


@pytest.fixture
def folder(tmp_path):
    def write(bundle=BUNDLE, names="images/a.jpg 0 100.5\nimages/b.jpg\nimages/c d.jpg\n"):
        (tmp_path / "bundle.out").write_text(bundle)
        if names is not None:
            (tmp_path / "list.txt").write_text(names)
        return tmp_path

    return write


def test_conventions(folder):
    reading = read_bundler(folder(), pixel_um=2.0)
    block = reading.block
    assert block.images.names.tolist() == ["a.jpg", "c d.jpg"]
    np.testing.assert_allclose(block.images.centre, [[0, 0, 10], [1, 0, 10]])
    np.testing.assert_allclose(block.images.angles, 0)
    # both have the same f, k1, k2
    assert len(block.cameras) == 1
    assert block.cameras[0].size_px == (22, 42)
    assert block.cameras[0].lens == {"k1": Prior(0.1), "k2": Prior(0.0)}
    assert block.cameras[0].focal_length_mm == pytest.approx(0.2)
    np.testing.assert_allclose(block.image_points.xy[0], [0.0201, 0.0402])
    assert reading.points is not None
    np.testing.assert_array_equal(reading.points, [[1, 2, 0], [0.5, 0, 1]])
    assert reading.messages == ("left out: 1 photograph that Bundler did not orient",)
    # p = (0.1, 0.2), p' = 100·(1 + 0.1·0.05)·p
    np.testing.assert_allclose(prediction(block, reading.points)[0], [0.0201, 0.0402], rtol=1e-12)
    assert is_bundler(folder())
    stated = read_bundler(folder() / "bundle.out", size_px=(100, 80))
    assert stated.block.cameras[0].size_px == (100, 80)


def test_photographs_without_a_list_have_numbers(folder):
    reading = read_bundler(folder(names=None))
    assert reading.block.images.names.tolist() == ["0", "2"]
    assert reading.messages[0] == "there is no list.txt: photographs are called by their numbers from 0"


def test_a_track_with_two_points_of_a_photograph(folder):
    reading = read_bundler(folder(BUNDLE.replace("2 0 5 10.05 20.1 2 7 1 2", "3 0 5 10.05 20.1 2 7 1 2 0 9 3 3")))
    assert len(reading.block.image_points) == 4
    assert "left out: 1 repeated measurement of a point in the same photograph" in reading.messages


def test_there_and_back(tmp_path):
    camera = replace(CAMERA, lens={"k1": Prior(-0.05), "k2": Prior(0.01)})
    oriented = oriented_sample(camera)
    block = replace(
        oriented.block,
        image_points=replace(oriented.block.image_points, xy=prediction(oriented.block, oriented.points)),
    )
    said = write_bundler(replace(oriented, block=block), tmp_path / "model")
    assert "could not be carried over: 4 control and check points" in said
    reading = read_bundler(tmp_path / "model", 5.0, (8000, 6000))
    again = reading.block
    assert again.images.names.tolist() == block.images.names.tolist()
    assert again.cameras[0].size_px == (8000, 6000)
    np.testing.assert_allclose(again.images.centre, block.images.centre, rtol=0, atol=1e-10)
    np.testing.assert_allclose(rotation_from_angles(again.images.angles), oriented.rotation, rtol=0, atol=1e-14)
    assert reading.points is not None
    predicted = prediction(again, reading.points)
    np.testing.assert_allclose(again.image_points.xy, predicted, rtol=0, atol=1e-10)
    assert len(predicted) == len(block.image_points)


def test_principal_point_is_taken_off(tmp_path):
    interior = CAMERA.interior | {"x0_mm": Prior(0.3, fixed=True), "y0_mm": Prior(-0.2, fixed=True)}
    write_bundler(oriented_sample(replace(CAMERA, interior=interior)), tmp_path / "model")
    reading = read_bundler(tmp_path / "model", 5.0)
    assert reading.points is not None
    np.testing.assert_allclose(reading.block.image_points.xy, prediction(reading.block, reading.points), atol=1e-10)


def test_lens_that_bundler_does_not_have(tmp_path):
    oriented = oriented_sample(replace(CAMERA, lens={"p1": Prior(1e-4)}))
    with pytest.raises(InputError, match="has lens parameter p1"):
        write_bundler(oriented, tmp_path / "model")


WRONG = {
    "no header": (BUNDLE[2:], 1, "is no Bundler file of version 0.3"),
    "version": (BUNDLE.replace("v0.3", "v0.4"), 1, "is no Bundler file of version 0.3"),
    "counts": (BUNDLE.replace("3 2\n", "3 -2\n"), 2, "'-2' is no count"),
    "huge counts": (BUNDLE.replace("3 2\n", "3 2000000\n"), 23, "cut off"),
    "cut off": (BUNDLE[:-8], 23, "cut off"),
    "too long": (BUNDLE + "1 2 3\n", 24, "comes after the last point"),
    "word": (BUNDLE.replace("10.05", "10,05"), 20, "'10,05' is not a number"),
    "nan": (BUNDLE.replace("10.05", "nan"), 20, "'nan' is not a finite number"),
    "camera": (BUNDLE.replace("2 7 1 2", "3 7 1 2"), 20, "'3' is not the number of a camera of the file"),
    "views": (BUNDLE.replace("2 0 5 10.05", "2.5 0 5 10.05"), 20, "'2.5' is no count"),
    "far": (BUNDLE.replace("20.1", "2e200"), 20, "is not possible"),
    "rotation": (BUNDLE.replace("1 0 0\n0 1 0", "1 0 0\n0 2 0", 1), 4, "is not a rotation"),
    "rotation overflow": (BUNDLE.replace("1 0 0\n0 1 0", "1 0 0\n0 1e200 0", 1), 5, "is not possible"),
    "focal length": (BUNDLE.replace("100 0.1", "-100 0.1", 1), 3, "is not a possible principal distance"),
    "no image points of oriented": (
        BUNDLE.replace("2 0 5 10.05 20.1 2 7 1 2", "0").replace("2 0 6 5.5 0 2 8 -5.5 0", "0"),
        None,
        "no image points of oriented",
    ),
    "not utf-8": (BUNDLE.encode() + b"\xff", 24, "is not a number"),
}


@pytest.mark.parametrize(("content", "line", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, content, line, says):
    (tmp_path / "bundle.out").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_bundler(tmp_path)
    assert caught.value.line == line


def test_list_that_does_not_belong(folder):
    with pytest.raises(InputError, match=r"list\.txt: names 2 photographs, bundle\.out has 3"):
        read_bundler(folder(names="a\nb\n"))
    with pytest.raises(InputError, match=r"list\.txt:3: photograph 'a' is there twice"):
        read_bundler(folder(names="a\nb\nx/a\n"))
