"""`aerotri ortho`: a true orthophoto, and how exactly it lies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console, written
from aerotri.commands.results import reopened
from aerotri.conventions import InputError, counted, real_path
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.files.work_place import held
from aerotri.formats.results.json_text import json_text
from aerotri.terrain.ortho.settings import OrthoSettings
from aerotri.volume.settings import LAYERS

if TYPE_CHECKING:
    from aerotri.public.ortho import Orthophoto


def run_ortho(
    source: Path, photographs: list[Path], surface: Path, layer: str, out: Path | None, settings: OrthoSettings,
    plots: bool, as_json: bool, executor: str = THREADS,
) -> int:  # fmt: skip
    """Exit code of the command; arguments as on the command line."""
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.folders import refuse_foreign_folder
    from aerotri.public.ortho import RECORD, make_ortho
    from aerotri.public.tile_folder import remove_tiles, tiles_beside
    from aerotri.public.volume_sigma import MeasuredSurface

    console = Console(quiet=as_json)
    settings.check()
    chosen(executor)
    target = out or Path(f"{real_path(source).name.removesuffix('_result')}_ortho")
    refuse_foreign_folder(target, RECORD)
    if layer not in LAYERS:
        raise InputError(f"there is no layer '{layer}'", f"choose one of {', '.join(LAYERS)}")
    tiles = tiles_beside(target)
    with held(target):
        ground = MeasuredSurface(surface, layer=layer)
        result = Adjustment(reopened(source, console))
        found = make_ortho(result, photographs, ground, target, settings, plots, tiles, console.stage, executor)
        remove_tiles(tiles)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines(outcome_lines(found))
    return 0


def outcome_lines(found: Orthophoto) -> list[str]:
    """What the user reads of an orthophoto."""
    s = found.summary
    used = sum(one["area_m2"] > 0.0 for one in s["photographs"])
    area, sigma, seams = s["area_m2"], s["sigma_m"], s["seams"]
    lines = [*(f"note: {note}" for note in found.notes)]
    lines.append(
        f"{s['columns']} × {s['rows']} cells of {s['cell_m']:g} m (GSD {s['gsd_m']:.3f} m) from {used} of "
        f"{counted(len(s['photographs']), 'photograph')}"
    )
    lines.append(
        f"{area['orthophoto']:.0f} m² of {area['surface']:.0f} m² with heights; {area['without_photograph']:.0f} m² no "
        f"photograph sees, {area['other_photograph']:.0f} m² are hidden in the photograph around them and taken from "
        "another"
    )
    if s["tiles_resumed"]:
        lines.append(f"tiles made before: {s['tiles_resumed']}")
    if area["bridged"] > 0.0:
        lines.append(f"{area['bridged']:.0f} m² of it over bridged holes of the surface: σ is not known there")
    same = s["of_one_adjustment"]
    adjustment = "adjustment" if same else "orientation"
    parts = [f"{adjustment} {sigma['orientation']['median']:.3f}", f"image {sigma['image']['median']:.3f}"]
    if sigma["surface"] is not None:
        parts.insert(0, f"{'matching' if same else 'heights'} {sigma['surface']['median']:.3f}")
    lines.append(
        f"σ of X and Y: median {sigma['total']['median']:.3f} m ({', '.join(parts)}), 95 % of the area below "
        f"{sigma['total']['q95']:.3f} m"
    )
    if seams["difference"] is not None and seams["difference_of_best"] is not None:
        lines.append(
            f"seams: {seams['length_m']:.0f} m; colours on both sides differ by {100 * seams['difference']:.1f} % of "
            f"white, {100 * seams['difference_of_best']:.1f} % between the best photographs"
        )
    return [*lines, written(found.folder, "ortho.html")]
