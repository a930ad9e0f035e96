"""Every family drawn, and the units of its parameters."""

import warnings
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.quiver import Quiver
from matplotlib.text import Text

from aerotri.functional_model.additional_parameters import FAMILIES, parameter_set, text_of
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES, default_items
from aerotri.report.plots.parameters import number_text, pattern_sheets, plot_pattern_sheet, plot_pattern_sheets
from aerotri.report.tables.adjustment import unit_of
from family_cameras import camera_for, inner_points


def any_camera(family):
    return camera_for(family if family in LINEAR_FAMILIES else "bluh")


def texts(figure):
    return {text.get_text() for text in figure.findobj(lambda artist: isinstance(artist, Text))}


def quiver_of(axes) -> Any:
    (quiver,) = (artist for artist in axes.collections if isinstance(artist, Quiver))
    return quiver


@pytest.mark.parametrize("family", FAMILIES)
def test_every_pattern_is_drawn(family):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figures = plot_pattern_sheets(family, any_camera(family))
        for figure, items in zip(figures, pattern_sheets(family), strict=True):
            FigureCanvasAgg(figure).draw()
            assert len(figure.axes) == len(items)
            assert set(items) <= texts(figure)
            for axes in figure.axes:
                quiver = quiver_of(axes)
                length = np.hypot(quiver.U, quiver.V) / quiver.scale
                assert 0.02 < length.max() < 0.3
    shown = [item for items in pattern_sheets(family) for item in items]
    full = list(default_items(family))
    assert len(shown) == 4 if family in ("grid", "collocation") else shown[: len(full)] == full


def test_sheets_are_divided():
    items = LINEAR_FAMILIES["legendre"].items[:45]
    with pytest.raises(ValueError, match="1 to 44 patterns"):
        plot_pattern_sheet("legendre", camera_for("legendre"), items)
    assert len(pattern_sheets("gruen")) == 1


def test_titles_and_pictures_belong_together_in_any_order():
    """Items are drawn where they were asked for."""
    figure = plot_pattern_sheet("bluh", camera_for("bluh"), ["12", "1"])
    sizes = [quiver_of(axes).V[0] for axes in figure.axes]
    first = quiver_of(figure.axes[0])
    x, y = first.X[0], first.Y[0]
    basis = parameter_set("bluh", ["1", "12"], camera_for("bluh")).basis(np.array([x]), np.array([y]))[0]
    np.testing.assert_allclose(sizes, basis[1, ::-1])


def test_one_unit_is_stated():
    """Scale of the middle of an UltraCamD tile: the longest vector of a shift by one unit is 1 mm."""
    found = texts(plot_pattern_sheet("ultracam_d", camera_for("ultracam_d"), ["50"]))
    assert {"50", "1 mm", text_of("ultracam_d", "50")} <= found


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.97, "0.97"), (150.3, "150"), (3140.0, "3100"), (1.64e4, "1.6·10⁴"), (2e-7, "2.0·10⁻⁷")],
)
def test_numbers(value, text):
    assert number_text(value) == text


@pytest.mark.parametrize("family", ["ebner", "gruen", "fourier", "legendre", "chebyshev", "grid", "collocation"])
def test_units_follow_from_scaling(family):
    """On a format twice as large a pattern of degree d is 2^d as large: its parameter has the unit mm^(1 − d)."""
    small, large = (camera_for(family, pixel_um=size) for size in (9.0, 18.0))
    items = default_items(family)
    x, y = inner_points(small, 50)
    one, two = parameter_set(family, items, small).basis(x, y), parameter_set(family, items, large).basis(2 * x, 2 * y)
    ratio = np.abs(two).max(axis=(0, 1)) / np.maximum(np.abs(one).max(axis=(0, 1)), 1e-300)
    names = ["mm", "–", "1/mm", "1/mm²", "1/mm³", "1/mm⁴", "1/mm⁵", "1/mm⁶", "1/mm⁷"]
    for item, factor in zip(items, ratio, strict=True):
        if factor > 0.0:
            assert unit_of(f"{family}.{item}") == names[round(np.log2(factor))]


def test_units_of_camera_families():
    assert [unit_of(f"dmc.{item}") for item in ("30", "41", "74", "79", "80")] == [
        "1/mm",
        "1/mm",
        "1/mm²",
        "–",
        "1/mm²",
    ]


@pytest.mark.parametrize("family", ["brown", "lens", "collocation"])
def test_command_draws_every_family(family, tmp_path, capsys):
    from aerotri.commands.parameters import run_parameters

    run_parameters(tmp_path, family, True)
    capsys.readouterr()
    assert (tmp_path / f"{family}.svg").stat().st_size > 10_000


def test_items_outside_of_the_full_set_are_drawn():
    assert {"29", "80"} < {item for sheet in pattern_sheets("dmc") for item in sheet}
