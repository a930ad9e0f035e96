"""The two point clouds of a change: what is known of their points, and what they were measured with."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError, real_path
from aerotri.crs_text import plan_of
from aerotri.public.dense import RECORD as DENSE
from aerotri.public.models import check_crs
from aerotri.public.stated import StatedAdjustment

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from aerotri.public.adjustment import Adjustment
    from aerotri.volume.change.adjusted_clouds import AdjustedDistances
    from aerotri.volume.change.clouds import Cloud, CloudDistances

CLOUDS = (".las", ".laz")
POINTS_IN_CYLINDER = 30.0
"""Points that a cylinder of the default diameter holds [L: Lague et al. 2013 ask for 20 and more]."""
BYTES_OF_POINT = 270
"""Coordinates, covariance and the tree."""


@dataclass(frozen=True, eq=False)
class CloudEpoch:
    """A cloud with its CRS and name.

    Parameters
    ----------
    key : of the adjustment it was measured with, '' where nothing says so. note : what was left out of it, in words.
    """

    cloud: Cloud
    crs: str
    label: str
    key: str = ""
    note: str = ""


def is_cloud(path: Any) -> bool:
    """Whether a path is that of a point cloud."""
    return isinstance(path, str | os.PathLike) and Path(path).suffix.lower() in CLOUDS


def opened(given: FilePath | np.ndarray) -> CloudEpoch:
    """A cloud, given as a file or as an array (n, 3).

    Raises
    ------
    InputError
        For what is no cloud, has too few points or does not fit into memory.
    """
    from aerotri.memory import refuse_beyond_memory
    from aerotri.volume.change.clouds import FEWEST, Cloud

    if isinstance(given, np.ndarray):
        xyz = np.asarray(given, dtype=float)
        if xyz.ndim != 2 or xyz.shape[1] != 3 or not np.isfinite(xyz).all():
            raise InputError("a cloud is no array (n, 3) of numbers", "give X, Y, Z of every point")
        epoch = CloudEpoch(Cloud(xyz, None), "", "array")
    else:
        epoch = _of_file(Path(given))
    count = len(epoch.cloud.xyz)
    if count < FEWEST:
        raise InputError(f"{epoch.label} has {count} points", "give a cloud of more points")
    refuse_beyond_memory(float(BYTES_OF_POINT) * count, f"{count} points", "cut out the part that is needed")
    return epoch


def _of_file(path: Path) -> CloudEpoch:
    from aerotri.formats.results.point_cloud import read_precise_cloud
    from aerotri.volume.change.clouds import Cloud

    if not is_cloud(path):
        raise InputError("is no point cloud", "give a LAS or LAZ file", path)
    read = read_precise_cloud(path)
    content = _beside(path) if read.matching is not None else {}
    stated = content.get("noise_length_m")
    length = float(stated) if isinstance(stated, int | float) and 0.0 <= stated < np.inf else None
    cloud = Cloud(read.xyz, read.covariance, read.matching, read.photographs, length)
    note = read.note and f"{path.name}: {read.note}"
    return CloudEpoch(cloud, read.crs, path.name, str(content.get("adjustment", "")), note)


def _beside(path: Path) -> dict[str, Any]:
    """What `aerotri dsm` wrote beside its cloud; empty where it is not there."""
    try:
        content = json.loads((path.parent / DENSE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def labels_of(first: CloudEpoch, second: CloudEpoch, given: Sequence[Any]) -> tuple[str, str]:
    """Names of both as they stand in results: with as many of the folders above as tell them apart."""
    labels = (first.label, second.label)
    if labels[0] != labels[1] or any(isinstance(one, np.ndarray) for one in given):
        return labels
    parts = [real_path(Path(one)).parts for one in given]
    for count in range(2, min(map(len, parts)) + 1):
        if parts[0][-count] != parts[1][-count]:
            return "/".join(parts[0][-count:]), "/".join(parts[1][-count:])
    return labels


def known_alike(first: Cloud, second: Cloud) -> tuple[Cloud, Cloud, str]:
    """Both clouds with σ of their points, or both without, and a sentence where one has none."""
    from aerotri.volume.change.clouds import Cloud

    if (first.covariance is None) == (second.covariance is None):
        return first, second, ""
    said = "one of the clouds has no σ of its points: the scatter of the points is taken for both"
    return Cloud(first.xyz, None), Cloud(second.xyz, None), said


def by_adjustments(
    found: CloudDistances, epochs: tuple[CloudEpoch, CloudEpoch], clouds: tuple[Cloud, Cloud],
    adjustments: tuple[Adjustment | FilePath | None, ...], crs: str,
) -> tuple[CloudDistances, AdjustedDistances | None, list[str], bool]:  # fmt: skip
    """The distances with a σ that knows the adjustments as far as they are known, sentences about them, and whether how
    the clouds lie to one another is known of them.

    Parameters
    ----------
    clouds : of the epochs, as they are used. adjustments : as stated.

    Raises
    ------
    InputError
        For one adjustment alone, or one that does not belong to its cloud.
    """
    from aerotri.volume.change.adjusted_clouds import adjusted_distances, with_adjustments

    first, second = (None if one is None else StatedAdjustment(one) for one in adjustments)
    if first is None and second is None:
        return _of_one_adjustment(found, epochs, clouds)
    if first is None or second is None:
        raise InputError(
            "the adjustment of one cloud is given alone",
            "give both: --first-adjustment and --second-adjustment; one result for both where they share it",
        )
    for epoch, stated in zip(epochs, (first, second), strict=True):
        check_crs(stated.record, plan_of(crs), Path(epoch.label))
    records = (first.record, first.record if second.is_same(first) else second.record)
    adjusted = adjusted_distances(found, clouds, records)
    said = list(dict.fromkeys(text for one in (first, second) for text in (one.doubt, one.missing) if text))
    return with_adjustments(found, clouds, adjusted), adjusted, [*said, adjusted.words], True


def _of_one_adjustment(
    found: CloudDistances, epochs: tuple[CloudEpoch, CloudEpoch], clouds: tuple[Cloud, Cloud]
) -> tuple[CloudDistances, None, list[str], bool]:
    """Where dsm.json beside both names one adjustment, its errors cancel and the noise of matching is left."""
    same = epochs[0].key != "" and epochs[0].key == epochs[1].key
    if same and all(cloud.matching is not None for cloud in clouds):
        return (
            found.with_variances(found.noise.sum(axis=1)), None,
            ["both clouds come from one adjustment: its errors cancel"], True,
        )  # fmt: skip
    said = []
    if all(cloud.covariance is not None for cloud in clouds):
        said.append(
            "what the adjustments of both clouds have in common, such as control points, is not known and makes σ too "
            "large: give both, --first-adjustment and --second-adjustment"
        )
    return found, None, said, False


def default_width(xyz: np.ndarray) -> float:
    """m, diameter of a cylinder that holds some 30 points on level ground of median density."""
    size = float(np.ptp(xyz[:, :2], axis=0).max()) / max(np.sqrt(len(xyz)) / 10.0, 1.0)
    if not size > 0.0:
        raise InputError("all points of a cloud have one place", "give a cloud of an area")
    _, count = np.unique(np.floor(xyz[:, :2] / size), axis=0, return_counts=True)
    density = float(np.median(count)) / size**2
    return float(f"{2.0 * np.sqrt(POINTS_IN_CYLINDER / (np.pi * density)):.2g}")


def check_sizes(sizes: Sequence[tuple[str, float]]) -> None:
    """Refuse sizes that are not possible.

    Raises
    ------
    InputError
    """
    for name, value in sizes:
        if not 0.0 < value < 1e6:
            raise InputError(f"{name} {value:g} m is not possible", "give metres above 0")


def within(stable: BaseGeometry | FilePath, crs: str, core: np.ndarray) -> np.ndarray:
    """(k,) bool, which places (k, 3) lie on stable ground."""
    import shapely

    from aerotri.volume.boundary import read_boundary

    polygon = (
        read_boundary(os.fspath(stable), plan_of(crs)).polygon if isinstance(stable, str | os.PathLike) else stable
    )
    return shapely.contains_xy(polygon, core[:, 0], core[:, 1])
