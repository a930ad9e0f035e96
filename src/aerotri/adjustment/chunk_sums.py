"""What the reduced normal equations are added up from: chunks of points, and observations beside the image points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.adjustment.kernel_records import Places, Sums
from aerotri.adjustment.unknowns import Unknowns
from aerotri.functional_model.observed_unknowns import Rows


class SharedRows:
    """Rows that chunks add to at the same time: where an earlier chunk adds as well, a chunk has a row of its own.

    Such rows stand behind the others and are added to them when all chunks are done, in order, so that no sum depends
    on which chunk was the first.

    Parameters
    ----------
    count : how many rows there are. touched : of every chunk, the rows that it adds to, each any number of times.
    """

    def __init__(self, count: int, touched: Sequence[Sequence[np.ndarray]]):
        self.places: list[np.ndarray] = []
        self._count = self._end = count
        self._behind: list[tuple[np.ndarray, slice]] = []
        seen = np.zeros(count, dtype=bool)
        for rows in touched:
            own = np.zeros(count, dtype=bool)
            for part in rows:
                own[part] = True
            twice = np.flatnonzero(own & seen)
            seen |= own
            behind = slice(self._end, self._end + len(twice))
            place = np.arange(count, dtype=np.int32)
            place[twice] = np.arange(behind.start, behind.stop)
            self.places.append(place)
            self._behind.append((twice, behind))
            self._end = behind.stop

    def zeros(self, *shape: int) -> np.ndarray:
        """Rows of a shape, and those behind them."""
        return np.zeros((self._end, *shape))

    def added_up(self, rows: np.ndarray) -> np.ndarray:
        """The rows with those behind added to them: a view of `rows`, which is changed."""
        for twice, behind in self._behind:
            rows[twice] += rows[behind]
        return rows[: self._count]


class ChunkSums:
    """Where the chunks of a system add up.

    Parameters
    ----------
    bounds : the chunks, first and end of the points of each.
    n_shared : how many of the shared parameters, from the first, act on rays.
    """

    def __init__(self, unknowns: Unknowns, bounds: Sequence[tuple[int, int]], n_shared: int):
        start, pair_start = unknowns.rays.start, unknowns.pair_start
        images = [unknowns.rays.image[start[first] : start[last]] for first, last in bounds]
        pairs = [unknowns.pair_block[pair_start[first] : pair_start[last]] for first, last in bounds]
        self._images = SharedRows(len(unknowns.images), [(image,) for image in images])
        self._blocks = SharedRows(len(unknowns.block_row), list(zip(images, pairs, strict=True)))
        self._chunks, self._shared, self._of_rays = len(bounds), len(unknowns.shared), n_shared
        self.places = [
            Places(image, block) for image, block in zip(self._images.places, self._blocks.places, strict=True)
        ]

    def zeros(self) -> list[Sums]:
        """Sums of every chunk, all zero. What is of photographs stands in arrays that all chunks have in common."""
        s = self._of_rays
        blocks, border = self._blocks.zeros(6, 6), self._images.zeros(self._shared, 6)
        right, squares = self._images.zeros(6), self._images.zeros(6)
        return [
            Sums(blocks, border, np.zeros((s, s)), right, np.zeros(s), squares, np.zeros(s))
            for _ in range(self._chunks)
        ]

    def matrix(self, sums: list[Sums]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Blocks (nb, 6, 6), border (n, s, 6) and corner (s, s) of all chunks, which are used up."""
        corner, of_rays = np.zeros((self._shared, self._shared)), slice(self._of_rays)
        for of_chunk in sums:
            corner[of_rays, of_rays] += of_chunk.corner
        return self._blocks.added_up(sums[0].blocks), self._images.added_up(sums[0].border), corner

    def squares(self, sums: list[Sums]) -> tuple[np.ndarray, np.ndarray]:
        """Squares of the columns before the points are eliminated, (n, 6) and (s,), of all chunks."""
        return self._images.added_up(sums[0].squares), self._of_shared([part.squares_shared for part in sums])

    def right(self, sums: list[Sums]) -> tuple[np.ndarray, np.ndarray]:
        """The right side (n, 6) and (s,) of all chunks."""
        return self.right_of(sums[0].right, [part.right_shared for part in sums])

    def zero_right(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Room for the right side alone: of photographs, in common, and of shared parameters, of every chunk."""
        return self._images.zeros(6), [np.zeros(self._of_rays) for _ in range(self._chunks)]

    def right_of(self, right: np.ndarray, of_chunks: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """The right side (n, 6) and (s,) from such room."""
        return self._images.added_up(right), self._of_shared(of_chunks)

    def _of_shared(self, of_chunks: list[np.ndarray]) -> np.ndarray:
        total = np.zeros(self._shared)
        for part in of_chunks:
            total[: self._of_rays] += part
        return total


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
