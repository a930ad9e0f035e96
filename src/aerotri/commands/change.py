"""`aerotri change`: what changed between two surfaces, against its σ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console, written
from aerotri.conventions import real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.volume.change.alignment import Align


def run_change(
    first: Path, second: Path, stable: str | None, align: Align, area: str | None, noise_length: float | None,
    adjustments: tuple[Path | None, Path | None], project: Path | None, out: Path | None, plots: bool, as_json: bool,
) -> None:  # fmt: skip
    """Measure and write; arguments as on the command line."""
    from aerotri.compiled import compilation_notice
    from aerotri.public.change import RECORD, change

    console = Console(quiet=as_json)
    target = out or Path(f"{real_path(second).stem}_change")
    refuse_foreign_folder(target, RECORD)
    console.stage(compilation_notice() or "comparing", None)
    found = change(
        first, second, stable=stable, align=align, area=area, noise_length=noise_length,
        first_adjustment=adjustments[0], second_adjustment=adjustments[1], project=project,
    )  # fmt: skip
    found.save(target, plots)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines([*_summary(found.summary), written(target, "change.html")])


def run_cloud_change(
    first: Path, second: Path, sizes: dict[str, float | None], stable: str | None,
    adjustments: tuple[Path | None, Path | None], project: Path | None, out: Path | None, plots: bool, as_json: bool,
) -> None:  # fmt: skip
    """The same of point clouds; `sizes` as of `aerotri.cloud_change`."""
    from aerotri.public.cloud_change import RECORD, cloud_change

    console = Console(quiet=as_json)
    target = out or Path(f"{real_path(second).stem}_change")
    refuse_foreign_folder(target, RECORD)
    found = cloud_change(
        first, second, stable=stable, first_adjustment=adjustments[0], second_adjustment=adjustments[1],
        project=project, **sizes,
    )  # fmt: skip
    found.save(target, plots)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines([*_cloud_summary(found.summary), written(target, "change.html")])


SIGMA_FROM = {
    "adjustments": "both adjustments and the noise of the points", "points": "the σ of the points",
    "scatter": "the scatter of the points",
}  # fmt: skip


def _cloud_summary(c: dict[str, Any]) -> list[str]:
    lines = [
        f"{c['with_distance']} of {c['core_points']} places every {c['spacing_m']:.3g} m have a distance; cylinders of "
        f"{c['cylinder_m']:.3g} m, normals from {c['normal_m']:.3g} m, at most {c['reach_m']:.3g} m away",
        f"σ of a distance (from {SIGMA_FROM[c['sigma_from']]}): median {c['sigma_m']:.3f} m; registration "
        f"error (position of one cloud relative to the other) {c['registration_m']:.3f} m",
        f"level of detection (95 %) {c['level_of_detection_m']:.3f} m in the median, {c['beyond_level_percent']:.1f} % "
        "of the places beyond it",
    ]
    if c["stable"] is not None:
        stable = c["stable"]
        lines.append(f"stable ground: {stable['core_points']} places, mean distance {stable['mean_m']:+.3f} m")
    return [*lines, *(f"note: {text}" for text in c["warnings"])]


def _summary(c: dict[str, Any]) -> list[str]:
    lines = [
        f"{c['cells']} cells of {c['cell_m']:.3g} m; level of detection (95 %) {c['level_of_detection_m']:.3f} m in "
        f"the median, {c['beyond_level_percent']:.1f} % of the cells beyond it"
    ]
    for v in c["volumes"]:
        lines.append(f"{v['name']}: {', '.join(_amount(v, of) for of in ('gained', 'lost', 'net'))} (1 σ)")
    if c["alignment"] is not None:
        moved = ", ".join(f"{u['name']} {u['value']:+.3g} ± {u['sigma']:.2g}" for u in c["alignment"]["unknowns"])
        lines.append(f"aligned on {c['alignment']['cells_used']} stable cells: {moved or 'nothing moved'}")
    return [*lines, *(f"note: {text}" for text in c["warnings"])]


def _amount(volume: dict[str, Any], of: str) -> str:
    """Without σ where no cell is beyond the level of detection: of nothing there is none."""
    from aerotri.formats.results.change import at_most
    from aerotri.report.quality import with_sigma

    value, sigma, least = volume[f"{of}_m3"], volume[f"sigma_{of}_m3"], at_most(volume, of)
    if least is not None:
        return f"{of} less than {least:g} m³"
    if value == 0.0 and sigma == 0.0:
        return f"nothing {of} beyond the level of detection"
    return f"{of} {with_sigma(value, sigma)} m³"
