"""Gains and offsets of photographs so that their colours agree where they overlap, held in the mean.

[D] Photographs a, b with n common cells, means m, standard deviations s and the correlation r have two conditions:
ln g_a + ln s_a = ln g_b + ln s_b ± √((1 − r²)/n), and with these gains g_a·m_a + o_a = g_b·m_b + o_b ± σ_d/√n, σ_d that
of the differences. Both are adjusted one after the other. (The sum of squares of g_a·c_a + o_a − g_b·c_b − o_b is no
good measure: noise makes it smaller with every smaller gain, from photograph to photograph.) A photograph that overlaps
little is held by pseudo-observations g = 1 ± `GAIN_SIGMA`, o = 0 ± `OFFSET_SIGMA`; the means of ln g and o are 0.

What does not belong to the ground (cars, water) is left out. Before gains are known it looks like a few photographs of
another exposure, so the first adjustment takes the cells that follow the relation of most cells of their own pair,
which holds for any exposure; only then all cells are held against one limit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.terrain.ortho.candidates import Candidates

GAIN_SIGMA, OFFSET_SIGMA = 0.3, 0.05
"""By which exposures may differ, and share of white by which haze may [C]."""
DARKEST, BRIGHTEST = 0.01, 0.98
"""Colours that count, shares of white: others are clipped."""
LIMIT = 2.5
"""Differences beyond this number of robust standard deviations do not count [C]: cars, water, trees."""
ROUNDS, SETTLED = 50, 1e-3
"""Adjustments of a band at most, and change of the gains with which they end [C]."""
LEAST_LIMIT = 2.5e-4
"""Share of white that differences may always have [C]: where photographs are free of noise."""
FEWEST_CELLS = 10
"""Of a pair of photographs [C]."""
MOST_OF_PAIR = 1000
"""Cells of a pair of photographs that are taken [C]: gains are good to a few thousandths with them."""
NOISE = 1e-3
"""Least standard deviation of colours, share of white [C]: one without any texture says nothing about gains."""
CORRELATED_CELLS = 25.0
"""Neighbouring cells differ alike: one in so many counts [C]."""
MOST_CELLS = 100_000
"""Coarse cells that colours are held against one another in; of more, rows and columns are left out evenly [C]."""
MOST_COUNTED = 20_000_000
"""Pairs of photographs that are counted in a table; more are sorted."""
FAR, VISIBLE = 3.0, 0.02
"""A photograph that is off differs from others so many times as much as photographs do at the median, and at least by
so much of white [C]."""


@dataclass(frozen=True, eq=False)
class Balance:
    """c ↦ gain·c + offset.

    Parameters
    ----------
    gain : (n, bands). offset : (n, bands), shares of white.
    before, after : robust standard deviation of the difference of two photographs, shares of white; NaN without any.
    left : (n,) the same of every photograph from others, after.
    """

    gain: np.ndarray
    offset: np.ndarray
    before: float
    after: float
    left: np.ndarray

    @property
    def off(self) -> np.ndarray:
        """Numbers of the photographs that agree with the others far less than these do, the worst first."""
        known = self.left[np.isfinite(self.left)]
        if not len(known):
            return np.zeros(0, np.intp)
        order = np.argsort(-self.left, kind="stable")
        return order[self.left[order] > max(FAR * float(np.median(known)), VISIBLE)]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Cells that two photographs show, of one band.

    Parameters
    ----------
    a, b : (k,) photographs. at : (m,) the pair of every cell. x, y : (m,) colours in a and in b.
    """

    a: np.ndarray
    b: np.ndarray
    at: np.ndarray
    x: np.ndarray
    y: np.ndarray


def no_balance(count: int, candidates: Candidates) -> Balance:
    """Colours as they are."""
    candidates = _thinned(candidates)
    bands = candidates.value.shape[1]
    gain, offset = np.ones((count, bands)), np.zeros((count, bands))
    difference = _differences(candidates, gain, offset)
    spread = _spread(difference)
    return Balance(gain, offset, spread, spread, _left(count, candidates, difference))


def balance_of(count: int, candidates: Candidates) -> Balance:
    """Gains and offsets of n photographs."""
    candidates = _thinned(candidates)
    found = no_balance(count, candidates)
    if np.isnan(found.before):
        return found
    gain, offset = found.gain, found.offset
    for band in range(gain.shape[1]):
        gain[:, band], offset[:, band] = _of_band(count, _pairs(candidates, band))
    difference = _differences(candidates, gain, offset)
    return Balance(gain, offset, found.before, _spread(difference), _left(count, candidates, difference))


def _thinned(candidates: Candidates) -> Candidates:
    every = max(int(np.sqrt(candidates.z.size / MOST_CELLS)), 1)
    thin = np.s_[..., ::every, ::every]
    return replace(candidates, found=candidates.found[thin], value=candidates.value[thin], z=candidates.z[thin])


def _of_band(count: int, pairs: _Pairs) -> tuple[np.ndarray, np.ndarray]:
    """Gains and offsets (n,) of one band."""
    p = pairs
    gain, offset = _solved(count, p, _follows_pair(p))
    for _ in range(ROUNDS):
        difference = np.abs(gain[p.a][p.at] * p.x + offset[p.a][p.at] - gain[p.b][p.at] * p.y - offset[p.b][p.at])
        limit = LIMIT * SIGMA_PER_MAD * float(np.median(difference)) if len(difference) else 0.0
        before = gain
        gain, offset = _solved(count, p, difference <= max(limit, LEAST_LIMIT))
        if np.abs(gain - before).max() < SETTLED:
            break
    return gain, offset


def _follows_pair(pairs: _Pairs) -> np.ndarray:
    """(m,) whether cells have the relation y = k·x + c of most cells of their pair, √k·x and y/√k being compared."""
    at, n = pairs.at, len(pairs.a)
    x, y = (v - _medians(at, v, n)[at] for v in (pairs.x, pairs.y))
    one, other = (np.maximum(SIGMA_PER_MAD * _medians(at, np.abs(v), n), NOISE) for v in (x, y))
    root = np.sqrt(other / one)[at]
    difference = root * x - y / root
    difference = np.abs(difference - _medians(at, difference, n)[at])
    limit = LIMIT * SIGMA_PER_MAD * _medians(at, difference, n)
    return difference <= np.maximum(limit, LEAST_LIMIT)[at]


def _medians(at: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """(n,) medians of the values of every group, of two middle ones the smaller; NaN without any."""
    out = np.full(n, np.nan)
    if not len(values):
        return out
    size = np.bincount(at, minlength=n)
    group = np.flatnonzero(size)
    # group and value in one number, which is sorted in a quarter of the time of both
    low, span = float(values.min()), 2.0 * float(np.ptp(values)) or 1.0
    ordered = np.sort(at + (values - low) / span)
    middle = np.cumsum(size) - size + (size - 1) // 2
    out[group] = (ordered[middle[group]] - group) * span + low
    return out


def balanced(candidates: Candidates, balance: Balance) -> np.ndarray:
    """(q, bands, r, c) float32 colours of the candidates."""
    return _changed(candidates, balance.gain, balance.offset)


def _changed(candidates: Candidates, gains: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    number = np.maximum(candidates.found, 0)
    out = np.empty_like(candidates.value)
    for band in range(out.shape[1]):
        gain, offset = gains[:, band].astype(np.float32), offsets[:, band].astype(np.float32)
        out[:, band] = candidates.value[:, band] * gain[number] + offset[number]
    return out


def _differences(candidates: Candidates, gain: np.ndarray, offset: np.ndarray) -> list[np.ndarray]:
    """(bands, r, c) best less every other photograph of a cell; NaN where there is none."""
    value = _changed(candidates, gain, offset)
    return [value[0] - value[q] for q in range(1, len(value))]


def _spread(differences: list[np.ndarray]) -> float:
    """Robust standard deviation."""
    every = max(sum(d.size for d in differences) // 1_000_000, 1)
    known = np.concatenate([d.ravel()[::every] for d in differences])
    known = known[np.isfinite(known)]
    return float(SIGMA_PER_MAD * np.median(np.abs(known))) if len(known) else float("nan")


def _left(count: int, candidates: Candidates, differences: list[np.ndarray]) -> np.ndarray:
    """(n,) robust standard deviations of the differences of photographs from others; NaN with few cells."""
    number, size = [np.zeros(0, np.int32)], [np.zeros(0, np.float32)]
    for q, difference in enumerate(differences, start=1):
        one = np.abs(difference).mean(axis=0)
        known = np.isfinite(one)
        for found in (candidates.found[0], candidates.found[q]):
            number.append(found[known])
            size.append(one[known])
    at = np.concatenate(number)
    out = SIGMA_PER_MAD * _medians(at, np.concatenate(size), count)
    return np.where(np.bincount(at, minlength=count) >= FEWEST_CELLS, out, np.nan)


def _pairs(candidates: Candidates, band: int) -> _Pairs:
    """Of the best photograph of cells and every other one, without clipped colours."""
    c = candidates
    keys, first, second = [], [], []
    count = int(c.found.max()) + 1
    for q in range(1, len(c.found)):
        one, other = c.value[0, band], c.value[q, band]
        usable = np.ones(one.shape, bool)
        for value in (one, other):
            usable &= (value > DARKEST) & (value < BRIGHTEST)
        keys.append(c.found[0][usable].astype(np.int64) * count + c.found[q][usable])
        first.append(one[usable].astype(float))
        second.append(other[usable].astype(float))
    which, at = _numbered(np.concatenate(keys), count * count)
    some = _evenly(at, len(which))
    x, y = np.concatenate(first)[some], np.concatenate(second)[some]
    return _Pairs(which // count, which % count, at[some], x, y)


def _evenly(at: np.ndarray, n: int) -> np.ndarray:
    """(m,) bool, some of the cells of every pair, evenly, where it has more than are taken."""
    size = np.bincount(at, minlength=n)
    every = -(-size // MOST_OF_PAIR)
    if (every <= 1).all():
        return np.ones(len(at), bool)
    order = np.argsort(at, kind="stable")
    rank = np.empty(len(at), np.intp)
    rank[order] = np.arange(len(at)) - np.repeat(np.cumsum(size) - size, size)
    return rank % every[at] == 0


def _numbered(values: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Whole numbers below `most` that occur, rising, and the place of every value among them."""
    if most > MOST_COUNTED:
        return np.unique(values, return_inverse=True)
    there = np.zeros(most, bool)
    there[values] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[values]


def _solved(n: int, pairs: _Pairs, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gains and offsets (n,) of one band from the cells that count, (m,)."""
    at, x, y = pairs.at[counts], pairs.x[counts], pairs.y[counts]
    weights = (np.ones_like(x), x, y, x * x, y * y, x * y)
    sums = np.stack([np.bincount(at, w, len(pairs.a)) for w in weights], axis=1)
    enough = sums[:, 0] >= FEWEST_CELLS
    a, b, sums = pairs.a[enough], pairs.b[enough], sums[enough]
    cells = sums[:, 0] / CORRELATED_CELLS
    ma, mb, aa, bb, ab = (sums[:, 1:] / sums[:, :1]).T
    va, vb = np.maximum(aa - ma * ma, NOISE**2), np.maximum(bb - mb * mb, NOISE**2)
    common = ab - ma * mb
    unlike = 1.0 - np.clip(common**2 / (va * vb), 0.0, 1.0) + NOISE**2 / np.minimum(va, vb)
    gain = np.exp(levelled(n, a, b, 0.5 * np.log(vb / va), unlike / cells, GAIN_SIGMA))
    difference = gain[a] ** 2 * va + gain[b] ** 2 * vb - 2.0 * gain[a] * gain[b] * common
    variance = np.maximum(difference, NOISE**2) / cells
    return gain, levelled(n, a, b, gain[b] * mb - gain[a] * ma, variance, OFFSET_SIGMA)


def levelled(
    n: int, a: np.ndarray, b: np.ndarray, difference: np.ndarray, variance: np.ndarray, sigma: float
) -> np.ndarray:
    """(n,) x with x_a − x_b = difference ± √variance and x = 0 ± sigma, their mean 0: a net of height differences."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    every, weight = np.arange(n), 1.0 / variance
    entries = np.concatenate([weight, weight, -weight, -weight, np.full(n, 1.0 / sigma**2)])
    row, column = np.concatenate([a, b, a, b, every]), np.concatenate([a, b, b, a, every])
    normal = coo_matrix((entries, (row, column)), shape=(n, n)).tocsc()
    right = np.bincount(a, weight * difference, n) - np.bincount(b, weight * difference, n)
    found = np.asarray(spsolve(normal, right)).reshape(n)
    return found - found.mean()
