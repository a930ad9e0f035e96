"""BAL files: the initial cost is met by an independent evaluation, and writing loses nothing."""

from __future__ import annotations

import contextlib
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aerotri.conventions import InputError
from aerotri.formats.assembly.oriented import oriented_block
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.foreign.bal import read_bal, write_bal
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, Prior

SMALL = """2 3 4
0 0     -3.859900e+02 3.871200e+02
1 0     -3.844000e+01 4.921200e+02
0 1 1.5 2.5
1 2 -7 8e1
""" + "\n".join(
    ["0.01", "-0.02", "0.03", "1", "2", "3", "400", "-1e-7", "1e-13"]
    + ["0", "0", "0", "-1", "0.5", "3", "450", "0", "0"]
    + ["1", "2", "-30", "0", "0", "-20", "5", "5", "-40"]
)


def cost(block: Block, points: np.ndarray) -> float:
    """½Σr² in pixels, from the records by the collinearity equations and the forward lens alone."""
    rays = block.image_points
    rotation = rotation_from_angles(block.images.angles, block.rotation)[rays.image]
    u = np.einsum("mji,mj->mi", rotation, points[rays.point] - block.images.centre[rays.image])
    tangents = -u[:, :2] / u[:, 2:]
    rho2 = np.sum(tangents**2, axis=1)
    camera = [block.cameras[c] for c in block.images.camera]
    c, k1, k2, pixel = np.array(
        [[k.focal_length_mm, k.lens["k1"].value, k.lens["k2"].value, k.pixel_mm] for k in camera]
    )[rays.image].T
    predicted = (c * (1.0 + k1 * rho2 + k2 * rho2**2))[:, None] * tangents
    return 0.5 * float(np.sum(((rays.xy - predicted) / pixel[:, None]) ** 2))


@pytest.mark.parametrize(("name", "expected"), [("49-7776", 8.509125e5), ("16-22106", 4.185660e6)])
def test_initial_cost(shared_data, tmp_path, name, expected):
    """Initial costs printed by Ceres' bundle adjuster for these problems."""
    block, points = read_bal(shared_data("bal") / f"problem-{name}-pre.txt")
    assert cost(block, points) == pytest.approx(expected, rel=2e-7)
    assert block.settings.adjustment.datum == "minimal"
    assert block.settings.adjustment.additional_parameters == (("lens", ("k1", "k2")),)
    assert write_bal(oriented_block(block, points), tmp_path / "again.txt") == ()
    again, same = read_bal(tmp_path / "again.txt")
    np.testing.assert_array_equal(same, points)
    np.testing.assert_array_equal(again.image_points.xy, block.image_points.xy)
    np.testing.assert_array_equal(again.image_points.point, block.image_points.point)
    np.testing.assert_allclose(again.images.centre, block.images.centre, rtol=0, atol=1e-13)
    np.testing.assert_allclose(again.images.angles, block.images.angles, rtol=0, atol=1e-14)
    assert again.cameras == block.cameras


def test_block_folder_of_bal(shared_data, tmp_path):
    block, points = read_bal(shared_data("bal") / "problem-49-7776-pre.txt")
    write_block(block, tmp_path / "block")
    again = read_block(tmp_path / "block")
    order = np.array([int(name) for name in again.points])
    assert cost(again, points[order]) == pytest.approx(cost(block, points), rel=1e-12)


@pytest.fixture
def small(tmp_path):
    (tmp_path / "small.txt").write_text(SMALL)
    return read_bal(tmp_path / "small.txt")


def test_conventions(small):
    block, points = small
    np.testing.assert_array_equal(points, [[1, 2, -30], [0, 0, -20], [5, 5, -40]])
    # no rotation: t = −X0, the camera axes are those of the object
    np.testing.assert_allclose(block.images.centre[1], [1, -0.5, -3])
    np.testing.assert_allclose(block.images.angles[1], 0)
    camera = block.cameras[0]
    assert camera.pixel_um == 1000.0
    assert camera.size_px == (772, 776)
    assert camera.interior["focal_length_mm"] == Prior(400.0)
    assert camera.interior["x0_mm"].kind == "fixed"
    assert camera.lens == {"k1": Prior(-1e-7), "k2": Prior(1e-13)}
    np.testing.assert_array_equal(block.image_points.sigma, 1.0)
    assert block.settings.image_sigma_um == 1000.0


def test_what_bal_cannot_hold_is_said(small, tmp_path):
    block, points = small
    points[2] = np.nan
    control = replace(
        block.control, point=np.array([0]), xyz=np.ones((1, 3)), sigma=np.ones((1, 3)), is_check=np.ones(1, bool)
    )
    lost = write_bal(oriented_block(replace(block, control=control), points), tmp_path / "out.txt")
    assert lost == (
        "could not be carried over: 1 control or check point",
        "could not be carried over: 1 image point not used in the adjustment, or of a photograph or point not adjusted",
    )
    again, same = read_bal(tmp_path / "out.txt")
    assert (len(again.image_points), len(same)) == (3, 2)
    lens = {**block.cameras[0].lens, "p1": Prior(0.1)}
    bad = replace(block, cameras=(replace(block.cameras[0], lens=lens), block.cameras[1]))
    with pytest.raises(InputError, match="has lens parameter p1"):
        write_bal(oriented_block(bad, points), tmp_path / "bad.txt")


def test_principal_point_and_brown_are_taken_off_the_image_points(small, tmp_path):
    """A camera with a principal point and Brown's errors, written and read, predicts the same ideal positions."""
    block, points = small
    camera = block.cameras[0]
    other = replace(
        camera,
        interior={**camera.interior, "x0_mm": Prior(2.0, fixed=True), "y0_mm": Prior(-3.0, fixed=True)},
        brown={"K1": Prior(1e-7), "b1": Prior(1e-3)},
    )
    write_bal(oriented_block(replace(block, cameras=(other, block.cameras[1])), points), tmp_path / "out.txt")
    again, _ = read_bal(tmp_path / "out.txt")
    x, y = block.image_points.xy[0] - np.array([2.0, -3.0])
    r2 = x * x + y * y
    expected = [x + x * 1e-7 * r2 + 1e-3 * x, y + y * 1e-7 * r2]
    np.testing.assert_allclose(again.image_points.xy[0], expected, rtol=1e-14)


WRONG = {
    "empty": ("", 1, "does not begin with the counts"),
    "words": ("a b c\n", 1, "does not begin with the counts"),
    "zero": ("0 0 0\n", 1, "does not begin with the counts"),
    "cut off": (SMALL[:-10], None, "its first line announces 46"),
    "not a number": (SMALL.replace("1.5 2.5", "1.5 2,5"), 4, "'2,5' is not a finite number"),
    "nan": (SMALL.replace("\n450\n", "\nnan\n"), 21, "'nan' is not a finite number"),
    "camera": (SMALL.replace("\n1 2 -7", "\n2 2 -7"), 5, "names a camera or point that the file does not have"),
    "point": (SMALL.replace("\n1 2 -7", "\n1 3 -7"), 5, "names a camera or point that the file does not have"),
    "far": (SMALL.replace("-7 8e1", "-7 8e14"), 5, "outside of any image"),
    "twice": (SMALL.replace("\n1 2 -7", "\n1 0 -7"), 5, "observed twice"),
    "focal length": (SMALL.replace("\n450\n", "\n-450\n"), 21, "focal length is not greater than 0"),
}


@pytest.mark.parametrize(("content", "line", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, content, line, says):
    (tmp_path / "bad.txt").write_text(content)
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_bal(tmp_path / "bad.txt")
    assert caught.value.line == line


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_files_give_an_input_error_or_a_block(data):
    raw = bytearray(SMALL.encode())
    at = data.draw(st.integers(0, len(raw) - 1))
    raw[at : at + data.draw(st.integers(0, 5))] = data.draw(st.binary(max_size=3) | st.sampled_from([b"9", b"-", b" "]))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.txt"
        path.write_bytes(bytes(raw))
        with contextlib.suppress(InputError):
            read_bal(path)
