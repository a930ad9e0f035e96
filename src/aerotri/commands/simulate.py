"""`aerotri simulate`: a block with its truth from a flight plan, and photographs of it."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import InputError
from aerotri.public.folders import refuse_existing_file, refuse_foreign_entries

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.simulation.rendering import RenderOptions, Scene
    from aerotri.simulation.spec import SimulationSpec
    from aerotri.simulation.truth import Truth

PHOTOGRAPHS, RECORD = "photographs", "rendered.json"


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
    render : how photographs look; None: none are made. only : names of the photographs to make, empty = all.
    overwrite : whether files of others in the folder may be replaced.
    """
    from aerotri.formats.work_place import held
    from aerotri.simulation import read_spec, simulate

    plan = read_spec(spec)
    block, truth = simulate(plan, seed)
    chosen = _chosen(block, only) if render is not None else []
    with held(out):
        _write(plan, seed, block, truth, out, overwrite, render, chosen, Console(quiet=as_json))
    counts: dict[str, Any] = {
        "block": block.name,
        "images": len(block.images),
        "image_points": len(block.image_points),
        "points": len(block.points),
        "control": int((~block.control.is_check).sum()),
        "check": int(block.control.is_check.sum()),
    }
    if render is not None:
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


def _write(
    plan: SimulationSpec, seed: int, block: Block, truth: Truth, out: Path, overwrite: bool,
    render: RenderOptions | None, chosen: list[int], console: Console,
) -> None:  # fmt: skip
    """The block with its truth in one step, then its photographs one by one."""
    from aerotri.formats.block_writer import OWN_ENTRIES
    from aerotri.simulation import write_simulated
    from aerotri.simulation.truth import TRUTH

    refuse_foreign_entries(out, (*OWN_ENTRIES, TRUTH), overwrite)
    older = _rendered(out)
    photographs = [f"{block.images.names[image]}.tif" for image in chosen]
    for name in photographs:
        if name not in older:
            refuse_existing_file(out / PHOTOGRAPHS / name, overwrite)
    # photographs of an older block of this place: none may stand beside another block
    gone = {f"{PHOTOGRAPHS}/{name}" for name in (*older, RECORD)} if older else set()
    write_simulated(out, block, truth, gone)
    if render is not None:
        from aerotri.simulation.rendering import make_scene

        _render(make_scene(plan, seed, block, truth, render), chosen, out / PHOTOGRAPHS, console)


def _rendered(out: Path) -> list[str]:
    """The photographs that the record of an older run names, and that this program may therefore remove."""
    record = out / PHOTOGRAPHS / RECORD
    if not record.is_file():
        return []
    try:
        names = [str(name) for name in json.loads(record.read_text(encoding="utf-8"))["photographs"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"cannot be read: {error}", "remove the folder, or choose another --out", record) from error
    return [name for name in names if Path(name).name == name]


def _refuse_without_room(scene: Scene, chosen: list[int], folder: Path) -> None:
    """Photographs are as large as their pixels, 16 bit each.

    Raises
    ------
    InputError
        When they do not fit on the disk.
    """
    needed = sum(2.0 * float(np.prod(scene.camera(image).nominal.size_px, dtype=float)) for image in chosen)
    free = shutil.disk_usage(next(p for p in folder.resolve().parents if p.is_dir())).free
    if needed > free:
        raise InputError(
            f"{len(chosen)} photographs need {needed / 2**30:.3g} GiB, {free / 2**30:.3g} GiB of the disk are free",
            "choose another place, or some of them by --only",
        )


def _render(scene: Scene, chosen: list[int], folder: Path, console: Console) -> None:
    """Every photograph whole or not at all; the record, written first, names them."""
    from aerotri.compiled import compilation_notice
    from aerotri.formats.atomic import atomic_file
    from aerotri.rasters_images import create_image
    from aerotri.simulation.rendering import rendered_rows

    _refuse_without_room(scene, chosen, folder)
    console.progress(compilation_notice())
    files = [f"{scene.names[image]}.tif" for image in chosen]
    content = {"photographs": files, "seed": scene.seed, "options": asdict(scene.options)}
    with atomic_file(folder / RECORD) as place:
        place.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    for number, (image, name) in enumerate(zip(chosen, files, strict=True)):

        def report(share: float, number: int = number) -> None:
            console.work("rendering", (number + share) / len(chosen), f"photograph {number + 1} of {len(chosen)}")

        columns, rows = scene.camera(image).nominal.size_px
        with atomic_file(folder / name) as place, create_image(place, columns, rows, 1, "uint16") as writer:
            for first, pixels in rendered_rows(scene, image, report):
                writer.write(first, pixels[None])
    console.lines([])
