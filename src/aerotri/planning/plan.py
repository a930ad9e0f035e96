"""From an area to a plan: strips, the block they will bring, its σ over the area, control added where it helps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.observations import Block, Camera
from aerotri.planning.area import Area
from aerotri.planning.control import Joint, Quality, first_control, joint_of, next_control
from aerotri.planning.covariance import intersection_covariance, joint_covariance
from aerotri.planning.expected_block import Expected, expected_block, places_of
from aerotri.planning.flight import Flight, Seen, plan_strips
from aerotri.planning.ground import Ground
from aerotri.planning.options import PlanOptions, Target
from aerotri.planning.piles import PileSigma, pile_sigmas

MOST_CONTROL = 30
"""Control points added at most, unless told otherwise [C]."""
DEFAULT_TARGET = "sigma-z"
FEWEST_GIVEN = 3
"""Control points that hold a block without positions."""

Given = tuple[tuple[str, ...], np.ndarray, np.ndarray]
Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class AddedControl:
    """A control point that the plan adds.

    Parameters
    ----------
    name : of the point. xyz : (3,) m. before, after : the quantity judged by, m or m³; NaN before the block holds.
    """

    name: str
    xyz: np.ndarray
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class PlanRecord:
    """A plan and its accuracy to be expected.

    Parameters
    ----------
    area, ground, camera, options, target : as asked. flight, seen : the strips. expected : the block with the control.
    block : the same with the control chosen. ground_points : (g, 3) m. step : m, cell of the map.
    covariance : (g, 3, 3) m² of a ground point measured in all photographs that see it. own : (g, 3, 3) m², the part
    of its image coordinates. rays : (g,). volume_sigma : m³. added : control in the order of its gain.
    control : (k, 3) m, all of it. mode_share, mode : share of the variance of heights that the largest common
    deformation has, and its σ (g,) m with sign. piles : of the area, where it has several polygons.
    """

    area: Area
    ground: Ground
    camera: Camera
    options: PlanOptions
    target: Target | None
    flight: Flight
    seen: Seen
    expected: Expected
    block: Block
    ground_points: np.ndarray
    step: float
    covariance: np.ndarray
    own: np.ndarray
    rays: np.ndarray
    volume_sigma: float
    added: tuple[AddedControl, ...]
    control_names: tuple[str, ...]
    control: np.ndarray
    mode_share: float
    mode: np.ndarray
    warnings: tuple[str, ...] = ()
    piles: tuple[PileSigma, ...] = ()

    @property
    def sigma(self) -> np.ndarray:
        """(g, 3) m of the ground points."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def deformation(self) -> np.ndarray:
        """(g, 3) m, the part of it that orientations and control cause: neighbours share it."""
        rest = np.diagonal(self.covariance - self.own, axis1=1, axis2=2)
        return np.sqrt(np.maximum(rest, 0.0))

    @property
    def quality(self) -> Quality:
        return Quality(self.sigma**2, self.volume_sigma**2)

    @property
    def judged(self) -> float:
        """The quantity of the target, of σ_Z without one; m or m³."""
        return self.quality.of(self.target or Target(DEFAULT_TARGET, np.inf))

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without one."""
        return None if self.target is None else self.judged <= self.target.value


def make_plan(
    area: Area, ground: Ground, camera: Camera, options: PlanOptions, target: Target | None, given: Given,
    wanted: int | None, most: int = MOST_CONTROL, say: Say = lambda text: None,
) -> PlanRecord:  # fmt: skip
    """Plan, predict, and add control.

    Parameters
    ----------
    given : names, coordinates (k, 3) m and σ (k, 3) m of control that is there.
    wanted : control points to add; None for as many as the target needs, `most` at most.
    """
    say("strips")
    flight, seen = plan_strips(area, ground, camera, options)
    places = places_of(area, ground, flight, camera, options, given)
    expected = expected_block(places, area, ground, flight, camera, options)
    if not len(expected.ground):
        raise InputError("no ground point of the map lies in two photographs", "raise the overlaps")
    say("control")
    chosen, steps = _chosen(expected, area, options, target, wanted, most)
    say("accuracy")
    block = expected.with_control(np.array(chosen, dtype=np.int64))
    rows, g = np.concatenate([expected.ground, expected.piles]), len(expected.ground)
    together = joint_covariance(block, expected.xyz, rows)
    noise = intersection_covariance(block, expected.xyz, rows)
    piles = pile_sigmas(area.piles, block.points[expected.piles], expected.owner, together[3 * g :, 3 * g :], noise[g:])
    covariance, own = together[: 3 * g, : 3 * g], noise[:g]
    joint = joint_of(covariance, own, area.polygon.area)
    blocks = covariance.reshape(g, 3, g, 3)[np.arange(g), :, np.arange(g), :]
    share, mode = _largest_mode(covariance[2::3, 2::3], own)
    candidates = expected.candidates[chosen]
    names = block.points[candidates]
    added = tuple(
        AddedControl(str(name), expected.xyz[row], *step)
        for name, row, step in zip(names, candidates, steps, strict=True)
    )
    return PlanRecord(
        area, ground, camera, options, target, flight, seen, expected, block, expected.xyz[expected.ground],
        places.step, blocks, own, np.bincount(block.image_points.point, minlength=len(block.points))[expected.ground],
        float(np.sqrt(max(joint.quality.volume, 0.0))), added, (*given[0], *map(str, names)),
        np.concatenate([expected.xyz[expected.given], expected.xyz[candidates]]), share, mode,
        _warnings(options, flight, seen, len(places.ground) - g, added, len(given[0])), piles,
    )  # fmt: skip


def _chosen(
    expected: Expected, area: Area, options: PlanOptions, target: Target | None, wanted: int | None, most: int
) -> tuple[list[int], list[tuple[float, float]]]:
    """Candidates that become control, and the quantity before and after each."""
    goal = target or Target(DEFAULT_TARGET, np.inf)
    held = options.positions_sigma is not None or len(expected.given) >= FEWEST_GIVEN
    chosen: list[int] = [] if held else first_control(expected.xyz[expected.candidates, :2])
    if wanted is not None and len(chosen) > wanted:
        raise InputError(
            f"{wanted + len(expected.given)} control points do not hold a block without positions",
            f"give {len(chosen)} or more, or --positions-sigma",
        )
    if wanted == len(chosen) or (wanted is None and target is None):
        return chosen, _first_steps(len(chosen), None if not chosen else np.nan)
    joint = _joint(expected, area, chosen)
    now = joint.quality.of(goal)
    steps = _first_steps(len(chosen), now)
    limit = min(most if wanted is None else wanted, joint.candidates)
    while len(chosen) < limit and not (wanted is None and now <= goal.value):
        best, after = next_control(joint, expected.candidate_sigma, goal, chosen)
        steps.append((now, after.of(goal)))
        chosen.append(best)
        joint = joint.with_control(best, expected.candidate_sigma)
        now = joint.quality.of(goal)
    return chosen, steps


def _first_steps(count: int, after: float | None) -> list[tuple[float, float]]:
    return [(np.nan, np.nan)] * max(count - 1, 0) + ([(np.nan, np.nan if after is None else after)] if count else [])


def _joint(expected: Expected, area: Area, chosen: list[int]) -> Joint:
    block = expected.with_control(np.array(chosen, dtype=np.int64))
    rows = np.concatenate([expected.ground, expected.candidates])
    own = intersection_covariance(block, expected.xyz, expected.ground)
    return joint_of(joint_covariance(block, expected.xyz, rows), own, area.polygon.area)


def _largest_mode(heights: np.ndarray, own: np.ndarray) -> tuple[float, np.ndarray]:
    """Share and shape of the largest common error of heights: the first eigenvector of what points share."""
    shared = heights - np.diag(own[:, 2, 2])
    values, vectors = np.linalg.eigh(shared)
    total = float(np.maximum(values, 0.0).sum())
    if total <= 0.0:
        return 0.0, np.zeros(len(heights))
    mode = vectors[:, -1] * np.sqrt(max(float(values[-1]), 0.0))
    return float(values[-1]) / total, mode * (1.0 if mode.sum() >= 0.0 else -1.0)


def _warnings(
    options: PlanOptions, flight: Flight, seen: Seen, unseen: int, added: tuple[AddedControl, ...], given: int
) -> tuple[str, ...]:
    told = []
    shortest = shortest_interval(flight)
    if options.interval > shortest:
        told.append(
            f"photographs follow each other after {shortest:.2f} s, the camera needs {options.interval:g} s: fly at "
            f"{options.speed * shortest / options.interval:.3g} m/s or less"
        )
    hidden = seen.rays < np.minimum(seen.framed, options.rays)
    if hidden.any():
        told.append(
            f"the terrain hides {100.0 * float(hidden.mean()):.2g} % of the area: fewer than {options.rays} "
            f"photographs see it there, {int(seen.rays.min())} at least; add cross strips, or a longer lens"
        )
    if unseen:
        told.append(f"{unseen} ground points lie in fewer than two photographs and have no σ")
    if options.positions_sigma is not None and len(added) + given == 0:
        told.append("without a control point nothing shows a wrong principal distance or a shift of all positions")
    return tuple(told)


def shortest_interval(flight: Flight) -> float:
    """s between two exposures of a strip, at least."""
    gaps = [np.diff(flight.time[own]).min() for own in flight.strips if len(own) > 1]
    return float(min(gaps)) if gaps else np.inf
