"""Features of photographs: SIFT [L] (Lowe 2004) by OpenCV, evenly spread, kept on disk.

Positions are found in the whole photograph, or, where it is larger than wanted, in a reduced one. OpenCV counts pixels
from the centre of the first one, which is 0.5 here; its own shift by a quarter of a pixel, from doubling the
photograph, is switched off (``enable_precise_upscale``). The image is doubled only where its pixels as they are hold
too few features (`detection`).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.files.ownership import told_by
from aerotri.tie_points.detection import EDGE_THRESHOLD, LAYERS, SIGMA, keypoints_of, scale_space, with_directions
from aerotri.tie_points.settings import DEFAULTS

FIRST_PIXEL = 0.5
"""Pixels from the corner of the first pixel, where images begin here, to its centre, where OpenCV counts from."""
CONTRAST_THRESHOLD = 0.015
"""Below Lowe's: dark ground has features too, and `_spread` chooses."""
ENOUGH = 0.5
"""Share of the features wanted from which those of the pixels as they are will do; else the image is doubled."""
CELLS = 16
"""The long side of a photograph is divided into this many cells, each with its share of the features."""
STRETCH = (0.1, 99.9)
"""Percentiles of grey values of more than 8 bits that become black and white."""
JPEG = (".jpg", ".jpeg")
SAMPLE_STEP = 4
"""Every so many-th row and column that percentiles of grey values are taken from; chosen [C]: a sixteenth of millions
of pixels gives the same percentiles."""


@dataclass(frozen=True, eq=False)
class Features:
    """Features of one photograph, in every part of it the largest first.

    Parameters
    ----------
    xy : (n, 2) float32 px, (0, 0) the upper left corner. descriptors : (n, 128) uint8.
    sigma_px : a-priori standard deviation of a coordinate, in pixels of the photograph.
    key : tells these features from those of another file or of other settings.
    """

    xy: np.ndarray
    descriptors: np.ndarray
    sigma_px: float
    key: str

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def digest(self) -> bytes:
        """Tells features from others by what they are, whatever the file is called."""
        return hashlib.sha256(self.xy.tobytes() + self.descriptors.tobytes()).digest()


@dataclass(frozen=True)
class FeatureOptions:
    """How features are sought.

    Parameters
    ----------
    count : of a photograph, at most. longest_px : larger photographs are reduced to this long side.
    sigma_px : standard deviation of a coordinate, in pixels of the photograph they were sought in.
    """

    count: int = DEFAULTS.features
    longest_px: int = DEFAULTS.feature_size
    sigma_px: float = 0.5


def features_of(path: Path, options: FeatureOptions, cache: Path) -> Features:
    """The features of a photograph, from `cache` where they are there already.

    Raises
    ------
    InputError
        When the photograph cannot be read.
    """
    key = _key(path, options)
    kept = cache / f"{path.name}.npz"
    known = _kept(kept, key)
    if known is not None:
        return known
    found = find_features(grey_8bit(path), options, key)
    with atomic_file(kept) as place, place.open("wb") as file:
        np.savez(file, xy=found.xy, descriptors=found.descriptors, sigma_px=found.sigma_px, key=np.array(key))
    return found


def find_features(grey: np.ndarray, options: FeatureOptions, key: str = "") -> Features:
    """The features of a grey image, (rows, columns) uint8."""
    import cv2

    rows, columns = grey.shape
    scale = min(1.0, options.longest_px / max(rows, columns))
    size = round(columns * scale), round(rows * scale)
    if scale < 1.0:
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    xy, descriptors = _in_pixels(grey, options.count) or _in_doubled(grey, options.count)
    back = np.array([columns, rows]) / np.array(size)
    descriptors = np.clip(np.rint(descriptors), 0, 255).astype(np.uint8)
    return Features((xy * back).astype(np.float32), descriptors, options.sigma_px / scale, key)


def _in_pixels(grey: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Features, up to `count`, and their descriptors, from the pixels as they are; None where there are too few."""
    octaves = scale_space(grey)
    found = keypoints_of(octaves, CONTRAST_THRESHOLD * 255.0 / LAYERS)
    keep = _spread(found.xy, found.size, grey.shape[::-1], count)
    if len(keep) < ENOUGH * count:
        return None
    points, descriptors = _sift().compute(grey, with_directions(octaves, found.chosen(keep)))
    return np.array([point.pt for point in points]) + FIRST_PIXEL, descriptors


def _in_doubled(grey: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Features, up to `count`, and their descriptors, from the image with doubled sides."""
    points, descriptors = _sift().detectAndCompute(grey, None)
    if not points:
        return np.zeros((0, 2)), np.zeros((0, 128))
    xy = np.array([point.pt for point in points]) + FIRST_PIXEL
    keep = _spread(xy, np.array([point.size for point in points]), grey.shape[::-1], count)
    return xy[keep], descriptors[keep]


def _sift() -> Any:
    import cv2

    return cv2.SIFT.create(0, LAYERS, CONTRAST_THRESHOLD, EDGE_THRESHOLD, SIGMA, True)


def _spread(xy: np.ndarray, extent: np.ndarray, size: tuple[int, ...], count: int) -> np.ndarray:
    """Rows of the features to keep: one at a place, and the largest of every cell before the second largest.

    Large features are found again: of as many in foliage, three times more than of those with the strongest contrast.
    """
    order = np.lexsort((xy[:, 0], xy[:, 1], -extent))
    # a corner with two directions is the same point twice
    _, first = np.unique(xy[order], axis=0, return_index=True)
    order = order[np.sort(first)]
    cell = np.floor(xy[order] * (CELLS / max(size))).astype(np.int64) @ np.array([1, CELLS + 1])
    by_cell = np.argsort(cell, kind="stable")
    begins = np.flatnonzero(np.diff(cell[by_cell], prepend=-1))
    rank = np.empty(len(order), np.int64)
    rank[by_cell] = np.arange(len(order)) - np.repeat(begins, np.diff(begins, append=len(order)))
    chosen = np.argsort(rank, kind="stable")[:count]
    return order[chosen]


def grey_8bit(path: Path) -> np.ndarray:
    """(rows, columns) uint8, the grey values of a photograph; more than 8 bits are stretched over their range.

    Raises
    ------
    InputError
    """
    from aerotri.rasters.images import open_photograph

    grey = _luminance_of_jpeg(path) if path.suffix.lower() in JPEG else None
    if grey is not None:
        return grey
    with open_photograph(path) as photograph:
        pixels = photograph.read(0, photograph.rows)
        whole = photograph.dtype == np.uint8
    grey = pixels[0] if len(pixels) < 3 else _luminance(pixels)
    return grey if whole else _stretched(grey, path)


def _luminance_of_jpeg(path: Path) -> np.ndarray | None:
    """The grey values that a JPEG holds beside its colours, as they stand in the file; None where it is damaged."""
    import cv2

    coded = np.fromfile(path, np.uint8)
    grey = cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION) if len(coded) else None
    return None if grey is None or grey.ndim != 2 else grey


def _luminance(pixels: np.ndarray) -> np.ndarray:
    """Grey of red, green and blue (ITU-R BT.601), of the type of the pixels."""
    grey = np.zeros(pixels.shape[1:], np.float32)
    for band, weight in zip(pixels, (0.299, 0.587, 0.114), strict=False):
        grey += np.float32(weight) * band
    return grey if pixels.dtype.kind == "f" else np.rint(grey).astype(pixels.dtype)


def _stretched(grey: np.ndarray, path: Path) -> np.ndarray:
    sample = grey[::SAMPLE_STEP, ::SAMPLE_STEP].astype(float)
    sample = sample[np.isfinite(sample)]
    if not len(sample):
        raise InputError("has no grey values", "give a whole photograph", path)
    low, high = np.percentile(sample, STRETCH)
    scaled = (np.nan_to_num(grey.astype(np.float32)) - low) * (255.0 / max(high - low, 1e-12))
    return np.rint(np.clip(scaled, 0.0, 255.0)).astype(np.uint8)


def _key(path: Path, options: FeatureOptions) -> str:
    import cv2

    sought = (options, CONTRAST_THRESHOLD, ENOUGH, CELLS, STRETCH, cv2.__version__)
    told = (*told_by(path), *sought)
    return hashlib.sha256(repr(told).encode()).hexdigest()


def _kept(path: Path, key: str) -> Features | None:
    """Features from disk, None where there are none or they belong to something else."""
    from aerotri.formats.files.npz import read_kept

    wanted = {"key": ("U", ()), "xy": ("f", (None, 2)), "descriptors": ("fiu", (None, 128)), "sigma_px": ("f", ())}
    kept = read_kept(path, wanted)
    if kept is None or str(kept["key"]) != key or len(kept["xy"]) != len(kept["descriptors"]):
        return None
    sigma = float(kept["sigma_px"])
    good = np.isfinite(kept["xy"]).all() and np.isfinite(sigma) and sigma > 0.0
    good = good and ((kept["descriptors"] >= 0) & (kept["descriptors"] <= 255)).all()
    return Features(kept["xy"].astype(np.float32), kept["descriptors"].astype(np.uint8), sigma, key) if good else None
