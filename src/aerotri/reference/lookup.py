"""The entries of the reference by the words a user would ask with."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from aerotri.reference.block_keys import (
    BlockKey,
    block_keys,
    block_tables,
    plan_keys,
    plan_tables,
    prior_keys,
)
from aerotri.reference.command_lines import CommandLine
from aerotri.reference.files import described_files
from aerotri.reference.printed_words import PRINTED_WORDS
from aerotri.reference.records import DescribedFile, Item
from aerotri.reference.words import WORDS, Word

KINDS = {
    "key of block.toml": ("gnss.shift", "pixel_um"),
    "table of block.toml": ("gnss", "stochastic"),
    "key of simulation.toml": ("flight.gsd_m", "flight.strips"),
    "table of simulation.toml": ("flight", "terrain"),
    "command": ("adjust", "predict volume"),
    "printed word": ("RMSE_V", "cut"),
    "file": ("points.csv", "work_list.csv"),
    "column": ("sZ", "points.csv sZ"),
    "dimension": ("sigma_x", "dsm.laz cov_xy"),
    "option": ("--robust", "adjust --robust"),
    "parameter": ("brown.K1", "bluh.1"),
    "word of a result": ("rejected", "rank deficient"),
    "JSON key": ("sigma0", "adjustment.json redundancy"),
}
"""Kinds of entries in the order in which they are told, with two words to ask for each."""
FIRST = "adjustment.json (result of adjust)"
"""The file whose keys are told before those of other files."""
CAMERA = re.compile(r"^camera\.[^.]+\.")
ITEMS = {"json": ("JSON key", "keys"), "cloud": ("dimension", "dimensions"), "table": ("column", "columns")}
"""What the items of a file of some form are, one and many."""
NAMED = 5
"""Near names that are offered where a word is not known; chosen [C]: more are no help."""


@dataclass(frozen=True, eq=False)
class Entry:
    """What the reference says of one thing.

    Parameters
    ----------
    kind : one of `KINDS`.
    name : of it. place : the file, table or command it belongs to. text : what it is.
    facts : unit, default and the like by name, without those that there are not. values : words and their meaning.
    """

    kind: str
    name: str
    place: str
    text: str
    facts: Mapping[str, str]
    values: Mapping[str, str]

    @property
    def title(self) -> str:
        """Name, kind and place in a line."""
        if self.kind.startswith(("key of", "table of")):
            return f"{self.name} — {self.kind}"
        return f"{self.name} — {self.kind}{f' of {self.place}' if self.place else ''}"


@cache
def entries() -> tuple[Entry, ...]:
    """All entries but commands and options."""
    return tuple(
        [
            *(_key("block.toml", one) for one in (*block_keys(), *prior_keys())),
            *_tables("block.toml", block_tables(), block_keys()),
            *(_key("simulation.toml", one) for one in plan_keys()),
            *_tables("simulation.toml", plan_tables(), plan_keys()),
            *(entry for one in described_files() for entry in _of_file(one)),
            *_parameters(),
            *(_word("printed word", word) for word in PRINTED_WORDS),
            *(_word("word of a result", word) for word in WORDS),
        ]
    )


def command_entries(commands: Sequence[CommandLine]) -> tuple[Entry, ...]:
    """Commands and their options."""
    found = []
    for command in commands:
        facts = {"usage": command.usage, "example": command.example}
        found.append(Entry("command", command.name, "", command.text, _facts(facts), {}))
        for option in command.options:
            facts = {"value": option.kind, "default": option.default, "required": "yes" if option.required else "",
                     "may be repeated": "yes" if option.repeated else ""}  # fmt: skip
            found.append(
                Entry("option", ", ".join(option.names), f"aerotri {command.name}", option.text, _facts(facts), {})
            )
    return tuple(found)


def find(words: str, known: Sequence[Entry]) -> list[Entry]:
    """The entries that a user means, those of that full name before those whose name ends so.

    Parameters
    ----------
    words : such as 'gnss.shift', 'camera.ucd.pixel_um', 'sZ', 'points.csv sZ', 'adjust --robust', 'rank deficient'.
    """
    asked = CAMERA.sub("camera.NAME.", " ".join(words.split()))
    for fold in (str, str.casefold):
        found = [
            entry for names in (_full_names, _short_names) for entry in known if fold(asked) in map(fold, names(entry))
        ]
        if found:
            return sorted(dict.fromkeys(found), key=_order)
    return []


def _order(entry: Entry) -> int:
    """The key of adjustment.json goes before what other files have under its name."""
    return list(KINDS).index("file" if FIRST in (entry.place, f"{entry.name} ({entry.place})") else entry.kind)


def names_of(entry: Entry) -> tuple[str, ...]:
    """All names by which an entry is found, the full ones first."""
    return (*_full_names(entry), *_short_names(entry))


def near(words: str, known: Sequence[Entry]) -> list[str]:
    """Names that are written nearly as what was asked."""
    asked = " ".join(words.split()).split(" ")[-1]
    names = {name.casefold(): name for entry in known for name in _own_names(entry)}
    return [names[name] for name in difflib.get_close_matches(asked.casefold(), list(names), NAMED, 0.7)]


def _own_names(entry: Entry) -> list[str]:
    """The names of an entry without its place; the last part of a long one too."""
    names = entry.name.split(", ") if entry.kind == "option" else [entry.name.replace("[]", "")]
    if entry.kind.startswith("key of") or entry.kind in ("JSON key", "parameter"):
        names.append(entry.name.replace("[]", "").rsplit(".", 1)[-1])
    return names


def _full_names(entry: Entry) -> Iterator[str]:
    file = entry.place.split(" (")[0].removeprefix("aerotri ")
    for name in (*_own_names(entry)[: 2 if entry.kind == "option" else 1], entry.name):
        yield name
        yield f"{file} {name}"
    if entry.kind in ("command", "option"):
        yield f"aerotri {entry.name}"
    if entry.kind == "file":
        yield f"{entry.name} ({entry.place})"
    if entry.kind.startswith("table of"):
        yield entry.name.strip("[]")


def _short_names(entry: Entry) -> Iterator[str]:
    file = entry.place.split(" (")[0]
    for name in _own_names(entry)[1:]:
        yield name
        yield f"{file} {name}"
    if entry.kind == "option":
        yield from (name.lstrip("-") for name in entry.name.split(", "))
    if entry.kind == "file":
        yield entry.name.rsplit(".", 1)[0]


def _facts(facts: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in facts.items() if value}


def _word(kind: str, word: Word) -> Entry:
    return Entry(kind, word.name, word.place, word.text, _facts({"what to do": word.remedy}), {})


def _key(file: str, key: BlockKey) -> Entry:
    facts = {
        "value": "" if key.values else key.kind, "unit": key.unit, "default": key.default,
        "required": "yes" if key.required else "",
    }  # fmt: skip
    return Entry(f"key of {file}", key.name, file, key.text, _facts(facts), dict.fromkeys(key.values, ""))


def _tables(file: str, tables: Mapping[str, str], keys: Sequence[BlockKey]) -> list[Entry]:
    below = {name: [key.name.rsplit(".", 1)[-1] for key in keys if key.table == name] for name in tables}
    return [
        Entry(f"table of {file}", f"[{name}]", file, text, _facts({"keys": ", ".join(below[name])}), {})
        for name, text in tables.items()
        if name
    ]


def _of_file(described: DescribedFile) -> Iterator[Entry]:
    is_json, (kind, plural) = described.form == "json", ITEMS.get(described.form, ITEMS["table"])
    names = ", ".join(name for name in described.columns if "." not in name and name != "[]")
    facts = {"written": described.when, plural: names}
    yield Entry("file", described.name, described.place, described.text, _facts(facts), {})
    for item in described.items:
        if item.name != "[]":
            yield Entry(kind, item.name, described.label, item.text, _facts(_of_item(item, is_json)), item.values)


def _of_item(item: Item, is_json: bool) -> dict[str, str]:
    may_be = f" or {'null' if is_json else 'empty'}" if item.kind.endswith("?") else ""
    return {
        "value": f"{item.kind.rstrip('?')}{may_be}",
        "unit": item.unit,
        "may be missing": "yes" if item.optional else "",
    }


def _parameters() -> list[Entry]:
    from aerotri.functional_model.additional_parameters import describe

    return [
        Entry("parameter", f"{one.family}.{one.item}", "additional_parameters",
              f"{one.text[:1].upper()}{one.text[1:]}." if one.text else one.reference,
              _facts({"write it as": f"{one.family}:{one.item}", "source": one.reference, "mark": one.mark}), {})
        for one in describe()
    ]  # fmt: skip
