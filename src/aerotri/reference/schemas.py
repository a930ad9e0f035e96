"""JSON Schemas of the JSON files, made from the reference: what it does not name is not allowed.

The folder `schema_files` beside this module holds them as files; `python -m aerotri.reference.schemas` writes them
anew.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aerotri.reference.files import described_files
from aerotri.reference.records import DescribedFile, Item

DRAFT = "https://json-schema.org/draft/2020-12/schema"
TYPES = {"text": "string", "number": "number", "whole": "integer", "yes/no": "boolean", "object": "object"}

SHIPPED = Path(__file__).parent / "schema_files"
"""The schemas as files of the package."""


@dataclass
class _Node:
    """A place in a JSON file: what is said of it, its keys, and the entries of a list."""

    item: Item | None = None
    keys: dict[str, _Node] = field(default_factory=dict)
    entry: _Node | None = None

    def at(self, path: list[str]) -> _Node:
        """The place below this one, made where it is not yet known."""
        if not path:
            return self
        if path[0] == "[]":
            self.entry = self.entry or _Node()
            return self.entry.at(path[1:])
        return self.keys.setdefault(path[0], _Node()).at(path[1:])

    @property
    def is_optional(self) -> bool:
        said = self.item or (self.entry.item if self.entry else None)
        return said is not None and said.optional


def json_files() -> tuple[DescribedFile, ...]:
    """What has a schema: the JSON files, and what commands print with --json."""
    return tuple(one for one in described_files() if one.form == "json")


def schema_of(described: DescribedFile) -> dict[str, Any]:
    """The JSON Schema of a JSON file, as plain values; units stand under the key "unit"."""
    root = _Node(item=None)
    for item in described.items:
        root.at(_path(item.name)).item = item
    return {"$schema": DRAFT, "title": described.label, "description": described.text, **_schema(root)}


def schema_name(described: DescribedFile) -> str:
    """Name of the schema's file: that of the file, with the place where it is not alone of its name."""
    alone = sum(one.name == described.name for one in json_files()) == 1
    name = (described.name if alone else described.label).removesuffix(".json")
    return "_".join("".join(c if c.isalnum() else " " for c in name).split()) + ".schema.json"


def schema_texts() -> dict[str, str]:
    """The schemas as text, by the name of their file."""
    return {schema_name(one): json.dumps(schema_of(one), indent=2, ensure_ascii=False) + "\n" for one in json_files()}


def _path(name: str) -> list[str]:
    """'groups[].rms' as groups, [], rms."""
    parts: list[str] = []
    for part in name.split("."):
        plain = part.rstrip("[]")
        parts += ([plain] if plain else []) + ["[]"] * part.count("[]")
    return parts


def _schema(node: _Node) -> dict[str, Any]:
    item = node.item
    content: dict[str, Any] = {}
    if node.entry is not None:
        content = {"type": "array", "items": _schema(node.entry)}
    elif node.keys or item is None or item.kind.startswith("object"):
        content = _object(node)
    elif item.kind != "anything":
        content = {"type": TYPES[item.kind.rstrip("?")]}
    if item is None:
        return content
    if item.kind.endswith("?"):
        content["type"] = [content["type"], "null"]
    if item.values:
        content["enum"] = list(item.values)
    return {"description": item.text, **({"unit": item.unit} if item.unit else {}), **content}


def _object(node: _Node) -> dict[str, Any]:
    named = {name: below for name, below in node.keys.items() if name != "*"}
    content: dict[str, Any] = {"type": "object"}
    if named:
        content["properties"] = {name: _schema(below) for name, below in named.items()}
        content["required"] = [name for name, below in named.items() if not below.is_optional]
    content["additionalProperties"] = _schema(node.keys["*"]) if "*" in node.keys else False
    return content


if __name__ == "__main__":
    for file_name, text in schema_texts().items():
        (SHIPPED / file_name).write_text(text, encoding="utf-8")
