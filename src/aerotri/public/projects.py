"""Whose a result is: the [project] that was named, or that of what the result was computed from."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath, InputError, real_path

if TYPE_CHECKING:
    from aerotri.observations.project import Project

RECORDS = (
    "adjustment.json", "dsm.json", "dtm.json", "volume.json", "change.json", "cloud_change.json", "compare.json",
)  # fmt: skip
"""Files that say whose a result is."""


def project_of(named: FilePath | None, *sources: object) -> Project:
    """The project of a result.

    Parameters
    ----------
    named : block folder, block.toml, a TOML file with the table [project] alone, or result of an adjustment; None:
        looked for.
    sources : what the result was computed from, the nearest first: a result, its folder or a file in it, a block;
        others say nothing.

    Raises
    ------
    InputError
        When nothing is known of a project at the place that was named.
    """
    from aerotri.observations.project import Project

    if named is not None:
        return _named(Path(named))
    found = (one for source in sources for one in _told(source) if one.given())
    return next(found, Project())


def _told(source: object) -> list[Project]:
    """The projects that a source tells of; none where its block cannot be read, which is not asked for here."""
    try:
        return list(_projects(source))
    except InputError:
        return []


def _named(place: Path) -> Project:
    for found in _projects(place):
        return found
    raise InputError("holds no block.toml", "give a block folder or the result of an adjustment", place)


def _projects(source: object) -> Iterator[Project]:
    """The projects that a source tells of, those with a logo first."""
    from aerotri.observations import Block
    from aerotri.public.adjustment import Adjustment
    from aerotri.results.head import Head

    if isinstance(source, Adjustment):
        yield source.block.project
    elif isinstance(source, Block):
        yield source.project
    elif isinstance(source, str | os.PathLike):
        yield from _of_place(Path(source))
    elif isinstance(head := getattr(source, "head", None), Head):
        yield head.project
    elif isinstance(path := getattr(source, "path", None), Path):
        yield from _of_place(path)


def _of_place(place: Path) -> Iterator[Project]:
    """Of a folder, or of the folder that a file stands in; of the run around it too."""
    from aerotri.public.run_steps import RECORD, RESULT

    if place.suffix == ".toml" and place.is_file():
        yield _of_toml(place)
        return
    folder = place if place.is_dir() else place.parent
    for toml in (folder / "block" / "block.toml", folder / "block.toml", folder / RESULT / "block" / "block.toml"):
        if place.is_dir() and toml.is_file():
            yield _of_toml(toml)
    toml = real_path(folder).parent / RESULT / "block" / "block.toml"
    if (real_path(folder).parent / RECORD).is_file() and toml.is_file():
        yield _of_toml(toml)
    for name in RECORDS:
        content = _read(folder / name)
        if isinstance(content.get("project"), dict):
            yield project_in(content)


def project_in(content: dict[str, Any]) -> Project:
    """What a JSON file says of its project; the picture of the logo is not in it."""
    from aerotri.observations.project import Project

    stated = content.get("project")
    known = {one.name for one in fields(Project)} - {"logo", "logo_content"}
    texts: dict[str, Any] = stated if isinstance(stated, dict) else {}
    return replace(Project(), **{name: text for name, text in texts.items() if name in known and isinstance(text, str)})


def _read(path: Path) -> dict[str, Any]:
    """The content of a JSON file; {} where there is none that can be read."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _of_toml(toml: Path) -> Project:
    from aerotri.formats.block.logo import with_logo
    from aerotri.formats.block.settings import read_block_toml, read_project_toml

    alone = read_project_toml(toml)
    if alone is not None:
        return with_logo(alone.project, alone)
    settings = read_block_toml(toml)
    return with_logo(settings.model.project.project(), settings)
