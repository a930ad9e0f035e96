"""`aerotri plan`: a flight over an area, its accuracy, and the control it needs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerotri.commands.console import Console, written
from aerotri.conventions import real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder


def run_plan(area: str, out: Path | None, asked: dict[str, Any], as_json: bool) -> None:
    """Plan and write; `asked` as of `aerotri.plan_flight`."""
    from aerotri.public.planning import RECORD, plan_flight

    console = Console(quiet=as_json)
    is_text = area.lstrip().upper().startswith(("POLYGON", "MULTIPOLYGON", "SRID="))
    target = out or Path("plan" if is_text else f"{real_path(Path(area)).stem}_plan")
    refuse_foreign_folder(target, RECORD)
    found = plan_flight(area, **asked)
    found.save(target)
    if as_json:
        print(json_text(found.summary))
        return
    console.lines([*plan_lines(found.summary), written(target, "plan.html")])


def plan_lines(c: dict[str, Any]) -> list[str]:
    """The plan in short."""
    f, a = c["flight"], c["accuracy"]
    lines = [
        f"{f['photographs']} photographs in {f['strips']} strips, {f['length_m'] / 1000.0:.2f} km, "
        f"{f['time_s'] / 60.0:.0f} minutes",
        f"GSD {100.0 * f['gsd_m'][0]:.2f} to {100.0 * f['gsd_m'][1]:.2f} cm; overlap at least "
        f"{100.0 * f['forward_overlap']:.0f} % forward, {100.0 * f['side_overlap']:.0f} % sideways; every place in "
        f"{f['least_rays']} photographs or more",
        f"expected error: in plan {a['rmse_h_m']:.3f} m, in height {a['rmse_v_m']:.3f} m; σ of Z on 95 % of the area "
        f"at most {a['sigma_z_95_m']:.3f} m; σ of the volume {a['sigma_volume_m3']:.3g} m³",
        f"{len(c['control'])} control points",
    ]
    if c["target"] is not None:
        t = c["target"]
        lines.append(
            f"target {t['kind']} {t['value']:g} {t['unit']}: {'met' if t['met'] else 'NOT met'} "
            f"({t['predicted']:.3g} {t['unit']})"
        )
    lines += [
        f"pile {one['name']}: σ of the volume {one['sigma_m3']:.3g} m³ on {one['area_m2']:.4g} m²" for one in c["piles"]
    ]
    return [*lines, *(f"note: {text}" for text in c["warnings"])]
