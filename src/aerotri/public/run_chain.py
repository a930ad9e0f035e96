"""The steps of a run one after another, each on what those before it gave."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import InputError
from aerotri.deformation.absorbed import AbsorptionFailedError
from aerotri.execution.work import TasksFailedError
from aerotri.formats.results.json_text import write_json
from aerotri.public.progress import Progress, StageReport
from aerotri.public.run_project import Project
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
)
from aerotri.results.failure import AdjustmentFailedError
from aerotri.results.head import Head

if TYPE_CHECKING:
    from aerotri.public.accuracy import Accuracy
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.dense import DenseSurface
    from aerotri.public.ortho import Orthophoto
    from aerotri.public.terrain import TerrainModel
    from aerotri.public.tying import TiedPhotographs
    from aerotri.public.volume_result import MeasuredVolume

OnStep = Callable[[Step, object], None]
NOT_MARKED = "found control points that are marked in no photograph"
NOT_PLACED = "found no place that can be trusted; --go-on builds on it all the same"


class RunChain:
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
        if verb == "tie_points" and step.status == "done" and outcome.misplaced:
            ending = "" if self._go_on else NOT_PLACED
            step = replace(step, status="failed", reason=outcome.misplaced)
        elif verb == "tie_points" and step.status == "done" and self._stop:
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
        found = self._measured(DTM, folder, "volume")
        self._project.volume = found
        return found

    def _measured(self, surface: str, folder: Path, verb: Verb) -> MeasuredVolume:
        """The volume on the surface in a folder of the run."""
        from aerotri.public.folders import refuse_foreign_folder
        from aerotri.public.volume import volume
        from aerotri.public.volume_result import RECORD as VOLUME_RECORD

        (settings, plots), place = self._given(verb), self._project.folder
        refuse_foreign_folder(folder, VOLUME_RECORD)
        found = volume(place / surface, adjustment=place / RESULT, progress=self._progress, **settings)
        found.save(folder, plots)
        return found

    def _dense_volume(self, folder: Path) -> MeasuredVolume:
        found = self._measured(DSM, folder, "dense_volume")
        self._project.dense_volume = found
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
    from aerotri.public.described import files_in
    from aerotri.report.pages.run import PRODUCTS, run_page

    files = {name: files_in(f"folder of {name}", folder / name) for name in PRODUCTS}

    with atomic_file(folder / RECORD) as place:
        write_json(place, content)
    with atomic_file(folder / REPORT) as place:
        place.write_text(run_page(dict(content), folder, head, files), encoding="utf-8")
