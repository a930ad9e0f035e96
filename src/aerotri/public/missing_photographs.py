"""Photographs of a block that are not among the files given: named, as what is made has less of the ground."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import counted

if TYPE_CHECKING:
    from aerotri.results.adjustment import Adjustment as Record

MOST_NAMED = 5
"""The user sees in which folder they are from the first few."""


def missing_photographs(record: Record, wanted: np.ndarray, found: np.ndarray) -> tuple[str, ...]:
    """Names of the photographs of a block that are wanted and have no file.

    Parameters
    ----------
    wanted, found : rows of the photographs.
    """
    names = record.result.block.images.names
    return tuple(str(names[row]) for row in wanted.tolist() if row not in set(found.tolist()))


def missing_in_words(names: Sequence[str], given: Sequence[Path]) -> tuple[str, ...]:
    """A sentence that names them; none where no photograph is missing."""
    if not names:
        return ()
    listed = ", ".join(names[:MOST_NAMED]) + (", …" if len(names) > MOST_NAMED else "")
    where = ", ".join(str(path) for path in given[:MOST_NAMED])
    said = counted(len(names), "photograph of the block is", "photographs of the block are")
    return (f"{said} not in {where}: {listed}; what they alone show is missing",)
