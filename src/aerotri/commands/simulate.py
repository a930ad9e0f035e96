"""`aerotri simulate`: a block with its truth from a flight plan, and photographs of it."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.simulation.rendering import RenderOptions, Scene

PHOTOGRAPHS, RECORD = "photographs", "rendered.json"


def run_simulate(
    spec: Path,
    out: Path,
    seed: int,
    as_json: bool,
    render: RenderOptions | None = None,
    only: tuple[str, ...] = (),
) -> None:
    """Simulate and write; arguments as on the command line.

    Parameters
    ----------
    render : how photographs look; None: none are made. only : names of the photographs to make, empty = all.
    """
    from aerotri.simulation import read_spec, simulate, write_simulated

    plan = read_spec(spec)
    block, truth = simulate(plan, seed)
    chosen = _chosen(block, only) if render is not None else []
    _remove_rendered(out)
    write_simulated(out, block, truth)
    counts: dict[str, Any] = {
        "block": block.name,
        "images": len(block.images),
        "image_points": len(block.image_points),
        "points": len(block.points),
        "control": int((~block.control.is_check).sum()),
        "check": int(block.control.is_check.sum()),
    }
    if render is not None:
        from aerotri.simulation.rendering import make_scene

        _render(make_scene(plan, seed, block, truth, render), chosen, out / PHOTOGRAPHS, Console(quiet=as_json))
        counts["rendered"] = len(chosen)
    if as_json:
        print(json.dumps(counts, ensure_ascii=False))
        return
    print(
        f"{counts['images']} photographs, {counts['image_points']} image points of {counts['points']} points, "
        f"{counts['control']} control and {counts['check']} check points written to {out}"
    )
    if chosen:
        print(f"{len(chosen)} photographs rendered in {out / PHOTOGRAPHS}")


def _chosen(block: Block, only: tuple[str, ...]) -> list[int]:
    """Numbers of the photographs to render.

    Raises
    ------
    InputError
    """
    names = block.images.names.tolist()
    unknown = [name for name in only if name not in names]
    if unknown:
        raise InputError(f"there is no photograph '{unknown[0]}' to render", f"names are {names[0]} to {names[-1]}")
    return [names.index(name) for name in dict.fromkeys(only)] if only else list(range(len(names)))


def _remove_rendered(out: Path) -> None:
    """Photographs of an older block of this place, those that its record names: none may stand beside another block."""
    record = out / PHOTOGRAPHS / RECORD
    if not record.is_file():
        return
    try:
        names = [str(name) for name in json.loads(record.read_text(encoding="utf-8"))["photographs"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"cannot be read: {error}", "remove the folder, or choose another --out", record) from error
    for name in names:
        if Path(name).name == name:
            (record.parent / name).unlink(missing_ok=True)
    record.unlink()


def _render(scene: Scene, chosen: list[int], folder: Path, console: Console) -> None:
    """Every photograph whole or not at all; the record, written first, names them."""
    from aerotri.compiled import compilation_notice
    from aerotri.formats.atomic import atomic_file
    from aerotri.rasters_images import create_image
    from aerotri.simulation.rendering import rendered_rows

    console.progress(compilation_notice())
    files = [f"{scene.names[image]}.tif" for image in chosen]
    content = {"photographs": files, "seed": scene.seed, "options": asdict(scene.options)}
    with atomic_file(folder / RECORD) as place:
        place.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    begun = time.perf_counter()
    for number, (image, name) in enumerate(zip(chosen, files, strict=True)):

        def report(share: float, number: int = number) -> None:
            whole = (number + share) / len(chosen)
            left = (time.perf_counter() - begun) * (1.0 - whole) / whole
            console.progress(f"rendering {number + 1} of {len(chosen)}: {100 * share:.0f} %, {left:.0f} s left")

        columns, rows = scene.camera(image).nominal.size_px
        with atomic_file(folder / name) as place, create_image(place, columns, rows, 1, "uint16") as writer:
            for first, pixels in rendered_rows(scene, image, report):
                writer.write(first, pixels[None])
    console.lines([])
