"""Two halves of a block adjusted apart and compared: the test of model errors that needs no control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath, InputError
from aerotri.execution.choice import THREADS
from aerotri.public.adjustment import Adjustment
from aerotri.public.argument_types import with_checked_types
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.public.workplaces import workplace
from aerotri.results.head import Head

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.results.halves import HalvesRecord

HALVES_NAMES = ("halves.json", "image_cells.csv", "ground_cells.csv", "ground_points.csv", "plots")


@dataclass(frozen=True, eq=False, repr=False)
class Halves:
    """Halves of a block compared, a division each.

    Parameters
    ----------
    record : what was found. adjusted : the block of which the halves are.
    settings : every argument that was used, as halves.json has them.
    """

    record: HalvesRecord
    adjusted: AdjustedBlock
    settings: list[dict[str, Any]] = field(default_factory=list)

    @property
    def found(self) -> tuple[str, ...]:
        """The divisions whose halves differ by more than noise: there the σ of the result are too small."""
        return self.record.found

    @property
    def conclusion(self) -> tuple[str, ...]:
        """What all divisions say together and what to do, in sentences."""
        from aerotri.diagnosis.halves import conclusion

        return conclusion(self.record)

    @property
    def tests(self) -> Table:
        """A row a test of every division: the differences over their σ, and the probability of them by noise alone."""
        rows = [(one, name, test) for one in self.record.comparisons for name, test in one.tests]
        columns = {"division": [one.division for one, _, _ in rows], "of": [name for _, name, _ in rows]}
        names = ("statistic", "freedom", "p_statistic", "rms_z", "p_rms", "p", "max_z", "usual_max_z", "differs")
        return Table.of("tests", columns | {name: [getattr(test, name) for _, _, test in rows] for name in names})

    @property
    def image_cells(self) -> Table:
        """Differences of the image errors by cell of the format: the columns of image_cells.csv."""
        from aerotri.formats.results.halves import image_columns

        columns = {name: values.tolist() for name, values in image_columns(self.record.comparisons).items()}
        units: dict[str, str] = {**dict.fromkeys(("x", "y"), "mm"), **dict.fromkeys(("dx", "dy", "s_dx", "s_dy"), "µm")}
        return Table.of("image errors of the halves", columns, units)

    @property
    def ground_cells(self) -> Table:
        """Mean differences of the ground points by cell in plan: the columns of ground_cells.csv."""
        from aerotri.formats.results.halves import ground_columns

        columns = {name: values.tolist() for name, values in ground_columns(self.record.comparisons).items()}
        metres = [name for name in columns if name not in ("division", "points", "z_X", "z_Y", "z_Z")]
        return Table.of("ground points of the halves", columns, dict.fromkeys(metres, "m"))

    def plots(self) -> dict[str, Figure]:
        """Pictures by name: image errors and heights of every division."""
        from aerotri.report.plots.halves import plot_field_difference, plot_height_differences

        out, block = {}, str(self.adjusted.block.name)
        for one in self.record.comparisons:
            for errors in one.fields:
                number = "" if len(one.fields) == 1 else f"_{len(out) + 1}"
                out[f"image_errors_{one.division}{number}"] = plot_field_difference(one, errors, block)
            if one.points is not None:
                out[f"heights_{one.division}"] = plot_height_differences(one, block, self.adjusted.block.crs)
        return out

    @cached_property
    def content(self) -> dict[str, Any]:
        """The content of halves.json."""
        from aerotri.formats.results.halves import halves_json

        block = self.adjusted.block
        return Head(block.project, block.crs).as_dict() | halves_json(self.record) | {"settings": self.settings}

    def save(self, out: FilePath) -> Path:
        """Write halves.json, the tables and the plots into a folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.formats.results.adjustment import write_csv
        from aerotri.formats.results.halves import ground_columns, image_columns, point_columns
        from aerotri.formats.results.json_text import write_json
        from aerotri.report.plots.overview import save_plots

        target, record = Path(out), self.record
        refuse_foreign_folder(target, HALVES_NAMES[0])
        with atomic_folder(target, own=HALVES_NAMES) as folder:
            save_plots(self.plots(), folder / "plots")
            write_json(folder / "halves.json", self.content)
            write_csv(folder / "image_cells.csv", image_columns(record.comparisons))
            write_csv(folder / "ground_cells.csv", ground_columns(record.comparisons))
            write_csv(folder / "ground_points.csv", point_columns(record.comparisons, self.adjusted.block.points))
        return target

    def summary(self) -> str:
        """The outcome in lines, as the command prints it."""
        from aerotri.report.tables.halves import halves_lines

        return "\n".join(halves_lines(self.record))

    def __repr__(self) -> str:
        return f"<aerotri halves of {self.record.block!r}: differ by {', '.join(self.found) or 'none'}>"

    def _repr_html_(self) -> str:
        return f"<div>{self.tests.html()}{''.join(f'<p>{escape(one)}</p>' for one in self.conclusion)}</div>"


@with_checked_types
def halves(
    result: Adjustment | FilePath,
    divisions: Sequence[str] | None = None,
    *,
    alpha: float | None = None,
    executor: str = THREADS,
    scratch: FilePath | None = None,
    progress: ProgressLike = None,
) -> Halves:
    """Divide the photographs of a block into two halves, adjust them apart and compare them.

    Both halves have the settings of the result. Their image points are independent; what they have in common (control
    points, known interior orientation) counts in the σ of the differences. Where the model of the camera is right, the
    halves differ by no more than these σ. Where they differ by more, the σ of the result are too small. No control is
    needed for that.

    Parameters
    ----------
    result : of an adjustment, or the folder of one.
    divisions : 'photographs' (alternate photographs of each strip), 'strips' (alternate strips), 'directions' (of
        flight), 'time' (first and second half of the flight); all where None.
    alpha : probability below which differences are no noise; that of the block where None.
    executor : where the halves are adjusted, a task a division: 'threads', 'processes:N', 'dask:ADDRESS' or
        'dask:local:N'.
    scratch : folder for what other processes read, one that all of them have; a temporary one where None.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    Halves

    Raises
    ------
    InputError
        When the folder holds no result, a division does not exist, or the executor is none or cannot be reached.
    TasksFailedError
        When divisions could not be computed elsewhere; the message names them.

    Examples
    --------
    >>> import aerotri
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block, parameters="brown:K1")
    >>> found = aerotri.halves(result, ["photographs"])
    >>> found.found
    ()
    """
    from aerotri.pipeline.halves import compare_halves
    from aerotri.public.results import open_result
    from aerotri.results.halves import DIVISIONS

    chosen = tuple(DIVISIONS) if divisions is None else tuple(dict.fromkeys(divisions))
    unknown = [name for name in chosen if name not in DIVISIONS]
    if unknown or not chosen:
        raise InputError(f"'{unknown[0] if unknown else ''}' is no division", f"use {', '.join(DIVISIONS)}")
    with stage_report(progress) as report, workplace(executor, scratch, report.said) as at:
        if not isinstance(result, Adjustment):
            report.stage("reading", None)
            result = open_result(result)
        if result.status != "converged":
            raise InputError(f"the adjustment ended '{result.status}'", "give the result of a converged one")
        used = used_arguments(halves, {"divisions": divisions, "alpha": alpha}, {})
        return Halves(compare_halves(result.record, chosen, alpha, report.stage, at), result.adjusted, used)
