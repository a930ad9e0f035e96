"""Clusters of photographs: sets that may share an error, such as the strips of a flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.track import (
    exposure_times,
    headings,
    one_an_exposure,
    order_of_exposure,
    strips_of_track,
)
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block

FEWEST = 5
"""Clusters from which a jackknife is made [C]: a variance of four degrees of freedom has a σ of 35 % of itself as a
standard deviation; of fewer clusters it says nothing."""
ALONE = 0.7
"""Share of the photographs from which a cluster holds the block alone [C]: the others show little of its errors."""
MOST, MOST_OF_LARGE, LARGE = 30, 12, 5000
"""Clusters at most, and at most in a block of more than LARGE photographs [C]: each costs a factorisation."""
PHOTOGRAPH, PER_CLUSTER, MOST_AT_RANDOM = "photograph", 3, 15
"""The scheme of errors of single photographs: photographs at random into clusters of PER_CLUSTER at least, so many at
most. What belongs to photographs adds up in such clusters as it does alone."""
MOST_TESTED = 60
"""Clusters of the scheme PHOTOGRAPH in its test [C]: more of them see smaller errors, and cost no factorisation. With
six deformations looked at they have 360 degrees of freedom, enough for errors 1.2 times as large as noise explains."""
CAMERA = "camera"
"""The scheme of errors that all photographs of one camera share, of a rig of FEWEST cameras or more."""
OF_ONE_EXPOSURE = ("time", "station")
"""Columns of images.csv that have a value of their own for every exposure and make no groups."""
SAME_WAY = np.radians(30.0)
"""Strips whose directions differ by less were flown the same way; photographs look the same way."""
FEWEST_OF_STRIP, LEAST_IN_STRIPS, STRAIGHT = 3, 0.5, 0.25
"""Strips are looked for where the track turns. There are none [C] where less than half of the exposures lie in straight
pieces of three exposures or more, not wider than a quarter of their length. Such blocks, of a facade or around an
object, are divided by the direction in which the photographs look."""
VIEW = "direction of view"
"""The scheme of photographs that look the same way, in a block without strips."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """One way to divide the photographs.

    Parameters
    ----------
    scheme : 'strip', 'direction of flight', VIEW, a column of images.csv, CAMERA or PHOTOGRAPH.
    label : (n,) number of every photograph's cluster, photographs as in `Unknowns`. names : (m,) of the clusters.
    joined : how many groups of the scheme there are where neighbours were joined to fewer clusters; len(names) if not.
    """

    scheme: str
    label: np.ndarray
    names: tuple[str, ...]
    joined: int

    def __len__(self) -> int:
        return len(self.names)


def cluster_schemes(block: Block, rows: np.ndarray, centre: np.ndarray) -> tuple[Clusters, ...]:
    """Strips, directions of flight or of view, every grouping column of images.csv, cameras and single photographs.

    A scheme of one cluster is left out unless the block is one strip, and one that divides the photographs as another
    before it.

    Parameters
    ----------
    block : its photographs, cameras and positions are looked at. rows : (n,) photographs that take part.
    centre : (n, 3) m, adjusted.
    """
    images = block.images
    found = _of_flight(block, rows, centre) or _of_views(block, rows)
    for name, values in images.columns.items():
        if name in OF_ONE_EXPOSURE:
            continue
        names, label = np.unique(values[rows].astype(str), return_inverse=True)
        found.append(_limited(name, label, tuple(str(n) for n in names)))
    of_camera = np.array([camera.name for camera in block.cameras])[images.camera[rows]]
    cameras, label = np.unique(of_camera, return_inverse=True)
    if len(cameras) >= FEWEST:
        found.append(_limited(CAMERA, label, tuple(cameras.tolist())))
    kept: list[Clusters] = []
    for clusters in found:
        several = 2 <= len(clusters) <= len(rows) // 2 or (clusters.scheme == "strip" and len(clusters) == 1)
        if several and not any(_alike(clusters, other) for other in kept):
            kept.append(clusters)
    return (*kept, _at_random(centre))


def _of_flight(block: Block, rows: np.ndarray, centre: np.ndarray) -> list[Clusters]:
    """Strips and directions of flight; none where the block was not flown in strips."""
    # the heads of a rig fly one track, not one a head
    alone, exposure = one_an_exposure(block, rows)
    order = _order_of_exposure(block, rows[alone], centre[alone])
    named = block.images.strip[rows[alone]].astype(str)
    strip, strip_names = _strips(named, centre[alone], order)
    if not all(named.tolist()) and not _is_flown(strip, centre[alone]):
        return []
    way = np.empty_like(strip)
    way[order], way_names = _directions(centre[alone][order], strip[order])
    return [
        _limited("strip", strip[exposure], strip_names),
        _limited("direction of flight", way[exposure], way_names),
    ]


def _is_flown(strip: np.ndarray, centre: np.ndarray) -> bool:
    """Whether enough exposures, strips (e,) and centres (e, 3), lie in straight pieces of the track."""
    inside = 0
    for number in np.unique(strip):
        xy = centre[strip == number, :2]
        if len(xy) >= FEWEST_OF_STRIP:
            length, width = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
            inside += len(xy) if width <= STRAIGHT * length else 0
    return inside >= LEAST_IN_STRIPS * len(strip)


def _of_views(block: Block, rows: np.ndarray) -> list[Clusters]:
    """Photographs that look the same way together, by the orientations of the block where it has them."""
    angles = block.images.angles[rows]
    if not np.isfinite(angles).all():
        return []
    axis = rotation_from_angles(angles, block.rotation)[:, :, 2]
    label, found = np.zeros(len(axis), dtype=np.int64), []
    for k, own in enumerate(axis):
        near = [float(own @ other) for other in found]
        if not near or max(near) < np.cos(SAME_WAY):
            found.append(own)
            near.append(1.0)
        label[k] = int(np.argmax(near))
    return [_limited(VIEW, label, tuple(str(k + 1) for k in range(len(found))))]


def order_by_place(xyz: np.ndarray) -> np.ndarray:
    """Rows of places by their distance from the middle of all: an order that hangs on no name, row, shift or turn."""
    return np.argsort(np.linalg.norm(xyz - xyz.mean(axis=0), axis=1), kind="stable") if len(xyz) else np.arange(0)


def divided_at_random(centre: np.ndarray, label: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(n,) labels exchanged at random among photographs with centres (n, 3), the same for any order of their rows."""
    order = order_by_place(centre)
    _, first, number = np.unique(label[order], return_index=True, return_inverse=True)
    changed = np.empty(len(label), dtype=np.int64)
    changed[order] = rng.permutation(np.argsort(np.argsort(first))[number])
    return changed


def to_test(clusters: Clusters, centre: np.ndarray) -> Clusters:
    """The clusters that are tested for a scheme: of single photographs more than its variance is taken from.

    Parameters
    ----------
    centre : (n, 3) m, of the photographs.
    """
    return _at_random(centre, MOST_TESTED, 1) if clusters.scheme == PHOTOGRAPH else clusters


def _at_random(centre: np.ndarray, most: int = MOST_AT_RANDOM, per_cluster: int = PER_CLUSTER) -> Clusters:
    """Photographs at random into clusters of `per_cluster` at least, so many at most."""
    n = len(centre)
    most = max(min(most if n <= LARGE else MOST_OF_LARGE, n // per_cluster), 1)
    equal = np.empty(n, dtype=np.int64)
    equal[order_by_place(centre)] = np.arange(n) % most
    label = divided_at_random(centre, equal, np.random.default_rng(n))
    return Clusters(PHOTOGRAPH, label, tuple(str(k + 1) for k in range(most)), n)


def _order_of_exposure(block: Block, rows: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(e,) order in which the photographs `rows` (e,) with centres (e, 3) were taken."""
    named = block.images.strip[rows].astype(str)
    strips = named if all(named.tolist()) else np.full(len(rows), "")
    return order_of_exposure(centre, strips, block.images.names[rows], exposure_times(block)[rows])


def _strips(named: np.ndarray, centre: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Strips (e,) of exposures and their names in their order: by name (e,), or found at turns of the centres."""
    if all(named.tolist()):
        names = list(dict.fromkeys(named[order].tolist()))
        return np.array([names.index(name) for name in named]), tuple(names)
    strip = np.empty(len(named), dtype=np.int64)
    strip[order] = strips_of_track(centre[order], np.full(len(named), ""))
    return strip, tuple(str(k + 1) for k in range(int(strip.max(initial=-1)) + 1))


def _directions(centre: np.ndarray, strip: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Strips flown the same way together; the names are compass directions in degrees."""
    heading = headings(centre, strip)
    label, found = np.zeros(len(strip), dtype=np.int64), []
    for number in np.unique(strip):
        own = strip == number
        angle = float(np.nan_to_num(heading[own][0]))
        apart = [abs((angle - other + np.pi) % (2.0 * np.pi) - np.pi) for other in found]
        if not apart or min(apart) > SAME_WAY:
            found.append(angle)
            apart.append(0.0)
        label[own] = int(np.argmin(apart))
    return label, tuple(f"{(90.0 - np.degrees(angle)) % 360.0:.0f}°" for angle in found)


def _limited(scheme: str, label: np.ndarray, names: tuple[str, ...]) -> Clusters:
    """At most MOST clusters, neighbours joined."""
    most, count = MOST if len(label) <= LARGE else MOST_OF_LARGE, len(names)
    if count <= most:
        return Clusters(scheme, label, names, count)
    joined = label * most // count
    first = [names[int(np.flatnonzero(np.arange(count) * most // count == k)[0])] for k in range(most)]
    last = [names[int(np.flatnonzero(np.arange(count) * most // count == k)[-1])] for k in range(most)]
    labels = tuple(a if a == b else f"{a} to {b}" for a, b in zip(first, last, strict=True))
    return Clusters(scheme, joined, labels, count)


def _alike(first: Clusters, second: Clusters) -> bool:
    pairs = set(zip(first.label.tolist(), second.label.tolist(), strict=True))
    return len(first) == len(second) == len(pairs)
