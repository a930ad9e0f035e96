"""What a block holds, counted before it is adjusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aerotri.observations import Block, Camera
from aerotri.observations.names import without_image_points


@dataclass(frozen=True)
class CameraUse:
    """A camera and how many photographs it took."""

    name: str
    model: str
    size_px: tuple[int, int]
    pixel_um: float
    focal_length_mm: float
    photographs: int
    projection: str


@dataclass(frozen=True)
class StripTies:
    """A strip: its photographs, and how many of its points other strips have as well."""

    name: str
    photographs: int
    common_points: int


@dataclass(frozen=True)
class ImagePointCounts:
    """Image points.

    Parameters
    ----------
    count : of them. points : object points they measure. rays_per_point : points by their number of photographs.
    in_one_photograph : points that only one photograph has, which nothing fixes.
    mean_rays : photographs a point, on average. fewest, median : image points in a photograph.
    sigma_um : median of their standard deviations.
    """

    count: int
    points: int
    rays_per_point: dict[int, int]
    in_one_photograph: int
    mean_rays: float
    fewest: int
    median: float
    sigma_um: float


@dataclass(frozen=True)
class GroundPointCounts:
    """Control or check points: with coordinates in full, in plan or height alone; with and without image points."""

    count: int
    full: int
    plan_only: int
    height_only: int
    with_image_points: int
    without_image_points: tuple[str, ...]


@dataclass(frozen=True)
class Extent:
    """Smallest and largest X, Y, Z, m, of some positions; NaN where a coordinate is not known."""

    name: str
    count: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]


@dataclass(frozen=True)
class Inventory:
    """All that is counted.

    Parameters
    ----------
    photographs : of them; with_start_position, with_start_angles, with_gnss, with_ins : that have such.
    without_image_points : photographs that no point is measured in.
    parts : photographs by the parts that no point ties together, the largest first.
    angles : smallest and largest start or INS angle ω, φ, κ, rad; () without any.
    """

    photographs: int
    with_start_position: int
    with_start_angles: int
    with_gnss: int
    with_ins: int
    without_image_points: tuple[str, ...]
    parts: tuple[tuple[str, ...], ...]
    cameras: tuple[CameraUse, ...]
    strips: tuple[StripTies, ...]
    image_points: ImagePointCounts
    control: GroundPointCounts
    check: GroundPointCounts
    extents: tuple[Extent, ...]
    angles: tuple[tuple[float, float], ...]


def inventory(block: Block) -> Inventory:
    """Count what a block holds."""
    images, rays, observed = block.images, block.image_points, block.gnss_ins
    in_photograph = np.bincount(rays.image, minlength=len(images))
    return Inventory(
        photographs=len(images),
        with_start_position=_known(images.centre),
        with_start_angles=_known(images.angles),
        with_gnss=0 if observed is None else _known(observed.xyz),
        with_ins=0 if observed is None else _known(observed.angles),
        without_image_points=tuple(images.names[in_photograph == 0].tolist()),
        parts=_parts(block),
        cameras=tuple(_camera_use(one, int((images.camera == k).sum())) for k, one in enumerate(block.cameras)),
        strips=_strips(block),
        image_points=_image_points(block, in_photograph),
        control=_ground_points(block, False),
        check=_ground_points(block, True),
        extents=_extents(block),
        angles=_angles(block),
    )


def _known(values: np.ndarray) -> int:
    return int(np.isfinite(values).all(axis=1).sum())


def _camera_use(camera: Camera, photographs: int) -> CameraUse:
    return CameraUse(
        camera.name, camera.model, camera.size_px, camera.pixel_um, camera.focal_length_mm, photographs,
        camera.projection,
    )  # fmt: skip


def _sees(block: Block) -> coo_array:
    """(n, N) which photograph has which point."""
    rays = block.image_points
    return coo_array((np.ones(len(rays)), (rays.image, rays.point)), shape=(len(block.images), len(block.points)))


def _parts(block: Block) -> tuple[tuple[str, ...], ...]:
    n = len(block.images)
    sees = _sees(block)
    # photographs and points as the nodes of one graph
    graph = coo_array((sees.data, (sees.row, sees.col + n)), shape=(n + len(block.points),) * 2)
    label = connected_components(graph, directed=False)[1][:n]
    there = np.isin(np.arange(n), block.image_points.image)
    groups = [np.flatnonzero(there & (label == k)) for k in np.unique(label[there])]
    return tuple(tuple(block.images.names[rows].tolist()) for rows in sorted(groups, key=len, reverse=True))


def _strips(block: Block) -> tuple[StripTies, ...]:
    names = np.asarray(block.images.strip)
    known = [name for name in dict.fromkeys(names.tolist()) if name]
    number = {name: k for k, name in enumerate(known)}
    of_image = np.array([number.get(name, -1) for name in names.tolist()], dtype=np.int64)
    rays = block.image_points
    strip = of_image[rays.image]
    own = strip >= 0
    sees = coo_array((np.ones(int(own.sum())), (strip[own], rays.point[own])), shape=(len(known), len(block.points)))
    sees = sees.tocsr()
    sees.data[:] = 1.0
    several = np.asarray(sees.sum(axis=0)).ravel() >= 2 if len(known) else np.zeros(len(block.points), bool)
    common = np.asarray(sees[:, several].sum(axis=1)).ravel().astype(int) if len(known) else np.zeros(0, int)
    return tuple(
        StripTies(name, int((of_image == k).sum()), int(common[k])) for k, name in enumerate(known)
    )  # fmt: skip


def _image_points(block: Block, in_photograph: np.ndarray) -> ImagePointCounts:
    rays = block.image_points
    count = np.bincount(rays.point, minlength=len(block.points))
    number, points = np.unique(count[count > 0], return_counts=True)
    there = in_photograph[in_photograph > 0]
    measured = int(points.sum())
    return ImagePointCounts(
        count=len(rays),
        points=measured,
        rays_per_point=dict(zip(number.tolist(), points.tolist(), strict=True)),
        in_one_photograph=int((count == 1).sum()),
        mean_rays=len(rays) / measured if measured else 0.0,
        fewest=int(there.min(initial=0)) if not len(there) else int(there.min()),
        median=float(np.median(there)) if len(there) else 0.0,
        sigma_um=1e3 * float(np.median(rays.sigma)) if len(rays) else float("nan"),
    )


def _ground_points(block: Block, is_check: bool) -> GroundPointCounts:
    own = block.control.is_check == is_check
    known = np.isfinite(block.control.xyz[own])
    plan = known[:, :2].all(axis=1)
    lonely = without_image_points(block)[own]
    names = block.points[block.control.point[own][lonely]].astype(str).tolist()
    return GroundPointCounts(
        count=int(own.sum()),
        full=int(known.all(axis=1).sum()),
        plan_only=int((plan & ~known[:, 2]).sum()),
        height_only=int((~known[:, :2].any(axis=1) & known[:, 2]).sum()),
        with_image_points=int((~lonely).sum()),
        without_image_points=tuple(names),
    )


def _extents(block: Block) -> tuple[Extent, ...]:
    control = block.control
    places = [
        ("control", control.xyz[~control.is_check]),
        ("check points", control.xyz[control.is_check]),
        ("start values", block.images.centre),
    ]
    if block.gnss_ins is not None:
        places.append(("GNSS", block.gnss_ins.xyz))
    return tuple(extent(name, xyz) for name, xyz in places if np.isfinite(xyz).any())


def extent(name: str, xyz: np.ndarray) -> Extent:
    """Smallest and largest of the known coordinates (n, 3), m."""
    low, high = [], []
    for column in xyz.T:
        known = column[np.isfinite(column)]
        low.append(float(known.min()) if len(known) else float("nan"))
        high.append(float(known.max()) if len(known) else float("nan"))
    return Extent(name, int(np.isfinite(xyz).any(axis=1).sum()), (low[0], low[1], low[2]), (high[0], high[1], high[2]))


def _angles(block: Block) -> tuple[tuple[float, float], ...]:
    angles = [block.images.angles] + ([] if block.gnss_ins is None else [block.gnss_ins.angles])
    whole = np.concatenate(angles)
    whole = whole[np.isfinite(whole).all(axis=1)]
    return tuple((float(column.min()), float(column.max())) for column in whole.T) if len(whole) else ()
