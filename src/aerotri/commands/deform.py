"""`aerotri deform`: what the image errors of a self-calibrated block do to its stereo models."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError, real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder


@dataclass(frozen=True)
class DeformOptions:
    """What to compute, as on the command line; the whole block where nothing else is chosen."""

    pair: tuple[str, str] | None = None
    end_lap: float | None = None
    block: bool = False
    step: int = 1
    variant: Any = "free"
    dem: Path | None = None
    spacing: float | None = None
    gsd: float | None = None
    group: str | None = None

    def check(self) -> None:
        """Refuse what does not go together, in the words of the command line.

        Raises
        ------
        InputError
        """
        chosen = [name for name, given in (("--pair", self.pair), ("--end-lap", self.end_lap), ("--block", self.block))
                  if given not in (None, False)]  # fmt: skip
        if len(chosen) > 1:
            raise InputError(f"{' and '.join(chosen)} are both given", "choose one of them")
        if self.end_lap is not None and self.dem is not None:
            raise InputError("a model at a stated end lap has flat ground", "give --dem with --pair or --block")
        if self.end_lap is None and (self.gsd is not None or self.group is not None):
            raise InputError("--gsd and --group belong to --end-lap", "leave them out")


def run_deform(source: Path, options: DeformOptions, out: Path | None, plots: bool, as_json: bool) -> int:
    """Exit code of the command; arguments as on the command line."""
    from aerotri.deformation.absorbed import AbsorptionFailedError
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.models import RECORD, deform

    console = Console(quiet=as_json)
    o = options
    o.check()
    target = out or Path(f"{real_path(source).name.removesuffix('_result')}_deformation")
    refuse_foreign_folder(target, RECORD)
    try:
        result = Adjustment(reopened(source, console))
        found = deform(
            result, pair=o.pair, end_lap=o.end_lap, step=o.step, variant=o.variant, dem=o.dem, spacing=o.spacing,
            gsd=o.gsd, group=o.group, progress=console.stage,
        )  # fmt: skip
    except AbsorptionFailedError as failure:
        console.failure(str(failure))
        return 1
    for note in found.notes:
        console.note(note)
    found.save(target, plots)
    content = found.summary
    if as_json:
        print(json_text(content))
    else:
        console.lines([*_summary(content), f"Written to {target}"])
    return 0


def _summary(content: dict[str, Any]) -> list[str]:
    from aerotri.deformation.restitution import ORIENTED
    from aerotri.report.quality import printable

    c = content
    lines = [f"{printable(c['title'])}, {ORIENTED[c['variant']]}, {c['nodes']} nodes every {c['spacing_m']:g} m"]
    if "h_over_b" in c:
        lines.append(
            f"end lap {100 * c['end_lap']:.1f} %, h/b {c['h_over_b']:.2f}, base {c['base_mm']:.2f} mm, GSD "
            f"{c['gsd_m']:.3f} m, 1 µm of x-parallax {c['cm_per_um']:.2f} cm"
        )
    for axis in ("dX", "dY", "dZ"):
        s = c[axis]
        known = s["rms"] is not None
        size = (
            f"{s['min']:+.3f} … {s['max']:+.3f} m, mean {s['mean']:+.3f}, RMS {s['rms']:.3f}" if known else "not known"
        )
        lines.append(f"{axis}  {size}")
    s = c["sigma_dZ"]
    if s["mean"] is None:
        lines.append("σ of dZ  not known: the block has no redundancy")
    else:
        lines.append(f"σ of dZ  {s['min']:.4f} … {s['max']:.4f} m, mean {s['mean']:.4f}: {c['sigma_includes']}")
    if "seams" in c and c["seams"]["count"]:
        seams = c["seams"]
        lines.append(f"steps between neighbouring models: RMS {seams['rms']:.3f} m at {seams['count']} seams; worst:")
        for seam in seams["worst"][:5]:
            first, second = (printable(", ".join(seam[key])) for key in ("first", "second"))
            step = f"RMS {seam['rms']:.3f} m, mean {seam['mean']:+.3f}, {seam['nodes']} nodes"
            lines.append(f"  {first} | {second}: {step}")
    return lines
