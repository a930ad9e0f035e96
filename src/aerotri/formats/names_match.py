"""Names of photographs and points that two files write differently."""

from __future__ import annotations

import re

import numpy as np

ENDING = re.compile(r"\.(jpe?g|tiff?|png|dng|raw|iiq|arw|cr2|cr3|nef|bmp|jp2|ecw|sid|img|ptx)$", re.IGNORECASE)
"""File endings of images."""


def stem(name: str) -> str:
    """The name of an image file without folder and ending."""
    return ENDING.sub("", name.replace("\\", "/").rsplit("/", 1)[-1])


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


def likely_prefix(names: np.ndarray, known: np.ndarray) -> str | None:
    """What stands before one of the names where it is found among the known ones, '' never; None where nothing fits.

    Parameters
    ----------
    names : (n,) str; known : (k,) str.
    """
    for name in names.tolist():
        for other in known.tolist():
            if len(other) > len(name) and other.endswith(name):
                return other[: -len(name)]
    return None
