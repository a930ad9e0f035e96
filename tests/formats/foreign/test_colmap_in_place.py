"""COLMAP models brought to an adjusted orientation: pycolmap opens, projects and undistorts with what was adjusted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.assembly.oriented import oriented_block, oriented_from_adjusted
from aerotri.formats.foreign.colmap import read_colmap, write_colmap
from aerotri.formats.foreign.colmap_in_place import update_colmap
from aerotri.observations import Prior
from rig_blocks import rig_block

pycolmap = pytest.importorskip("pycolmap")

LENS = {"k1": Prior(-0.05), "k2": Prior(0.01), "p1": Prior(1e-3), "p2": Prior(-5e-4)}
FISHEYE_LENS = {"k1": Prior(-0.03), "k2": Prior(0.004), "k3": Prior(-1e-3), "k4": Prior(2e-4)}
SMALL = 20
"""Part of the true number of pixels: photographs to undistort are made."""


def measured(block, truth):
    """The block with perspective nadir and fisheye side camera, small formats, and exact image points with noise."""
    from aerotri.functional_model.additional_parameters import lens
    from aerotri.functional_model.rotation import rotation_from_angles

    cameras = tuple(
        replace(
            camera,
            size_px=(camera.size_px[0] // SMALL, camera.size_px[1] // SMALL),
            pixel_um=camera.pixel_um * SMALL,
            lens={name: FISHEYE_LENS.get(name, Prior(0.0, fixed=True)) for name in ("k1", "k2", "p1", "p2", "k3", "k4")}
            if fisheye
            else {name: LENS.get(name, Prior(0.0, fixed=True)) for name in ("k1", "k2", "p1", "p2", "k3", "k4")},
            projection="fisheye" if fisheye else "perspective",
        )
        for camera, fisheye in zip(block.cameras, (False, True, False), strict=True)
    )
    rays, xy = block.image_points, np.empty_like(block.image_points.xy)
    rotation = rotation_from_angles(truth.angles)
    u = np.einsum("mji,mj->mi", rotation[rays.image], truth.points[rays.point] - truth.centre[rays.image])
    of_ray = block.images.camera[rays.image]
    rng = np.random.default_rng(1)
    for number, camera in enumerate(cameras):
        own = of_ray == number
        a, b = (-u[own, :2] / u[own, 2:]).T
        bent = camera.focal_length_mm * lens.distort(a, b, lens.vector_of(camera))
        xy[own] = bent + camera.principal_point_mm + rng.normal(0, 0.2 * camera.pixel_mm, bent.shape)
    inside = (np.abs(xy) < np.array([camera.half_format_mm for camera in cameras])[of_ray]).all(axis=1)
    sigma = np.repeat(0.2 * np.array([camera.pixel_mm for camera in cameras])[of_ray][:, None], 2, axis=1)
    points = type(rays)(rays.image[inside], rays.point[inside], xy[inside], sigma[inside])
    names = np.array([f"{name}.png" for name in block.images.names.tolist()])
    images = replace(block.images, names=names, centre=truth.centre, angles=truth.angles)
    return replace(block, cameras=cameras, images=images, image_points=points)


def as_of_colmap(folder):
    """The model as COLMAP would have it: colours, and image points without object point."""
    model = pycolmap.Reconstruction(folder)
    rng = np.random.default_rng(2)
    for point in model.points3D.values():
        point.color = rng.integers(0, 255, 3).astype(np.uint8)
    for number, image in model.images.items():
        if image.num_points3D > 20:
            model.delete_observation(number, next(k for k, p in enumerate(image.points2D) if p.has_point3D()))
    (folder / ".aerotri-files").unlink()
    return model


@pytest.fixture(scope="module")
def flown():
    block, truth = rig_block(3, cameras=("left", "fore"))
    return measured(block, truth), truth


@pytest.fixture(scope="module", params=["binary", "text"])
def updated(flown, request, tmp_path_factory):
    """Folder, the model before, and the result: a rig of a fisheye and two perspective cameras, adjusted."""
    block, truth = flown
    folder = tmp_path_factory.mktemp("colmap") / "model"
    write_colmap(oriented_block(block, truth.points), folder)
    before = as_of_colmap(folder)
    if request.param == "text":
        for path in folder.iterdir():
            path.unlink()
    (before.write_binary if request.param == "binary" else before.write_text)(folder)
    read, _ = read_colmap(folder, 80.0)
    result = aerotri.adjust(read)
    assert result.status == "converged"
    said = aerotri.convert(result, folder, "colmap", in_place=True)
    return folder, before, result, said


def test_pycolmap_projects_where_we_do(updated):
    folder, _, result, _ = updated
    model, adjusted = pycolmap.Reconstruction(folder), result.adjusted
    block, rays = adjusted.block, adjusted.block.image_points
    images = {image.name: image for image in model.images.values()}
    assert {camera.model.name for camera in model.cameras.values()} >= {"OPENCV_FISHEYE"}
    used = np.flatnonzero(np.isfinite(adjusted.rays.v).all(axis=1))
    assert len(used) > 1000
    for k in used.tolist():
        camera = block.cameras[block.images.camera[rays.image[k]]]
        ours = px_from_mm(rays.xy[k] + adjusted.rays.v[k], camera.size_px, camera.pixel_mm)
        point = model.points3D[int(block.points[rays.point[k]])]
        theirs = images[block.images.names[rays.image[k]]].project_point(point.xyz)
        np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-6)


def test_everything_else_stays(updated):
    folder, before, result, said = updated
    model = pycolmap.Reconstruction(folder)
    assert sorted(model.images) == sorted(before.images)
    assert sorted(model.points3D) == sorted(before.points3D)
    assert sorted(model.cameras) == sorted(before.cameras)
    assert {k: rig.num_sensors() for k, rig in model.rigs.items()} == {1: 3}
    for number, image in before.images.items():
        again = model.images[number]
        assert (again.name, again.camera_id, again.frame_id) == (image.name, image.camera_id, image.frame_id)
        np.testing.assert_array_equal([p.xy for p in again.points2D], [p.xy for p in image.points2D])
        assert [p.point3D_id for p in again.points2D] == [p.point3D_id for p in image.points2D]
    for number, point in before.points3D.items():
        again = model.points3D[number]
        assert again.color.tolist() == point.color.tolist()
        assert {(e.image_id, e.point2D_idx) for e in again.track.elements} == {
            (e.image_id, e.point2D_idx) for e in point.track.elements
        }
    older = pycolmap.Reconstruction(folder / "before_aerotri")
    assert older.num_points3D() == before.num_points3D()
    # the files are ours now: a second time keeps the first older ones only
    aerotri.convert(result, folder, "colmap", in_place=True)
    assert [path.name for path in folder.iterdir() if path.is_dir()] == ["before_aerotri"]
    assert not any("could not be carried over" in text for text in said)


def test_colmap_undistorts(updated, tmp_path):
    PIL = pytest.importorskip("PIL.Image")
    folder, _, _, _ = updated
    model = pycolmap.Reconstruction(folder)
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    rng = np.random.default_rng(1)
    # one photograph of each camera
    names = sorted({image.camera_id: image.name for image in model.images.values() if image.has_pose}.values())
    for image in model.images.values():
        if image.name in names:
            camera = model.cameras[image.camera_id]
            pixels = rng.integers(0, 255, (camera.height, camera.width, 3)).astype(np.uint8)
            PIL.fromarray(pixels).save(photographs / image.name)
    pycolmap.undistort_images(tmp_path / "dense", folder, photographs, image_names=names)
    undistorted = pycolmap.Reconstruction(tmp_path / "dense" / "sparse")
    assert {camera.model.name for camera in undistorted.cameras.values()} == {"PINHOLE"}
    assert sorted(path.name for path in (tmp_path / "dense" / "images").iterdir()) == names


def test_what_was_not_adjusted_moves_along(flown, tmp_path):
    """Half of the points and a photograph are taken out of the block, which then turns, grows and moves."""
    block, truth = flown
    folder = tmp_path / "model"
    write_colmap(oriented_block(block, truth.points), folder)
    before = pycolmap.Reconstruction(folder)
    read, points = read_colmap(folder, 80.0)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    oriented = oriented_block(read, points)
    there = np.arange(len(points)) % 2 == 0
    rotation = turn @ oriented.rotation
    rotation[0] = np.nan
    moved = replace(
        oriented,
        centre=2.0 * oriented.centre @ turn.T + [10.0, 20.0, 30.0],
        rotation=rotation,
        points=np.where(there[:, None], 2.0 * points @ turn.T + [10.0, 20.0, 30.0], np.nan),
    )
    said = update_colmap(moved, folder)
    model = pycolmap.Reconstruction(folder)
    assert said == (f"not adjusted, moved along with the others: 1 photograph and {int((~there).sum())} object points",)
    for number, point in before.points3D.items():
        np.testing.assert_allclose(
            model.points3D[number].xyz, 2.0 * turn @ point.xyz + [10.0, 20.0, 30.0], rtol=0, atol=1e-6
        )
    for number, image in before.images.items():
        wanted = 2.0 * turn @ image.projection_center() + [10.0, 20.0, 30.0]
        np.testing.assert_allclose(model.images[number].projection_center(), wanted, rtol=0, atol=1e-6)


def test_what_colmap_has_no_words_for_is_fitted(flown, tmp_path):
    """Additional parameters that a lens can hold nearly: the image points stay, the camera takes them over."""
    block, truth = flown
    folder = tmp_path / "model"
    write_colmap(oriented_block(block, truth.points), folder)
    read, _ = read_colmap(folder, 80.0)
    adjustment = replace(read.settings.adjustment, additional_parameters=(("brown", ("K1", "K2", "P1")),))
    cameras = tuple(
        replace(camera, lens={name: replace(prior, fixed=True) for name, prior in camera.lens.items()})
        for camera in read.cameras
    )
    settings = replace(read.settings, adjustment=adjustment)
    result = aerotri.adjust(replace(read, cameras=cameras, settings=settings))
    oriented = oriented_from_adjusted(result.adjusted)
    said = update_colmap(oriented, folder)
    assert sum("the nearest lens is written, RMS" in text for text in said) == 3
    model = pycolmap.Reconstruction(folder)
    errors = [
        np.hypot(*(image.project_point(model.points3D[p.point3D_id].xyz) - p.xy))
        for image in model.images.values()
        for p in image.points2D
        if image.has_pose and p.has_point3D()
    ]
    # as measured with σ = 0.2 px
    assert np.median(errors) < 0.4
    assert len(errors) == len(read.image_points)


def test_refusals(flown, tmp_path):
    block, truth = flown
    folder = tmp_path / "model"
    write_colmap(oriented_block(block, truth.points), folder)
    read, points = read_colmap(folder, 80.0)
    oriented = oriented_block(read, points)
    with pytest.raises(InputError, match="is no colmap project"):
        aerotri.convert(read, tmp_path, "colmap", points=points, in_place=True)
    with pytest.raises(InputError, match="not possible for 'bal'"):
        aerotri.convert(read, folder, "bal", points=points, in_place=True)
    names = replace(read.images, names=np.array([f"x{name}" for name in read.images.names.tolist()]))
    with pytest.raises(InputError, match="no photograph of the result"):
        update_colmap(replace(oriented, block=replace(read, images=names)), folder)
    centre = oriented.centre.copy()
    centre[np.flatnonzero(read.images.camera == 1)[0]] += 0.01
    with pytest.raises(InputError, match="moves on its rig"):
        update_colmap(replace(oriented, centre=centre), folder)
    several = replace(read, cameras=(*read.cameras, read.cameras[0]))
    camera = read.images.camera.copy()
    camera[np.flatnonzero(camera == 0)[0]] = 3
    several = replace(several, images=replace(read.images, camera=camera))
    with pytest.raises(InputError, match="other parameters in every group"):
        update_colmap(replace(oriented, block=several), folder)
