"""Metashape's projects and cameras: the manual's formulas by hand, there and back, damaged and hostile files."""

from __future__ import annotations

import re
import zipfile
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from metashape_sample import LAT, LON, Sample, archive, earth_centred

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.coordinates.local_frame import topocentric_frame
from aerotri.formats.assembly.oriented import oriented_block
from aerotri.formats.convert import detect_format, write_oriented
from aerotri.formats.foreign.metashape_files import open_project
from aerotri.formats.foreign.metashape_markers import read_metashape_markers
from aerotri.formats.foreign.metashape_project import read_metashape_project
from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Prior

CRS = {"utm": "EPSG:25832", "degrees": "EPSG:25832", "local": "local"}


def local(reading):
    """Centres, rotations and points in the axes of the sample."""
    block = reading.block
    rotation = rotation_from_angles(block.images.angles)
    if block.crs == "local":
        shift = [1000.0, 2000.0, 0.0]
        return block.images.centre - shift, rotation, reading.points - shift
    frame = topocentric_frame(block.crs, np.array([LON, LAT, 350.0]))
    turned = frame.axes_at(block.images.centre) @ rotation
    return frame.to_local(block.images.centre), turned, frame.to_local(reading.points)


@pytest.mark.parametrize("ending", [".psx", ".psz", ".xml"])
@pytest.mark.parametrize("system", ["utm", "degrees", "local"])
def test_project(tmp_path, ending, system):
    sample = Sample(system)
    path = sample.write(tmp_path, ending)
    assert detect_format(path) == "metashape-project"
    reading = read_metashape_project(path)
    block = reading.block
    assert block.crs == CRS[system]
    assert block.images.names.tolist() == [f"DJI_{k}.JPG" for k in range(6)]
    assert [camera.name for camera in block.cameras] == ["camera 0", "camera 1"]
    assert [camera.projection for camera in block.cameras] == ["perspective", "fisheye"]
    assert block.cameras[0].pixel_um == pytest.approx(4.0)
    assert block.cameras[0].lens["k4"] == Prior(5e-4, fixed=True)
    assert not block.cameras[0].lens["k1"].fixed
    assert block.settings.adjustment.datum == "control"
    centre, rotation, points = local(reading)
    np.testing.assert_allclose(centre, sample.centre, atol=1e-6)
    np.testing.assert_allclose(rotation, sample.rotation, atol=1e-9)
    # markers: coordinates, σ, check point
    assert [str(block.points[k]) for k in block.control.point] == [f"gcp {k}" for k in range(5)]
    assert block.control.is_check.tolist() == [False] * 4 + [True]
    np.testing.assert_allclose(block.control.sigma[:2], [[0.03] * 3, [0.01, 0.02, 0.04]])
    assert block.gnss_ins is not None
    np.testing.assert_allclose(block.gnss_ins.sigma, np.tile([0.02, 0.02, 0.03], (6, 1)))
    frame = None if system == "local" else topocentric_frame(block.crs, np.array([LON, LAT, 350.0]))
    there = block.control.xyz - [1000.0, 2000.0, 0.0] if frame is None else frame.to_local(block.control.xyz)
    np.testing.assert_allclose(there, sample.points[-5:], atol=1e-6)
    observed = block.gnss_ins.xyz - [1000.0, 2000.0, 0.0] if frame is None else frame.to_local(block.gnss_ins.xyz)
    np.testing.assert_allclose(observed, sample.centre + 0.01, atol=1e-6)
    # image points: of markers the pinned ones, of tie points those with a place, once
    rays, names = block.image_points, block.points.tolist()
    known = np.array([int(names[p][1:]) - 1000 if names[p][0] == "t" else 55 + int(names[p][-1]) for p in rays.point])
    ties = 0 if ending == ".xml" else int(sample.seen[:, :55].sum())
    assert len(rays) == int(sample.seen[[0, 2, 3, 4, 5], 55:].sum()) + ties
    px = np.empty_like(rays.xy)
    for number, camera in enumerate(block.cameras):
        own = block.images.camera[rays.image] == number
        px[own] = px_from_mm(rays.xy[own], camera.size_px, camera.pixel_mm)
    np.testing.assert_allclose(px, sample.px[rays.image, known], atol=1e-3)
    is_marker = known >= 55
    np.testing.assert_allclose(rays.sigma[is_marker], 0.25 * 0.004)
    np.testing.assert_allclose(rays.sigma[~is_marker], 0.5 * 0.004)
    if ties:
        np.testing.assert_allclose(points[5:], sample.points[[int(name[1:]) - 1000 for name in names[5:]]], atol=1e-4)
    # the lens of the block projects where the manual says
    for number, camera in enumerate(block.cameras):
        own = block.images.camera[rays.image] == number
        u = np.einsum("mji,mj->mi", rotation[rays.image[own]], sample.points[known[own]] - centre[rays.image[own]])
        bent = lens.distort(*(-u[:, :2] / u[:, 2:]).T, lens.vector_of(camera))
        np.testing.assert_allclose(
            camera.focal_length_mm * bent + camera.principal_point_mm, rays.xy[own], rtol=0, atol=1e-5
        )


def test_it_adjusts_and_goes_back(tmp_path):
    """Read, adjusted with the interior free, written as cameras and read again."""
    sample = Sample("utm")
    block = aerotri.read(sample.write(tmp_path, ".psx")).block
    result = aerotri.adjust(block)
    assert result.status == "converged"
    aerotri.convert(result, tmp_path / "cameras.xml", "metashape-xml")
    again = read_metashape_project(tmp_path / "cameras.xml").block
    adjusted = result.adjusted
    np.testing.assert_allclose(again.images.centre, adjusted.images.centre, rtol=0, atol=1e-5)
    np.testing.assert_allclose(
        rotation_from_angles(again.images.angles), rotation_from_angles(adjusted.images.angles), atol=1e-9
    )
    assert again.control.is_check.tolist() == block.control.is_check.tolist()
    np.testing.assert_allclose(again.control.xyz, block.control.xyz, rtol=0, atol=1e-6)
    np.testing.assert_allclose(again.control.sigma, block.control.sigma)
    # earth-centred coordinates as Metashape computes them: the chunk's transform after the camera's
    root = ElementTree.parse(tmp_path / "cameras.xml").getroot()
    chunk = root.find("chunk")
    assert chunk is not None
    parts = [np.array((chunk.findtext(f"transform/{key}") or "").split(), float) for key in ("rotation", "translation")]
    poses = [np.array((node.text or "").split(), float).reshape(4, 4) for node in chunk.iter("transform") if node.text
             and len(node.text.split()) == 16]  # fmt: skip
    world = np.array([parts[0].reshape(3, 3) @ pose[:3, 3] + parts[1] for pose in poses])
    frame = topocentric_frame("EPSG:25832", np.array([LON, LAT, 350.0]))
    np.testing.assert_allclose(world, earth_centred(frame.to_local(adjusted.images.centre)), rtol=0, atol=1e-4)


@pytest.mark.parametrize("crs", ["local", "EPSG:25832"])
def test_there_and_back(tmp_path, crs):
    sample = Sample("utm" if crs != "local" else "local")
    reading = read_metashape_project(sample.write(tmp_path, ".psz"))
    assert reading.points is not None
    oriented = oriented_block(reading.block, reading.points)
    said = write_oriented(oriented, tmp_path / "cameras.xml", "metashape-xml")
    assert any("image points" in text for text in said)
    again = read_metashape_project(tmp_path / "cameras.xml").block
    assert again.crs == crs
    for one, two in zip(again.cameras, reading.block.cameras, strict=True):
        assert one.size_px == two.size_px
        np.testing.assert_allclose(one.focal_length_mm, two.focal_length_mm, rtol=1e-14)
        np.testing.assert_allclose(lens.vector_of(one), lens.vector_of(two), rtol=1e-12)
    np.testing.assert_allclose(again.images.centre, oriented.centre, rtol=0, atol=1e-5)
    np.testing.assert_allclose(rotation_from_angles(again.images.angles), oriented.rotation, atol=1e-9)


def test_rigs(tmp_path):
    """A sensor that another leads is a camera of a rig; the photographs of one exposure stand together."""
    block = read_metashape_project(Sample("utm", rig=True).write(tmp_path, ".psx")).block
    (rig,) = block.rigs
    assert (rig.reference, list(rig.cameras)) == ("camera 0", ["camera 1"])
    assert block.images.columns["station"].tolist() == ["10", "11", "12", "10", "11", "12"]
    write_oriented(oriented_block(block, np.full((len(block.points), 3), np.nan)), tmp_path / "x.xml", "metashape-xml")
    again = read_metashape_project(tmp_path / "x.xml").block
    assert again.rigs == block.rigs
    assert again.images.columns["station"].tolist() == ["0", "1", "2", "0", "1", "2"]


def test_points_that_another_component_sees(tmp_path):
    """They have places in axes of their own, while photographs are brought into those of the active component."""
    sample = Sample("local")
    path = sample.write(tmp_path, ".psz")
    with zipfile.ZipFile(path) as file:
        files = {name: file.read(name) for name in file.namelist()}
    text = re.sub(r'(<camera id="12")', r'\1 component_id="1"', files["doc.xml"].decode())
    active = re.search(r"<transform><rotation>.*?</transform>", text, re.DOTALL)[0]
    other = active.replace("<scale>100.0<", "<scale>50.0<")
    parts = f'<component id="0">{active}</component><component id="1">{other}</component>'
    text = text.replace("<frames", f'<components active_id="0">{parts}</components><frames')
    path.write_bytes(archive(files | {"doc.xml": text.encode()}))
    reading = read_metashape_project(path)
    assert np.isfinite(reading.block.images.centre).all()
    of_point = np.array([int(name[1:]) - 1000 for name in reading.block.points[5:].tolist()])
    elsewhere = sample.seen[2, of_point]
    assert 5 < np.sum(elsewhere) < len(elsewhere) - 5
    points = local(reading)[2][5:]
    assert np.isnan(points[elsewhere]).all()
    np.testing.assert_allclose(points[~elsewhere], sample.points[of_point[~elsewhere]], atol=1e-4)


def test_without_orientation_and_transform(tmp_path):
    """References alone give a block that can be adjusted from its image points."""
    path = Sample("utm").write(tmp_path, ".xml")
    text = re.sub(r"<transform>.*?</transform>", "", path.read_text(), flags=re.DOTALL)
    path.write_text(text)
    reading = read_metashape_project(path)
    assert np.isnan(reading.block.images.centre).all()
    assert len(reading.block.control) == 5
    assert reading.block.crs == "EPSG:25832"
    assert "the chunk is not georeferenced" in reading.messages


def changed(old, new):
    def change(path):
        text = path.read_text()
        assert re.search(old, text, re.DOTALL)
        path.write_text(re.sub(old, new, text, count=1, flags=re.DOTALL))

    return change


WRONG = {
    "cut off": (changed(r"</chunk>.*", ""), "is not XML"),
    "entities": (changed(r"<document", '<!DOCTYPE x [<!ENTITY a "a">]><document'), "declares a document type"),
    "no chunk": (changed(r"<cameras.*</cameras>", ""), "holds no chunk with photographs"),
    "no photographs": (changed(r"<group.*</group>", ""), "holds no photographs"),
    "twice": (changed(r'label="DJI_1.JPG"', 'label="DJI_0.JPG"'), "two of its photographs are called 'DJI_0.JPG'"),
    "id": (changed(r'camera id="11"', 'camera id="10"'), "two of its photographs have the id '10'"),
    "name": (changed(r'label="DJI_1.JPG"', 'label="a&#10;b"'), "cannot be the name of a photograph"),
    "sensor": (changed(r'sensor_id="1"', 'sensor_id="7"'), "a sensor '7' that is not described"),
    "spherical": (changed(r'type="fisheye"', 'type="spherical"'), "is of type spherical"),
    "size": (changed(r'width="4000"', 'width="0.5"'), "width and height of sensor"),
    "focal": (changed(r"<f>2400.5", "<f>-1"), "the focal length of sensor 'camera 0' is not greater than 0"),
    "number": (changed(r"<f>2400.5", "<f>2_400"), "f of sensor 'camera 0' = '2_400' is not a number"),
    "p3": (changed(r"<k1>", "<p3>1</p3><k1>"), "p3 of sensor 'camera 0' cannot be expressed"),
    "old": (changed(r"<f>2400.5</f>", "<fx>1</fx>"), "old PhotoScan"),
    "pose": (changed(r"<transform>", "<transform>1 "), "does not have 16 numbers"),
    "rotation": (changed(r"<transform>[-0-9.]+", "<transform>7"), "is no rotation"),
    "nan": (changed(r"<transform>[-0-9.]+", "<transform>nan"), "= 'nan' is not a number"),
    "scale": (changed(r"<scale>100.0", "<scale>0"), "scale is not greater than 0"),
    "earth": (changed(r"<translation>[^<]*", "<translation>1 2 3"), "does not lie on the earth"),
    "reference": (changed(r"<reference>[^<]*", '<reference>PROJCS["x"]'), "has no EPSG code"),
    "system": (changed(r"25832&quot;]]</reference>", "99999&quot;]]</reference>"), "is not known to PROJ"),
    "marker": (changed(r'marker id="1"', 'marker id="0"'), "two of its markers have the id '0'"),
    "place": (changed(r'<location camera_id="10" pinned="true" x="', '<location camera_id="10" pinned="true" x="x'),
              "x of a marker"),
    "again": (changed(r'(<location camera_id="10"[^>]*/>)', r"\1\1"), "is twice in a photograph"),
    "accuracy": (changed(r'accuracy_markers" value="0.03', 'accuracy_markers" value="much'), "accuracy_markers"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, change, says):
    path = Sample("utm").write(tmp_path, ".xml")
    change(path)
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_metashape_project(path)
    assert caught.value.remedy
    assert caught.value.file is not None


@pytest.mark.parametrize("read", [read_metashape_project, read_metashape_markers])
@pytest.mark.parametrize("tag", ["camera_crs", "markers_reference"])
def test_systems_of_cameras_and_markers(tmp_path, read, tag):
    """The chunk's own system may be repeated; another one, in which coordinates count, is refused."""
    path = Sample("utm").write(tmp_path, ".xml")
    text = path.read_text()
    own = re.search(r"<reference>(PROJCS.*?)</reference>", text)
    assert own is not None
    path.write_text(text.replace(own[0], f"{own[0]}<{tag}>{own[1]}</{tag}>"))
    read(path)
    path.write_text(text.replace(own[0], f"{own[0]}<{tag}>{own[1].replace('25832', '25833')}</{tag}>"))
    with pytest.raises(InputError, match="another coordinate system") as caught:
        read(path)
    assert tag in caught.value.message


def damaged_archive(path, name, content):
    """The archive with one file other, or missing where the content is None."""
    with zipfile.ZipFile(path) as file:
        files = {key: file.read(key) for key in file.namelist()}
    files |= {name: content} if content is not None else {}
    path.write_bytes(archive({key: value for key, value in files.items() if key != name or content is not None}))


PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex %s\nproperty float x\nproperty float y\nproperty uint id\n"
HOSTILE = {
    "no archive": (lambda path: path.write_bytes(b"PK\3\4" + b"x" * 100), "is no archive"),
    "cut off": (lambda path: path.write_bytes(path.read_bytes()[:-300]), "is no archive"),
    "no document": (lambda path: damaged_archive(path, "doc.xml", None), "holds no doc.xml"),
    "bomb": (lambda path: damaged_archive(path, "doc.xml", b" " * (40 << 20)), "would grow to"),
    "no points": (lambda path: damaged_archive(path, "p0.ply", None), "holds no p0.ply"),
    "no ply": (lambda path: damaged_archive(path, "p0.ply", b"x"), "is no binary PLY file"),
    "ascii": (lambda path: damaged_archive(path, "p0.ply", b"ply\nformat ascii 1.0\nend_header\n"), "is no binary PLY"),
    "count": (lambda path: damaged_archive(path, "p0.ply", PLY % b"99999999999" + b"end_header\n"), "is cut off"),
    "negative": (lambda path: damaged_archive(path, "p0.ply", PLY % b"-1" + b"end_header\n"), "has no vertices"),
    "lists": (lambda path: damaged_archive(path, "p0.ply", PLY % b"0" + b"property list uchar int i\nend_header\n"),
              "properties that are no numbers"),
    "lacks": (lambda path: damaged_archive(path, "points0.ply", PLY % b"0" + b"end_header\n"), "lacks id or x or y"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "says"), HOSTILE.values(), ids=HOSTILE)
def test_hostile_archives(tmp_path, change, says):
    path = Sample("utm").write(tmp_path, ".psz")
    change(path)
    with pytest.raises(InputError, match=re.escape(says)):
        read_metashape_project(path)


def test_bits_of_an_archive(tmp_path):
    """A changed byte anywhere gives a block or an error with a remedy."""
    path = Sample("utm").write(tmp_path, ".psz")
    raw, rng = path.read_bytes(), np.random.default_rng(1)
    remedies = []
    for place in rng.integers(0, len(raw), 60).tolist():
        path.write_bytes(raw[:place] + bytes([raw[place] ^ 0x55]) + raw[place + 1 :])
        try:
            read_metashape_project(path)
        except InputError as error:
            remedies.append(error.remedy)
    assert remedies
    assert all(remedies)


def test_files_that_are_missing_or_elsewhere(tmp_path):
    path = Sample("utm").write(tmp_path, ".psx")
    path.write_text('<document path="../other/project.zip"/>')
    with pytest.raises(InputError, match="outside of its folder"):
        read_metashape_project(path)
    path.write_text('<document path="{projectname}.files/project.zip"/>')
    (tmp_path / "site.files/0/0/frame.zip").unlink()
    with pytest.raises(InputError, match="there is no such file"):
        read_metashape_project(path)
    (tmp_path / "site.files/0/chunk.zip").unlink()
    with pytest.raises(InputError, match="there is no such file"):
        read_metashape_project(path)


def test_additional_parameters_are_fitted(tmp_path):
    reading = read_metashape_project(Sample("local").write(tmp_path, ".psz"))
    assert reading.points is not None
    cameras = (replace(reading.block.cameras[0], brown={"K1": Prior(1e-5)}), reading.block.cameras[1])
    oriented = oriented_block(replace(reading.block, cameras=cameras), reading.points)
    said = write_oriented(oriented, tmp_path / "cameras.xml", "metashape-xml")
    assert any("Metashape has no words for" in text for text in said)


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_damaged_members_of_every_compression(tmp_path, method):
    path = tmp_path / "site.psz"
    with zipfile.ZipFile(path, "w", method) as file:
        file.writestr("doc.xml", "<document>" + "<a b='1'/>" * 500 + "</document>")
    whole = path.read_bytes()
    begin = whole.index(b"doc.xml") + len("doc.xml")
    end = whole.index(b"PK\x01\x02")
    for at in range(begin, end, 3):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        with pytest.raises(InputError):
            open_project(path)


@pytest.mark.parametrize("system", ["utm", "degrees", "local"])
def test_markers_alone(tmp_path, system):
    """File > Export > Markers: added as control to a block from elsewhere, image points included."""
    sample = Sample(system)
    whole = sample.write(tmp_path, ".xml")
    text = whole.read_text()
    text = re.sub(r"(?s)<transform>.*?</transform>", "", text)
    # exported markers have sensors without calibration
    text = re.sub(r"(?s)<calibration.*?</calibration>", "", text)
    path = tmp_path / "markers.xml"
    path.write_text(text)
    found = read_metashape_markers(path)
    assert found.crs == {"utm": "EPSG:25832", "degrees": "EPSG:4258", "local": ""}[system]
    assert found.is_check.tolist() == [False] * 4 + [True]
    np.testing.assert_allclose(found.sigma[:2], [[0.03] * 3, [0.01, 0.02, 0.04]])
    assert any("0.25 pixels" in text for text in found.messages)
    without = re.sub(r"(?s)<markers>.*?</markers>", "", whole.read_text())
    (tmp_path / "cameras.xml").write_text(re.sub(r"<frames.*?</frames>", "", without, flags=re.S))
    reading = aerotri.read(tmp_path / "cameras.xml", control=str(path))
    expected = aerotri.read(whole).block
    block = reading.block
    assert len(block.control) == 5
    order = [block.points.tolist().index(name) for name in expected.points[expected.control.point].tolist()]
    assert sorted(block.points[block.control.point].tolist()) == sorted(block.points[order].tolist())
    np.testing.assert_allclose(block.control.xyz, expected.control.xyz, rtol=0, atol=1e-6)
    assert len(block.image_points) == len(expected.image_points)


def test_markers_that_are_not_there(tmp_path):
    path = tmp_path / "markers.xml"
    path.write_text('<document version="1.2.0"><chunk><cameras><camera id="0" label="a"/></cameras></chunk></document>')
    with pytest.raises(InputError, match="holds no markers"):
        read_metashape_markers(path)
