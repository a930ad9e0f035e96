"""Decisions, conditions and scanned film in a block folder: read, and written back the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from format_samples import FILM_TOML, assert_same_block, assert_same_record

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.block.scanned_film import scan_from_mm, sigma_px_from_mm
from aerotri.functional_model.interior import fit_fiducials, measurement_sigma, mm_from_scan

EDITS = """\
# decisions
image,point,action,reason
a,p2,off,"blurred, twice"
,p1,check,
,p9,off,moved
,p2,off,
"""
CONSTRAINTS = """\
kind,points,value,sigma
vertical,p1 p2,,0.01
horizontal,p1 p2 p9,,0.01
height_difference,p1 p2,1.5,0.02
distance,p2 p9,12,0.02
line,p1 p2 p9,,0.05
"""
PIXELS = """\
image,point,x,y
a,p1,5000,4000.5
a,p2,100,7000
b,p1,9000,40
"""
MARKS = """\
image,fiducial,column,row
a,F1,100,100
a,F2,9900,110
a,F3,9890,7900
a,F4,110,7890
b,F1,7900,100
b,F2,7910,9900
b,F3,100,9890
b,F4,110,90
"""


@pytest.fixture
def film(small_block):
    """A block of two scans, the second turned by a quarter."""
    size = FILM_TOML.replace("[10000, 8000]", "[10000, 10000]")
    return lambda **changes: small_block(
        {"block.toml": size, "image_points.csv": PIXELS, "fiducials.csv": MARKS, "gnss_ins.csv": None} | changes
    )


@pytest.mark.parametrize("tables", ["csv", "parquet"])
def test_edits_and_constraints(small_block, tmp_path, tables):
    block = read_block(small_block({"edits.csv": EDITS, "constraints.csv": CONSTRAINTS}))
    edits, conditions = block.edits, block.constraints
    assert edits is not None
    assert conditions is not None
    assert edits.image.tolist() == [0, -1, -1, -1]
    assert block.points[edits.point].tolist() == ["p2", "p1", "p9", "p2"]
    assert edits.action.tolist() == ["off", "check", "off", "off"]
    assert edits.reason.tolist() == ["blurred, twice", "", "moved", ""]
    assert conditions.kind.tolist() == ["vertical", "horizontal", "height_difference", "distance", "line"]
    assert [block.points[p].tolist() for p in conditions.points][1:4] == [
        ["p1", "p2", "p9"],
        ["p1", "p2"],
        ["p2", "p9"],
    ]
    np.testing.assert_array_equal(conditions.value, [np.nan, np.nan, 1.5, 12, np.nan])
    np.testing.assert_array_equal(conditions.sigma, [0.01, 0.01, 0.02, 0.02, 0.05])
    write_block(block, tmp_path / "again", tables=tables)
    assert_same_block(read_block(tmp_path / "again"), replace(block, name="small"))


def test_tables_without_rows_say_nothing(small_block):
    empty = {"edits.csv": "image,point,action\n", "constraints.csv": "# none\n", "fiducials.csv": ""}
    block = read_block(small_block(empty))
    assert (block.edits, block.constraints, block.fiducials) == (None, None, None)
    assert block.interior_fits == {}


def test_points_of_a_constraint_are_separated_by_blanks(small_block, tmp_path):
    block = read_block(small_block({"constraints.csv": CONSTRAINTS}))
    named = replace(block, points=np.array(["p 1", "p2", "p9"]))
    with pytest.raises(InputError, match="has a blank in its name"):
        write_block(named, tmp_path / "again")


def test_scans_are_brought_to_the_fiducial_marks(film):
    block = read_block(film())
    camera = block.cameras[0]
    assert camera.interior_orientation == "affine"
    assert camera.fiducials["F2"] == (49.0, 39.0)
    assert block.fiducials is not None
    assert len(block.fiducials) == 8
    fit = block.interior_fits[0]
    assert fit.kind == "affine"
    expected = mm_from_scan(fit, np.array([[5000, 4000.5], [100, 7000]]))
    np.testing.assert_array_equal(block.image_points.xy[:2], expected)
    # the marks of the other scan: its columns run downwards in the image
    np.testing.assert_allclose(mm_from_scan(block.interior_fits[1], np.array([[7900, 100]])), [[-49, 39]], atol=0.06)
    np.testing.assert_array_equal(block.image_points.sigma, 0.002)


@pytest.mark.parametrize("kind", ["similarity", "affine", "projective"])
def test_scans_are_written_in_pixels(film, tmp_path, kind):
    toml = FILM_TOML.replace("[10000, 8000]", "[10000, 10000]").replace("affine", kind)
    rows = PIXELS.replace("x,y", "x,y,sx,sy").replace("4000.5", "4000.5,0.3,0.4").replace("7000", "7000,0.2,0.2")
    block = read_block(film(**{"block.toml": toml, "image_points.csv": rows.replace("9000,40", "9000,40,0.5,0.1")}))
    # columns of the second scan lie along y
    np.testing.assert_allclose(block.image_points.sigma[2], [0.001, 0.005], rtol=0.03)
    write_block(block, tmp_path / "again")
    text = (tmp_path / "again" / "image_points.csv").read_text().splitlines()[1].split(",")
    np.testing.assert_allclose([float(word) for word in text[2:]], [5000, 4000.5, 0.3, 0.4], rtol=1e-9)
    again = read_block(tmp_path / "again")
    assert again.cameras == block.cameras
    assert_same_record(again.fiducials, block.fiducials)
    np.testing.assert_allclose(again.image_points.xy, block.image_points.xy, rtol=0, atol=1e-10)
    np.testing.assert_allclose(again.image_points.sigma, block.image_points.sigma, rtol=1e-9)


def test_cells_without_sigma_have_that_of_the_block(film):
    rows = "image,point,x,y,sx,sy\na,p1,5000,4000,0.5,\nb,p1,9000,40,,\n"
    block = read_block(film(**{"image_points.csv": rows}))
    np.testing.assert_allclose(block.image_points.sigma, [[0.005, 0.002], [0.002, 0.002]], rtol=0.01)


@pytest.mark.parametrize("kind", ["similarity", "affine", "projective"])
@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 4, np.pi / 2])
def test_way_back_to_the_scan(kind, turn):
    """Positions and σ go to mm and back, however the film lay in the scanner."""
    rng = np.random.default_rng(3)
    mm = np.array([[-100.0, 100], [100, 100], [100, -100], [-100, -100], [0, 101], [99, 0]])
    turned = mm @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    px = turned * [1.0, -1.0] / 0.01 + 12000 + rng.normal(0, 1, mm.shape)
    fit = fit_fiducials(px, mm, kind)
    places = rng.uniform(0, 24000, (7, 2))
    np.testing.assert_allclose(scan_from_mm(fit, mm_from_scan(fit, places)), places, rtol=0, atol=1e-7)
    sigma = measurement_sigma(fit, places, np.array([0.3, 0.3 if turn == np.pi / 4 else 0.5]))
    back = sigma_px_from_mm(fit, places, sigma)
    np.testing.assert_allclose(measurement_sigma(fit, places, back), sigma, rtol=1e-3 if turn == np.pi / 4 else 1e-9)


def test_photographs_alone(small_block, tmp_path):
    """A block without image points is read where that is said, and never adjusted."""
    folder = small_block({"image_points.csv": "image,point,x,y\n", "control.csv": None})
    with pytest.raises(InputError, match="holds no image points"):
        read_block(folder)
    block = read_block(folder, rays_needed=False)
    assert (len(block.images), len(block.image_points), len(block.points)) == (2, 0, 0)
    write_block(block, tmp_path / "again")
    assert_same_block(read_block(tmp_path / "again", rays_needed=False), block)
