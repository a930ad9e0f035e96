"""How sharp photographs are, by the detail that they show of the same ground.

A photograph out of focus, or moved while it was exposed, shows less detail than others of the same cells. What cells
are made of cancels, and so do exposures: every two photographs are compared where both are candidates, and only those
whose pixels are about as large on the ground.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.terrain.ortho.balance import levelled
from aerotri.terrain.ortho.candidates import Candidates
from aerotri.terrain.photographs import Photographs

FEWEST_CELLS = 20
"""Of two photographs, in which both show detail [C]."""
ALIKE = 0.25
"""Largest difference of the logarithms of two pixel sizes [C]: smaller pixels show finer detail, which is fainter."""
LARGEST, SIGMA = 1.5, 1.0
"""Logarithm of the ratio of two details beyond which it counts no more, and by which photographs may differ [C]."""
LEAST_BLUR = 1.25
"""From which on a photograph counts as blurred [C]: light and the angle of the ray change detail by less."""


def blur_of(photographs: Photographs, candidates: Candidates, gain: np.ndarray) -> np.ndarray:
    """(n,) by how much less detail photographs show than the others of the same ground; 1 where it is little.

    Parameters
    ----------
    gain : (n,) that brings their colours to one another: a dark photograph is not a blurred one.
    """
    count, c = len(photographs), candidates
    size = np.log(photographs.gsd)
    keys, ratios = [], []
    for q in range(1, len(c.found)):
        there = (c.found[q] >= 0) & (c.detail[0] > 0.0) & (c.detail[q] > 0.0)
        a, b = c.found[0][there].astype(np.int64), c.found[q][there].astype(np.int64)
        ratio = np.log(gain[a] * c.detail[0][there] / (gain[b] * c.detail[q][there]))
        alike = np.abs(size[a] - size[b]) < ALIKE
        keys.append((a * count + b)[alike])
        ratios.append(np.clip(ratio[alike], -LARGEST, LARGEST))
    out = np.ones(count)
    pair, at, cells = np.unique(np.concatenate([*keys, np.zeros(0, np.int64)]), return_inverse=True, return_counts=True)
    enough = cells >= FEWEST_CELLS
    if not enough.any():
        return out
    mean = np.bincount(at, np.concatenate(ratios)) / cells
    a, b = np.divmod(pair[enough], count)
    told = np.unique(np.concatenate([a, b]))
    detail = levelled(count, a, b, mean[enough], 1.0 / cells[enough], SIGMA)
    out[told] = np.exp(np.median(detail[told]) - detail[told])
    return np.where(out < LEAST_BLUR, 1.0, out)


def sharper_first(candidates: Candidates, photographs: Photographs, gsd: float, blur: np.ndarray) -> Candidates:
    """With pixels of blurred photographs as much larger as their detail is less, the best photograph first again.

    Parameters
    ----------
    gsd : m, that pixels are held against.
    """
    if not (blur > 1.0).any():
        return candidates
    c = candidates
    more = ((blur**2 - 1.0) * (photographs.gsd / gsd) ** 2).astype(np.float32)
    cost = c.cost + np.where(c.found >= 0, more[np.maximum(c.found, 0)], np.float32(0.0))
    order = np.argsort(cost, axis=0, kind="stable")
    found, cost, column, row, detail = (
        np.take_along_axis(one, order, axis=0) for one in (c.found, cost, c.column, c.row, c.detail)
    )
    value = np.take_along_axis(c.value, order[:, None], axis=0)
    return replace(c, found=found, cost=cost, column=column, row=row, detail=detail, value=value)
