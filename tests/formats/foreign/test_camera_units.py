"""Adjusted cameras in the parameters of Metashape and Pix4D, against the formulas of their manuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import px_from_mm
from aerotri.formats.foreign.camera_units import METASHAPE, PIX4D, cameras_elsewhere
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.report.pages.adjustment import report_html
from aerotri.report.tables.cameras_elsewhere import elsewhere_tables
from small_blocks import small_block


@pytest.fixture(scope="module")
def adjusted():
    """A block with a lens, a principal point beside the middle of the image, and all of them estimated."""
    block, _ = small_block(5, "lens:k1+k2+p1+p2")
    camera = block.cameras[0]
    interior = {name: replace(one, value=one.value + shift, sigma=0.05, fixed=False)
                for (name, one), shift in zip(camera.interior.items(), (0.0, 0.21, -0.13), strict=True)}  # fmt: skip
    return aerotri.adjust(replace(block, cameras=(replace(camera, interior=interior),)), explain=False).adjusted


def values_of(adjusted, program):
    (one,) = (one for one in cameras_elsewhere(adjusted) if one.program == program)
    return one


def seen(adjusted):
    """(n, 2) ideal positions for c = 1, y down, of the rays used, and (n, 2) px where they were adjusted."""
    block, rays = adjusted.block, adjusted.block.image_points
    used = adjusted.rays.status == RayStatus.USED
    rotation = rotation_from_angles(adjusted.images.angles, block.rotation)[rays.image[used]]
    away = adjusted.points.xyz[rays.point[used]] - adjusted.images.centre[rays.image[used]]
    x, y, z = np.einsum("nij,ni->jn", rotation, away)
    camera = block.cameras[0]
    at = px_from_mm(rays.xy[used] + adjusted.rays.v[used], camera.size_px, camera.pixel_mm)
    return np.column_stack([x / -z, -y / -z]), at


def bent(xy, radial, first, second):
    """Both manuals' formula; `first` stands with 2x² in x, `second` with 2xy there."""
    x, y = xy.T
    r2 = x**2 + y**2
    scale = 1.0 + sum(k * r2 ** (i + 1) for i, k in enumerate(radial))
    return np.column_stack([x * scale + first * (r2 + 2 * x**2) + 2 * second * x * y,
                            y * scale + second * (r2 + 2 * y**2) + 2 * first * x * y])  # fmt: skip


def test_metashape(adjusted):
    one = values_of(adjusted, METASHAPE)
    p = {name: value for name, value, _ in one.values}
    xy, at = seen(adjusted)
    x, y = bent(xy, [p[f"k{k}"] for k in (1, 2, 3, 4)], p["p1"], p["p2"]).T
    columns, rows = adjusted.block.cameras[0].size_px
    u = columns / 2 + p["cx"] + x * p["f"] + x * p["b1"] + y * p["b2"]
    v = rows / 2 + p["cy"] + y * p["f"]
    assert np.abs(np.column_stack([u, v]) - at).max() < 1e-4
    assert not one.said
    assert abs(p["k1"]) > 0.0
    assert abs(p["cx"]) > 0.1


def test_pix4d(adjusted):
    one = values_of(adjusted, PIX4D)
    p = {(name, unit): value for name, value, unit in one.values}
    xy, at = seen(adjusted)
    x, y = bent(xy, [p[f"R{k}", ""] for k in (1, 2, 3)], p["T2", ""], p["T1", ""]).T
    f = p["focal length", "px"]
    found = np.column_stack([p["principal point x", "px"] + f * x, p["principal point y", "px"] + f * y])
    assert np.abs(found - at).max() < 1e-4
    assert not one.said
    pixel = adjusted.block.cameras[0].pixel_mm
    for name in ("focal length", "principal point x", "principal point y"):
        assert p[name, "mm"] == pytest.approx(pixel * p[name, "px"])


def test_what_cannot_be_said_is_told():
    block, _ = small_block(5, "bluh:1-12")
    found = aerotri.adjust(block, explain=False).adjusted
    for one in cameras_elsewhere(found):
        assert f"{one.program} has no words for its additional parameters" in one.said[0]
        assert "px over the format" in one.said[0]
        assert one.values
    fisheye = tuple(replace(camera, projection="fisheye") for camera in found.block.cameras)
    seen_wide = replace(found, block=replace(found.block, cameras=fisheye))
    tables, notes = elsewhere_tables(seen_wide)
    assert [table.title for table in tables] == [METASHAPE]
    assert any("another polynomial" in text for text in notes)


def test_on_the_page(adjusted):
    page = report_html(adjusted, {})
    tables, _ = elsewhere_tables(adjusted)
    for one in tables:
        assert f"<h4>{one.title}</h4>" in page
        assert all(text in page for text in one.texts[0])
