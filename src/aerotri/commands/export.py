"""`aerotri export`: a result for a GIS, for tables with geometries, for a catalogue, as a document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerotri.commands.adjust import folder_name
from aerotri.commands.console import Console
from aerotri.formats.results.json_text import json_text


def run_export(
    result: Path, to: Any, out: Path | None, scale: float | None, flown: str, of_document: dict[str, Any], as_json: bool
) -> None:
    """Export; arguments as on the command line.

    Parameters
    ----------
    of_document : language, document, camera and project, as of `aerotri.export`.

    Raises
    ------
    InputError
        Where the folder holds no result that has converged, or the format cannot hold it.
    """
    from aerotri.public.exporting import export

    console = Console(quiet=as_json)
    target = out or Path(f"{folder_name(result).removesuffix('_result')}_export")
    found = export(result, target, to, scale=scale, flown=flown, **of_document, progress=console.stage)
    if as_json:
        content = {"target": str(target), "format": to, "files": list(found.files), "messages": list(found.notes)}
        print(json_text(content))
    else:
        console.lines([*found.notes, *(f"Written to {target / name}" for name in found.files)])
