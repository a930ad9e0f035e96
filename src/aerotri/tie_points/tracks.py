"""Tracks: features of several photographs that are one point, and an even choice of them, the longest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.tie_points import _kernels
from aerotri.tie_points.matching import PairMatches


@dataclass(frozen=True, eq=False)
class Tracks:
    """Points measured in several photographs, their rays side by side.

    Parameters
    ----------
    start : (t + 1,) where the rays of a track begin. image, feature : (m,) of every ray.
    """

    start: np.ndarray
    image: np.ndarray
    feature: np.ndarray

    def __len__(self) -> int:
        return len(self.start) - 1

    @property
    def length(self) -> np.ndarray:
        """(t,) photographs of each."""
        return np.diff(self.start)

    @property
    def of_ray(self) -> np.ndarray:
        """(m,) the track of every ray."""
        return np.repeat(np.arange(len(self)), self.length)

    def with_images(self, image: np.ndarray) -> Tracks:
        """The tracks with their photographs numbered otherwise; rays of a track stand in the order of the numbers.

        Parameters
        ----------
        image : (n,) new number of every photograph.
        """
        order = np.lexsort((image[self.image], self.of_ray))
        return Tracks(self.start, image[self.image][order], self.feature[order])

    def chosen(self, rays: np.ndarray) -> Tracks:
        """The tracks of the rays (m,) bool that are left, those with two or more."""
        counts = np.bincount(self.of_ray[rays], minlength=len(self))
        rays = rays & (counts[self.of_ray] > 1)
        return Tracks(_starts(counts[counts > 1]), self.image[rays], self.feature[rays])


@dataclass(frozen=True, eq=False)
class Measured:
    """Positions that the features of tracks are rows of: (f, 2) px, and a-priori standard deviations (f,) in px."""

    xy: np.ndarray
    sigma_px: np.ndarray

    def of(self, tracks: Tracks) -> tuple[np.ndarray, np.ndarray]:
        """(m, 2) px and (m,) px of the rays."""
        return self.xy[tracks.feature], self.sigma_px[tracks.feature]


def tracks_of(track: np.ndarray, image: np.ndarray, measured: Measured) -> tuple[Tracks, Measured]:
    """Tracks of rays in any order, and the positions in the order of their rays.

    Parameters
    ----------
    track, image : (m,) of every ray. measured : m positions.
    """
    order = np.lexsort((image, track))
    counts = np.bincount(track)
    tracks = Tracks(_starts(counts[counts > 0]), image[order], np.arange(len(image)))
    return tracks, Measured(measured.xy[order], measured.sigma_px[order])


def _starts(counts: np.ndarray) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def join_matches(pairs: Sequence[PairMatches], counts: np.ndarray) -> Tracks:
    """Tracks from the matches of pairs.

    Where matches lead to two features of one photograph, these two are left out: one of them is wrong.

    Parameters
    ----------
    counts : (n,) features of every photograph.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first = _starts(counts)
    total = int(first[-1])
    ends = [(first[p.first] + p.matches[:, 0], first[p.second] + p.matches[:, 1]) for p in pairs]
    a, b = (np.concatenate([e[k] for e in ends]) if ends else np.zeros(0, np.int64) for k in (0, 1))
    graph = coo_array((np.ones(len(a), np.int8), (a, b)), shape=(total, total))
    label = connected_components(graph, directed=False)[1]
    node = np.unique(np.concatenate([a, b]))
    image = np.searchsorted(first, node, side="right") - 1
    order = np.lexsort((node, image, label[node]))
    node, image = node[order], image[order]
    place = np.unique(label[node], return_inverse=True)[1]
    same = (np.diff(place, prepend=-1) == 0) & (np.diff(image, prepend=-1) == 0)
    alone = ~(same | np.append(same[1:], False))
    every = Tracks(_starts(np.bincount(place)) if len(place) else _starts(place), image, node - first[image])
    return every.chosen(alone)


def thin(tracks: Tracks, xy: np.ndarray, size_px: np.ndarray, wanted: int, cells: int = 8) -> Tracks:
    """About `wanted` points in every photograph, spread evenly: the longest tracks first.

    First every cell of a photograph gets its share, then photographs that lack points get more wherever there are any.

    Parameters
    ----------
    xy : (m, 2) px, of the rays. size_px : (n, 2) columns and rows of the photographs. cells : along the longer side.
    """
    along = np.ceil(cells * size_px / size_px.max(axis=1, keepdims=True)).astype(np.int64)
    fine = np.clip((xy / size_px[tracks.image] * along[tracks.image]).astype(np.int64), 0, along[tracks.image] - 1)
    cell = fine[:, 1] * cells + fine[:, 0]
    order = np.argsort(-tracks.length, kind="stable")
    keep = np.zeros(len(tracks), bool)
    share = -(-wanted // int(along.prod(axis=1).max()))
    taken = np.zeros((len(size_px), cells * cells), np.int64)
    _kernels.thin_tracks(order, tracks.start, (tracks.image, cell), taken, (share, wanted), keep)
    return tracks.chosen(keep[tracks.of_ray])
