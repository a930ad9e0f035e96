"""The chain from a folder of photographs to a block with start values."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.conventions import InputError, mm_from_px, real_path
from aerotri.coordinates.blocks import transform_block
from aerotri.diagnosis.control_points import doubts_with_orientation
from aerotri.diagnosis.gnss_heights import doubts_of_gnss_heights
from aerotri.diagnosis.suspicions import suspicions_of_lists
from aerotri.execution.work import Workplace
from aerotri.formats.assembly import assemble
from aerotri.formats.assembly.parts import PositionList, Reading, no_sigma
from aerotri.formats.assembly.reprojection import reproject
from aerotri.memory import fitting
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Settings
from aerotri.observations.settings import GnssSettings
from aerotri.tie_points.features import FeatureOptions, Features, features_of
from aerotri.tie_points.given import (
    Given,
    approximate_places,
    complete,
    crs_of,
    is_observed,
    positions_in,
    with_unmarked_control,
)
from aerotri.tie_points.matching import MatchOptions, match_all, neighbours
from aerotri.tie_points.misfit import adjusted_offsets, with_sigma_of_ties
from aerotri.tie_points.orientation import Oriented, Progress, in_frame, orient, with_start_values
from aerotri.tie_points.photographs import LENS, PhotographSet
from aerotri.tie_points.placed import CONTROL, Placed
from aerotri.tie_points.settings import DEFAULTS
from aerotri.tie_points.tasks import bytes_of_search, features_elsewhere, matches_elsewhere
from aerotri.tie_points.tracks import Measured, Tracks, join_matches, thin
from aerotri.tie_points.transfer import View, measured_by_windows
from aerotri.tie_points.verification import rays_that_meet

CACHE = "tie_point_cache"
FEATURES, PAIRS, WINDOWS = "features of photographs", "matching pairs", "measuring by windows"
"""Stages, as a user reads them."""
ITERATIONS = 300
"""Iterations that the written settings allow, ten times the default; chosen [C]: start values of a first orientation
are bent, and Huber's weights settle slowly."""
MORE_TRACKS = 2
"""Tracks compared with the first orientation over those wanted in the end: some do not stand it."""
ORIENTING = 500
"""Points of a photograph that the first orientation is found from [C]: with four times as many it takes more than twice
as long, and positions fit it as well."""


@dataclass(frozen=True)
class Options:
    """How points are found; `points` a photograph are wanted in the end."""

    features: FeatureOptions = field(default_factory=FeatureOptions)
    matches: MatchOptions = field(default_factory=MatchOptions)
    points: int = DEFAULTS.points


@dataclass(frozen=True, eq=False)
class TiedBlock:
    """A block from photographs.

    Parameters
    ----------
    block : with start values. points : (N, 3) m, start values of its points in its CRS, NaN where not known.
    median_px : residual of the start values. pairs : of photographs that were matched, and that have matches.
    left_out : names of photographs that could not be tied. messages : what the user should know.
    placed : how well the first orientation fits control points or positions; None where neither placed it.
    doubts : what looks wrong in the control points and the place, in sentences; they are among the messages.
    """

    block: Block
    points: np.ndarray
    median_px: float
    pairs: tuple[int, int]
    left_out: tuple[str, ...]
    messages: tuple[str, ...]
    placed: Placed | None = None
    doubts: tuple[str, ...] = ()


def tie_photographs(
    photographs: PhotographSet,
    given: Given,
    options: Options,
    cache: Path,
    progress: Progress,
    at: Workplace | None = None,
) -> TiedBlock:
    """From photographs to a block.

    Matching, drawing and mapping run through the photographs in an order of their features, so that what comes out
    does not hang on the names of files; the block has the photographs by name again.

    Parameters
    ----------
    cache : folder of features and matches, which are taken from there where they are the same.
    at : other processes that find features and matches; the threads of this one where None.

    Raises
    ------
    InputError
    TasksFailedError
        When other processes could not find features or matches.
    """
    crs = crs_of(photographs, given)
    positions, said = positions_in(photographs, given, crs)
    _refuse_bad_lists(photographs, given, crs, positions)
    features = _features(photographs, options.features, cache, progress, at)
    order = _order_of(features)
    tracks, measured, oriented, pairs = _oriented_tracks(
        photographs.in_order(order), [features[k] for k in order], given, crs, positions, options, cache, progress, at
    )
    tracks, oriented = tracks.with_images(order), oriented.in_order(np.argsort(order), photographs.cameras)
    keep = np.bincount(tracks.image, minlength=len(photographs)) > 0
    block = _bare_block(photographs, oriented.cameras, tracks, measured.of(tracks), keep)
    reading = complete(replace(Reading(block), messages=(*photographs.messages, *said)), given, crs, positions)
    reading = with_start_values(reading, oriented.kept(keep))
    frame = oriented.frame
    placed_block = in_frame(reading.block, frame)
    found = reproject(*placed_block)
    about_control = (*doubts_with_orientation(*placed_block), *suspicions_of_lists(reading.block))
    if oriented.placed is not None and oriented.placed.by == CONTROL:
        about_control += doubts_of_gnss_heights(reading.block)
    local = reading.block if frame is None else transform_block(reading.block, frame)
    offset_px, unsettled = adjusted_offsets(local, found.points, found.offset_px)
    block, sigma_px = with_sigma_of_ties(reading.block, offset_px, len(tracks))
    points = found.points if frame is None else frame.from_local(found.points)
    reading = with_unmarked_control(replace(reading, block=block, points=points), given)
    return TiedBlock(
        block=reading.block,
        points=points if reading.points is None else reading.points,
        median_px=found.median_px,
        pairs=pairs,
        left_out=tuple(photographs.names[~keep].tolist()),
        messages=(
            *reading.messages,
            *oriented.messages,
            *about_control,
            f"the standard deviation of tie points is {sigma_px:.2f} px, as they fit one another",
            *((unsettled,) if unsettled else ()),
        ),
        placed=oriented.placed,
        doubts=(*(() if oriented.placed is None else oriented.placed.doubts()), *about_control),
    )


def _order_of(features: list[Features]) -> np.ndarray:
    """(n,) photographs in an order that hangs on what they show alone; files that show the same stay as they are."""
    return np.array(sorted(range(len(features)), key=lambda k: features[k].digest), dtype=np.int64)


def _oriented_tracks(
    photographs: PhotographSet, features: list[Features], given: Given, crs: str, positions: PositionList | None,
    options: Options, cache: Path, progress: Progress, at: Workplace | None,
) -> tuple[Tracks, Measured, Oriented, tuple[int, int]]:  # fmt: skip
    """Tracks whose rays meet, their places, the orientation, and how many pairs were matched and are tied."""
    places = approximate_places(photographs, positions, given)
    tracks, pairs = _tracks(photographs, features, places, options, cache, progress, at)
    size = np.array([photographs.cameras[c].size_px for c in photographs.camera], dtype=float)
    tracks, measured = _measured(tracks, features)
    tracks = thin(tracks, measured.of(tracks)[0], size, MORE_TRACKS * options.points)
    bare = _bare_block(photographs, photographs.cameras, tracks, measured.of(tracks))
    few = _with_few_points(bare, tracks, measured.of(tracks)[0], size)
    oriented = orient(few, given, crs, positions, options.matches.seed, progress)
    meeting = rays_that_meet(oriented.block_of(bare), *oriented.relative)
    tracks, measured = _by_windows(photographs, tracks.chosen(meeting), measured, oriented, progress)
    return thin(tracks, measured.of(tracks)[0], size, options.points), measured, oriented, pairs


def _by_windows(
    photographs: PhotographSet, tracks: Tracks, measured: Measured, oriented: Oriented, progress: Progress
) -> tuple[Tracks, Measured]:
    """Tracks measured by windows, of which the rays meet."""
    block = _bare_block(photographs, oriented.cameras, tracks, measured.of(tracks))
    points = reproject(block, *oriented.relative).points
    view = View(*oriented.relative, oriented.cameras, photographs.camera, photographs.paths)
    tracks, measured = measured_by_windows(
        view, tracks, measured, points, lambda done: progress(WINDOWS, done, len(photographs))
    )
    block = _bare_block(photographs, oriented.cameras, tracks, measured.of(tracks))
    return tracks.chosen(rays_that_meet(block, *oriented.relative)), measured


def _measured(tracks: Tracks, features: list[Features]) -> tuple[Tracks, Measured]:
    """The tracks and the positions of their features, ray by ray."""
    sigma = np.array([one.sigma_px for one in features])
    found = Measured(_xy(tracks, features), sigma[tracks.image])
    return Tracks(tracks.start, tracks.image, np.arange(len(tracks.image))), found


def _with_few_points(bare: Block, tracks: Tracks, xy: np.ndarray, size: np.ndarray) -> Block:
    """The block with as many of its points as a first orientation needs, evenly spread, under the names they have."""
    few = thin(Tracks(tracks.start, tracks.image, np.arange(len(xy))), xy, size, ORIENTING).feature
    rays = bare.image_points
    return replace(bare, image_points=ImagePoints(rays.image[few], rays.point[few], rays.xy[few], rays.sigma[few]))


def _refuse_bad_lists(photographs: PhotographSet, given: Given, crs: str, positions: PositionList | None) -> None:
    """What is wrong with the lists is said before anything is computed.

    Raises
    ------
    InputError
    """
    nothing = np.zeros(0, np.int64)
    bare = _bare_block(
        photographs,
        photographs.cameras,
        Tracks(np.zeros(1, np.int64), nothing, nothing),
        (np.zeros((0, 2)), np.zeros(0)),
    )
    reading = with_unmarked_control(complete(Reading(bare), given, crs, positions), given)
    if given.orientation is not None and not is_observed(given.stated):
        assemble.with_orientations(reading, given.orientation, given.stated)


def _features(
    photographs: PhotographSet, options: FeatureOptions, cache: Path, progress: Progress, at: Workplace | None
) -> list[Features]:
    if at is not None:
        features_elsewhere(photographs, options, cache / "features", at, _counted(progress, FEATURES, len(photographs)))
    found: list[Features] = []
    each = max(bytes_of_search(camera, options) for camera in photographs.cameras)
    threads = int(max(1.0, min(thread_count(), fitting(each))))

    def of(path: Path) -> Features:
        return features_of(path, options, cache / "features")

    with ThreadPoolExecutor(threads) as pool:
        for features in pool.map(of, photographs.paths):
            found.append(features)
            if at is None:
                progress(FEATURES, len(found), len(photographs))
    return found


def _tracks(
    photographs: PhotographSet,
    features: list[Features],
    places: np.ndarray,
    options: Options,
    cache: Path,
    progress: Progress,
    at: Workplace | None,
) -> tuple[Tracks, tuple[int, int]]:
    pairs = neighbours(places, options.matches.neighbours)
    if at is not None:
        matches_elsewhere(
            photographs, pairs, (options.features, options.matches), (cache / "features", cache / "matches"), at,
            _counted(progress, PAIRS, len(pairs)),
        )  # fmt: skip
    cameras = [photographs.cameras[c] for c in photographs.camera]
    matched = match_all(
        features, cameras, photographs.names, pairs, options.matches, cache / "matches",
        lambda done, count: progress(PAIRS, done, count) if at is None else None,
    )  # fmt: skip
    if not matched:
        raise InputError(
            "no two photographs have matches",
            "check that they overlap; more --features or a larger --feature-size may help",
        )
    tracks = join_matches(matched, np.array([len(f) for f in features]))
    return tracks, (len(pairs), len(matched))


def _counted(progress: Progress, stage: str, count: int) -> Callable[[float], None]:
    return lambda share: progress(stage, round(share * count), count)


def _xy(tracks: Tracks, features: list[Features]) -> np.ndarray:
    """(m, 2) px of the rays."""
    first = np.concatenate([[0], np.cumsum([len(f) for f in features])])
    return np.concatenate([f.xy for f in features])[first[tracks.image] + tracks.feature].astype(float)


def _bare_block(
    photographs: PhotographSet,
    cameras: tuple[Camera, ...],
    tracks: Tracks,
    measured: tuple[np.ndarray, np.ndarray],
    keep: np.ndarray | None = None,
) -> Block:
    """Cameras, photographs and tie points; `keep` (n,) bool, the photographs of the block."""
    keep = np.ones(len(photographs), bool) if keep is None else keep
    xy_px, sigma_px = measured
    of_camera = photographs.camera[tracks.image]
    xy = np.empty_like(xy_px)
    for number, camera in enumerate(cameras):
        own = of_camera == number
        xy[own] = mm_from_px(xy_px[own], camera.size_px, camera.pixel_mm)
    pixel = np.array([camera.pixel_mm for camera in cameras])
    sigma = sigma_px * pixel[of_camera]
    index = np.cumsum(keep) - 1
    count = int(keep.sum())
    width = len(str(len(tracks)))
    return Block(
        name=real_path(photographs.paths[0]).parent.name,
        cameras=cameras,
        images=Images(photographs.names[keep], photographs.camera[keep], np.full(count, ""), no_sigma(count),
                      no_sigma(count), photographs.time_column(keep)),
        points=np.array([f"tp{number:0{width}d}" for number in range(len(tracks))], dtype=str),
        image_points=ImagePoints(index[tracks.image], tracks.of_ray, xy, np.repeat(sigma[:, None], 2, axis=1)),
        settings=_settings(cameras, 1e3 * float(np.median(sigma)) if len(sigma) else 1.0),
    )  # fmt: skip


def _settings(cameras: tuple[Camera, ...], sigma_um: float) -> Settings:
    """Unknown lenses are unknowns; tie points of machines need a robust adjustment, whose last digits take long."""
    items = tuple(name for name in LENS if any(name in c.lens and c.lens[name].kind == "free" for c in cameras))
    return Settings(
        adjustment=AdjustmentSettings(
            additional_parameters=(("lens", items),) if items else (), robust="huber", max_iterations=ITERATIONS
        ),
        gnss=GnssSettings(shift="off"),
        image_sigma_um=sigma_um,
    )
