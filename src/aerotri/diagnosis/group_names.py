"""Photographs in words: by name, by strip, or by their number."""

from __future__ import annotations

import numpy as np

from aerotri.observations import Block

MOST_NAMED = 3
"""Photographs, or strips, that are named one by one [C]."""


def photographs_in_words(block: Block, rows: np.ndarray) -> str:
    """'photograph 7', 'strips 2, 4', '12 photographs (3, 4, 5 and 9 more)', 'all 35 photographs'.

    Parameters
    ----------
    rows : indices.
    """
    rows = np.asarray(rows)
    if len(rows) == len(block.images) and len(rows) > 1:
        return f"all {len(rows)} photographs"
    strips = whole_strips(block, rows)
    if len(rows) > 1 and 0 < len(strips) <= MOST_NAMED:
        return f"strip{'s' if len(strips) > 1 else ''} {', '.join(strips)}"
    names = block.images.names.astype(str)[rows[:MOST_NAMED]]
    if len(rows) <= MOST_NAMED:
        return f"photograph{'s' if len(rows) > 1 else ''} {', '.join(names)}"
    return f"{len(rows)} photographs ({', '.join(names)} and {len(rows) - MOST_NAMED} more)"


def whole_strips(block: Block, rows: np.ndarray) -> list[str]:
    """The strips that photographs (indices) are, all of them and nothing else; empty where they are none."""
    strip = np.asarray(block.images.strip)
    own = np.unique(strip[rows])
    whole = all(s and np.isin(np.flatnonzero(strip == s), rows).all() for s in own)
    return [str(s) for s in own] if whole else []
