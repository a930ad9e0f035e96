"""Whether cameras keep their places on a rigid rig: tests of what a rigid adjustment does not allow.

[D] A photograph that leaves its place by d (position, then rotation vector, axes of the reference camera) changes its
orientation by M·d, M = diag(R_s, R_s). With N and b of the photographs and Q = C(CᵀNC)⁻¹Cᵀ of the rigid adjustment,

    u = Mᵀb,   cov(u) = σ0²·S,   S = Mᵀ(N − N·Q·N)M

at the rigid solution, without another adjustment. One photograph: uᵀS⁻u/σ̂0² of its six elements, an F test. All of a
camera, moving anew at every exposure: the sum of squares of u, locally most powerful for a small variance of the
movements [L: Rao 1948; Verbyla 1993]; it is a sum of χ² weighted with the eigenvalues λ of S, and of λ(1 + ρλ) where
the movements have the variance ρ·σ0². A drift: Σ τ·u over the exposures, τ from −½ to ½.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import bsr_matrix

from aerotri.adjustment.exposures import exposures_of
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Factor
from aerotri.observations.rigs import STATION
from aerotri.quantiles import noncentrality
from aerotri.results.adjusted_block import Outcome
from aerotri.results.rigidity import HeadTest, Rigidity, StationTests, WholeStations
from aerotri.statistics.rigidity_tests import POS, ROT, Head, Photographs, Scores, Tests, holm

MOST = 400
"""Photographs of a camera whose S is held at once [C]; of longer flights section by section, their correlations with
one another left out."""
AT_ONCE = 2e7
"""Numbers of right sides that are solved at once [C]."""
AT_A_TIME = 100
"""Photographs of stations that are tested together [C]: each is solved for with all of them."""
FEWEST = 3
"""Stations from which movements of a camera are tested."""


def rigidity_of(system: NormalSystem, solution: Solution, factor: Factor, outcome: Outcome) -> Rigidity | None:
    """The tests of all cameras on rigid rigs; None where there are none, or nothing to test with.

    Parameters
    ----------
    factor : of the undamped equations at the solution.
    """
    rigging, freedom = system.unknowns.rigging, float(outcome.redundancy)
    if rigging is None or not outcome.vtpv > 0.0 or freedom < 1.0:
        return None
    settings = system.unknowns.block.settings.adjustment
    tests = Tests(outcome.vtpv, freedom, settings.alpha, settings.power)
    heads, photographs, every = [], [], _heads(system, solution)
    for head in every:
        scores = [_scores(system, solution, factor, head, part) for part in _sections(len(head.rows))]
        photographs.append(tests.of_photographs(head, scores))
        if len(head.rows) >= FEWEST:
            drift = _drift(system, solution, factor, head)
            heads.append((head, scores, drift))
    if not photographs:
        return None
    tests = Tests(outcome.vtpv, freedom, settings.alpha, settings.power, 4 * max(len(heads), 1))
    found = tuple(_with_holm([test for one in heads for test in tests.of_head(*one)], settings.alpha))
    block = system.unknowns.block
    return Rigidity(
        heads=found,
        stations=_stations(system, photographs, settings.alpha),
        whole=_whole_stations(system, solution, factor, every, tests),
        alpha=settings.alpha,
        power=settings.power,
        station_detectable=_station_detectable(photographs, tests, sum(len(one.p) for one in photographs)),
        focal_mm={camera.name: camera.focal_length_mm for camera in block.cameras},
    )


def _heads(system: NormalSystem, solution: Solution) -> list[Head]:
    """The mounted cameras, and the reference camera where there are two others to tell it from them."""
    u, rigging = system.unknowns, system.unknowns.rigging
    if rigging is None:
        return []
    block, rays = u.block, np.bincount(u.rays.image, minlength=len(u.images))
    usable = (rays > 0) & u.eo_free.all(axis=1) & ~u.by_angles
    tau = _times(system, solution)
    names = rigging.mountings.cameras
    out = []
    for rig in block.rigs:
        own = [k for k, name in enumerate(names) if name in rig.cameras]
        for k in own:
            out.append((rig.name, names[k], np.flatnonzero((rigging.mounting == k) & usable)))
        if len(own) > 1:
            led = np.unique(rigging.lead[np.isin(rigging.mounting, own)])
            out.append((rig.name, rig.reference, led[usable[led]]))
    return [
        Head(rig, camera, rows[order], solution.state.rotation[rigging.lead[rows[order]]], tau[rows[order]])
        for rig, camera, rows in out
        if len(rows) and len(order := np.argsort(tau[rows], kind="stable"))
    ]


def _times(system: NormalSystem, solution: Solution) -> np.ndarray:
    """(n,) from −½ at the first exposure to ½ at the last, flights one behind the other."""
    u = system.unknowns
    assert u.rigging is not None
    leads = u.rigging.leads
    exposures = exposures_of(u.block, u.images[leads], solution.state.centre[leads])
    time, behind = np.zeros(len(leads)), 0.0
    for flight in np.unique(exposures.flight):
        own = exposures.flight == flight
        since = exposures.time[own] - exposures.time[own].min()
        time[own] = behind + since
        behind += float(since.max()) + exposures.usual_step
    span = float(np.ptp(time))
    tau = (time - time.min()) / span - 0.5 if span > 0.0 else np.zeros(len(time))
    every = np.zeros(len(u.images))
    every[leads] = tau
    return every[u.rigging.lead]


def _sections(count: int) -> list[np.ndarray]:
    """Rows of sections of at most `MOST`, about equally long."""
    return [np.asarray(part) for part in np.array_split(np.arange(count), max(-(-count // MOST), 1))]


class _Normals:
    """N·M of chosen photographs from the matrix of all."""

    def __init__(self, system: NormalSystem, matrix: BorderedMatrix, head: Head, part: np.ndarray):
        u, rows = system.unknowns, head.rows[part]
        n, m = len(u.images), len(rows)
        own = np.full(n, -1)
        own[rows] = np.arange(m)
        move = np.zeros((m, 6, 6))
        move[:, POS, POS] = move[:, ROT, ROT] = head.axes[part]
        low, high = u.block_row, u.block_col
        as_is = np.flatnonzero(own[high] >= 0)
        turned = np.flatnonzero((own[low] >= 0) & (low != high))
        at = np.concatenate([low[as_is], high[turned]])
        column = np.concatenate([own[high[as_is]], own[low[turned]]])
        blocks = np.concatenate([matrix.blocks[as_is], np.swapaxes(matrix.blocks[turned], 1, 2)]) @ move[column]
        order = np.lexsort((column, at))
        start = np.concatenate([[0], np.cumsum(np.bincount(at, minlength=n))])
        self.images = bsr_matrix((blocks[order], column[order], start), shape=(6 * n, 6 * m)).tocsc()
        self.size = 6 * n
        self.shared = np.swapaxes(matrix.border[rows] @ move, 0, 1).reshape(matrix.border.shape[1], 6 * m)
        self.rows, self.move = rows, move

    def dense(self, columns: slice) -> np.ndarray:
        """Some columns, (6·n + s, k)."""
        return np.concatenate([self.images[:, columns].toarray(), self.shared[:, columns]])

    def of_rows(self, full: np.ndarray) -> np.ndarray:
        """Mᵀ·full at the chosen photographs: (6·n + s, k) → (6·m, k)."""
        n = self.size
        chosen = full[:n].reshape(n // 6, 6, -1)[self.rows]
        return (np.swapaxes(self.move, 1, 2) @ chosen).reshape(6 * len(self.rows), -1)


def _scores(system: NormalSystem, solution: Solution, factor: Factor, head: Head, part: np.ndarray) -> Scores:
    """u and S of a section of the photographs of a camera."""
    equations = solution.equations
    normals = _Normals(system, equations.matrix, head, part)
    count = 6 * len(part)
    s = np.empty((count, count))
    size = np.empty(count)
    step = max(int(AT_ONCE / (normals.size + len(normals.shared))), 6)
    transposed = normals.images.T.tocsr()
    for first in range(0, count, step):
        columns = slice(first, min(first + step, count))
        a = normals.dense(columns)
        direct = normals.of_rows(a)
        x = factor.solve(a)
        n = normals.size
        s[:, columns] = direct - transposed @ x[:n] - normals.shared.T @ x[n:]
        size[columns] = direct[np.arange(first, columns.stop), np.arange(columns.stop - first)]
    u = normals.of_rows(equations.of_photographs[:, None])[:, 0]
    return Scores(u, 0.5 * (s + s.T), size)


def _drift(system: NormalSystem, solution: Solution, factor: Factor, head: Head) -> Scores:
    """Score and S of a drift of the camera, six elements."""
    equations = solution.equations
    normals = _Normals(system, equations.matrix, head, np.arange(len(head.rows)))
    tau = np.kron(head.tau[:, None], np.eye(6))
    a = np.concatenate([normals.images @ tau, normals.shared @ tau])
    direct = tau.T @ normals.of_rows(a)
    s = direct - a.T @ factor.solve(a)
    u = tau.T @ normals.of_rows(equations.of_photographs[:, None])[:, 0]
    return Scores(u, 0.5 * (s + s.T), np.diagonal(direct).copy())


def _with_holm(tests: list[HeadTest], alpha: float) -> list[HeadTest]:
    """The tests with what is found when all are taken together."""
    found = holm(np.array([p for one in tests for p in (one.movement_p, one.drift_p)]), alpha)
    return [
        replace(one, movement_found=bool(found[2 * k]), drift_found=bool(found[2 * k + 1]))
        for k, one in enumerate(tests)
    ]


def _stations(system: NormalSystem, every: list[Photographs], alpha: float) -> StationTests:
    """The tests of all photographs, in the order of the block."""
    block = system.unknowns.block
    image = system.unknowns.images[np.concatenate([one.head.rows for one in every])]
    order = np.argsort(image, kind="stable")
    p = np.concatenate([one.p for one in every])

    def names(name: str) -> np.ndarray:
        return np.concatenate([np.full(len(one.p), getattr(one.head, name), dtype=object) for one in every])[order]

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(one, name) for one in every])[order]

    return StationTests(
        image=image[order],
        rig=names("rig"),
        camera=names("camera"),
        station=np.asarray(block.images.columns[STATION], dtype=object)[image[order]],
        turned=joined("turned"),
        sigma=joined("sigma"),
        freedom=joined("freedom"),
        f=joined("f"),
        p=joined("p"),
        found=holm(p, alpha)[order],
    )


def _whole_stations(
    system: NormalSystem, solution: Solution, factor: Factor, heads: list[Head], tests: Tests
) -> WholeStations:
    """The tests of all exposures with two photographs or more, in the order of the block."""
    u = system.unknowns
    assert u.rigging is not None
    rig_of = {int(row): head.rig for head in heads for row in head.rows}
    for row in list(rig_of):
        # of two cameras the reference camera is no head of its own, but belongs to its stations
        rig_of.setdefault(int(u.rigging.lead[row]), rig_of[row])
    usable = (np.bincount(u.rays.image, minlength=len(u.images)) > 0) & u.eo_free.all(axis=1) & ~u.by_angles
    rows = np.array(sorted((int(u.rigging.lead[row]), row) for row in rig_of if usable[row]), np.int64).reshape(-1, 2)
    lead, first, count = np.unique(rows[:, 0], return_index=True, return_counts=True)
    lead, first, count = lead[count > 1], first[count > 1], count[count > 1]
    freedom, f, p = [], [], []
    for part in _batches(count):
        own = np.concatenate([rows[a : a + k, 1] for a, k in zip(first[part], count[part], strict=True)])
        axes = solution.state.rotation[u.rigging.lead[own]]
        together = Head("", "", own, axes, np.zeros(len(own)))
        found = tests.of_stations(_scores(system, solution, factor, together, np.arange(len(own))), count[part])
        for kept, new in zip((freedom, f, p), found, strict=True):
            kept.extend(new)
    names = np.asarray(u.block.images.columns[STATION], dtype=object)
    return WholeStations(
        rig=np.array([rig_of[int(row)] for row in lead], dtype=object),
        station=names[u.images[lead]],
        photographs=count,
        freedom=np.array(freedom, dtype=np.int64),
        f=np.array(f, dtype=float),
        p=np.array(p, dtype=float),
        found=holm(np.array(p, dtype=float), tests.alpha),
    )


def _batches(count: np.ndarray) -> list[slice]:
    """Runs of stations with about `AT_A_TIME` photographs together."""
    number = (np.cumsum(count) - count) // AT_A_TIME
    edges = [*np.flatnonzero(np.diff(number, prepend=-1)).tolist(), len(count)]
    return [slice(a, b) for a, b in pairwise(edges)]


def _station_detectable(every: list[Photographs], tests: Tests, count: int) -> dict[tuple[str, str], float]:
    """Rotation of a single photograph about its worst axis that would be found, median of a camera's."""
    needed = noncentrality(6.0, tests.alpha / count, tests.power)
    out = {}
    for one in every:
        least = np.maximum(one.information, 0.0)
        with np.errstate(divide="ignore"):
            out[one.head.rig, one.head.camera] = float(np.median(np.sqrt(needed * tests.variance / least)))
    return out
