"""`aerotri dsm`: the whole surface by dense matching."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console, written
from aerotri.commands.results import reopened
from aerotri.conventions import counted, real_path
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.files.work_place import held
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.tile_folder import remove_tiles, tiles_beside
from aerotri.terrain.settings import DenseSettings

if TYPE_CHECKING:
    from aerotri.public.dense import DenseSurface


def run_dsm(
    source: Path, photographs: list[Path], out: Path | None, settings: DenseSettings, plots: bool, as_json: bool,
    executor: str = THREADS,
) -> int:  # fmt: skip
    """Exit code of the command; arguments as on the command line."""
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.dense import RECORD, measure_dense

    console = Console(quiet=as_json)
    settings.check()
    chosen(executor)
    target = out or Path(f"{real_path(source).name.removesuffix('_result')}_dsm")
    refuse_foreign_folder(target, RECORD)
    tiles = tiles_beside(target)
    with held(target):
        result = Adjustment(reopened(source, console))
        found = measure_dense(result, photographs, settings, tiles, console.stage, executor)
        console.progress("writing")
        found.save(target, plots)
        remove_tiles(tiles)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines(outcome_lines(found, target))
    return 0


def outcome_lines(found: DenseSurface, target: Path) -> list[str]:
    """What the user reads of the surface."""
    return [*(f"note: {note}" for note in found.notes), *_summary(found.summary), written(target, "dsm.html")]


def _summary(content: dict[str, Any]) -> list[str]:
    c = content
    pairs = counted(c["pairs"], "pair")
    lines = [
        f"{c['photographs']} photographs in {pairs}, GSD {c['gsd_m']:.3f} m; cells of {c['cell_m']:.3g} m",
        f"{c['cells']['measured']} cells with a height, {c['area_m2']:.0f} m²; photographs of a cell: "
        f"{c['photographs_mean']:.1f}",
    ]
    if c["tiles_resumed"]:
        lines.append(f"tiles measured before: {c['tiles_resumed']} of {c['tiles']}")
    s, noise = c["sigma_Z_m"], c["noise_length_m"]
    length = "" if noise is None else f"; noise length {noise:.2g} m"
    lines.append(
        f"σ of Z: median {s['median']:.3f} m (matching {s['matching']:.3f}, adjustment {s['adjustment']:.3f}){length}"
    )
    y = c["y_parallax_px"]
    lines.append(f"y-parallax of the pairs: median {y['median']:.2f} px, largest {y['largest']:.2f} px")
    g = c["ground"]
    if g is not None:
        lines.append(
            f"ground: {g['measured']} cells measured, {g['bridged']} bridged; σ of a bridge "
            f"{g['bridge']['sigma_at_1_m']:.3f} m · distance^{g['bridge']['power']:.1f}"
        )
    return lines
