"""Image points and object points of COLMAP models: as pycolmap reads them, whatever the text or the numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.foreign.colmap import read_colmap
from aerotri.formats.foreign.colmap_arrays import read_arrays

pycolmap = pytest.importorskip("pycolmap")

LARGE = 2**40 + 3
"""A number that no table of all numbers could hold."""


def model_in(folder: Path, binary: bool, numbers: tuple[int, ...]) -> Path:
    """Three images, numbered backwards, of points with these numbers; every third image point belongs to none."""
    model = pycolmap.Reconstruction()
    params = [1200.0, 410.0, 290.0]
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(camera_id=1, model="SIMPLE_PINHOLE", width=800, height=600, params=params)
    )
    rng = np.random.default_rng(3)
    tracks: dict[int, list[tuple[int, int]]] = {number: [] for number in numbers}
    for image in (9, 4, 2):
        px, seen = rng.uniform(0.0, 500.0, (3 * len(numbers), 2)), rng.permutation(numbers)
        own = pycolmap.Image(
            name=f"photograph_{image}.jpg", points2D=[pycolmap.Point2D(p) for p in px], camera_id=1, image_id=image
        )
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(rng.normal(size=3) * 0.1), rng.normal(size=3))
        model.add_image_with_trivial_frame(own, pose)
        for place, number in enumerate(seen.tolist()):
            tracks[number].append((image, 3 * place + 1))
    for number, elements in tracks.items():
        track = pycolmap.Track()
        for element in elements:
            track.add_element(*element)
        model.add_point3D_with_id(number, pycolmap.Point3D(xyz=rng.normal(size=3), track=track))
    folder.mkdir()
    (model.write_binary if binary else model.write_text)(folder)
    return folder


def read_by_pycolmap(folder: Path) -> dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]:
    """Pixel position and object point by names of image and point."""
    model = pycolmap.Reconstruction(folder)
    return {
        (image.name, str(p.point3D_id)): (p.xy, model.points3D[p.point3D_id].xyz)
        for image in model.images.values()
        for p in image.points2D
        if p.has_point3D()
    }


@pytest.mark.parametrize("numbers", [(7, 3, 21, 5), (7, 3, LARGE, 5), (7, 3, 2**60, 5)])
@pytest.mark.parametrize("binary", [True, False])
def test_as_pycolmap_reads(tmp_path, binary, numbers):
    """2**60 is no exact floating-point number: such a text is left to pycolmap."""
    folder = model_in(tmp_path / "model", binary, numbers)
    assert (read_arrays(folder) is None) == (not binary and max(numbers) > 2**53)
    block, points = read_colmap(folder)
    expected = read_by_pycolmap(folder)
    rays = block.image_points
    assert len(rays) == len(expected) == 12
    for image, point, xy in zip(rays.image, rays.point, rays.xy, strict=True):
        px, xyz = expected[block.images.names[image], block.points[point]]
        np.testing.assert_allclose(xy * 1e3 * [1, -1] + [400.0, 300.0], px, rtol=0, atol=1e-9)
        np.testing.assert_allclose(points[point], xyz, rtol=1e-12)
    # points are numbered as they appear, image by image
    _, first = np.unique(rays.point, return_index=True)
    assert (np.diff(first) > 0).all()


def changed(folder: Path, name: str, change: Callable[[str], str]) -> Path:
    path = folder / name
    path.write_text(change(path.read_text()))
    return folder


def test_a_text_written_by_others(tmp_path):
    """Comments, blank lines before an image, Windows line ends and blanks at the ends are as good."""
    one = read_colmap(model_in(tmp_path / "one", False, (1, 2, 3)))[0]
    other = model_in(tmp_path / "other", False, (1, 2, 3))
    changed(other, "points3D.txt", lambda text: "\n# made by hand\n" + text.replace("\n", "  \r\n"))
    changed(other, "images.txt", lambda text: "\n\n# made by hand\n" + text.replace("\n", " \r\n"))
    again = read_colmap(other)[0]
    np.testing.assert_array_equal(one.image_points.xy, again.image_points.xy)
    assert one.points.tolist() == again.points.tolist()
    assert one.images.names.tolist() == again.images.names.tolist()


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("images.txt", lambda text: text.replace(" -1 ", " none ", 1)),
        ("images.txt", lambda text: text.replace(" -1 ", " 77 ", 1)),
        ("images.txt", lambda text: text.replace(" -1 ", " nan 5 -1 ", 1)),
        ("images.txt", lambda text: text.replace("\n4 ", "\n9 ", 1)),
        ("points3D.txt", lambda text: text[: text.index("\n", 200)] + "\n8 1.0\n"),
        ("points3D.txt", lambda text: text.replace("\n1 ", "\n1 nan ", 1)),
        ("points3D.txt", lambda text: ""),
    ],
)
def test_damaged_texts_are_refused(tmp_path, name, change):
    folder = model_in(tmp_path / "model", False, (1, 2, 3))
    before = (folder / name).read_text()
    changed(folder, name, change)
    assert (folder / name).read_text() != before
    with pytest.raises(InputError):
        read_colmap(folder)


def test_a_number_of_an_image_that_occurs_twice_is_refused(tmp_path):
    folder = model_in(tmp_path / "model", True, (1, 2, 3))
    raw = (folder / "images.bin").read_bytes()
    names = [raw.index(f"photograph_{k}.jpg".encode()) for k in (4, 9)]
    places = [name - 64 for name in names]
    assert [raw[p] for p in places] == [4, 9]
    (folder / "images.bin").write_bytes(raw[: places[1]] + b"\4" + raw[places[1] + 1 :])
    with pytest.raises(InputError, match="two images have the number 4"):
        read_colmap(folder)
