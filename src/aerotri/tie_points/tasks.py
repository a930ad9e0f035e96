"""Features and matches found by other processes, and kept in files from which this process then reads them.

A photograph is a task, then its pairs with all that come after it. What other processes did not keep is found here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.execution.work import Work, Workplace
from aerotri.observations import Camera
from aerotri.tie_points.features import FeatureOptions, features_of
from aerotri.tie_points.matching import MatchOptions, matches_of
from aerotri.tie_points.photographs import PhotographSet

BYTES_OF_PROCESS, BYTES_OF_PIXEL, BYTES_OF_SOUGHT_PIXEL, BYTES_OF_FEATURE = 300_000_000, 8, 240, 8_000
"""Memory of a process: without work; of a pixel of a photograph as it is read; of one that features are sought in, all
octaves of SIFT with doubled sides; and of a feature, with those of thirty neighbours."""
AGAIN = "run the command again: what is done is kept"
Report = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class FeatureWork:
    """How features are sought, and where they are kept."""

    options: FeatureOptions
    cache: Path


@dataclass(frozen=True, eq=False)
class PairWork:
    """Photographs whose features are matched.

    Parameters
    ----------
    paths, cameras, names : of every photograph. features : as they were found. cache : with features and matches.
    """

    paths: tuple[Path, ...]
    cameras: tuple[Camera, ...]
    names: np.ndarray
    features: FeatureWork
    options: MatchOptions
    cache: Path


def find_features_of(shared: FeatureWork, path: Path) -> int:
    """Find the features of a photograph and keep them; how many there are."""
    return len(features_of(path, shared.options, shared.cache))


def match_with_others(shared: PairWork, task: tuple[int, tuple[int, ...]]) -> int:
    """Match a photograph with others and keep the matches; how many there are."""
    first, seconds = task
    s = shared
    features = {k: features_of(s.paths[k], s.features.options, s.features.cache) for k in (first, *seconds)}
    kept = s.cache / f"{s.names[first]}.npz"
    return sum(map(len, matches_of((first, seconds), features, s.cameras, s.options, kept)))


def features_elsewhere(
    photographs: PhotographSet, options: FeatureOptions, cache: Path, at: Workplace, report: Report
) -> None:
    """Find the features of all photographs, a task each, and keep them in `cache`.

    Raises
    ------
    InputError, TasksFailedError
    """
    work = Work(
        find_features_of, FeatureWork(options, cache.absolute()), [path.absolute() for path in photographs.paths],
        [f"features of {name}" for name in photographs.names.tolist()], "photographs", at.folder,
        BYTES_OF_PROCESS + max(bytes_of_search(camera, options) for camera in photographs.cameras), AGAIN,
    )  # fmt: skip
    at.executor.run(work, report)


def matches_elsewhere(
    photographs: PhotographSet, pairs: Sequence[tuple[int, int]], options: tuple[FeatureOptions, MatchOptions],
    caches: tuple[Path, Path], at: Workplace, report: Report,
) -> None:  # fmt: skip
    """Match all pairs, a task for every first photograph, and keep the matches.

    Parameters
    ----------
    caches : folders of features and of matches.

    Raises
    ------
    InputError, TasksFailedError
    """
    seconds = {i: tuple(j for first, j in pairs if first == i) for i in sorted({i for i, _ in pairs})}
    shared = PairWork(
        tuple(path.absolute() for path in photographs.paths),
        tuple(photographs.cameras[c] for c in photographs.camera.tolist()), photographs.names,
        FeatureWork(options[0], caches[0].absolute()), options[1], caches[1].absolute(),
    )  # fmt: skip
    work = Work(
        match_with_others, shared, list(seconds.items()),
        [f"pairs of {photographs.names[i]}" for i in seconds], "photographs", at.folder,
        BYTES_OF_PROCESS + BYTES_OF_FEATURE * options[0].count, AGAIN,
    )  # fmt: skip
    at.executor.run(work, report)


def bytes_of_search(camera: Camera, options: FeatureOptions) -> int:
    """Memory that the search for features in a photograph takes."""
    columns, rows = camera.size_px
    scale = min(1.0, options.longest_px / max(columns, rows))
    return int(columns * rows * (BYTES_OF_PIXEL + BYTES_OF_SOUGHT_PIXEL * scale**2))
