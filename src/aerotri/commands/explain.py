"""`aerotri explain`: what the reference says of a key, a column, a file, an option or a word of a result."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

from aerotri.conventions import InputError
from aerotri.formats.results.json_text import json_text
from aerotri.reference.lookup import KINDS, Entry, command_entries, entries, find, near


def run_explain(words: str, program: Any, as_json: bool) -> None:
    """Print the entries; arguments as on the command line.

    Parameters
    ----------
    words : what is asked for; '' tells what can be asked.
    program : the command lines that there are, a `typer.Typer`.

    Raises
    ------
    InputError
        For a word that the reference does not have, with the names nearest to it.
    """
    from aerotri.reference.command_lines import command_lines

    known = (*entries(), *command_entries(command_lines(program)))
    if not words.strip() and not as_json:
        print("\n".join(_kinds(known)))
        return
    found = find(words, known) if words.strip() else list(known)
    if not found:
        names = ", ".join(f"'{name}'" for name in near(words, known))
        ask = "ask for a key of block.toml, a column, a file, an option or a printed word; aerotri explain lists more"
        raise InputError(f"nothing is called '{words[:60]}'", f"did you mean {names}?" if names else ask)
    if as_json:
        print(json_text([dataclasses.asdict(entry) for entry in found]))
        return
    print("\n".join(_lines(found)))


def _kinds(known: Sequence[Entry]) -> Iterator[str]:
    """What can be asked, kind by kind with examples."""
    yield "aerotri explain WORD says what a word means. It knows:"
    width = max(map(len, KINDS))
    for kind, examples in KINDS.items():
        count = sum(entry.kind == kind for entry in known)
        yield f"  {kind:<{width}} {count:>4}, such as: {', '.join(examples)}"
    yield "Where a word stands in several files, give the file or command before it: aerotri explain points.csv sZ"


def _lines(found: Sequence[Entry]) -> Iterator[str]:
    for entry in found:
        yield entry.title
        yield f"  {entry.text}"
        for name, value in entry.facts.items():
            yield f"  {name}: {value}"
        plain = [word for word, meaning in entry.values.items() if not meaning]
        if plain:
            yield f"  one of: {', '.join(plain)}"
        for word, meaning in entry.values.items():
            if meaning:
                yield f"    {word or '(empty)'}: {meaning}"
