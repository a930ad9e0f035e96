"""`aerotri parameters`: the sets of additional parameters, in words and in pictures."""

from __future__ import annotations

import json
from pathlib import Path

from aerotri.conventions import InputError

MOST = 16
"""Parameters of a family listed when all families are."""


def run_parameters(draw: Path | None, family: str | None, as_json: bool) -> None:
    """List the sets, or draw their patterns; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.functional_model.additional_parameters import FAMILIES, describe

    if family is not None and family not in FAMILIES:
        raise InputError(f"unknown parameter family '{family}'", f"known are {', '.join(FAMILIES)}")
    entries = [d for d in describe() if family in (None, d.family)]
    drawn = [] if draw is None else _draw(draw, family)
    if as_json:
        print(json.dumps([vars(d) for d in entries], ensure_ascii=False, indent=2))
        return
    for name in dict.fromkeys(d.family for d in entries):
        own = [d for d in entries if d.family == name]
        print(f"{name}: {len(own)} parameters. {own[0].reference}")
        for d in own[:MOST] if family is None else own:
            print(f"  {d.item:<12} [{d.mark}] {d.text}")
        if family is None and len(own) > MOST:
            print(f"  … {len(own) - MOST} more: aerotri parameters --family {name}")
    if draw is not None:
        print(f"Drawn to {draw}: {', '.join(drawn)}")


def _draw(folder: Path, family: str | None) -> list[str]:
    from aerotri.functional_model.additional_parameters import FAMILIES
    from aerotri.report.plots import save_plots
    from aerotri.report.plots_parameters import plot_pattern_sheets
    from aerotri.simulation.cameras import block_camera
    from aerotri.simulation.spec import CameraSpec

    drawn = []
    for name, own in FAMILIES.items():
        if family in (None, name):
            model = own.camera_model or "ultracam_d"
            camera = block_camera(model, CameraSpec.model_validate({"preset": model}))
            sheets = plot_pattern_sheets(name, camera)
            save_plots({f"{name}_{k}" if k else name: sheet for k, sheet in enumerate(sheets)}, folder)
            drawn.append(name)
    return drawn
