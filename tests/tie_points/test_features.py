"""Features lie where the detail is, to a few hundredths of a pixel, and matches are what a plain search finds."""

from __future__ import annotations

import os

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from aerotri.rasters.images import create_image
from aerotri.tie_points.features import FeatureOptions, features_of, find_features, grey_8bit
from aerotri.tie_points.matching import mutual_matches, neighbours


def blobs(size: float, shape=(400, 500)) -> tuple[np.ndarray, np.ndarray]:
    """A grey image with round blobs of σ `size`, and their centres (k, 2) px from the corner."""
    rng = np.random.default_rng(3)
    places = np.array([[x, y] for x in range(40, 480, 50) for y in range(40, 380, 50)]) + rng.random((63, 2))
    row, column = np.indices(shape) + 0.5
    image = np.full(shape, 40.0)
    for x, y in places:
        image += 150.0 * np.exp(-((column - x) ** 2 + (row - y) ** 2) / (2.0 * size**2))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), places


@pytest.mark.parametrize(("size", "longest", "bound"), [(2.5, 4000, 0.03), (4.0, 4000, 0.06), (4.0, 250, 0.12)])
def test_features_lie_where_the_blobs_are(size, longest, bound):
    """Every single one within `bound`, their mean within a hundredth: no half or quarter pixel, whole or reduced."""
    image, places = blobs(size)
    xy = find_features(image, FeatureOptions(longest_px=longest)).xy
    off = np.array([xy[np.argmin(((xy - place) ** 2).sum(axis=1))] - place for place in places])
    assert np.abs(off).max() < bound
    assert np.abs(off.mean(axis=0)).max() < 0.01


def test_reduced_photographs_have_larger_standard_deviations():
    image, _ = blobs(4.0)
    assert find_features(image, FeatureOptions(longest_px=250)).sigma_px == pytest.approx(1.0)
    assert find_features(image, FeatureOptions()).sigma_px == 0.5


def test_features_are_spread():
    """A tenth of the image has nearly all contrast; the rest gets its share, and no place is there twice."""
    texture = gaussian_filter(np.random.default_rng(1).normal(0.0, 1.0, (300, 400)), 1.0) * 28.0
    texture[:, :40] *= 6.0
    found = find_features(np.clip(120.0 + texture, 0, 255).astype(np.uint8), FeatureOptions(count=500))
    assert len(found) == 500
    assert len(np.unique(found.xy, axis=0)) == 500
    inside = np.histogram2d(*found.xy.T, bins=(8, 6), range=((0, 400), (0, 300)))[0]
    assert inside.min() >= 4


def test_features_of_another_photograph_of_the_same_name_size_and_time_are_not_taken(tmp_path):
    image, _ = blobs(3.0)
    path, found = tmp_path / "a.tif", []
    for grey in (image, image[::-1].copy()):
        with create_image(path, 500, 400, 1, "uint8") as writer:
            writer.write(0, grey[None])
        # padded to one size
        path.write_bytes(path.read_bytes().ljust(1 << 18, b"\0"))
        os.utime(path, (1e9, 1e9))
        found.append(features_of(path, FeatureOptions(), tmp_path / "cache"))
    assert found[0].key != found[1].key
    np.testing.assert_array_equal(found[1].xy, find_features(grey_8bit(path), FeatureOptions()).xy)


def test_sixteen_bits_are_stretched_and_kept_on_disk(tmp_path):
    """The same features from 16 bits as from 8; read again they are the same, and another file's are not taken."""
    image, _ = blobs(3.0)
    with create_image(tmp_path / "a.tif", 500, 400, 1, "uint16") as writer:
        writer.write(0, (image.astype(np.uint16) * 41 + 900)[None])
    grey = grey_8bit(tmp_path / "a.tif")
    assert (grey.min(), grey.max()) == (0, 255)
    first = features_of(tmp_path / "a.tif", FeatureOptions(), tmp_path / "cache")
    again = features_of(tmp_path / "a.tif", FeatureOptions(), tmp_path / "cache")
    np.testing.assert_array_equal(first.xy, again.xy)
    np.testing.assert_array_equal(first.descriptors, again.descriptors)
    fewer = features_of(tmp_path / "a.tif", FeatureOptions(count=10), tmp_path / "cache")
    assert len(fewer) == 10
    (tmp_path / "cache" / "a.tif.npz").write_bytes(b"damaged")
    np.testing.assert_array_equal(features_of(tmp_path / "a.tif", FeatureOptions(), tmp_path / "cache").xy, first.xy)


@pytest.mark.parametrize("counts", [(70, 50), (1500, 1100)])
def test_matches_are_those_of_a_plain_search(counts):
    rng = np.random.default_rng(2)
    base = rng.integers(0, 120, (max(counts), 128))
    one, other = (np.clip(base[:n] + rng.integers(-12, 13, (n, 128)), 0, 255).astype(np.uint8) for n in counts)
    other = other[rng.permutation(len(other))]
    a, b = (np.sqrt(d / d.sum(axis=1, keepdims=True)) for d in (one.astype(float), other.astype(float)))
    distance = np.sqrt(np.maximum(2.0 - 2.0 * a @ b.T, 0.0))
    expected = []
    for i in range(len(a)):
        j = int(np.argmin(distance[i]))
        row, column = np.sort(distance[i]), np.sort(distance[:, j])
        if np.argmin(distance[:, j]) == i and row[0] < 0.8 * row[1] and column[0] < 0.8 * column[1]:
            expected.append((i, j))
    assert len(expected) > 40
    assert [tuple(match) for match in mutual_matches(one, other, 0.8).tolist()] == expected


def test_neighbours():
    """On a line the two nearest; a photograph without a position is compared with all others."""
    place = np.array([[0.0, 0], [1, 0], [2.1, 0], [np.nan, np.nan], [9, 0]])
    assert neighbours(place, 1) == [(0, 1), (0, 3), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4)]


def test_neighbours_equally_far_away():
    """On a grid the first of those as far away as the last, wherever the grid lies and however it is turned."""
    grid = 100.0 * np.array([[i, j] for i in range(5) for j in range(6)])
    pairs = neighbours(grid, 6)
    assert max(sum(k in pair for pair in pairs) for k in range(30)) >= 6
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for moved in (grid + [5e5, 5.3e6], 10.0 * grid @ turn.T, grid @ turn.T + [3e5, 4e6]):
        assert neighbours(moved, 6) == pairs
