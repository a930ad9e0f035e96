"""COLMAP models: pycolmap itself projects where the records say, for every camera model that can be expressed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample

import aerotri
from aerotri.conventions import InputError, mm_from_px, px_from_mm
from aerotri.formats.assembly.oriented import OrientedBlock, oriented_block, oriented_from_adjusted
from aerotri.formats.foreign.colmap import colmap_camera, point_numbers, read_colmap, write_colmap
from aerotri.functional_model.additional_parameters import ParameterSet, brown, lens
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Prior, Settings
from aerotri.observations.block import BROWN_NAMES
from aerotri.results.adjusted_block import (
    AdjustedBlock,
    GroundPointResults,
    ImageResults,
    Outcome,
    PointResults,
    RayResults,
    SharedParameters,
)

pycolmap = pytest.importorskip("pycolmap")

MODELS = {
    "SIMPLE_PINHOLE": [1200.0, 410.0, 290.0],
    "PINHOLE": [1200.0, 1210.0, 410.0, 290.0],
    "SIMPLE_RADIAL": [1200.0, 410.0, 290.0, -0.05],
    "RADIAL": [1200.0, 410.0, 290.0, -0.05, 0.01],
    "OPENCV": [1200.0, 1190.0, 410.0, 290.0, -0.05, 0.01, 0.002, -0.003],
    "FULL_OPENCV": [1200.0, 1200.0, 410.0, 290.0, -0.05, 0.01, 0.002, -0.003, 0.004, 0.0, 0.0, 0.0],
    "SIMPLE_FISHEYE": [400.0, 410.0, 290.0],
    "FISHEYE": [400.0, 405.0, 410.0, 290.0],
    "SIMPLE_RADIAL_FISHEYE": [400.0, 410.0, 290.0, -0.05],
    "RADIAL_FISHEYE": [400.0, 410.0, 290.0, -0.05, 0.01],
    "OPENCV_FISHEYE": [400.0, 405.0, 410.0, 290.0, -0.05, 0.01, 0.002, -0.003],
    "THIN_PRISM_FISHEYE": [400.0, 405.0, 410.0, 290.0, -0.05, 0.01, 0.002, -0.003, 0.002, -0.001, 0.003, -0.002],
}
ANGLES = np.array([[0.05, -0.1, 0.4], [-0.2, 0.1, -2.0], [0.1, 0.0, 1.5]])
CENTRES = np.array([[0.0, 0.0, 100.0], [20.0, 5.0, 105.0], [5.0, 25.0, 95.0]])


def values(priors, names) -> np.ndarray:
    return np.array([priors[name].value if name in priors else 0.0 for name in names])


def measured(camera: Camera, tangents: np.ndarray, extra=lambda xy: np.zeros_like(xy)) -> np.ndarray:
    """(n, 2) mm where directions are measured: x = c·lens(tangents) + x0 + d(x), by fixed point."""
    principal = np.array(camera.principal_point_mm)
    ideal = camera.focal_length_mm * lens.distort(*tangents.T, lens.vector_of(camera))
    xy = ideal + principal
    for _ in range(100):
        bar = xy - principal
        xy = ideal + principal + brown.image_error(bar[:, 0], bar[:, 1], values(camera.brown, BROWN_NAMES)) + extra(xy)
    return xy


def tangents_of(rotation: np.ndarray, centre: np.ndarray, points: np.ndarray) -> np.ndarray:
    u = (points - centre) @ rotation
    return -u[:, :2] / u[:, 2:]


def synthetic(camera: Camera, extra=lambda xy: np.zeros_like(xy), names=None) -> tuple[Block, np.ndarray]:
    """A block of three images without noise, and its points."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-10, 35, (40, 2)), rng.uniform(-5, 5, 40)])
    rotation = rotation_from_angles(ANGLES)
    image = np.repeat(np.arange(3), len(points))
    point = np.tile(np.arange(len(points)), 3)
    xy = np.vstack([measured(camera, tangents_of(rotation[i], CENTRES[i], points), extra) for i in range(3)])
    images = Images(
        np.array(["a.jpg", "b.jpg", "c.jpg"]), np.zeros(3, int), np.full(3, ""), CENTRES.copy(), ANGLES.copy()
    )
    block = Block(
        "synthetic",
        (camera,),
        images,
        np.arange(7, 47).astype(str) if names is None else names,
        ImagePoints(image, point, xy, np.full_like(xy, camera.pixel_mm)),
        settings=Settings(image_sigma_um=camera.pixel_um),
    )
    return block, points


def reprojection_px(folder) -> float:
    """Largest distance between measured and projected image points, both by pycolmap."""
    model = pycolmap.Reconstruction(folder)
    largest = 0.0
    for image in model.images.values():
        for point in image.points2D:
            if point.has_point3D():
                projected = image.project_point(model.points3D[point.point3D_id].xyz)
                largest = max(largest, float(np.max(np.abs(projected - point.xy))))
    return largest


def frame_camera(**changes) -> Camera:
    interior = {"focal_length_mm": Prior(60.0), "x0_mm": Prior(0.4, fixed=True), "y0_mm": Prior(-0.7, fixed=True)}
    return replace(Camera("cam", "frame", (8000, 6000), 5.0, interior), **changes)


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("name", MODELS)
def test_camera_models_project_alike(tmp_path, name, binary):
    """The same points through pycolmap's camera and through the records agree to 1e-8 px."""
    colmap = pycolmap.Camera(camera_id=3, model=name, width=800, height=600, params=MODELS[name])
    rng = np.random.default_rng(1)
    directions = rng.uniform(-0.25, 0.25, (50, 2))
    expected = np.array([colmap.img_from_cam(np.array([a, b, 1.0])) for a, b in directions])
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(colmap)
    for number, angles in enumerate(ANGLES[:2], 1):
        rotation = np.diag([1.0, -1.0, -1.0]) @ rotation_from_angles(angles).T
        pose = pycolmap.Rigid3d(np.column_stack([rotation, -rotation @ CENTRES[number]]))
        points = [pycolmap.Point2D(px) for px in expected]
        image = pycolmap.Image(name=f"{number}.jpg", points2D=points, camera_id=3, image_id=number)
        model.add_image_with_trivial_frame(image, pose)
    track = pycolmap.Track()
    track.add_element(1, 4)
    track.add_element(2, 4)
    model.add_point3D_with_id(12, pycolmap.Point3D(xyz=np.array([1.0, 2.0, 3.0]), track=track))
    (tmp_path / "model").mkdir()
    (model.write_binary if binary else model.write_text)(tmp_path / "model")

    block, points3d = read_colmap(tmp_path / "model", pixel_um=4.0)
    camera = block.cameras[0]
    # our camera frame is COLMAP's turned by diag(1, −1, −1)
    xy = measured(camera, directions * np.array([1.0, -1.0]))
    np.testing.assert_allclose(px_from_mm(xy, camera.size_px, camera.pixel_mm), expected, atol=1e-8)
    back, params = colmap_camera(camera)
    # the two without distortion are written as models that old versions know
    assert back == {"SIMPLE_FISHEYE": "SIMPLE_RADIAL_FISHEYE", "FISHEYE": "OPENCV_FISHEYE"}.get(name, name)
    np.testing.assert_allclose(params[: len(MODELS[name])], MODELS[name], rtol=1e-13)
    assert not any(params[len(MODELS[name]) :])
    assert block.images.names.tolist() == ["1.jpg", "2.jpg"]
    np.testing.assert_allclose(block.images.angles, ANGLES[:2], atol=1e-14)
    np.testing.assert_allclose(block.images.centre, CENTRES[1:], atol=1e-12)
    assert block.points.tolist() == ["12"]
    np.testing.assert_array_equal(points3d, [[1.0, 2.0, 3.0]])
    np.testing.assert_allclose(block.image_points.xy, mm_from_px(expected[[4, 4]], (800, 600), 0.004))
    np.testing.assert_array_equal(block.image_points.sigma, 0.004)
    assert block.settings.adjustment.datum == "minimal"
    assert all(prior.kind == "free" for prior in [*camera.lens.values(), *camera.brown.values()])


LENSES = {
    "none": frame_camera(),
    "radial": frame_camera(lens={"k1": Prior(-0.05), "k2": Prior(0.01)}),
    "tangential": frame_camera(lens={"k1": Prior(-0.05), "p1": Prior(0.001), "p2": Prior(-0.002)}),
    "affinity": frame_camera(lens={"k3": Prior(0.02)}, brown={"b1": Prior(0.001)}),
    "brown": frame_camera(brown={"K1": Prior(-1e-6), "P1": Prior(1e-6), "b1": Prior(1e-4), "b2": Prior(-2e-4)}),
}


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("name", LENSES)
def test_written_models_reproject(tmp_path, name, binary):
    block, points = synthetic(LENSES[name])
    lost = write_colmap(oriented_block(block, points), tmp_path / "model", binary=binary)
    assert reprojection_px(tmp_path / "model") < 1e-7
    assert any("free of the additional parameters" in text for text in lost) == (name == "brown")
    again, same = read_colmap(tmp_path / "model", pixel_um=5.0)
    assert again.points.tolist() == block.points.tolist()
    np.testing.assert_array_equal(same, points)
    np.testing.assert_array_equal(again.image_points.image, block.image_points.image)
    if name != "brown":
        np.testing.assert_allclose(again.image_points.xy, block.image_points.xy, atol=1e-12)
        assert {k for k, prior in again.cameras[0].lens.items() if prior.value} == set(LENSES[name].lens)


def test_what_colmap_cannot_hold_is_said(tmp_path):
    block, points = synthetic(frame_camera(), names=np.array([f"P {i}" for i in range(40)]))
    points[3] = np.nan
    angles = block.images.angles
    angles[2] = np.nan
    used = np.ones(len(block.image_points), bool)
    used[[0, 5]] = False
    control = replace(
        block.control, point=np.array([0]), xyz=np.ones((1, 3)), sigma=np.ones((1, 3)), is_check=np.ones(1, bool)
    )
    oriented = replace(oriented_block(replace(block, control=control), points), used=used)
    lost = write_colmap(oriented, tmp_path / "model")
    text = "\n".join(lost)
    assert "1 control or check point" in text
    assert "1 photograph without orientation" in text
    assert "2 points with one ray" in text
    again, same = read_colmap(tmp_path / "model")
    assert len(again.images) == 2
    assert len(same) == 37
    assert again.points[0] == "2"


def test_numbers_of_points():
    assert point_numbers(np.array(["3", "12"])).tolist() == [3, 12]
    assert point_numbers(np.array(["03", "12"])).tolist() == [1, 2]
    assert point_numbers(np.array(["a", "12"])).tolist() == [1, 2]
    assert point_numbers(np.array(["9" * 30])).tolist() == [1]


def test_a_point_twice_in_an_image_is_taken_once(tmp_path):
    model = pycolmap.Reconstruction()
    params = MODELS["SIMPLE_PINHOLE"]
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(camera_id=1, model="SIMPLE_PINHOLE", width=800, height=600, params=params)
    )
    measured_px = [pycolmap.Point2D(px) for px in ([10.0, 20.0], [30.0, 40.0], [50.0, 60.0])]
    image = pycolmap.Image(name="a", points2D=measured_px, camera_id=1, image_id=1)
    model.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    for number, places in ((5, (0, 2)), (6, (1,))):
        track = pycolmap.Track()
        for place in places:
            track.add_element(1, place)
        model.add_point3D_with_id(number, pycolmap.Point3D(xyz=np.ones(3), track=track))
    model.write_text(tmp_path)
    with pytest.warns(UserWarning, match="1 repeated measurement"):
        block, _ = read_colmap(tmp_path)
    assert block.points.tolist() == ["5", "6"]
    px = px_from_mm(block.image_points.xy, (800, 600), 1e-3)
    np.testing.assert_allclose(px, [[10, 20], [30, 40]])


@pytest.mark.parametrize(
    ("model", "params", "says"),
    [
        ("EQUIRECTANGULAR", [800.0, 600.0], "model EQUIRECTANGULAR"),
        ("SIMPLE_DIVISION", [200.0, 400.0, 300.0, -0.9], "no direction for parts of its format"),
        ("SIMPLE_PINHOLE", [-1.0, 400.0, 300.0], "no valid parameters"),
    ],
)
def test_cameras_that_cannot_be_expressed(tmp_path, model, params, says):
    block, points = synthetic(frame_camera())
    write_colmap(oriented_block(block, points), tmp_path / "model", binary=False)
    text = " ".join(["1", model, "800", "600", *map(str, params)])
    (tmp_path / "model" / "cameras.txt").write_text(text + "\n")
    with pytest.raises(InputError, match=says):
        read_colmap(tmp_path / "model")


def test_no_model(tmp_path):
    with pytest.raises(InputError, match="holds no COLMAP model"):
        read_colmap(tmp_path)
    for name in ("cameras", "images", "points3D"):
        (tmp_path / f"{name}.txt").write_text("1 NOTHING\n")
    with pytest.raises(InputError, match="no readable COLMAP model"):
        read_colmap(tmp_path)


def adjusted_with(block: Block, points: np.ndarray, parameters: dict[tuple[str, str], float]) -> AdjustedBlock:
    """An adjustment that found these shared parameters and left no residuals."""
    n, total, m = len(block.images), len(points), len(block.image_points)
    names, groups = np.array([key[0] for key in parameters]), np.array([key[1] for key in parameters])
    s = len(names)
    nothing = GroundPointResults(np.zeros(0, int), *(np.zeros((0, 3)) for _ in range(4)), np.zeros(0, int))
    kinds = np.array(["interior" if "_mm" in name else "additional" for name in names])
    return AdjustedBlock(
        block=block,
        outcome=Outcome("converged", "", 1, 1.0, 5.0, 0.0, 0, 0, 0, 1),
        images=ImageResults(block.images.centre, block.images.angles, np.zeros((n, 6, 6)), np.full(n, total)),
        points=PointResults(points, np.zeros((total, 3, 3)), np.full(total, n), np.zeros(total)),
        rays=RayResults(np.zeros((m, 2)), np.ones((m, 2)), np.zeros((m, 2)), np.ones(m), np.zeros(m, int)),
        parameters=SharedParameters(
            names, groups, kinds, np.full(s, ""), np.array(list(parameters.values())), np.eye(s), np.zeros(s),
            np.full(s, ""), np.zeros(s), np.full(s, "estimated"), np.full(s, ""),
        ),
        control=nothing,
        check=nothing,
        groups=(),
    )  # fmt: skip


def test_adjusted_blocks_are_written_free_of_their_additional_parameters(tmp_path):
    """With errors of every kind in the measurements, the written model reprojects to nothing."""
    true = frame_camera(
        brown={"K1": Prior(-1e-6)},
        lens={"k1": Prior(0.02)},
        interior={"focal_length_mm": Prior(60.5), "x0_mm": Prior(0.1), "y0_mm": Prior(-0.2)},
    )
    bluh = ParameterSet("bluh", ("1", "9"), true)
    amount = np.array([1e-4, 2e-7])
    block, points = synthetic(true, lambda xy: bluh.basis(xy[:, 0], xy[:, 1]) @ amount)
    start = replace(true, brown={}, lens={"k1": Prior(0.0)}, interior=frame_camera().interior)
    families = (("bluh", ("1", "9")), ("brown", ("K1",)), ("lens", ("k1",)))
    block = replace(
        block,
        cameras=(start,),
        settings=replace(block.settings, adjustment=AdjustmentSettings(additional_parameters=families)),
    )
    found = {("focal_length_mm", "cam"): 60.5, ("x0_mm", "cam"): 0.1, ("y0_mm", "cam"): -0.2}
    found |= {("bluh.1", "cam"): 1e-4, ("bluh.9", "cam"): 2e-7, ("brown.K1", "cam"): -1e-6, ("lens.k1", "cam"): 0.02}
    oriented = oriented_from_adjusted(adjusted_with(block, points, found))
    lost = write_colmap(oriented, tmp_path / "model")
    assert lost[-1] == "image points are written free of the additional parameters, which COLMAP has no words for"
    assert all("names of" in text or "size of the pixels" in text or "standard dev" in text for text in lost[:-1])
    assert reprojection_px(tmp_path / "model") < 1e-6
    again, _ = read_colmap(tmp_path / "model", pixel_um=5.0)
    np.testing.assert_allclose(again.cameras[0].focal_length_mm, 60.5, rtol=1e-14)
    np.testing.assert_allclose(again.cameras[0].principal_point_mm, [0.1, -0.2], atol=1e-12)
    assert again.cameras[0].lens["k1"].value == pytest.approx(0.02)


def test_groups_with_parameters_of_their_own_become_cameras(tmp_path):
    block, points = synthetic(frame_camera())
    days = np.array(["mon", "tue", "mon"])
    chosen = AdjustmentSettings(additional_parameters=(("lens", ("k1",)),), parameter_groups="day")
    block = replace(
        block, images=replace(block.images, columns={"day": days}), settings=replace(block.settings, adjustment=chosen)
    )
    found = {("lens.k1", "mon"): 0.01, ("lens.k1", "tue"): 0.02, ("focal_length_mm", "cam"): 61.0}
    oriented: OrientedBlock = oriented_from_adjusted(adjusted_with(block, points, found))
    assert [camera.name for camera in oriented.block.cameras] == ["cam mon", "cam tue"]
    assert oriented.block.images.camera.tolist() == [0, 1, 0]
    assert [camera.lens["k1"].value for camera in oriented.block.cameras] == [0.01, 0.02]
    assert [camera.focal_length_mm for camera in oriented.block.cameras] == [61.0, 61.0]
    assert oriented.errors is None


def test_blocks_without_orientation_are_refused():
    block, points = synthetic(frame_camera())
    nowhere = replace(block, images=replace(block.images, centre=np.full((3, 3), np.nan)))
    with pytest.raises(InputError, match="has no orientations"):
        oriented_block(nowhere, points)
    with pytest.raises(InputError, match="not those of the block"):
        oriented_block(block, points[:-1])


def test_a_model_without_points(tmp_path):
    """Photographs, orientations and cameras are start values; that image points are missing is said."""
    oriented = oriented_sample()
    write_colmap(oriented, tmp_path / "x", binary=False)
    rows = [line for line in (tmp_path / "x" / "images.txt").read_text().splitlines() if not line.startswith("#")]
    (tmp_path / "x" / "images.txt").write_text("\n\n".join(rows[::2]) + "\n\n")
    (tmp_path / "x" / "points3D.txt").write_text("")
    reading = aerotri.read(tmp_path / "x", pixel_um=5.0)
    assert any("no points that were measured" in text for text in reading.messages)
    assert len(reading.block.image_points) == 0
    order = [reading.block.images.names.tolist().index(name) for name in oriented.block.images.names.tolist()]
    np.testing.assert_allclose(reading.block.images.centre[order], oriented.centre, rtol=0, atol=1e-9)
