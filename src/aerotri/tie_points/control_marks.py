"""Where control points should appear in the photographs, and the pieces of photographs to find them in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, px_from_mm
from aerotri.coordinates.blocks import frame_of_block
from aerotri.formats.assembly import placing
from aerotri.formats.assembly.names_match import match_photographs
from aerotri.formats.assembly.parts import PointList
from aerotri.functional_model.collinearity import interior_row, predict
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block

Geoid = FilePath | None
HALF_SIZE_PX, LARGEST_HALF_PX = 80, 400
"""Half the side of a piece where control holds the block, and the largest where positions alone do."""
BROWN_ROUNDS = 5
"""Brown's errors belong to the measured position, which is sought."""


@dataclass(frozen=True, eq=False)
class ControlMarks:
    """Control points in photographs, k of them.

    Parameters
    ----------
    points : (N,) str names. xyz : (N, 3) in the block's CRS.
    point, image : (k,) index into these and into the photographs.
    predicted : (k, 2) px column and row. marked : (k, 2) px, NaN where not marked.
    half_size_px : of the piece around.
    """

    points: np.ndarray
    xyz: np.ndarray
    point: np.ndarray
    image: np.ndarray
    predicted: np.ndarray
    marked: np.ndarray
    half_size_px: int

    def __len__(self) -> int:
        return len(self.point)


def predict_marks(block: Block, given: PointList, ground: np.ndarray, geoid: FilePath | None = None) -> ControlMarks:
    """Control points wherever the orientation of the photographs says they are, inside of the format.

    Parameters
    ----------
    block : with start values. given : the control points. ground : (N, 3) tie points in the CRS of the block, for
        the height of points that have none.
    """
    xyz = placing.to_crs(given.xyz, given.crs, block.crs, geoid) if given.crs else given.xyz.copy()
    height = float(np.nanmedian(ground[:, 2])) if np.isfinite(ground[:, 2]).any() else 0.0
    xyz = np.column_stack([xyz[:, :2], np.where(np.isnan(xyz[:, 2]), height, xyz[:, 2])])
    known = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    oriented = np.flatnonzero(np.isfinite(block.images.centre).all(axis=1))
    point, image = (grid.ravel() for grid in np.meshgrid(known, oriented, indexing="ij"))
    px = _projected(block, xyz, point, image, geoid)
    size = np.array([camera.size_px for camera in block.cameras])[block.images.camera[image]]
    there = np.isfinite(px).all(axis=1) & (px >= 0.0).all(axis=1) & (px <= size).all(axis=1)
    point, image, px = point[there], image[there], px[there]
    return ControlMarks(
        given.points, xyz, point, image, px, _marked(block, given, point, image), _half_size(block, xyz)
    )


def _projected(
    block: Block, xyz: np.ndarray, point: np.ndarray, image: np.ndarray, geoid: FilePath | None
) -> np.ndarray:
    """(k, 2) px, NaN behind the camera."""
    rotation, centre = rotation_from_angles(block.images.angles, block.rotation), block.images.centre
    if block.crs != "local":
        frame = frame_of_block(block, geoid)
        rotation = frame.axes_at(centre) @ rotation
        xyz, centre = frame.to_local(xyz), frame.to_local(centre)
    interior = np.array([interior_row(camera) for camera in block.cameras])
    of_camera = block.images.camera[image]
    xy = np.zeros((len(point), 2))
    for _ in range(BROWN_ROUNDS):
        xy = predict(rotation, centre, xyz, interior, image, point, of_camera, xy)
    ahead = np.einsum("mi,mi->m", rotation[image][:, :, 2], xyz[point] - centre[image]) < 0.0
    px = np.full_like(xy, np.nan)
    for number, camera in enumerate(block.cameras):
        own = ahead & (of_camera == number)
        px[own] = px_from_mm(xy[own], camera.size_px, camera.pixel_mm)
    return px


def _marked(block: Block, given: PointList, point: np.ndarray, image: np.ndarray) -> np.ndarray:
    marked = np.full((len(point), 2), np.nan)
    if given.rays is None:
        return marked
    names = {name: row for row, name in enumerate(given.points.tolist())}
    index = match_photographs(given.rays.images, block.images.names)[0]
    own = {
        (names[given.rays.points[p]], index[i]): xy
        for p, i, xy in zip(given.rays.point.tolist(), given.rays.image.tolist(), given.rays.xy, strict=True)
        if given.rays.points[p] in names
    }
    for row, key in enumerate(zip(point.tolist(), image.tolist(), strict=True)):
        marked[row] = own.get(key, marked[row])
    return marked


def _half_size(block: Block, xyz: np.ndarray) -> int:
    """Two standard deviations of the positions, in pixels, where no control holds the block."""
    measured = np.isin(block.control.point, block.image_points.point)
    held = int((measured & ~block.control.is_check).sum()) >= 3
    if held or block.gnss_ins is None or not len(xyz):
        return HALF_SIZE_PX
    camera = block.cameras[0]
    above = abs(float(np.nanmedian(block.images.centre[:, 2]) - np.nanmedian(xyz[:, 2])))
    gsd = max(above * camera.pixel_mm / camera.focal_length_mm, 1e-9)
    wanted = 2.0 * float(np.nanmedian(block.gnss_ins.sigma[:, :2])) / gsd
    return int(np.clip(wanted, HALF_SIZE_PX, LARGEST_HALF_PX))


def pieces(
    marks: ControlMarks, paths: dict[str, Path], names: np.ndarray
) -> Iterator[tuple[int, tuple[int, int], bytes]]:
    """The photographs around the predicted positions, as (row of the marks, (column, row) of its corner, JPEG).

    Parameters
    ----------
    paths : of the photographs by name. names : (n,) str of the block's photographs.
    """
    import cv2

    from aerotri.tie_points.features import grey_8bit

    for number in np.unique(marks.image).tolist():
        grey = grey_8bit(paths[str(names[number])])
        for row in np.flatnonzero(marks.image == number).tolist():
            column, line = np.floor(marks.predicted[row]).astype(int).tolist()
            left, top = max(column - marks.half_size_px, 0), max(line - marks.half_size_px, 0)
            part = grey[top : line + marks.half_size_px + 1, left : column + marks.half_size_px + 1]
            done, packed = cv2.imencode(".jpg", part, [cv2.IMWRITE_JPEG_QUALITY, 92])
            if done:
                yield row, (left, top), packed.tobytes()
