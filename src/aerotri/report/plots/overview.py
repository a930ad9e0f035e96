"""All plots of an adjusted block. A plot function takes a result and returns a figure; it never saves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from aerotri.image_errors import Change, averaged_residuals, field_on_grid, image_groups
from aerotri.image_errors.residual_profiles import residual_profiles
from aerotri.report.plots.block import plot_block_plan, plot_ground_points, plot_rays_per_point
from aerotri.report.plots.camera import plot_averaged_residuals, plot_systematic_errors
from aerotri.report.plots.ellipses import plot_error_ellipses
from aerotri.report.plots.overlap import plot_overlap
from aerotri.report.plots.panels import Panel, plot_panels
from aerotri.report.plots.reliability import plot_reliability
from aerotri.report.plots.rendering import save_plots
from aerotri.report.plots.residual_profiles import plot_photograph_residuals, plot_residual_profiles
from aerotri.report.plots.residuals import (
    correlated_parameters,
    plot_correlations,
    plot_ray_correlation,
    plot_residual_histogram,
)
from aerotri.report.plots.rigs import plot_rig
from aerotri.report.plots.trajectory import plot_trajectory
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.photograph_residuals import PhotographResiduals, photograph_residuals
from aerotri.statistics.position_differences import position_differences

__all__ = [
    "all_plots",
    "plot_averaged_residuals",
    "plot_block_plan",
    "plot_change",
    "plot_correlations",
    "plot_error_ellipses",
    "plot_ground_points",
    "plot_overlap",
    "plot_photograph_residuals",
    "plot_ray_correlation",
    "plot_rays_per_point",
    "plot_reliability",
    "plot_residual_histogram",
    "plot_residual_profiles",
    "plot_rig",
    "plot_systematic_errors",
    "plot_trajectory",
    "save_plots",
]

MOST_GROUPS = 8
"""Groups of photographs that have plots over the image format; chosen [C]: more make the report long and slow to
draw."""


def all_plots(
    adjusted: AdjustedBlock, changes: Sequence[Change] = (), prints: np.ndarray | None = None,
    of_photographs: PhotographResiduals | None = None,
) -> dict[str, Figure]:  # fmt: skip
    """The figures of the report by a name fit for a file, in the order of the report.

    Plots over the image format are drawn for the first eight image groups and numbered from the second on.

    Parameters
    ----------
    changes : of the image errors between groups, as `group_changes` finds them.
    prints : (n,) footprints over the relief, see `plot_overlap`.
    of_photographs : residuals of the photographs; None: of the rays that `adjusted` has.
    """
    name = adjusted.block.name
    figures = {"block_plan": plot_block_plan(adjusted)}
    _add(figures, "overlap", plot_overlap(adjusted, prints))
    positions = position_differences(adjusted)
    if positions is not None:
        figures["trajectory"] = plot_trajectory(positions, name)
    _add(figures, "error_ellipses", plot_error_ellipses(adjusted))
    if len(adjusted.control) or len(adjusted.check):
        figures["ground_points"] = plot_ground_points(adjusted)
    for number, group in enumerate(image_groups(adjusted.block)[:MOST_GROUPS], start=1):
        suffix = "" if number == 1 else f"_{number}"
        field = field_on_grid(adjusted, group.name, camera=group.camera.name)
        if field.max > 0.0:
            figures[f"systematic_errors{suffix}"] = plot_systematic_errors(field, name)
        averaged = averaged_residuals(adjusted, group.name, camera=group.camera.name)
        if averaged.shown.any():
            figures[f"averaged_residuals{suffix}"] = plot_averaged_residuals(averaged, name)
    for number, change in enumerate(changes, start=1):
        figures["change" if number == 1 else f"change_{number}"] = plot_change(adjusted, change)
    for number, rig in enumerate(dict.fromkeys(one.rig for one in adjusted.rigs), start=1):
        figures["rig" if number == 1 else f"rig_{number}"] = plot_rig(adjusted, rig)
    if len(correlated_parameters(adjusted)) >= 2:
        figures["correlations"] = plot_correlations(adjusted)
    figures["residual_histogram"] = plot_residual_histogram(adjusted)
    _add(figures, "column_row_residuals", plot_residual_profiles(residual_profiles(adjusted), name))
    of_photographs = photograph_residuals(adjusted) if of_photographs is None else of_photographs
    _add(figures, "photograph_residuals", plot_photograph_residuals(of_photographs, adjusted))
    if adjusted.ray_correlation is not None and adjusted.ray_correlation.nearest >= 0:
        figures["ray_correlation"] = plot_ray_correlation(adjusted.ray_correlation, name)
    figures["rays_per_point"] = plot_rays_per_point(adjusted)
    if adjusted.effects is not None:
        figures["reliability"] = plot_reliability(adjusted)
    return figures


def _add(figures: dict[str, Figure], name: str, figure: Figure | None) -> None:
    """Keep a figure that there is."""
    if figure is not None:
        figures[name] = figure


def plot_change(adjusted: AdjustedBlock, change: Change) -> Figure:
    """Two groups and their difference, on one scale."""
    fields = [field_on_grid(adjusted, group, camera=change.camera) for group in (change.first, change.second)]
    title = f"Two groups – {adjusted.block.name}"
    return plot_panels([Panel(field.group, field) for field in (*fields, change.field)], title)
