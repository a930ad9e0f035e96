"""The joint covariance of any unknowns of one adjustment, by their names.

Columns of Q are had one by one from the factor of the final normal equations: a unit right side for an unknown of the
reduced system, the eliminated unit right side for an object point. Cofactors that do not lie on the pattern of the
normal matrix (two points far apart) are had in the same way as those that do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides, solve_sides
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.conventions import InputError
from aerotri.results.model_part import ModelRoot
from aerotri.statistics.covariance import inner_datum, to_angles
from aerotri.statistics.model_of_functions import known_root_of
from aerotri.statistics.model_part import positive_part

POINT, IMAGE, SHARED = "point", "image", "shared"
AXES, ELEMENTS = ("X", "Y", "Z"), ("X0", "Y0", "Z0", "omega", "phi", "kappa")


@dataclass(frozen=True)
class Chosen:
    """One object point, photograph or shared parameter.

    Parameters
    ----------
    kind : POINT, IMAGE or SHARED. row : in the unknowns of the adjustment. of_block : row of the block's table.
    name : as the user gave it. parts : which of its coordinates or elements are wanted.
    """

    kind: str
    row: int
    of_block: int
    name: str
    parts: tuple[int, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the scalars wanted, such as 'T12:X'."""
        if self.kind == SHARED:
            return (self.name,)
        parts = AXES if self.kind == POINT else ELEMENTS
        return tuple(f"{self.name}:{parts[k]}" for k in self.parts)


def choose_unknowns(unknowns: Unknowns, names: Sequence[str]) -> list[Chosen]:
    """What names mean: 'T12' the point, 'T12:Z' its height, '1_008' the photograph, '1_008:X0' one element of it,
    'bluh.1' a parameter, 'bluh.1 (day2)' that of a group.

    Raises
    ------
    InputError
        For a name that means nothing, or that several groups have.
    """
    finder = _Finder(unknowns)
    return [finder.find(str(name)) for name in names]


class _Finder:
    """Rows of points, photographs and parameters by name."""

    def __init__(self, unknowns: Unknowns):
        u = self._unknowns = unknowns
        self._points = {str(u.block.points[p]): (k, int(p)) for k, p in enumerate(u.points)}
        self._images = {str(u.block.images.names[i]): (k, int(i)) for k, i in enumerate(u.images)}

    def find(self, name: str) -> Chosen:
        whole = self._whole(name)
        if whole is not None:
            return whole
        owner, _, part = name.rpartition(":")
        if owner in self._points and part in AXES:
            return Chosen(POINT, *self._points[owner], owner, (AXES.index(part),))
        if owner in self._images and part in ELEMENTS:
            return Chosen(IMAGE, *self._images[owner], owner, (ELEMENTS.index(part),))
        raise InputError(
            f"'{name}' is no point, photograph or parameter of the adjustment",
            "give names as POINT, POINT:Z, PHOTOGRAPH:X0 (or omega …), or a parameter such as bluh.1",
        )

    def _whole(self, name: str) -> Chosen | None:
        if name in self._points:
            return Chosen(POINT, *self._points[name], name, (0, 1, 2))
        if name in self._images:
            return Chosen(IMAGE, *self._images[name], name, tuple(range(6)))
        return self._parameter(name)

    def _parameter(self, name: str) -> Chosen | None:
        shared = self._unknowns.shared
        rows = [k for k, (own, group) in enumerate(zip(shared.names, shared.groups, strict=True))
                if name in (own, f"{own} ({group})")]  # fmt: skip
        if len(rows) > 1:
            groups = ", ".join(f"'{name} ({shared.groups[k]})'" for k in rows[:4])
            raise InputError(f"several groups have a parameter '{name}'", f"give one of {groups}")
        return Chosen(SHARED, rows[0], rows[0], name, (0,)) if rows else None


def joint_cofactors(
    system: NormalSystem, state: State, factor: Factor, estimator: Estimator, chosen: Sequence[Chosen],
    root: ModelRoot | None = None,
) -> tuple[np.ndarray, np.ndarray | None]:  # fmt: skip
    """(k, k) cofactors: 3 rows a point (X, Y, Z), 6 a photograph (X0, Y0, Z0, ω, φ, κ), one a shared parameter.

    In the frame of the adjustment; what is held has zeros. Angles at a middle angle of ±90° are NaN.

    Returns
    -------
    cofactors, and (k, k) the model part of the covariance; None without `root`.
    """
    u = system.unknowns
    columns = [(k, axis) for k, one in enumerate(chosen) for axis in range(_size(one))]
    images, shared, points = _unit_solutions(system, state, factor, estimator, chosen, columns)
    q = np.stack([_taken(chosen[k], axis, images, shared, points) for k, axis in columns])
    if u.block.settings.adjustment.datum == "inner" and u.motions.count:
        inner = inner_datum(system, state, factor, estimator)
        g = np.stack([_taken(chosen[k], axis, inner.images, inner.shared, inner.points) for k, axis in columns])
        qa = np.stack([_taken(chosen[k], axis, inner.q_images, inner.q_shared, inner.q_points) for k, axis in columns])
        q = q - g @ qa.T - qa @ g.T + g @ inner.both @ g.T
    turn = _in_angles(u, state, chosen)
    model = None
    if root is not None:
        model = np.zeros_like(q)
        for part in root.parts:
            of_root = np.stack([_taken(chosen[k], axis, part.images, part.shared, part.points) for k, axis in columns])
            noise = np.zeros_like(q)
            if part.noise > 0.0:
                own = known_root_of(system, shared, points)
                noise = part.noise * (q - own.T @ own)
            model += positive_part((of_root @ of_root.T)[None], noise[None])[0]
        model = turn @ model @ turn.T
    q = turn @ q @ turn.T
    return 0.5 * (q + q.T), model


def _size(one: Chosen) -> int:
    return {POINT: 3, IMAGE: 6, SHARED: 1}[one.kind]


def _unit_solutions(
    system: NormalSystem,
    state: State,
    factor: Factor,
    estimator: Estimator,
    chosen: Sequence[Chosen],
    columns: list[tuple[int, int]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Q·e for the unit vectors e of the columns: of photographs (n, 6, k), shared (s, k) and points (P, 3, k)."""
    u = system.unknowns
    n, s, k = len(u.images), len(u.shared), len(columns)
    sides, right = np.zeros((len(u.points), 3, k)), np.zeros((6 * n + s, k))
    for c, (which, axis) in enumerate(columns):
        one = chosen[which]
        if one.kind == POINT:
            sides[one.row, axis, c] = 1.0
        elif one.kind == IMAGE:
            right[6 * one.row + axis, c] = float(u.eo_free[one.row, axis])
        else:
            right[6 * n + one.row, c] = 1.0
    images, shared, points = solve_sides(system, state, factor, sides, estimator, right[6 * n :])
    if right[: 6 * n].any():
        direct = factor.solve(np.concatenate([right[: 6 * n], np.zeros((s, k))]))
        of_images, of_shared = np.ascontiguousarray(direct[: 6 * n].reshape(n, 6, k)), direct[6 * n :].copy()
        images, shared = images + of_images, shared + of_shared
        points = points + expand_sides(system, state, of_images, of_shared, np.zeros_like(sides), estimator)
    held = ~u.eo_free
    images[held] = 0.0
    return images, shared, points


def _taken(one: Chosen, axis: int, images: np.ndarray, shared: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The row of one scalar."""
    if one.kind == POINT:
        return points[one.row, axis]
    return images[one.row, axis] if one.kind == IMAGE else shared[one.row]


def _in_angles(unknowns: Unknowns, state: State, chosen: Sequence[Chosen]) -> np.ndarray:
    """Partials of the scalars by the unknowns: small rotations become ω, φ, κ."""
    size = sum(_size(one) for one in chosen)
    turn, first = np.eye(size), 0
    of_images = to_angles(unknowns, state) if any(one.kind == IMAGE for one in chosen) else None
    for one in chosen:
        if one.kind == IMAGE and of_images is not None:
            turn[first + 3 : first + 6, first + 3 : first + 6] = of_images[one.row]
        first += _size(one)
    return turn
