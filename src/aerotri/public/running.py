"""Everything from photographs, or a block, to terrain and volume: one folder, one report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from aerotri.conventions import FilePath, real_path
from aerotri.execution.choice import THREADS, chosen
from aerotri.execution.opening import opened
from aerotri.public.blocks import Axes, Sigmas
from aerotri.public.folders import refuse_no_folder
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.run_chain import OnStep, RunChain
from aerotri.public.run_project import Project
from aerotri.public.run_steps import (
    BLOCK,
    Verb,
    is_block,
    is_missing,
    steps_of,
)
from aerotri.tie_points.settings import DEFAULTS
from aerotri.volume.settings import RUN_LAYER, SIGMA, BoundaryFrom, Layer

if TYPE_CHECKING:
    pass

Unmarked = Literal["stop", "continue"]
EDITS = "edits.csv"
MARKED_SINCE = "the block of an earlier run was marked since: it is taken up as it is"


def run(
    source: FilePath,
    out: FilePath | None = None,
    *,
    control: FilePath | None = None,
    check: Sequence[str] = (),
    control_sigma_m: Sigmas | None = None,
    control_prefix: str = "",
    axes: Axes | None = None,
    columns: str = "",
    positions: FilePath | None = None,
    time_stamps: FilePath | None = None,
    camera: FilePath | None = None,
    focal_length_mm: float | None = None,
    pixel_um: float | None = None,
    crs: str = "",
    geoid: FilePath | None = None,
    seed: int = DEFAULTS.seed,
    parameters: str | None = None,
    interval: float | None = None,
    boundary: Any = None,
    base: Any = None,
    layer: Layer = RUN_LAYER,
    boundary_from: BoundaryFrom = SIGMA.boundary_from,
    boundary_sigma: float = SIGMA.boundary_sigma,
    density: float | None = None,
    density_sigma: float = 0.0,
    dense: bool = True,
    resolution: float | None = None,
    plots: bool = True,
    go_on: bool = False,
    unmarked: Unmarked | None = None,
    further: Mapping[Verb, Mapping[str, Any]] | None = None,
    executor: str = THREADS,
    project: FilePath | None = None,
    on_step: OnStep | None = None,
    progress: ProgressLike = None,
) -> Project:
    """Everything: photographs to tie points, adjustment, terrain, volume, surface and orthophoto, with one report.

    Parameters
    ----------
    source : folder of photographs, or a block, which is adjusted alone.
    out : folder to write, with a folder a step; NAME_project in the current folder where None.
    control : control points with their image points, gcp_list.txt.
    check : names of control points that become check points.
    control_sigma_m : σ of X, Y, Z, m, of control points without one; 0: without error, held.
    control_prefix : what image points have before the names of control points.
    axes : 'yx' where lists that do not name their columns have Y, or the latitude, first; as their coordinate
        system has them where None. Lists with an order of their own: X and Y change places, of the control points
        alone where there are any.
    columns : of such a list of control points (of positions where there are none): letters such as 'PNEZD', or names
        separated by commas.
    positions : of the photographs, in place of EXIF; or a trajectory, or time stamps, see `aerotri.tie_points`.
    time_stamps : when the photographs were taken, where `positions` is a trajectory: file .MRK of the drone, or a
        folder of them; those beside the photographs where None.
    camera : file with the camera.
    focal_length_mm : in place of EXIF.
    pixel_um : size of a pixel, µm, in place of EXIF.
    crs : coordinate system; that of the control where '', else UTM of EXIF.
    geoid : grid of geoid undulations for its heights.
    seed : the same seed gives the same result.
    parameters : additional parameters of the adjustment, see `aerotri.adjust`; those of the block where None, of
        photographs 'auto'.
    interval : m between the points of the terrain (pickets); from the GSD and the relief where None.
    boundary : of a volume, see `aerotri.volume`; no volume where None. It is measured on the terrain and, if `dense`,
        on the dense surface too.
    base : of the volume, see `aerotri.volume`.
    layer : surface of the terrain that `volume` is measured on: 'dtm', within the boundary all that was measured,
        beside it the ground without objects; or 'dsm', with objects everywhere. `dense_volume` is measured on the
        dense surface, with objects.
    boundary_from : 'survey', where the boundary is known in space, or 'product', where it was drawn on the surface or
        the orthophoto of this run, see `aerotri.volume`.
    boundary_sigma : m, σ of either coordinate of a corner of the boundary.
    density : t/m³, of all that is inside the boundary: gives tonnes.
    density_sigma : t/m³, its σ, common to all piles.
    dense : the dense surface, the orthophoto and, with a boundary, the volume on the dense surface as well.
    resolution : m, cell of the dense surface; two pixels on the ground where None.
    plots : draw the plots of the adjustment.
    go_on : go on after an adjustment that was rejected, and where the control points or positions do not fit the
        photographs.
    unmarked : where control points are marked in no photograph, 'stop' after the tie points, or 'continue', as where
        None. A block of an earlier run in `out` that was marked since is taken up, unless 'stop' is given.
    further : more settings of a step by the name of its verb, {'terrain': {'window': 21}}.
    executor : where tie points, terrain, dense surface and orthophoto are made: 'threads', 'processes:N',
        'dask:ADDRESS' or 'dask:local:N'.
    project : of photographs: block, result or TOML file whose [project] stands at the head of all pages.
    on_step : takes each step when it begins, with None, and when it ended, with what it gave or why it failed.
    progress : see `aerotri.adjust`.

    Returns
    -------
    Project
        Look at its `verdict` first. A step that fails is told there; nothing is built on it.

    Raises
    ------
    InputError
        When there is nothing to begin with, or the first step refuses its input.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     block = aerotri.simulate(aerotri.example_flight(), seed=1).save(f"{place}/block")
    ...     project = aerotri.run(block, f"{place}/project", parameters="none", plots=False)
    >>> project.verdict, [step.status for step in project.steps]
    ('accepted', ['done', 'done', 'left out', 'left out', 'left out', 'left out'])
    """
    marked, names = not is_missing(control), {"check": tuple(check)}
    from_block = is_block(Path(source))
    elsewhere = None if chosen(executor).kind == "threads" else executor
    said = ("boundary_from", boundary_from, SIGMA.boundary_from), ("boundary_sigma", boundary_sigma, 0.0)
    of_mass = ("density", density, None), ("density_sigma", density_sigma, 0.0)
    sure = {name: value for name, value, usual in (*said, *of_mass) if value != usual}
    settings: dict[Verb, dict[str, Any]] = {
        "tie_points": {
            "control": control, "control_sigma_m": control_sigma_m, "control_prefix": control_prefix if marked else "",
            "axes": axes, "columns": columns,
            "positions": positions, "time_stamps": time_stamps, "camera": camera,
            "focal_length_mm": focal_length_mm, "pixel_um": pixel_um,
            "crs": crs, "geoid": geoid, "seed": seed, "executor": elsewhere, "project": project,
            **({} if from_block else names),
        },
        "adjust": {
            "parameters": parameters or (None if from_block else "auto"), "geoid": geoid,
            "control_prefix": "" if marked else control_prefix,
            "plots": plots, **(names if from_block else {}),
        },
        "terrain": {"interval": interval, "ground_within": boundary, "executor": elsewhere},
        "volume": {} if is_missing(boundary) else {"boundary": boundary, "base": base, "layer": layer, **sure},
        "dense": {"resolution": resolution, "executor": elsewhere},
        "orthophoto": {"executor": elsewhere}, "accuracy": {},
    }  # fmt: skip
    for verb, more in (further or {}).items():
        settings[verb] = {**settings.get(verb, {}), **more}
    # of a dense surface there is the one with objects alone
    of_dense = {name: value for name, value in settings["volume"].items() if name != "layer"}
    settings["dense_volume"] = of_dense | settings.get("dense_volume", {})
    place = Path(source)
    target = Path(f"{real_path(place).name}_project" if out is None else out)
    refuse_no_folder(target)
    with stage_report(progress) as report:
        steps = steps_of(place, target, settings, dense)
        if chosen(executor).address:
            with opened(executor, report.said):
                pass  # a scheduler that does not answer is told now, not after hours
        if unmarked != "stop" and not from_block and (target / BLOCK / EDITS).is_file():
            steps["tie_points"] = replace(steps["tie_points"], status="left out", reason=MARKED_SINCE)
        begun = Project(target, place)
        return RunChain(begun, steps, settings, go_on, on_step, report, unmarked == "stop").run()
