"""What changed between two adjustments of a block, measured against σ.

Differences are second − first, and every |Δ|/σ takes the σ of the second adjustment. Two adjustments of one block share
most of their observations, so their difference scatters by much less than σ (one inside the other: σ_Δ² = σ1² − σ2²):
|Δ|/σ says how much a change matters, it is no test of significance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from aerotri.observations import Block
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults
from aerotri.statistics.ray_changes import RayChanges, compare_rays, rows_in_common

SAME_COORDINATE = 1e-6
"""m; given coordinates closer than this are the same."""

ORIENTATION = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
COORDINATES = ("X", "Y", "Z")


@dataclass(frozen=True)
class Change:
    """A quantity in the first and in the second run; None where a run does not have it."""

    name: str
    first: Any
    second: Any


@dataclass(frozen=True, eq=False)
class Differences:
    """Differences second − first of the k things that both runs adjusted.

    Parameters
    ----------
    names : (k,) str. elements : names of the e elements.
    delta : (k, e) m and rad. sigma : (k, e) of the second run.
    """

    names: np.ndarray
    elements: tuple[str, ...]
    delta: np.ndarray
    sigma: np.ndarray

    def __len__(self) -> int:
        return len(self.names)

    @property
    def ratio(self) -> np.ndarray:
        """(k, e) |Δ|/σ; NaN where there is no σ."""
        known = self.sigma > 0.0
        return np.where(known, np.abs(self.delta) / np.where(known, self.sigma, 1.0), np.nan)

    @property
    def rms(self) -> np.ndarray:
        """(e,) root mean square of Δ."""
        known = np.isfinite(self.delta)
        squares = np.where(known, self.delta, 0.0) ** 2
        return np.sqrt(squares.sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan))

    def worst(self, top: int) -> np.ndarray:
        """Rows of the `top` things with the largest |Δ|/σ, largest first."""
        size = np.nan_to_num(self.ratio).max(axis=1, initial=0.0)
        rows = np.argsort(-size, kind="stable")[:top]
        return rows[size[rows] > 0.0]


@dataclass(frozen=True)
class ParameterChange:
    """A shared parameter or interior element; NaN where a run does not have it, σ NaN where it is held.

    Parameters
    ----------
    kind : 'interior', 'additional' or 'gnss'.
    """

    name: str
    group: str
    kind: str
    first: float
    second: float
    sigma_first: float
    sigma: float

    @property
    def delta(self) -> float:
        return self.second - self.first

    @property
    def ratio(self) -> float:
        """|Δ|/σ of the second run."""
        return abs(self.delta) / self.sigma if self.sigma > 0.0 else float("nan")


@dataclass(frozen=True, eq=False)
class CheckChange:
    """Check points that are check points in both runs.

    Parameters
    ----------
    names : (k,) str. first, second : (k, 3) m, adjusted − given.
    counts : check points of the first and of the second run.
    """

    names: np.ndarray
    first: np.ndarray
    second: np.ndarray
    counts: tuple[int, int]

    @property
    def rms(self) -> np.ndarray:
        """(2, 3) m, of X, Y, Z in the first and the second run, over the points in common."""
        both = np.stack([self.first, self.second])
        known = np.isfinite(both)
        squares = np.where(known, both, 0.0) ** 2
        return np.sqrt(squares.sum(axis=1) / np.where(known.any(axis=1), known.sum(axis=1), np.nan))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two adjustments side by side.

    Parameters
    ----------
    outcome : status, σ̂0 and counts, changed or not. settings : those that differ.
    roles : control and check points whose role, given coordinates or σ differ.
    orientations, points, parameters, check_points : see there.
    warnings_gone, warnings_new : of the first run only, of the second only.
    notes : what to bear in mind when reading the differences.
    """

    outcome: tuple[Change, ...]
    settings: tuple[Change, ...]
    rays: RayChanges
    roles: tuple[Change, ...]
    orientations: Differences
    points: Differences
    parameters: tuple[ParameterChange, ...]
    check_points: CheckChange
    warnings_gone: tuple[str, ...]
    warnings_new: tuple[str, ...]
    notes: tuple[str, ...]


def compare(first: AdjustedBlock, second: AdjustedBlock) -> Comparison:
    """Compare two adjustments; things are matched by name.

    Coordinates are compared only where both runs have the same coordinate reference system, angles only where they have
    the same order of rotations.
    """
    one, two = first.outcome.warnings, second.outcome.warnings
    return Comparison(
        outcome=_outcome(first, second),
        settings=_settings(first.block, second.block),
        rays=compare_rays(first, second),
        roles=_roles(first, second),
        orientations=_orientations(first, second),
        points=_points(first, second),
        parameters=_parameters(first, second),
        check_points=_check_points(first, second),
        warnings_gone=tuple(text for text in one if text not in two),
        warnings_new=tuple(text for text in two if text not in one),
        notes=_notes(first, second),
    )


def _outcome(first: AdjustedBlock, second: AdjustedBlock) -> tuple[Change, ...]:
    names = ("status", "sigma0", "sigma0_um", "vtpv", "iterations", "observations", "unknowns", "redundancy")
    changes = [Change(name, getattr(first.outcome, name), getattr(second.outcome, name)) for name in names]
    counts: list[tuple[str, Callable[[AdjustedBlock], int]]] = [
        ("photographs adjusted", lambda run: int((run.images.rays > 0).sum())),
        ("points adjusted", lambda run: int((run.points.rays > 0).sum())),
        ("rays used", lambda run: int(run.images.rays.sum())),
        ("control points", lambda run: len(run.control)),
        ("check points", lambda run: len(run.check)),
    ]
    return tuple(changes + [Change(name, count(first), count(second)) for name, count in counts])


def _settings(first: Block, second: Block) -> tuple[Change, ...]:
    one, two = _flat(_set_of(first)), _flat(_set_of(second))
    return tuple(
        Change(name, one.get(name), two.get(name))
        for name in dict.fromkeys([*one, *two])
        if one.get(name) != two.get(name)
    )


def _set_of(block: Block) -> dict[str, Any]:
    """What was set rather than measured, under the names that block.toml gives it where it does."""
    return {
        "name": block.name,
        "crs": block.crs,
        "rotation": block.rotation,
        "camera": {camera.name: camera for camera in block.cameras},
        **{f.name: getattr(block.settings, f.name) for f in fields(block.settings)},
    }


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    """Nested records and mappings as one mapping with dotted names."""
    if is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in fields(value)}
    if not isinstance(value, Mapping):
        return {prefix: value}
    flat: dict[str, Any] = {}
    for key, inner in value.items():
        flat |= _flat(inner, f"{prefix}.{key}" if prefix else str(key))
    return flat


def _roles(first: AdjustedBlock, second: AdjustedBlock) -> tuple[Change, ...]:
    one, two = _role_of(first), _role_of(second)
    changes = [
        Change(name, one.get(name), two.get(name))
        for name in dict.fromkeys([*one, *two])
        if one.get(name) != two.get(name)
    ]
    given_one, given_two = _given(first.block), _given(second.block)
    for name in given_one.keys() & given_two.keys():
        for axis, a, b in zip(COORDINATES + tuple(f"σ{x}" for x in COORDINATES), given_one[name], given_two[name],
                              strict=True):  # fmt: skip
            if not (abs(a - b) <= SAME_COORDINATE or (np.isnan(a) and np.isnan(b))):
                changes.append(Change(f"{name} {axis}", _or_none(a), _or_none(b)))
    return tuple(sorted(changes, key=lambda change: change.name))


def _role_of(run: AdjustedBlock) -> dict[str, str]:
    """'control', 'check' or 'not used' of every point with given coordinates, by name."""
    names = run.block.points
    roles = {str(names[point]): "not used" for point in run.block.control.point}
    for results, role in ((run.control, "control"), (run.check, "check")):
        roles |= {str(names[point]): role for point in results.point}
    return roles


def _given(block: Block) -> dict[str, np.ndarray]:
    values = np.concatenate([block.control.xyz, block.control.sigma], axis=1)
    return {str(block.points[point]): row for point, row in zip(block.control.point, values, strict=True)}


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _orientations(first: AdjustedBlock, second: AdjustedBlock) -> Differences:
    names, i, j = _adjusted_by_both(first, second, lambda run: run.block.images.names, lambda run: run.images.rays)
    delta = np.concatenate(
        [
            second.images.centre[j] - first.images.centre[i],
            _smallest_turn(second.images.angles[j] - first.images.angles[i]),
        ],
        axis=1,
    )
    if first.block.rotation != second.block.rotation:
        delta[:, 3:] = np.nan
    return Differences(names, ORIENTATION, delta, second.images.total_sigma[j])


def _smallest_turn(angle: np.ndarray) -> np.ndarray:
    """Angles brought between −π and π."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _points(first: AdjustedBlock, second: AdjustedBlock) -> Differences:
    names, i, j = _adjusted_by_both(first, second, lambda run: run.block.points, lambda run: run.points.rays)
    return Differences(names, COORDINATES, second.points.xyz[j] - first.points.xyz[i], second.points.total_sigma[j])


def _adjusted_by_both(
    first: AdjustedBlock,
    second: AdjustedBlock,
    names_of: Callable[[AdjustedBlock], np.ndarray],
    rays_of: Callable[[AdjustedBlock], np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Names and rows of what both runs adjusted; nothing where the coordinates mean different things."""
    if first.block.crs != second.block.crs:
        return np.zeros(0, dtype=str), np.zeros(0, np.int64), np.zeros(0, np.int64)
    i, j = rows_in_common(names_of(first), names_of(second))
    both = (rays_of(first)[i] > 0) & (rays_of(second)[j] > 0)
    return names_of(second)[j[both]].astype(str), i[both], j[both]


def _parameters(first: AdjustedBlock, second: AdjustedBlock) -> tuple[ParameterChange, ...]:
    one, two = _values_of(first), _values_of(second)
    nothing = ("", float("nan"), float("nan"))
    changes = []
    for group, name in dict.fromkeys([*one, *two]):
        kind_one, before, sigma_before = one.get((group, name), nothing)
        kind_two, after, sigma_after = two.get((group, name), nothing)
        held = not (np.isfinite(sigma_before) or np.isfinite(sigma_after))
        if not held or before != after:
            changes.append(ParameterChange(name, group, kind_two or kind_one, before, after, sigma_before, sigma_after))
    return tuple(changes)


def _values_of(run: AdjustedBlock) -> dict[tuple[str, str], tuple[str, float, float]]:
    """Kind, value and σ by (group, name); the interior elements of every camera, held (σ NaN) or not."""
    values = {
        (camera.name, name): ("interior", camera.interior[name].value, float("nan"))
        for camera in run.block.cameras
        for name in INTERIOR_ELEMENTS
    }
    p = run.parameters
    for k in range(len(p)):
        values[str(p.groups[k]), str(p.names[k])] = (str(p.kinds[k]), float(p.value[k]), float(p.sigma[k]))
    return values


def _check_points(first: AdjustedBlock, second: AdjustedBlock) -> CheckChange:
    def names(run: AdjustedBlock, results: GroundPointResults) -> np.ndarray:
        return run.block.points[results.point].astype(str)

    i, j = rows_in_common(names(first, first.check), names(second, second.check))
    return CheckChange(
        names=names(second, second.check)[j],
        first=first.check.difference[i],
        second=second.check.difference[j],
        counts=(len(first.check), len(second.check)),
    )


def _notes(first: AdjustedBlock, second: AdjustedBlock) -> tuple[str, ...]:
    one, two = first.block, second.block
    notes = []
    if one.crs != two.crs:
        notes.append(f"coordinates are in {one.crs} and in {two.crs}: orientations and points are not compared")
    if one.rotation != two.rotation:
        notes.append(f"angles are {one.rotation} and {two.rotation}: they are not compared")
    datums = one.settings.adjustment.datum, two.settings.adjustment.datum
    if datums[0] != datums[1] or set(datums) & {"minimal", "inner"}:
        notes.append(
            f"datum {datums[0]} and {datums[1]}: differences of coordinates hold the motion of the whole block"
        )
    for which, run in (("first", first), ("second", second)):
        if run.outcome.status != "converged":
            notes.append(f"the {which} run has {run.outcome.status}: its numbers are no result")
    return tuple(notes)
