"""`aerotri predict picket-interval`: how far apart pickets should be."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.formats.results.json_text import json_text


@dataclass(frozen=True)
class IntervalQuestion:
    """As on the command line: scan and scale, or the GSD, or a result with photographs for a pilot."""

    scan_um: float | None = None
    scale: float | None = None
    gsd: float | None = None
    k: float | None = None
    pilot: Path | None = None
    photographs: tuple[Path, ...] = ()
    area: tuple[float, float, float, float] | None = None
    tolerance: float | None = None


def run_predict_interval(question: IntervalQuestion, as_json: bool) -> None:
    """Answer and print.

    Raises
    ------
    InputError
    """
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.picket_interval import stated_gsd
    from aerotri.public.predict import picket_interval

    q, console = question, Console(quiet=as_json)
    stated_gsd(q.scan_um, q.scale, q.gsd, q.pilot is not None, bool(q.photographs))
    pilot = None if q.pilot is None else Adjustment(reopened(q.pilot, console))
    found = picket_interval(
        scan_um=q.scan_um, scale=q.scale, gsd=q.gsd, k=q.k, pilot=pilot, photographs=q.photographs, area=q.area,
        tolerance=q.tolerance, progress=console.stage,
    )  # fmt: skip
    content = found.summary
    console.lines([json_text(content)] if as_json else _summary(content))


def _summary(content: dict[str, Any]) -> list[str]:
    c = content
    lines = [f"GSD {c['gsd_m']:.3f} m"]
    for name, (low, high) in c["interval_m"].items():
        span = f"{low:.1f} m" if low == high else f"{low:.1f} … {high:.1f} m"
        lines.append(f"{name}: pickets every {span} (Tran 2007, k·√(P·Ma))")
    lines.append(f"older rule, 30 times the GSD: {c['older_rule_m']:.1f} m")
    if "pilot" in c:
        p = c["pilot"]
        lines.append(f"{'interval':>10}{'RMSE':>9}{'pickets':>9}{'errors':>8}")
        for t in p["tried"]:
            rmse = "–" if t["rmse_m"] is None else f"{t['rmse_m']:.3f} m"
            lines.append(f"{t['interval_m']:>8.1f} m{rmse:>9}{t['pickets']:>9}{t['errors']:>8}")
        why = "σ of a picket" if p["tolerance_m"] is None else "tolerance"
        limit = p["sigma_of_a_picket_m"] if p["tolerance_m"] is None else p["tolerance_m"]
        lines.append(f"pilot: pickets every {p['interval_m']:.1f} m (RMSE = {why}, {limit:.3f} m), k {p['k']:.3f}")
    return lines
