"""Standard deviations, redundancy numbers and tests of a part, from the inverse over what all parts share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.adjustment.partial_factor import restored
from aerotri.adjustment.point_sides import point_cofactors
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import Unknowns
from aerotri.diagnosis import judge
from aerotri.formats.block.folder import read_block
from aerotri.formats.results.adjustment import write_result
from aerotri.partition.part_picture import PartPicture, picture_of
from aerotri.partition.part_tasks import At, PartTask
from aerotri.partition.placing import Place
from aerotri.results.adjusted_block import AdjustedBlock, Blunder, GroundPointResults, ObservationGroup, Outcome
from aerotri.results.in_crs import transform_result, with_model_of
from aerotri.results.model_part import ModelPart
from aerotri.statistics.covariance import Cofactors
from aerotri.statistics.held_control import no_held_tests
from aerotri.statistics.model_part import spread_over_block
from aerotri.statistics.summarise import record_of, turned_down, weighted_sum

MEASURED, MODEL = "measured", "model"
"""Files of a part: solution and cofactors; the model part of photographs and points."""


@dataclass(frozen=True)
class Measured:
    """What σ0 of the whole needs of a part.

    Parameters
    ----------
    vtpv : vᵀPv with the final weights. turned_down : redundancy that robust weights take away.
    """

    vtpv: float
    turned_down: float


@dataclass(frozen=True, eq=False)
class Ending:
    """How the whole ended, for the results of its parts.

    Parameters
    ----------
    at : where. outcome : of the whole. folder : for the folders of the parts, by name.
    every : one point of so many goes to the page of the whole. place : see `Setting`.
    model_part : of the whole. shared_model : (s, s) that of all shared parameters; None where there is none.
    """

    at: At
    outcome: Outcome
    folder: Path
    every: int
    place: Place | None
    model_part: ModelPart
    shared_model: np.ndarray | None


@dataclass(frozen=True, eq=False)
class GroundPoints:
    """Control or check points of a part.

    Parameters
    ----------
    names : (k,) str. xyz, sigma : (k, 3) m, given. adjusted : (k, 3) m. results : what the adjustment says of them.
    """

    names: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    adjusted: np.ndarray
    results: GroundPointResults


@dataclass(frozen=True, eq=False)
class Written:
    """What a part tells of its results, which are in its folder.

    Parameters
    ----------
    name : of the part. verdict : 'accepted', 'doubtful' or 'rejected'. reasons : sentences.
    control, check : its ground points. groups : of its observations. blunders : suspected gross errors.
    points, rays : how many; rays that were used. picture : for the page of the whole.
    """

    name: str
    verdict: str
    reasons: tuple[str, ...]
    control: GroundPoints
    check: GroundPoints
    groups: tuple[ObservationGroup, ...]
    blunders: tuple[Blunder, ...]
    points: int
    rays: int
    picture: PartPicture


def measure_part(at: At, task: PartTask) -> Measured:
    """Cofactors of photographs, points and rays of a part."""
    files = task.files
    part = files.system(at.positions)
    system = part.system
    state = files.state(at.state, at.shared[task.shared])
    numbers, _ = files.eliminated(at.tag)
    inverse = restored(system.symbolic, numbers).inverse_below(task.there.inverse())
    points, redundancy = point_cofactors(system, state, inverse, at.estimator)
    n = len(system.unknowns.images)
    q = Cofactors(
        inverse.blocks[:n].copy(), inverse.corner, points, np.swapaxes(inverse.border, 1, 2).copy(), redundancy, inverse
    )
    solution = Solution("converged", state, system.assemble(state, 0.0, at.estimator), at.estimator, 0)
    files.keep_object(MEASURED, (solution, q))
    return Measured(weighted_sum(system, solution), turned_down(solution, q))


def write_part(ending: Ending, task: PartTask) -> Written:
    """Tables of a part, as `aerotri adjust` writes them; σ0 and counts of the outcome are those of the whole."""
    part = task.files.system(ending.at.positions)
    solution, q = task.files.object(MEASURED)
    outcome = replace(ending.outcome, warnings=part.warnings)
    found = record_of(part.system, solution, q, outcome, no_held_tests(part.system), part.ray_status)
    found = _with_model(found, ending, part.system.unknowns, task)
    verdict = judge(found)
    found = replace(found, outcome=replace(outcome, verdict=verdict.level, reasons=verdict.reasons))
    result = found
    if ending.place is not None:
        frame = ending.place.frame()
        result = with_model_of(transform_result(found, read_block(task.source, rays_needed=False), frame), found, frame)
    write_result(result, ending.folder / task.name)
    shared = np.zeros(len(found.block.images), bool)
    shared[part.system.unknowns.images[part.kept]] = True
    return Written(
        task.name, verdict.level, verdict.reasons,
        _ground_points(result, result.control), _ground_points(result, result.check),
        found.groups, found.blunders, len(found.block.points), int(np.sum(found.rays.status == RayStatus.USED)),
        picture_of(found, result, shared, ending.every),
    )  # fmt: skip


def _with_model(found: AdjustedBlock, ending: Ending, unknowns: Unknowns, task: PartTask) -> AdjustedBlock:
    """With the model part of the whole, where there is one."""
    found = replace(found, model_part=ending.model_part)
    if ending.shared_model is None:
        return found
    images, points = task.files.object(MODEL)
    own = np.ix_(task.shared, task.shared)
    found = spread_over_block(unknowns, found, images, ending.shared_model[own], points)
    return with_model_of(found, found, None)


def _ground_points(found: AdjustedBlock, results: GroundPointResults) -> GroundPoints:
    control = found.block.control
    row = {int(point): k for k, point in enumerate(control.point)}
    rows = np.array([row[int(point)] for point in results.point], dtype=np.int64)
    return GroundPoints(
        found.block.points[results.point],
        control.xyz[rows],
        control.sigma[rows],
        found.points.xyz[results.point],
        results,
    )
