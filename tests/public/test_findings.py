"""Truth, findings and decisions as a notebook takes them."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri
from aerotri import InputError

BROWN = {"K1": 2e-5, "P1": 1e-5}


def plan_with(**changes):
    plan = aerotri.example_flight()
    for table, values in changes.items():
        plan[table] = plan.get(table, {}) | values
    return plan


@pytest.fixture(scope="module")
def erring():
    """A camera with a lens error, flown on two days."""
    plan = plan_with(flight={"days": 2}, adjustment={"parameter_groups": "day"})
    plan["camera"]["camera"]["errors"] = {"brown": BROWN}
    flight = aerotri.simulate(plan, seed=2)
    return flight, aerotri.adjust(flight.block, parameters="brown:K1+P1")


def test_errors_found_are_those_of_the_truth(erring):
    """Without what the orientation takes as well, nine vectors of ten are within 2.5 σ in either coordinate."""
    flight, result = erring
    found = result.image_errors(without_orientation=True)
    left = found - flight.true_image_errors(without_orientation=True)
    assert found.rms_um > 3.0 * left.rms_um
    d, sigma = (np.stack([left.table[p + "dx"], left.table[p + "dy"]]) for p in ("", "s_"))
    assert np.mean(np.abs(d) < 2.5 * sigma) > 0.9
    assert left.sigma_um == found.sigma_um > 0.0


def test_true_errors_are_those_that_were_put_in(erring):
    """Brown's terms as the theory has them: K1 and P1 are corrections, the error has the other sign."""
    flight, _ = erring
    table = flight.true_image_errors().table
    x, y = table["x"], table["y"]
    r2 = x**2 + y**2
    np.testing.assert_allclose(table["dx"], -1e3 * (x * BROWN["K1"] * r2 + BROWN["P1"] * (r2 + 2 * x**2)), atol=1e-9)
    np.testing.assert_allclose(table["dy"], -1e3 * (y * BROWN["K1"] * r2 + BROWN["P1"] * 2 * x * y), atol=1e-9)


def test_a_true_lens_is_an_image_error_too():
    """A forward lens that is estimated is found again; the error is k1·r³ but for terms of its square."""
    plan = plan_with()
    plan["camera"]["camera"]["errors"] = {"lens": {"k1": -0.004}}
    flight = aerotri.simulate(plan, seed=2)
    true = flight.true_image_errors(without_orientation=True)
    found = aerotri.adjust(flight.block, parameters="lens:k1").image_errors(without_orientation=True)
    assert true.rms_um > 2.0
    assert (found - true).rms_um < 0.2 * true.rms_um
    table = flight.true_image_errors().table
    radius, c = np.hypot(table["x"], table["y"]), 8.8
    length = np.hypot(table["dx"], table["dy"])
    np.testing.assert_allclose(length, 4.0 * radius**3 / c**2, rtol=0.02, atol=1e-6)


def test_days_of_one_camera_do_not_differ(erring):
    changes = erring[1].group_changes
    assert len(changes) == 1
    row = changes.row("1")
    assert (row["second"], row["changed"]) == ("2", False)
    assert row["p"] > 0.01
    assert erring[1].plot.group_change().axes
    with pytest.raises(InputError, match="not compared"):
        erring[1].plot.group_change("7")


def test_what_is_not_there_is_refused(erring):
    flight, result = erring
    for ask in (lambda: result.image_errors("7"), lambda: result.plot.averaged_residuals("7")):
        with pytest.raises(InputError, match="group '7' is not there"):
            ask()
    for ask, said in (
        (lambda: flight.true_image_errors("other"), "no camera 'other'"),
        (lambda: flight.true_image_errors(day="3"), "no day '3'"),
        (lambda: flight.true_surface(0.0), "no surface"),
        (lambda: flight.true_surface(1e-5), "too many"),
        (lambda: result.image_errors() - result.image_errors(nodes=5), "other places"),
        (lambda: result.image_errors().plot(*[result.image_errors()] * 4), "too many"),
    ):
        with pytest.raises(InputError, match=said):
            ask()


def test_truth_as_tables(flight):
    points = flight.true_points
    np.testing.assert_array_equal(points["Z"], flight.truth.points[:, 2])
    xy = np.column_stack([points["X"], points["Y"]])
    np.testing.assert_allclose(flight.true_heights(xy), points["Z"], atol=1e-9)
    kappa = np.degrees(flight.truth.angles[:, 2])
    np.testing.assert_array_equal(flight.true_images["kappa"], kappa)
    surface = flight.true_surface(cell=4.0, area=(-20.0, -12.0, 20.0, 12.0))
    assert surface.z.shape == (6, 10)
    middle = np.array([[surface.grid.x(np.array([0]))[0], surface.grid.y(np.array([0]))[0]]])
    assert surface.z[0, 0] == flight.true_heights(middle)[0]


def test_gross_errors_are_found_and_listed():
    """Every ray that is wrong by 40 σ and more is on the list of gross errors, with the size it was given."""
    plan = plan_with(gross_errors={"fraction": 0.01, "range_sigma": [40.0, 80.0]})
    flight = aerotri.simulate(plan, seed=3)
    result = aerotri.adjust(flight.block, robust="data-snooping")
    made = {(row["image"], row["point"]): max(abs(row["dx"]), abs(row["dy"])) for row in
            flight.gross_errors.to_arrow().to_pylist()}  # fmt: skip
    found = {(row["image"], row["point"]): row["estimated"] for row in result.blunders.to_arrow().to_pylist()}
    rays = {(row["image"], row["point"]): row["status"] for row in result.rays.to_arrow().to_pylist()}
    assert len(made) >= 5
    # of a point in two photographs either ray may be the wrong one
    several = {ray for ray in made if sum(point == ray[1] for _, point in rays) > 2}
    assert several <= set(found)
    for ray in several:
        assert abs(found[ray]) == pytest.approx(made[ray], rel=0.35)


def test_a_wrong_control_point_tops_the_work_list():
    plan = plan_with(control={"blunders": [{"point": "C03", "error_m": [0.0, 0.0, 1.0]}]})
    block = aerotri.simulate(plan, seed=1).block
    result = aerotri.adjust(block)
    assert result.verdict != "accepted"
    work = result.work_list
    assert (work["level"][0], work["kind"][0], work["where"][0]) == ("wrong", "control", "C03")
    assert set(result.findings["grade"]) - {"accepted"}
    mended = aerotri.adjust(aerotri.edit(block, off=["C03"], reason="1 m too high"))
    assert mended.verdict == "accepted"
    assert np.isnan(mended.control.row("C03")["dZ"])


def test_decisions_add_up(flight):
    block = aerotri.edit(flight.block, off=[("C01", "1_001")], check=["C02"], reason="first look")
    block = aerotri.edit(block, control=["C02", "K01"])
    names = block.points[block.edits.point].tolist()
    assert list(zip(names, block.edits.action.tolist(), block.edits.reason.tolist(), strict=True)) == [
        ("C01", "off", "first look"), ("C02", "control", ""), ("K01", "control", "")
    ]  # fmt: skip
    assert aerotri.edit(block).edits is block.edits
    for ask, said in (
        ({"off": ["nobody"]}, "no point 'nobody'"),
        ({"off": [("C01", "9_999")]}, "no photograph '9_999'"),
        ({"off": [("C01", "2_006")]}, "not measured in '2_006'"),
        ({"check": ["T000001"]}, "not a control or check point"),
    ):
        with pytest.raises(InputError, match=said):
            aerotri.edit(block, **ask)


def test_map_of_height_accuracy(result):
    """A place shows the median of the points around it, and nothing far from all points; the figure has its scale."""
    from aerotri.report.plots.accuracy import median_around

    xy = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    found = median_around(xy, 0.1 + 0.1 * (xy[:, 0] > 2.5), np.arange(0.0, 30.0), np.arange(6.0))
    np.testing.assert_allclose(found[2, [1, 4]], [0.1, 0.2])
    assert np.isnan(found[2, -1])
    figure = result.plot.height_accuracy()
    assert "σ of Z [m]" in [axes.get_ylabel() for axes in figure.axes]


def test_own_tables():
    table = aerotri.Table.of("layouts", {"layout": ["b", "a"], "s": [0.04, np.nan], "n": [4, 9]}, {"s": "m"})
    assert "<td>0.0400</td>" in table.html()
    assert "<td>–</td>" in table.html()
    assert table.sorted("layout")["n"].tolist() == [9, 4]
    assert table.where([False, True]).select("n", "layout").to_arrow().to_pylist() == [{"n": 9, "layout": "a"}]
    with pytest.raises(InputError, match="no column 'Z'"):
        table.select("Z")
    with pytest.raises(InputError, match="different lengths"):
        aerotri.Table.of("x", {"a": [1], "b": [1, 2]})
