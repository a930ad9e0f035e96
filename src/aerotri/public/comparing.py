"""Sets of additional parameters side by side, and a block through other programs' solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from aerotri.conventions import FilePath, InputError
from aerotri.execution.choice import THREADS
from aerotri.observations import Block
from aerotri.public.adjustment import Adjustment
from aerotri.public.block_settings import with_settings
from aerotri.public.blocks import read
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.table import Table
from aerotri.public.workplaces import workplace
from aerotri.results.head import Head

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.crosscheck import CrosscheckResult
    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.results.parameter_comparison import ParameterComparison

COMPARISON_NAMES = ("compare_parameters.json", "compare_parameters.csv", "compare_parameters.png",
                    "compare_parameters.svg")  # fmt: skip
CROSSCHECK_NAMES = ("crosscheck.json", "crosscheck.csv", "plots", "report.html")


@dataclass(frozen=True, eq=False)
class ComparedParameters:
    """Sets of additional parameters side by side.

    Parameters
    ----------
    record : what was found of every set. choice : the set that `auto` would take, '' where none converged.
    reason : why, in a sentence. head : of files.
    """

    record: ParameterComparison
    choice: str
    reason: str
    head: Head = field(default_factory=Head)

    @property
    def table(self) -> Table:
        """A row a set: the columns of compare_parameters.csv."""
        from aerotri.formats.results.parameter_sets import comparison_columns

        columns = {name: pa.array(np.asarray(values).tolist()) for name, values in
                   comparison_columns(self.record).items()}  # fmt: skip
        return Table("sets of additional parameters", pa.table(columns))

    def plot(self) -> Figure:
        """Check points and predicted control of every set."""
        from aerotri.report.plots.comparison import plot_comparison

        return plot_comparison(self.record)

    def save(self, out: FilePath) -> Path:
        """Write the comparison as JSON, CSV and a picture into a folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.public.saving import write_comparison_tables
        from aerotri.report.plots.overview import save_plots

        target = Path(out)
        refuse_foreign_folder(target, COMPARISON_NAMES[0])
        with atomic_folder(target, own=COMPARISON_NAMES) as folder:
            save_plots({"compare_parameters": self.plot()}, folder)
            write_comparison_tables(self.record, folder, self.head)
        return target

    def _repr_html_(self) -> str:
        return f"<div>{self.table.html()}<p>{self.reason}</p></div>"


def compare_parameters(
    block: Block | FilePath,
    sets: Sequence[str] = (),
    *,
    folds: int = 10,
    robust: str | None = None,
    geoid: FilePath | None = None,
    executor: str = THREADS,
    scratch: FilePath | None = None,
    progress: ProgressLike = None,
) -> ComparedParameters:
    """Adjust a block with several sets of additional parameters, and predict its control by cross-validation.

    The first set that can be adjusted begins at the start values of the block, all others where that one ended.

    Parameters
    ----------
    block : a block, or the folder of one.
    sets : specifications as `aerotri.adjust` takes them; one of each family where empty.
    folds : parts in which control points are left out and predicted.
    robust : estimator, as of `aerotri.adjust`; data snooping is replaced by Huber's.
    geoid, progress : as of `aerotri.adjust`.
    executor : where the sets after the first are adjusted, a task each: 'threads', 'processes:N', 'dask:ADDRESS' or
        'dask:local:N'.
    scratch : folder for what other processes read, one that all of them have; a temporary one where None.

    Returns
    -------
    ComparedParameters

    Raises
    ------
    InputError
        For a set that does not exist, or that the block's camera does not have; when the executor is none or cannot be
        reached.
    AdjustmentFailedError
        When the block cannot be adjusted with any set.
    TasksFailedError
        When sets could not be computed elsewhere; the message names them. One that does not converge is none of these.

    Examples
    --------
    >>> import aerotri
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> found = aerotri.compare_parameters(block, ["none", "brown:K1+K2"], folds=3)
    >>> len(found.table)
    2
    """
    from aerotri import pipeline
    from aerotri.functional_model.additional_parameters import AUTO, format_parameters, parse_parameters
    from aerotri.strategies.parameter_choice import candidate_sets, choose

    choices = [parse_parameters(spec) for spec in sets]
    if AUTO in choices:
        raise InputError(
            "'auto' cannot be one of the sets", "leave the sets out: then all that 'auto' chooses from are compared"
        )
    chosen = with_settings(block, robust=robust)
    with stage_report(progress) as report, workplace(executor, scratch, report.said) as at:
        found = pipeline.compare_parameters(chosen, choices or candidate_sets(chosen), folds, geoid, report.set_of, at)
    head = Head(chosen.project, chosen.crs)
    if not any(outcome.converged for outcome in found.outcomes):
        return ComparedParameters(found, "", "", head)
    best = choose(found)
    return ComparedParameters(found, ",".join(format_parameters(best.choice)) or "none", best.reason, head)


@dataclass(frozen=True, eq=False)
class Crosscheck:
    """A block through other programs' solvers.

    Parameters
    ----------
    record : what was found of every peer. adjusted : the block as it was adjusted, in the frame of its adjustment.
    """

    record: CrosscheckResult
    adjusted: AdjustedBlock

    @property
    def verdict(self) -> str:
        """'agrees', or in a word what does not."""
        return self.record.verdict

    @property
    def sentence(self) -> str:
        """The outcome in a sentence."""
        return self.record.sentence

    @property
    def table(self) -> Table:
        """Differences against σ, a row a kind of unknown and peer: the columns of crosscheck.csv."""
        rows = [(check.peer, d) for check in self.record.checks for d in check.differences]
        columns = {"peer": [peer for peer, _ in rows]}
        columns |= {name: [getattr(d, name) for _, d in rows] for name in ("kind", "count", "max", "rms", "worst")}
        return Table("differences over σ", pa.table(columns))

    @cached_property
    def content(self) -> dict[str, Any]:
        """The content of crosscheck.json."""
        from aerotri.crosscheck.outcome_json import crosscheck_json

        block = self.adjusted.block
        return Head(block.project, block.crs).as_dict() | crosscheck_json(self.record)

    def plot(self) -> Figure:
        """Differences of every peer over σ."""
        from aerotri.report.plots.crosscheck import plot_crosscheck

        return plot_crosscheck(self.record)

    def save(self, out: FilePath) -> Path:
        """Write crosscheck.json, crosscheck.csv, the plots and the report into a folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.formats.results.json_text import write_json
        from aerotri.public.tables import write_rows
        from aerotri.report.pages.adjustment import Findings, write_report
        from aerotri.report.plots.overview import all_plots, save_plots

        target = Path(out)
        refuse_foreign_folder(target, CROSSCHECK_NAMES[0])
        with atomic_folder(target, own=CROSSCHECK_NAMES) as folder:
            drawn = save_plots({"crosscheck": self.plot()}, folder / "plots")
            plots = {**all_plots(self.adjusted), **drawn}
            write_report(self.adjusted, plots, folder / "report.html", Findings(crosscheck=self.record))
            write_rows(self.table, folder / "crosscheck.csv")
            write_json(folder / "crosscheck.json", self.content)
        return target

    def _repr_html_(self) -> str:
        return f"<div><p>{self.sentence}</p>{self.table.html()}</div>"


def crosscheck(source: Adjustment | Block | FilePath, progress: ProgressLike = None) -> Crosscheck:
    """Adjust the same block by pycolmap, and by Ceres with a model written from the papers alone.

    Parameters
    ----------
    source : a result; or a block, a result's folder or files of any format that `aerotri.read` reads, adjusted first.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    Crosscheck

    Raises
    ------
    InputError
        When the source cannot be read, or has not converged.
    AdjustmentFailedError
        When the block cannot be adjusted.
    """
    from aerotri import pipeline
    from aerotri.crosscheck import crosscheck as check
    from aerotri.crosscheck.freed import as_adjusted

    with stage_report(progress) as report:
        found = _adjusted(source, report.iteration)
        if found.status != "converged":
            message = found.adjusted.outcome.message
            raise InputError(
                f"{found.status}: {message}; there is no solution to check",
                "find the cause first: `aerotri adjust` of this block names it",
            )
        local = as_adjusted(found.record.local, found.record.system.unknowns.block)
        return Crosscheck(check(local, pipeline.adjust, lambda text: report.stage(text, None)), local)


def _adjusted(source: Adjustment | Block | FilePath, iteration: Callable[[int, float, float], None]) -> Adjustment:
    from aerotri.pipeline import adjust_keeping_system
    from aerotri.public.results import open_result

    if isinstance(source, Adjustment):
        return source
    if isinstance(source, Block):
        return Adjustment(adjust_keeping_system(source, iteration))
    if (Path(source) / "solution.npz").is_file():
        return open_result(source)
    found = read(source)
    return Adjustment(adjust_keeping_system(found.block, iteration, found.points))
