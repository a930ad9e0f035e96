"""The chain from a folder of photographs to a block with start values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aerotri.adjustment.track import strips_of_track
from aerotri.conventions import InputError, mm_from_px
from aerotri.coordinates import LocalFrame
from aerotri.coordinates.blocks import frame_of_block
from aerotri.coordinates.georeference import is_projected, utm_crs
from aerotri.formats import assemble, placing
from aerotri.formats.assemble_control import with_check_points, with_control
from aerotri.formats.parts import OrientationList, PointList, PositionList, Reading, no_sigma
from aerotri.formats.reprojection import reproject
from aerotri.functional_model.rotation import angles_from_rotation, exponential, rotation_from_angles
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Settings
from aerotri.observations.block import GnssSettings
from aerotri.tie_points.features import FeatureOptions, Features, features_of
from aerotri.tie_points.first_orientation import Mapped, is_held, map_incrementally
from aerotri.tie_points.georeferencing import is_line, place
from aerotri.tie_points.matching import MatchOptions, match_all, neighbours
from aerotri.tie_points.photographs import PhotographSet
from aerotri.tie_points.tracks import Tracks, join_matches, thin
from aerotri.tie_points.verification import rays_that_meet

EXIF_SIGMA_M = (5.0, 5.0, 10.0)
"""Standard deviations of a position that does not say how good it is: hand-held GNSS [C]."""
CACHE = "tie_point_cache"
SHORTEST_STRIP = 3.0
"""Photographs a strip has on average, where the track is one."""
PLAUSIBLE = 0.1
"""Part by which a principal distance may differ from that of EXIF, which is rounded, before it is not believed."""
MORE_TRACKS = 2
"""Tracks given to the first orientation over those wanted in the end: some do not stand it."""
Progress = Callable[[str, int, int], None]
"""Told what is going on, how many are done and how many there are."""


@dataclass(frozen=True, eq=False)
class Given:
    """What the user gives beside the photographs.

    Parameters
    ----------
    stated : CRS, geoid, standard deviations. positions : in place of EXIF. control, check : control points and the
        names of those that are check points. orientation : in place of a first orientation.
    mark_sigma_px : of the image points of control.
    """

    stated: assemble.Statements = field(default_factory=assemble.Statements)
    positions: PositionList | None = None
    control: PointList | None = None
    check: tuple[str, ...] = ()
    orientation: OrientationList | None = None
    mark_sigma_px: float = 0.5


@dataclass(frozen=True)
class Options:
    """How points are found; `points` a photograph are wanted in the end."""

    features: FeatureOptions = field(default_factory=FeatureOptions)
    matches: MatchOptions = field(default_factory=MatchOptions)
    points: int = 1000


@dataclass(frozen=True, eq=False)
class TiedBlock:
    """A block from photographs.

    Parameters
    ----------
    block : with start values. points : (N, 3) m, start values of its points in its CRS, NaN where not known.
    median_px : residual of the start values. pairs : of photographs that were matched, and that have matches.
    left_out : names of photographs that could not be tied. messages : what the user should know.
    """

    block: Block
    points: np.ndarray
    median_px: float
    pairs: tuple[int, int]
    left_out: tuple[str, ...]
    messages: tuple[str, ...]


def tie_photographs(
    photographs: PhotographSet, given: Given, options: Options, cache: Path, progress: Progress
) -> TiedBlock:
    """From photographs to a block.

    Parameters
    ----------
    cache : folder of features and matches, which are taken from there where they are the same.

    Raises
    ------
    InputError
    """
    crs = _crs(photographs, given)
    positions, said = _positions(photographs, given, crs)
    _refuse_bad_lists(photographs, given, crs, positions)
    features = _features(photographs, options.features, cache, progress)
    tracks, pairs = _tracks(photographs, features, _places(photographs, positions, given), options, cache, progress)
    size = np.array([photographs.cameras[c].size_px for c in photographs.camera], dtype=float)
    tracks = thin(tracks, _xy(tracks, features), size, MORE_TRACKS * options.points)
    bare = _bare_block(photographs, photographs.cameras, tracks, features)
    oriented = _oriented(bare, given, crs, positions, options.matches.seed, progress)
    tracks = tracks.chosen(rays_that_meet(oriented.block_of(bare), oriented.centre, oriented.rotation))
    tracks = thin(tracks, _xy(tracks, features), size, options.points)
    keep = np.bincount(tracks.image, minlength=len(photographs)) > 0
    block = _bare_block(photographs, oriented.cameras, tracks, features, keep)
    reading = _complete(replace(Reading(block), messages=said), given, crs, positions)
    reading = _with_start_values(reading, oriented.kept(keep))
    frame = oriented.frame
    found = reproject(*_in_frame(reading.block, frame))
    block, sigma_px = _with_sigma_of_ties(reading.block, found.residual_px, len(tracks))
    return TiedBlock(
        block=block,
        points=found.points if frame is None else frame.from_local(found.points),
        median_px=found.median_px,
        pairs=pairs,
        left_out=tuple(photographs.names[~keep].tolist()),
        messages=(
            *reading.messages,
            *oriented.messages,
            f"the standard deviation of tie points is {sigma_px:.2f} px, as they fit one another",
        ),
    )


@dataclass(frozen=True, eq=False)
class _Oriented:
    """Orientation in the local frame of the CRS (None: the block is local), with the cameras that belong to it."""

    centre: np.ndarray
    rotation: np.ndarray
    cameras: tuple[Camera, ...]
    frame: LocalFrame | None
    messages: tuple[str, ...]

    def block_of(self, block: Block) -> Block:
        return replace(block, cameras=self.cameras)

    def kept(self, keep: np.ndarray) -> _Oriented:
        return replace(self, centre=self.centre[keep], rotation=self.rotation[keep])


def _refuse_bad_lists(photographs: PhotographSet, given: Given, crs: str, positions: PositionList | None) -> None:
    """What is wrong with the lists is said before anything is computed.

    Raises
    ------
    InputError
    """
    nothing = np.zeros(0, np.int64)
    bare = _bare_block(photographs, photographs.cameras, Tracks(np.zeros(1, np.int64), nothing, nothing), [])
    reading = _complete(Reading(bare), given, crs, positions)
    if given.orientation is not None and not _is_observed(given.stated):
        assemble.with_orientations(reading, given.orientation, given.stated)


def _features(photographs: PhotographSet, options: FeatureOptions, cache: Path, progress: Progress) -> list[Features]:
    found = []
    for number, path in enumerate(photographs.paths, 1):
        found.append(features_of(path, options, cache / "features"))
        progress("features of photographs", number, len(photographs))
    return found


def _crs(photographs: PhotographSet, given: Given) -> str:
    """As stated, else of the control, else of the positions; UTM where these are geographic, 'local' without any."""
    if given.stated.crs:
        return placing.known_crs(given.stated.crs)
    lists = [part for part in (given.control, given.positions) if part is not None]
    for part in lists:
        if part.crs:
            return part.crs if is_projected(part.crs) else utm_crs(part.xyz[:, 0], part.xyz[:, 1])
    known = np.isfinite(photographs.lon_lat_height).all(axis=1)
    if lists or given.orientation is not None or not known.any():
        return "local"
    return utm_crs(*photographs.lon_lat_height[known, :2].T)


def _positions(photographs: PhotographSet, given: Given, crs: str) -> tuple[PositionList | None, tuple[str, ...]]:
    """Positions in the CRS of the block, from a list or from EXIF."""
    if given.positions is not None:
        return given.positions, ()
    known = np.flatnonzero(np.isfinite(photographs.lon_lat_height).all(axis=1))
    if not len(known):
        return None, ()
    if crs == "local":
        return None, ("positions of EXIF were left out: the block has no coordinate system; state it with --crs",)
    xyz = photographs.lon_lat_height[known]
    flat = placing.to_crs(xyz, "EPSG:4326", placing.horizontal_part(crs), None)
    said = []
    if "+" in crs and photographs.ellipsoidal[known].all():
        flat = placing.from_ellipsoidal_heights(flat, crs, given.stated.geoid)
    elif not photographs.ellipsoidal[known].any():
        said.append("heights of EXIF count from sea level; they are taken as those of the block's CRS as they are")
    stated = given.stated.positions_sigma_m
    sigma = photographs.sigma_m[known]
    if stated is None and np.isnan(sigma).any():
        said.append("positions of EXIF do not say how good they are: σ {:g}, {:g}, {:g} m taken".format(*EXIF_SIGMA_M))
    sigma = np.where(np.isnan(sigma), np.array(stated or EXIF_SIGMA_M), sigma)
    path = photographs.paths[0].parent
    return PositionList(path, photographs.names[known], flat, sigma, no_sigma(len(known))), tuple(said)


def _places(photographs: PhotographSet, positions: PositionList | None, given: Given) -> np.ndarray:
    """(n, 3) where photographs are, for the choice of neighbours alone."""
    from aerotri.formats.names_match import match_photographs

    found = no_sigma(len(photographs))
    for names, xyz in (
        *(((positions.images, positions.xyz),) if positions is not None else ()),
        *(((given.orientation.images, given.orientation.centre),) if given.orientation is not None else ()),
    ):
        index = match_photographs(names, photographs.names)[0]
        found[index[index >= 0]] = xyz[index >= 0]
    return found


def _tracks(photographs, features, places, options: Options, cache: Path, progress: Progress):
    pairs = neighbours(places, options.matches.neighbours)
    cameras = [photographs.cameras[c] for c in photographs.camera]
    matched = match_all(
        features, cameras, photographs.names, pairs, options.matches, cache / "matches",
        lambda done, count: progress("matching pairs", done, count),
    )  # fmt: skip
    if not matched:
        raise InputError(
            "no two photographs have matches", "check that they overlap; more features or a larger --ratio may help"
        )
    tracks = join_matches(matched, np.array([len(f) for f in features]))
    return tracks, (len(pairs), len(matched))


def _xy(tracks: Tracks, features: list[Features]) -> np.ndarray:
    """(m, 2) px of the rays."""
    first = np.concatenate([[0], np.cumsum([len(f) for f in features])])
    return np.concatenate([f.xy for f in features])[first[tracks.image] + tracks.feature].astype(float)


def _bare_block(
    photographs: PhotographSet,
    cameras: tuple[Camera, ...],
    tracks: Tracks,
    features: list[Features],
    keep: np.ndarray | None = None,
) -> Block:
    """Cameras, photographs and tie points; `keep` (n,) bool, the photographs of the block."""
    keep = np.ones(len(photographs), bool) if keep is None else keep
    xy_px = _xy(tracks, features) if len(tracks) else np.zeros((0, 2))
    of_camera = photographs.camera[tracks.image]
    xy = np.empty_like(xy_px)
    for number, camera in enumerate(cameras):
        own = of_camera == number
        xy[own] = mm_from_px(xy_px[own], camera.size_px, camera.pixel_mm)
    pixel = np.array([camera.pixel_mm for camera in cameras])
    sigma = np.array([features[i].sigma_px for i in tracks.image.tolist()]) * pixel[of_camera]
    index = np.cumsum(keep) - 1
    count = int(keep.sum())
    width = len(str(len(tracks)))
    return Block(
        name=photographs.paths[0].resolve().parent.name,
        cameras=cameras,
        images=Images(photographs.names[keep], photographs.camera[keep], np.full(count, ""), no_sigma(count),
                      no_sigma(count)),
        points=np.array([f"tp{number:0{width}d}" for number in range(len(tracks))], dtype=str),
        image_points=ImagePoints(index[tracks.image], tracks.of_ray, xy, np.repeat(sigma[:, None], 2, axis=1)),
        settings=_settings(cameras, 1e3 * float(np.median(sigma)) if len(sigma) else 1.0),
    )  # fmt: skip


def _settings(cameras: tuple[Camera, ...], sigma_um: float) -> Settings:
    """Unknown lenses are unknowns; tie points of machines need a robust adjustment."""
    unknown = tuple(name for name in ("k1", "k2", "p1", "p2", "k3") if any(name in c.lens for c in cameras))
    free = any(not is_held(camera) for camera in cameras) and unknown
    families = (("lens", unknown),) if free else ()
    return Settings(
        adjustment=AdjustmentSettings(additional_parameters=families, robust="huber"),
        gnss=GnssSettings(shift="off"),
        image_sigma_um=sigma_um,
    )


def _complete(reading: Reading, given: Given, crs: str, positions: PositionList | None) -> Reading:
    """The block with its CRS, positions, and what is marked of the control."""
    reading = assemble.with_crs(reading, "" if crs == "local" else crs)
    if given.orientation is not None and _is_observed(given.stated):
        reading = assemble.with_orientations(reading, given.orientation, given.stated)
    elif positions is not None:
        reading = assemble.with_positions(reading, positions, given.stated)
    control = given.control
    if control is not None and control.rays is not None and len(control.rays.image):
        reading = assemble.with_rays(reading, control.rays, given.mark_sigma_px)
        reading = with_control(reading, control, given.stated)
        reading = with_check_points(reading, given.check)
    elif control is not None:
        reading = replace(
            reading, messages=(*reading.messages, f"{control.path.name}: its points are not marked yet, so not in use")
        )
    return _with_datum(reading)


def _with_sigma_of_ties(block: Block, residual_px: np.ndarray, ties: int) -> tuple[Block, float]:
    """The block with the standard deviation of a coordinate that the misfit of its tie points shows.

    Of a point with k rays, residuals have 2k − 3 redundant coordinates of 2k; half of two-dimensional errors are less
    than √(2 ln 2) σ [L]. Ratios between the rays stay.

    Parameters
    ----------
    residual_px : (m,). ties : the first so many points are tie points.
    """
    rays = block.image_points
    own = (rays.point < ties) & np.isfinite(residual_px)
    length = np.bincount(rays.point, minlength=len(block.points))[rays.point[own]]
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image]]
    relative = residual_px[own] * pixel[own] / rays.sigma[own].mean(axis=1) / np.sqrt(1.0 - 3.0 / (2.0 * length))
    factor = float(np.median(relative)) / np.sqrt(2.0 * np.log(2.0))
    if not factor > 0.0:
        factor = 1.0
    sigma = np.where((rays.point < ties)[:, None], factor * rays.sigma, rays.sigma)
    common = float(np.median(sigma[own])) if own.any() else float(np.median(sigma))
    settings = replace(block.settings, image_sigma_um=1e3 * common)
    found = replace(block, image_points=replace(rays, sigma=sigma), settings=settings)
    return found, common / block.cameras[0].pixel_mm


def _is_held_by_control(block: Block) -> bool:
    return int(np.isfinite(block.control.xyz[~block.control.is_check]).all(axis=1).sum()) >= 3


def _is_observed(stated: assemble.Statements) -> bool:
    """Whether orientations are observations beside start values."""
    return stated.orientation_sigma_m is not None or stated.orientation_sigma_deg is not None


def _with_datum(reading: Reading) -> Reading:
    """Positions may be shifted as a whole where control holds the block; without either the datum is minimal."""
    block, settings = reading.block, reading.block.settings
    held = _is_held_by_control(block)
    if block.gnss_ins is not None and held:
        settings = replace(settings, gnss=replace(settings.gnss, shift="block"))
    if block.gnss_ins is None and not held:
        settings = replace(settings, adjustment=replace(settings.adjustment, datum="minimal"))
    return replace(reading, block=replace(block, settings=settings))


def _oriented(
    bare: Block, given: Given, crs: str, positions: PositionList | None, seed: int, progress: Progress
) -> _Oriented:
    reading = _complete(Reading(bare), given, crs, positions)
    if given.orientation is not None:
        return _given_orientation(reading, given.orientation, given.stated)
    count = len(bare.images)

    def report(done: int) -> None:
        progress("first orientation", min(done, count), count)

    mapped, said = map_incrementally(bare, seed, report=report), ()
    if not _is_held_by_control(reading.block):
        cameras, said = _plausible(bare.cameras, mapped.cameras)
        mapped = map_incrementally(replace(bare, cameras=cameras), seed, report=report) if said else mapped
    frame = None if crs == "local" else frame_of_block(reading.block, given.stated.geoid)
    oriented = _placed(reading.block, mapped, frame, seed)
    return replace(oriented, messages=(*oriented.messages, *said))


def _plausible(stated: tuple[Camera, ...], found: tuple[Camera, ...]) -> tuple[tuple[Camera, ...], tuple[str, ...]]:
    """The cameras with the interior of those held whose principal distance came out wrong, and what to say of it.

    Vertical photographs from one height do not determine it without control; small changes between them, such as
    leaves in the wind, then take it far off.
    """
    cameras, said = [], []
    for camera, other in zip(stated, found, strict=True):
        ratio = other.focal_length_mm / camera.focal_length_mm
        if abs(ratio - 1.0) > PLAUSIBLE:
            interior = {name: replace(prior, fixed=True) for name, prior in camera.interior.items()}
            said.append(
                f"the photographs make the principal distance of {camera.name} {other.focal_length_mm:.3g} mm, "
                f"{100 * (ratio - 1):+.0f} % off what is stated: it is held at {camera.focal_length_mm:.4g} mm, "
                "and heights above the ground hang on that; control points determine it"
            )
            camera = replace(camera, interior=interior)
        cameras.append(camera)
    return tuple(cameras), tuple(said)


def _given_orientation(reading: Reading, given: OrientationList, stated: assemble.Statements) -> _Oriented:
    start_only = replace(stated, orientation_sigma_m=None, orientation_sigma_deg=None)
    block = assemble.with_orientations(reading, given, start_only).block
    frame = None if block.crs == "local" else frame_of_block(block, stated.geoid)
    _, centre, rotation = _in_frame(block, frame)
    return _Oriented(centre, rotation, block.cameras, frame, ())


def _in_frame(block: Block, frame: LocalFrame | None) -> tuple[Block, np.ndarray, np.ndarray]:
    """The block, and its start values in the frame."""
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    if frame is None:
        return block, block.images.centre, rotation
    return block, frame.to_local(block.images.centre), frame.axes_at(block.images.centre) @ rotation


def _placed(block: Block, mapped: Mapped, frame: LocalFrame | None, seed: int) -> _Oriented:
    """The first orientation brought onto control points, where three of them are marked, else onto positions."""
    found = reproject(replace(block, cameras=mapped.cameras), mapped.centre, mapped.rotation)
    looking = -np.nanmean(mapped.rotation[:, :, 2], axis=0)
    control = block.control
    usable = ~control.is_check & np.isfinite(control.xyz).all(axis=1)
    usable &= np.isfinite(found.points[control.point]).all(axis=1)
    target = control.xyz[usable]
    if len(target) >= 3 and not is_line(target):
        source, sigma = found.points[control.point[usable]], control.sigma[usable].max(axis=1)
        what = "control points"
    else:
        source, target, sigma = _positions_of(block, mapped)
        what, usable = "positions", None
    if len(source) < 2:
        return _unplaced(block, mapped, looking)
    local = target if frame is None else frame.to_local(target)
    placement = place(source, local, sigma, None if what == "control points" else looking, seed)
    median = float(np.median(placement.misfit))
    said = f"the first orientation fits {len(source)} {what} to {median:.3g} m (median)"
    rotation = placement.rotation @ mapped.rotation
    return _Oriented(placement(mapped.centre), rotation, mapped.cameras, frame, (said,))


def _positions_of(block: Block, mapped: Mapped) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    observed = block.gnss_ins
    if observed is None:
        return no_sigma(0), no_sigma(0), np.zeros(0)
    there = np.isfinite(mapped.centre[observed.image, 0]) & np.isfinite(observed.xyz).all(axis=1)
    rows = observed.image[there]
    return mapped.centre[rows], observed.xyz[there], observed.sigma[there].max(axis=1)


def _unplaced(block: Block, mapped: Mapped, looking: np.ndarray) -> _Oriented:
    """Nothing says where the block is: its own frame, turned so that photographs look down on average."""
    if len(block.control):
        raise InputError(
            "fewer than three control points are marked, and photographs have no positions", "mark more of them"
        )
    turn = _rotation_between(looking, np.array([0.0, 0.0, -1.0]))
    said = "nothing says where the photographs were taken: scale, place and north of the block are arbitrary"
    return _Oriented(mapped.centre @ turn.T, turn @ mapped.rotation, mapped.cameras, None, (said,))


def _rotation_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The shortest rotation that brings a direction onto another (Rodrigues)."""
    a, b = one / np.linalg.norm(one), other / np.linalg.norm(other)
    axis = np.cross(a, b)
    size = float(np.linalg.norm(axis))
    return exponential(axis / max(size, 1e-300) * np.arctan2(size, a @ b))


def _with_start_values(reading: Reading, oriented: _Oriented) -> Reading:
    """Start values in the CRS, the cameras found, and strips where the photographs make a track."""
    block, frame = reading.block, oriented.frame
    centre, rotation = oriented.centre, oriented.rotation
    if frame is not None:
        centre = frame.from_local(centre)
        rotation = np.swapaxes(frame.axes_at(centre), 1, 2) @ rotation
    angles = angles_from_rotation(rotation, block.rotation)
    images = replace(block.images, centre=centre, angles=angles, strip=_strips(centre))
    return replace(reading, block=replace(block, images=images, cameras=oriented.cameras))


def _strips(centre: np.ndarray) -> np.ndarray:
    if not np.isfinite(centre).all():
        return np.full(len(centre), "")
    strip = strips_of_track(centre, np.full(len(centre), ""))
    if len(centre) < SHORTEST_STRIP * (strip.max() + 1):
        return np.full(len(centre), "")
    return np.array([str(number + 1) for number in strip.tolist()], dtype=str)
