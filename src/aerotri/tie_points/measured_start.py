"""Start values of a measured block, whatever its geometry: its image points alone, then GNSS and control.

The photographs are oriented to one another by incremental mapping (`first_orientation`), with the stated principal
distances held and, where these do not fit, free. Every part of the block is brought onto the positions and control
points that it contains by a robust similarity (`georeferencing`). What the rays then miss their points by says whether
the start can be right.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.prepare import with_edits
from aerotri.adjustment.start_values import directions_of, intersect_into
from aerotri.conventions import InputError, counted, px_from_mm
from aerotri.formats.assembly.reprojection import ideal_tangents
from aerotri.functional_model.rotation import exponential
from aerotri.observations import Block, Camera, ImagePoints, Prior
from aerotri.tie_points.first_orientation import LENS_IN_MAPPING, SMALLEST_PART, Mapped, map_parts
from aerotri.tie_points.georeferencing import is_line, place
from aerotri.tie_points.tracks import Tracks, thin

SEED = 1
PARTNERS = 12
"""Photographs that each is matched with [C]; the pairs that hold the block together come on top."""
POINTS = 500
"""Image points of a photograph that are used, evenly spread."""
WELL_KNOWN = 0.05
"""σ over value of a principal distance above which it is as good as unknown."""
FITS, BELONGS = 4.0, 20.0
"""Miss of a ray, in tolerances, with which it fits; median miss of a photograph beyond which it is left out."""
MOST = 0.9
"""Share of photographs, and of rays that fit, with which no other assumption on the cameras is tried."""
FEWEST_FITTING = 0.5
"""Share of rays that fit below which the start is refused."""
SURE = 3.0
"""Width of a set of positions, in their σ, from which it tells the roll of a part."""
FREE_DISTANCE_M = 100.0
"""Median distance of the points where nothing tells the scale."""
LOOKS_UP = 0.3
"""Vertical component of the mean direction of view from which photographs look up."""


@dataclass(frozen=True, eq=False)
class MeasuredStart:
    """Start values in the frame of the block.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3) camera → object; NaN for photographs that could not be oriented.
    cameras : those of the block, with the principal distances and lenses found where they are free.
    fitting : rays that fit, of those that count.
    messages : what was done, in sentences.
    """

    centre: np.ndarray
    rotation: np.ndarray
    cameras: tuple[Camera, ...]
    fitting: tuple[int, int]
    messages: tuple[str, ...]

    @property
    def oriented(self) -> np.ndarray:
        """(n,) bool."""
        return np.isfinite(self.centre[:, 0])


def start_from_points(block: Block, seed: int = SEED) -> MeasuredStart:
    """Start values from image points, positions and control points; orientations that are given are not used.

    Parameters
    ----------
    block : in a frame in metres with Z up.

    Raises
    ------
    InputError
        When the photographs cannot be oriented to one another, or the image points do not fit.
    """
    bare = _bare(block)
    tied = np.bincount(bare.image_points.image, minlength=len(block.images)) > 0
    best, refused = None, None
    for cameras in _assumptions(bare.cameras):
        try:
            found = _placed(block, replace(bare, cameras=cameras), seed)
        except InputError as error:
            refused = refused or error
            continue
        if best is None or found.fitting[0] > best.fitting[0]:
            best = found
        if found.oriented.sum() >= MOST * tied.sum() and found.fitting[0] >= MOST * found.fitting[1]:
            break
    if best is None:
        raise refused or InputError("there are no cameras", "give one in block.toml")
    if best.fitting[0] <= FEWEST_FITTING * best.fitting[1]:
        share = 100.0 * best.fitting[0] / max(best.fitting[1], 1)
        raise InputError(
            f"of the tie points, only {share:.0f} % of the rays fit the orientation that they give",
            "check the principal distance, the size of a pixel, the axes of the image points and the names of points",
        )
    return best


def _bare(block: Block) -> Block:
    """Cameras and image points freed of the lens that is stated; without rays that are switched off or doubled."""
    block, off = with_edits(block)
    rays, tangent = block.image_points, ideal_tangents(block)
    _, first = np.unique(rays.image * len(block.points) + rays.point, return_index=True)
    once = np.zeros(len(rays), bool)
    once[first] = True
    focal = np.array([camera.focal_length_mm for camera in block.cameras])
    bar = np.array([camera.principal_point_mm for camera in block.cameras])
    of_camera = block.images.camera[rays.image]
    xy = tangent * focal[of_camera, None] + bar[of_camera]
    own = np.flatnonzero(once & ~off & np.isfinite(xy).all(axis=1))
    points = ImagePoints(rays.image[own], rays.point[own], xy[own], rays.sigma[own])
    cameras = tuple(replace(camera, brown={}, lens={}, parameters={}, rolling_shutter=None) for camera in block.cameras)
    return replace(block, image_points=points, cameras=cameras)


def _assumptions(cameras: tuple[Camera, ...]) -> Iterator[tuple[Camera, ...]]:
    """The cameras with their principal distances held, then, where these are not well known, free."""
    lens = {name: Prior() for name in LENS_IN_MAPPING}
    for free in (False, True):
        made = []
        for camera in cameras:
            stated = camera.interior["focal_length_mm"]
            unknown = free and not _is_well_known(stated)
            prior = Prior(stated.value) if unknown else Prior(stated.value, fixed=True)
            made.append(replace(camera, lens=lens, interior={**camera.interior, "focal_length_mm": prior}))
        yield tuple(made)
        if all(_is_well_known(camera.interior["focal_length_mm"]) for camera in cameras):
            return


def _is_well_known(prior: Prior) -> bool:
    return prior.fixed or (prior.sigma is not None and prior.sigma < WELL_KNOWN * prior.value)


def _thinned(bare: Block) -> Block:
    """The block with no more points than a first orientation needs, evenly spread."""
    rays = bare.image_points
    order = np.lexsort((rays.image, rays.point))
    name, start = np.unique(rays.point[order], return_index=True)
    size = np.array([bare.cameras[c].size_px for c in bare.images.camera], dtype=float)
    tracks = Tracks(np.append(start, len(order)).astype(np.int64), rays.image[order], order)
    px = np.empty_like(rays.xy)
    for number, camera in enumerate(bare.cameras):
        own = bare.images.camera[rays.image] == number
        px[own] = px_from_mm(rays.xy[own], camera.size_px, camera.pixel_mm)
    kept = thin(tracks, px[order], size, POINTS).feature if len(name) else order
    chosen = np.sort(kept)
    points = ImagePoints(rays.image[chosen], rays.point[chosen], rays.xy[chosen], rays.sigma[chosen])
    return replace(bare, image_points=points)


def _placed(block: Block, bare: Block, seed: int) -> MeasuredStart:
    """The parts that the image points give, each brought to where its positions and control points are."""
    parts = map_parts(_thinned(bare), seed, PARTNERS)
    count = len(block.images)
    cameras = _with_found_cameras(bare.cameras, parts)
    found = replace(bare, cameras=cameras)
    centre, rotation, said = _in_their_places(block, found, parts, seed)
    centre, rotation, fitting = _that_belong(found, centre, rotation)
    oriented, share = int(np.isfinite(centre[:, 0]).sum()), 100.0 * fitting[0] / max(fitting[1], 1)
    said += _changed_distances(block.cameras, cameras)
    message = (
        f"start values from the tie points alone: {oriented} of {counted(count, 'photograph')}, {share:.0f} % of their "
        f"rays fit; {'; '.join(said)}"
    )
    return MeasuredStart(centre, rotation, _as_stated(block.cameras, cameras), fitting, (message,))


def _in_their_places(
    block: Block, found: Block, parts: tuple[Mapped, ...], seed: int
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Centres (n, 3), rotations (n, 3, 3) and what was done; a part is left out that nothing places beside others.

    Where nothing places any part, the largest stays in a frame of its own.
    """
    count, said = len(block.images), []
    centre, rotation = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    for part in parts:
        new = np.isfinite(part.centre[:, 0]) & np.isnan(centre[:, 0])
        placed = _in_place(block, part, _points_of(found, part), first=not said, seed=seed)
        if placed is not None and (not said or new.sum() >= SMALLEST_PART):
            centre[new], rotation[new] = placed[0][new], placed[1][new]
            said.append(f"{counted(int(new.sum()), 'photograph')} {placed[2]}")
    if not said:
        centre, rotation, words = _anywhere(parts[0], _points_of(found, parts[0]))
        said.append(f"{counted(int(np.isfinite(centre[:, 0]).sum()), 'photograph')} {words}")
    return centre, rotation, said


def _points_of(found: Block, part: Mapped) -> np.ndarray:
    """(N, 3) the points of a part, in its frame."""
    points = np.full((len(found.points), 3), np.nan)
    intersect_into(points, found, directions_of(found), part.rotation, part.centre)
    return points


def _with_found_cameras(cameras: tuple[Camera, ...], parts: tuple[Mapped, ...]) -> tuple[Camera, ...]:
    """Every camera as the largest part has it that found it."""
    made = []
    for number, camera in enumerate(cameras):
        found = [part.cameras[number] for part in parts if part.cameras[number] != camera]
        made.append(found[0] if found else camera)
    return tuple(made)


def _as_stated(stated: tuple[Camera, ...], found: tuple[Camera, ...]) -> tuple[Camera, ...]:
    """The cameras of the block; free principal distances, and free lenses that begin at zero, start as found."""
    made = []
    for camera, other in zip(stated, found, strict=True):
        focal, lens = camera.interior["focal_length_mm"], dict(camera.lens)
        if focal.kind == "free":
            focal = replace(focal, value=float(other.focal_length_mm))
        for name in LENS_IN_MAPPING:
            if name in lens and lens[name].kind == "free" and lens[name].value == 0.0:
                lens[name] = replace(lens[name], value=float(other.lens[name].value))
        made.append(replace(camera, lens=lens, interior={**camera.interior, "focal_length_mm": focal}))
    return tuple(made)


def _changed_distances(stated: tuple[Camera, ...], found: tuple[Camera, ...]) -> list[str]:
    """Sentences on the principal distances that the photographs themselves give, where those stated are far off."""
    pairs = [
        (camera, camera.focal_length_mm, other.focal_length_mm) for camera, other in zip(stated, found, strict=True)
    ]
    return [
        f"principal distance of {camera.name} {c:.4g} mm, stated {own:.4g} mm"
        for camera, own, c in pairs
        if abs(c / own - 1.0) > WELL_KNOWN
    ]


def _in_place(
    block: Block, part: Mapped, points: np.ndarray, first: bool, seed: int
) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Centres and rotations of a part in the frame of the block, and how they got there; None where nothing tells.

    Parameters
    ----------
    points : (N, 3) in the frame of the part. first : whether no other part has a place yet; then positions on a line
        are taken, with photographs that look down.
    """
    source, target, sigma, controls = _references(block, part, points)
    looking = -np.nanmean(part.rotation[:, :, 2], axis=0)
    on_line = len(target) < 3 or is_line(target) or (not first and _may_be_line(target, sigma))
    if len(target) < 2 or (on_line and (controls == len(target) or not first)):
        return None
    placement = place(source, target, sigma, looking, seed)
    turned, used = placement.rotation @ part.rotation, placement.used
    shown = placement.misfit[used] if used.any() else placement.misfit
    positions = len(target) - controls
    what = [_of_all(used[:positions], "position")] if positions else []
    what += [_of_all(used[positions:], "control point")] if controls else []
    words = f"fit {' and '.join(what)} to {np.median(shown):.3g} m (median)"
    if not placement.agreed:
        words += ", which are few: positions and control points contradict one another or the photographs"
    if on_line:
        words += ", which lie on a line: taken to look down"
    elif not controls and -np.nanmean(turned[:, 2, 2]) > LOOKS_UP:
        words += ", but they look up: if they should not, an axis of the image points is turned round"
    return placement(part.centre), turned, words


def _of_all(used: np.ndarray, what: str) -> str:
    """'12 positions', '9 of 12 positions'."""
    every = counted(len(used), what)
    return every if used.all() else f"{int(used.sum())} of {every}"


def _references(block: Block, part: Mapped, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Points (k, 3) of a part, where they are (k, 3), σ (k, 3) m, and how many of them, at the end, are control points.

    Positions stated as start values stand for those that are not observed.
    """
    where, sigma = block.images.centre.copy(), np.zeros((len(block.images), 3))
    where[~np.isfinite(where).all(axis=1)] = np.nan
    if block.gnss_ins is not None:
        gnss = block.gnss_ins
        known = np.isfinite(gnss.xyz).all(axis=1) & np.isfinite(gnss.sigma).all(axis=1)
        rows = gnss.image[known]
        where[rows], sigma[rows] = gnss.xyz[known], gnss.sigma[known]
    there = np.isfinite(where[:, 0]) & np.isfinite(part.centre[:, 0])
    control = with_edits(block)[0].control
    usable = ~control.is_check & np.isfinite(control.xyz).all(axis=1)
    usable &= np.isfinite(points[control.point]).all(axis=1)
    source = np.concatenate([part.centre[there], points[control.point[usable]]])
    target = np.concatenate([where[there], control.xyz[usable]])
    return source, target, np.concatenate([sigma[there], control.sigma[usable]]), int(usable.sum())


def _may_be_line(xyz: np.ndarray, sigma: np.ndarray) -> bool:
    """Whether the width of a set of positions (k, 3) may come from their errors alone."""
    size = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(size[1] < SURE * np.linalg.norm(sigma.max(axis=1)))


def _anywhere(part: Mapped, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """A part that nothing places: its points at a usual distance, its photographs looking down on average."""
    seen = np.isfinite(part.centre[:, 0])
    middle = np.nanmedian(points, axis=0)
    scale = FREE_DISTANCE_M / max(float(np.median(np.linalg.norm(part.centre[seen] - middle, axis=1))), 1e-300)
    turn = _turn_down(-np.nanmean(part.rotation[:, :, 2], axis=0))
    words = "in a frame of their own: neither positions nor control points place them"
    return scale * (part.centre - middle) @ turn.T, turn @ part.rotation, words


def _turn_down(looking: np.ndarray) -> np.ndarray:
    """The shortest rotation that makes a direction point down; none where photographs look to all sides."""
    length = float(np.linalg.norm(looking))
    if length < LOOKS_UP:
        return np.eye(3)
    a, b = looking / length, np.array([0.0, 0.0, -1.0])
    axis = np.cross(a, b)
    size = float(np.linalg.norm(axis))
    if size < 1e-12:
        return np.diag([1.0, -1.0, -1.0]) if a @ b < 0.0 else np.eye(3)
    return exponential(axis / size * np.arctan2(size, a @ b))


def misses(block: Block, centre: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(m,) distance of every ray from its point, in tolerances; ∞ behind the camera, NaN where there is no point.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3); NaN for photographs without orientation.
    """
    rays, directions = block.image_points, directions_of(block)
    points = np.full((len(block.points), 3), np.nan)
    intersect_into(points, block, directions, rotation, centre)
    own = np.einsum("mji,mj->mi", rotation[rays.image], points[rays.point] - centre[rays.image])
    with np.errstate(invalid="ignore", divide="ignore"):
        miss = np.linalg.norm(-own[:, :2] / own[:, 2:] - directions.tangent, axis=1) / directions.tolerance
        miss[own[:, 2] >= 0.0] = np.inf
    return miss


def _that_belong(
    block: Block, centre: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """The photographs whose rays meet those of others, and the rays that fit, of all that two oriented ones have."""
    image = block.image_points.image
    miss = misses(block, centre, rotation)
    for row in np.flatnonzero(np.isfinite(centre[:, 0])):
        own = miss[image == row]
        own = own[~np.isnan(own)]
        if not len(own) or np.median(own) > BELONGS:
            centre[row], rotation[row] = np.nan, np.nan
    use = np.isfinite(centre[image, 0])
    twice = np.bincount(block.image_points.point[use], minlength=len(block.points)) > 1
    counts = use & twice[block.image_points.point]
    with np.errstate(invalid="ignore"):
        fits = counts & (misses(block, centre, rotation) < FITS)
    return centre, rotation, (int(fits.sum()), int(counts.sum()))
