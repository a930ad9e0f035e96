"""`aerotri tiepoints`: a folder of photographs becomes a block."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aerotri.commands.console import Console
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.results.json_text import json_text
from aerotri.tie_points.settings import DEFAULTS


@dataclass(frozen=True)
class TiePointOptions:
    """The options of the command line, under their names there."""

    gcp: str = ""
    check: tuple[str, ...] = ()
    positions: str = ""
    orientation: str = ""
    camera: CameraSpec = field(default_factory=CameraSpec)
    stated: Statements = field(default_factory=Statements)
    mark_sigma_px: float = DEFAULTS.mark_sigma_px
    points: int = DEFAULTS.points
    features: int = DEFAULTS.features
    feature_size_px: int = DEFAULTS.feature_size
    neighbours: int = DEFAULTS.neighbours
    seed: int = DEFAULTS.seed
    executor: str = THREADS
    project: Path | None = None


def run_tiepoints(folder: Path, out: Path, options: TiePointOptions, as_json: bool, overwrite: bool = False) -> None:
    """Tie and write; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.work_place import held
    from aerotri.public.tying import refuse_other_content, tie_points
    from aerotri.tie_points.photographs_to_block import CACHE

    console, o, stated = Console(quiet=as_json), options, options.stated
    chosen(o.executor)
    refuse_other_content(out, overwrite)
    with held(out):
        tied = tie_points(
            folder, control=o.gcp or None, check=o.check, positions=o.positions or None,
            orientation=o.orientation or None, camera=o.camera.file, focal_length_mm=o.camera.focal_length_mm,
            pixel_um=o.camera.pixel_um, free_interior=o.camera.free, crs=stated.crs, geoid=stated.geoid,
            control_sigma_m=stated.control_sigma_m, control_prefix=stated.control_prefix,
            mark_sigma_px=o.mark_sigma_px, positions_sigma_m=stated.positions_sigma_m,
            orientation_sigma_m=stated.orientation_sigma_m, orientation_sigma_deg=stated.orientation_sigma_deg,
            points=o.points, features=o.features, feature_size=o.feature_size_px, neighbours=o.neighbours, seed=o.seed,
            project=o.project, cache=out / CACHE, executor=o.executor, progress=console.stage,
        )  # fmt: skip
        tied.save(out, overwrite=overwrite, progress=console.stage)
    content = tied.summary(out)
    if as_json:
        print(json_text(content, None))
    else:
        console.lines(outcome_lines(content, out))


def outcome_lines(content: dict[str, Any], out: Path) -> list[str]:
    """What the user reads of the block and of the page to mark control points in."""
    pairs, per = content["pairs"], content["points_per_photograph"]
    said = [
        *content["messages"],
        f"{content['photographs']} photographs in {content['crs']}, {pairs['tied']} of {pairs['compared']} pairs tied: "
        f"{content['tie_points']} tie points with {content['rays_per_point']:.1f} rays, "
        f"{per['median']:.0f} in a photograph ({per['smallest']} at least)",
        f"{content['control']} control and {content['check']} check points; first orientation fits to "
        f"{content['median_residual_px']:.2f} px (median); {content['seconds']:.0f} s",
    ]
    if content["marking_page"]:
        bench = f"aerotri view {shlex.quote(str(out))} --photos PHOTOS"
        said.append(f"control points are marked on the bench ({bench}), or in {content['marking_page']}")
    if content["left_out"]:
        said.append(f"could not be tied and left out: {', '.join(content['left_out'])}")
    return [*said, f"Written to {out}"]
