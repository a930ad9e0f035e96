"""`aerotri divide`: a block cut into parts that are adjusted one by one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from aerotri.commands.console import Console
from aerotri.formats.results.json_text import json_text


def run_divide(path: Path, out: Path | None, parts: int | None, as_json: bool) -> None:
    """Divide and write; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.commands.adjust import folder_name
    from aerotri.formats.block.folder import read_photographs
    from aerotri.partition.part_list import part_folders
    from aerotri.public.parts import divide

    console = Console(quiet=as_json)
    target = out or Path(f"{folder_name(path)}_parts")
    divide(path, target, parts=parts, progress=console.stage)
    counts = {folder.name: len(read_photographs(folder)) for folder in part_folders(target)}
    photographs = len(read_photographs(path))
    twice = sum(counts.values()) - photographs
    if as_json:
        print(json_text({"folder": str(target), "parts": counts, "photographs": photographs}))
        return
    console.lines(
        [
            f"{parts_in_words(counts, parts)}; {photographs} photographs stand in them {twice} times more than once",
            f"Written to {target}: aerotri adjust {target}",
        ]
    )


def parts_in_words(photographs: Mapping[str, int], wanted: int | None) -> str:
    """How many parts there are, and of how many photographs.

    Parameters
    ----------
    photographs : of each part. wanted : parts that were asked for; None where nothing was said.
    """
    count = len(photographs)
    fewer = wanted is not None and count < wanted
    possible = f" ({wanted} were asked for; the block can be cut into {count} at most)" if fewer else ""
    return f"{count} parts of {min(photographs.values())} to {max(photographs.values())} photographs{possible}"
