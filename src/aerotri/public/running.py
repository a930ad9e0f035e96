"""Everything from photographs, or a block, to terrain and volume: one folder, one report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from aerotri.conventions import FilePath, InputError
from aerotri.deformation.absorbed import AbsorptionFailedError
from aerotri.execution.choice import THREADS, chosen
from aerotri.execution.opening import opened
from aerotri.execution.work import TasksFailedError
from aerotri.formats.results.json_text import write_json
from aerotri.public.blocks import Sigmas
from aerotri.public.folders import refuse_no_folder
from aerotri.public.progress import Progress, ProgressLike, StageReport, stage_report
from aerotri.public.run_steps import (
    BLOCK,
    BUILT_ON,
    DSM,
    DTM,
    NO_CHECK_POINTS,
    RECORD,
    REPORT,
    RESULT,
    Step,
    Verb,
    is_block,
    is_missing,
    steps_of,
)
from aerotri.results.failure import AdjustmentFailedError
from aerotri.results.head import Head, now
from aerotri.tie_points.settings import DEFAULTS
from aerotri.volume.settings import RUN_LAYER, SIGMA, BoundaryFrom, Layer

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.public.accuracy import Accuracy
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.dense import DenseSurface
    from aerotri.public.ortho import Orthophoto
    from aerotri.public.terrain import TerrainModel
    from aerotri.public.tying import TiedPhotographs
    from aerotri.public.volume_result import MeasuredVolume

OnStep = Callable[[Step, object], None]
Unmarked = Literal["stop", "continue"]
EDITS = "edits.csv"
NOT_MARKED = "found control points that are marked in no photograph"
MARKED_SINCE = "the block of an earlier run was marked since: it is taken up as it is"


@dataclass(eq=False, repr=False)
class Project:
    """What `aerotri.run` made: the results of its steps, None for those that were left out or failed.

    Parameters
    ----------
    folder : where everything was written.
    source : what it began with.
    steps : each with how it ended.
    tied : the photographs tied. adjustment : also where it was rejected. surface : the terrain. volume : over it.
    dense : the surface of all that stands on the ground. orthophoto : over it.
    accuracy : by the check points, None without them.
    seconds : that it took. computed : when it began.
    unmarked : control points that are marked in no photograph, where the run stopped for them.
    """

    folder: Path
    source: Path
    steps: list[Step] = field(default_factory=list)
    tied: TiedPhotographs | None = None
    adjustment: Adjustment | None = None
    surface: TerrainModel | None = None
    volume: MeasuredVolume | None = None
    dense: DenseSurface | None = None
    orthophoto: Orthophoto | None = None
    accuracy: Accuracy | None = None
    seconds: float = 0.0
    computed: datetime = field(default_factory=now)
    unmarked: tuple[str, ...] = ()

    @property
    def block(self) -> Block | None:
        """The block as it was adjusted; that of the tie points where it was not."""
        if self.adjustment is not None:
            return self.adjustment.block
        return None if self.tied is None else self.tied.block

    @property
    def verdict(self) -> str:
        """'accepted', 'doubtful' or 'rejected' by the adjustment; 'failed' where there is none."""
        return "failed" if self.adjustment is None else self.adjustment.verdict

    @property
    def complete(self) -> bool:
        """Whether no step failed."""
        return not any(step.status == "failed" for step in self.steps)

    @property
    def report(self) -> Path:
        """The page about all steps."""
        return self.folder / REPORT

    @property
    def head(self) -> Head:
        """Of page and file: the block's."""
        block = self.block
        return Head(computed=self.computed) if block is None else Head(block.project, block.crs, self.computed)

    @property
    def summary(self) -> dict[str, Any]:
        """The content of run.json."""
        return {**self.head.as_dict(), "source": str(self.source), "steps": [asdict(step) for step in self.steps],
                "seconds": round(self.seconds, 1), "report": str(self.report)}  # fmt: skip

    def __repr__(self) -> str:
        done = ", ".join(f"{step.what.lower()} {step.status}" for step in self.steps)
        return f"<aerotri.Project in '{self.folder}': {self.verdict}; {done}>"

    def _repr_html_(self) -> str:
        """The steps, and what the adjustment found, as a notebook shows them."""
        rows = "".join(
            f"<tr><td>{escape(step.what)}</td><td>{escape(step.status)}</td><td>{step.seconds:.0f} s</td>"
            f"<td>{escape(step.reason or str(self.folder / step.folder))}</td></tr>"
            for step in self.steps
        )
        made = (self.adjustment, self.surface, self.volume, self.dense, self.orthophoto)
        shown = [one.html() for one in made if one is not None]
        return f"<div><table><caption>{escape(self.verdict)}</caption>{rows}</table>{''.join(shown)}</div>"


def run(
    source: FilePath,
    out: FilePath | None = None,
    *,
    control: FilePath | None = None,
    check: Sequence[str] = (),
    control_sigma_m: Sigmas | None = None,
    control_prefix: str = "",
    positions: FilePath | None = None,
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
    positions : of the photographs, in place of EXIF.
    camera : file with the camera.
    focal_length_mm : in place of EXIF.
    pixel_um : size of a pixel, µm, in place of EXIF.
    crs : coordinate system; that of the control where '', else UTM of EXIF.
    geoid : grid of geoid undulations for its heights.
    seed : the same seed gives the same result.
    parameters : additional parameters of the adjustment, see `aerotri.adjust`; those of the block where None, of
        photographs 'auto'.
    interval : m between the points of the terrain (pickets); from the GSD and the relief where None.
    boundary : of a volume, see `aerotri.volume`; no volume where None.
    base : of the volume, see `aerotri.volume`.
    layer : surface of the volume: 'dtm', within the boundary all that was measured, beside it the ground without
        objects; or 'dsm', with objects everywhere.
    boundary_from : 'survey', where the boundary is known in space, or 'product', where it was drawn on the surface or
        the orthophoto of this run, see `aerotri.volume`.
    boundary_sigma : m, σ of either coordinate of a corner of the boundary.
    density : t/m³, of all that is inside the boundary: gives tonnes.
    density_sigma : t/m³, its σ, common to all piles.
    dense : the dense surface and the orthophoto as well.
    plots : draw the plots of the adjustment.
    go_on : go on after an adjustment that was rejected.
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
            "positions": positions, "camera": camera, "focal_length_mm": focal_length_mm, "pixel_um": pixel_um,
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
        "dense": {"executor": elsewhere}, "orthophoto": {"executor": elsewhere}, "accuracy": {},
    }  # fmt: skip
    for verb, more in (further or {}).items():
        settings[verb] |= more
    place = Path(source)
    target = Path(f"{place.resolve().name}_project" if out is None else out)
    refuse_no_folder(target)
    with stage_report(progress) as report:
        steps = steps_of(place, target, settings, dense)
        if chosen(executor).address:
            with opened(executor, report.said):
                pass  # a scheduler that does not answer is told now, not after hours
        if unmarked != "stop" and not from_block and (target / BLOCK / EDITS).is_file():
            steps["tie_points"] = replace(steps["tie_points"], status="left out", reason=MARKED_SINCE)
        begun = Project(target, place)
        return _Chain(begun, steps, settings, go_on, on_step, report, unmarked == "stop").run()


class _Chain:
    """The steps one after another, each on what those before it gave.

    Parameters
    ----------
    project : to be filled. steps : what there is to do. settings : of every verb.
    stop : whether to stop where control points are marked nowhere.
    """

    def __init__(
        self, project: Project, steps: Mapping[Verb, Step], settings: Mapping[Verb, Mapping[str, Any]], go_on: bool,
        on_step: OnStep | None, report: StageReport, stop: bool = False,
    ):  # fmt: skip
        self._stop = stop
        self._project, self._steps, self._settings, self._go_on = project, steps, settings, go_on
        self._tell: OnStep = on_step or (lambda step, outcome: None)
        self._progress: Progress = report.stage

    def run(self) -> Project:
        """The project, with its record and its report written."""
        project, begun = self._project, time.perf_counter()
        missing: dict[Verb, str] = {}
        for verb, step in self._steps.items():
            ending = missing.get(BUILT_ON.get(verb, verb), "")
            if not step.status and ending:
                step = replace(step, status="left out", reason=ending)
            if not step.status and verb == "accuracy" and not self._has_check_points():
                step = replace(step, status="left out", reason=NO_CHECK_POINTS)
            if not step.status:
                step, ending = self._done(verb, step)
            if ending:
                missing[verb] = ending
            project.steps.append(step)
        project.seconds = time.perf_counter() - begun
        write_report(project.summary, project.folder, project.head)
        return project

    def _done(self, verb: Verb, step: Step) -> tuple[Step, str]:
        """The step as it ended; and why nothing can be built on it, '' where it can."""
        self._tell(step, None)
        begun, ending = time.perf_counter(), ""
        try:
            outcome: Any = getattr(self, f"_{verb}")(self._project.folder / step.folder)
            step = replace(step, status="done")
        except (AdjustmentFailedError, AbsorptionFailedError) as error:
            # all is well with the input, but the equations have no solution
            outcome, ending = error, "is missing"
            step = replace(step, status="failed", reason=f"aerotri {step.name} ended with 1")
        except TasksFailedError as error:
            outcome, ending = error, "is missing"
            step = replace(step, status="failed", reason=str(error))
        except InputError as error:
            if not self._project.steps:
                raise
            outcome, ending = error, "is missing"
            step = replace(step, status="failed", reason=str(error))
        if verb == "adjust" and step.status == "done" and not is_usable(outcome):
            o = outcome.adjusted.outcome
            ending = "" if self._go_on else "is rejected; --go-on builds on it all the same"
            step = replace(step, status="failed", reason=f"{o.verdict}: {next(iter(o.reasons), o.message)}")
        if verb == "tie_points" and step.status == "done" and self._stop:
            self._project.unmarked = outcome.unmarked
            ending = NOT_MARKED if outcome.unmarked else ""
        step = replace(step, seconds=round(time.perf_counter() - begun, 1))
        self._tell(step, outcome)
        return step, f"{step.name} {ending}" if ending else ""

    def _given(self, verb: Verb) -> tuple[dict[str, Any], bool]:
        """The settings of a verb that are stated, and whether to draw."""
        settings = {name: value for name, value in self._settings[verb].items() if not is_missing(value)}
        return settings, settings.pop("plots", True)

    def _tie_points(self, folder: Path) -> TiedPhotographs:
        from aerotri.formats.files.work_place import held
        from aerotri.public.tying import refuse_other_content, tie_points
        from aerotri.tie_points.photographs_to_block import CACHE

        settings, _ = self._given("tie_points")
        refuse_other_content(folder, overwrite=False)
        with held(folder):
            tied = tie_points(self._project.source, **settings, cache=folder / CACHE, progress=self._progress)
            tied.save(folder, progress=self._progress)
        self._project.tied = tied
        return tied

    def _adjust(self, folder: Path) -> Adjustment:
        from aerotri.public.adjusting import adjust_folder

        (settings, plots), source = self._given("adjust"), self._project.source
        begin = source if is_block(source) else self._project.folder / BLOCK
        photographs = () if is_block(source) else (source,)
        found = adjust_folder(begin, folder, plots=plots, photographs=photographs, progress=self._progress, **settings)
        self._project.adjustment = found
        return found

    def _has_check_points(self) -> bool:
        adjusted = self._project.adjustment
        return adjusted is not None and len(adjusted.adjusted.check) > 0

    def _accuracy(self, folder: Path) -> Accuracy:
        from aerotri.public.accuracy import ACCURACY_NAMES, accuracy
        from aerotri.public.folders import refuse_foreign_folder

        settings, _ = self._given("accuracy")
        refuse_foreign_folder(folder, ACCURACY_NAMES[0])
        found = accuracy(self._project.adjustment or self._project.folder / RESULT, **settings)
        found.save(folder)
        self._project.accuracy = found
        return found

    def _terrain(self, folder: Path) -> TerrainModel:
        from aerotri.formats.files.atomic import room_beside
        from aerotri.public.folders import refuse_foreign_folder
        from aerotri.public.terrain import RECORD as DTM_RECORD
        from aerotri.public.terrain import terrain

        settings, plots = self._given("terrain")
        refuse_foreign_folder(folder, DTM_RECORD)
        result = self._project.folder / RESULT
        with ExitStack() as stack:
            if "executor" in settings:
                settings["scratch"] = stack.enter_context(room_beside(folder))
            found = terrain(result, self._project.source, progress=self._progress, **settings)
            found.save(folder, plots)
        self._project.surface = found
        return found

    def _volume(self, folder: Path) -> MeasuredVolume:
        from aerotri.public.folders import refuse_foreign_folder
        from aerotri.public.volume import volume
        from aerotri.public.volume_result import RECORD as VOLUME_RECORD

        (settings, plots), place = self._given("volume"), self._project.folder
        refuse_foreign_folder(folder, VOLUME_RECORD)
        found = volume(
            place / DTM, adjustment=place / RESULT, progress=self._progress, **settings
        )  # fmt: skip
        found.save(folder, plots)
        self._project.volume = found
        return found

    def _dense(self, folder: Path) -> DenseSurface:
        from aerotri.formats.files.work_place import held
        from aerotri.public.dense import RECORD as DENSE_RECORD
        from aerotri.public.dense import dense_surface
        from aerotri.public.folders import refuse_foreign_folder
        from aerotri.public.tile_folder import remove_tiles, tiles_beside

        settings, plots = self._given("dense")
        refuse_foreign_folder(folder, DENSE_RECORD)
        tiles = tiles_beside(folder)
        result = self._project.folder / RESULT
        with held(folder):
            found = dense_surface(result, self._project.source, tiles=tiles, progress=self._progress, **settings)
            found.save(folder, plots)
            remove_tiles(tiles)
        self._project.dense = found
        return found

    def _orthophoto(self, folder: Path) -> Orthophoto:
        from aerotri.formats.files.work_place import held
        from aerotri.public.ortho import orthophoto
        from aerotri.public.tile_folder import remove_tiles, tiles_beside

        (settings, plots), place = self._given("orthophoto"), self._project.folder
        with held(folder):
            found = orthophoto(
                place / RESULT, self._project.source, place / DSM, folder, plots=plots, tiles=tiles_beside(folder),
                progress=self._progress, **settings,
            )  # fmt: skip
            remove_tiles(tiles_beside(folder))
        self._project.orthophoto = found
        return found


def is_usable(result: Adjustment) -> bool:
    """Whether a result has converged and is not rejected."""
    return result.status == "converged" and result.verdict != "rejected"


def write_report(content: Mapping[str, Any], folder: Path, head: Head) -> None:
    """The record and the page, each whole or not at all."""
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.report.pages.run import run_page

    with atomic_file(folder / RECORD) as place:
        write_json(place, content)
    with atomic_file(folder / REPORT) as place:
        place.write_text(run_page(dict(content), folder, head), encoding="utf-8")
