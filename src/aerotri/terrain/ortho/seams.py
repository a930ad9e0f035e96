"""The photograph that every coarse cell takes: the best one, unless a seam is seen less elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.terrain.ortho import _seam_kernels as kernels
from aerotri.terrain.ortho.candidates import Candidates

PASSES, BETWEEN, LEAST_GAIN = 12, 3, 0.01
"""Of messages, forwards and backwards each, at most; after so many each the labels are looked at, and no more are sent
where these cost no less by that share [C]."""
MOST, LEAST = 5.0, 0.05
"""Cost of a difference at most, in standard deviations, and of a seam where nothing differs [C]: at a car not more than
at a house, and seams no longer than needed."""
BEST_WEIGHT = 1.0
"""Of the cost of not taking the best photograph [C], over what the second best costs more at the middle of a
photograph."""
NO_CANDIDATE = 1e6


@dataclass(frozen=True, eq=False)
class Choice:
    """The photograph of every coarse cell.

    Parameters
    ----------
    label : (r, c) int32 place in the list of candidates. number : (r, c) int32 photograph, −1 for none.
    seam, seam_of_best : mean difference of the two photographs along seams, in shares of white; with the best
        photograph of every cell. length, length_of_best : sides of cells that are seams.
    """

    label: np.ndarray
    number: np.ndarray
    seam: float
    seam_of_best: float
    length: int
    length_of_best: int


def choose(candidates: Candidates, colours: np.ndarray, move: bool = True) -> Choice:
    """The photographs of the coarse cells.

    Parameters
    ----------
    colours : (q, bands, r, c) of the candidates, balanced. move : whether seams are laid where they are seen least.
    """
    best = np.zeros(candidates.found.shape[1:], np.int32)
    label = _moved(candidates, colours) if move and len(candidates.found) > 1 else best
    seen = [_seen(candidates.found, colours, one) for one in (label, best)]
    number = np.take_along_axis(candidates.found, label[None], axis=0)[0]
    return Choice(label, number, seen[0][0], seen[1][0], seen[0][1], seen[1][1])


def _moved(candidates: Candidates, colours: np.ndarray) -> np.ndarray:
    found = candidates.found
    spread = SIGMA_PER_MAD * np.nanmedian(np.abs(colours[0] - colours[1])) if (found[1] >= 0).any() else 0.0
    scaled = np.nan_to_num(colours / np.float32(max(spread, 1e-4))).astype(np.float32)
    unary = np.ascontiguousarray(np.moveaxis(_own_cost(candidates), 0, -1))
    shape = (*found.shape[1:], len(found), len(found))
    right, below = np.empty(shape, np.float32), np.empty(shape, np.float32)
    difference = np.empty(shape, np.float32)
    kernels.differences(found, scaled, np.float32(MOST), difference)
    lists = np.ascontiguousarray(np.moveaxis(found, 0, -1))
    kernels.seam_costs(lists, difference, np.float32(MOST), np.float32(LEAST), right, below)
    return _least_cost(unary, right, below)


def _least_cost(unary: np.ndarray, right: np.ndarray, below: np.ndarray) -> np.ndarray:
    """(r, c) int32 labels of the least cost found, none dearer than the best photograph of every cell."""
    messages = np.zeros((4, *unary.shape), np.float32)
    kept = np.zeros(unary.shape[:2], np.int32)
    least = sum(kernels.energy(unary, right, below, kept))
    for _ in range(PASSES // BETWEEN):
        for _ in range(BETWEEN):
            for backwards in (False, True):
                kernels.pass_messages(unary, right, below, messages, backwards)
        label = np.zeros_like(kept)
        kernels.decide(unary, right, below, messages, label)
        cost, before = sum(kernels.energy(unary, right, below, label)), least
        if cost < least:
            kept, least = label, cost
        if cost > (1.0 - LEAST_GAIN) * before:
            break
    return kept


def _own_cost(candidates: Candidates) -> np.ndarray:
    """(q, r, c) float32, what it costs not to take the best photograph."""
    there = candidates.found >= 0
    more = np.where(there, candidates.cost - np.where(there[0], candidates.cost[0], 0.0), 0.0)
    second = more[1][there[1]]
    scale = float(np.quantile(second, 0.9)) if second.size else 1.0
    out = np.where(there, BEST_WEIGHT * more / max(scale, 1e-9), NO_CANDIDATE)
    return np.where(there[:1], out, 0.0).astype(np.float32)


def _seen(found: np.ndarray, colours: np.ndarray, label: np.ndarray) -> tuple[float, int]:
    """Mean difference along the seams of labels, and how many sides of cells are seams."""
    number = np.take_along_axis(found, label[None], axis=0)[0]
    total, known, count = 0.0, 0, 0
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        i, j = np.nonzero((number[one] != number[other]) & (number[one] >= 0) & (number[other] >= 0))
        k, m = (i, j + 1) if one == np.s_[:, :-1] else (i + 1, j)
        count += len(i)
        for at_i, at_j in ((i, j), (k, m)):
            a, b = (_of(found, colours, at_i, at_j, n) for n in (number[i, j], number[k, m]))
            difference = np.abs(a - b).mean(axis=1)
            there = np.isfinite(difference)
            total, known = total + float(difference[there].sum()), known + int(there.sum())
    return (total / known if known else float("nan")), count


def _of(found: np.ndarray, colours: np.ndarray, i: np.ndarray, j: np.ndarray, number: np.ndarray) -> np.ndarray:
    """(n, bands) of a photograph at coarse cells; NaN where it is no candidate."""
    place = found[:, i, j] == number
    value = colours[np.argmax(place, axis=0), :, i, j]
    return np.where(place.any(axis=0)[:, None], value, np.nan)
