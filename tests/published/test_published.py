"""Numbers others printed, to the last printed digit. Every row of tests/reference names its line in the report."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerotri.formats.foreign.bal import read_bal
from aerotri.formats.foreign.dbat import read_dbat
from aerotri.pipeline import adjust, adjust_keeping_system
from places import SHARED_DATA
from small_blocks import with_adjustment

REFERENCE = Path(__file__).parent / "reference"
ELEMENTS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")


def rows_of(name):
    with open(REFERENCE / name, encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def assert_printed(value: float, printed: str, what: str, loose: float = 0.0):
    """The value rounds to what is printed: within half a unit of its last digit, and `loose` besides."""
    mantissa, _, exponent = printed.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent or 0) - decimals)
    assert abs(value - float(printed)) <= 0.5001 * unit + loose, f"{what}: {value!r} is not {printed}"


def compare_orientation(result, name, loose_sigma=1e-6):
    photo_row = {str(n): k for k, n in enumerate(result.block.images.names)}
    degrees = np.array([1.0, 1.0, 1.0, *[180.0 / np.pi] * 3])
    values = np.hstack([result.images.centre, result.images.angles]) * degrees
    sigma = result.images.sigma * degrees
    for row in rows_of(name):
        item = row["item"].removeprefix("s_")
        source = sigma if row["item"].startswith("s_") else values
        at = photo_row[row["photo"]], ELEMENTS.index(item)
        # DBAT stops at a relative change of 1e-6, before the last of its printed digits stands still
        loose = loose_sigma * sigma[at]
        assert_printed(source[at], row["printed"], f"{name} line {row['line']} ({row['photo']} {row['item']})", loose)


def compare_points(result, name, loose_sigma=0.0):
    row_of = {str(n): k for k, n in enumerate(result.block.points)}
    for row in rows_of(name):
        k = row_of[row["point"]]
        assert result.points.rays[k] == int(row["rays"])
        for axis, letter in enumerate("XYZ"):
            where = f"{name} line {row['line']} (point {row['point']} {letter})"
            assert_printed(result.points.xyz[k, axis], row[letter], where, loose_sigma * result.points.sigma[k, axis])
            assert_printed(result.points.sigma[k, axis], row[f"s{letter}"], where)


@pytest.fixture(scope="module")
def strasbourg():
    folder = SHARED_DATA / "dbat_sxb"
    if not folder.exists():
        pytest.skip("real data 'dbat_sxb' is not beside the project (../shared/data)")
    block = read_dbat(folder)
    # DBAT evaluates Brown's parameters at the measured image points
    adjustment = replace(block.settings.adjustment, parameter_position="measured")
    block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    return block, adjust(block)


def test_strasbourg_summary(strasbourg):
    """dbat_sxb/result/report.txt lines 20–24, 43; digits beyond the report from targets.md 1."""
    block, result = strasbourg
    o = result.outcome
    assert_printed(o.sigma0, "1.1786", "line 20")
    assert_printed(o.sigma0, "1.178598", "targets.md 1")
    assert (o.redundancy, o.unknowns, o.observations) == (1261, 1173, 2434)
    assert_printed(np.sqrt(o.vtpv), "41.8527", "line 43")
    assert len(result.control) == 14
    assert len(result.check) == 2
    assert len(block.images) == 5


def test_strasbourg_orientation(strasbourg):
    compare_orientation(strasbourg[1], "dbat_sxb_orientation.csv")


def test_strasbourg_points(strasbourg):
    compare_points(strasbourg[1], "dbat_sxb_points.csv")


def test_strasbourg_check_points(strasbourg):
    """report.txt lines 464–469: differences and deviations of 351 and 410."""
    result = strasbourg[1]
    names = [str(result.block.points[p]) for p in result.check.point]
    for point, d, s in (
        ("351", ("0.167", "0.008", "-0.459"), ("0.0551", "0.0347", "0.240")),
        ("410", ("0.096", "-0.296", "0.136"), ("0.0345", "0.0356", "0.180")),
    ):
        k = names.index(point)
        for axis in range(3):
            assert_printed(result.check.difference[k, axis], d[axis], f"check point {point}")
            assert_printed(result.check.sigma[k, axis], s[axis], f"check point {point}")


def test_strasbourg_correlations(strasbourg):
    """report.txt lines 105, 112, 116: ρ(Xc, φ) 99.9 %, ρ(Yc, ω) −100.0 % of photo 1."""
    images = strasbourg[1].images
    sigma, q = images.sigma[0], images.covariance[0]
    assert_printed(100 * q[0, 4] / (sigma[0] * sigma[4]), "99.9", "line 105")
    assert_printed(100 * q[1, 3] / (sigma[1] * sigma[3]), "-100.0", "line 112")


def one_pixel_all_control(block):
    rays = block.image_points
    return replace(
        block,
        image_points=replace(rays, sigma=np.full_like(rays.sigma, 0.006)),
        control=replace(block.control, is_check=np.zeros(len(block.control), bool)),
    )


def test_strasbourg_all_points_at_one_pixel(strasbourg):
    """targets.md 1: 16 control points, σ0 1.07447, redundancy 1267 (own computation, not printed in the reports)."""
    outcome = adjust(one_pixel_all_control(strasbourg[0])).outcome
    assert_printed(outcome.sigma0, "1.07447", "targets.md 1")
    assert outcome.redundancy == 1267


def test_strasbourg_with_projection_centres(shared_data):
    """dbat_sxb/result/sxb-prior-eo-dbatreport.txt lines 21–25, 44, and every orientation and control point in it."""
    folder = shared_data("dbat_sxb")
    block = one_pixel_all_control(read_dbat(folder, folder / "reference" / "fake-camera-positions.txt"))
    result = adjust(block)
    assert_printed(result.outcome.sigma0, "1.06942", "line 21")
    assert (result.outcome.redundancy, result.outcome.unknowns, result.outcome.observations) == (1279, 1173, 2452)
    # ours is 38.24585: the report's input was another export of the same measurements, hence 0.02 σ below as well
    assert_printed(np.sqrt(result.outcome.vtpv), "38.2458", "line 44", loose=1e-5)
    compare_orientation(result, "dbat_sxb_prior_eo_orientation.csv", loose_sigma=0.02)
    compare_points(result, "dbat_sxb_prior_eo_points.csv", loose_sigma=0.02)


def test_strasbourg_variants_that_go_wrong(strasbourg):
    """targets.md 1: half a pixel off gives 1.178646, y flipped 1.18446, without the point seen once 1.1727.

    The figure for y flipped comes with the half pixel added instead of subtracted: y0 = 38.811 − 38.988 + 0.003.
    """
    block = strasbourg[0]
    rays = block.image_points
    shifted = replace(block, image_points=replace(rays, xy=rays.xy + [0.003, -0.003]))
    assert_printed(adjust(shifted).outcome.sigma0, "1.178646", "half a pixel off")
    camera = block.cameras[0]
    y0 = replace(camera.interior["y0_mm"], value=-0.174)
    flipped = replace(block, cameras=(replace(camera, interior={**camera.interior, "y0_mm": y0}),))
    assert_printed(adjust(flipped).outcome.sigma0, "1.18446", "principal point with y flipped")
    once = np.bincount(rays.point, minlength=len(block.points)) == 1
    keep = ~once[block.control.point]
    control = replace(
        block.control,
        point=block.control.point[keep],
        xyz=block.control.xyz[keep],
        sigma=block.control.sigma[keep],
        is_check=block.control.is_check[keep],
    )
    assert_printed(adjust(replace(block, control=control)).outcome.sigma0, "1.1727", "without the point seen once")


@pytest.fixture(scope="module")
def roma():
    folder = SHARED_DATA / "dbat_roma"
    if not folder.exists():
        pytest.skip("real data 'dbat_roma' is not beside the project (../shared/data)")
    block = read_dbat(folder)
    # DBAT evaluates Brown's parameters at the measured image points
    adjustment = replace(block.settings.adjustment, parameter_position="measured")
    block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    return block, adjust(block)


def test_roma_self_calibration(roma):
    """dbat_roma/result/report.txt lines 21–25, 44 and 57–80."""
    block, result = roma
    o = result.outcome
    assert_printed(o.sigma0, "0.582769", "line 21")
    assert (o.redundancy, o.unknowns, o.observations) == (101801, 79321, 181122)
    assert_printed(np.sqrt(o.vtpv), "185.94", "line 44")
    assert_printed(np.sqrt(o.vtpv), "185.9397", "models.md 4")
    assert o.iterations == 5
    p = result.parameters
    value, sigma = dict(zip(p.names, p.value, strict=True)), dict(zip(p.names, p.sigma, strict=True))
    camera = block.cameras[0]
    # DBAT counts the principal point from the centre of the upper left pixel, one pixel further in, y down
    half_w, half_h, pixel = *camera.half_format_mm, camera.pixel_mm
    assert_printed(value["focal_length_mm"], "24.5425", "line 58")
    assert_printed(sigma["focal_length_mm"], "0.00254", "line 59")
    assert_printed(value["x0_mm"] + half_w + 0.5 * pixel, "18.0816", "line 61")
    assert_printed(sigma["x0_mm"], "0.00195", "line 62")
    assert_printed(half_h - value["y0_mm"] + 0.5 * pixel, "12.0164", "line 64")
    assert_printed(sigma["y0_mm"], "0.00189", "line 65")
    assert_printed(value["brown.K1"], "2.21523e-4", "line 71")
    assert_printed(sigma["brown.K1"], "2.54e-7", "line 72")
    assert_printed(value["brown.K2"], "-1.86985e-7", "targets.md 1")
    assert_printed(sigma["brown.K2"], "5.85e-10", "targets.md 1")


def test_roma_orientation(roma):
    """All 60 photographs in DBAT's datum: photo 1 and one base component fixed."""
    compare_orientation(roma[1], "dbat_roma_orientation.csv")


@pytest.mark.parametrize("datum", ["minimal", "inner"])
def test_roma_in_any_datum(roma, datum):
    """targets.md 1: any minimal or inner datum gives σ0 and the camera with its σ."""
    block, fixed = roma
    result = adjust(with_adjustment(block, datum=datum, datum_fixed=()))
    assert_printed(result.outcome.sigma0, "0.582769", "line 21")
    assert result.outcome.redundancy == 101801
    np.testing.assert_allclose(result.parameters.value, fixed.parameters.value, rtol=1e-6)
    np.testing.assert_allclose(result.parameters.sigma, fixed.parameters.sigma, rtol=1e-5)


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [("problem-49-7776-pre.txt", "8.509125e5", 1.33445e4), ("problem-16-22106-pre.txt", "4.185660e6", 1.80345e4)],
)
def test_bundle_adjustment_in_the_large(shared_data, file, before, after):
    """targets.md 1: ½Σr² at the start and at most 1.3344e4 / 1.8034e4 (five digits) at the end."""
    block, points = read_bal(shared_data("bal") / file)
    adjustment = adjust_keeping_system(with_adjustment(block, max_iterations=60), given_points=points)
    assert_printed(0.5 * adjustment.solution.costs[0], before, "start")
    assert 0.5 * adjustment.result.outcome.vtpv < after
    assert adjustment.result.outcome.status == "converged"
