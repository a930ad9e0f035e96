"""Numbers of the command line are finite and of a size that something measured can have; --out can be written to."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, cast

import typer
from typer.core import TyperCommand

from aerotri.cli.options import HELP
from aerotri.conventions import LARGEST

LARGEST_COUNT = 2**31 - 1
"""Largest whole number of an option, that of 32 bits with a sign: what libraries below take for a count."""
LARGEST_SEED = 2**63 - 1
"""Largest seed, that of 64 bits with a sign."""


class CheckedCommand(TyperCommand):
    """A command whose numbers and --out are held against what can be, before anything is done; help stands last."""

    def get_help_option(self, ctx: Any) -> Any:
        """--help in the panel of its own."""
        option: Any = super().get_help_option(ctx)
        if option is not None:
            option.rich_help_panel = HELP
        return option

    def invoke(self, ctx: Any) -> Any:
        for param in self.params:
            reason = refusal(str(param.name), ctx.params.get(param.name))
            if reason:
                raise typer.BadParameter(reason, ctx=ctx, param=cast(Any, param))
        if isinstance(out := ctx.params.get("out"), Path):
            from aerotri.formats.files.places import refuse_impossible_place

            refuse_impossible_place(out)
        return super().invoke(ctx)


def refusal(name: str, value: Any) -> str:
    """Why the value of an option cannot be, '' where it can; values of several are looked at one by one."""
    if isinstance(value, (tuple, list)):
        return next(filter(None, (refusal(name, one) for one in value)), "")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return ""
    if isinstance(value, float) and not math.isfinite(value):
        return f"{value} is not a number to compute with."
    largest = LARGEST if isinstance(value, float) else LARGEST_SEED if name == "seed" else LARGEST_COUNT
    return f"{value:g} is too large, at most {largest:g} can be." if abs(value) > largest else ""
