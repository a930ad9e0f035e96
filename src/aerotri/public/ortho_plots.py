"""Plots of an orthophoto: the image, the σ of its positions, its seams, and the points in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.terrain.ortho.make import OrthoOutcome


@dataclass(frozen=True, eq=False)
class OrthoPlots:
    """Plots of an orthophoto, each a matplotlib Figure.

    Parameters
    ----------
    record : the numbers as arrays. folder : with the rasters. points : control and check points. block : its name.
    """

    record: OrthoOutcome
    folder: Path
    points: tuple[Any, ...]
    block: str

    def orthophoto(self) -> Figure:
        """The orthophoto with control and check points."""
        from aerotri.report.plots.ortho import plot_orthophoto

        return plot_orthophoto(self.record, self.folder, self.block, self.points)

    def sigma(self) -> Figure:
        """σ of its positions."""
        from aerotri.report.plots.ortho import plot_ortho_sigma

        return plot_ortho_sigma(self.record, self.block)

    def seams(self) -> Figure:
        """Its seams, and which photograph is between them."""
        from aerotri.report.plots.ortho import plot_seams

        return plot_seams(self.record, self.folder, self.block)

    def points_in_it(self) -> Figure:
        """The ground around control and check points, with a cross where their coordinates are.

        Raises
        ------
        InputError
            When none lies in the orthophoto.
        """
        from aerotri.report.plots.ortho import plot_points

        if not self.points:
            raise InputError("no control or check point lies in the orthophoto", "leave this plot out")
        return plot_points(self.record, self.folder, self.points, self.block)

    def all(self) -> dict[str, Figure]:
        """Every plot by the name of its file."""
        found = {"orthophoto": self.orthophoto(), "sigma": self.sigma(), "seams": self.seams()}
        return found | ({"points": self.points_in_it()} if self.points else {})
