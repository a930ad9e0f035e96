"""Where the object points lie: tie point candidates, control and check points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.memory import fitting, refuse_beyond_memory
from aerotri.observations import Camera
from aerotri.simulation.flight import FlightFrame, FlownImages
from aerotri.simulation.random_streams import scattered
from aerotri.simulation.spec import ControlSpec, TiePointSpec, TowerSpec

CONTROL_REACH = 0.7
"""Control lies as far beyond the outer strip axes as this share of half a footprint."""
CHECK_SURPLUS = 2
"""Check points drawn for one that is wanted: those that fewer than two photographs see are left out; chosen [C]: where
more than half are, the flight does not cover its area."""
BYTES_OF_POINT = 2000
"""With its name and its rays in as many photographs as usually see one."""
TOWER_REACH = (0.1, 0.5)
"""Where towers stand, from the middle of a photograph along and across the flight, in units of the half format [C]: at
60 % end lap the neighbours see them too."""


@dataclass(frozen=True, eq=False)
class ControlPoints:
    """Signalised points, k of them, control first.

    Parameters
    ----------
    names : (k,) str, 'C01' … and 'K01' … for check points.
    xy : (k, 2) m.
    is_check : (k,) bool.
    """

    names: np.ndarray
    xy: np.ndarray
    is_check: np.ndarray


def tie_candidates(
    spec: TiePointSpec,
    count: int,
    flown: FlownImages,
    cameras: Sequence[Camera],
    frame: FlightFrame,
    ground_m: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Plan positions of possible tie points; every leading part of them is distributed like the whole.

    Returns
    -------
    (count, 2) m.
    """
    if spec.distribution != "uniform":
        return _clustered(spec, count, flown, cameras, ground_m, rng)
    corners = _on_ground(
        np.arange(len(flown)), np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)]), flown, cameras, ground_m
    )
    along_across = frame.along_across(corners.reshape(-1, 2))
    low, high = along_across.min(axis=0), along_across.max(axis=0)
    return frame.plan(low + (high - low) * scattered(count, rng))


def _clustered(
    spec: TiePointSpec,
    count: int,
    flown: FlownImages,
    cameras: Sequence[Camera],
    ground_m: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Around the nodes of a pattern in each image, as Gruber laid them out; the nodes of overlapping images meet."""
    nodes = float(np.prod(spec.pattern))
    _refuse_too_many(
        nodes * (len(flown) if spec.distribution == "nodes" else 1.0),
        "nodes of tie points",
        "lower 'tie_points.pattern'",
    )
    if spec.distribution == "nodes":
        cells = len(flown) * spec.pattern[0] * spec.pattern[1]
        order = np.concatenate([rng.permutation(cells) for _ in range(-(-count // cells))])[:count]
        image, *node = np.unravel_index(order, (len(flown), *spec.pattern))
    else:
        image = rng.integers(len(flown), size=count)
        node = [rng.integers(number, size=count) for number in spec.pattern]
    along, across = (_nodes(number)[which] for number, which in zip(spec.pattern, node, strict=True))
    position = _by_axes(along, across, image, flown, cameras)
    position = position + 2.0 * spec.cluster_sigma * rng.normal(size=(count, 2))
    return _on_ground(image, position[:, None, :], flown, cameras, ground_m)[:, 0]


def tower_places(
    spec: TowerSpec, flown: FlownImages, cameras: Sequence[Camera], ground_m: float, rng: np.random.Generator
) -> np.ndarray:
    """(t, 2) m plan positions of the towers, in the order of the photographs they stand in."""
    _refuse_too_many(2.0 * len(flown) * spec.per_image, "points of towers", "lower 'towers.per_image'")
    image = np.repeat(np.arange(len(flown)), spec.per_image)
    along, across = (rng.uniform(-reach, reach, size=len(image)) for reach in TOWER_REACH)
    position = _by_axes(along, across, image, flown, cameras)
    return _on_ground(image, position[:, None, :], flown, cameras, ground_m)[:, 0]


def _refuse_too_many(count: float, what: str, remedy: str) -> None:
    """Points are counted before any is made.

    Raises
    ------
    InputError
        When they do not fit into memory.
    """
    told = f"{remedy}; {fitting(BYTES_OF_POINT):.2g} would fit"
    refuse_beyond_memory(BYTES_OF_POINT * count, f"{count:.3g} {what}", told)


def _by_axes(along: np.ndarray, across: np.ndarray, image: np.ndarray, flown: FlownImages, cameras: Sequence[Camera]):
    """(n, 2) x, y in the photographs of positions along and across the flight."""
    is_x = np.array([(c.flight_axis or "+y")[1] == "x" for c in cameras])[flown.camera[image]]
    return np.where(is_x[:, None], np.stack([along, across], 1), np.stack([across, along], 1))


def _nodes(count: int) -> np.ndarray:
    """Nodes of a pattern in units of the half format, the outer ones at 0.8."""
    return np.zeros(1) if count == 1 else np.linspace(-0.8, 0.8, count)


def _on_ground(
    image: np.ndarray, position: np.ndarray, flown: FlownImages, cameras: Sequence[Camera], ground_m: float
) -> np.ndarray:
    """(n, p, 2) m on the mean level of format positions in units of the half format, as planned (no tilt).

    Parameters
    ----------
    image : (n,); position : (n, p, 2), or (p, 2) the same for all.
    """
    per_camera = np.array([np.array(c.half_format_mm) / c.focal_length_mm for c in cameras])
    half = per_camera[flown.camera[image]] * (flown.planned_centre[image, 2:] - ground_m)
    flat = np.zeros((len(image), 3))
    flat[:, 2] = flown.angles[image, 2]
    turn = rotation_from_angles(flat)[:, :2, :2]
    return flown.planned_centre[image, None, :2] + np.einsum("nab,npb->npa", turn, half[:, None, :] * position)


def lay_out_control(spec: ControlSpec, frame: FlightFrame, base_m: float, rng: np.random.Generator) -> ControlPoints:
    """Control on a grid (or where the spec says), check points evenly scattered between, some to spare.

    The rectangle ends at the outer projection centres along the flight and beyond the outer strip axes across.

    Parameters
    ----------
    base_m : base length that the distance of the control counts in.
    """
    half = frame.half_axes + np.array([0.0, CONTROL_REACH * frame.footprint[1] / 2.0])
    mesh = np.inf if spec.distance_bases is None else spec.distance_bases * base_m
    _refuse_too_many(
        float((2.0 * half / mesh + 2.0).prod()) + CHECK_SURPLUS * spec.check_points,
        "control and check points",
        "raise 'control.distance_bases' or lower 'control.check_points'",
    )
    if spec.positions:
        control = (2.0 * np.array(spec.positions) - 1.0) * half
    elif spec.distance_bases is not None:
        control = _grid(half, spec.distance_bases * base_m, spec.interior, rng)
    else:
        control = np.zeros((0, 2))
    spare = spec.check_points * CHECK_SURPLUS
    check = (2.0 * scattered(spare, rng) - 1.0) * half
    return ControlPoints(
        np.array([f"C{i + 1:02d}" for i in range(len(control))] + [f"K{i + 1:02d}" for i in range(spare)]),
        frame.plan(np.concatenate([control, check])),
        np.arange(len(control) + spare) >= len(control),
    )


def _grid(half: np.ndarray, distance: float, interior: bool, rng: np.random.Generator) -> np.ndarray:
    """Nodes of the grid whose mesh comes closest to the distance, each moved by some hundredths of it."""
    counts = np.maximum(np.round(2.0 * half / distance), 1).astype(int) + 1
    u, v = (np.linspace(-1.0, 1.0, count) for count in counts)
    nodes = np.array([(a, b) for a in u for b in v])
    if not interior:
        nodes = nodes[(np.abs(nodes) == 1.0).any(axis=1)]
    moved = nodes * half + 0.03 * distance * rng.normal(size=nodes.shape)
    return np.clip(moved, -half, half)


def choose_seen(layout: ControlPoints, rays_per_point: np.ndarray, check_points: int) -> np.ndarray:
    """(k,) index of the points to use: all control, and the first check points that two images see.

    Raises
    ------
    InputError
        When a control point is in no image, or too few check points are in two.
    """
    unseen = layout.names[~layout.is_check & (rays_per_point == 0)]
    if len(unseen):
        raise InputError(f"control point '{unseen[0]}' is in no image", "move it with 'control.positions'")
    check = np.flatnonzero(layout.is_check & (rays_per_point >= 2))[:check_points]
    if len(check) < check_points:
        raise InputError(
            f"'control.check_points' asks for {check_points}, only {len(check)} are in two images",
            "ask for fewer or overlap the images more",
        )
    return np.concatenate([np.flatnonzero(~layout.is_check), check])
