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
from aerotri.simulation.spec import SimulationSpec


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
    foot = on_ground(tower_places(spec.towers, flown, imaging.cameras, spec.terrain.height_m, rng))
    top = foot + np.array([0.0, 0.0, spec.towers.height_m])
    top[:, :2] += spec.towers.sigma_m * rng.normal(size=(len(foot), 2))
    xyz = np.stack([foot, top], axis=1).reshape(-1, 3)
    names = np.array([f"W{k + 1:03d}_{end}" for k in range(len(foot)) for end in ("foot", "top")])
    rays, _ = imaging.measure(imaging.rays(xyz), spec.tie_points.margin_px)
    weak = names[np.bincount(rays.point, minlength=len(xyz)) < 2]
    if len(weak):
        raise InputError(
            f"tower point '{weak[0]}' is in fewer than two photographs", "raise 'flight.end_lap', or leave 'towers' out"
        )
    return Towers(names, xyz, rays)


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
