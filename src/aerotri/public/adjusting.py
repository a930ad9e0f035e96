"""A block's folder adjusted into the folder of a result."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath
from aerotri.formats.assembly.assemble_control import block_with_check_points
from aerotri.formats.block.unread import unread_in_words
from aerotri.public.adjustment import Adjustment
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.progress import StageReport
from aerotri.public.results import adjust
from aerotri.public.saving import RECORD, write_adjustment

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.public.progress import Progress


def read_in_metres(folder: Path, control_prefix: str = "", geoid: FilePath | None = None) -> tuple[Block, str]:
    """A block from its folder, in a coordinate system that counts in metres; and what was done for that.

    Parameters
    ----------
    folder : of the block, or its block.toml.
    control_prefix : what image points have before the names of control points.
    geoid : grid of geoid undulations for a coordinate system that has none of its own.

    Raises
    ------
    InputError
    """
    from aerotri.coordinates.metric import in_metres
    from aerotri.formats.block.folder import read_block
    from aerotri.observations.names import with_control_prefix

    return in_metres(with_control_prefix(read_block(folder), control_prefix), geoid)


def with_read_time(found: Adjustment, seconds: float) -> Adjustment:
    """The result with the time that reading took among its timings."""
    result = found.adjusted
    outcome = replace(result.outcome, timings_s={"read": seconds, **result.outcome.timings_s})
    return replace(found, record=replace(found.record, result=replace(result, outcome=outcome)))


def adjust_folder(
    folder: Path,
    out: Path,
    *,
    progress: Progress,
    plots: bool = True,
    control_prefix: str = "",
    check: Sequence[str] = (),
    geoid: FilePath | None = None,
    photographs: Sequence[Path] = (),
    **settings: Any,
) -> Adjustment:
    """Read, adjust, and write the result.

    Parameters
    ----------
    folder : of the block. out : of the result.
    progress : takes (stage, share).
    plots : draw the plots and the report.
    control_prefix, geoid : see `read_in_metres`. check : names of control points that become check points.
    photographs : files or folders, of which the report shows the marks of control and check points.
    settings : as of `aerotri.adjust`.

    Returns
    -------
    Adjustment
        As it was adjusted, whatever its verdict.

    Raises
    ------
    InputError
        When the block makes no sense, or the folder holds other files.
    AdjustmentFailedError
        When the observations do not determine the unknowns.
    """
    begun = time.perf_counter()
    block, note = read_in_metres(folder, control_prefix, geoid)
    block = block_with_check_points(block, check, control_prefix)
    seconds = time.perf_counter() - begun
    refuse_foreign_folder(out, RECORD)
    found = with_read_time(adjust(block, geoid=geoid, progress=progress, **settings), seconds)
    write_adjustment(found.record, out, plots, StageReport(progress), photographs=photographs)
    return replace(found, notes=(*((note,) if note else ()), *unread_in_words(folder)))
