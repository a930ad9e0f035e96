"""The process that adjusts a block for the bench: progress as lines of JSON, the result in a folder."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from aerotri.bench.records import RECORD, read_records
from aerotri.conventions import InputError
from aerotri.observations import Block


def work(block: Path, out: Path, before: Path | None, geoid: str) -> int:
    """Exit code: 0 with a result, whatever its verdict, 1 without one.

    Parameters
    ----------
    block, out : folders. before : a result whose orientation is a start value. geoid : grid file, '' where none.
    """
    from aerotri.execution.work import TasksFailedError
    from aerotri.public.adjusting import read_in_metres
    from aerotri.public.results import adjust
    from aerotri.public.saving import save_adjustment
    from aerotri.results.failure import AdjustmentFailedError

    try:
        read, _ = read_in_metres(block, "", geoid or None)
        found = adjust(_started(read, before), geoid=geoid or None, progress=_say)
        save_adjustment(found.record, out, plots=False, progress=_say)
    except (InputError, AdjustmentFailedError, TasksFailedError) as error:
        _print({"error": str(error)})
        return 1
    return 0


def _started(block: Block, before: Path | None) -> Block:
    """The block with the orientation of an earlier result as start values, where that is of its photographs.

    Not where orientation elements are held: they are held at what the block says.
    """
    if before is None or not (before / RECORD).is_file() or block.settings.adjustment.datum == "fixed":
        return block
    old = read_records(before)
    row = {name: k for k, name in enumerate(old.block.images.names.tolist())}
    rows = [row.get(name, -1) for name in block.images.names.tolist()]
    if old.block.crs != block.crs or old.block.rotation != block.rotation or -1 in rows:
        return block
    return replace(block, images=replace(block.images, centre=old.centre[rows], angles=old.angles[rows]))


def _say(stage: str, share: float | None) -> None:
    _print({"stage": stage, "share": share})


def _print(content: dict[str, Any]) -> None:
    print(json.dumps(content), flush=True)


if __name__ == "__main__":
    given = [Path(text) if text else None for text in sys.argv[1:4]]
    if given[0] is None or given[1] is None:
        raise SystemExit(2)
    raise SystemExit(work(given[0], given[1], given[2], sys.argv[4]))
