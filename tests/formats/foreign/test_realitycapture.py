"""RealityCapture's list of registrations: rotations about one axis at a time, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import ORIENTATIONS, kind_of
from aerotri.formats.foreign.realitycapture import read_realitycapture

LIST = """\
#cameras 4
#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2
a.jpg,500000.5,5400000.25,400.125,0,0,0,24.5,0.001,-0.002,-0.05,0.01,0,0,0.001,-0.0002
b.jpg,500010,5400000,400,90,0,0,24.5,0.001,-0.002,-0.05,0.01,0,0,0.001,-0.0002
c.jpg,500020,5400000,400,0,30,0,24.5,0.001,-0.002,-0.05,0.01,0,0,0.001,-0.0002
d.jpg,500030,5400000,400,-20,35,10,24.5,0.001,-0.002,-0.05,0.01,0,0,0.001,-0.0002
"""


def about(axis: str, degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array({
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis])  # fmt: skip


def test_rotations(tmp_path):
    path = tmp_path / "registrations.csv"
    path.write_text(LIST)
    assert kind_of(path, ORIENTATIONS) == "realitycapture"
    found = read_realitycapture(path)
    assert found.images.tolist() == ["a.jpg", "b.jpg", "c.jpg", "d.jpg"]
    np.testing.assert_array_equal(found.centre[0], [500000.5, 5400000.25, 400.125])
    a, b, c, d = found.rotation
    np.testing.assert_allclose(a, np.eye(3), atol=1e-15)
    # the top of the photograph points east
    np.testing.assert_allclose(b @ [0, 1, 0], [1, 0, 0], atol=1e-15)
    # it looks forwards, to the north
    np.testing.assert_allclose(c @ [0, 0, -1], [0, 0.5, -np.sqrt(0.75)], atol=1e-15)
    np.testing.assert_allclose(d, about("z", 20) @ about("x", 35) @ about("y", 10), atol=1e-15)
    assert "not used: f, px, py, k1" in found.messages[0]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("500010,5400000,400,90,0,0", "500010,5400000", "the row has"),
        ("500010,", "x,", "not a number"),
        ("b.jpg", "a.jpg", "a.jpg"),
    ],
)
def test_errors(tmp_path, old, new, says):
    path = tmp_path / "registrations.csv"
    text = LIST.replace(old, new)
    if "the row has" in says:
        text = "\n".join(line[:20] if line.startswith("b.jpg") else line for line in text.splitlines())
    path.write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        read_realitycapture(path)
    assert caught.value.line == 4
    assert caught.value.remedy


@pytest.mark.parametrize("head", ["", "#cameras 4\n", "#name,x,y,alt,yaw,pitch,roll\n"])
def test_a_list_without_names_of_its_columns(tmp_path, head):
    path = tmp_path / "registrations.csv"
    path.write_text(head + LIST.partition("roll,f,px,py,k1,k2,k3,k4,t1,t2\n")[2])
    with pytest.raises(InputError, match="does not name its columns") as caught:
        read_realitycapture(path)
    assert "name,x,y,alt,heading,pitch,roll" in caught.value.remedy
