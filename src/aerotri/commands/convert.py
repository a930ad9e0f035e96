"""`aerotri convert`: between formats; what the target cannot hold is said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.formats.oriented import OrientedBlock

TARGETS = ("block", "bal", "colmap", "colmap-text")


def run_convert(source: Path, target: Path, to: str, positions: Path | None, as_json: bool) -> None:
    """Convert; arguments as on the command line.

    Raises
    ------
    InputError
    """
    if to not in TARGETS:
        raise InputError(f"'{to}' is not a format that is written", f"known are {', '.join(TARGETS)}")
    if target.resolve() == source.resolve():
        raise InputError("source and target are the same", "choose another target", target)
    lost = _to_block(source, target, positions) if to == "block" else _to_model(source, target, to)
    if as_json:
        print(json.dumps({"target": str(target), "format": to, "messages": list(lost)}, ensure_ascii=False))
        return
    for sentence in lost:
        print(sentence)
    print(f"Written to {target}")


def _to_block(source: Path, target: Path, positions: Path | None) -> tuple[str, ...]:
    from aerotri.formats.convert import detect_format, read_any, write_any
    from aerotri.formats.dbat import read_dbat

    if positions is not None:
        if detect_format(source) != "dbat":
            raise InputError("positions are added to DBAT scripts only", "leave --positions out", source)
        return write_any(read_dbat(source, positions), target)
    block, points = read_any(source)
    return write_any(block, target, points=points)


def _to_model(source: Path, target: Path, to: str) -> tuple[str, ...]:
    from aerotri.formats.colmap import write_colmap
    from aerotri.formats.convert import write_oriented

    oriented = _oriented(source)
    if to == "bal":
        return write_oriented(oriented, target, "bal")
    return write_colmap(oriented, target, binary=to == "colmap")


def _oriented(source: Path) -> OrientedBlock:
    """Orientation and points of a result, of a model that has them, or of a block adjusted for the purpose."""
    from aerotri.formats.block_folder import read_block
    from aerotri.formats.convert import read_any
    from aerotri.formats.oriented import oriented_block, oriented_from_adjusted

    if (source / "solution.npz").is_file():
        from aerotri.formats.solution import read_solution
        from aerotri.pipeline import reopen

        saved = read_solution(source / "solution.npz")
        return oriented_from_adjusted(reopen(read_block(source / "block"), saved).result)
    block, points = read_any(source)
    if points is not None:
        return oriented_block(block, points)
    from aerotri.compiled import compilation_notice
    from aerotri.pipeline import AdjustmentFailedError, adjust

    console = Console()
    console.progress(compilation_notice())
    try:
        return oriented_from_adjusted(adjust(block, console.iteration))
    except AdjustmentFailedError as failure:
        raise InputError(
            f"the block has to be adjusted first, and that failed: {failure}", "mend the block", source
        ) from None
