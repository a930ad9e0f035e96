"""Plots: drawn without warnings, every axis named with its unit, nothing on top of anything, honest numbers."""

import functools
import warnings
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aerotri.image_errors import averaged_residuals, field_on_grid
from aerotri.report.plots import canvas, plan
from aerotri.report.plots.camera import seams
from aerotri.report.plots.overview import (
    all_plots,
    plot_averaged_residuals,
    plot_block_plan,
    plot_correlations,
    plot_ground_points,
    plot_systematic_errors,
    save_plots,
)
from synthetic import make_adjusted_block, ultracam

NAMES = [
    "block_plan", "overlap", "error_ellipses", "ground_points", "systematic_errors", "averaged_residuals",
    "correlations", "residual_histogram", "column_row_residuals", "photograph_residuals", "rays_per_point",
]  # fmt: skip


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block()


def empty_points(results):
    return replace(
        results, point=np.zeros(0, np.int64), difference=np.zeros((0, 3)), sigma=np.zeros((0, 3)), r=np.zeros((0, 3)),
        w=np.zeros((0, 3)), rays=np.zeros(0, np.int64),
    )  # fmt: skip


def drawn(figure):
    FigureCanvasAgg(figure).draw()
    return figure


def all_text(figure):
    return " ".join(t.get_text() for t in figure.findobj(matplotlib.text.Text))


def test_all_plots(adjusted):
    figures = all_plots(adjusted)
    assert list(figures) == NAMES
    for figure in figures.values():
        assert 7.0 <= figure.get_size_inches()[0] <= 9.0
        assert adjusted.block.name in figure.texts[0].get_text()


@functools.cache
def plots_of(strips, per_strip):
    """All plots of a block of that shape, drawn."""
    figures = all_plots(make_adjusted_block(strips, per_strip, n_points=200))
    return {name: drawn(figure) for name, figure in figures.items()}


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_units(name):
    figure = plots_of(4, 10)[name]
    for axes in figure.axes[:2]:
        labels = axes.get_xlabel() + axes.get_ylabel()
        assert name == "correlations" or "[" in labels


def tick_labels(axis):
    """Labels of the ticks within the axes; matplotlib keeps some beyond."""
    low, high = sorted(axis.get_view_interval())
    return [
        tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high and tick.label1.get_visible()
    ]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", [(4, 10), (1, 14), (12, 3)])
def test_nothing_overlaps(name, shape):
    """Title, subtitle, legends, axis labels and scale texts keep apart from one another and inside the figure."""
    figure = plots_of(*shape)[name]
    renderer = figure.canvas.get_renderer()
    parts = [*figure.texts, *figure.legends]
    for axes in figure.axes:
        parts += [axes.xaxis.label, axes.yaxis.label, *tick_labels(axes.xaxis), *tick_labels(axes.yaxis)]
        parts += [artist for artist in axes.get_children() if isinstance(artist, matplotlib.text.Text)]
        parts += [artist.text for artist in axes.get_children() if isinstance(artist, matplotlib.quiver.QuiverKey)]
    boxes = [(part, part.get_window_extent(renderer)) for part in parts if getattr(part, "get_text", lambda: "-")()]
    assert len(boxes) > 5
    width, height = figure.canvas.get_width_height()
    for i, (first, a) in enumerate(boxes):
        assert a.x0 >= -1, first
        assert a.y0 >= -1, first
        assert a.x1 <= width + 1, first
        assert a.y1 <= height + 1, first
        for second, b in boxes[i + 1 :]:
            apart = a.x1 <= b.x0 + 1 or b.x1 <= a.x0 + 1 or a.y1 <= b.y0 + 1 or b.y1 <= a.y0 + 1
            assert apart, (first, second)


@pytest.mark.parametrize("shape", [(4, 10), (1, 14), (12, 3)])
@pytest.mark.parametrize("toward", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)])
def test_arrows_of_differences_end_inside(shape, toward):
    """The longest arrow of a point at the edge is not cut at the frame."""
    adjusted = make_adjusted_block(*shape, n_points=200)
    moved = 0.1 * np.array(toward) * np.ones((len(adjusted.check), 1))
    figure = drawn(plot_ground_points(replace(adjusted, check=replace(adjusted.check, difference=moved))))
    ends = 0
    for axes in figure.axes:
        for quiver in (artist for artist in axes.get_children() if isinstance(artist, matplotlib.quiver.Quiver)):
            begin = axes.transData.transform(np.column_stack([quiver.X, quiver.Y]))
            end = begin + figure.dpi / quiver.scale * np.column_stack([quiver.U, quiver.V])
            box = axes.get_window_extent()
            assert (end >= (box.x0, box.y0)).all()
            assert (end <= (box.x1, box.y1)).all()
            ends += len(end)
    assert ends >= 2 * len(adjusted.check)


def test_coordinates_of_neighbouring_panels_keep_apart():
    """Wherever the block lies, the last coordinate of the left panel does not meet the first of the right one."""
    adjusted = make_adjusted_block(4, 10, n_points=200)
    for east in np.linspace(0.0, 1000.0, 9):
        shift = np.array([6e6 + east, 0.0, 0.0])
        points = replace(adjusted.points, xyz=adjusted.points.xyz + shift)
        images = replace(adjusted.images, centre=adjusted.images.centre + shift)
        figure = drawn(plot_ground_points(replace(adjusted, points=points, images=images)))
        left, right = (tick_labels(axes.xaxis) for axes in figure.axes[:2])
        renderer = figure.canvas.get_renderer()
        ends = max(label.get_window_extent(renderer).x1 for label in left)
        assert ends + 2.0 <= min(label.get_window_extent(renderer).x0 for label in right)


def test_check_points_are_named_on_the_plan(adjusted):
    names = adjusted.block.points[adjusted.check.point[:3]].tolist()
    text = all_text(drawn(plot_block_plan(adjusted))).split()
    assert any(name in text for name in names)


def test_size(tmp_path):
    """All plots of 132 photographs as SVG and PNG."""
    big = make_adjusted_block(11, 12, 1774, n_control=30, n_check=60)
    rendered = save_plots(all_plots(big), tmp_path)
    assert sum(len(plot.svg) for plot in rendered.values()) < 2e6
    assert {path.name for path in tmp_path.iterdir()} == {f"{n}.{kind}" for n in NAMES for kind in ("svg", "png")}


def test_same_figure_same_bytes(adjusted, tmp_path):
    one = save_plots({"plan": plot_block_plan(adjusted)}, tmp_path)
    two = save_plots({"plan": plot_block_plan(adjusted)}, tmp_path)
    assert one == two


def test_settings_of_the_user_are_left_alone(adjusted, tmp_path):
    with matplotlib.rc_context({"font.size": 21.0, "text.usetex": False, "svg.hashsalt": "mine"}):
        save_plots({"plan": plot_block_plan(adjusted)}, tmp_path)
        assert matplotlib.rcParams["font.size"] == 21.0
        assert matplotlib.rcParams["svg.hashsalt"] == "mine"


def test_days_have_numbered_plots():
    figures = all_plots(make_adjusted_block(2, 4, 60, groups="day"))
    assert {"systematic_errors", "systematic_errors_2", "averaged_residuals", "averaged_residuals_2"} <= set(figures)
    assert "day 2" in figures["systematic_errors_2"].texts[1].get_text()


def test_without_ground_points(adjusted):
    bare = replace(adjusted, control=empty_points(adjusted.control), check=empty_points(adjusted.check))
    figures = all_plots(bare)
    assert "ground_points" not in figures
    for figure in figures.values():
        drawn(figure)
    drawn(plot_ground_points(replace(adjusted, control=empty_points(adjusted.control))))


def test_without_additional_parameters():
    figures = all_plots(make_adjusted_block(2, 4, 60, parameters="none"))
    assert "systematic_errors" not in figures
    assert "correlations" not in figures


def test_correlations_need_two(adjusted):
    with pytest.raises(ValueError, match="at least two"):
        plot_correlations(make_adjusted_block(2, 4, 60, parameters="none"))


@pytest.mark.parametrize("field", ["images", "points", "rays", "sigma0"])
def test_a_result_full_of_holes_is_drawn(adjusted, field):
    if field == "images":
        images = replace(
            adjusted.images, centre=adjusted.images.centre * np.nan, angles=adjusted.images.angles * np.nan
        )
        holed = replace(adjusted, images=images)
    elif field == "points":
        holed = replace(adjusted, points=replace(adjusted.points, xyz=adjusted.points.xyz * np.nan))
    elif field == "rays":
        nothing = adjusted.rays.v * np.nan
        rays = replace(adjusted.rays, v=nothing, r=nothing, w=nothing, status=np.ones_like(adjusted.rays.status))
        holed = replace(adjusted, rays=rays)
    else:
        holed = replace(adjusted, outcome=replace(adjusted.outcome, sigma0=np.nan, sigma0_um=np.nan))
    for figure in all_plots(holed).values():
        drawn(figure)


@pytest.mark.parametrize("name", ["$x^2$ and $", "a_b^c\\frac", "line\nbreak\t\x1b[31m", "n" * 300, "<b>&amp;"])
def test_names_are_text(name, tmp_path):
    adjusted = make_adjusted_block(2, 4, 60, name=name)
    block = adjusted.block
    points = block.points.astype(object)
    points[adjusted.control.point[0]] = name
    figure = drawn(plot_block_plan(replace(adjusted, block=replace(block, points=points))))
    assert "\n" not in figure.texts[0].get_text()
    assert len(figure.texts[0].get_text()) < 80


def test_letters_that_the_font_lacks_are_no_warning(tmp_path):
    save_plots({"plan": plot_block_plan(make_adjusted_block(2, 4, 60, name="測量"))}, tmp_path)


def test_systematic_errors_states_what_it_shows(adjusted):
    field = field_on_grid(adjusted, "ucd2")
    text = all_text(drawn(plot_systematic_errors(field, "b")))
    assert f"largest {1e3 * field.max:.2f} µm" in text
    assert f"RMS {1e3 * field.rms:.2f} µm" in text
    assert "flight" in text
    assert "µm (" in text


def test_averaged_residuals_state_sign_and_limit(adjusted):
    averaged = averaged_residuals(adjusted, "ucd2", n_min=7)
    text = all_text(drawn(plot_averaged_residuals(averaged, "b")))
    assert "measured − adjusted" in text
    assert "at least 7 rays" in text


@pytest.mark.parametrize("axis", ["+x", "-x", "+y", "-y"])
def test_seams_turn_with_the_flight(axis):
    """Two seams across, two along, at the pixels of the tiles: 1873 columns and 1207 rows from the centre."""
    camera = ultracam(flight_axis=axis)
    if axis in ("+x", "-x"):
        camera = replace(camera, size_px=(7500, 11500))
    lines = np.array(seams(camera))
    long = 0 if axis in ("+y", "-y") else 1
    at = sorted({round(float(line[0, long]), 6) for line in lines if line[0, long] == pytest.approx(line[1, long])})
    np.testing.assert_allclose(at, [-16.857, 16.857], atol=1e-6)
    other = 1 - long
    at = sorted({round(float(line[0, other]), 6) for line in lines if line[0, other] == pytest.approx(line[1, other])})
    np.testing.assert_allclose(at, [-10.863, 10.863], atol=1e-6)


def test_footprint_of_a_vertical_photograph():
    """A level photograph at height h shows format·h/c, turned by κ."""
    adjusted = make_adjusted_block(1, 1, 30, parameters="none")
    centre = np.array([[1000.0, 2000.0, 1134.0]])
    xyz = adjusted.points.xyz.copy()
    xyz[:, 2] = 120.0
    level = replace(
        adjusted, points=replace(adjusted.points, xyz=xyz),
        images=replace(adjusted.images, centre=centre, angles=np.array([[0.0, 0.0, np.pi / 2]])),
    )  # fmt: skip
    corners = plan.footprints(level)[0]
    half = 1014.0 / 101.4 * np.array([33.75, 51.75])
    np.testing.assert_allclose(np.ptp(corners, axis=0), 2 * half, rtol=1e-12)
    # the lower left corner of the image lies at +x, −y after a quarter turn
    np.testing.assert_allclose(corners[0], [1000.0 + half[0], 2000.0 - half[1]], rtol=1e-12)


def test_oblique_photographs_hide_their_footprint():
    adjusted = make_adjusted_block(1, 2, 30, parameters="none")
    angles = np.array([[0.0, 0.0, 0.0], [np.radians(85.0), 0.0, 0.0]])
    corners = plan.footprints(replace(adjusted, images=replace(adjusted.images, angles=angles)))
    assert np.isfinite(corners[0]).all()
    assert np.isnan(corners[1]).all()


@pytest.mark.parametrize(
    ("value", "expected"), [(0.099, 0.05), (0.1, 0.1), (1.0, 1.0), (7.3, 5.0), (23.0, 20.0), (0.0, 1.0), (np.nan, 1.0)]
)
def test_nice_number(value, expected):
    assert canvas.nice_number(value) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("metres", "text"),
    [(2.0, "2 m"), (0.1, "10 cm"), (0.005, "5 mm"), (2e-5, "20 µm"), (5e-7, "0.5 µm"), (2000, "2 km")],
)
def test_length_text(metres, text):
    assert canvas.length_text(metres) == text


def test_figures_are_figures(adjusted):
    assert all(isinstance(figure, Figure) for figure in all_plots(adjusted).values())
