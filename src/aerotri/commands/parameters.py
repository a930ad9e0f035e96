"""`aerotri parameters`: the sets of additional parameters, in words and in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.formats.results.json_text import json_text

if TYPE_CHECKING:
    from aerotri.functional_model.additional_parameters import ParameterDescription

MOST = 16
"""Parameters of a family listed when all families are."""


def run_parameters(out: Path | None, family: str | None, as_json: bool) -> None:
    """List the sets, or draw their patterns; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.public.parameters import draw_parameters, list_parameters

    entries = list_parameters(family)
    drawn = None if out is None else draw_parameters(out, family)
    if as_json:
        print(json_text([vars(d) for d in entries]))
        return
    lines = _lines(entries, whole=family is not None)
    print("\n".join(lines if drawn is None else [*lines, f"Drawn to {out}: {', '.join(drawn)}"]))


def _lines(entries: Sequence[ParameterDescription], whole: bool) -> list[str]:
    """A heading a family, and its parameters; all of them where `whole`."""
    lines = []
    for name in dict.fromkeys(d.family for d in entries):
        own = [d for d in entries if d.family == name]
        lines.append(f"{name}: {len(own)} parameters. {own[0].reference}")
        lines += [f"  {d.item:<12} [{d.mark}] {d.text}" for d in (own if whole else own[:MOST])]
        if not whole and len(own) > MOST:
            lines.append(f"  … {len(own) - MOST} more: aerotri parameters --family {name}")
    return lines
