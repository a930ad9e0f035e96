"""What is known at some places in plan and changes slowly: which places tell it, and linear between them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import KDTree


def spread_places(xy: np.ndarray, nodes: tuple[int, int]) -> np.ndarray:
    """Rows of places (n, 2), spread over all of them in plan: those nearest to the nodes of a lattice, each once.

    Parameters
    ----------
    nodes : of the lattice along the first and the second axis, over the box around all places.
    """
    low, high = xy.min(axis=0), xy.max(axis=0)
    along = [np.linspace(a, b, count) for a, b, count in zip(low, high, nodes, strict=True)]
    wanted = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.unique(KDTree(xy).query(wanted)[1])


def lattice_of(xy: np.ndarray, most: int) -> tuple[int, int]:
    """Nodes along both axes, about `most` in all and as far apart along one as along the other, over places (n, 2)."""
    size = np.ptp(xy, axis=0)
    if not size.min() > 0.0:
        return (most, 1) if size[0] > 0.0 else (1, most)
    first = int(np.clip(round(np.sqrt(most * size[0] / size[1])), 1, most))
    return first, max(most // first, 1)


def between_places(places: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (p, …) at places (p, 2), linear between them, at (k, 2); beyond them those of the nearest.

    Of places on one line they are linear along it.
    """
    middle = places.mean(axis=0)
    away, wanted = places - middle, at - middle
    # of two by two numbers: the linear algebra library gives a matrix of all places to threads that wait for each other
    spread = away.T @ away
    if len(places) < 3 or np.linalg.matrix_rank(spread) < 2:
        return _along_line(away, values, wanted, np.linalg.eigh(spread)[1][:, -1])
    near = np.asarray(NearestNDInterpolator(away, values)(wanted))
    linear = np.asarray(LinearNDInterpolator(away, values)(wanted))
    return np.where(np.isfinite(linear), linear, near)


def _along_line(away: np.ndarray, values: np.ndarray, wanted: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Linear by the distance along a direction (2,), on either side of the line alike."""
    place, at = away @ direction, wanted @ direction
    order = np.argsort(place, kind="stable")
    columns = values.reshape(len(values), -1)[order]
    found = np.stack([np.interp(at, place[order], column) for column in columns.T], axis=-1)
    return found.reshape(len(at), *values.shape[1:])
