"""`aerotri dtm`: points by image matching, and the surfaces they make."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError, real_path, stated_number
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder
from aerotri.terrain.settings import TerrainSettings

if TYPE_CHECKING:
    from aerotri.public.terrain import TerrainModel


def metres_or_auto(text: str) -> float | None:
    """The interval of the command line; None for auto.

    Raises
    ------
    InputError
    """
    if text == "auto":
        return None
    try:
        return stated_number(text)
    except ValueError:
        raise InputError(f"--interval '{text}' is not a number", "give metres, or auto") from None


def run_dtm(
    source: Path, photographs: list[Path], out: Path | None, settings: TerrainSettings, plots: bool, as_json: bool,
    executor: str = THREADS,
) -> int:  # fmt: skip
    """Exit code of the command; arguments as on the command line."""
    from aerotri.formats.files.atomic import room_beside
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.terrain import RECORD, measure_terrain

    console = Console(quiet=as_json)
    settings.check()
    chosen(executor)
    target = out or Path(f"{real_path(source).name.removesuffix('_result')}_dtm")
    refuse_foreign_folder(target, RECORD)
    result = Adjustment(reopened(source, console))
    with ExitStack() as stack:
        room = None if chosen(executor).kind == "threads" else stack.enter_context(room_beside(target))
        found = measure_terrain(result, photographs, settings, console.stage, executor, room)
        console.progress("writing")
        found.save(target, plots)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines(outcome_lines(found, target))
    return 0


def outcome_lines(found: TerrainModel, target: Path) -> list[str]:
    """What the user reads of the surface."""
    return [*(f"note: {note}" for note in found.notes), *_summary(found.summary), f"Written to {target}"]


def _summary(content: dict[str, Any]) -> list[str]:
    c = content
    p = c["pickets"]
    lines = [
        f"{c['photographs']} photographs, GSD {c['gsd_m']:.3f} m; pickets every {c['interval_m']:g} m"
        f" ({c['interval_source']}), raster cells of {c['cell_m']:g} m",
        f"{p['accepted']} of {p['seen']} nodes that are seen accepted ({p['stepped_aside']} moved to a place nearby), "
        f"{p['errors']} error pickets, {p['holes']} holes",
    ]
    reasons = [f"{n} {name}" for name, n in c["status"].items() if n and name not in ("accepted", "not seen")]
    if reasons:
        lines.append("not accepted: " + ", ".join(reasons))
    s = c["sigma_Z_m"]
    lines.append(
        f"σ of Z: median {s['median']:.3f} m (matching {s['matching']:.3f}, adjustment {s['adjustment']:.3f}; "
        f"between pickets {s['interpolation']:.3f}); parallax of the rays {c['ray_sigma_px']:.3f} px"
    )
    lines.append(f"{c['ground_share'] * 100:.0f} % of the pickets are ground")
    return lines
