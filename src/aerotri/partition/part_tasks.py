"""What is done to one part at a time; each is a task that may run anywhere and twice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.adjustment.adjusted_positions import at_adjusted_positions, positions_moved, unit_of_residuals
from aerotri.adjustment.partial_factor import eliminate_inner, restored
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.settled_points import settled_points
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.conventions import InputError
from aerotri.coordinates.blocks import transform_block
from aerotri.formats.block.folder import read_block
from aerotri.partition.common import Left, PartFacts
from aerotri.partition.joint_tasks import Above
from aerotri.partition.part_files import PartFiles
from aerotri.partition.part_system import PartSystem, part_system
from aerotri.partition.placing import Place
from aerotri.statistics.summarise import count_observations


@dataclass(frozen=True, eq=False)
class PartTask:
    """A part.

    Parameters
    ----------
    name : of the part. source : folder of its observations. work : folder of its work.
    above : where its shared photographs and parameters stand; None before that is known.
    """

    name: str
    source: Path
    work: Path
    above: Above | None = None

    @property
    def files(self) -> PartFiles:
        return PartFiles(self.work)

    @property
    def there(self) -> Above:
        """Where it stands, once that is known."""
        assert self.above is not None
        return self.above

    @property
    def shared(self) -> np.ndarray:
        """(s,) its shared parameters among all."""
        return self.there.shared


@dataclass(frozen=True, eq=False)
class Setting:
    """What all parts need to begin.

    Parameters
    ----------
    shared_images : str, photographs that stand in several parts, sorted. origin : (3,) m, the local origin.
    place : where a block with a coordinate system is adjusted; None of a local one.
    """

    shared_images: np.ndarray
    origin: np.ndarray
    place: Place | None


@dataclass(frozen=True, eq=False)
class At:
    """Where the equations are taken.

    Parameters
    ----------
    state : number of the state. positions : round of the positions that parameters are evaluated at.
    shared : all shared parameters there. estimator : of the weights. damping : λ. tag : names the files.
    """

    state: int
    positions: int
    shared: np.ndarray
    estimator: Estimator
    damping: float
    tag: str


@dataclass(frozen=True, eq=False)
class Move:
    """From one place to another.

    Parameters
    ----------
    last : whether nothing but the cost is wanted there, because the equations are taken elsewhere next.
    variance : σ̂0², where points are led to a share of their σ.
    """

    start: At
    end: At
    last: bool = False
    variance: float = 1.0


@dataclass(frozen=True)
class Reduced:
    """What a part tells of its equations; what it leaves is in its files.

    Parameters
    ----------
    cost : Σρ. decrement : of what was eliminated; of_points : of the points among it.
    rounding : what the cost is uncertain by, see `RightSide`.
    fault : why there are no equations, '' where there are.
    """

    cost: float
    decrement: float = 0.0
    of_points: float = 0.0
    rounding: float = 0.0
    fault: str = ""


def prepare_part(setting: Setting, task: PartTask) -> PartFacts:
    """Read a part and set up its system."""
    block = read_block(task.source, rays_needed=False)
    shared = np.isin(block.images.names, setting.shared_images)
    local = block if setting.place is None else transform_block(block, setting.place.frame())
    part, state = part_system(local, shared, setting.origin)
    system, u = part.system, part.system.unknowns
    task.files.keep_system(part, 0)
    task.files.keep_state(state, 0)
    counts, s = count_observations(system), len(u.shared)
    return PartFacts(
        kept=block.images.names[u.images[part.kept]],
        middle=state.centre[:, :2].mean(axis=0),
        labels=tuple(zip(u.shared.names, u.shared.groups, u.shared.kinds, u.shared.marks, strict=True)),
        start=np.array(u.shared.start, dtype=float),
        priors=part.priors,
        images=len(u.images) - len(part.kept),
        points=len(u.points),
        rays=len(u.rays.image),
        observations=counts.observations,
        unknowns=counts.unknowns - s - 6 * len(part.kept),
        points_seen=block.points,
        observed=block.images.names[[] if block.gnss_ins is None else block.gnss_ins.image],
        settings=repr((block.cameras, block.settings, block.crs, block.rotation)),
        bytes_needed=system.symbolic.bytes_needed,
        warnings=part.warnings,
    )


def reduce_part(at: At, task: PartTask) -> Reduced:
    """The equations of a part at a state, its points and inner photographs eliminated."""
    part = task.files.system(at.positions)
    return _reduced(part, at, task)


def move_part(move: Move, task: PartTask) -> Reduced:
    """Follow the solution of what is shared: a new state of the part, and its equations there."""
    files, start = task.files, move.start
    part = files.system(start.positions)
    state = files.state(start.state, start.shared[task.shared])
    numbers, half = files.eliminated(start.tag)
    x = restored(part.system.symbolic, numbers).expand(half, task.there.solution(start.tag))
    step = part.system.whole_step(state, x, start.damping, start.estimator)
    if step is None:
        return Reduced(np.inf, fault="a step that is not a number")
    there = part.system.unknowns.advance(state, step)
    files.keep_state(there, move.end.state)
    if move.last:
        there = files.state(move.end.state, move.end.shared[task.shared])
        side = part.system.right_side(there, move.end.estimator)
        return Reduced(side.cost, rounding=side.rounding)
    return _reduced(part, move.end, task)


def settle_part(move: Move, task: PartTask) -> Reduced:
    """Lead the points to where their rays want them, and the equations there."""
    files, at = task.files, move.start
    part = files.system(at.positions)
    state = files.state(at.state, at.shared[task.shared])
    files.keep_state(settled_points(part.system, state, at.estimator, move.variance), move.end.state)
    return _reduced(part, move.end, task)


def evaluate_part(move: Move, task: PartTask) -> tuple[float, int]:
    """Parameters evaluated at the adjusted image points of a state; sum of the squared changes in units of the
    residuals, and how many."""
    files, at = task.files, move.start
    part = files.system(at.positions)
    state = files.state(at.state, at.shared[task.shared])
    there = at_adjusted_positions(part.system, state, at.estimator)
    files.keep_system(replace(part, system=there), move.end.positions)
    count = 2 * len(there.unknowns.rays.image)
    unit = unit_of_residuals(there, there.right_side(state, at.estimator).residual, at.estimator)
    return count * (positions_moved(part.system, there) / unit) ** 2, count


def _reduced(part: PartSystem, at: At, task: PartTask) -> Reduced:
    system, files = part.system, task.files
    state = files.state(at.state, at.shared[task.shared])
    equations = system.assemble(state, at.damping, at.estimator)
    if equations.undetermined >= 0:
        u = system.unknowns
        return Reduced(np.inf, fault=f"point {u.block.points[u.points[equations.undetermined]]} is not determined")
    try:
        factor, matrix = eliminate_inner(system.symbolic, equations.matrix)
    except NotPositiveDefiniteError:
        return Reduced(np.inf, fault="its observations do not determine its photographs")
    rest = factor.reduce_side(equations.right)
    of_images = np.diagonal(equations.matrix.blocks[part.kept], axis1=1, axis2=2).ravel()
    diagonal = np.concatenate([of_images, np.diagonal(equations.matrix.corner)])
    files.keep_eliminated(factor.eliminated(), rest.half, at.tag)
    files.keep_left(Left(matrix, rest.right, diagonal), at.tag)
    files.keep_array(f"lengths_{at.tag}", system.residual_lengths(equations))
    of_points = equations.point_decrement
    return Reduced(equations.cost, rest.decrement + of_points, of_points, equations.rounding)


def refuse_fault(tasks: list[PartTask], found: list[Reduced]) -> None:
    """Say which part has no equations.

    Raises
    ------
    InputError
    """
    for task, part in zip(tasks, found, strict=True):
        if part.fault:
            raise InputError(
                f"part {task.name}: {part.fault}",
                "adjust this part alone to see what it lacks: aerotri adjust of its folder", task.source,
            )  # fmt: skip
