"""`aerotri init`: the folder of a new block, to be filled in."""

from __future__ import annotations

from pathlib import Path

from aerotri.commands.console import Console
from aerotri.commands.convert import camera_spec
from aerotri.formats.results.json_text import json_text


def run_init(
    folder: Path,
    camera_name: str,
    camera_size: str,
    pixel_um: float | None,
    focal_length_mm: float | None,
    as_json: bool,
) -> None:
    """Write the folder; arguments as on the command line.

    Raises
    ------
    InputError
        When one of its files is there already.
    """
    from aerotri.formats.block.template import NewCamera, write_template

    spec = camera_spec(None, camera_name, camera_size, pixel_um, focal_length_mm, None, False)
    camera = NewCamera(spec.name, spec.size_px, spec.pixel_um, spec.focal_length_mm)
    files = write_template(folder, camera)
    if as_json:
        print(json_text({"folder": str(folder), "files": list(files)}, None))
        return
    Console().lines(_lines(folder, files, camera.is_example))


def _lines(folder: Path, files: tuple[str, ...], is_example: bool) -> list[str]:
    lines = [f"Written to {folder}: {', '.join(files)}"]
    if is_example:
        lines.append("the camera in block.toml is an example: write size_px, pixel_um and focal_length_mm of yours")
    return [*lines, f"Fill in the tables, then: aerotri check {folder}"]
