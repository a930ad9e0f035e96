"""A block from several files: names that differ, axes, heights, true and grid north, and what must be stated."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample, prediction

from aerotri.conventions import InputError
from aerotri.coordinates import local_frame
from aerotri.crs_text import plan_of
from aerotri.formats.assembly import placing
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.assembly.names_match import match_photographs
from aerotri.formats.assembly.placing import (
    from_ellipsoidal_heights,
    in_local_frame,
    rotation_from_yaw_pitch_roll,
    to_crs,
    true_heights,
)
from aerotri.formats.assembly.project import Request, read_project
from aerotri.formats.convert import write_any, write_oriented
from aerotri.formats.foreign.bingo import write_bingo
from aerotri.formats.foreign.metashape import write_metashape
from aerotri.formats.foreign.odm import write_odm_gcp
from aerotri.formats.foreign.patb import write_patb
from aerotri.formats.foreign.pix4d import write_pix4d_gcp, write_pix4d_geo
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Prior
from aerotri.observations.names import prefix_of

UTM = (717000.0, 1606000.0, 0.0)
UTM_WKT = 'PROJCS["WGS 84 / UTM zone 47N",AUTHORITY["EPSG","32647"]]'
SIGMAS = ("control_sigma_m", "positions_sigma_m")
SPEC = CameraSpec(name="P1", size_px=(8000, 6000), pixel_um=5.0, focal_length_mm=40.0)
CAMERAS_TOML = """\
[camera.P1]
size_px = [8000, 6000]
pixel_um = 5.0
focal_length_mm = 40.0
[camera.P1.brown]
K1 = { value = 1e-6 }
[camera.cam]
size_px = [8000, 6000]
pixel_um = 5.0
focal_length_mm = 41.0
"""


@pytest.fixture
def files(tmp_path):
    """The sample block in several files."""
    oriented = oriented_sample(shift=UTM)
    block = oriented.block
    write_bingo(block, tmp_path / "points.txt")
    write_pix4d_geo(block, tmp_path / "geo.csv")
    write_pix4d_gcp(block, tmp_path / "gcp.csv")
    write_metashape(oriented, tmp_path / "opk.txt")
    write_odm_gcp(replace(block, crs="EPSG:32647"), tmp_path / "gcp_list.txt")
    write_patb(oriented, tmp_path / "patb")
    write_any(block, tmp_path / "block")
    return tmp_path


def request(files, source="points.txt", **changes) -> Request:
    return Request(str(files / source), "made", **({"camera": SPEC} | changes))


def test_everything_from_its_own_file(files):
    sample = oriented_sample(shift=UTM).block
    reading = read_project(
        request(
            files, orientation=str(files / "opk.txt"), positions=str(files / "geo.csv"), control=str(files / "gcp.csv"),
            check=("t16",), image_sigma_px=0.5, gnss_shift="block", stated=Statements(crs="EPSG:32647"),
        )
    )  # fmt: skip
    block = reading.block
    assert (block.name, block.crs, block.cameras[0].name) == ("made", "EPSG:32647", "P1")
    assert block.images.names.tolist() == sample.images.names.tolist()
    np.testing.assert_allclose(block.image_points.xy, sample.image_points.xy, rtol=0, atol=5.1e-7)
    np.testing.assert_array_equal(block.image_points.sigma, 0.0025)
    assert block.settings.image_sigma_um == 2.5
    assert block.settings.gnss.shift == "block"
    np.testing.assert_allclose(block.images.centre, sample.images.centre, rtol=0, atol=5.1e-7)
    np.testing.assert_allclose(block.images.angles, sample.images.angles, rtol=0, atol=1e-12)
    assert block.gnss_ins is not None
    np.testing.assert_array_equal(block.gnss_ins.sigma, 0.05)
    assert block.points[block.control.point].tolist() == ["t0", "t7", "t13", "t16"]
    assert block.control.is_check.tolist() == [False, False, False, True]
    # exact in a plane grid; the rays of a grid of scale 1.00018 over a round earth do not meet as well
    assert re.search(r"image points fit the given orientations to 0\.\d+ px", reading.messages[-2])


def test_image_points_alone(files):
    reading = read_project(request(files))
    assert reading.block.settings.adjustment.datum == "minimal"
    assert reading.messages == (
        "the standard deviation of image points is assumed as 1 pixel: state yours with --image-sigma-px",
    )
    np.testing.assert_array_equal(reading.block.image_points.sigma, 0.005)
    assert np.isnan(reading.block.images.centre).all()


def test_local_sample_fits_its_orientations(files):
    reading = read_project(request(files, orientation=str(files / "opk.txt")))
    found = re.search(r"fit the given orientations to ([\d.e-]+) px \(median of \d+ rays\)", reading.messages[-1])
    assert found is not None
    assert float(found[1]) < 1e-3


def test_photographs_of_other_folders_and_endings(files):
    text = (files / "geo.csv").read_text()
    (files / "other.csv").write_text(re.sub(r"p(\d)\.jpg", r"flight\\p\1.TIF", text) + "more.jpg,1,2,3,.1,.1\n")
    reading = read_project(request(files, positions=str(files / "other.csv"), gnss_shift="off"))
    assert reading.block.gnss_ins is not None
    assert reading.block.gnss_ins.image.tolist() == [0, 1, 2, 3]
    assert "other.csv: 4 photographs are named with another folder or file ending" in reading.messages
    assert "other.csv: 1 photograph is not in the block and left out: 'more.jpg'" in reading.messages
    (files / "none.csv").write_text("x.jpg,1,2,3,.1,.1\n")
    with pytest.raises(
        InputError, match=r"none\.csv: names no photograph of the block: 'x\.jpg' is not among 'p0\.jpg'"
    ):
        read_project(request(files, positions=str(files / "none.csv")))


def test_names_match_only_where_that_is_clear():
    known = np.array(["a.jpg", "b.jpg", "b.tif", "c"])
    index, loosely = match_photographs(np.array(["x/a.TIF", "b", "b.tif", "c", "d"]), known)
    assert index.tolist() == [0, -1, 2, 3, -1]
    assert loosely == 1
    # two names for one photograph
    assert match_photographs(np.array(["a.jpg", "a.tif"]), known)[0].tolist() == [-1, -1]
    assert prefix_of(np.array(["02", "GCP10"]), np.array(["GCP_GCP10", "x"])) == "GCP_"
    assert prefix_of(np.array(["02"]), np.array(["03"])) is None


def test_prefix_of_control(files):
    text = (files / "gcp.csv").read_text()
    (files / "short.csv").write_text(text.replace("t", ""))
    with pytest.raises(InputError, match="state what stands before them: --control-prefix t"):
        read_project(request(files, control=str(files / "short.csv")))
    stated = Statements(control_prefix="t")
    reading = read_project(request(files, control=str(files / "short.csv"), stated=stated, check=("7", "t0")))
    assert reading.block.points[reading.block.control.point].tolist() == ["t0", "t7", "t13", "t16"]
    assert reading.block.control.is_check.tolist() == [True, True, False, False]


def test_points_never_measured_are_kept_and_said(files):
    (files / "more.csv").write_text((files / "gcp.csv").read_text() + "far,717100,1608050,100,.1,.1\n")
    reading = read_project(request(files, control=str(files / "more.csv")))
    assert reading.block.points[reading.block.control.point[-1]] == "far"
    assert "more.csv: 1 point is not measured: 'far'" in reading.messages


def test_axes(files):
    rows = [line.split(",") for line in (files / "gcp.csv").read_text().splitlines()]
    (files / "yx.csv").write_text("".join(",".join([r[0], r[2], r[1], *r[3:]]) + "\n" for r in rows))
    positions = str(files / "geo.csv")
    with pytest.raises(
        InputError, match=r"yx\.csv: lies 1\d+ km from the photographs, 0\.\d+ km with X and Y exchanged"
    ):
        read_project(request(files, positions=positions, control=str(files / "yx.csv")))
    rows = [line.split(",") for line in (files / "geo.csv").read_text().splitlines()]
    (files / "yx_geo.csv").write_text("".join(",".join([r[0], r[2], r[1], *r[3:]]) + "\n" for r in rows))
    reading = read_project(
        request(files, positions=str(files / "yx_geo.csv"), control=str(files / "yx.csv"), stated=Statements(axes="yx"))
    )
    sample = oriented_sample(shift=UTM).block
    np.testing.assert_allclose(reading.block.control.xyz, sample.control.xyz, rtol=0, atol=5.1e-7)


def with_system(files, crs):
    """The orientations of the sample under a system that a comment names."""
    text = (files / "opk.txt").read_text()
    (files / "named.txt").write_text(f"# CoordinateSystem: {crs}\n{text}")
    return str(files / "named.txt")


def test_orientations_name_the_system_of_the_block(files):
    source = with_system(files, UTM_WKT)
    for changes in ({"orientation": source}, {"source": source, "image_points": (str(files / "points.txt"),)}):
        reading = read_project(request(files, **changes))
        assert reading.block.crs == "EPSG:32647"
    with pytest.raises(InputError, match=r"is in EPSG:32648, the block in EPSG:32647"):
        read_project(request(files, orientation=with_system(files, "EPSG:32648"), stated=Statements(crs="EPSG:32647")))


@pytest.mark.parametrize(
    ("crs", "of_block", "says"),
    [
        ("EPSG:32647", "EPSG:32647+5773", "heights count as ellipsoidal, and were brought to those of EPSG:32647+5773"),
        ("EPSG:32647+5773", "EPSG:32647", "heights of EPSG:32647+5773 were brought to ellipsoidal ones"),
        ("EPSG:32647", "EPSG:32647", ""),
    ],
)
def test_heights_of_orientations(files, monkeypatch, crs, of_block, says):
    """The plan has to be that of the block, heights are brought there as those of control are."""
    monkeypatch.setattr(placing, "to_crs", lambda xyz, source, target, _: xyz + [0, 0, 10.0 * (source != target)])
    stated = Statements(crs=of_block)
    plain = read_project(request(files, orientation=str(files / "opk.txt"), stated=stated))
    found = read_project(request(files, orientation=with_system(files, crs), stated=stated))
    moved = found.block.images.centre - plain.block.images.centre
    np.testing.assert_allclose(moved, np.tile([0, 0, 10.0 if says else 0.0], (len(moved), 1)), atol=1e-9)
    assert not says or f"named.txt: {says}" in found.messages


def test_what_is_stated_of_control_is_not_of_the_source(files):
    rows = "".join(f"p{k}.jpg,{UTM[0] + k},{UTM[1]},500,0,0,0\n" for k in range(4))
    (files / "att.csv").write_text(f"name,X,Y,Z,yaw,pitch,roll\n{rows}")
    (files / "yx.txt").write_text("c,1606000,717000,100\n")
    stated = Statements(crs="EPSG:32647", columns="PNEZ", **dict.fromkeys(SIGMAS, (1.0, 1.0, 1.0)))
    found = read_project(
        Request(str(files / "att.csv"), "b", control=str(files / "yx.txt"), camera=SPEC, stated=stated)
    )
    assert found.block.gnss_ins.xyz[1].tolist() == [UTM[0] + 1, UTM[1], 500]
    assert found.block.control.xyz.tolist() == [[717000, 1606000, 100]]


def test_standard_deviations_that_files_lack(files):
    rows = [",".join(line.split(",")[:4]) for line in (files / "gcp.csv").read_text().splitlines()]
    (files / "bare.csv").write_text("\n".join(rows))
    with pytest.raises(InputError, match="gives no standard deviations — state them, in metres: --control-sigma-m"):
        read_project(request(files, control=str(files / "bare.csv")))
    stated = Statements(control_sigma_m=(0.1, 0.2, 0.3))
    reading = read_project(request(files, control=str(files / "bare.csv"), stated=stated))
    np.testing.assert_array_equal(reading.block.control.sigma[1], [0.1, 0.2, 0.3])


def test_gcp_list_brings_its_image_points(files):
    """Control of OpenDroneMap beside tie points: its pixels are measured again, so they are other points."""
    text = (files / "gcp_list.txt").read_text().replace(" t", " gcp_t")
    (files / "gcp_list.txt").write_text(text)
    stated = Statements(control_sigma_m=(0.1, 0.1, 0.1))
    reading = read_project(request(files, control=str(files / "gcp_list.txt"), stated=stated))
    block = reading.block
    assert block.crs == "EPSG:32647"
    sample = oriented_sample(shift=UTM).block
    of_control = np.isin(sample.image_points.point, sample.control.point)
    assert len(block.image_points) == len(sample.image_points) + of_control.sum()
    new = np.char.startswith(block.points, "gcp_")[block.image_points.point]
    order = np.lexsort((block.points[block.image_points.point[new]], block.image_points.image[new]))
    wanted = np.flatnonzero(of_control)
    wanted = wanted[np.lexsort((sample.points[sample.image_points.point[wanted]], sample.image_points.image[wanted]))]
    np.testing.assert_allclose(
        block.image_points.xy[new][order], sample.image_points.xy[wanted], rtol=0, atol=1e-8
    )  # fmt: skip
    alone = read_project(request(files, "gcp_list.txt", stated=stated))
    assert len(alone.block.image_points) == of_control.sum()
    assert len(alone.block.control) == 4


def test_the_same_ray_twice(files):
    with pytest.raises(InputError, match="is measured in another file already"):
        read_project(request(files, image_points=(str(files / "points.txt"),)))


def test_folder_of_patb(files):
    stated = Statements(control_sigma_m=(0.02, 0.02, 0.02))
    reading = read_project(request(files, "patb", camera=replace(SPEC, focal_length_mm=None), stated=stated))
    block = reading.block
    assert block.cameras[0].focal_length_mm == 40.0
    assert any("rotations are camera-to-object" in said for said in reading.messages)
    np.testing.assert_allclose(block.images.angles, oriented_sample().block.images.angles, rtol=0, atol=1e-9)
    assert len(block.control) == 3
    one = Statements(control_sigma_m=(0.02, 0.02, 0.02), patb_rotation="object-to-camera")
    turned = read_project(request(files, "patb", stated=one)).block
    assert np.abs(turned.images.angles - block.images.angles).max() > 0.01


def test_what_is_added_to_a_whole_block(files):
    """A block folder keeps its σ, and takes positions that it does not have yet."""
    from aerotri.formats.block.folder import read_block, write_block

    block = read_block(files / "block")
    write_block(replace(block, gnss_ins=None, control=type(block.control).empty()), files / "bare")
    with pytest.raises(InputError, match="has cameras of its own"):
        read_project(request(files, "bare"))
    reading = read_project(
        request(files, "bare", camera=CameraSpec(), positions=str(files / "geo.csv"), control=str(files / "gcp.csv"))
    )
    np.testing.assert_array_equal(reading.block.image_points.sigma, block.image_points.sigma)
    assert reading.block.gnss_ins is not None
    assert len(reading.block.control) == 4
    with pytest.raises(InputError, match="has observed positions already"):
        read_project(request(files, "block", camera=CameraSpec(), positions=str(files / "geo.csv")))
    with pytest.raises(InputError, match="point 't0' has coordinates already"):
        read_project(request(files, "block", camera=CameraSpec(), control=str(files / "gcp.csv")))
    write_block(replace(block, crs="EPSG:32647"), files / "utm")
    with pytest.raises(InputError, match="the block is in EPSG:32647, not in EPSG:25832"):
        read_project(request(files, "utm", camera=CameraSpec(), stated=Statements(crs="EPSG:25832")))


def test_cameras_of_a_file(files):
    (files / "cameras.toml").write_text(CAMERAS_TOML)
    block = read_project(request(files, camera=CameraSpec(file=files / "cameras.toml"))).block
    # the files of image points name the camera
    assert [camera.name for camera in block.cameras] == ["cam"]
    assert block.cameras[0].focal_length_mm == 41.0
    (files / "cameras.toml").write_text(CAMERAS_TOML[: CAMERAS_TOML.index("[camera.cam]")])
    block = read_project(
        request(files, camera=CameraSpec(file=files / "cameras.toml", free=True, flight_axis="+x"))
    ).block
    assert block.cameras[0].brown == {"K1": Prior(1e-6)}
    assert [prior.kind for prior in block.cameras[0].interior.values()] == ["free"] * 3
    assert block.cameras[0].flight_axis == "+x"


WRONG_CAMERAS = {
    "none": (CameraSpec(), "the camera is not known"),
    "no pixel": (
        CameraSpec(size_px=(8000, 6000)),
        "the camera needs both the size of the photograph and the size of a pixel",
    ),
    "no focal": (replace(SPEC, focal_length_mm=None), "the principal distance is not known"),
    "too small": (replace(SPEC, size_px=(800, 600)), "lies outside the format of camera 'P1'"),
}


@pytest.mark.parametrize(("spec", "says"), WRONG_CAMERAS.values(), ids=WRONG_CAMERAS)
def test_cameras_that_will_not_do(files, spec, says):
    with pytest.raises(InputError, match=re.escape(says)):
        read_project(request(files, camera=spec))


def test_camera_files_that_will_not_do(files):
    for name, text, says in (
        (
            "a.toml",
            CAMERAS_TOML.replace("pixel_um", "pixel_um = 5.0\npixel", 1),
            "a.toml:4: unknown key 'camera.P1.pixel'",
        ),
        (
            "b.toml",
            CAMERAS_TOML.replace("camera.cam", "camera.other"),
            "camera 'cam' is not described; there are P1, other",
        ),
        ("c.toml", "name = 1\n", "c.toml"),
        ("d.txt", "nothing", "d.txt: does not describe a camera"),
    ):
        (files / name).write_text(text)
        with pytest.raises(InputError, match=re.escape(says)):
            read_project(request(files, camera=CameraSpec(file=files / name)))
    with pytest.raises(InputError, match=r"none\.toml: there is no such file"):
        read_project(request(files, camera=CameraSpec(file=files / "none.toml")))


def test_format_that_the_name_of_the_camera_tells(files):
    named = (files / "points.txt").read_text().replace(" cam\n", " H_40.0_30.0\n")
    (files / "named.txt").write_text(named)
    assert read_project(request(files, "named.txt")).block.cameras[0].name == "P1"
    with pytest.raises(InputError, match=re.escape("has a format of 40 × 30 mm, the options give 32 × 24 mm")):
        read_project(request(files, "named.txt", camera=replace(SPEC, pixel_um=4.0)))


STRANGE = {
    "no file": ({"source": "none.txt"}, "none.txt: there is no such file"),
    "kind": ({"source": "gcp.csv"}, "gcp.csv: is of no known format"),
    "control kind": ({"control": "points.txt"}, "points.txt: is not in a known format of control points"),
    "control missing": ({"control": "none.csv"}, "none.csv: there is no such file"),
    "folder": ({"control": "patb"}, "patb: is"),
    "check": ({"control": "gcp.csv", "check": ("t1",)}, "--check t1: there is no such control point"),
    "shift": ({"gnss_shift": "on"}, "--gnss-shift 'on' is not possible"),
    "axes": ({"stated": Statements(axes="zy")}, "--axes 'zy' is not possible"),
    "two sigmas": ({"image_sigma_um": 1.0, "image_sigma_px": 1.0}, "exclude each other"),
    "offset": ({"orientation": "opk.txt", "offset": "shift.xyz"}, "is not an orientation of Pix4D"),
    "prefix": ({"stated": Statements(control_prefix="t")}, "--control-prefix is given, but no control points"),
    "patb": ({"stated": Statements(patb_rotation="up")}, "--patb-rotation 'up' is not possible"),
    "crs": ({"stated": Statements(crs="UTM 47")}, "crs 'UTM 47' is not understood"),
    "crs unknown": ({"stated": Statements(crs="EPSG:99999999")}, "is not known to PROJ"),
    "heights": (
        {"control": "gcp.csv", "stated": Statements(control_heights="geoid")}, "--control-heights 'geoid'",
    ),
    "no other heights": (
        {"control": "gcp.csv", "stated": Statements(control_heights="ellipsoidal")}, "is not needed",
    ),
    "alteration": (
        {"orientation": "opk.txt", "stated": Statements(linear_alteration_m=0.0)}, "--linear-alteration needs",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("changes", "says"), STRANGE.values(), ids=STRANGE)
def test_strange_requests(files, changes, says):
    (files / "shift.xyz").write_text("1 2 3")
    paths = {k: str(files / v) if k in ("control", "orientation", "offset") else v for k, v in changes.items()}
    with pytest.raises(InputError, match=re.escape(says)):
        read_project(request(files, **paths))


def test_yaw_pitch_roll_count_from_true_north(files):
    """The top of a photograph that flies true north points off grid north by the convergence of 0.506°."""
    rows = ["p0.jpg 717000 1608000 150 0 0 0", "p1.jpg 717000 1608000 150 90 0 0", "p2.jpg 717000 1608000 150 0 10 0"]
    (files / "geo.txt").write_text("EPSG:32647\n" + "\n".join(f"{row} 0.1 0.2" for row in rows))
    reading = read_project(request(files, positions=str(files / "geo.txt"), gnss_shift="off"))
    assert "yaw, pitch, roll of 3 photographs are start values, turned by -0.506° to grid north" in reading.messages
    rotation = rotation_from_angles(reading.block.images.angles)
    convergence = np.radians(0.50562)
    # up in the image: grid azimuth −γ, and 90° − γ
    np.testing.assert_allclose(rotation[0][:, 1], [-np.sin(convergence), np.cos(convergence), 0], atol=1e-5)
    np.testing.assert_allclose(rotation[1][:, 1], [np.cos(convergence), np.sin(convergence), 0], atol=1e-5)
    # nose up by 10°: the camera looks ahead
    np.testing.assert_allclose(
        -rotation[2][:, 2], [-0.0015, np.sin(np.radians(10)), -np.cos(np.radians(10))], atol=1e-4
    )
    np.testing.assert_array_equal(reading.block.images.centre[0], [717000, 1608000, 150])
    assert np.isnan(reading.block.images.angles[3]).all()


def test_convergence_against_the_local_frame():
    """Yaw 0 and the axes of the frame at the place give the same north as longitude and latitude do."""
    xyz = np.array([[717000.0, 1606000.0, 150.0]])
    rotation, _ = rotation_from_yaw_pitch_roll(np.zeros((1, 3)), xyz, "EPSG:32647")
    frame = local_frame("EPSG:32647", xyz)
    place = frame.georeference.to_geographic(xyz)
    north = frame.georeference.from_geographic(place + [[0, 1e-6, 0]])
    in_frame = frame.to_local(north) - frame.to_local(xyz)
    expected = frame.axes_at(xyz)[0] @ rotation[0][:, 1]
    np.testing.assert_allclose(expected, (in_frame / np.linalg.norm(in_frame))[0], atol=1e-6)


def test_yaw_pitch_roll_of_a_local_block_are_left_out(files):
    (files / "geo2.csv").write_text("p0.jpg,717000,1608000,150,90,0,0,.1,.1\n")
    reading = read_project(request(files, positions=str(files / "geo2.csv"), gnss_shift="off"))
    assert any(said.startswith("yaw, pitch, roll count from true north and were left out") for said in reading.messages)
    assert np.isnan(reading.block.images.angles).all()


def test_longitude_and_latitude_in_a_block_of_utm(files):
    (files / "lonlat.csv").write_text("image,lon,lat,alt,acc\np0.jpg,101.013526,14.517,150,0.5\n")
    with pytest.raises(InputError, match="the block has no coordinate system"):
        read_project(request(files, positions=str(files / "lonlat.csv"), stated=Statements(crs="local")))
    reading = read_project(request(files, positions=str(files / "lonlat.csv"), stated=Statements(crs="EPSG:32647")))
    from pyproj import Transformer

    expected = Transformer.from_crs("EPSG:4326", "EPSG:32647", always_xy=True).transform(101.013526, 14.517)
    assert reading.block.gnss_ins is not None
    np.testing.assert_allclose(reading.block.gnss_ins.xyz, [[*expected, 150]], rtol=0, atol=1e-6)


def test_orientations_of_pix4d_are_shifted(files):
    from aerotri.formats.foreign.pix4d import write_pix4d_eo

    write_pix4d_eo(oriented_sample(), files / "eo.txt")
    (files / "eo_offset.xyz").write_text("717000 1606000 0\n")
    reading = read_project(request(files, orientation=str(files / "eo.txt"), offset=files / "eo_offset.xyz"))
    np.testing.assert_allclose(reading.block.images.centre, oriented_sample(shift=UTM).centre, rtol=0, atol=5.1e-7)
    observed = Statements(orientation_sigma_m=(0.1, 0.1, 0.1))
    with pytest.raises(InputError, match="has observed positions already"):
        read_project(request(files, "block", camera=CameraSpec(), orientation=str(files / "opk.txt"), stated=observed))


def test_coordinates_of_another_datum_are_refused():
    with pytest.raises(InputError, match="are on different datums"):
        to_crs(np.array([[500000.0, 5700000.0, 0.0]]), "EPSG:25832", "EPSG:32632", None)
    with pytest.raises(InputError, match="has no plan position"):
        to_crs(np.array([[np.nan, np.nan, 5.0]]), "EPSG:4326", "EPSG:32632", None)
    found = to_crs(np.array([[9.0, 51.0, np.nan]]), "EPSG:4326", "EPSG:32632", None)
    np.testing.assert_allclose(found, [[500000.0, 5649824.0, np.nan]], atol=1.0)


def test_ellipsoidal_heights(shared_data):
    geoid = shared_data("ultracam_eagle_m3") / "fr_ign_RAF20.tif"
    points = np.array([[815601.51, 6283629.28, 54.96], [815601.51, 6283629.28, np.nan]])
    found = from_ellipsoidal_heights(points, "EPSG:2154+5720", geoid)
    np.testing.assert_allclose(found[0, 2], 5.6139, atol=1e-3)
    assert np.isnan(found[1, 2])
    with pytest.raises(InputError, match="no plan position"):
        from_ellipsoidal_heights(np.array([[np.nan, np.nan, 5.0]]), "EPSG:2154+5720", geoid)
    assert plan_of("EPSG:2154+5720") == "EPSG:2154"


def test_true_heights_against_the_scale_of_the_projection():
    """Lambert-93 at Montpellier: the scale by PROJ's own factors."""
    from pyproj import Proj, Transformer

    centre = np.array([[814975.925, 6283986.148, 1771.28]])
    lon, lat = Transformer.from_crs("EPSG:2154", "EPSG:4171", always_xy=True).transform(*centre[0, :2])
    scale = Proj("EPSG:2154").get_factors(lon, lat).meridional_scale
    expected = (1771.28 + (scale - 1.0) * 5.0) / scale
    np.testing.assert_allclose(true_heights(centre, "EPSG:2154+5720", 5.0)[0, 2], expected, rtol=0, atol=1e-5)


def test_models_of_a_block_with_crs_are_written_in_its_local_frame(tmp_path):
    """Rays that meet in the local frame meet in the model."""
    from aerotri.formats.foreign.bundler import read_bundler

    local = oriented_sample()
    frame = local_frame("EPSG:32647", np.array([[717000.0, 1606000.0, 0.0]]))
    centre, points = frame.from_local(local.centre), frame.from_local(local.points)
    rotation = np.swapaxes(frame.axes_at(centre), 1, 2) @ local.rotation
    images = replace(local.block.images, centre=centre, angles=angles_from_rotation(rotation))
    control = replace(local.block.control, xyz=points[local.block.control.point])
    block = replace(local.block, crs="EPSG:32647", images=images, control=control, gnss_ins=None)
    oriented = replace(local, block=block, centre=centre, rotation=rotation, points=points)
    said = write_oriented(oriented, tmp_path / "model", "bundler")
    assert said[-1].startswith("coordinates are local: east, north of the grid and up around longitude 101.0")
    reading = read_bundler(tmp_path / "model", 5.0)
    assert reading.points is not None
    np.testing.assert_allclose(
        reading.block.image_points.xy, prediction(reading.block, reading.points), rtol=0, atol=1e-7
    )
    in_frame, _ = in_local_frame(oriented)
    assert in_frame.block.crs == "local"


def test_photographs_alone(shared_data, tmp_path):
    """Four DMC photographs of NGI: orientations as start values, no image points."""
    from aerotri.formats.block.folder import read_block

    folder = shared_data("dmc_ngi")
    spec = CameraSpec(file=folder / "config.yaml")
    reading = read_project(Request(str(folder / "camera_pos_ori.txt"), "dmc", camera=spec))
    block = reading.block
    assert (len(block.images), len(block.image_points)) == (4, 0)
    np.testing.assert_array_equal(block.images.centre[0], [-55094.50448, -3727407.03748, 5258.30793])
    np.testing.assert_allclose(np.degrees(block.images.angles[0]), [-0.349216, 0.298484, -179.086702], atol=1e-12)
    assert block.cameras[0].name == "Integraph DMC"
    write_any(block, tmp_path / "dmc")
    again = read_block(tmp_path / "dmc", rays_needed=False)
    np.testing.assert_array_equal(again.images.centre, block.images.centre)
