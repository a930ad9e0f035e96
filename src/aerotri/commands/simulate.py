"""`aerotri simulate`: a block with its truth from a flight plan, and photographs of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_no_folder

if TYPE_CHECKING:
    from aerotri.simulation.rendering import RenderOptions


def run_simulate(
    spec: Path,
    out: Path,
    seed: int,
    as_json: bool,
    render: RenderOptions | None = None,
    only: tuple[str, ...] = (),
    overwrite: bool = False,
) -> None:
    """Simulate and write; arguments as on the command line.

    Parameters
    ----------
    render : how photographs look; None: none are made.
    only : names of the photographs to make, empty = all.
    overwrite : whether files of others in the folder may be replaced.

    Raises
    ------
    InputError
    """
    from aerotri.public.simulating import simulate

    console = Console(quiet=as_json)
    refuse_no_folder(out)
    flight = simulate(spec, seed)
    wanted, counts = render is not None, flight.summary
    looks: dict[str, Any] = (
        {} if render is None else {"targets": render.targets, "blur_px": render.blur_px, "noise": render.noise}
    )
    flight.save(out, photographs=wanted, only=only, overwrite=overwrite, progress=console.stage, **looks)
    rendered = (len(dict.fromkeys(only)) or counts["images"]) if wanted else 0
    if wanted:
        counts["rendered"] = rendered
    if as_json:
        print(json_text(counts, None))
        return
    console.lines(_lines(counts, out, rendered))


def run_simulate_parts(spec: Path, out: Path, seed: int, parts: int, as_json: bool) -> None:
    """Simulate and write a block in parts; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.public.parts import simulate_parts

    console = Console(quiet=as_json)
    counts = simulate_parts(spec, out, parts=parts, seed=seed, progress=console.stage)
    if as_json:
        print(json_text(counts, None))
        return
    said = _lines(counts, out, 0)
    console.lines([*said, f"{parts} parts: aerotri adjust {out}"])


def _lines(counts: dict[str, Any], out: Path, rendered: int) -> list[str]:
    from aerotri.simulation.photograph_files import PHOTOGRAPHS
    from aerotri.simulation.truth import MARKED_CONTROL

    lines = [
        f"{counts['images']} photographs, {counts['image_points']} image points of {counts['points']} points, "
        f"{counts['control']} control and {counts['check']} check points written to {out}"
    ]
    if not rendered:
        return lines
    marked = [f"control points in them: {out / MARKED_CONTROL}"] if (out / MARKED_CONTROL).is_file() else []
    return [*lines, f"{rendered} photographs rendered in {out / PHOTOGRAPHS}", *marked]
