"""Blocks too large for one machine: divided into parts, and adjusted exactly, part by part."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from aerotri.conventions import FilePath, InputError, real_path
from aerotri.execution.choice import THREADS, chosen
from aerotri.public.argument_types import with_checked_types
from aerotri.public.blocks import request_of
from aerotri.public.progress import ProgressLike, stage_report

if TYPE_CHECKING:
    from aerotri.formats.assembly.project import Request
    from aerotri.observations import Block
    from aerotri.partition.whole import Whole
    from aerotri.public.table import Table

Say = Callable[[str, float | None], None]
PHOTOGRAPHS_A_PART = 2000
"""Photographs of a part where nothing is said [C]: a task takes about 1.5 GB then."""


@dataclass(frozen=True, eq=False, repr=False)
class PartsAdjustment:
    """A block in parts after its adjustment: what `aerotri.adjust_parts` returns.

    Parameters
    ----------
    record : the numbers of the whole.
    folder : with the tables; those of photographs, points and rays stand in parts/NAME.

    Examples
    --------
    See `aerotri.adjust_parts`:

    >>> from aerotri import PartsAdjustment
    >>> PartsAdjustment.sigma0.__doc__
    'σ̂0, dimensionless.'
    """

    record: Whole
    folder: Path

    @property
    def status(self) -> str:
        """'converged' or 'not converged'."""
        return self.record.outcome.status

    @property
    def verdict(self) -> str:
        """'accepted', 'doubtful' or 'rejected': that of the worst part."""
        return self.record.outcome.verdict

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the result is not simply accepted, in sentences that name the part."""
        return self.record.outcome.reasons

    @property
    def warnings(self) -> tuple[str, ...]:
        """What else the user should read."""
        return self.record.outcome.warnings

    @property
    def sigma0(self) -> float:
        """σ̂0, dimensionless."""
        return self.record.outcome.sigma0

    @property
    def redundancy(self) -> int:
        """Observations less unknowns."""
        return self.record.outcome.redundancy

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts."""
        return self.record.parts

    @property
    def parameters(self) -> Table:
        """Shared parameters with σ and correlations, the columns of parameters.csv."""
        from aerotri.public.tables import parameters_table

        return parameters_table(self.record.record)

    def __repr__(self) -> str:
        o, r = self.record.outcome, self.record
        return (
            f"<aerotri.PartsAdjustment {r.record.block.name!r}: {o.status}, {o.verdict}, σ0 {o.sigma0:.3f}, "
            f"{len(r.parts)} parts, {r.photographs} photographs>"
        )


@with_checked_types
def divide(
    block: Block | FilePath, folder: FilePath, *, parts: int | None = None,
    tables: Literal["csv", "parquet"] = "parquet", progress: ProgressLike = None,
) -> Path:  # fmt: skip
    """Divide a block into parts for `adjust_parts`.

    Every part is a block folder: its points with all their rays, the photographs that see them, its control points and
    observed positions. Photographs along the cuts stand in several parts; no point does.

    Parameters
    ----------
    block : a block, or the folder of one; of a folder the image points are read piece by piece and never held whole,
        unless it has decisions, constraints or datum points, or states no σ of image coordinates.
    folder : an empty folder; the parts are written to parts/0000, parts/0001 and so on.
    parts : how many; as many as have 2000 photographs each where None, two at least.
    tables : 'csv' or 'parquet'.
    progress : True for a bar, or a function that takes (stage, share).

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        When the block holds what parts cannot, or cannot be cut.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> plan = aerotri.example_flight()
    >>> plan["flight"]["images_per_strip"] = 16
    >>> with tempfile.TemporaryDirectory() as place:
    ...     parts = aerotri.divide(aerotri.simulate(plan, seed=1).block, f"{place}/parts", parts=2) / "parts"
    ...     [folder.name for folder in sorted(parts.iterdir())]
    ['0000', '0001']
    """
    from aerotri.formats.block.writer import write_block
    from aerotri.formats.files.atomic import atomic_folder, room_beside
    from aerotri.observations import Block
    from aerotri.partition.part_list import write_part_list
    from aerotri.partition.whole import PARTS
    from aerotri.public.folders import refuse_foreign_folder

    target = Path(folder)
    _refuse_few(parts)
    refuse_foreign_folder(target)
    with stage_report(progress) as report, room_beside(target) as room, atomic_folder(target) as place:
        if isinstance(block, Block):
            cut = _whole_parts(block, parts, report.stage)
        else:
            cut = _parts_in_pieces(block, parts, room, report.stage)
        for number, part in enumerate(cut):
            write_block(part, place / PARTS / f"{number:04d}", tables=tables)
        write_part_list(place)
    return target


def _parts_in_pieces(path: FilePath, parts: int | None, room: Path, say: Say) -> Iterator[Block]:
    """The parts of the block of a folder."""
    from aerotri.formats.block.in_pieces import open_in_pieces
    from aerotri.partition.dividing_pieces import divided
    from aerotri.partition.part_system import refuse_what_parts_cannot
    from aerotri.public.blocks import read_block

    source = open_in_pieces(path)
    if source is None:
        return _whole_parts(read_block(path), parts, say)
    source = replace(source, block=_in_metres(source.block))
    refuse_what_parts_cannot(source.block)
    return divided(source, _count(source.block, parts), room, say)


def _whole_parts(block: Block, parts: int | None, say: Say) -> Iterator[Block]:
    """The parts of a block that is held whole."""
    from aerotri.partition.dividing import divide as cut
    from aerotri.partition.dividing import part_of
    from aerotri.partition.part_system import refuse_what_parts_cannot

    block = _in_metres(block)
    refuse_what_parts_cannot(block)
    say("dividing", None)
    division = cut(block, _count(block, parts))
    for number in range(division.count):
        say("writing parts", number / division.count)
        yield part_of(block, division, number)


def _in_metres(block: Block) -> Block:
    """A block that counts in degrees in the UTM zone of its datum, as `adjust` brings it there.

    Warns
    -----
    UserWarning
        Naming both systems.
    """
    from aerotri.coordinates.metric import in_metres

    block, said = in_metres(block)
    if said:
        warnings.warn(said, stacklevel=4)
    return block


def _count(block: Block, parts: int | None) -> int:
    return max(2, math.ceil(len(block.images) / PHOTOGRAPHS_A_PART)) if parts is None else parts


def convert_parts(
    source: FilePath, folder: FilePath, *, parts: int | None = None, tables: Literal["csv", "parquet"] = "parquet",
    progress: ProgressLike = None, **stated: Any,
) -> tuple[str, ...]:  # fmt: skip
    """Write a block of another program in parts for `adjust_parts`, without ever holding its image points.

    The files are those of `divide` after `convert`. Image points of COLMAP, PAT-B (.im) and BINGO are read piece by
    piece; other formats are refused by name.

    Parameters
    ----------
    source : COLMAP model, folder of PAT-B files, .im or BINGO file.
    folder : an empty folder; the parts are written to parts/0000, parts/0001 and so on.
    parts : how many; as many as have 2000 photographs each where None, two at least.
    tables : 'csv' or 'parquet'.
    progress : True for a bar, or a function that takes (stage, share).
    **stated : further files, the camera and what else the source does not tell, as of `aerotri.read`.

    Returns
    -------
    tuple of str
        What was matched, assumed or left out, in sentences.

    Raises
    ------
    InputError
        As `aerotri.read` and `divide`; for a format that is not read in pieces.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> plan = aerotri.example_flight()
    >>> plan["flight"]["images_per_strip"] = 16
    >>> flown = aerotri.simulate(plan, seed=1)
    >>> with tempfile.TemporaryDirectory() as place:
    ...     said = aerotri.convert(flown.block, f"{place}/patb", "patb")
    ...     said = aerotri.convert_parts(
    ...         f"{place}/patb", f"{place}/parts", parts=2, control_sigma_m=(0.02, 0.02, 0.04),
    ...         camera_size=(11500, 7500), pixel_um=9.0,
    ...     )
    ...     found = aerotri.adjust_parts(f"{place}/parts", f"{place}/result")
    >>> found.status
    'converged'
    """
    return convert_request_parts(
        request_of(source, **stated), Path(folder), parts=parts, tables=tables, progress=progress
    )  # fmt: skip


def convert_request_parts(
    request: Request, target: Path, *, parts: int | None = None, tables: Literal["csv", "parquet"] = "parquet",
    progress: ProgressLike = None,
) -> tuple[str, ...]:  # fmt: skip
    """As `convert_parts`, with everything that is stated in one record.

    Raises
    ------
    InputError
    """
    from aerotri.formats.assembly.project_in_pieces import read_in_pieces
    from aerotri.formats.block.writer import write_block
    from aerotri.formats.files.atomic import atomic_folder, room_beside
    from aerotri.partition.dividing_pieces import divided
    from aerotri.partition.part_list import write_part_list
    from aerotri.partition.part_system import refuse_what_parts_cannot
    from aerotri.partition.whole import PARTS
    from aerotri.public.folders import refuse_foreign_folder

    _refuse_few(parts)
    refuse_foreign_folder(target)
    request = replace(request, name=request.name or real_path(target).name)
    with stage_report(progress) as report, room_beside(target) as room, atomic_folder(target) as place:
        report.stage("reading photographs", None)
        source = read_in_pieces(request, room / "head")
        source = replace(source, block=_in_metres(source.block))
        refuse_what_parts_cannot(source.block)
        cut = divided(source, _count(source.block, parts), room, report.stage)
        for number, part in enumerate(cut):
            write_block(part, place / PARTS / f"{number:04d}", tables=tables)
        write_part_list(place)
    return source.messages


def _refuse_few(parts: int | None) -> None:
    if parts is not None and parts < 2:
        raise InputError(f"{parts} parts", "a block is divided into two parts or more")


def simulate_parts(
    plan: FilePath | Mapping[str, Any], folder: FilePath, *, parts: int, seed: int = 1, progress: ProgressLike = None
) -> dict[str, Any]:
    """Simulate a block in parts for `adjust_parts`, without ever holding it whole.

    Photographs, start values, observed positions, ground and control are those that `simulate` gives for the same seed.
    Tie points are drawn for every part by itself: a point belongs to the part on whose ground it lies.

    Parameters
    ----------
    plan : file simulation.toml, or its tables as nested dictionaries.
    folder : an empty folder; the parts are written to parts/0000, parts/0001 and so on, each with its truth/.
    parts : how many, two at least.
    seed : the same seed and number of parts give the same parts.
    progress : True for a bar, or a function that takes (stage, share).

    Returns
    -------
    dict
        How much was measured, as `SimulatedBlock.summary` says it.

    Raises
    ------
    InputError
        For a plan that makes no sense, or holds what parts cannot: rigs, rolling shutters, towers, a georeference.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> plan = aerotri.example_flight()
    >>> plan["flight"]["images_per_strip"] = 16
    >>> with tempfile.TemporaryDirectory() as place:
    ...     counts = aerotri.simulate_parts(plan, f"{place}/parts", parts=2)
    ...     found = aerotri.adjust_parts(f"{place}/parts", f"{place}/result")
    >>> counts["images"], found.status
    (32, 'converged')
    """
    from aerotri import simulation
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.partition.part_list import write_part_list
    from aerotri.partition.part_system import refuse_what_parts_cannot
    from aerotri.partition.whole import PARTS
    from aerotri.public.folders import refuse_foreign_folder

    spec = simulation.parse_spec(plan) if isinstance(plan, Mapping) else simulation.read_spec(plan)
    target, images, counts = Path(folder), set[str](), np.zeros(4, dtype=np.int64)
    refuse_foreign_folder(target)
    with stage_report(progress) as report, atomic_folder(target) as place:
        report.stage("flight", None)
        for number, (block, truth) in enumerate(simulation.simulate_parts(spec, seed, parts)):
            refuse_what_parts_cannot(block)
            report.counted("simulating parts", number, parts)
            simulation.write_simulated(place / PARTS / f"{number:04d}", block, truth, tables="parquet")
            images.update(block.images.names.tolist())
            is_check = block.control.is_check
            counts += (len(block.image_points), len(block.points), int((~is_check).sum()), int(is_check.sum()))
        write_part_list(place)
    measured = dict(zip(("image_points", "points", "control", "check"), counts.tolist(), strict=True))
    return {"block": spec.name, "images": len(images), **measured, "parts": parts}


def adjust_parts(
    folder: FilePath, out: FilePath, *, robust: Literal["off", "huber"] | None = None,
    max_iterations: int | None = None, geoid: FilePath | None = None, plots: bool = True, executor: str = THREADS,
    progress: ProgressLike = None,
) -> PartsAdjustment:  # fmt: skip
    """Adjust a block in parts: the numbers of `adjust` of the whole, without ever holding it whole.

    Every part is a task that eliminates its points and its own photographs; what is left are the equations of the
    photographs and parameters that parts share. σ, redundancy numbers and tests are those of the whole block.

    Parameters
    ----------
    folder : of `divide`, or made by hand: parts/NAME with a block each.
    out : folder to write; the tables of a part go to parts/NAME in it.
    robust : 'huber' lowers the weight of gross errors; as the parts say where None.
    max_iterations : at most, in each stage of a robust estimator.
    geoid : grid of geoid undulations for heights of the coordinate system; every worker sees it under this name.
    plots : draw the plots and the report, report.html; without them it is quicker.
    executor : where the parts are computed: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    progress : True for a bar, or a function that takes (stage, share).

    Returns
    -------
    PartsAdjustment
        Look at its `verdict` first.

    Raises
    ------
    InputError
        When parts do not belong together, hold what is adjusted in one piece only, or do not determine the block.
    TasksFailedError
        When a part could not be computed; it is named.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> plan = aerotri.example_flight()
    >>> plan["flight"]["images_per_strip"] = 16
    >>> with tempfile.TemporaryDirectory() as place:
    ...     parts = aerotri.divide(aerotri.simulate(plan, seed=1).block, f"{place}/parts", parts=2)
    ...     found = aerotri.adjust_parts(parts, f"{place}/result")
    >>> found.status, found.parts
    ('converged', ('0000', '0001'))
    """
    from aerotri.execution.opening import opened
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.partition.adjusting import PartsSettings
    from aerotri.partition.adjusting import adjust_parts as adjust
    from aerotri.partition.whole import PARTS, write_whole
    from aerotri.public.folders import refuse_foreign_folder

    target, grid = Path(out), None if geoid is None else real_path(Path(geoid))
    refuse_foreign_folder(target, "adjustment.json")
    chosen(executor)
    tables = ("parameters.csv", "control.csv", "check.csv", "work_list.csv")
    own = ("adjustment.json", *tables, "report.html", "plots", PARTS)
    with (
        stage_report(progress) as report,
        opened(executor, report.said) as workers,
        atomic_folder(target, own) as place,
    ):
        whole = adjust(Path(folder), place, workers, PartsSettings(robust, max_iterations, grid), report.stage)
        if plots:
            report.stage("drawing", None)
            whole = _drawn(whole, place)
        write_whole(whole, place)
    return PartsAdjustment(whole, target)


def _drawn(whole: Whole, folder: Path) -> Whole:
    """The report and its plots, the time of them counted."""
    from aerotri.report.pages.parts import parts_plots, write_parts_report
    from aerotri.report.plots.overview import save_plots

    begun = time.perf_counter()
    write_parts_report(whole, save_plots(parts_plots(whole), folder / "plots"), folder / "report.html")
    outcome = whole.record.outcome
    timings = {**outcome.timings_s, "plots": time.perf_counter() - begun}
    return replace(whole, record=replace(whole.record, outcome=replace(outcome, timings_s=timings)))
