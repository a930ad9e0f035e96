"""Metashape's camera calibrations: the manual's formulas by hand, there and back, damaged files."""

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import CAMERA, oriented_sample

from aerotri.conventions import InputError, mm_from_px
from aerotri.formats.assembly.camera_spec import CameraSpec, cameras_of
from aerotri.formats.convert import write_oriented
from aerotri.formats.foreign.metashape_camera import expressible, read_metashape_camera
from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.observations import Prior

XML = """<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>{projection}</projection>
  <width>4000</width>
  <height>3000</height>
  <f>2400.5</f>
  <cx>12.5</cx>
  <cy>-7.25</cy>
  <b1>1.5</b1>
  <b2>-0.75</b2>
  <k1>-0.05</k1>
  <k2>0.01</k2>
  <k3>-0.002</k3>
  <k4>0.0005</k4>
  <p1>0.001</p1>
  <p2>-0.002</p2>
  <date>2026-01-01T00:00:00Z</date>
</calibration>
"""


@pytest.fixture
def file(tmp_path):
    def write(projection="frame", change=("", "")):
        path = tmp_path / "calibration.xml"
        path.write_text(re.sub(change[0], change[1], XML.format(projection=projection)) if change[0] else XML.format(
            projection=projection))  # fmt: skip
        return path

    return write


@pytest.mark.parametrize("projection", ["frame", "fisheye"])
def test_formulas_of_the_manual(file, projection):
    """u, v of a direction (X, Y, Z), x right, y down, z forwards, written out as the manual has it."""
    camera = read_metashape_camera(file(projection), 5.0)
    x, y = np.random.default_rng(1).uniform(-0.6, 0.6, (2, 50))
    if projection == "fisheye":
        r0 = np.hypot(x, y)
        a, b = x * np.arctan(r0) / r0, y * np.arctan(r0) / r0
    else:
        a, b = x, y
    r2 = a**2 + b**2
    radial = 1 - 0.05 * r2 + 0.01 * r2**2 - 0.002 * r2**3 + 0.0005 * r2**4
    xd = a * radial + 0.001 * (r2 + 2 * a**2) + 2 * -0.002 * a * b
    yd = b * radial - 0.002 * (r2 + 2 * b**2) + 2 * 0.001 * a * b
    u = 2000 + 12.5 + xd * 2400.5 + xd * 1.5 + yd * -0.75
    v = 1500 - 7.25 + yd * 2400.5
    ours = camera.focal_length_mm * lens.distort(x, -y, lens.vector_of(camera)) + np.array(camera.principal_point_mm)
    expected = mm_from_px(np.column_stack([u, v]), camera.size_px, camera.pixel_mm)
    np.testing.assert_allclose(ours, expected, atol=1e-12)
    assert all(prior.fixed for prior in (*camera.lens.values(), *camera.interior.values()))


@pytest.mark.parametrize("projection", ["frame", "fisheye"])
def test_there_and_back(file, tmp_path, projection):
    (camera,) = cameras_of(CameraSpec(file=file(projection), pixel_um=5.0), (), np.array([]), np.array([]))
    said = write_oriented(oriented_sample(camera), tmp_path / "again.xml", "metashape-camera")
    assert all(text.startswith("could not be carried over") and "lens" not in text for text in said)
    again = read_metashape_camera(tmp_path / "again.xml", 5.0)
    assert again.projection == camera.projection
    for own, other in ((again.lens, camera.lens), (again.interior, camera.interior)):
        assert {k: p.value for k, p in own.items()} == pytest.approx({k: p.value for k, p in other.items()}, rel=1e-14)


def test_brown_is_fitted_and_the_residual_is_true():
    camera = replace(CAMERA, brown={"K1": Prior(-3e-6), "P1": Prior(2e-6), "b1": Prior(1e-4)})
    fitted, (said,) = expressible(camera)
    largest = float(said.split("at most ")[1].split(" px")[0])
    assert largest < 0.05
    xy = np.random.default_rng(1).uniform(-1, 1, (200, 2)) * np.array(camera.half_format_mm)
    values = np.array([camera.brown[n].value if n in camera.brown else 0.0 for n in brown.ITEMS])
    ideal = (xy - brown.image_error(xy[:, 0], xy[:, 1], values)) / camera.focal_length_mm
    ours = lens.distort(*ideal.T, lens.vector_of(fitted)) * camera.focal_length_mm
    assert np.hypot(*(ours - xy).T).max() / camera.pixel_mm < 1.1 * largest


@pytest.mark.parametrize(
    ("projection", "change", "says"),
    [
        ("spherical", ("", ""), "projection 'spherical' cannot be expressed"),
        ("frame", ("<f>2400.5</f>", ""), "has no <f>"),
        ("frame", ("<f>2400.5", "<f>0"), "not greater than 0"),
        ("frame", ("<width>4000", "<width>40.5"), "no format"),
        ("frame", ("<date>.*</date>", "<p3>0.1</p3>"), "<p3> cannot be expressed"),
    ],
)
def test_errors(file, projection, change, says):
    with pytest.raises(InputError, match=re.escape(says)):
        read_metashape_camera(file(projection, change), 5.0)


def test_size_of_pixels_is_needed(file):
    with pytest.raises(InputError, match="does not tell the size of a pixel"):
        cameras_of(CameraSpec(file=file()), (), np.array([]), np.array([]))
