"""What the parts of a block have in common: shared photographs and shared parameters, and their normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.shared_priors import SharedPriors
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Symbolic
from aerotri.conventions import InputError

B = 6


@dataclass(frozen=True, eq=False)
class PartFacts:
    """What a part tells of itself before anything is adjusted.

    Parameters
    ----------
    kept : (k,) str, its shared photographs, in the order of its root. position : (k, 2) m, of these.
    labels : (name, group, kind, mark) of its shared parameters. start : (s,) their start values.
    priors : what is known of them beforehand.
    images, points, rays : how many take part. observations, unknowns : without what is shared.
    points_seen, observed : str, names of its points, and of its photographs with observed positions.
    settings : what block.toml says, to be compared. bytes_needed : of its factor. warnings : sentences for the user.
    """

    kept: np.ndarray
    position: np.ndarray
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
    """What a part leaves of its normal equations.

    Parameters
    ----------
    matrix : (6·k + s, 6·k + s). right : (6·k + s,).
    """

    matrix: np.ndarray
    right: np.ndarray


class Common:
    """Where what the parts leave belongs.

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
        self.start, position = np.zeros(len(self.labels)), np.zeros((len(self.images), 2))
        for part, images, shared in zip(facts, self.of_images, self.of_shared, strict=True):
            self.start[shared], position[images] = part.start, part.position
        self.priors = _together(facts, self.of_shared, len(self.labels))
        self._pairs, row, col = pattern(self.of_images, len(self.images))
        self.symbolic = Symbolic(len(self.images), row, col, position, len(self.labels))

    @property
    def weighted(self) -> np.ndarray:
        """(s,) bool, parameters of which something is known beforehand."""
        known = self.priors.weight > 0.0
        for field in self.priors.fields:
            known[field.columns] = True
        return known

    def columns(self, part: int) -> np.ndarray:
        """(6·k + s,) of a part's shared photographs and parameters among all."""
        images = (B * self.of_images[part][:, None] + np.arange(B)).ravel()
        return np.concatenate([images, B * len(self.images) + self.of_shared[part]])

    def empty(self) -> tuple[BorderedMatrix, np.ndarray]:
        """A matrix and a right side to add to."""
        n, s = len(self.images), len(self.labels)
        blocks = np.zeros((len(self.symbolic.block_row), B, B))
        return BorderedMatrix(blocks, np.zeros((n, s, B)), np.zeros((s, s))), np.zeros(B * n + s)

    def add(self, part: int, left: Left, matrix: BorderedMatrix, right: np.ndarray) -> None:
        """Add what a part leaves."""
        k, images, shared = len(self.of_images[part]), self.of_images[part], self.of_shared[part]
        own = B * k
        tiled = left.matrix[:own, :own].reshape(k, B, k, B).swapaxes(1, 2)
        place, first, second = self._pairs[part]
        matrix.blocks[place] += tiled[first, second]
        border = left.matrix[own:, :own].reshape(len(shared), k, B)
        matrix.border[np.ix_(images, shared)] += border.swapaxes(0, 1)
        matrix.corner[np.ix_(shared, shared)] += left.matrix[own:, own:]
        right[self.columns(part)] += left.right

    def add_priors(self, matrix: BorderedMatrix, right: np.ndarray, shared: np.ndarray, damping: float) -> None:
        """Add what is known of the shared parameters, whose values are (s,)."""
        weight = np.zeros_like(matrix.corner)
        self.priors.add_to(weight, np.zeros(len(shared)))
        weight[np.diag_indices_from(weight)] *= 1.0 + damping
        matrix.corner[:] += weight
        self.priors.add_gaps_to(right[B * len(self.images) :], shared)

    def cost_of_priors(self, shared: np.ndarray) -> float:
        """What the values (s,) cost against what is known of them."""
        return sum(self.priors.add_gaps_to(np.zeros(len(shared)), shared))

    def inverse_of(self, part: int, inverse: Inverse) -> np.ndarray:
        """(6·k + s, 6·k + s) the inverse over what a part shares, out of that on the pattern of all."""
        place, first, second = self._pairs[part]
        k, images, shared = len(self.of_images[part]), self.of_images[part], self.of_shared[part]
        own = B * k
        tiled = np.zeros((k, k, B, B))
        tiled[second, first] = inverse.blocks[place].swapaxes(1, 2)
        tiled[first, second] = inverse.blocks[place]
        out = np.empty((own + len(shared), own + len(shared)))
        out[:own, :own] = tiled.swapaxes(1, 2).reshape(own, own)
        border = inverse.border[np.ix_(images, shared)].swapaxes(0, 1).reshape(len(shared), own)
        out[own:, :own], out[:own, own:] = border, border.T
        out[own:, own:] = inverse.corner[np.ix_(shared, shared)]
        return out


Places = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of the blocks that a part leaves: where each belongs, and its photographs."""


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


def pattern(of_images: list[np.ndarray], n: int) -> tuple[list[Places], np.ndarray, np.ndarray]:
    """For every part the places of its pairs of photographs and the pairs; rows and columns of all blocks.

    Parameters
    ----------
    of_images : rows of the shared photographs of every part among all n.
    """
    pairs: list[Places] = []
    for images in of_images:
        first, second = np.nonzero(images[:, None] < images[None, :])
        pairs.append((first, second, images[first] * n + images[second]))
    codes = np.unique(np.concatenate([code for _, _, code in pairs]))
    row, col = np.concatenate([np.arange(n), codes // n]), np.concatenate([np.arange(n), codes % n])
    out: list[Places] = []
    for images, (first, second, code) in zip(of_images, pairs, strict=True):
        own = np.arange(len(images))
        place = np.concatenate([images, n + np.searchsorted(codes, code)])
        out.append((place, np.concatenate([own, first]), np.concatenate([own, second])))
    return out, row, col
