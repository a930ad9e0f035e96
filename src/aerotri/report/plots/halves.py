"""Two halves of a block compared, as pictures: image errors by cell of the format, heights by cell in plan."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from aerotri.report.plots.camera import draw_format, flight_arrow, micron, size_text
from aerotri.report.plots.canvas import (
    GREY,
    INK,
    WIDTH,
    axes_at,
    coordinate_axes,
    new_figure,
    per_inch_for,
    plain,
    scale_vector,
    styled,
    vectors,
)
from aerotri.results.halves import DIVISIONS, AgreementTest, FieldDifference, HalvesComparison

HIGHEST = 6.2
"""Inches that a map is high at most: with its title it fits a printed page."""
FULL_TONE = 5.0
"""|difference|/σ that has the full tone; chosen [C]: beyond it no noise explains a cell."""
PALE = LinearSegmentedColormap.from_list("pale", ["#ffffff", "#9aa3ab"])
"""Tones on which black arrows are still seen."""
LONGEST_IN_CELLS = 1.3
"""Longest arrow, in cells."""


@styled
def plot_field_difference(comparison: HalvesComparison, field: FieldDifference, block_name: str) -> Figure:
    """Difference of the image errors: arrows in µm, the tone of a cell says how many σ."""
    camera, half = field.camera, np.array(field.camera.half_format_mm)
    subtitle = (
        f"{plain(field.group)}: {plain(comparison.halves[0], 60)} − {plain(comparison.halves[1], 60)}\n"
        f"RMS {micron(field.rms, camera)}, by σ alone {micron(field.rms_sigma, camera)};  {_outcome(field.test)}\n"
        "without shifts, scale, rotation, tilts: orientation and interior orientation take them"
    )
    mm_per_inch = max(2 * half[0] / (WIDTH - 2.6), 2 * half[1] / HIGHEST)
    width, height = 2 * half / mm_per_inch
    title = f"Image errors of the halves compared, {DIVISIONS[comparison.division]} – {plain(block_name)}"
    figure = new_figure(height + 1.95, title, subtitle)
    axes = axes_at(figure, 0.8, 0.85, width, height)
    axes.set_xlim(-half[0], half[0])
    axes.set_ylim(-half[1], half[1])
    axes.set_xlabel("x in the image [mm]")
    axes.set_ylabel("y in the image [mm]")
    tone = np.abs(field.z).max(axis=-1)
    mesh = axes.imshow(
        tone, cmap=PALE, vmin=0.0, vmax=FULL_TONE, origin="lower", aspect="auto", zorder=0,
        extent=(-half[0], half[0], -half[1], half[1]),
    )  # fmt: skip
    draw_format(axes, camera)
    cell = width / field.x.shape[1]
    per_inch, size = per_inch_for(np.linalg.norm(field.d, axis=-1), LONGEST_IN_CELLS * cell)
    at, d = np.stack([field.x, field.y], axis=-1).reshape(-1, 2), field.d.reshape(-1, 2)
    quiver = vectors(axes, at, d, per_inch, INK, zorder=3, clip_on=False)
    scale_vector(axes, quiver, size, per_inch, size_text(size, camera), 0.85, 0.25)
    _tone_bar(figure, mesh, 0.8 + width + 0.15, height, "larger of |dx|, |dy| over its σ")
    flight_arrow(figure, camera, 0.8 + width + 1.3, 0.85 + height / 2)
    return figure


@styled
def plot_height_differences(comparison: HalvesComparison, block_name: str, crs: str) -> Figure:
    """Mean height differences by cell in plan: the number in cm, the tone says how many σ."""
    points = comparison.points
    if points is None:
        raise ValueError("nothing was compared")
    low, high = points.centre.min(axis=0) - points.size / 2, points.centre.max(axis=0) + points.size / 2
    per_inch = max((high[0] - low[0]) / (WIDTH - 2.4), (high[1] - low[1]) / HIGHEST)
    width, height = (high - low) / per_inch
    rms, sigma = (float(np.sqrt(np.mean(values[:, 2] ** 2))) for values in (points.mean, points.mean_sigma))
    how = ", after a transformation with seven parameters" if comparison.transformed else ""
    subtitle = (
        f"{plain(comparison.halves[0], 60)} − {plain(comparison.halves[1], 60)}{how}\n"
        f"{len(points.point)} points in {len(points.centre)} cells of {points.size:.3g} m;  RMS {100 * rms:.2g} cm, by "
        f"σ alone {100 * sigma:.2g} cm;  {_outcome(points.height)}"
    )
    title = f"Heights of the halves compared, {DIVISIONS[comparison.division]} – {plain(block_name)}"
    figure = new_figure(height + 1.75, title, subtitle)
    left = max(0.95, (WIDTH - width - 1.2) / 2.0)
    axes = axes_at(figure, left, 0.7, width, height)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    cells = [Rectangle(tuple(at - points.size / 2), points.size, points.size) for at in points.centre]
    patches = PatchCollection(cells, cmap="RdBu_r", edgecolor="white", linewidth=0.8, zorder=1)
    patches.set_array(points.z[:, 2])
    patches.set_clim(-FULL_TONE, FULL_TONE)
    axes.add_collection(patches)
    axes.plot(*points.xyz[:, :2].T, ".", ms=0.6, color=GREY, alpha=0.35, zorder=2)
    letters = float(np.clip(72.0 * points.size / per_inch / 4.2, 4.0, 9.0))
    for at, value, z in zip(points.centre, points.mean[:, 2], points.z[:, 2], strict=True):
        strong = abs(z) > 0.7 * FULL_TONE
        text = f"{100 * value:+.{0 if 100 * rms >= 10 else 1}f}".replace("-", "−")
        weight = "bold" if abs(z) > points.height.usual_max_z else "normal"
        axes.text(float(at[0]), float(at[1]), text, ha="center", va="center", fontsize=letters,
                  color="white" if strong else INK, weight=weight, zorder=3)  # fmt: skip
    coordinate_axes(axes, width, height, ("X (local) [m]", "Y (local) [m]") if crs == "local" else ("E [m]", "N [m]"))
    _tone_bar(figure, patches, left + width + 0.15, height, "height difference over its σ", 0.7)
    told = "numbers: mean difference [cm], bold where beyond what noise gives;  dots: points"
    figure.text(left / WIDTH, 0.08 / float(figure.get_size_inches()[1]), told, fontsize=8, color=GREY)
    return figure


def _outcome(test: AgreementTest) -> str:
    return f"largest {test.max_z:.1f} σ, by noise alone mostly below {test.usual_max_z:.1f} σ;  p = {test.p:.2g}"


def _tone_bar(
    figure: Figure, mesh: ScalarMappable, left: float, height: float, label: str, bottom: float = 0.85
) -> None:
    scale = axes_at(figure, left, bottom, 0.16, height)
    bar = figure.colorbar(mesh, cax=scale, extend="max")
    bar.set_label(label)
    scale.yaxis.set_major_formatter(lambda value, _: f"{value:g}".replace("-", "−"))
