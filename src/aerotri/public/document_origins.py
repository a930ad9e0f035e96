"""Which result a document in a folder is of, so that the document of another result does not take its place."""

from __future__ import annotations

import json
from pathlib import Path

from aerotri.conventions import InputError

ORIGINS = ".aerotri-documents"
"""Beside the documents: the results they are of, by the names of the files."""


def with_origin(target: Path, name: str, origin: str) -> str:
    """The content of `ORIGINS` with one more document.

    Parameters
    ----------
    target : folder of the documents, may be missing. name : of the file. origin : of what result it is.

    Raises
    ------
    InputError
        When the folder holds a document of another result under that name.
    """
    known = _read(target / ORIGINS)
    other = known.get(name, origin)
    if other != origin and (target / name).is_file():
        raise InputError(
            f"is the document of another result, {other}", "give another folder to write to, or remove it",
            target / name,
        )  # fmt: skip
    return json.dumps(known | {name: origin}, indent=1, ensure_ascii=False) + "\n"


def _read(path: Path) -> dict[str, str]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {str(k): str(v) for k, v in content.items()} if isinstance(content, dict) else {}
