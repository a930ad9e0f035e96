"""What the parts of a block have in common: shared photographs and shared parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.shared_priors import SharedPriors
from aerotri.conventions import InputError


@dataclass(frozen=True, eq=False)
class PartFacts:
    """What a part tells of itself before anything is adjusted.

    Parameters
    ----------
    kept : (k,) str, its shared photographs, in the order of its root. middle : (2,) m, of all its photographs.
    labels : (name, group, kind, mark) of its shared parameters. start : (s,) their start values.
    priors : what is known of them beforehand.
    images, points, rays : how many take part. observations, unknowns : without what is shared.
    points_seen, observed : str, names of its points, and of its photographs with observed positions.
    settings : what block.toml says, to be compared. bytes_needed : of its factor. warnings : sentences for the user.
    """

    kept: np.ndarray
    middle: np.ndarray
    labels: tuple[tuple[str, str, str, str], ...]
    start: np.ndarray
    priors: SharedPriors
    images: int
    points: int
    rays: int
    observations: int
    unknowns: int
    points_seen: np.ndarray
    observed: np.ndarray
    settings: str
    bytes_needed: int
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Left:
    """What a part or a joint leaves of the normal equations.

    Parameters
    ----------
    matrix : (6·k + s, 6·k + s), of joints the lower triangle. right : (6·k + s,).
    diagonal : (6·k + s,) of the matrix before any photograph was eliminated.
    """

    matrix: np.ndarray
    right: np.ndarray
    diagonal: np.ndarray


class Common:
    """What is shared.

    Parameters
    ----------
    facts : of every part.

    `images` (n,) are the names of the shared photographs, `labels` those of the s shared parameters, `start` (s,) their
    start values, `of_images` and `of_shared` the rows of each part's in them.
    """

    def __init__(self, facts: Sequence[PartFacts]):
        self.images = np.unique(np.concatenate([part.kept for part in facts]))
        if not len(self.images):
            raise InputError("the parts have no photograph in common", "a block in parts shares photographs")
        self.labels = tuple(dict.fromkeys(label for part in facts for label in part.labels))
        column = {label: k for k, label in enumerate(self.labels)}
        self.of_images = [np.searchsorted(self.images, part.kept) for part in facts]
        self.of_shared = [np.array([column[label] for label in part.labels], dtype=np.int64) for part in facts]
        self.start = np.zeros(len(self.labels))
        for part, shared in zip(facts, self.of_shared, strict=True):
            self.start[shared] = part.start
        self.priors = _together(facts, self.of_shared, len(self.labels))
        self.middle = np.array([part.middle for part in facts])

    @property
    def weighted(self) -> np.ndarray:
        """(s,) bool, parameters of which something is known beforehand."""
        known = self.priors.weight > 0.0
        for field in self.priors.fields:
            known[field.columns] = True
        return known

    def with_priors(self, left: Left, shared: np.ndarray, damping: float) -> Left:
        """What is left at the root, symmetric, with what is known of the shared parameters, whose values are (s,)."""
        weight, right = np.zeros_like(left.matrix), left.right.copy()
        self.priors.add_to(weight, np.zeros(len(shared)))
        weight[np.diag_indices_from(weight)] *= 1.0 + damping
        self.priors.add_gaps_to(right, shared)
        matrix = np.tril(left.matrix) + np.tril(left.matrix, -1).T + weight
        return Left(matrix, right, left.diagonal + np.diagonal(weight))

    def cost_of_priors(self, shared: np.ndarray) -> float:
        """What the values (s,) cost against what is known of them."""
        return sum(self.priors.add_gaps_to(np.zeros(len(shared)), shared))


def _together(facts: Sequence[PartFacts], columns: list[np.ndarray], count: int) -> SharedPriors:
    """What all parts know of the shared parameters, each thing once."""
    weight, value = np.zeros(count), np.zeros(count)
    fields: dict[tuple[int, ...], JointPrior] = {}
    for part, own in zip(facts, columns, strict=True):
        weight[own], value[own] = part.priors.weight, part.priors.value
        for field in part.priors.fields:
            there = own[np.arange(len(own))[field.columns]]
            fields[tuple(there.tolist())] = replace(field, columns=there)
    return replace(
        facts[0].priors, weight=weight, value=value, of_points=np.zeros(count, dtype=bool),
        fields=tuple(fields.values()), deviations=(), deviation_priors=(), position_errors=(), photograph_fields=(),
    )  # fmt: skip
