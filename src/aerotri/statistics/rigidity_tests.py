"""Tests whether a camera keeps its place on a rigid rig, from the scores u and S of its photographs.

See `rigidity` for u and S. σ̂0² comes from the same residuals: vᵀPv = uᵀS⁻u + what is independent of u, so
P(T > c·vᵀPv) is that of Σ(λ − c)·χ²₁ − c·χ²_rest > 0. Positions are tested beyond what rotations explain, against vᵀPv
without it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from scipy.optimize import brentq

from aerotri.quantiles import f_exceedance, noncentrality
from aerotri.results.rigidity import POSITION, ROTATION, HeadTest
from aerotri.statistics.weighted_chi_square import weighted_chi_square_exceedance

NOTHING = 1e-8
"""Share of its normal equations below which nothing of an element is left to test."""
ROT, POS = slice(3, 6), slice(0, 3)


@dataclass(frozen=True, eq=False)
class Head:
    """Photographs of one camera of a rig in order of time, their axes (m, 3, 3) and τ (m,)."""

    rig: str
    camera: str
    rows: np.ndarray
    axes: np.ndarray
    tau: np.ndarray


@dataclass(frozen=True, eq=False)
class Scores:
    """u (6·m,) and S (6·m, 6·m) of photographs of one camera, and the diagonal of MᵀNM (6·m,)."""

    u: np.ndarray
    s: np.ndarray
    size: np.ndarray


@dataclass(frozen=True, eq=False)
class Photographs:
    """The tests of the photographs of one camera, as `StationTests`; information (m,) of S about the worst axis."""

    head: Head
    turned: np.ndarray
    sigma: np.ndarray
    freedom: np.ndarray
    f: np.ndarray
    p: np.ndarray
    information: np.ndarray


@dataclass(frozen=True)
class Tests:
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

    def of_photographs(self, head: Head, scores: list[Scores]) -> Photographs:
        """Every photograph of a camera by itself."""
        m = len(head.rows)
        turned, sigma, information = np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.zeros(m)
        freedom, f, p = np.zeros(m, dtype=np.int64), np.full(m, np.nan), np.ones(m)
        k = 0
        for part in scores:
            for at in range(0, len(part.u), 6):
                own = slice(at, at + 6)
                u, s, size = part.u[own], part.s[own, own], part.size[own]
                inverse, freedom[k] = _inverse(s, size)
                if freedom[k] and self.freedom > freedom[k]:
                    f[k], p[k] = self._f_test(float(u @ inverse @ u), int(freedom[k]))
                information[k] = np.linalg.eigvalsh(s[ROT, ROT])[0]
                inverse, rank = _inverse(s[ROT, ROT], size[ROT])
                if rank == 3:
                    turned[k] = inverse @ u[ROT]
                    sigma[k] = np.sqrt(self.variance * np.diagonal(inverse))
                k += 1
        return Photographs(head, turned, sigma, freedom, f, p, information)

    def of_stations(self, scores: Scores, photographs: np.ndarray) -> tuple[list[int], list[float], list[float]]:
        """Degrees of freedom, F and P of whole stations, one behind the other with (k,) `photographs` each."""
        freedom, f, p = [], [], []
        for first, count in zip(6 * (np.cumsum(photographs) - photographs), 6 * photographs, strict=True):
            own = slice(int(first), int(first + count))
            inverse, rank = _inverse(scores.s[own, own], scores.size[own])
            value = np.nan, 1.0
            if rank and self.freedom > rank:
                value = self._f_test(float(scores.u[own] @ inverse @ scores.u[own]), rank)
            freedom.append(rank)
            f.append(value[0])
            p.append(value[1])
        return freedom, f, p

    def of_head(self, head: Head, scores: list[Scores], drift: Scores) -> list[HeadTest]:
        """Movements and drift of a camera, first in rotation, then in position beyond that."""
        places, trend = [_beyond_rotations(one) for one in scores], _beyond_rotations(drift)
        parts = {
            ROTATION: (self, scores, self, drift),
            # what turns explain is not noise either: a camera that shifts would hide behind it
            POSITION: (self._without(*scores), places, self._without(drift), trend),
        }
        out = []
        for what, (of_movement, every, of_drift, trend) in parts.items():
            at = ROT if what == ROTATION else POS
            out.append(
                HeadTest(
                    head.rig, head.camera, what, len(head.rows), *of_movement._movement(every, np.arange(6)[at]),
                    *of_drift._drift(trend, at),
                )
            )  # fmt: skip
        return out

    def _without(self, *scores: Scores) -> Tests:
        """The tests beside what turns of these photographs take out of vᵀPv."""
        squared, taken = 0.0, 0
        for one in scores:
            rot = _rotations(one)
            inverse, rank = _inverse(one.s[np.ix_(rot, rot)], one.size[rot])
            squared, taken = squared + float(one.u[rot] @ inverse @ one.u[rot]), taken + rank
        if taken >= self.freedom:
            return self
        return replace(self, vtpv=max(self.vtpv - squared, 1e-300), freedom=self.freedom - taken)

    def _drift(self, trend: Scores, at: slice) -> tuple[np.ndarray, np.ndarray, float, bool, float]:
        """Change with its σ, P of such a one by chance, False, and the change that would be found."""
        inverse, rank = _inverse(trend.s[at, at], trend.size[at])
        if rank < 3 or self.freedom <= 3.0:
            return np.full(3, np.nan), np.full(3, np.nan), 1.0, False, np.nan
        change, sigma = inverse @ trend.u[at], np.sqrt(self.variance * np.diagonal(inverse))
        p = self._f_test(float(trend.u[at] @ change), 3)[1]
        needed = noncentrality(3.0, self.alpha / self.count, self.power)
        worst = 1.0 / np.linalg.eigvalsh(trend.s[at, at])[0]
        return change, sigma, p, False, float(np.sqrt(needed * self.variance * worst))

    def _f_test(self, squared: float, rank: int) -> tuple[float, float]:
        """F of a quadratic form that is part of vᵀPv, and P of a larger one."""
        rest = max((self.vtpv - squared) / (self.freedom - rank), 1e-300)
        f = squared / rank / rest
        return f, f_exceedance(f, rank, self.freedom - rank)

    def _movement_parts(self, scores: list[Scores], own: np.ndarray) -> tuple[np.ndarray, float, float]:
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

    def _movement(self, scores: list[Scores], own: np.ndarray) -> tuple[float, float, float, bool, float]:
        """σ of movements with its own σ, P of such a sum of squares by chance, False, and the σ that would be found."""
        eigenvalues, total, excess = self._movement_parts(scores, own)
        squares = float(np.sum(eigenvalues**2))
        if not squares > 0.0:
            return 0.0, np.nan, 1.0, False, np.nan
        variance = max(excess / squares, 0.0)
        rho = variance / self.variance
        spread = self.variance * np.sqrt(2.0 * np.sum((eigenvalues * (1.0 + rho * eigenvalues)) ** 2)) / squares
        movement = float(np.sqrt(variance))
        own_sigma = float(spread / (2.0 * movement)) if movement > 0.0 else float(np.sqrt(spread))
        p = self._exceedance(eigenvalues, total / self.vtpv, 0.0)
        return movement, own_sigma, p, False, self._detectable(eigenvalues)

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


def _rotations(one: Scores) -> np.ndarray:
    """The rows of rotations."""
    return (np.arange(0, len(one.u), 6)[:, None] + np.arange(3, 6)).ravel()


def _beyond_rotations(one: Scores) -> Scores:
    """Scores of positions where rotations of the same photographs are free, in the places of positions."""
    rot = _rotations(one)
    pos = rot - 3
    inverse, _ = _inverse(one.s[np.ix_(rot, rot)], one.size[rot])
    gain = one.s[np.ix_(pos, rot)] @ inverse
    u, s = np.zeros_like(one.u), np.zeros_like(one.s)
    u[pos] = one.u[pos] - gain @ one.u[rot]
    left = one.s[np.ix_(pos, pos)] - gain @ one.s[np.ix_(rot, pos)]
    s[np.ix_(pos, pos)] = 0.5 * (left + left.T)
    return Scores(u, s, one.size)


def holm(p: np.ndarray, alpha: float) -> np.ndarray:
    """(n,) bool, which of n tests reject, with the probability α of one or more false alarms [L: Holm 1979]."""
    order = np.argsort(p, kind="stable")
    small = p[order] <= alpha / np.arange(len(p), 0, -1)
    found = np.zeros(len(p), dtype=bool)
    found[order[: len(p) if small.all() else int(np.argmin(small))]] = True
    return found
