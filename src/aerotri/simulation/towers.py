"""Towers: structures whose top stands over their foot, so that they tell the plumb line without any coordinates.

[P, paper 002] Top and bottom of a tower have the same plan coordinates, and nobody needs to know which.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.observations.block import Constraints
from aerotri.simulation.flight import FlownImages
from aerotri.simulation.ground_points import tower_places
from aerotri.simulation.measuring import Imaging
from aerotri.simulation.projection import Rays
from aerotri.simulation.random_streams import stream
from aerotri.simulation.spec import SimulationSpec, TowerSpec

ATTEMPTS = 20
"""So often a tower is moved that a tilt has put out of all photographs but one."""


@dataclass(frozen=True, eq=False)
class Towers:
    """The 2t points of t towers, foot and top by turns: names (2t,) str, xyz (2t, 3) m, and rays without noise."""

    names: np.ndarray
    xyz: np.ndarray
    rays: Rays


def build_towers(
    spec: SimulationSpec, flown: FlownImages, imaging: Imaging, on_ground: Callable[[np.ndarray], np.ndarray], seed: int
) -> Towers:
    """The towers of a spec with the rays of every photograph that sees them; none where the spec has none.

    Raises
    ------
    InputError
        When a foot or top is in fewer than two photographs.
    """
    if spec.towers is None:
        nothing = np.zeros(0, np.int64)
        return Towers(np.zeros(0, dtype=str), np.zeros((0, 3)), Rays(nothing, nothing, np.zeros((0, 2))))
    rng = stream(seed, "towers")
    xyz, weak = np.zeros((0, 2, 3)), np.zeros(0, np.int64)
    for attempt in range(ATTEMPTS):
        drawn = _drawn(spec.towers, spec.terrain.height_m, flown, imaging, on_ground, rng)
        xyz = drawn if attempt == 0 else np.where(np.isin(np.arange(len(xyz)), weak)[:, None, None], drawn, xyz)
        rays, _ = imaging.measure(xyz.reshape(-1, 3), imaging.rays(xyz.reshape(-1, 3)), spec.tie_points.margin_px)
        weak = np.flatnonzero((np.bincount(rays.point, minlength=2 * len(xyz)) < 2).reshape(-1, 2).any(axis=1))
        if not len(weak):
            names = [f"W{k + 1:03d}_{end}" for k in range(len(xyz)) for end in ("foot", "top")]
            return Towers(np.array(names), xyz.reshape(-1, 3), rays)
    raise InputError(
        f"tower {weak[0] + 1} is in fewer than two photographs", "raise 'flight.end_lap', or leave 'towers' out"
    )


def _drawn(
    spec: TowerSpec,
    ground_m: float,
    flown: FlownImages,
    imaging: Imaging,
    on_ground: Callable[[np.ndarray], np.ndarray],
    rng: np.random.Generator,
) -> np.ndarray:
    """(t, 2, 3) m, foot and top of every tower."""
    foot = on_ground(tower_places(spec, flown, imaging.cameras, ground_m, rng))
    top = foot + np.array([0.0, 0.0, spec.height_m])
    top[:, :2] += spec.sigma_m * rng.normal(size=(len(foot), 2))
    return np.stack([foot, top], axis=1)


def plumb_lines(towers: np.ndarray, sigma_m: float) -> Constraints:
    """The conditions that the top of every tower stands over its foot.

    Parameters
    ----------
    towers : (t, 2) index of foot and top. sigma_m : σ of a plan coordinate of the top against the foot.
    """
    count = len(towers)
    return Constraints(
        kind=np.full(count, "vertical"),
        points=tuple(towers),
        value=np.full(count, np.nan),
        sigma=np.full(count, sigma_m),
    )
