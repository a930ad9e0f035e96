"""`aerotri demcor`: a DEM freed of the deformation of the models it was made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError, real_path
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.results.json_text import json_text


def run_demcor(
    source: Path, dem: Path, out: Path, pair: tuple[str, str] | None, models: Path | None, table: Path | None,
    orientation: str | None, as_json: bool, overwrite: bool = False, executor: str = THREADS,
) -> int:  # fmt: skip
    """Exit code of the command; arguments as on the command line."""
    from aerotri.deformation.absorbed import AbsorptionFailedError
    from aerotri.formats.files.atomic import room_beside
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.dem import correct_dem, refuse_foreign_files

    console = Console(quiet=as_json)
    if (pair is None) == (models is None):
        raise InputError("either --pair or --models says which photographs the DEM was made of", "give one of the two")
    chosen(executor)
    if real_path(out) == real_path(dem):
        raise InputError("source and target are the same", "choose another --out", out)
    refuse_foreign_files(out, overwrite)
    result = Adjustment(reopened(source, console), folder=source)
    try:
        with room_beside(out) as room:
            found = correct_dem(
                dem, result, pair=pair, models=models, model_table=table, orientation=orientation, scratch=room,
                executor=executor, progress=console.stage,
            )  # fmt: skip
            found.save(out, overwrite)
    except AbsorptionFailedError as failure:
        console.failure(str(failure))
        return 1
    for note in found.notes:
        console.note(note)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines([*_summary(found.summary), f"Written to {out}"])
    return 0


def _summary(content: dict[str, Any]) -> list[str]:
    from aerotri.deformation.restitution import ORIENTED
    from aerotri.report.quality import printable

    c = content
    lines = [
        f"{c['corrected']} of {c['cells']} cells corrected, {c['no_data']} without data, {c['outside_models']} outside "
        f"the models; {len(c['models'])} model{'s' * (len(c['models']) != 1)}, {ORIENTED[c['variant']]}"
    ]
    for when in ("before", "after"):
        s = c[when]
        lines.append(f"{when:<7} Z {s['min']:.3f} … {s['max']:.3f} m, mean {s['mean']:.3f}")
    s, sigma = c["dZ"], c["sigma_dZ"]
    lines.append(f"dZ  {s['min']:+.3f} … {s['max']:+.3f} m, mean {s['mean']:+.3f}, RMS {s['rms']:.3f}")
    if sigma["mean"] is not None:
        lines.append(f"σ of dZ  {sigma['min']:.4f} … {sigma['max']:.4f} m: {c['sigma_includes']}")
    seams = c["seams"]
    if seams["count"]:
        lines.append(
            f"steps at {seams['count']} seams between models: RMS {seams['rms_before']:.3f} m before, "
            f"{seams['rms_after']:.3f} m after (roughness of the terrain included); worst:"
        )
        for seam in seams["worst"][:5]:
            first, second = (printable(", ".join(seam[key])) for key in ("first", "second"))
            lines.append(f"  {first} | {second}: mean {seam['mean_before']:+.3f} → {seam['mean_after']:+.3f} m")
    return lines
