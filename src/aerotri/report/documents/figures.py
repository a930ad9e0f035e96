"""Figures of a document: those of the report, as files beside the template."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from aerotri.image_errors import ImageGroup, averaged_residuals, field_on_grid, image_groups
from aerotri.report.documents.picture_texts import in_language
from aerotri.report.plots.block import plot_block_plan, plot_ground_points
from aerotri.report.plots.camera import plot_averaged_residuals, plot_systematic_errors
from aerotri.report.plots.rendering import RenderedPlot, render_plots
from aerotri.results.adjusted_block import AdjustedBlock

LARGEST_SVG = 3_000_000
"""Bytes of a drawing that is embedded with its lines; larger ones (tens of thousands of points) as a picture [C]."""
MOST_GROUPS = 4
"""Groups of photographs whose image errors are drawn in the report [C]: about two pages."""


def adjustment_figures(adjusted: AdjustedBlock, language: str) -> tuple[dict[str, bytes], list[tuple[str, str]]]:
    """Files by name; keys of the captions with their files: plan, differences at ground points, image errors."""
    figures: dict[str, tuple[str, Figure]] = {"plan": ("plan", plot_block_plan(adjusted))}
    if len(adjusted.control) or len(adjusted.check):
        figures["ground"] = ("ground", plot_ground_points(adjusted))
    for number, group in enumerate(image_groups(adjusted.block)[:MOST_GROUPS], start=1):
        figures |= {f"{name}{number}": (name, figure) for name, figure in camera_figures(adjusted, group).items()}
    drawn = in_language({name: figure for name, (_, figure) in figures.items()}, language)
    files, names = as_files(render_plots(drawn))
    return files, [(caption, names[name]) for name, (caption, _) in figures.items()]


def camera_figures(adjusted: AdjustedBlock, group: ImageGroup) -> dict[str, Figure]:
    """Systematic image errors of a group and what remains in its residuals, where there are any."""
    figures: dict[str, Figure] = {}
    field = field_on_grid(adjusted, group.name, camera=group.camera.name)
    if field.max > 0.0:
        figures["field"] = plot_systematic_errors(field, adjusted.block.name)
    averaged = averaged_residuals(adjusted, group.name, camera=group.camera.name)
    if averaged.shown.any():
        figures["averaged"] = plot_averaged_residuals(averaged, adjusted.block.name)
    return figures


def as_files(plots: Mapping[str, RenderedPlot]) -> tuple[dict[str, bytes], dict[str, str]]:
    """Plots as files: their contents by file name, and the file names by the names of the plots."""
    files, names = {}, {}
    for name, plot in plots.items():
        small = 0 < len(plot.svg) <= LARGEST_SVG
        names[name] = f"{name}.svg" if small else f"{name}.png"
        files[names[name]] = plot.svg if small else plot.png
    return files, names
