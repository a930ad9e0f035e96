"""OpenSfM projects brought to an adjusted orientation: OpenSfM's own formulas project where this program does.

The formulas of OpenSfM's documentation and cameras are written out here, apart from the reader and the writer.
"""

from __future__ import annotations

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from test_colmap_in_place import measured

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.coordinates.local_frame import topocentric_frame
from aerotri.formats.assembly.oriented import oriented_block, oriented_from_adjusted
from aerotri.formats.foreign.opensfm import read_opensfm, write_opensfm
from aerotri.formats.foreign.opensfm_in_place import update_opensfm
from aerotri.observations.rigs import station_places
from rig_blocks import rig_block

ORIGIN = {"latitude": 47.5, "longitude": 12.25, "altitude": 430.0}


def rotation_of(vector):
    """Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.array(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def vector_of(rotation):
    angle = np.arccos((np.trace(rotation) - 1.0) / 2.0)
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return (axis * angle / (2.0 * np.sin(angle))).tolist() if angle else [0.0, 0.0, 0.0]


def projected(camera, x, y, z):
    """Normalised image coordinates of a direction in the camera's frame (x right, y down, z forwards)."""
    kind, k = camera["projection_type"], [camera.get(f"k{i}", 0.0) for i in (1, 2, 3, 4)]
    fx = camera["focal_x"] if "focal_x" in camera else camera["focal"]
    fy = camera["focal_y"] if "focal_y" in camera else camera["focal"]
    if kind.startswith("fisheye"):
        r = np.hypot(x, y)
        theta = np.arctan2(r, z)
        scale = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8) / r
        u, v = x * scale, y * scale
    else:
        x, y = x / z, y / z
        r2 = x * x + y * y
        radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]))
        p1, p2 = camera.get("p1", 0.0), camera.get("p2", 0.0)
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
    return fx * u + camera.get("c_x", 0.0), fy * v + camera.get("c_y", 0.0)


def positions(model, shot, point):
    """Where OpenSfM sees a point, by the shot's own pose and by its rig, pixels from the upper left corner."""
    value = model["shots"][shot]
    camera = model["cameras"][value["camera"]]
    xyz = np.array(model["points"][point]["coordinates"])
    own = rotation_of(value["rotation"]) @ xyz + value["translation"]
    found = [own]
    for instance in model.get("rig_instances", {}).values():
        if shot in instance["rig_camera_ids"]:
            mount = model["rig_cameras"][instance["rig_camera_ids"][shot]]
            rig = rotation_of(instance["rotation"]) @ xyz + instance["translation"]
            found.append(rotation_of(mount["rotation"]) @ rig + mount["translation"])
    longer = max(camera["width"], camera["height"])
    size = np.array([camera["width"], camera["height"]])
    return [np.array(projected(camera, *x)) * longer + size / 2.0 for x in found]


def as_of_opensfm(folder, block):
    """reconstruction.json with rigs, colours, metadata and another reconstruction, as OpenSfM writes it."""
    path = folder / "reconstruction.json"
    (model,) = json.loads(path.read_text())
    rng = np.random.default_rng(2)
    for point in model["points"].values():
        point["color"] = rng.integers(0, 255, 3).astype(float).tolist()
    places, names = station_places(block), block.images.names.tolist()
    cameras = [camera.name for camera in block.cameras]
    pose = {n: (rotation_of(s["rotation"]), np.array(s["translation"])) for n, s in model["shots"].items()}
    # the rig's own frame is that of none of its cameras
    turn, shift = rotation_of([0.1, -0.2, 0.3]), np.array([0.05, 0.02, -0.01])
    model["rig_cameras"], model["rig_instances"] = {}, {}
    for row, name in enumerate(names):
        lead = names[places.lead[row]]
        r, t = pose[name][0] @ pose[lead][0].T, pose[name][1] - pose[name][0] @ pose[lead][0].T @ pose[lead][1]
        model["rig_cameras"][f"rig {cameras[block.images.camera[row]]}"] = {
            "rotation": vector_of(r @ turn), "translation": (r @ shift + t).tolist(),
        }  # fmt: skip
        instance = model["rig_instances"].setdefault(f"exposure {lead}", {"rig_camera_ids": {}})
        instance["rig_camera_ids"][name] = f"rig {cameras[block.images.camera[row]]}"
        instance["rotation"] = vector_of(turn.T @ pose[lead][0])
        instance["translation"] = (turn.T @ (pose[lead][1] - shift)).tolist()
    for k, value in enumerate(model["shots"].values()):
        value |= {"capture_time": 1.5e9 + k, "orientation": 1, "skey": "s", "merge_cc": 0}
    model |= {"reference_lla": ORIGIN, "biases": {}}
    path.write_text(json.dumps([{"cameras": {}, "shots": {}, "points": {}}, model]))
    (folder / ".aerotri-files").unlink()
    return model


def project(folder):
    block, truth = rig_block(3, cameras=("left", "fore"))
    block = measured(block, truth)
    oriented = oriented_block(block, truth.points)
    shift = -oriented.centre.mean(axis=0)
    oriented = replace(oriented, centre=oriented.centre + shift, points=oriented.points + shift)
    write_opensfm(oriented, folder)
    return as_of_opensfm(folder, block)


@pytest.fixture(scope="module")
def updated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("opensfm") / "opensfm"
    before = project(folder)
    reading = read_opensfm(folder, 80.0)
    assert reading.origin == (12.25, 47.5, 430.0)
    (rig,) = reading.block.rigs
    assert (rig.reference, sorted(rig.cameras)) == ("nadir", ["fore", "left"])
    result = aerotri.adjust(reading.block)
    assert result.status == "converged"
    said = aerotri.convert(result, folder, "opensfm", in_place=True)
    return folder, before, result, said


def test_opensfm_projects_where_we_do(updated):
    folder, _, result, _ = updated
    model, adjusted = json.loads((folder / "reconstruction.json").read_text())[1], result.adjusted
    assert {camera["projection_type"] for camera in model["cameras"].values()} == {"brown", "fisheye_opencv"}
    block, rays = adjusted.block, adjusted.block.image_points
    used = np.flatnonzero(np.isfinite(adjusted.rays.v).all(axis=1))
    assert len(used) > 1000
    for k in used.tolist():
        camera = block.cameras[block.images.camera[rays.image[k]]]
        ours = px_from_mm(rays.xy[k] + adjusted.rays.v[k], camera.size_px, camera.pixel_mm)
        theirs = positions(model, str(block.images.names[rays.image[k]]), str(block.points[rays.point[k]]))
        assert len(theirs) == 2
        np.testing.assert_allclose(theirs, [ours, ours], rtol=0, atol=1e-6)


def test_everything_else_stays(updated):
    folder, before, result, said = updated
    others, model = json.loads((folder / "reconstruction.json").read_text())
    assert others == {"cameras": {}, "shots": {}, "points": {}}
    assert list(model) == list(before)
    for section in ("cameras", "shots", "points", "rig_cameras", "rig_instances"):
        assert list(model[section]) == list(before[section])
    for name, shot in before["shots"].items():
        assert {k: v for k, v in model["shots"][name].items() if k not in ("rotation", "translation")} == {
            k: v for k, v in shot.items() if k not in ("rotation", "translation")
        }
    for name, point in before["points"].items():
        assert model["points"][name]["color"] == point["color"]
    old = json.loads((folder / "before_aerotri" / "reconstruction.json").read_text())
    assert old[1] == before
    assert not any("could not be carried over" in text for text in said)
    # the reader finds what was adjusted
    again = read_opensfm(folder, 80.0)
    there = np.isfinite(result.adjusted.images.centre).all(axis=1)
    np.testing.assert_allclose(again.block.images.centre[there], result.adjusted.images.centre[there], atol=1e-8)


def test_a_block_in_a_coordinate_system(tmp_path):
    """Read into a CRS around reference_lla, and written back into the axes there."""
    folder = tmp_path / "opensfm"
    before = project(folder)
    block = aerotri.read(folder, crs="EPSG:25833", pixel_um=80.0).block
    frame = topocentric_frame("EPSG:25833", np.array([12.25, 47.5, 430.0]))
    local = read_opensfm(folder, 80.0)
    np.testing.assert_allclose(frame.to_local(block.images.centre), local.block.images.centre, atol=1e-6)
    np.testing.assert_allclose(block.images.centre.mean(axis=0)[:2], [293000, 5265000], atol=3000)
    result = aerotri.adjust(block)
    aerotri.convert(result, folder, "opensfm", in_place=True)
    model = json.loads((folder / "reconstruction.json").read_text())[1]
    errors = []
    rays, adjusted = block.image_points, result.adjusted
    for k in np.flatnonzero(np.isfinite(adjusted.rays.v).all(axis=1))[::7].tolist():
        camera = block.cameras[block.images.camera[rays.image[k]]]
        ours = px_from_mm(rays.xy[k] + adjusted.rays.v[k], camera.size_px, camera.pixel_mm)
        theirs = positions(model, str(block.images.names[rays.image[k]]), str(block.points[rays.point[k]]))
        errors.append(np.abs(np.array(theirs) - ours).max())
    # coordinates of a projected system have a few digits less
    assert max(errors) < 1e-5
    # no more than the adjustment itself moves it
    for name, shot in before["shots"].items():
        turn = rotation_of(model["shots"][name]["rotation"]) @ rotation_of(shot["rotation"]).T
        assert np.abs(turn - np.eye(3)).max() < 0.01


def test_opendronemap(tmp_path):
    """The project in a projected system is the local one times an affine transformation, before and after."""
    folder = tmp_path / "opensfm"
    before = project(folder)
    (folder / "reconstruction.json").rename(folder / "reconstruction.topocentric.json")
    linear, shift = 0.9996 * rotation_of([0.0, 0.0, 0.02]), np.array([310.0, -120.0, 430.0])
    theirs = copy.deepcopy(before)
    for point in theirs["points"].values():
        point["coordinates"] = (linear @ point["coordinates"] + shift).tolist()
    (folder / "reconstruction.json").write_text(json.dumps([theirs]))
    (folder / "undistorted").mkdir()
    result = aerotri.adjust(read_opensfm(folder, 80.0).block)
    said = aerotri.convert(result, folder, "opensfm", in_place=True)
    assert any("remove the folder" in text for text in said)
    local = json.loads((folder / "reconstruction.topocentric.json").read_text())[1]
    (model,) = json.loads((folder / "reconstruction.json").read_text())
    assert model["cameras"] == local["cameras"]
    for name, point in list(local["points"].items())[::9]:
        wanted = linear @ point["coordinates"] + shift
        np.testing.assert_allclose(model["points"][name]["coordinates"], wanted, atol=1e-6)
    # a similarity changes no image point
    for shot in list(local["shots"])[:10]:
        for point in list(local["points"])[:30]:
            both = [*positions(local, shot, point), *positions(model, shot, point)[:1]]
            if np.abs(both[0]).max() < 1e4:
                np.testing.assert_allclose(both, [both[0]] * 3, rtol=0, atol=1e-4)
    assert sorted(path.name for path in (folder / "before_aerotri").iterdir()) == [
        "reconstruction.json", "reconstruction.topocentric.json",
    ]  # fmt: skip


def test_cameras_of_groups_and_photographs_that_move(tmp_path):
    """A camera with other parameters for one photograph becomes two; a photograph off its rig leaves the instance."""
    folder = tmp_path / "opensfm"
    project(folder)
    reading = read_opensfm(folder, 80.0)
    assert reading.points is not None
    oriented = oriented_block(reading.block, reading.points)
    block, row = oriented.block, int(np.flatnonzero(oriented.block.images.camera == 1)[0])
    interior = block.cameras[1].interior | {"focal_length_mm": replace(block.cameras[1].interior["x0_mm"], value=36.0)}
    cameras = (*block.cameras, replace(block.cameras[1], name="left day 2", interior=interior))
    camera, centre = block.images.camera.copy(), oriented.centre.copy()
    camera[row] = 3
    centre[row] += 0.1
    changed = replace(block, cameras=cameras, images=replace(block.images, camera=camera))
    said = update_opensfm(replace(oriented, block=changed, centre=centre), folder)
    assert said == ("1 photograph has a rig instance of its own now, since it moves on the rig",)
    model = json.loads((folder / "reconstruction.json").read_text())[1]
    name = str(block.images.names[row])
    assert model["shots"][name]["camera"] == "left day 2"
    assert model["cameras"]["left day 2"]["focal_y"] == pytest.approx(36.0 / 80e-3 / 300)
    assert model["rig_instances"][name]["rig_camera_ids"] == {name: "rig left"}
    both = positions(model, name, next(iter(model["points"])))
    np.testing.assert_allclose(both[0], both[1], rtol=0, atol=1e-6)


def test_additional_parameters_are_fitted(tmp_path):
    folder = tmp_path / "opensfm"
    project(folder)
    read = read_opensfm(folder, 80.0).block
    adjustment = replace(read.settings.adjustment, additional_parameters=(("brown", ("K1", "P1")),))
    cameras = tuple(
        replace(camera, lens={name: replace(prior, fixed=True) for name, prior in camera.lens.items()})
        for camera in read.cameras
    )
    settings = replace(read.settings, adjustment=adjustment)
    result = aerotri.adjust(replace(read, cameras=cameras, settings=settings))
    said = update_opensfm(oriented_from_adjusted(result.adjusted), folder)
    assert sum("OpenSfM has no words for" in text for text in said) == 3


def test_refusals(tmp_path):
    folder = tmp_path / "opensfm"
    model = project(folder)
    reading = read_opensfm(folder, 80.0)
    assert reading.points is not None
    oriented = oriented_block(reading.block, reading.points)
    names = replace(reading.block.images, names=np.array([f"x{n}" for n in reading.block.images.names.tolist()]))
    with pytest.raises(InputError, match="no photograph of the result"):
        update_opensfm(replace(oriented, block=replace(reading.block, images=names)), folder)
    for change, says in (
        (lambda m: m["rig_instances"].update(x={"rig_camera_ids": dict.fromkeys(list(m["shots"])[:2], "rig left")}),
         "a rig camera took two"),
        (lambda m: m["rig_cameras"].pop("rig left"), "is not described in rig_cameras"),
        (lambda m: m["rig_cameras"].update({"rig left": {}}), "has no rotation"),
        (lambda m: m["reference_lla"].update(latitude=123.0), "is no place on the earth"),
        (lambda m: m.update(rig_instances=[1]), "rig_instances: is no table"),
    ):  # fmt: skip
        damaged = copy.deepcopy(model)
        change(damaged)
        (folder / "reconstruction.json").write_text(json.dumps([damaged]))
        with pytest.raises(InputError, match=says):
            read_opensfm(folder)
