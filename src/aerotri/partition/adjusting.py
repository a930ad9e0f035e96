"""`adjust` of a folder of parts: prepared, minimised, σ of everything, tables of the parts and of the whole."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, real_path
from aerotri.execution.work import Executor, Work
from aerotri.formats.block.folder import read_block, read_photographs
from aerotri.observations import Block
from aerotri.partition.common import Common, PartFacts
from aerotri.partition.course import Course, Ended
from aerotri.partition.joints import LEAST_BYTES, Joints
from aerotri.partition.model_part import model_part_of
from aerotri.partition.part_list import part_folders
from aerotri.partition.part_picture import SAMPLE_RAYS
from aerotri.partition.part_results import Ending, Written, measure_part, write_part
from aerotri.partition.part_system import refuse_robust
from aerotri.partition.part_tasks import PartTask, Setting, prepare_part
from aerotri.partition.placing import Place, place_of
from aerotri.partition.telling import Say, Told
from aerotri.partition.whole import PARTS, Whole, whole_of
from aerotri.results.adjusted_block import Outcome
from aerotri.statistics.model_part import of_parameters
from aerotri.statistics.stated_sigma import sigma0_um
from aerotri.statistics.summarise import parameters_of

WORK = "work"
"""Folder of what the tasks exchange, while they run."""
BYTES_A_RAY = 3000
"""Memory of a part's task beside its factor [C]: tables, partials and pairs of a ray."""


@dataclass(frozen=True)
class PartsSettings:
    """How a block in parts is adjusted.

    Parameters
    ----------
    robust : estimator that lowers the weight of gross errors; as the parts say where None.
    max_iterations : at most, in each stage of a robust estimator; as the parts say where None.
    geoid : grid for the heights of the block's CRS, where PROJ does not have it; every worker sees it.
    """

    robust: str | None = None
    max_iterations: int | None = None
    geoid: Path | None = None


def adjust_parts(folder: Path, out: Path, executor: Executor, settings: PartsSettings, say: Say) -> Whole:
    """Adjust a block in parts; the tables of the parts are written to parts/ of the result.

    Parameters
    ----------
    folder : holds parts/NAME, each a block folder. out : an empty folder to fill, which every worker can write to.
    say : told what is done, and the share of it.
    """
    begun, sources = time.perf_counter(), part_folders(folder)
    if settings.robust is not None:
        refuse_robust(settings.robust)
    if len(sources) < 2:
        raise InputError("holds no parts", "divide a block: aerotri divide BLOCK FOLDER --parts N", folder)
    work = out / WORK
    try:
        names, origin, place = _shared_photographs(sources, settings.geoid)
        tasks = [PartTask(p.name, real_path(p), real_path(work / p.name)) for p in sources]
        told = Told(executor, say)
        told.stage = "reading"
        facts = told.run(_reading(Setting(names, origin, place), tasks, work))
        first = read_block(sources[0], rays_needed=False)
        common = _common_of(facts, tasks)
        joints = Joints(common, tasks, told, work)
        observations = sum(part.observations for part in facts) + common.priors.count
        unknowns = sum(part.unknowns for part in facts) + 6 * len(common.images) + len(common.labels)
        asked, chosen = first.settings.adjustment, settings
        limit = asked.max_iterations if chosen.max_iterations is None else chosen.max_iterations
        course = Course(
            joints, common, told, work, observations - unknowns, unknowns,
            max(part.bytes_needed + BYTES_A_RAY * part.rays for part in facts) + LEAST_BYTES,
            lambda iteration, sigma0: _tell_iteration(told, say, iteration, sigma0),
        )  # fmt: skip
        told.stage = "iteration 1"
        ended = course.minimise(chosen.robust or asked.robust, limit)
        solved = time.perf_counter()
        told.stage = "standard deviations"
        photographs = sum(part.images for part in facts) + len(common.images)
        every = max(1, sum(part.rays for part in facts) // SAMPLE_RAYS)
        whole = _with_sigma(course, ended, first, out, observations, unknowns, photographs, every, place)
        seconds = {"solve": solved - begun, "statistics": time.perf_counter() - solved}
        warnings = tuple(
            f"part {t.name}: {said}" for t, part in zip(tasks, facts, strict=True) for said in part.warnings
        )
        outcome = replace(whole.outcome, timings_s=seconds, warnings=(*whole.outcome.warnings, *warnings))
        return replace(whole, record=replace(whole.record, outcome=outcome))
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _tell_iteration(told: Told, say: Say, iteration: int, sigma0: float) -> None:
    """What an iteration led to; the tasks that follow belong to the next."""
    say(f"iteration {iteration}: σ0 {sigma0:.4g}", None)
    told.stage = f"iteration {iteration + 1}"


def _with_sigma(
    course: Course, ended: Ended, first: Block, out: Path, observations: int, unknowns: int, photographs: int,
    every: int, place_of_block: Place | None,
) -> Whole:  # fmt: skip
    """Inverse, tables of the parts, and what they say together."""
    place, common = ended.place, course.common
    corner = course.solved(place)
    course.joints.invert(place.at.tag)
    measured = course.run(measure_part, place.at)
    vtpv = sum(part.vtpv for part in measured) + common.cost_of_priors(place.at.shared)
    freedom = observations - unknowns - sum(part.turned_down for part in measured)
    if freedom <= 0.0:
        raise InputError("the observations do not exceed the unknowns", "give more rays, control or positions")
    sigma0 = float(np.sqrt(vtpv / freedom))
    outcome = Outcome(
        status=ended.status,
        message="" if ended.status == "converged" else f"no convergence within {ended.iterations} iterations",
        iterations=ended.iterations, sigma0=sigma0, sigma0_um=sigma0_um(sigma0, first), vtpv=vtpv,
        observations=observations, unknowns=unknowns, conditions=0, redundancy=observations - unknowns,
    )  # fmt: skip
    model = model_part_of(course, place, first, ended.status, sigma0, photographs)
    course.begin("tables")
    ending = Ending(place.at, outcome, real_path(out / PARTS), every, place_of_block, model.part, model.shared)
    written: list[Written] = course.run(write_part, ending)
    parameters = parameters_of(common.labels, place.at.shared, corner.inverse, common.weighted, sigma0)
    if model.shared is not None:
        kinds = [kind for _, _, kind, _ in common.labels]
        parameters = replace(parameters, model=of_parameters(kinds, model.shared, len(parameters)))
    return whole_of(first, outcome, parameters, written, photographs, every, model.part)


def _reading(setting: Setting, tasks: list[PartTask], work: Path) -> Work[Setting, PartTask, PartFacts]:
    size = max(sum(file.stat().st_size for file in task.source.iterdir() if file.is_file()) for task in tasks)
    names = [f"part {task.name}" for task in tasks]
    return Work(prepare_part, setting, tasks, names, "parts", work, bytes_each=60 * size + LEAST_BYTES)


def _shared_photographs(sources: Sequence[Path], geoid: Path | None) -> tuple[np.ndarray, np.ndarray, Place | None]:
    """Names of the photographs that stand in several parts, sorted; (3,) m, the local origin; the place of all."""
    of_parts = [read_photographs(source) for source in sources]
    unique, count = np.unique(np.concatenate([images.names for images in of_parts]), return_counts=True)
    centres = np.concatenate([images.centre for images in of_parts])
    place = place_of(sources, geoid)
    if place is not None:
        centres = place.frame().to_local(centres)
    return unique[count > 1], np.round(np.nan_to_num(np.nanmean(centres, axis=0))), place


def _common_of(facts: Sequence[PartFacts], tasks: Sequence[PartTask]) -> Common:
    """What the parts share.

    Raises
    ------
    InputError
        When they do not belong together.
    """
    for part, task in zip(facts, tasks, strict=True):
        if part.settings != facts[0].settings:
            raise InputError(
                f"block.toml of part {task.name} differs from that of part {tasks[0].name}",
                "give all parts the same cameras and settings", task.source / "block.toml",
            )  # fmt: skip
    for what, seen in (
        ("point", [p.points_seen for p in facts]),
        ("observed position of", [p.observed for p in facts]),
    ):
        unique, count = np.unique(np.concatenate(seen), return_counts=True)
        if (count > 1).any():
            twice = unique[count > 1][0]
            names = [task.name for task, own in zip(tasks, seen, strict=True) if twice in own]
            raise InputError(
                f"{what} '{twice}' stands in the parts {names[0]} and {names[1]}",
                "a point with all its rays, and the position of a photograph, belong to one part",
            )
    return Common(facts)
