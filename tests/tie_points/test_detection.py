"""Keypoints in the pixels that there are, against OpenCV's, and what is compared where a first look has been."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree

from aerotri.tie_points.detection import EDGE_THRESHOLD, LAYERS, SIGMA, keypoints_of, scale_space, with_directions
from aerotri.tie_points.features import CONTRAST_THRESHOLD, FeatureOptions, find_features
from aerotri.tie_points.matching import windows_of


@pytest.fixture(scope="module")
def textured() -> np.ndarray:
    """A grey image with details of all sizes."""
    rng = np.random.default_rng(5)
    layers = [gaussian_filter(rng.normal(0.0, 1.0, (300, 400)), s) * s for s in (1.5, 3.0, 6.0, 12.0)]
    image = sum(layers)
    return np.clip(np.rint(120.0 + 45.0 * image / image.std()), 0, 255).astype(np.uint8)


def test_keypoints_are_those_of_opencv(textured):
    """Of those larger than the smallest, which OpenCV finds in a doubled image: places, sizes and main directions."""
    octaves = scale_space(textured)
    own = keypoints_of(octaves, CONTRAST_THRESHOLD * 255.0 / LAYERS)
    angle = np.array([point.angle for point in with_directions(octaves, own)])
    theirs = cv2.SIFT.create(0, LAYERS, CONTRAST_THRESHOLD, EDGE_THRESHOLD, SIGMA, True).detect(textured, None)
    place, size = np.array([p.pt for p in theirs]), np.array([p.size for p in theirs])
    large = np.flatnonzero((own.size > 5.0) & (own.size < 40.0))
    near = KDTree(place).query_ball_point(own.xy[large], 0.3)
    found = [
        [k for k in rows if abs(np.log(size[k] / own.size[one])) < 0.1] for one, rows in zip(large, near, strict=True)
    ]
    assert len(large) > 150
    there = [bool(rows) for rows in found]
    assert np.mean(there) > 0.9
    off = [own.xy[one] - place[rows[0]] for one, rows in zip(large, found, strict=True) if rows]
    assert np.abs(np.mean(off, axis=0)).max() < 0.02
    turned = [
        min(abs((angle[one] - theirs[k].angle + 180.0) % 360.0 - 180.0) for k in rows)
        for one, rows in zip(large, found, strict=True) if rows
    ]  # fmt: skip
    assert np.mean(np.array(turned) < 5.0) > 0.9


def test_extrema_are_those_of_their_definition(textured):
    """Every keypoint lies by a pixel of a difference of Gaussians that is the largest or smallest of the 27 around."""
    octave = scale_space(textured)[0]
    found = keypoints_of([octave], CONTRAST_THRESHOLD * 255.0 / LAYERS)
    difference = np.diff(octave.astype(float), axis=0)
    shifted = [np.roll(difference, (a, b, c), (0, 1, 2)) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)]
    extreme = (difference >= np.max(shifted, axis=0)) | (difference <= np.min(shifted, axis=0))
    layer, row, column = np.nonzero(extreme[1:-1, 5:-5, 5:-5])
    there = KDTree(np.column_stack([column + 5, row + 5, layer + 1]))
    place = np.column_stack([found.xy, found.layer + found.between])
    assert len(found) > 100
    # between the pixels it has moved by half a pixel along each axis, one in ten by a step more
    far = there.query(place, p=np.inf)[0]
    assert np.mean(far <= 0.5 + 1e-9) > 0.85
    assert far.max() < 2.0


def test_blobs_in_their_own_pixels():
    """Where the pixels as they are hold enough, places are as right as in a doubled image."""
    rng = np.random.default_rng(3)
    places = np.array([[x, y] for x in range(40, 480, 50) for y in range(40, 380, 50)]) + rng.random((63, 2))
    row, column = np.indices((400, 500)) + 0.5
    image = np.full((400, 500), 40.0)
    for x, y in places:
        image += 150.0 * np.exp(-((column - x) ** 2 + (row - y) ** 2) / 18.0)
    grey = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    xy = find_features(grey, FeatureOptions(count=100)).xy
    off = np.array([xy[np.argmin(((xy - place) ** 2).sum(axis=1))] - place for place in places])
    assert np.abs(off).max() < 0.05
    assert np.abs(off.mean(axis=0)).max() < 0.01


def test_windows_hold_the_partners():
    """Of features under a plane map and relief, from sure matches that saw half of the relief; far fewer than all."""
    rng = np.random.default_rng(8)
    one = rng.random((4000, 2)) * [2000.0, 1500.0]
    relief = rng.uniform(-1.0, 1.0, (4000, 1)) * [[60.0, 0.0]]
    other = one @ np.array([[0.9, 0.1], [-0.1, 0.9]]) + [300.0, -100.0] + relief
    sure = np.flatnonzero(np.abs(relief[:, 0]) < 30.0)[:300]
    compared, held = 0, np.zeros(len(one), bool)
    for rows, columns in windows_of((one, other), np.column_stack([sure, sure])):
        held[rows] = np.isin(rows, columns)
        compared += len(rows) * len(columns)
    assert held.all()
    assert compared < 0.15 * len(one) ** 2
