"""The value type all families share: patterns at points, only those that act there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Terms:
    """Patterns of additional parameters at n points, k of them acting at each.

    Parameters
    ----------
    index : (n, k) which item of the family the column is.
    value : (n, 2, k) mm per unit of the parameter, the image error (dx, dy).
    partial : (n, 2, k, 2) the derivative of `value` by x and y, per unit of the parameter.
    """

    index: np.ndarray
    value: np.ndarray
    partial: np.ndarray


def dense_terms(dx: list, dy: list, partials: list) -> Terms:
    """`Terms` of a family all of whose items act everywhere.

    Parameters
    ----------
    dx, dy : p arrays (n,) each.
    partials : p entries (∂dx/∂x, ∂dx/∂y, ∂dy/∂x, ∂dy/∂y), arrays (n,).
    """
    value = np.stack([np.stack(dx, axis=-1), np.stack(dy, axis=-1)], axis=1)
    partial = np.stack([np.stack([np.stack(p[:2], -1), np.stack(p[2:], -1)], axis=1) for p in partials], axis=2)
    index = np.broadcast_to(np.arange(len(dx)), (value.shape[0], len(dx)))
    return Terms(index, value, partial)
