"""Point clouds, LAS and LAZ; nothing but this and `copc` knows laspy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from aerotri.conventions import InputError
from aerotri.crs_text import crs_text
from aerotri.formats.results.copc import write_copc
from aerotri.formats.results.las_header import check_las
from aerotri.vectors.geojson import LARGEST_M

if TYPE_CHECKING:
    from laspy import LasHeader
    from pyproj import CRS

    from aerotri.formats.results.copc import Octree
    from aerotri.terrain.dense.points import SurfacePoints

UNCLASSIFIED, GROUND, NOISE = 1, 2, (7, 18)
"""Classes of points [L: ASPRS LAS 1.4]."""
SCALE_M = 0.001
"""Step of the coordinates, m, which LAS keeps as whole numbers; chosen [C]: 1 mm is below σ of every picket, and 32
bits then reach over 4000 km."""

OF_MATCHING, OF_PHOTOGRAPHS = "sigma_z_matching", "photographs"
SURFACE_FIELDS = (
    ("NormalX", "f4", "of length 1, upwards"), ("NormalY", "f4", ""), ("NormalZ", "f4", ""),
    ("sigma_x", "f4", "sigma of X [m]"), ("sigma_y", "f4", "sigma of Y [m]"), ("sigma_z", "f4", "sigma of Z [m]"),
    ("cov_xy", "f4", "covariance of X, Y [m2]"), ("cov_xz", "f4", "covariance of X, Z [m2]"),
    ("cov_yz", "f4", "covariance of Y, Z [m2]"), (OF_MATCHING, "f4", "of matching alone [m]"),
    (OF_PHOTOGRAPHS, "u1", "that measured it"),
)  # fmt: skip
"""Name, type and meaning of the extra bytes of a surface; normals are named as PDAL and CloudCompare know them."""


def write_point_cloud(path: Path, xyz: np.ndarray, sigma: np.ndarray, ground: np.ndarray, crs: str | None) -> None:
    """Write points (n, 3) m as LAZ 1.4 with `sigma_z` (n,) m; what is ground (n,) bool has class 2."""
    import laspy
    from pyproj import CRS

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = np.floor(xyz.min(axis=0)), np.full(3, SCALE_M)
    header.add_extra_dim(laspy.ExtraBytesParams("sigma_z", "f4", "sigma of Z [m]"))
    if crs is not None:
        header.add_crs(CRS.from_user_input(crs))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    cloud.classification = np.where(ground, GROUND, UNCLASSIFIED).astype(np.uint8)
    cloud["sigma_z"] = sigma.astype(np.float32)
    with path.open("wb") as file:
        cloud.write(file, do_compress=True)


def write_surface_cloud(path: Path, parts: Iterable[SurfacePoints], tree: Octree, crs: str | None) -> int:
    """Write the cells of a surface as COPC, which is LAZ 1.4, with colours and `SURFACE_FIELDS`; how many.

    Ground has class 2.

    Parameters
    ----------
    parts : points, part by part. tree : over all of them.
    """
    import laspy
    from pyproj import CRS

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.offsets, header.scales = np.floor(tree.low), np.full(3, SCALE_M)
    header.add_extra_dims([laspy.ExtraBytesParams(*field) for field in SURFACE_FIELDS])
    if crs is not None:
        header.add_crs(CRS.from_user_input(crs))
    return write_copc(path, header, (_records(part, header) for part in parts), tree)


def _records(part: SurfacePoints, header: LasHeader) -> np.ndarray:
    """Packed points of a part."""
    import laspy

    points = laspy.ScaleAwarePointRecord.zeros(len(part.xyz), header=header)
    points.x, points.y, points.z = part.xyz.T
    points["return_number"] = points["number_of_returns"] = np.ones(len(part.xyz), np.uint8)
    points["classification"] = np.where(part.ground, GROUND, UNCLASSIFIED).astype(np.uint8)
    points["red"], points["green"], points["blue"] = part.colour.T
    for name, values in zip(SURFACE_FIELDS, _surface_fields(part), strict=True):
        points[name[0]] = values
    return points.array


def _surface_fields(part: SurfacePoints) -> tuple[np.ndarray, ...]:
    """Values of `SURFACE_FIELDS`, (n,) each."""
    xx, yy, zz, xy, xz, yz = part.covariance.T
    return (
        *part.normal.T, *(np.sqrt(np.maximum(v, 0.0)) for v in (xx, yy, zz)), xy, xz, yz, part.matching,
        part.photographs,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class PointCloud:
    """The points of a LAS or LAZ file that are to be used.

    Parameters
    ----------
    xyz : (n, 3) m. classes : (n,). usable : (N,) bool of all points of the file; false of noise (classes 7 and 18) and
        of points that are withheld.
    """

    xyz: np.ndarray
    classes: np.ndarray
    usable: np.ndarray

    @property
    def note(self) -> str:
        """How many were left out, '' where none was."""
        left = int(np.count_nonzero(~self.usable))
        if not left:
            return ""
        return f"{left} of {len(self.usable)} points are marked as noise (class 7 or 18) or withheld: left out"


def read_point_cloud(path: Path, parallel: bool = True) -> PointCloud:
    """The points of a LAS or LAZ file, without noise and those that are withheld.

    Parameters
    ----------
    parallel : whether LAZ is unpacked by several threads, which a forked process cannot.

    Raises
    ------
    InputError
    """
    import laspy

    check_las(path)
    try:
        backends = laspy.LazBackend.detect_available() if parallel else (laspy.LazBackend.Lazrs,)
        cloud = laspy.read(path, laz_backend=backends)
        xyz = np.column_stack([np.asarray(axis, dtype=float) for axis in (cloud.x, cloud.y, cloud.z)])
        classes = np.asarray(cloud.classification)
        usable = ~(np.isin(classes, NOISE) | np.asarray(cloud.withheld, dtype=bool))
    except BaseException as error:
        _refuse_damaged(error, path)
    if not (np.abs(xyz) <= LARGEST_M).all():
        raise InputError("has points at no possible place", "write the file anew, its scale or offset is damaged", path)
    if len(usable) and not usable.any():
        raise InputError("has no points but noise (class 7 or 18) and withheld ones", "give a cloud of points", path)
    return PointCloud(xyz[usable], classes[usable], usable)


def _refuse_damaged(error: BaseException, path: Path) -> NoReturn:
    """Raise what laspy and lazrs raised as a damaged file; an interrupt stays what it is.

    They raise whatever a damaged file leads to; a panic of lazrs is no Exception.
    """
    if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
        raise error
    raise InputError(f"cannot be read: {error}", "give a whole LAS or LAZ file", path) from error


@dataclass(frozen=True, eq=False)
class PreciseCloud:
    """Points of a LAS or LAZ file with what it says of their σ.

    Parameters
    ----------
    xyz : (n, 3) m. covariance : (n, 6) m², XX, YY, ZZ, XY, XZ, YZ; None where the points have no σ.
    matching : (n,) m, σ of Z by matching alone; photographs : (n,) that measured a point; None where not stated.
    crs : see `crs_text`. note : what was left out, '' for nothing.
    """

    xyz: np.ndarray
    covariance: np.ndarray | None
    matching: np.ndarray | None
    photographs: np.ndarray | None
    crs: str
    note: str


def read_precise_cloud(path: Path) -> PreciseCloud:
    """The points of a LAS or LAZ file with their covariances and CRS.

    What is stated of σ are `SURFACE_FIELDS`; with `sigma_x` to `sigma_z` alone the covariances are 0.

    Raises
    ------
    InputError
    """
    import laspy

    read = read_point_cloud(path)
    xyz, usable = read.xyz, read.usable
    refuse_cloud_units(path)
    try:
        cloud = laspy.read(path)
        there = set(cloud.point_format.dimension_names)
        names = ("sigma_x", "sigma_y", "sigma_z", "cov_xy", "cov_xz", "cov_yz")
        columns = [
            np.asarray(cloud[name], dtype=float)[usable] if name in there else np.zeros(len(xyz)) for name in names
        ]
        matching, photographs = (
            np.asarray(cloud[name], dtype=float)[usable] if name in there else None
            for name in (OF_MATCHING, OF_PHOTOGRAPHS)
        )
        system = crs_text(cloud.header.parse_crs())
    except BaseException as error:
        _refuse_damaged(error, path)
    if not {"sigma_x", "sigma_y", "sigma_z"} <= there:
        return PreciseCloud(xyz, None, None, None, system, read.note)
    covariance = np.column_stack([*(column**2 for column in columns[:3]), *columns[3:]])
    if not np.isfinite(covariance).all() or (matching is not None and not np.isfinite(matching).all()):
        raise InputError("has points whose σ is not a number", "write the cloud anew", path)
    return PreciseCloud(xyz, covariance, matching, photographs, system, read.note)


def system_of_cloud(path: Path) -> str:
    """The CRS of a LAS or LAZ file, see `crs_text`.

    Raises
    ------
    InputError
    """
    return crs_text(_crs_of(path))


def _crs_of(path: Path) -> CRS | None:
    import laspy

    check_las(path)
    try:
        with laspy.open(path) as file:
            return file.header.parse_crs()
    except BaseException as error:
        _refuse_damaged(error, path)


def refuse_cloud_units(path: Path) -> None:
    """Refuse a LAS or LAZ file whose CRS counts in degrees or feet.

    Raises
    ------
    InputError
    """
    crs = _crs_of(path)
    if crs is None:
        return
    for axis in crs.axis_info:
        if axis.unit_name not in ("metre", "meter", "unity"):
            raise InputError(
                f"is in {crs.name}, which counts {axis.name} in {axis.unit_name}",
                "bring it to metres first: pdal translate IN OUT reprojection --filters.reprojection.out_srs=EPSG:…",
                path,
            )
