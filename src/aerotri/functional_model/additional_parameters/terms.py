"""The value type all families share: patterns at points, only those that act there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np


@dataclass(frozen=True, eq=False)
class Terms:
    """Patterns of additional parameters at n points, k of them acting at each.

    Parameters
    ----------
    index : (n, k) which of the items asked for the column is.
    value : (n, 2, k) mm per unit of the parameter, the image error (dx, dy).
    partial : (n, 2, k, 2) the derivative of `value` by x and y, per unit of the parameter; None unless asked for.
    """

    index: np.ndarray
    value: np.ndarray
    partial: np.ndarray | None = None


@lru_cache(maxsize=64)
def places(items: tuple[str, ...]) -> dict[str, int]:
    """Place of every item by its name."""
    return {item: place for place, item in enumerate(items)}


PIECE = 4096
"""Points filled at a time: columns are written with a stride, which is fast only while the rows stay in the cache."""

Fill = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None], None]
"""Fills value (m, 2, k) and partial (m, 2, k, 2), zero before, at positions x, y (m,) mm."""


def dense_terms(x: np.ndarray, y: np.ndarray, k: int, partials: bool, fill: Fill) -> Terms:
    """`Terms` at points (n,) mm of a family all of whose k items act everywhere."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    n = len(x)
    value, partial = np.zeros((n, 2, k)), np.zeros((n, 2, k, 2)) if partials else None
    for start in range(0, n, PIECE):
        rows = slice(start, start + PIECE)
        fill(x[rows], y[rows], value[rows], None if partial is None else partial[rows])
    return Terms(np.broadcast_to(np.arange(k), (n, k)), value, partial)


def only(terms: Terms, known: tuple[str, ...], items: Sequence[str]) -> Terms:
    """The columns of some items, for families of which only some items act at a point.

    Parameters
    ----------
    terms : `index` counts within `known`.
    known, items : all names, and those to keep.

    Returns
    -------
    Terms whose `index` counts within `items`; a column acting at no point is dropped, what remains of items not kept
    is zero.
    """
    if tuple(items) == known:
        return terms
    place = np.full(len(known), -1)
    place[[places(known)[item] for item in items]] = np.arange(len(items))
    index = place[terms.index]
    acts = index >= 0
    if acts.all():
        return Terms(index, terms.value, terms.partial)
    keep = np.flatnonzero(acts.any(axis=0))
    index, acts = index[:, keep], acts[:, keep]
    value = terms.value[:, :, keep] * acts[:, None, :]
    partial = None if terms.partial is None else terms.partial[:, :, keep] * acts[:, None, :, None]
    return Terms(np.where(acts, index, 0), value, partial)


def turned(terms: Terms, turn: np.ndarray) -> Terms:
    """Patterns of a native frame in image axes.

    Parameters
    ----------
    terms : of native positions, along native axes.
    turn : (2, 2) rotation image axes → native axes.
    """
    if np.array_equal(turn, np.eye(2)):
        return terms
    value = np.einsum("ia,nak->nik", turn.T, terms.value)
    partial = None if terms.partial is None else np.einsum("ia,nakb,bj->nikj", turn.T, terms.partial, turn)
    return Terms(terms.index, value, partial)
