"""Strips and cameras whose measurements do not fit the others: an axis of all their image points turned round."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerotri.diagnosis import changes
from aerotri.diagnosis.free_model import FreeModel
from aerotri.diagnosis.group_names import photographs_in_words
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.diagnosis.photographs import FEWEST_RAYS
from aerotri.observations import Block

MOSTLY = 0.75
"""Share of the photographs of a group that are in the model, or are not, for the group to count as a whole [C]."""
FEWEST = 2
"""Photographs of a side from which they are a group; single ones are tried one by one."""


def of_groups(block: Block, model: FreeModel) -> Iterator[Hypothesis]:
    """Strips or cameras that are all outside the model of the others, or all within one that they alone made.

    Which of the two sides is mirrored the image points do not tell: both are tried.
    """
    names = np.array([camera.name for camera in block.cameras])[block.images.camera]
    for groups, noun in ((np.asarray(block.images.strip), ""), (names, "camera")):
        for rows in _sides(block, model, groups):
            subject = photographs_in_words(block, rows)
            if noun and len(np.unique(groups[rows])) == 1:
                subject = f"{noun} {groups[rows[0]]}"
            for axis, remedy in enumerate(("x negated", "y negated")):
                change = changes.on_image_points(changes.negated(axis), rows)
                yield Hypothesis(f"{subject}: the measurements", remedy, change)


def _sides(block: Block, model: FreeModel, groups: np.ndarray) -> list[np.ndarray]:
    """Photographs (indices) of the groups outside the model, and of those within; nothing where they are not whole."""
    count = np.bincount(block.image_points.image, minlength=len(groups))
    tells = count >= FEWEST_RAYS
    names, of = np.unique(groups, return_inverse=True)
    total = np.bincount(of, weights=tells, minlength=len(names))
    share = np.bincount(of, weights=tells & model.joined, minlength=len(names)) / np.maximum(total, 1)
    whole = (share >= MOSTLY) | (share <= 1.0 - MOSTLY)
    if len(names) < 2 or not whole[total > 0].all():
        return []
    outside, within = (np.flatnonzero(side[of]) for side in (share <= 1.0 - MOSTLY, share >= MOSTLY))
    if min(len(outside), len(within)) < FEWEST:
        return []
    return sorted((outside, within), key=len)
