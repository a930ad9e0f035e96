"""`aerotri tiepoints`: a folder of photographs becomes a block."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from aerotri.commands.console import Console
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.results.json_text import json_text
from aerotri.tie_points.settings import DEFAULTS

if TYPE_CHECKING:
    from aerotri.formats.assembly.imported import ImportRecord

HEADING = "control point"
MOST_LINES = 40
"""Control points that are printed; all of them stand in tiepoints.json."""


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
    time_stamps: str = ""


def run_tiepoints(folder: Path, out: Path, options: TiePointOptions, as_json: bool, overwrite: bool = False) -> int:
    """Tie and write; arguments as on the command line. Exit code: 1 where the block has no place that can be trusted.

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
            time_stamps=o.time_stamps or None,
            orientation=o.orientation or None, camera=o.camera.file, focal_length_mm=o.camera.focal_length_mm,
            pixel_um=o.camera.pixel_um, free_interior=o.camera.free, crs=stated.crs, geoid=stated.geoid,
            control_sigma_m=stated.control_sigma_m, control_prefix=stated.control_prefix,
            axes=cast(Any, stated.axes), columns=stated.columns,
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
        console.lines(outcome_lines(content, out, tied.imported))
    if tied.misplaced:
        console.failure(tied.misplaced)
    return 1 if tied.misplaced else 0


def outcome_lines(content: dict[str, Any], out: Path, imported: ImportRecord) -> list[str]:
    """What the user reads of the block, of its import, and of the page to mark control points in."""
    pairs, per = content["pairs"], content["points_per_photograph"]
    said = [
        *imported.remarks,
        *imported.lines(),
        *placement_lines(content["placement"]),
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


def placement_lines(placement: dict[str, Any] | None) -> list[str]:
    """A table of the control points that gave the block its place; none of positions, which are many."""
    from aerotri.tie_points.placed import CONTROL

    if placement is None or placement["by"] != CONTROL:
        return []
    points = placement["points"]
    width = max(len(HEADING), *(len(point["name"]) for point in points[:MOST_LINES]))
    heading = f"{HEADING:{width}} {'dX m':>9} {'dY m':>9} {'dZ m':>9} {'misfit':>9}  used"
    more = [f"and {len(points) - MOST_LINES} more, see tiepoints.json"] if len(points) > MOST_LINES else []
    return [heading, *(_row(point, width) for point in points[:MOST_LINES]), *more]


def _row(point: dict[str, Any], width: int) -> str:
    from aerotri.report.quality import printable
    from aerotri.tie_points.georeferencing import AGREES

    name = f"{printable(point['name']):{width}}"
    if point["reason"]:
        return f"{name} {'':39}  no: {point['reason']}"
    offsets = " ".join(f"{value:9.3f}" for value in point["offset_m"])
    used = "yes" if point["used"] else f"no: more than {AGREES:g} σ"
    return f"{name} {offsets} {point['misfit_sigma']:7.1f} σ  {used}"
