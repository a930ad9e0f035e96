"""Tables, findings and the lines for the terminal: known values, units, what is not known."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis import findings
from aerotri.report import quality
from aerotri.report.tables import adjustment as tables
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(2, 5, 80, n_control=10, n_check=6)


def by_hand(adjusted, difference, check=True):
    """Check (or control) points 4, 9 … with these differences, σ 3 cm adjusted, 5 cm given."""
    difference = np.array(difference, float)
    k = len(difference)
    points = np.arange(4, 4 + 5 * k, 5)
    source = adjusted.check if check else adjusted.control
    r = np.full((k, 3), np.nan) if check else np.where(np.isfinite(difference), 0.75, np.nan)
    results = replace(source, point=points, difference=difference, sigma=np.full((k, 3), 0.03), r=r,
                      w=np.ones((k, 3)), rays=np.full(k, 5))  # fmt: skip
    columns = ("point", "difference", "sigma", "r", "w", "rays")
    none = replace(source, **{name: getattr(source, name)[:0] for name in columns})
    control = replace(adjusted.block.control, point=points, xyz=np.ones((k, 3)), sigma=np.full((k, 3), 0.05),
                      is_check=np.full(k, check))  # fmt: skip
    block = replace(adjusted.block, control=control)
    mine, other = ("check", "control") if check else ("control", "check")
    return replace(adjusted, block=block, **{mine: results, other: none})


def column(table, name):
    place = [c.name for c in table.columns].index(name)
    return [row[place] for row in table.rows], [row[place] for row in table.texts]


def test_ground_statistics_by_hand(adjusted):
    one = by_hand(adjusted, [[0.3, 0.4, -0.2], [-0.1, 0.0, np.nan]])
    s = quality.ground_statistics(one, one.check)
    assert s.count.tolist() == [2, 2, 1]
    np.testing.assert_allclose(s.rms, [np.sqrt(0.05), np.sqrt(0.08), 0.2])
    np.testing.assert_allclose(s.mean, [0.1, 0.2, -0.2])
    np.testing.assert_allclose(s.max, [0.3, 0.4, 0.2])
    np.testing.assert_allclose(s.expected, np.hypot(0.03, 0.05))
    assert s.fit_h == pytest.approx(np.sqrt(0.13))
    np.testing.assert_allclose(s.survey, 0.05)
    assert s.rmse_h == pytest.approx(np.sqrt(0.13 + 2.0 * 0.05**2))
    assert s.rmse_v == pytest.approx(np.hypot(0.2, 0.05))


def test_expected_residuals_of_control_points(adjusted):
    """A control point's residual varies by σ̂0·σ·√r."""
    one = by_hand(adjusted, [[0.01, 0.02, 0.03]], check=False)
    s = quality.ground_statistics(one, one.control)
    np.testing.assert_allclose(s.expected, 1.04 * 0.05 * np.sqrt(0.75))


def test_accuracy_table(adjusted):
    one = by_hand(adjusted, [[0.3, 0.4, -0.2], [-0.1, 0.0, np.nan]])
    table = tables.ground_accuracy(one, one.check, "check")
    with_survey = [f"RMSE_{axis}, survey error included" for axis in "HV"]
    assert column(table, "coordinate")[0] == ["X", "Y", "Z", "in plan", *with_survey]
    assert column(table, "RMS")[1] == ["0.224", "0.283", "0.200", "0.361", "0.367", "0.206"]
    assert column(table, "largest")[1][3] == "0.500"
    assert column(table, "mean")[1] == ["+0.100", "+0.200", "-0.200", "–", "–", "–"]
    assert table.columns[2].unit == "m"


@pytest.mark.parametrize(("n", "warns"), [(0, True), (1, True), (29, True), (30, False), (31, False)])
def test_asprs_warning_below_30(adjusted, n, warns):
    one = by_hand(adjusted, np.full((n, 3), 0.01))
    text = quality.asprs_warning(one)
    assert bool(text) == warns
    if warns:
        assert "ASPRS" in text
        assert "30" in text
    assert any("ASPRS" in line for line in tables.summary_lines(one)) == warns


def finding(adjusted, start):
    return next(f for f in findings(adjusted) if f.quantity.startswith(start))


def test_sigma0_beside_its_band(adjusted):
    """Redundancy 100: χ² quantiles 74.22 and 129.56 (tables), so σ0 lies between .862 and 1.138."""
    for sigma0, level in ((1.0, "good"), (1.13, "good"), (1.145, "note"), (0.85, "note"), (1.8, "attention")):
        outcome = replace(adjusted.outcome, sigma0=sigma0, redundancy=100)
        found = finding(replace(adjusted, outcome=outcome), "σ₀")
        assert "0.862 to 1.138" in found.expected
        assert found.level == level
    assert "px" in found.value
    assert "µm" in found.value


def test_check_points_beside_their_sigma(adjusted):
    """Ten coordinates expected at 5.8 cm: χ²(10) 97.5 % is 20.48, so at most 8.3 cm."""
    good = finding(by_hand(adjusted, np.full((10, 3), 0.05)), "fit in height")
    assert good.level == "good"
    assert good.value == "0.050 m"
    assert "0.058 m from the σ; at most 0.083 m" in good.expected
    assert finding(by_hand(adjusted, np.full((10, 3), 0.09)), "fit in height").level == "attention"


def test_bias_at_check_points(adjusted):
    rng = np.random.default_rng(1)
    shifted = rng.normal(0, 0.03, (12, 3)) + [0, 0, 0.2]
    quantities = [f.quantity for f in findings(by_hand(adjusted, shifted))]
    assert "mean of dZ at check points" in quantities
    assert "mean of dX at check points" not in quantities


def test_large_residuals_against_chance(adjusted):
    assert finding(adjusted, "image coordinates with |w| > 3.29").level == "good"
    w = adjusted.rays.w.copy()
    w[:40] = 9.0
    many = replace(adjusted, rays=replace(adjusted.rays, w=w))
    assert finding(many, "image coordinates with").level == "attention"


def test_no_self_calibration_is_noted():
    bare = make_adjusted_block(2, 4, 60, parameters="none")
    assert finding(bare, "additional parameters").level == "note"
    assert len(tables.parameters(bare)) == 0


def test_largest_residuals_are_the_largest_in_order(adjusted):
    rays = adjusted.rays
    w = np.zeros_like(rays.w)
    w[7], w[30], w[31] = [1.0, -9.0], [5.0, 2.0], [np.nan, np.nan]
    v, r = np.full_like(w, 0.004), np.full_like(w, 0.5)
    one = replace(adjusted, rays=replace(rays, v=v, w=w, r=r))
    table = tables.largest_residuals(one)
    ray = one.block.image_points
    assert column(table, "photograph")[0] == one.block.images.names[ray.image[[7, 30]]].tolist()
    assert column(table, "point")[0] == one.block.points[ray.point[[7, 30]]].tolist()
    assert column(table, "wy")[1] == ["-9.00", "+2.00"]
    # −v/r = −4 µm / 0.5
    assert column(table, "error x")[1] == ["-8.0", "-8.0"]


def test_orientation_table(adjusted):
    table = tables.images(adjusted)
    assert len(table) == 10
    assert column(table, "photograph")[0][3] == "01_004"
    units = {c.name: c.unit for c in table.columns}
    assert (units["X0"], units["ω"], units["σω"], units["σX0"]) == ("m", "°", "mgon", "m")
    assert column(table, "σκ")[1][3] == "0.67"
    assert float(column(table, "φ")[1][3]) == pytest.approx(np.degrees(adjusted.images.angles[3, 1]), abs=1e-5)


def test_weak_points_are_the_weakest(adjusted):
    table = tables.weak_points(adjusted, top=5)
    sigma = np.nan_to_num(adjusted.points.sigma[:, 2])
    assert column(table, "σZ")[0] == sorted(sigma, reverse=True)[:5]


def test_weak_images_put_the_unknown_first(adjusted):
    covariance = adjusted.images.covariance.copy()
    covariance[4] *= 4.0
    covariance[8] *= np.nan
    one = replace(adjusted, images=replace(adjusted.images, covariance=covariance))
    names = column(tables.weak_images(one, top=3), "photograph")
    assert names[0][:2] == [adjusted.block.images.names[8], adjusted.block.images.names[4]]


def test_parameters_table_has_units_and_effects(adjusted):
    table = tables.parameters(adjusted)
    units = dict(zip(column(table, "parameter")[0], column(table, "unit")[0], strict=True))
    assert units["bluh.1"] == "–"
    assert units["bluh.9"] == "1/mm²"
    assert units["ultracam_d.49"] == "–"
    assert units["ultracam_d.50"] == "mm"
    assert units["ultracam_d.65"] == "mm"
    assert units["ultracam_d.66"] == "rad"
    row = column(table, "parameter")[0].index("ultracam_d.50")
    value = adjusted.parameters.value[list(adjusted.parameters.names).index("ultracam_d.50")]
    assert column(table, "effect")[0][row] == pytest.approx(1e3 * abs(value))


def test_cameras_table(adjusted):
    table = tables.cameras(adjusted)
    assert table.texts[0] == ("ucd2", "c", "101.4021", "0.0040", "+0.0021")
    assert table.texts[1] == ("ucd2", "x0", "0.0000", "held", "0.0000")


def test_metre_digits():
    assert quality.metre_digits(np.array([0.05])) == 3
    assert quality.metre_digits(np.array([2e-4])) == 5
    assert quality.metre_digits(np.array([np.nan, 0.0])) == 3


def test_summary_lines(adjusted):
    lines = tables.summary_lines(adjusted)
    assert lines[0] == "frederiksstad: converged after 4 iterations"
    assert lines[1] == "sigma0 1.040 (2.60 µm, 0.29 px)"
    o = adjusted.outcome
    assert lines[2] == f"redundancy {o.redundancy} = {o.observations} observations − {o.unknowns} unknowns"
    assert any(line.startswith("10 control points: RMS X ") for line in lines)
    assert any(line.startswith("6 check points: RMS X ") for line in lines)


def test_summary_lines_do_not_steer_the_terminal():
    hostile = make_adjusted_block(2, 4, 60, name="\x1b[2Jgone\r\nnew")
    outcome = replace(hostile.outcome, warnings=("point \x1b]0;title\x07 is odd",))
    for line in tables.summary_lines(replace(hostile, outcome=outcome)):
        assert line.isprintable()
