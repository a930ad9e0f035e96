"""Paper 003 in short: its UltraCamD and DMC over small blocks; whole in tools/reproduce/reproduce_paper_003.py."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from aerotri.report.plots.panels import Panel, plot_panels
from aerotri.simulation import read_spec
from places import PROJECT
from simulation.test_blocks import scaled_down

MODULES = ("cases", "runs", "table", "figures", "reports")


def in_turn(function, shared, seeds, _bytes_of_one):
    """Runs one after the other."""
    return [function(shared, seed) for seed in seeds]


@pytest.fixture(scope="module")
def tool():
    """The modules of the tool by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "reproduce"))
        yield {name: importlib.import_module(f"paper_003.{name}") for name in MODULES}


def smaller(case):
    """The plan of a small block with the camera of a case."""
    return scaled_down(read_spec(case.plan_path)).model_dump(exclude_none=True)


@pytest.fixture(scope="module")
def answers(tool):
    """(case, plan, rows) of the digital cameras over Frederiksstad."""
    found = []
    for case in tool["cases"].FREDERIKSSTAD[:2]:
        plan = smaller(case)
        found.append((case, plan, tool["runs"].rows_of(case, plan, [1], in_turn)))
    return found


def test_the_findings_hold(answers):
    """[P] 5.1 to 5.3: (a) self-calibration is required, (b) 1–12 shrink, (c) all flatten, (d) special ones are few."""
    for _, _, rows in answers:
        none, general, special, both = rows[:4]
        assert none.rms[2] > 1.2 * general.rms[2]
        assert none.horizontal_m > general.horizontal_m
        assert both.averaged_um < general.averaged_um < none.averaged_um
        assert both.mean("shape") < 0.1 < general.mean("shape")
        assert both.mean("error_left_um") < special.mean("error_left_um")
        assert both.mean("error_left_um") < general.mean("error_left_um") < none.mean("error_left_um")


def test_the_error_left_without_parameters_is_the_camera(answers):
    for case, plan, rows in answers:
        ((_, camera),) = plan["camera"].items()
        rms_um = camera["errors"]["physical"]["rms_um"]
        assert rows[0].mean("error_left_um") == pytest.approx(rms_um, rel=0.01), case.name
        truth = rows[0].true_field
        assert 1e3 * np.sqrt(np.mean(truth.d**2)) == pytest.approx(rms_um, rel=0.05)


def test_shape_is_the_share_of_the_cameras_own_patterns(tool, answers):
    """1 for averaged residuals that are such a pattern, 0 for what is orthogonal to all of them."""
    from dataclasses import replace

    from aerotri.functional_model.additional_parameters import parameter_set

    case, _, rows = answers[0]
    averaged = rows[0].first.averaged
    basis = parameter_set("ultracam_d", ["50", "66"], averaged.camera).basis(averaged.x.ravel(), averaged.y.ravel())
    mean = (basis @ np.array([1e-3, 1e-5])).reshape(averaged.mean.shape)
    whole = replace(averaged, mean=mean, count=np.full(averaged.count.shape, 9))
    assert tool["runs"].shape_share(whole, case.special) == pytest.approx(1.0)
    noise = np.random.default_rng(1).normal(size=mean.shape)
    share = tool["runs"].shape_share(replace(whole, mean=noise), case.special)
    assert share == pytest.approx(32 / mean.size, abs=0.06)


def test_table(tool, answers):
    of = [tool["table"].Answer(case, rows) for case, _, rows in answers]
    text = tool["table"].markdown(of, "a test")
    tables = [line for line in text.splitlines() if line.startswith("| ")]
    assert {line.count("|") for line in tables} == {9}
    assert len(tables) == 2 + 4 + 5
    for finding in "abcd":
        assert f"**({finding})" in text
    assert "parameter 80" in text
    # h/b by the focal length and the printed end laps; the paper cut its decimals
    assert "66.3 % 4.46 (printed 4.4), UltraCamD 49.5 % 2.97 (printed 2.9), UltraCamD 84 % 9.39 (printed 9.3)" in text


def test_figures(tool, answers):
    figures = tool["figures"]
    for case, _, rows in answers:
        assert len(figures.averaged_figure(case, rows).axes) == 3
        assert len(figures.errors_figure(case, rows).axes) == 4
    assert len(figures.check_points_figure([(case, rows) for case, _, rows in answers]).axes) == 2


def test_panels_share_one_scale(answers):
    """The arrows of all panels are drawn with the same scale: twice the field, twice the arrows."""
    field = answers[0][2][1].first.averaged
    from dataclasses import replace

    figure = plot_panels([Panel("one", field), Panel("two", replace(field, mean=2.0 * field.mean))], "scale")
    scales = {artist.scale for axes in figure.axes for artist in axes.collections if hasattr(artist, "U")}
    assert len(scales) == 1
    with pytest.raises(ValueError, match="one to four"):
        plot_panels([Panel("", field)] * 5, "too many")


def test_reports_by_one_call(tool, tmp_path):
    case = tool["cases"].FREDERIKSSTAD[2]
    (report,) = tool["reports"].write_reports([(case, smaller(case))], tmp_path)
    assert "<h1>frederiksstad_rmk</h1>" in report.read_text(encoding="utf-8")
    assert (tmp_path / "frederiksstad_rmk" / "truth" / "image_errors.csv").exists()


def test_days_and_navigation(tool, answers):
    """[P] 5.1: two days give the same errors; GNSS and INS hold a block without parameters."""
    case, plan, rows = answers[0]
    runs, table = tool["runs"], tool["table"]
    tests = runs.days_over_seeds(case, plan, [1], in_turn)
    assert tests[0].freedom == 44
    assert tests[0].p > 1e-4
    navigation = runs.with_navigation(case, plan)
    assert [n.heading for n in navigation] == ["none", "1–12", "1–12, 42–73"]
    assert navigation[0].using[2] < 0.7 * navigation[0].without[2]
    text = table.markdown([table.Answer(case, rows, day_tests=tests, navigation=navigation)], "a test")
    assert "1 simulations: χ² over its degrees of freedom" in text
    assert "**With and without GNSS and INS.**" in text
