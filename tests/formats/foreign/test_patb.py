"""PAT-B: there and back, and which way the rotations go."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import CAMERA, oriented_sample, without_orientation

from aerotri.conventions import InputError
from aerotri.formats.assembly.reprojection import settle
from aerotri.formats.foreign.patb import (
    is_patb_con,
    is_patb_im,
    is_patb_ori,
    read_patb_con,
    read_patb_im,
    read_patb_ori,
    write_patb,
)
from aerotri.observations import Prior

IM = """\
      101     152818.000
        1   -1000.5     2000.25  1
        2    3000.0    -4000.0   2
      -99
      102     152818.000
        1    1000.0     2000.0   1
      -99
      -99
"""
ORI = """\
             101                     1000.50000      2000.25000       600.12500
  0.000000000000 -1.000000000000  0.000000000000  1.000000000000  0.000000000000
  0.000000000000  0.000000000000  0.000000000000  1.000000000000
"""
CON = """\
   1  500000.5  5700000.25  100.125  1 1
   2  500010.0  5700010.0   0.0      1 0
   3  0.0       0.0         120.5    0 2
   4  1.0       2.0         3.0      0 0
 -99
"""


def test_conventions(tmp_path):
    for name, text in (("a.im", IM), ("a.ori", ORI), ("a.con", CON)):
        (tmp_path / name).write_text(text)
    rays = read_patb_im(tmp_path / "a.im")
    np.testing.assert_array_equal(rays.xy, [[-1.0005, 2.00025], [3, -4], [1, 2]])
    np.testing.assert_array_equal(rays.focal_length_mm, [152.818, 152.818])
    assert rays.images.tolist() == ["101", "102"]
    assert rays.messages == ("could not be carried over: the classes of the image points",)
    given = read_patb_ori(tmp_path / "a.ori")
    np.testing.assert_array_equal(given.centre, [[1000.5, 2000.25, 600.125]])
    assert [name for name, _ in given.choices] == ["camera-to-object", "object-to-camera"]
    # a quarter turn: the camera's x axis points along Y, or the other way
    np.testing.assert_array_equal(given.choices[0][1][0][:, 0], [0, 1, 0])
    np.testing.assert_array_equal(given.choices[1][1][0][:, 0], [0, -1, 0])
    assert read_patb_ori(tmp_path / "a.ori", "object-to-camera").choices == ()
    control = read_patb_con(tmp_path / "a.con")
    nan = np.nan
    np.testing.assert_array_equal(
        control.xyz, [[500000.5, 5700000.25, 100.125], [500010, 5700010, nan], [nan, nan, 120.5]]
    )
    assert control.messages[0] == "left out: 1 point of classes 0 0, which are not control"
    assert is_patb_im(tmp_path / "a.im")
    assert is_patb_ori(tmp_path / "a.ori")
    assert is_patb_con(tmp_path / "a.con")
    assert not is_patb_im(tmp_path / "a.con")


def test_millimetres_are_told_by_the_principal_distance(tmp_path):
    (tmp_path / "a.im").write_text(IM.replace("152818.000", "152.818"))
    rays = read_patb_im(tmp_path / "a.im")
    np.testing.assert_array_equal(rays.xy[0], [-1000.5, 2000.25])
    assert rays.focal_length_mm[0] == 152.818
    assert "taken as mm" in rays.messages[0]


@pytest.mark.parametrize("principal_point", [(0.0, 0.0), (0.2, -0.1)])
def test_there_and_back(tmp_path, principal_point):
    interior = CAMERA.interior | {
        k: Prior(v, fixed=True) for k, v in zip(("x0_mm", "y0_mm"), principal_point, strict=True)
    }
    oriented = oriented_sample(replace(CAMERA, interior=interior))
    block = oriented.block
    lost = write_patb(oriented, tmp_path / "patb")
    assert lost == (
        "could not be carried over: 1 check point",
        "could not be carried over: the standard deviations of 4 ground points (control and check)",
        "could not be carried over: 4 observations of GNSS and INS",
    )
    rays = read_patb_im(tmp_path / "patb" / "block.im")
    np.testing.assert_allclose(rays.xy + principal_point, block.image_points.xy, rtol=0, atol=5.1e-7)
    np.testing.assert_array_equal(rays.focal_length_mm, 40.0)
    given = read_patb_ori(tmp_path / "patb" / "block.ori", "camera-to-object")
    np.testing.assert_allclose(given.centre, oriented.centre, rtol=0, atol=5.1e-6)
    np.testing.assert_allclose(given.rotation, oriented.rotation, rtol=0, atol=5.1e-13)
    control = read_patb_con(tmp_path / "patb" / "block.con")
    assert control.points.tolist() == ["t0", "t7", "t13"]
    np.testing.assert_allclose(control.xyz, block.control.xyz[:3], rtol=0, atol=5.1e-6)
    lines = (tmp_path / "patb" / "block.ori").read_text().splitlines()
    # I16,16x,3F16.5 / 5F16.12 / 4F16.12
    assert [len(line) for line in lines[:3]] == [80, 80, 64]
    assert lines[0][:32] == "          p0.jpg                "


def test_long_names_become_numbers(tmp_path):
    oriented = oriented_sample()
    names = np.array([f"DJI_20211224092312_{i}.JPG" for i in range(4)])
    block = replace(oriented.block, images=replace(oriented.block.images, names=names))
    lost = write_patb(replace(oriented, block=block), tmp_path / "patb")
    assert lost[-1] == "4 names are too long for PAT-B and replaced by numbers, see names.csv"
    assert read_patb_im(tmp_path / "patb" / "block.im").images.tolist() == ["1", "2", "3", "4"]
    assert (tmp_path / "patb" / "names.csv").read_text().splitlines()[1] == 'photo,1,"DJI_20211224092312_0.JPG"'


def test_what_is_not_oriented_is_left_out(tmp_path):
    oriented = oriented_sample()
    block = without_orientation(oriented.block)
    bare = replace(oriented, block=block, centre=np.full((4, 3), np.nan), rotation=np.full((4, 3, 3), np.nan))
    lost = write_patb(bare, tmp_path / "patb")
    assert lost[-1] == "could not be carried over: 4 photographs without orientation"
    assert not (tmp_path / "patb" / "block.ori").exists()


@pytest.mark.parametrize("way", ["camera-to-object", "object-to-camera"])
def test_reprojection_settles_which_way_rotations_go(tmp_path, way):
    """Written the one way or the other, the image points tell."""
    oriented = oriented_sample()
    turned = oriented.rotation if way == "camera-to-object" else np.swapaxes(oriented.rotation, 1, 2)
    write_patb(replace(oriented, rotation=turned), tmp_path / "patb")
    given = read_patb_ori(tmp_path / "patb" / "block.ori")
    name, said = settle(oriented.block, given.centre, dict(given.choices), "state it")
    assert name == way
    np.testing.assert_allclose(dict(given.choices)[name], oriented.rotation, atol=1e-12)
    assert re.search(rf"rotations are {way}, by the median residual of the image points: {way} [\d.e-]+ px", said)


def test_what_cannot_be_settled_is_an_error():
    oriented = oriented_sample()
    same = {"one": oriented.rotation, "other": oriented.rotation @ np.eye(3)}
    with pytest.raises(InputError, match="none fits the image points clearly better"):
        settle(oriented.block, oriented.centre, same, "state it")
    rays = replace(
        oriented.block.image_points,
        **{k: getattr(oriented.block.image_points, k)[:3] for k in ("image", "point", "xy", "sigma")},
    )
    few = replace(oriented.block, image_points=rays)
    with pytest.raises(InputError, match="too few points are measured"):
        settle(few, oriented.centre, same, "state it")


WRONG_IM = {
    "no head": ("1 2 3\n", 1, "begins no photograph"),
    "cut off": (IM[: IM.index("      -99")], 3, "photograph '101' does not end"),
    "row": (IM.replace("-1000.5     2000.25  1", "-1000.5"), 2, "has 2 entries"),
    "number": (IM.replace("2000.25", "2000,25"), 2, "'2000,25' is not a number"),
    "photograph twice": (IM.replace("  102 ", "  101 "), 5, "'101' is there twice"),
    "point twice": (IM.replace("        2 ", "        1 "), 3, "point '1' in photograph '101' is there twice"),
    "principal distance": (IM.replace("152818.000", "-152818.0", 1), 1, "is not greater than 0"),
    "far": (IM.replace("2000.25", "2e13"), 2, "outside of any image"),
}
WRONG_ORI = {
    "empty": ("", 1, "is empty"),
    "cut off": (ORI[:200], 3, "has 3 entries, not 4"),
    "cut between rows": (ORI[: ORI.rindex("\n", 0, -1) + 1], 2, "ends within a photograph"),
    "twice": (ORI + ORI, 4, "'101' is there twice"),
    "number": (ORI.replace("600.12500", "********"), 1, "'********' is not a number"),
    "no rotation": (ORI.replace("-1.000000000000", "-0.900000000000"), 2, "is no rotation"),
    "mirrored": (ORI.replace("-1.000000000000", " 1.000000000000"), 2, "is no rotation"),
}
WRONG_CON = {
    "row": (CON.replace("0 2\n", "0\n"), 3, "is no control point"),
    "class": (CON.replace("0 2\n", "0 x\n"), 3, "is no control point"),
    "twice": (CON.replace("   2  ", "   1  "), 2, "point '1' is there twice"),
    "number": (CON.replace("100.125", "1oo"), 1, "'1oo' is not a number"),
}


@pytest.mark.parametrize(
    ("reader", "content", "line", "says"),
    [
        *(pytest.param(read_patb_im, *case, id=f"im: {name}") for name, case in WRONG_IM.items()),
        *(pytest.param(read_patb_ori, *case, id=f"ori: {name}") for name, case in WRONG_ORI.items()),
        *(pytest.param(read_patb_con, *case, id=f"con: {name}") for name, case in WRONG_CON.items()),
    ],
)
def test_errors(tmp_path, reader, content, line, says):
    (tmp_path / "bad").write_text(content)
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        reader(tmp_path / "bad")
    assert line is None or caught.value.line == line
