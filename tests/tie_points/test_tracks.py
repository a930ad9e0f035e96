"""Tracks from matches of pairs, and the choice among them."""

from __future__ import annotations

import numpy as np

from aerotri.tie_points.matching import PairMatches
from aerotri.tie_points.tracks import Tracks, join_matches, thin


def rays(tracks: Tracks) -> set[tuple[tuple[int, int], ...]]:
    pairs = list(zip(tracks.image.tolist(), tracks.feature.tolist(), strict=True))
    return {tuple(pairs[a:b]) for a, b in zip(tracks.start[:-1], tracks.start[1:], strict=True)}


def test_matches_become_tracks():
    """Joined over photographs; two features of one photograph in one track are both left out, the rest stays."""
    pairs = [
        PairMatches(0, 1, np.array([[0, 5], [1, 6], [2, 7]])),
        PairMatches(1, 2, np.array([[5, 3], [6, 4]])),
        PairMatches(0, 2, np.array([[2, 4]])),
    ]
    # 0:1 - 1:6 - 2:4 - 0:2 - 1:7: photographs 0 and 1 twice, one ray is left
    assert rays(join_matches(pairs, np.array([10, 10, 10]))) == {((0, 0), (1, 5), (2, 3))}
    assert len(join_matches([], np.array([3, 3]))) == 0
    pairs.append(PairMatches(2, 3, np.array([[4, 9]])))
    assert rays(join_matches(pairs, np.array([10, 10, 10, 10]))) == {((0, 0), (1, 5), (2, 3)), ((2, 4), (3, 9))}


def test_thinning_takes_the_longest_and_fills_every_part():
    """Long tracks crowd in one corner: they are taken up to the share of their cell, short ones elsewhere."""
    rng = np.random.default_rng(1)
    size = np.array([[800.0, 600.0]] * 3)
    crowd = np.tile(rng.random((200, 1, 2)) * 100.0, (1, 3, 1))
    plain = np.tile(rng.random((600, 1, 2)) * [800.0, 600.0], (1, 2, 1))
    image = np.concatenate([np.tile([0, 1, 2], 200), np.tile([0, 1], 600)])
    xy = np.concatenate([crowd.reshape(-1, 2), plain.reshape(-1, 2)])
    start = np.concatenate([np.arange(0, 600, 3), 600 + np.arange(0, 1201, 2)])
    tracks = Tracks(start, image, np.arange(len(image)))
    kept = thin(tracks, xy, size, 96)
    places = xy[kept.feature][kept.image == 0]
    cells = np.histogram2d(*places.T, bins=(8, 6), range=((0, 800), (0, 600)))[0]
    assert cells.min() >= 2
    assert cells.sum() < 200
    # the third photograph has the crowd alone and gets what it wants of it
    assert (kept.image == 2).sum() >= 96
    assert kept.length[: (kept.image == 2).sum()].min() == 3
    everything = thin(tracks, xy, size, 10**6)
    np.testing.assert_array_equal(everything.feature, tracks.feature)
