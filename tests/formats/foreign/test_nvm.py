"""VisualSFM's NVM: poses and lens by its formulas, the distortion as other programs write it, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.convert import detect_format
from aerotri.formats.foreign.nvm import read_nvm
from aerotri.functional_model.rotation import rotation_from_angles
from formats.foreign.metashape_sample import ANGLES, CENTRES, Sample

SIZE, FOCAL, R = (4000, 3000), 2400.5, 0.06
POINTS = Sample().points
CAMERA_FROM_WORLD = [np.diag([1.0, -1.0, -1.0]) @ turn.T for turn in rotation_from_angles(ANGLES)]


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """w, x, y, z, from the eigenvector of the rotation."""
    values, vectors = np.linalg.eig(matrix)
    axis = np.real(vectors[:, np.argmin(np.abs(values - 1.0))])
    across = np.cross(axis, [0.3, 0.5, 0.8])
    turned = matrix @ across
    angle = np.arctan2(axis @ np.cross(across, turned), across @ turned)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def measured(k: int, lens: str) -> np.ndarray:
    """(n, 2) from the image centre."""
    x, y, z = CAMERA_FROM_WORLD[k] @ (POINTS - CENTRES[k]).T
    ideal = np.column_stack([x / z, y / z])
    r2 = np.sum(ideal**2, axis=1)
    if lens == "opencv":
        return FOCAL * ideal * (1 - R * r2)[:, None]
    if lens == "none":
        return FOCAL * ideal
    # d with d·(1 + r·d²) = u, by Newton's method
    u, d = np.sqrt(r2), np.sqrt(r2)
    for _ in range(30):
        d = d - (d * (1 + R * d * d) - u) / (1 + 3 * R * d * d)
    return FOCAL * ideal * (d / u)[:, None]


def nvm(lens: str = "visualsfm", fixed: bool = False) -> str:
    r = {"visualsfm": R, "opencv": -R, "none": 0.0}[lens]
    lines = [f"NVM_V3 FixedK {FOCAL} 2000 {FOCAL} 1500" if fixed else "NVM_V3 ", "", "6"]
    for k in range(6):
        values = [FOCAL, *quaternion(CAMERA_FROM_WORLD[k]).tolist(), *CENTRES[k].tolist(), r]
        lines.append(f'DJI"{k}.JPG ' + " ".join(map(repr, values)) + " 0")
    at = np.array([measured(k, lens) for k in range(6)])
    seen, xy = (np.abs(at) < np.array(SIZE) / 2).all(axis=2), at.tolist()
    lines += ["", str(len(POINTS))]
    for j, place in enumerate(POINTS.tolist()):
        rays = [f"{k} {j} {xy[k][j][0]!r} {xy[k][j][1]!r}" for k in np.flatnonzero(seen[:, j]).tolist()]
        lines.append(" ".join([*map(repr, place), "255 255 255", str(len(rays)), *rays]))
    return "\n".join([*lines, "", "0", "#the last part of NVM file points to the PLY files", "0", ""])


@pytest.mark.parametrize(("lens", "fixed"), [("visualsfm", False), ("opencv", False), ("none", False), ("none", True)])
def test_a_model(tmp_path, lens, fixed):
    path = tmp_path / "site.nvm"
    path.write_text(nvm(lens, fixed))
    assert detect_format(path) == "nvm"
    reading = aerotri.read(path, pixel_um=4.0, camera_size=SIZE)
    block = reading.block
    assert block.images.names.tolist() == [f"DJI {k}.JPG" for k in range(6)]
    assert block.cameras[0].size_px == SIZE
    np.testing.assert_allclose(block.images.centre, CENTRES)
    np.testing.assert_allclose(rotation_from_angles(block.images.angles), rotation_from_angles(ANGLES), atol=1e-9)
    fit = [float(found[1]) for text in reading.messages if (found := re.search(r"fit the given \w+ to (\S+) px", text))]
    assert fit[0] < 0.05
    words = [text for text in reading.messages if text.startswith("the distortion is")]
    assert [text.split(",")[0] for text in words] == {
        "visualsfm": ["the distortion is VisualSFM's"], "opencv": ["the distortion is OpenCV's k1"], "none": [],
    }[lens]  # fmt: skip


def test_without_a_size(tmp_path):
    path = tmp_path / "site.nvm"
    path.write_text(nvm())
    reading = aerotri.read(path)
    assert any("--camera-size" in text for text in reading.messages)
    assert any(text.startswith("the photographs have 1 camera: ") for text in reading.messages)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("NVM_V3 ", "NVM_V3 FixedQ 1", "is not understood"),
        ("\n6\n", "\n7\n", "is no camera"),
        ("\n60\n", "\n600000\n", "more than the file has"),
        ("255 255 255 ", "255 255 255 1", "other than the measurements"),
        ('DJI"1', 'DJI"0', "called 'DJI 0.JPG'"),
        (f"{FOCAL} ", "0 ", "no camera has"),
    ],
)
def test_what_is_refused(tmp_path, old, new, says):
    path = tmp_path / "site.nvm"
    text = nvm()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=says) as caught:
        read_nvm(path)
    assert caught.value.file == path
    assert caught.value.remedy
