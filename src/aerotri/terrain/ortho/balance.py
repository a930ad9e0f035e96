"""Gains and offsets of photographs so that their colours agree where they overlap, held in the mean.

[D] Photographs a, b with n common cells, means m, standard deviations s and the correlation r have two conditions:
ln g_a + ln s_a = ln g_b + ln s_b ± √((1 − r²)/n), and with these gains g_a·m_a + o_a = g_b·m_b + o_b ± σ_d/√n, σ_d that
of the differences. Both are adjusted one after the other. (The sum of squares of g_a·c_a + o_a − g_b·c_b − o_b is no
good measure: noise makes it smaller with every smaller gain, from photograph to photograph.) A photograph that overlaps
little is held by pseudo-observations g = 1 ± `GAIN_SIGMA`, o = 0 ± `OFFSET_SIGMA`; the means of ln g and o are 0.
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
LIMIT, ROUNDS = 2.5, 4
"""Differences beyond this number of robust standard deviations do not count [C]: cars, water, trees; and rounds."""
FEWEST_CELLS = 10
"""Of a pair of photographs [C]."""
NOISE = 1e-3
"""Least standard deviation of colours, share of white [C]: one without any texture says nothing about gains."""
CORRELATED_CELLS = 25.0
"""Neighbouring cells differ alike: one in so many counts [C]."""
MOST_CELLS = 100_000
"""Coarse cells that colours are held against one another in; of more, rows and columns are left out evenly [C]."""
MOST_COUNTED = 20_000_000
"""Pairs of photographs that are counted in a table; more are sorted."""


@dataclass(frozen=True, eq=False)
class Balance:
    """c ↦ gain·c + offset.

    Parameters
    ----------
    gain : (n, bands). offset : (n, bands), shares of white.
    before, after : robust standard deviation of the difference of two photographs, shares of white; NaN without any.
    """

    gain: np.ndarray
    offset: np.ndarray
    before: float
    after: float


def no_balance(count: int, candidates: Candidates) -> Balance:
    """Colours as they are."""
    bands = candidates.value.shape[1]
    gain, offset = np.ones((count, bands)), np.zeros((count, bands))
    spread = _spread(_differences(candidates, gain, offset))
    return Balance(gain, offset, spread, spread)


def balance_of(count: int, candidates: Candidates) -> Balance:
    """Gains and offsets of n photographs."""
    every = max(int(np.sqrt(candidates.z.size / MOST_CELLS)), 1)
    thin = np.s_[..., ::every, ::every]
    candidates = replace(candidates, found=candidates.found[thin], value=candidates.value[thin], z=candidates.z[thin])
    bands = candidates.value.shape[1]
    gain, offset = np.ones((count, bands)), np.zeros((count, bands))
    before = _spread(_differences(candidates, gain, offset))
    if np.isnan(before):
        return Balance(gain, offset, before, before)
    for _ in range(ROUNDS):
        difference = _differences(candidates, gain, offset)
        for band in range(bands):
            limit = LIMIT * max(_spread([d[band : band + 1] for d in difference]), 1e-4)
            a, b, sums = _sums(candidates, difference, band, limit)
            gain[:, band], offset[:, band] = _solved(count, a, b, sums)
    return Balance(gain, offset, before, _spread(_differences(candidates, gain, offset)))


def balanced(candidates: Candidates, balance: Balance) -> np.ndarray:
    """(q, bands, r, c) float32 colours of the candidates."""
    number = np.maximum(candidates.found, 0)
    out = np.empty_like(candidates.value)
    for band in range(out.shape[1]):
        gain, offset = balance.gain[:, band].astype(np.float32), balance.offset[:, band].astype(np.float32)
        out[:, band] = candidates.value[:, band] * gain[number] + offset[number]
    return out


def _differences(candidates: Candidates, gain: np.ndarray, offset: np.ndarray) -> list[np.ndarray]:
    """(bands, r, c) best less every other photograph of a cell; NaN where there is none."""
    value = balanced(candidates, Balance(gain, offset, np.nan, np.nan))
    return [value[0] - value[q] for q in range(1, len(value))]


def _spread(differences: list[np.ndarray]) -> float:
    """Robust standard deviation."""
    every = max(sum(d.size for d in differences) // 1_000_000, 1)
    known = np.concatenate([d.ravel()[::every] for d in differences])
    known = known[np.isfinite(known)]
    return float(SIGMA_PER_MAD * np.median(np.abs(known))) if len(known) else float("nan")


def _sums(
    candidates: Candidates, differences: list[np.ndarray], band: int, limit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs a, b (k,) and (k, 6) numbers of cells, Σ c_a, Σ c_b, Σ c_a², Σ c_b², Σ c_a·c_b."""
    c = candidates
    pairs, first, second = [], [], []
    count = int(c.found.max()) + 1
    for q, difference in enumerate(differences, start=1):
        one, other = c.value[0, band], c.value[q, band]
        usable = np.abs(difference[band]) <= limit
        for value in (one, other):
            usable &= (value > DARKEST) & (value < BRIGHTEST)
        pairs.append(c.found[0][usable].astype(np.int64) * count + c.found[q][usable])
        first.append(one[usable].astype(float))
        second.append(other[usable].astype(float))
    x, y = np.concatenate(first), np.concatenate(second)
    which, at = _numbered(np.concatenate(pairs), count * count)
    sums = np.stack([np.bincount(at, w, len(which)) for w in (np.ones_like(x), x, y, x * x, y * y, x * y)], axis=1)
    enough = sums[:, 0] >= FEWEST_CELLS
    return which[enough] // count, which[enough] % count, sums[enough]


def _numbered(values: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Whole numbers below `most` that occur, rising, and the place of every value among them."""
    if most > MOST_COUNTED:
        return np.unique(values, return_inverse=True)
    there = np.zeros(most, bool)
    there[values] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[values]


def _solved(n: int, a: np.ndarray, b: np.ndarray, sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gains and offsets (n,) of one band."""
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
