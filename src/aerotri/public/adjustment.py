"""An adjusted block as a notebook sees it: numbers, tables, plots, covariances, and a folder to keep it in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath
from aerotri.public.folders import paths_of
from aerotri.public.progress import ProgressLike

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from aerotri.image_errors import AveragedResiduals, Change
    from aerotri.observations import Block
    from aerotri.public.covariance import Covariance
    from aerotri.public.image_errors import ImageErrors
    from aerotri.public.plots import AdjustmentPlots
    from aerotri.public.table import Table
    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.results.adjustment import Adjustment as Record


@dataclass(frozen=True, eq=False, repr=False)
class Adjustment:
    """An adjusted block: what `aerotri.adjust` and `aerotri.open_result` return.

    Parameters
    ----------
    record : the numbers of the result together with the equations they come from.
    notes : what was done with the input before, in sentences.
    folder : that it was opened from, None for a new one.

    Examples
    --------
    >>> import aerotri
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block)
    >>> result.status
    'converged'
    >>> result.points["Z"].shape == (len(result.points),)
    True
    """

    record: Record
    notes: tuple[str, ...] = ()
    folder: Path | None = None

    @property
    def adjusted(self) -> AdjustedBlock:
        """The numbers as arrays, in the coordinate system of the block."""
        return self.record.result

    @property
    def block(self) -> Block:
        """The block as it was adjusted."""
        return self.adjusted.block

    @property
    def status(self) -> str:
        """'converged', 'not converged' or 'rank deficient'."""
        return self.adjusted.outcome.status

    @property
    def verdict(self) -> str:
        """'accepted', 'doubtful' or 'rejected'."""
        return self.adjusted.outcome.verdict

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the result is not simply accepted, in sentences."""
        return self.adjusted.outcome.reasons

    @property
    def good_for(self) -> str:
        """'absolute' (positions in the coordinate system, and the shape), 'relative' (the shape alone) or 'neither'."""
        return self.adjusted.outcome.good_for

    @property
    def purpose(self) -> str:
        """The same in a sentence or two, with the numbers; '' where it is not known."""
        return self.adjusted.outcome.purpose

    @property
    def precision(self) -> dict[str, Any]:
        """Absolute and relative σ side by side, m: medians, the whole block, neighbours; that of adjustment.json."""
        from aerotri.formats.results.adjustment import both_precisions

        return both_precisions(self.adjusted)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What else the user should read."""
        return self.adjusted.outcome.warnings

    @property
    def sigma0(self) -> float:
        """σ̂0, dimensionless: 1 when the stated standard deviations are right."""
        return self.adjusted.outcome.sigma0

    @property
    def sigma0_um(self) -> float:
        """σ̂0 times the stated standard deviation of an image coordinate, µm."""
        return self.adjusted.outcome.sigma0_um

    @property
    def redundancy(self) -> int:
        """Observations − unknowns + conditions."""
        return self.adjusted.outcome.redundancy

    @cached_property
    def images(self) -> Table:
        """Exterior orientation with σ, a row a photograph: the columns of images.csv; m and degrees."""
        from aerotri.public.tables import images_table

        return images_table(self.adjusted)

    @cached_property
    def points(self) -> Table:
        """Object points with σ: the columns of points.csv; m."""
        from aerotri.public.tables import points_table

        return points_table(self.adjusted)

    @cached_property
    def rays(self) -> Table:
        """Image points with residuals, redundancy numbers and tests: the columns of residuals.parquet; mm."""
        from aerotri.public.tables import rays_table

        return rays_table(self.adjusted)

    @cached_property
    def parameters(self) -> Table:
        """Interior orientation, additional parameters and others shared by many rays: those of parameters.csv."""
        from aerotri.public.tables import parameters_table

        return parameters_table(self.adjusted)

    @cached_property
    def control(self) -> Table:
        """Control points, adjusted − given with σ: the columns of control.csv; m."""
        from aerotri.public.tables import control_table

        return control_table(self.adjusted)

    @cached_property
    def check(self) -> Table:
        """Check points, adjusted − given with σ: the columns of check.csv; m."""
        from aerotri.public.tables import check_table

        return check_table(self.adjusted)

    @cached_property
    def groups(self) -> Table:
        """Groups of observations: how well each fits its stated σ, and its share of the redundancy."""
        from aerotri.public.tables import groups_table

        return groups_table(self.adjusted)

    @cached_property
    def findings(self) -> Table:
        """What the verdict rests on: each number beside what it should be."""
        from aerotri.public.findings import findings_table

        return findings_table(self.record.local)

    @cached_property
    def work_list(self) -> Table:
        """What to look at first, the worst on top: what, where, how far beyond its limit, what to do."""
        from aerotri.public.findings import work_table

        return work_table(self.record.local)

    @cached_property
    def blunders(self) -> Table:
        """Image points that a robust estimator or data snooping took for gross errors, and how large they are; µm."""
        from aerotri.public.findings import blunders_table

        return blunders_table(self.adjusted)

    @cached_property
    def group_changes(self) -> Table:
        """Image errors of parameter groups (days, strips, cameras) against each other, with the test of 'no change'."""
        from aerotri.public.findings import changes_table

        return changes_table(self.adjusted)

    def image_errors(
        self,
        group: str | None = None,
        camera: str | None = None,
        without_orientation: bool = False,
        nodes: int | None = None,
    ) -> ImageErrors:
        """The systematic image errors, measured − ideal, on a grid over the format, with σ.

        Parameters
        ----------
        group : parameter group (a camera, a day); the first where None. camera : where a group has several.
        without_orientation : leave out shifts, scale, rotation and tilts, which the orientation of the photographs can
            take as well; so that different sets of parameters, or result and truth, can be compared.
        nodes : along x; 25 on the longer side of the format where None.

        Raises
        ------
        InputError
            For a group that the block does not have.
        """
        from aerotri.public.image_errors import errors_of_result

        return errors_of_result(self.adjusted, group, camera, without_orientation, nodes)

    @cached_property
    def set_aside(self) -> Table:
        """Photographs and points that did not take part, and why: columns kind, name, reason."""
        from aerotri.public.tables import set_aside_table

        return set_aside_table(self.adjusted)

    @property
    def plot(self) -> AdjustmentPlots:
        """Plots of the result, each a matplotlib Figure."""
        from aerotri.public.plots import AdjustmentPlots

        return AdjustmentPlots(self.adjusted)

    def image_errors_at(self, xy: np.ndarray, group: str | None = None, camera: str | None = None) -> np.ndarray:
        """(n, 2) mm, the systematic image errors at image positions.

        Parameters
        ----------
        xy : (n, 2) mm from the image centre, as measured.
        group, camera : as of `image_errors`.

        Raises
        ------
        InputError
            For a group that the block does not have.
        """
        from aerotri.public.image_errors import errors_at

        return errors_at(self.adjusted, xy, group, camera)

    def averaged_residuals(self, group: str | None = None, camera: str | None = None) -> AveragedResiduals:
        """Mean residuals by cell of the format: what the parameters have left; mm.

        Parameters
        ----------
        group, camera : as of `image_errors`.
        """
        from aerotri.public.image_errors import residuals_of_result

        return residuals_of_result(self.adjusted, group, camera)

    def change_between(self, first: str, second: str) -> Change:
        """How the image errors of two parameter groups differ, and whether they changed at all.

        Parameters
        ----------
        first, second : names of groups, such as two days; the `field` of the change is first − second, and
            `statistic`, `freedom` and `p` are those of the test of no change.

        Raises
        ------
        InputError
            For a group that the block does not have.
        """
        from aerotri.image_errors import change

        return change(self.adjusted, first, second)

    def covariance(self, names: Sequence[str]) -> Covariance:
        """The joint covariance of points, photographs and parameters, however far apart.

        Parameters
        ----------
        names : 'T12' (X, Y, Z of a point), 'T12:Z', '1_008' (all six elements of a photograph), '1_008:X0', a parameter
            such as 'bluh.1', or 'bluh.1 (day2)' where groups have their own.

        Returns
        -------
        Covariance
            In the coordinate system of the block; m, rad, parameters in their unit; σ̂0² included. `total` and
            `total_sigma` contain the model part: errors that strips or other groups of photographs share.

        Raises
        ------
        InputError
            For a name that means nothing.
        """
        from aerotri.public.covariance import covariance_of

        return covariance_of(self.record, list(names))

    def save(
        self, out: FilePath, plots: bool = True, progress: ProgressLike = None,
        photographs: FilePath | Sequence[FilePath] = (),
    ) -> Path:  # fmt: skip
        """Write the tables, adjustment.json, the solution, the block as used and the report into a folder.

        Parameters
        ----------
        out : folder; an older result there is replaced in one step, files of others stay.
        plots : draw the plots and the report; without them it is quicker.
        progress : see `aerotri.adjust`.
        photographs : files or folders, as they were measured: the report then shows every mark of a control or check
            point in its photograph.

        Returns
        -------
        Path of the folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        from aerotri.public.saving import save_adjustment

        return save_adjustment(self.record, Path(out), plots, progress, paths_of(photographs))

    def summary(self) -> str:
        """The outcome in lines, as the command prints it."""
        from aerotri.report.tables.adjustment import summary_lines

        return "\n".join(summary_lines(self.adjusted))

    def __repr__(self) -> str:
        name, o = self.block.name, self.adjusted.outcome
        return (
            f"<aerotri.Adjustment of {name!r}: {o.status}, {o.verdict}, σ0 {o.sigma0:.4g}, "
            f"{len(self.images)} photographs, {len(self.points)} points>"
        )

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """The outcome as a notebook shows it: the verdict first."""
        o = self.adjusted.outcome
        reasons = "".join(f"<li>{escape(reason)}</li>" for reason in (*o.reasons, *o.warnings, *o.notes))
        return (
            f"<div><b>{escape(str(self.block.name))}: {escape(o.verdict)}</b> ({escape(o.status)}), "
            f"σ<sub>0</sub> {o.sigma0:.4g} ({o.sigma0_um:.3g} µm), redundancy {o.redundancy}"
            f"{f'<p>{escape(o.purpose)}</p>' if o.purpose else ''}"
            f"{f'<ul>{reasons}</ul>' if reasons else ''}{self.groups.html()}</div>"
        )
