"""`aerotri check`: what a block holds and what it lacks, without adjusting it."""

from __future__ import annotations

from pathlib import Path

from aerotri.commands.console import Console
from aerotri.formats.results.json_text import json_text


def run_check(block: Path, control_prefix: str, geoid: Path | None, as_json: bool) -> int:
    """Exit code of the command: 0 when the block can be adjusted, 1 when it cannot.

    Raises
    ------
    InputError
        When the block cannot be read.
    """
    from aerotri.compiled import compilation_notice
    from aerotri.public.block_check import check

    console = Console(quiet=as_json)
    console.progress(compilation_notice())
    found = check(block, control_prefix=control_prefix, geoid=geoid)
    if as_json:
        print(json_text(found.summary, None))
    else:
        console.lines(found.lines())
    return 0 if found.can_be_adjusted else 1
