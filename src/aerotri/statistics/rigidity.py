"""Whether cameras keep their places on a rigid rig: tests of what a rigid adjustment does not allow.

[D] A photograph that leaves its place by d (position, then rotation vector, axes of the reference camera) changes its
orientation by M·d, M = diag(R_s, R_s). With N and b of the photographs and Q = C(CᵀNC)⁻¹Cᵀ of the rigid adjustment,

    u = Mᵀb,   cov(u) = σ0²·S,   S = Mᵀ(N − N·Q·N)M

at the rigid solution, without another adjustment. One photograph: uᵀS⁻u/σ̂0² of its six elements, an F test. All of a
camera, moving anew at every exposure: the sum of squares of u, locally most powerful for a small variance of the
movements [L: Rao 1948; Verbyla 1993]; it is a sum of χ² weighted with the eigenvalues λ of S, and of λ(1 + ρλ) where
the movements have the variance ρ·σ0². A drift: Σ τ·u over the exposures, τ from −½ to ½.

σ̂0² comes from the same residuals: vᵀPv = uᵀS⁻u + what is independent of u, so P(T > c·vᵀPv) is that of
Σ(λ − c)·χ²₁ − c·χ²_rest > 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import bsr_matrix

from aerotri.adjustment.exposures import exposures_of
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Factor
from aerotri.observations.rigs import STATION
from aerotri.quantiles import f_exceedance, noncentrality
from aerotri.results.adjusted_block import Outcome
from aerotri.results.rigidity import POSITION, ROTATION, HeadTest, Rigidity, StationTests
from aerotri.statistics.weighted_chi_square import weighted_chi_square_exceedance

MOST = 400
"""Photographs of a camera whose S is held at once [C]; of longer flights section by section, their correlations with
one another left out."""
AT_ONCE = 2e7
"""Numbers of right sides that are solved at once [C]."""
NOTHING = 1e-8
"""Share of its normal equations below which nothing of an element is left to test."""
FEWEST = 3
"""Stations from which movements of a camera are tested."""
ROT, POS = slice(3, 6), slice(0, 3)


@dataclass(frozen=True, eq=False)
class _Head:
    """Photographs of one camera of a rig in order of time, their axes (m, 3, 3) and τ (m,)."""

    rig: str
    camera: str
    rows: np.ndarray
    axes: np.ndarray
    tau: np.ndarray


@dataclass(frozen=True, eq=False)
class _Scores:
    """u (6·m,) and S (6·m, 6·m) of photographs of one camera, and the diagonal of MᵀNM (6·m,)."""

    u: np.ndarray
    s: np.ndarray
    size: np.ndarray


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
    tests = _Tests(outcome.vtpv, freedom, settings.alpha, settings.power)
    heads, photographs = [], []
    for head in _heads(system, solution):
        scores = [_scores(system, solution, factor, head, part) for part in _sections(len(head.rows))]
        photographs.append(tests.of_photographs(head, scores))
        if len(head.rows) >= FEWEST:
            drift = _drift(system, solution, factor, head)
            heads.append((head, scores, drift))
    if not photographs:
        return None
    tests = _Tests(outcome.vtpv, freedom, settings.alpha, settings.power, 4 * max(len(heads), 1))
    found = tuple(_with_holm([test for one in heads for test in tests.of_head(*one)], settings.alpha))
    block = system.unknowns.block
    return Rigidity(
        heads=found,
        stations=_stations(system, photographs, settings.alpha),
        alpha=settings.alpha,
        power=settings.power,
        station_detectable=_station_detectable(photographs, tests, sum(len(one.p) for one in photographs)),
        focal_mm={camera.name: camera.focal_length_mm for camera in block.cameras},
    )


def _heads(system: NormalSystem, solution: Solution) -> list[_Head]:
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
        _Head(rig, camera, rows[order], solution.state.rotation[rigging.lead[rows[order]]], tau[rows[order]])
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

    def __init__(self, system: NormalSystem, matrix: BorderedMatrix, head: _Head, part: np.ndarray):
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


def _scores(system: NormalSystem, solution: Solution, factor: Factor, head: _Head, part: np.ndarray) -> _Scores:
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
    return _Scores(u, 0.5 * (s + s.T), size)


def _drift(system: NormalSystem, solution: Solution, factor: Factor, head: _Head) -> _Scores:
    """Score and S of a drift of the camera, six elements."""
    equations = solution.equations
    normals = _Normals(system, equations.matrix, head, np.arange(len(head.rows)))
    tau = np.kron(head.tau[:, None], np.eye(6))
    a = np.concatenate([normals.images @ tau, normals.shared @ tau])
    direct = tau.T @ normals.of_rows(a)
    s = direct - a.T @ factor.solve(a)
    u = tau.T @ normals.of_rows(equations.of_photographs[:, None])[:, 0]
    return _Scores(u, 0.5 * (s + s.T), np.diagonal(direct).copy())


@dataclass(frozen=True, eq=False)
class _Photographs:
    """The tests of the photographs of one camera, as `StationTests`; s_rot (m, 3) diagonal of S over σ0² scale."""

    head: _Head
    turned: np.ndarray
    sigma: np.ndarray
    freedom: np.ndarray
    f: np.ndarray
    p: np.ndarray
    information: np.ndarray


@dataclass(frozen=True)
class _Tests:
    """The tests themselves, with vᵀPv and redundancy of the adjustment; `count` of them share α."""

    vtpv: float
    freedom: float
    alpha: float
    power: float
    count: int = 1

    @property
    def variance(self) -> float:
        """σ̂0²."""
        return self.vtpv / self.freedom

    def of_photographs(self, head: _Head, scores: list[_Scores]) -> _Photographs:
        """Every photograph of a camera by itself."""
        m = len(head.rows)
        turned, sigma, information = np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.zeros((m, 3))
        freedom, f, p = np.zeros(m, dtype=np.int64), np.full(m, np.nan), np.ones(m)
        k = 0
        for part in scores:
            for at in range(0, len(part.u), 6):
                own = slice(at, at + 6)
                u, s, size = part.u[own], part.s[own, own], part.size[own]
                inverse, freedom[k] = _inverse(s, size)
                if freedom[k] and self.freedom > freedom[k]:
                    f[k], p[k] = self._f_test(float(u @ inverse @ u), int(freedom[k]))
                information[k] = np.diagonal(s)[ROT]
                inverse, rank = _inverse(s[ROT, ROT], size[ROT])
                if rank == 3:
                    turned[k] = inverse @ u[ROT]
                    sigma[k] = np.sqrt(self.variance * np.diagonal(inverse))
                k += 1
        return _Photographs(head, turned, sigma, freedom, f, p, information)

    def of_head(self, head: _Head, scores: list[_Scores], drift: _Scores) -> list[HeadTest]:
        """Movements and drift of a camera, first in rotation, then in position beyond that."""
        out = []
        beyond = {ROTATION: (scores, drift), POSITION: ([_beyond_rotations(one) for one in scores],
                                                        _beyond_rotations(drift))}  # fmt: skip
        for what, (every, trend) in beyond.items():
            at = ROT if what == ROTATION else POS
            movement, movement_sigma, p, detectable = self._movement(*self._movement_parts(every, np.arange(6)[at]))
            inverse, rank = _inverse(trend.s[at, at], trend.size[at])
            change, change_sigma, drift_p, drift_detectable = np.full(3, np.nan), np.full(3, np.nan), 1.0, np.nan
            if rank == 3:
                change, variances = inverse @ trend.u[at], self.variance * np.diagonal(inverse)
                change_sigma = np.sqrt(variances)
                drift_p = self._f_test(float(trend.u[at] @ change), 3)[1]
                needed = noncentrality(3.0, self.alpha / self.count, self.power)
                worst = 1.0 / np.linalg.eigvalsh(trend.s[at, at])[0]
                drift_detectable = float(np.sqrt(needed * self.variance * worst))
            out.append(
                HeadTest(
                    head.rig, head.camera, what, len(head.rows), movement, movement_sigma, p, False, detectable,
                    change, change_sigma, drift_p, False, drift_detectable,
                )
            )  # fmt: skip
        return out

    def _f_test(self, squared: float, rank: int) -> tuple[float, float]:
        """F of a quadratic form that is part of vᵀPv, and P of a larger one."""
        rest = max((self.vtpv - squared) / (self.freedom - rank), 1e-300)
        f = squared / rank / rest
        return f, f_exceedance(f, rank, self.freedom - rank)

    def _movement_parts(self, scores: list[_Scores], own: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Eigenvalues of S, Σu², and Σu² less what is expected, over all sections."""
        values, total = [], 0.0
        for part in scores:
            at = (np.arange(0, len(part.u), 6)[:, None] + own).ravel()
            # elements that nothing is known of count nothing
            eigen = np.linalg.eigvalsh(part.s[np.ix_(at, at)])
            values.append(eigen[eigen > NOTHING * max(float(part.size[at].max(initial=0.0)), 1e-300)])
            total += float(part.u[at] @ part.u[at])
        eigenvalues = np.concatenate(values)
        return eigenvalues, total, total - self.variance * float(eigenvalues.sum())

    def _movement(self, eigenvalues: np.ndarray, total: float, excess: float) -> tuple[float, float, float, float]:
        """σ of movements with its own σ, P of such a sum of squares by chance, and the σ that would be found."""
        squares = float(np.sum(eigenvalues**2))
        if not squares > 0.0:
            return 0.0, np.nan, 1.0, np.nan
        variance = max(excess / squares, 0.0)
        rho = variance / self.variance
        spread = self.variance * np.sqrt(2.0 * np.sum((eigenvalues * (1.0 + rho * eigenvalues)) ** 2)) / squares
        movement = float(np.sqrt(variance))
        own_sigma = float(spread / (2.0 * movement)) if movement > 0.0 else float(np.sqrt(spread))
        p = self._exceedance(eigenvalues, total / self.vtpv, 0.0)
        return movement, own_sigma, p, self._detectable(eigenvalues)

    def _exceedance(self, eigenvalues: np.ndarray, ratio: float, rho: float) -> float:
        """P(Σu² > ratio·vᵀPv) where the movements have the variance ρ·σ0²."""
        rest = max(self.freedom - len(eigenvalues), 0.0)
        weights = np.append((1.0 + rho * eigenvalues) * (eigenvalues - ratio), -ratio)
        return weighted_chi_square_exceedance(weights, np.append(np.ones(len(eigenvalues)), rest), 0.0)

    def _detectable(self, eigenvalues: np.ndarray) -> float:
        """σ of movements that the first of `count` tests finds with the power asked for."""
        level, largest = self.alpha / self.count, float(eigenvalues.max())
        mean = float(eigenvalues.sum()) / self.freedom
        top = largest
        if self._exceedance(eigenvalues, 0.999999 * top, 0.0) > level:
            return np.nan

        def too_likely(ratio: float) -> float:
            return self._exceedance(eigenvalues, ratio, 0.0) - level

        ratio = cast(float, brentq(too_likely, mean, 0.999999 * top))

        def missing(log_rho: float) -> float:
            return self._exceedance(eigenvalues, ratio, float(np.exp(log_rho))) - self.power

        low, high = np.log(1e-6 / largest), np.log(1e12 / largest)
        if missing(high) < 0.0:
            return np.nan
        return float(np.sqrt(self.variance * np.exp(cast(float, brentq(missing, low, high)))))


def _inverse(s: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, int]:
    """S⁻ where `size` says what is not rounding, and its rank."""
    unit = 1.0 / np.sqrt(np.maximum(size, 1e-300))
    values, vectors = np.linalg.eigh(s * np.outer(unit, unit))
    keep = values > NOTHING
    vectors = vectors[:, keep] * unit[:, None]
    return (vectors / values[keep]) @ vectors.T, int(keep.sum())


def _beyond_rotations(one: _Scores) -> _Scores:
    """Scores of positions where rotations of the same photographs are free, in the places of positions."""
    rot = (np.arange(0, len(one.u), 6)[:, None] + np.arange(3, 6)).ravel()
    pos = rot - 3
    inverse, _ = _inverse(one.s[np.ix_(rot, rot)], one.size[rot])
    gain = one.s[np.ix_(pos, rot)] @ inverse
    u, s = np.zeros_like(one.u), np.zeros_like(one.s)
    u[pos] = one.u[pos] - gain @ one.u[rot]
    left = one.s[np.ix_(pos, pos)] - gain @ one.s[np.ix_(rot, pos)]
    s[np.ix_(pos, pos)] = 0.5 * (left + left.T)
    return _Scores(u, s, one.size)


def holm(p: np.ndarray, alpha: float) -> np.ndarray:
    """(n,) bool, which of n tests reject, with the probability α of one or more false alarms [L: Holm 1979]."""
    order = np.argsort(p, kind="stable")
    small = p[order] <= alpha / np.arange(len(p), 0, -1)
    found = np.zeros(len(p), dtype=bool)
    found[order[: len(p) if small.all() else int(np.argmin(small))]] = True
    return found


def _with_holm(tests: list[HeadTest], alpha: float) -> list[HeadTest]:
    """The tests with what is found when all are taken together."""
    found = holm(np.array([p for one in tests for p in (one.movement_p, one.drift_p)]), alpha)
    return [
        replace(one, movement_found=bool(found[2 * k]), drift_found=bool(found[2 * k + 1]))
        for k, one in enumerate(tests)
    ]


def _stations(system: NormalSystem, every: list[_Photographs], alpha: float) -> StationTests:
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


def _station_detectable(every: list[_Photographs], tests: _Tests, count: int) -> dict[tuple[str, str], float]:
    """Rotation of a single photograph about its worst axis that would be found, median of a camera's."""
    needed = noncentrality(6.0, tests.alpha / count, tests.power)
    out = {}
    for one in every:
        least = np.maximum(one.information.min(axis=1), 0.0)
        with np.errstate(divide="ignore"):
            out[one.head.rig, one.head.camera] = float(np.median(np.sqrt(needed * tests.variance / least)))
    return out
