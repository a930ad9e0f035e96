"""What the reduced normal equations are added up from: chunks of points, and observations beside the image points."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.kernel_records import Sums
from aerotri.adjustment.unknowns import Unknowns
from aerotri.functional_model.observed_unknowns import Rows


class ChunkSums:
    """Sums of one chunk of points, over the photographs and pairs that it touches and no others.

    Parameters
    ----------
    n_shared : how many of the shared parameters, from the first, act on rays.
    """

    def __init__(self, unknowns: Unknowns, first: int, last: int, n_shared: int):
        image = unknowns.rays.image[unknowns.rays.start[first] : unknowns.rays.start[last]]
        pair = unknowns.pair_block[unknowns.pair_start[first] : unknowns.pair_start[last]]
        self._shared = slice(0, n_shared)
        self._images = slice(int(image.min()), int(image.max()) + 1)
        n = len(unknowns.images)
        self._pairs = slice(int(pair.min()), int(pair.max()) + 1) if len(pair) else slice(n, n)
        n_images, n_pairs = self._images.stop - self._images.start, self._pairs.stop - self._pairs.start
        self.offsets = (self._images.start, self._pairs.start)
        self._sums = Sums(
            np.empty((n_images, 6, 6)),
            np.empty((n_pairs, 6, 6)),
            np.empty((n_images, n_shared, 6)),
            np.empty((n_shared, n_shared)),
            np.empty((n_images, 6)),
            np.empty(n_shared),
            np.empty((n_images, 6)),
            np.empty(n_shared),
        )

    def cleared(self) -> Sums:
        """The arrays, set to zero."""
        for array in self._sums:
            array.fill(0.0)
        return self._sums

    def cleared_right(self) -> tuple[np.ndarray, np.ndarray]:
        """The arrays of the right side, set to zero."""
        right = self._sums.right, self._sums.right_shared
        for array in right:
            array.fill(0.0)
        return right

    def add_matrix_to(self, blocks: np.ndarray, border: np.ndarray, corner: np.ndarray) -> None:
        """Add to the matrix of all chunks."""
        blocks[self._images] += self._sums.diagonal
        blocks[self._pairs] += self._sums.pairs
        border[self._images, self._shared] += self._sums.border
        corner[self._shared, self._shared] += self._sums.corner

    def add_squares_to(self, squares: np.ndarray, squares_shared: np.ndarray) -> None:
        """Add to the squares of the columns, before points are eliminated, of all chunks."""
        squares[self._images] += self._sums.squares
        squares_shared[self._shared] += self._sums.squares_shared

    def add_right_to(self, right: np.ndarray, right_shared: np.ndarray) -> None:
        """Add to the right side of all chunks."""
        right[self._images] += self._sums.right
        right_shared[self._shared] += self._sums.right_shared


def add_squares(rows: Rows, blocks: np.ndarray, border: np.ndarray, corner: np.ndarray) -> None:
    """Add whitened observations beside the image points to the matrix."""
    image, own = rows.image, rows.image >= 0
    np.add.at(blocks, image[own], np.einsum("gka,gkb->gab", rows.by_image[own], rows.by_image[own]))
    for c in range(rows.columns.shape[1]):
        column, there, value = rows.columns[:, c], rows.columns[:, c] >= 0, rows.by_shared[:, :, c]
        both = there & own
        np.add.at(border, (image[both], column[both]), np.einsum("gka,gk->ga", rows.by_image[both], value[both]))
        for d in range(rows.columns.shape[1]):
            pair = there & (rows.columns[:, d] >= 0)
            product = np.sum(value[pair] * rows.by_shared[pair, :, d], axis=1)
            np.add.at(corner, (column[pair], rows.columns[pair, d]), product)


def add_gaps(rows: Rows, right: np.ndarray, right_shared: np.ndarray) -> None:
    """Add whitened observations beside the image points to the right side."""
    own = rows.image >= 0
    np.add.at(right, rows.image[own], np.einsum("gka,gk->ga", rows.by_image[own], rows.gap[own]))
    for c in range(rows.columns.shape[1]):
        column, there = rows.columns[:, c], rows.columns[:, c] >= 0
        np.add.at(right_shared, column[there], np.sum(rows.by_shared[there, :, c] * rows.gap[there], axis=1))


def add_own_squares(rows: Rows, squares: np.ndarray, squares_shared: np.ndarray) -> None:
    """Add the squared columns of whitened observations beside the image points: (n, 6) and (s,)."""
    own = rows.image >= 0
    np.add.at(squares, rows.image[own], np.sum(rows.by_image[own] ** 2, axis=1))
    for c in range(rows.columns.shape[1]):
        there = rows.columns[:, c] >= 0
        np.add.at(squares_shared, rows.columns[there, c], np.sum(rows.by_shared[there, :, c] ** 2, axis=1))
