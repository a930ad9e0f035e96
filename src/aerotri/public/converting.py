"""Blocks and results in the formats of other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, real_path
from aerotri.observations import Block
from aerotri.public.adjustment import Adjustment
from aerotri.public.blocks import ReadBlock, read, text_of_path
from aerotri.public.folders import refuse_existing_file, refuse_foreign_entries
from aerotri.public.progress import ProgressLike, StageReport, stage_report

if TYPE_CHECKING:
    from aerotri.formats.assembly.imported import ImportRecord
    from aerotri.formats.assembly.oriented import OrientedBlock

Tables = Literal["csv", "parquet"]
Target = Literal[
    "block", "bal", "colmap", "colmap-text", "bundler", "opensfm", "metashape", "metashape-camera", "metashape-xml",
    "blocks-exchange", "opk", "pix4d-eo", "ign", "patb", "bingo", "pix4d-gcp", "pix4d-geo", "pix4d-offset", "odm-gcp",
    "odm-geo", "ign-mes", "ign-app",
]  # fmt: skip


def convert(
    source: Block | Adjustment | ReadBlock | FilePath,
    out: FilePath,
    to: Target = "block",
    *,
    points: np.ndarray | None = None,
    tables: Tables = "csv",
    geoid: FilePath | None = None,
    in_place: bool = False,
    overwrite: bool = False,
    progress: ProgressLike = None,
) -> tuple[str, ...]:
    """Write a block or a result, in our format or in that of another program.

    Parameters
    ----------
    source : a result, or the folder of one, written as adjusted; a block, or files that `aerotri.read` reads, written
        at its start values, and adjusted for the purpose where the target needs object points that it does not have.
    out : file or folder to write.
    to : format to write.
    points : (N, 3) m, object points of a block, for formats that hold them.
    tables : of our own format; 'parquet' is read faster where there are millions of image points.
    geoid : grid of geoid undulations for heights of the coordinate system.
    in_place : `out` is the project that the block was read from (COLMAP, OpenSfM): cameras, orientations and object
        points become those of `source`, everything else stays, older files go into its folder before_aerotri.
    overwrite : replace files that aerotri has not written, or that were changed since.
    progress : see `aerotri.adjust`.

    Returns
    -------
    tuple of str
        What the target cannot hold, in sentences; of files that are read here, what was matched or assumed as well.

    Raises
    ------
    InputError
        For a format that is not known, a block that it cannot hold at all, or files of others at its place.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> with tempfile.TemporaryDirectory() as place:
    ...     said = aerotri.convert(block, f"{place}/copy")
    ...     len(aerotri.read_block(f"{place}/copy").images)
    12
    """
    target, said = Path(out), ()
    if in_place:
        refuse_no_project(_place(source), target, to)
    else:
        refuse_target(_place(source), target, to, overwrite)
    if not isinstance(source, (Block, Adjustment, ReadBlock)):
        source = read(source, name=name_of_target(target, to))
        said = source.messages
    if isinstance(source, Block):
        source = ReadBlock(source, points, ())
    if to == "block":
        own = ReadBlock(source.block, None, (), is_result=True) if isinstance(source, Adjustment) else source
        return (*said, *_write_own(own, target, tables))
    with stage_report(progress) as report:
        if in_place:
            return (*said, *_update(source, target, to, geoid))
        if isinstance(source, Adjustment) or source.is_result:
            return (*said, *_write_result(source, target, to, geoid))
        return (*said, *_write_block(source, target, to, geoid, report))


def _write_own(source: ReadBlock, target: Path, tables: Tables) -> tuple[str, ...]:
    """The block in our own format, with its tables as asked for, and import.json beside it where it was read."""
    from aerotri.formats.block.writer import IMPORT, OWN_ENTRIES, write_block
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.json_text import write_json

    if tables not in get_args(Tables):
        raise InputError(f"there are no tables as '{tables}'", f"choose {' or '.join(get_args(Tables))}")
    said = losses_of_import(source)
    if not source.sources:
        write_block(source.block, target, tables)
        return said
    with atomic_folder(target, own=OWN_ENTRIES) as place:
        write_block(source.block, place, tables)
        write_json(place / IMPORT, imported_as_written(source).as_dict())
    return said


def losses_of_import(source: ReadBlock) -> tuple[str, ...]:
    """What a block folder cannot hold of what was read, and what is to be known of it."""
    from aerotri.formats.convert import about_points

    return (*(() if source.is_result else _about_held(source.block)), *about_points(source.points))


def imported_as_written(source: ReadBlock) -> ImportRecord:
    """What was imported into a block folder."""
    return replace(source, messages=(*source.messages, *losses_of_import(source))).imported


def name_of_target(target: Path, to: Target) -> str:
    """A block is called as the folder it is written to."""
    return real_path(target).name if to == "block" else ""


def refuse_target(source: str, target: Path, to: str, overwrite: bool) -> None:
    """Refuse, before anything is read, what cannot be written.

    Raises
    ------
    InputError
    """
    from aerotri.formats.convert import FOLDER_TARGETS, TARGETS

    if to not in TARGETS:
        raise InputError(f"'{to}' is not a format that is written", f"known are {', '.join(TARGETS)}")
    if source and real_path(target) == real_path(Path(source)):
        raise InputError("source and target are the same", "choose another target", target)
    if to in FOLDER_TARGETS:
        refuse_foreign_entries(target, FOLDER_TARGETS[to], overwrite)
    else:
        refuse_existing_file(target, overwrite)


def refuse_no_project(source: str, target: Path, to: str) -> None:
    """Refuse, before anything is read, what cannot be brought to an orientation in place.

    Raises
    ------
    InputError
    """
    from aerotri.formats.convert import RECOGNISERS, UPDATERS

    if to not in UPDATERS:
        raise InputError(f"--in-place is not possible for '{to}'", f"it is for {', '.join(UPDATERS)}")
    if not RECOGNISERS[to](target):
        raise InputError(f"is no {to} project to bring up to date", "give its folder, or leave --in-place out", target)
    if source and real_path(target) == real_path(Path(source)):
        raise InputError("source and target are the same", "give the result of the adjustment as source", target)


def _update(source: Adjustment | ReadBlock, target: Path, to: Target, geoid: FilePath | None) -> tuple[str, ...]:
    """The project of another program at an orientation of ours."""
    from aerotri.formats.assembly.oriented import oriented_block, oriented_from_adjusted
    from aerotri.formats.convert import update_project
    from aerotri.opening import open_result

    if isinstance(source, Adjustment):
        oriented = oriented_from_adjusted(source.adjusted)
    elif source.is_result:
        oriented = oriented_from_adjusted(open_result(source.source).result)
    elif source.points is None:
        raise InputError("has no object points", "give the result of its adjustment", source.source or None)
    else:
        oriented = oriented_block(source.block, source.points)
    return update_project(oriented, target, to, geoid)


def _place(source: Block | Adjustment | ReadBlock | FilePath) -> str:
    """Where the source comes from; '' where it is in memory."""
    if isinstance(source, (Block, Adjustment)):
        return ""
    return source.source if isinstance(source, ReadBlock) else text_of_path(source)


def _write_result(source: Adjustment | ReadBlock, target: Path, to: Target, geoid: FilePath | None) -> tuple[str, ...]:
    """Orientation and points as adjusted; what was measured, as it was measured."""
    from aerotri.formats.assembly.oriented import oriented_from_adjusted
    from aerotri.formats.convert import BLOCK_WRITERS, write_any, write_oriented
    from aerotri.opening import open_result

    if to in BLOCK_WRITERS:
        return tuple(write_any(source.block, target, to))
    adjusted = source.adjusted if isinstance(source, Adjustment) else open_result(source.source).result
    return tuple(write_oriented(oriented_from_adjusted(adjusted), target, to, geoid))


def _write_block(
    reading: ReadBlock, target: Path, to: Target, geoid: FilePath | None, report: StageReport
) -> tuple[str, ...]:
    from aerotri.formats.assembly.oriented import oriented_block
    from aerotri.formats.convert import BLOCK_WRITERS, ORIENTATION_WRITERS, write_any, write_oriented

    block, points, said = reading.block, reading.points, _about_held(reading.block)
    if to in BLOCK_WRITERS:
        return (*said, *write_any(block, target, to, points))
    if to in ORIENTATION_WRITERS:
        oriented, at_start = _at_start_values(block, points, to)
        said = (*said, *at_start)
    else:
        oriented = None if points is None else oriented_block(block, points)
    if oriented is None:
        oriented = _adjusted(reading, geoid, report)
    return (*said, *write_oriented(oriented, target, to, geoid))


def _about_held(block: Block) -> tuple[str, ...]:
    """A sentence about control without error."""
    count = int((block.control.sigma[~block.control.is_check] == 0.0).sum())
    return (
        (f"{counted(count, 'coordinate')} of control points with σ = 0: an adjustment holds them fixed",)
        if count
        else ()
    )


def _at_start_values(
    block: Block, points: np.ndarray | None, to: Target
) -> tuple[OrientedBlock | None, tuple[str, ...]]:
    """The block at the orientations it came with; None where it has none and the format needs them."""
    from aerotri.formats.assembly.oriented import OrientedBlock, given_errors
    from aerotri.functional_model.rotation import rotation_from_angles

    rotation = rotation_from_angles(block.images.angles, block.rotation)
    known = np.full((len(block.points), 3), np.nan) if points is None else points
    used = np.ones(len(block.image_points), bool)
    oriented = OrientedBlock(block, block.images.centre, rotation, known, used, *given_errors(block))
    if oriented.oriented.any():
        return oriented, ("the orientations are those of the files, not adjusted",)
    return (oriented, ()) if to == "patb" else (None, ())


def _adjusted(reading: ReadBlock, geoid: FilePath | None, report: StageReport) -> OrientedBlock:
    """The block adjusted for the purpose.

    Raises
    ------
    InputError
        When that fails.
    """
    from aerotri.compiled import compilation_notice
    from aerotri.formats.assembly.oriented import oriented_from_adjusted
    from aerotri.pipeline import AdjustmentFailedError, adjust_keeping_system

    source = reading.source or None
    if not len(reading.block.image_points):
        raise InputError("holds no image points", "the target needs object points", source)
    report.stage(compilation_notice() or "adjusting", None)
    try:
        done = adjust_keeping_system(reading.block, report.iteration, geoid=geoid)
    except AdjustmentFailedError as failure:
        raise InputError(
            f"the block has to be adjusted first, and that failed: {failure}",
            "find the cause first: `aerotri adjust` of this block names it",
            source,
        ) from None
    return oriented_from_adjusted(done.result)
