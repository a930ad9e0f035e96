"""The plots of a result. Each is a matplotlib Figure: a notebook shows it, `savefig` keeps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.results.adjusted_block import AdjustedBlock


@dataclass(frozen=True, eq=False)
class AdjustmentPlots:
    """Plots of an adjusted block.

    Parameters
    ----------
    adjusted : the numbers.
    """

    adjusted: AdjustedBlock

    def systematic_errors(self, group: str | None = None, camera: str | None = None) -> Figure:
        """The systematic image errors over the format, what is significant drawn darker.

        Parameters
        ----------
        group : parameter group (a camera, a day); the first where None. camera : where a group has several.

        Raises
        ------
        InputError
            For a group that the block does not have.
        """
        from aerotri.image_errors import field_on_grid
        from aerotri.report.plots.camera import plot_systematic_errors

        field = field_on_grid(self.adjusted, *self._group(group, camera))
        return plot_systematic_errors(field, self.adjusted.block.name)

    def averaged_residuals(self, group: str | None = None, camera: str | None = None) -> Figure:
        """Mean residuals by cell of the format: what the parameters have left.

        Parameters
        ----------
        group, camera : as of `systematic_errors`.

        Raises
        ------
        InputError
            For a group that the block does not have.
        """
        from aerotri.image_errors import averaged_residuals
        from aerotri.report.plots.camera import plot_averaged_residuals

        name, _, own = self._group(group, camera)
        found = averaged_residuals(self.adjusted, name, camera=own)
        return plot_averaged_residuals(found, self.adjusted.block.name)

    def block_plan(self) -> Figure:
        """Photographs, strips, control and check points in plan."""
        from aerotri.report.plots.overview import plot_block_plan

        return plot_block_plan(self.adjusted)

    def ground_points(self) -> Figure:
        """Differences at control and check points as arrows."""
        from aerotri.report.plots.overview import plot_ground_points

        return plot_ground_points(self.adjusted)

    def residuals(self) -> Figure:
        """Histogram of the residuals of the image points beside the normal distribution."""
        from aerotri.report.plots.overview import plot_residual_histogram

        return plot_residual_histogram(self.adjusted)

    def neighbouring_rays(self) -> Figure:
        """Correlation of the residuals of two image points of a photograph, by their distance.

        Raises
        ------
        InputError
            When no image points are near enough to one another.
        """
        from aerotri.conventions import InputError
        from aerotri.report.plots.overview import plot_ray_correlation

        found = self.adjusted.ray_correlation
        if found is None or found.nearest < 0:
            raise InputError("no image points of a photograph are near one another", "there is nothing to draw")
        return plot_ray_correlation(found, self.adjusted.block.name)

    def correlations(self) -> Figure:
        """Correlations of the shared parameters.

        Raises
        ------
        InputError
            When there are fewer than two.
        """
        from aerotri.conventions import InputError
        from aerotri.report.plots.residuals import correlated_parameters, plot_correlations

        if len(correlated_parameters(self.adjusted)) < 2:
            raise InputError("fewer than two parameters are shared by the rays", "adjust with additional parameters")
        return plot_correlations(self.adjusted)

    def rays_per_point(self) -> Figure:
        """How many photographs the object points were measured in."""
        from aerotri.report.plots.overview import plot_rays_per_point

        return plot_rays_per_point(self.adjusted)

    def reliability(self) -> Figure:
        """Where gross errors that the tests would just not find do most to heights.

        Raises
        ------
        InputError
            When the external reliability was not computed.
        """
        from aerotri.conventions import InputError
        from aerotri.report.plots.overview import plot_reliability

        if self.adjusted.effects is None:
            raise InputError("this result has no external reliability", "adjust the block again with aerotri.adjust")
        return plot_reliability(self.adjusted)

    def height_accuracy(self) -> Figure:
        """σ of heights as a map over the block, with control and check points.

        Raises
        ------
        InputError
            When no object point has a σ.
        """
        from aerotri.conventions import InputError
        from aerotri.report.plots.accuracy import heights_with_sigma, plot_height_accuracy

        if not heights_with_sigma(self.adjusted).any():
            raise InputError("no object point has a σ", "adjust the block until it converges")
        return plot_height_accuracy(self.adjusted)

    def group_change(self, first: str | None = None, second: str | None = None) -> Figure:
        """Image errors of two parameter groups (days, strips, cameras) and their difference, on one scale.

        Parameters
        ----------
        first, second : names of the groups; the first two that can be compared where None.

        Raises
        ------
        InputError
            When the two groups were not compared.
        """
        from aerotri.conventions import InputError
        from aerotri.image_errors import group_changes
        from aerotri.report.plots.overview import plot_change

        found = [
            change for change in group_changes(self.adjusted)
            if first in (None, change.first) and second in (None, change.second)
        ]  # fmt: skip
        if not found:
            remedy = "adjust with additional parameters and parameter_groups; group_changes lists what was compared"
            raise InputError("these groups were not compared", remedy)
        return plot_change(self.adjusted, found[0])

    def all(self) -> dict[str, Figure]:
        """Every plot of the report by the name of its file."""
        from aerotri.report.plots.overview import all_plots

        return all_plots(self.adjusted)

    def _group(self, group: str | None, camera: str | None) -> tuple[str, None, str | None]:
        """Name of the group, nodes of its grid (as the format has it), camera."""
        from aerotri.public.image_errors import chosen_group

        found = chosen_group(self.adjusted.block, group, camera)
        return found.name, None, found.camera.name
