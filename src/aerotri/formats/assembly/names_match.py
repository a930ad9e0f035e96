"""Names of photographs and points that two files write differently."""

from __future__ import annotations

import numpy as np

from aerotri.observations.names import stem


def match_photographs(names: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, int]:
    """Which photographs names mean: those of the same name, else of the same file without folder and ending.

    Parameters
    ----------
    names : (n,) str; known : (k,) str.

    Returns
    -------
    index : (n,) into `known`, −1 where there is none, or more than one without the ending.
    loosely : how many were found without folder or ending only.
    """
    exact = {name: i for i, name in enumerate(known.tolist())}
    by_stem: dict[str, int] = {}
    for i, name in enumerate(known.tolist()):
        key = stem(name)
        by_stem[key] = -1 if key in by_stem else i
    index, loosely = np.full(len(names), -1), 0
    for row, name in enumerate(names.tolist()):
        if name in exact:
            index[row] = exact[name]
        elif by_stem.get(stem(name), -1) >= 0:
            index[row] = by_stem[stem(name)]
            loosely += 1
    # two names that mean the same photograph mean none
    found, count = np.unique(index[index >= 0], return_counts=True)
    index[np.isin(index, found[count > 1])] = -1
    return index, loosely
