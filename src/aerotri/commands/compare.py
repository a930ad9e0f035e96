"""`aerotri compare`: a surface against a control surface."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import InputError, real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder
from aerotri.terrain.settings import ALIGNMENTS, INTERPOLATIONS, Interpolation, Movement

if TYPE_CHECKING:
    from aerotri.public.surface_comparison import SurfaceComparison


def run_compare(
    test: Path, control: Path, out: Path | None, method: Interpolation, align: Movement, cell: float | None,
    project: Path | None, plots: bool, as_json: bool,
) -> None:  # fmt: skip
    """Compare and write; arguments as on the command line."""
    from aerotri.public.surface_comparison import RECORD, compare

    for name, value, known in (("method", method, INTERPOLATIONS), ("align", align, ALIGNMENTS)):
        if value not in known:
            raise InputError(f"--{name} '{value}' is not known", f"choose one of {', '.join(known)}")
    console = Console(quiet=as_json)
    target = out or Path(f"{real_path(test).stem}_comparison")
    refuse_foreign_folder(target, RECORD)
    found = compare(test, control, method=method, align=align, cell=cell, project=project, progress=console.stage)
    for note in found.notes:
        console.note(note)
    found.save(target, plots)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines([*_summary(found), f"Written to {target}"])


def _summary(found: SurfaceComparison) -> list[str]:
    from aerotri.report.quality import two_digits

    c = found.record
    s = c.statistics
    lines = [
        f"{s.count} cells of {c.grid.cell_x:g} m compared, "
        f"{100 * c.coverage:.1f} % of the cells of the control surface; {found.method}",
        f"bias {s.bias:+.3f} m, median {s.median:+.3f}, RMSE {s.rmse:.3f}, σ {s.std:.3f}, NMAD {s.nmad:.3f}, "
        f"LE90 {s.le90:.3f}, largest {s.max:.3f} m",
    ]
    if found.bias_sigma is not None:
        shared = found.matching_shared
        part = f" ({two_digits(1e3 * shared)} mm by errors that neighbouring cells share)" if shared > 0.0 else ""
        lines.append(
            f"σ of the bias {two_digits(1e3 * found.bias_sigma)} mm{part}; noise length {found.noise_length:.2g} m"
        )
    return [*lines, *([c.alignment_text] if c.alignment_text else [])]
