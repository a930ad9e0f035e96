"""Lists of what was measured: written and read again."""

from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample

from aerotri.conventions import InputError, mm_from_px
from aerotri.formats.convert import write_any
from aerotri.formats.foreign.ign import read_ign_app, read_ign_mes
from aerotri.formats.foreign.odm import read_odm_geo
from aerotri.formats.foreign.pix4d import read_pix4d_offset


def sample():
    return replace(oriented_sample().block, crs="EPSG:25832")


def test_ign_image_points(tmp_path):
    block = sample()
    said = write_any(block, tmp_path / "a.mes", "ign-mes")
    back = read_ign_mes(tmp_path / "a.mes")
    names = [(back.points[p], back.images[i]) for p, i in zip(back.point, back.image, strict=True)]
    rays, camera = block.image_points, block.cameras[0]
    assert names == [(block.points[p], block.images.names[i]) for p, i in zip(rays.point, rays.image, strict=True)]
    np.testing.assert_allclose(mm_from_px(back.xy, camera.size_px, camera.pixel_mm), rays.xy, atol=1e-8)
    assert any("could not be carried over" in words for words in said)


def test_ign_control(tmp_path):
    block = sample()
    write_any(block, tmp_path / "a.app", "ign-app")
    back = read_ign_app(tmp_path / "a.app")
    assert back.points.tolist() == block.points[block.control.point].tolist()
    np.testing.assert_allclose(back.xyz, block.control.xyz, atol=5e-5)


def test_odm_positions(tmp_path):
    block = sample()
    write_any(block, tmp_path / "geo.txt", "odm-geo")
    back = read_odm_geo(tmp_path / "geo.txt")
    observed = block.gnss_ins
    assert back.images.tolist() == block.images.names[observed.image].tolist()
    np.testing.assert_allclose(back.xyz, observed.xyz, atol=1e-6)
    np.testing.assert_allclose(back.sigma[:, 2], observed.sigma[:, 2], atol=1e-6)
    np.testing.assert_allclose(back.sigma[:, 0], observed.sigma[:, :2].max(axis=1), atol=1e-6)
    with pytest.raises(InputError, match="needs a coordinate system"):
        write_any(replace(block, crs="local"), tmp_path / "geo2.txt", "odm-geo")


def test_pix4d_offset(tmp_path):
    said = write_any(sample(), tmp_path / "a_offset.xyz", "pix4d-offset")
    np.testing.assert_array_equal(read_pix4d_offset(tmp_path / "a_offset.xyz"), 0.0)
    assert "the offset is zero" in said[0]
