"""pycolmap's part: what fits one geometry of two photographs, and the first orientation by incremental mapping."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.assembly.reprojection import ideal_tangents
from aerotri.formats.foreign.colmap_cameras import SIGN
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.observations import Block, Camera, Prior

LENS_IN_MAPPING = ("k1", "k2")
"""Lens parameters that the first orientation estimates; the adjustment frees the others."""
FEWEST_INITIAL, FEWEST_POSE = 50, 15
"""Points in common of the first pair, and of a further photograph: half of COLMAP's defaults, 100 and 30; aerial tie
points are spread evenly and fewer than those of other photographs."""
SMALLEST_ANGLE_DEG = (16.0, 8.0, 4.0, 2.0)
"""Angles between the rays of the first pair, tried one after the other: narrow cameras have small ones."""
PAIR_TRIALS = 500
"""Random samples of a pair at most: points have names, so that half of them right is little; 200 samples of five then
hold a right one with a probability of 99.8 %. COLMAP's 10 000 are spent on planes that are none."""
MOST_PARTS = 10
"""Parts of a block that are looked for [C]."""
FIRST_PAIRS = 30
"""First pairs that are tried for a part [C]: where so many fail, the others do."""
SMALLEST_PART = 3
"""Photographs of a part that is worth a frame of its own."""
GROWTH = 1.3
"""Growth of a part after which it is adjusted as a whole [C]: above COLMAP's 1.1, for speed; a start needs no
better."""


@dataclass(frozen=True, eq=False)
class Mapped:
    """A first orientation in a frame of its own.

    Parameters
    ----------
    centre : (n, 3); rotation : (n, 3, 3) camera → object; NaN for photographs that could not be oriented.
    cameras : with the focal lengths and lenses found.
    """

    centre: np.ndarray
    rotation: np.ndarray
    cameras: tuple[Camera, ...]


def has_known_focal_length(camera: Camera) -> bool:
    """Whether the principal distance is fixed or observed."""
    return camera.interior["focal_length_mm"].kind != "free"


def is_held(camera: Camera) -> bool:
    """Whether the camera is known: its principal distance and its lens."""
    return has_known_focal_length(camera) and not any(prior.kind == "free" for prior in camera.lens.values())


def pinhole(camera: Camera) -> Any:
    """pycolmap's camera with the principal distance and principal point as they are stated, no lens.

    Raises
    ------
    InputError
        For a fisheye.
    """
    from aerotri.colmap_library import pycolmap

    if camera.is_fisheye:
        raise InputError(
            f"camera '{camera.name}' is a fisheye: tie points are matched and oriented in perspective photographs only",
            "measure the tie points with COLMAP, camera model OPENCV_FISHEYE, and read its model as a block",
        )

    return pycolmap.Camera(
        model="SIMPLE_PINHOLE",
        width=camera.size_px[0],
        height=camera.size_px[1],
        params=[camera.focal_length_mm / camera.pixel_mm, *_principal_px(camera)],
        has_prior_focal_length=True,
    )


def _principal_px(camera: Camera) -> list[float]:
    return px_from_mm(np.array([camera.principal_point_mm]), camera.size_px, camera.pixel_mm)[0].tolist()


def two_view_inliers(
    cameras: tuple[Any, Any], xy: tuple[np.ndarray, np.ndarray], tolerance_px: float, fewest: int, seed: int
) -> np.ndarray:
    """(k,) rows of the matches that one geometry of two photographs explains.

    Parameters
    ----------
    cameras : see `pinhole`. xy : (m, 2) px each, row by row the same point.
    """
    from aerotri.colmap_library import pycolmap

    options = _two_view_options(fewest, seed)
    options.ransac.max_error = tolerance_px
    rows = np.arange(len(xy[0]), dtype=np.uint32)
    geometry = pycolmap.estimate_two_view_geometry(
        cameras[0], xy[0].astype(float), cameras[1], xy[1].astype(float), np.column_stack([rows, rows]), options
    )
    return np.asarray(geometry.inlier_matches, dtype=np.int64).reshape(-1, 2)[:, 0]


def _two_view_options(fewest: int, seed: int) -> Any:
    from aerotri.colmap_library import pycolmap

    options = pycolmap.TwoViewGeometryOptions()
    options.min_num_inliers = fewest
    options.detect_watermark = False
    options.ransac.random_seed = seed
    return options


def map_incrementally(
    block: Block, seed: int, tolerance_px: float = 4.0, report: Callable[[int], None] = lambda done: None
) -> Mapped:
    """Orient photographs from their image points alone.

    Unknown cameras get focal length and radial lens; known ones keep theirs. With one thread, so that it repeats.

    Parameters
    ----------
    block : cameras, image points, no orientation. report : called with the photographs oriented so far.

    Raises
    ------
    InputError
        When no two photographs make a beginning.
    """
    return _mapped_parts(block, lambda angle: _mapping_options(block, seed, angle, tolerance_px), None, report)[0]


def map_parts(block: Block, seed: int, partners: int, tolerance_px: float = 4.0) -> tuple[Mapped, ...]:
    """As `map_incrementally`, every part of a block that falls apart in a frame of its own, the largest first.

    Parameters
    ----------
    partners : photographs that each is matched with, those with most points in common. What ties the block together
        stays.

    Raises
    ------
    InputError
        When no two photographs make a beginning.
    """

    def options(angle: float) -> Any:
        found = _mapping_options(block, seed, angle, tolerance_px)
        found.multiple_models = True
        found.max_num_models = MOST_PARTS
        found.min_model_size = SMALLEST_PART
        found.init_num_trials = FIRST_PAIRS
        return found

    return _mapped_parts(block, options, partners, lambda done: None)


def _mapped_parts(
    block: Block, options_at: Callable[[float], Any], partners: int | None, report: Callable[[int], None]
) -> tuple[Mapped, ...]:
    """The models of the first angle that gives any, the largest first; `options_at` takes the angle in degrees.

    `partners` are those that a photograph is matched with at most.
    """
    from aerotri.colmap_library import pycolmap

    with tempfile.TemporaryDirectory() as folder, _quiet():
        database = Path(folder) / "database.db"
        _write_database(block, database, partners)
        for angle in SMALLEST_ANGLE_DEG:
            options = options_at(angle)
            done = [1]

            def advance(done: list[int] = done) -> None:
                done[0] += 1
                report(done[0])

            pycolmap.set_random_seed(options.random_seed)
            models = pycolmap.incremental_mapping(
                database, folder, folder, options, initial_image_pair_callback=advance, next_image_callback=advance
            )
            if models:
                largest_first = sorted(models.values(), key=lambda model: -model.num_reg_images())
                return tuple(_mapped(block, model) for model in largest_first)
    raise InputError(
        "no pair of photographs is good enough to start the orientation",
        "check that the photographs overlap, and the focal length and the size of a pixel",
    )


@contextmanager
def _quiet() -> Generator[None]:
    """pycolmap's own messages silenced for the time being."""
    from aerotri.colmap_library import pycolmap

    level = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = level


def _mapping_options(block: Block, seed: int, angle_deg: float, tolerance_px: float) -> Any:
    from aerotri.colmap_library import pycolmap

    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.num_threads = options.mapper.num_threads = 1
    options.extract_colors = False
    options.multiple_models = False
    options.min_num_matches = FEWEST_POSE
    options.min_model_size = 2
    options.ba_refine_focal_length = options.mapper.abs_pose_refine_focal_length = not any(
        has_known_focal_length(camera) and not is_held(camera) for camera in block.cameras
    )
    options.constant_cameras = {n for n, camera in enumerate(block.cameras, 1) if is_held(camera)}
    mapper, triangulation = options.mapper, options.triangulation
    triangulation.ignore_two_view_tracks = False
    mapper.init_min_num_inliers, mapper.abs_pose_min_num_inliers = FEWEST_INITIAL, FEWEST_POSE
    mapper.init_min_tri_angle = angle_deg
    mapper.init_max_error = mapper.filter_max_reproj_error = tolerance_px
    mapper.abs_pose_max_error = 3.0 * tolerance_px
    options.ba_global_frames_ratio = options.ba_global_points_ratio = GROWTH
    triangulation.merge_max_reproj_error = triangulation.complete_max_reproj_error = tolerance_px
    return options


def _keypoints(block: Block) -> np.ndarray:
    """(m, 2) px as COLMAP's cameras see them: as measured, of known cameras freed of all they are known to do."""
    rays, tangent = block.image_points, ideal_tangents(block)
    px, of_camera = np.empty_like(rays.xy), block.images.camera[rays.image]
    for number, camera in enumerate(block.cameras):
        own = of_camera == number
        xy = rays.xy[own]
        if is_held(camera):
            xy = tangent[own] * camera.focal_length_mm + np.array(camera.principal_point_mm)
        px[own] = px_from_mm(xy, camera.size_px, camera.pixel_mm)
    return px


def _write_database(block: Block, path: Path, partners: int | None) -> None:
    """Cameras, photographs, image points and, as matches, what every two photographs have in common."""
    from aerotri.colmap_library import pycolmap

    rays, px = block.image_points, _keypoints(block)
    order = np.lexsort((rays.point, rays.image))
    bounds = np.searchsorted(rays.image[order], np.arange(len(block.images) + 1))
    with pycolmap.Database.open(path) as database:
        ids = {}
        for number, camera in enumerate(block.cameras, 1):
            made = pinhole(camera)
            if not is_held(camera):
                lens = [SIGN.get(k, 1.0) * (camera.lens[k].value if k in camera.lens else 0.0) for k in LENS_IN_MAPPING]
                params = [*made.params, *lens]
                made = pycolmap.Camera(
                    model="RADIAL", width=made.width, height=made.height, params=params, has_prior_focal_length=True
                )
            made.camera_id = number
            database.write_camera(made, use_camera_id=True)
            rig = pycolmap.Rig(rig_id=number)
            rig.add_ref_sensor(made.sensor_id)
            database.write_rig(rig, use_rig_id=True)
        for row, name in enumerate(block.images.names.tolist()):
            image = pycolmap.Image(name=name, camera_id=int(block.images.camera[row]) + 1, image_id=row + 1)
            ids[row] = database.write_image(image, use_image_id=True)
            frame = pycolmap.Frame(frame_id=row + 1, rig_id=image.camera_id)
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            database.write_keypoints(ids[row], px[order[bounds[row] : bounds[row + 1]]].astype(np.float32))
        for i, j, matches in _common_points(rays.point[order], bounds, partners):
            _write_pair(database, (i, j), matches, px[order], bounds, block)


def _common_points(
    point: np.ndarray, bounds: np.ndarray, partners: int | None
) -> Iterator[tuple[int, int, np.ndarray]]:
    """Pairs of photographs with enough points in common, and where these stand in the lists of the two.

    With partners only so many for each photograph, and the pairs that tie all of them together most strongly.
    """
    from scipy.sparse import csr_array

    # where there are no points the shape cannot be told from them
    shape = len(bounds) - 1, int(point.max(initial=0)) + 1
    seen = csr_array((np.ones(len(point), np.int32), point, bounds), shape=shape)
    both = (seen @ seen.T).tocoo()
    enough = (both.row < both.col) & (both.data >= FEWEST_POSE)
    first, second, count = both.row[enough], both.col[enough], both.data[enough]
    if partners is not None:
        kept = _strongest(first, second, count, len(bounds) - 1, partners)
        first, second = first[kept], second[kept]
    for i, j in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        own, other = point[bounds[i] : bounds[i + 1]], point[bounds[j] : bounds[j + 1]]
        _, at, there = np.intersect1d(own, other, assume_unique=True, return_indices=True)
        yield i, j, np.column_stack([at, there]).astype(np.uint32)


def _strongest(first: np.ndarray, second: np.ndarray, count: np.ndarray, images: int, partners: int) -> np.ndarray:
    """(pairs,) bool, pairs that are among the `partners` with most points of one of their photographs, or in the tree
    of most points that joins all photographs."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    ends = np.concatenate([first, second])
    pair = np.tile(np.arange(len(first)), 2)
    order = np.lexsort((pair, -np.tile(count, 2), ends))
    ranked = ends[order]
    rank = np.arange(len(order)) - np.searchsorted(ranked, ranked)
    kept = np.zeros(len(first), bool)
    kept[pair[order[rank < partners]]] = True
    tree = minimum_spanning_tree(coo_array((1.0 / count, (first, second)), shape=(images, images))).tocoo()
    kept[np.isin(first * images + second, tree.row * images + tree.col)] = True
    return kept


def _write_pair(
    database: Any, pair: tuple[int, int], matches: np.ndarray, px: np.ndarray, bounds: np.ndarray, block: Block
) -> None:
    from aerotri.colmap_library import pycolmap

    cameras = [pinhole(block.cameras[block.images.camera[k]]) for k in pair]
    own = [px[bounds[k] : bounds[k + 1]] for k in pair]
    options = _two_view_options(FEWEST_POSE, seed=1)
    options.ransac.max_num_trials = PAIR_TRIALS
    geometry = pycolmap.estimate_two_view_geometry(cameras[0], own[0], cameras[1], own[1], matches, options)
    database.write_matches(pair[0] + 1, pair[1] + 1, matches)
    database.write_two_view_geometry(pair[0] + 1, pair[1] + 1, geometry)


def _mapped(block: Block, model: Any) -> Mapped:
    centre, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    for image in model.images.values():
        if image.has_pose:
            pose, row = image.cam_from_world().matrix(), image.image_id - 1
            rotation[row] = pose[:, :3].T @ COLMAP_FROM_CAMERA
            centre[row] = -pose[:, :3].T @ pose[:, 3]
    cameras = []
    for number, camera in enumerate(block.cameras, 1):
        unknown = not is_held(camera) and number in model.cameras
        cameras.append(_with_found(camera, list(model.cameras[number].params)) if unknown else camera)
    return Mapped(centre, rotation, tuple(cameras))


def _with_found(camera: Camera, params: list[float]) -> Camera:
    """The camera with COLMAP's focal length and radial lens as start values."""
    focal, lens = replace(camera.interior["focal_length_mm"], value=params[0] * camera.pixel_mm), dict(camera.lens)
    for name, value in zip(LENS_IN_MAPPING, params[3:], strict=True):
        lens[name] = replace(lens.get(name, Prior()), value=SIGN.get(name, 1.0) * value)
    return replace(camera, interior={**camera.interior, "focal_length_mm": focal}, lens=lens)
