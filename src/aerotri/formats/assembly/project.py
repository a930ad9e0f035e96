"""A block from several files at once: image points from one, positions, control and orientations from others.

The source is a whole block (`convert.READERS`), a reconstruction, a folder of IGN or PAT-B files, a file of image
points, or a list of orientations (photographs alone). What else is given is added, in the order of `read_project`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.coordinates.blocks import frame_of_block, starts_elsewhere, transform_block
from aerotri.diagnosis.suspicions import suspicions_of_lists
from aerotri.formats import convert
from aerotri.formats.assembly import kinds, placing
from aerotri.formats.assembly.assemble import Statements, with_crs, with_orientations, with_positions, with_rays
from aerotri.formats.assembly.assemble_control import with_check_points, with_control
from aerotri.formats.assembly.camera_spec import CameraSpec, about_replaced, camera_of_each, cameras_of, freed
from aerotri.formats.assembly.kinds import ReadingOptions
from aerotri.formats.assembly.parts import (
    OrientationList,
    PointList,
    PositionList,
    RayList,
    Reading,
    no_sigma,
)
from aerotri.formats.assembly.reprojection import FEWEST, control_at_start, residuals_at_start, sample_of_points
from aerotri.formats.assembly.rigs_by_name import names_told, with_rig
from aerotri.formats.block.folder import read_block
from aerotri.formats.foreign.alicevision import read_alicevision
from aerotri.formats.foreign.blocks_exchange import read_blocks_exchange
from aerotri.formats.foreign.bundler import read_bundler
from aerotri.formats.foreign.colmap import read_colmap
from aerotri.formats.foreign.ign import files_of, is_ign, is_ign_camera, read_ign_app, read_ign_camera, read_ign_mes
from aerotri.formats.foreign.list_header import has_attitudes
from aerotri.formats.foreign.metashape_project import read_metashape_project
from aerotri.formats.foreign.micmac import read_micmac
from aerotri.formats.foreign.nvm import read_nvm
from aerotri.formats.foreign.openmvg import read_openmvg
from aerotri.formats.foreign.opensfm import read_opensfm
from aerotri.formats.foreign.opensfm_gcp import NAME as OPENSFM_GCP
from aerotri.formats.foreign.opf import read_opf
from aerotri.formats.foreign.pix4d import read_pix4d_offset
from aerotri.formats.foreign.pix4d_params import read_pix4d_params
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images

FOLDERS = {"ign": "IGN", "patb": "PAT-B"}
"""Kinds of folders whose files are parts."""
UNKNOWN_PIXEL_UM = 1.0
"""Size of a pixel where nothing tells it; a principal distance of 3000 pixels then reads 3 mm."""
IN_PIXELS: Mapping[str, Callable[[Path, float], Reading]] = {
    "alicevision": read_alicevision,
    "micmac": read_micmac,
    "openmvg": read_openmvg,
    "opensfm": read_opensfm,
}
"""Whole blocks that know no size of a pixel."""
WITHOUT_SIZE: Mapping[str, Callable[[Path, float, tuple[int, int] | None], Reading]] = {
    "bundler": read_bundler,
    "nvm": read_nvm,
}
"""Whole blocks that know no format of the photographs either."""
MAY_FREE = ("blocks-exchange", "colmap", "metashape-project", "opf", "pix4d-params", *WITHOUT_SIZE, *IN_PIXELS)
"""Whole blocks whose interior elements --free-interior makes unknowns."""
WITHOUT_SIGMA = ("bal", "blocks-exchange", "colmap", "opf", "pix4d-params", *WITHOUT_SIZE, *IN_PIXELS)
"""Whole blocks whose files have no standard deviation of image points."""
ABOUT_SIGMA = assumed("the standard deviation of image points is assumed as 1 pixel: state yours with --image-sigma-px")
CONTROL_BESIDE = (OPENSFM_GCP, "gcp_list.txt")
"""Control points of OpenSfM beside its reconstruction."""
SHIFTS = ("off", "block", "strip")
_Read = TypeVar("_Read")


@dataclass(frozen=True)
class Request:
    """What is to be read, and what the user states.

    Parameters
    ----------
    source : PATH or kind:PATH; name : of the block.
    image_points, orientation, positions, control : further files, PATH or kind:PATH, '' for none.
    camera, stated : see there. check : control points that become check points.
    offset : file with what is added to orientations of Pix4D.
    image_sigma_um, image_sigma_px : standard deviation of the image points; None: that of the source, or a pixel.
    gnss_shift : 'off', 'block' or 'strip'; None: as the settings are.
    time_stamps : file of time stamps, or a folder of them, where `positions` is a trajectory.
    station_pattern, rig_reference : see `rigs_by_name.with_rig`; '' for no rig.
    """

    source: str
    name: str
    image_points: tuple[str, ...] = ()
    orientation: str = ""
    positions: str = ""
    control: str = ""
    camera: CameraSpec = field(default_factory=CameraSpec)
    stated: Statements = field(default_factory=Statements)
    check: tuple[str, ...] = ()
    offset: FilePath | None = None
    image_sigma_um: float | None = None
    image_sigma_px: float | None = None
    gnss_shift: str | None = None
    station_pattern: str = ""
    rig_reference: str = ""
    time_stamps: str = ""


@dataclass(frozen=True, eq=False)
class _Parts:
    """What a source holds that is no whole block."""

    rays: tuple[RayList, ...] = ()
    orientations: OrientationList | None = None
    control: tuple[PointList, ...] = ()
    cameras: tuple[Camera, ...] = ()
    messages: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    positions: PositionList | None = None


def read_project(request: Request) -> Reading:
    """The block of a request.

    Raises
    ------
    InputError
        For whatever is missing, damaged or contradictory, naming the file and, of lists, the line.
    """
    return assembled(request, _WHOLE)


@dataclass(frozen=True)
class Sources:
    """How the source of a request is read where its image points are the bulk of it.

    Parameters
    ----------
    colmap : a COLMAP model at a size of its pixels. rays : a file of image points, of a kind.
    """

    colmap: Callable[[Path, float], tuple[Block, np.ndarray | None]]
    rays: Callable[[str, Path, ReadingOptions], RayList]


def _read_rays(kind: str, path: Path, options: ReadingOptions) -> RayList:
    return kinds.read_rays(f"{kind}:{path}", options)


_WHOLE = Sources(read_colmap, _read_rays)


def assembled(request: Request, sources: Sources) -> Reading:
    """As `read_project`, its source read in a way of one's own."""
    options = reading_options(request)
    whole = _whole(request, sources)
    of_source = options.beside_control() if request.control else options
    parts = _Parts() if whole is not None else _parts(request, of_source, sources)
    reading = whole if whole is not None else _begin(request, parts)
    control = [*parts.control, *([kinds.read_control(request.control, options)] if request.control else [])]
    positions = parts.positions
    if request.positions:
        positions = kinds.read_position_list(request.positions, of_source, request.time_stamps)
    orientations = [] if parts.orientations is None else [parts.orientations]
    if request.orientation:
        orientations.append(kinds.read_orientations(request.orientation, options))
    crs = request.stated.crs
    if not crs and reading.block.crs == "local":
        crs = placing.system_of_lists([*control, *([positions] if positions else []), *orientations])
    reading = with_crs(reading, crs, request.stated.geoid)
    extra = [kinds.read_rays(text, options) for text in request.image_points]
    of_control = [part.rays for part in control if part.rays is not None and part.rays.path not in parts.files]
    sigma_px = 1.0 if request.image_sigma_px is None else request.image_sigma_px
    for rays in (*parts.rays, *extra, *of_control):
        reading = with_rays(reading, rays, sigma_px)
    for given in orientations:
        reading = with_orientations(reading, given, request.stated)
    if positions is not None:
        reading = with_positions(reading, positions, request.stated)
    for points in control:
        reading = with_control(reading, points, request.stated)
    reading = with_check_points(reading, request.check, request.stated.control_prefix)
    if request.station_pattern:
        reading = _on_rig(reading, request)
    return _finished(_with_said_sigma(reading, request), request, whole is None)


def _with_said_sigma(reading: Reading, request: Request) -> Reading:
    """A whole block with a note where its format has no σ of image points and none is stated."""
    kind, _ = kind_of_source(request)
    stated = request.image_sigma_um is not None or request.image_sigma_px is not None
    if stated or kind not in WITHOUT_SIGMA or not len(reading.block.image_points):
        return reading
    return replace(reading, messages=(*reading.messages, ABOUT_SIGMA))


def _on_rig(reading: Reading, request: Request) -> Reading:
    try:
        return with_rig(reading, request.station_pattern, request.rig_reference)
    except InputError as error:
        raise InputError(error.message, error.remedy, error.file or Path(request.source)) from error


def reading_options(request: Request) -> ReadingOptions:
    """What single formats leave open, of a request.

    Raises
    ------
    InputError
        When what is stated makes no sense.
    """
    offset = None if request.offset is None else read_pix4d_offset(request.offset)
    if request.rig_reference and not request.station_pattern:
        raise InputError("--rig-reference is given, but no rig", "say how names tell it: --station-pattern PATTERN")
    if request.stated.columns and not (request.control or request.positions):
        raise InputError("--columns is given, but no list of points", "give it: --control FILE, or --positions FILE")
    if request.time_stamps and not request.positions:
        raise InputError("--time-stamps is given, but no trajectory", "give it: --positions FILE")
    if not request.control and request.stated.control_prefix:
        raise InputError("--control-prefix is given, but no control points", "give them: --control FILE")
    return kinds.options_of(request.stated, offset)


def _whole(request: Request, sources: Sources) -> Reading | None:
    """The source as a whole block; None where it is made of parts."""
    reading = _as_it_is(request, sources)
    if reading is None or not request.camera.free:
        return reading
    cameras = tuple(freed(camera) for camera in reading.block.cameras)
    return replace(reading, block=replace(reading.block, cameras=cameras))


def kind_of_source(request: Request) -> tuple[str | None, Path]:
    """The kind of the source of a request, where it is stated or that of a whole block, and its path.

    Raises
    ------
    InputError
        When there is no such file.
    """
    stated, path = kinds.split_kind(request.source, convert.READERS, FOLDERS, kinds.RAYS, kinds.ORIENTATIONS)
    if not path.exists():
        raise InputError("there is no such file or folder", "check the path", path)
    if stated is None:
        stated = next((name for name, is_it in convert.RECOGNISERS.items() if is_it(path)), None)
    return stated, path


def _as_it_is(request: Request, sources: Sources) -> Reading | None:
    kind, path = kind_of_source(request)
    if kind not in convert.READERS:
        return None
    pixel_um, size_px = request.camera.pixel_um, request.camera.size_px
    may_free = kind in MAY_FREE and request.camera.free
    if request.camera != CameraSpec(pixel_um=pixel_um, size_px=size_px, free=may_free):
        remedy = f"leave the options of the camera out; --pixel-um may stay, of {', '.join(MAY_FREE)} --free-interior"
        raise InputError("has cameras of its own", remedy, path)
    if size_px is not None and kind not in WITHOUT_SIZE:
        raise InputError("has cameras of its own", "leave --camera-size out", path)
    with_pixels = _with_pixels(kind, path, request)
    if with_pixels is not None:
        return with_pixels
    said = () if pixel_um is not None else (_about_pixel(UNKNOWN_PIXEL_UM),)
    if kind in ("colmap", *WITHOUT_SIZE, *IN_PIXELS):
        pixel_um = UNKNOWN_PIXEL_UM if pixel_um is None else pixel_um
        if kind == "colmap":
            (block, points), heard = _with_warnings(lambda pixel=pixel_um: sources.colmap(path, pixel))
            return Reading(block, points, (*heard, *said))
        sized = WITHOUT_SIZE.get(kind)
        read = IN_PIXELS[kind](path, pixel_um) if sized is None else sized(path, pixel_um, size_px)
        return replace(read, messages=(*read.messages, *_control_beside(path, kind, request.control), *said))
    if pixel_um is not None:
        raise InputError("has cameras of its own", "leave --pixel-um out", path)
    if kind == "block":
        return Reading(read_block(path, rays_needed=False))
    block, points = convert.read_any(path, kind)
    return Reading(block, points)


def _with_pixels(kind: str | None, path: Path, request: Request) -> Reading | None:
    """A whole block of a format that tells the size of its pixels, or may; None of others."""
    pixel_um, geoid = request.camera.pixel_um, request.stated.geoid
    if kind == "metashape-project":
        return read_metashape_project(path, pixel_um)
    if kind == "blocks-exchange":
        return read_blocks_exchange(path, pixel_um, geoid)
    if kind == "opf":
        return read_opf(path, pixel_um, geoid)
    if kind == "pix4d-params":
        offset = None if request.offset is None else read_pix4d_offset(request.offset)
        return read_pix4d_params(path, pixel_um, offset)
    return None


def _with_warnings(read: Callable[[], _Read]) -> tuple[_Read, tuple[str, ...]]:
    """What is read, and what its reader warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = read()
    own = [one.message.args[0] for one in caught if type(one.message) is UserWarning]
    for one in caught:
        if type(one.message) is not UserWarning:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
    return found, tuple(own)


def _about_pixel(pixel_um: float) -> str:
    return assumed(f"a pixel counts as {pixel_um:g} µm: state it with --pixel-um")


def _control_beside(path: Path, kind: str, control: str) -> tuple[str, ...]:
    """Sentences on OpenSfM's lists of control points beside a reconstruction that are not read."""
    folder = path if path.is_dir() else path.parent
    found = [name for name in CONTROL_BESIDE if (folder / name).is_file()] if kind == "opensfm" and not control else []
    return tuple(left_behind(f"{name} beside it is not read: add it with --control {folder / name}") for name in found)


def _parts(request: Request, options: ReadingOptions, sources: Sources) -> _Parts:
    stated, path = kinds.split_kind(request.source, FOLDERS, kinds.RAYS, kinds.ORIENTATIONS)
    if path.is_dir():
        if stated == "ign" or (stated is None and is_ign(path)):
            return _ign(path, request)
        if stated == "patb" or (stated is None and files_of(path, ".im")):
            return _patb(path, options, sources)
        raise InputError(
            "is a folder of no known format", f"known are {', '.join(convert.RECOGNISERS)}, ign, patb", path
        )
    kind = stated or kinds.kind_of(path, kinds.RAYS) or kinds.kind_of(path, kinds.ORIENTATIONS)
    if kind is not None and kind in kinds.RAYS:
        if kind == "odm-gcp":
            control = kinds.read_control(f"odm-gcp:{path}", options)
            rays = () if control.rays is None else (control.rays,)
            return _Parts(rays, control=(control,), files=(path,))
        return _Parts((sources.rays(kind, path, options),))
    if kind in kinds.ORIENTATIONS:
        return _Parts(orientations=kinds.read_orientations(f"{kind}:{path}", options))
    if has_attitudes(path) and not request.positions:
        return _Parts(positions=kinds.read_position_list(f"csv:{path}", options))
    known = ", ".join((*convert.RECOGNISERS, *FOLDERS, *kinds.RAYS, *kinds.ORIENTATIONS))
    raise InputError(
        "is of no known format", f"known are {known}; put the format before the path, as FORMAT:{path.name}", path
    )


def _ign(folder: Path, request: Request) -> _Parts:
    """All files of IGN in a folder: one .OPK, and the .mes, .app and cameras beside it."""
    orientations = _only_one(folder, ".opk")
    pixel_um = UNKNOWN_PIXEL_UM if request.camera.pixel_um is None else request.camera.pixel_um
    cameras = tuple(read_ign_camera(path, pixel_um) for path in files_of(folder, ".txt") if is_ign_camera(path))
    if len({camera.name for camera in cameras}) < len(cameras):
        raise InputError("two files in this folder describe the same camera", "keep one of them", folder)
    rays = tuple(read_ign_mes(path) for path in files_of(folder, ".mes"))
    control = tuple(read_ign_app(path) for path in files_of(folder, ".app"))
    said = _about_pixel(pixel_um)
    told = request.camera.pixel_um is not None or request.camera.describes_camera
    list_of = kinds.read_orientations(f"ign-opk:{orientations}", ReadingOptions())
    return _Parts(rays, list_of, control, cameras, () if told else (said,))


def _patb(folder: Path, options: ReadingOptions, sources: Sources) -> _Parts:
    """The .im, .ori and .con file of a folder."""
    paths = {ending: _only_one(folder, ending) if files_of(folder, ending) else None for ending in (".ori", ".con")}
    rays = sources.rays("patb-im", _only_one(folder, ".im"), options)
    orientations = kinds.read_orientations(f"patb-ori:{paths['.ori']}", options) if paths[".ori"] else None
    control = (kinds.read_control(f"patb-con:{paths['.con']}", options),) if paths[".con"] else ()
    return _Parts((rays,), orientations, control)


def _only_one(folder: Path, ending: str) -> Path:
    found = files_of(folder, ending)
    if len(found) != 1:
        message = f"holds {len(found)} files {ending}" if found else f"holds no file {ending}"
        raise InputError(message, f"exactly one is needed in the folder; or give the {ending} file itself", folder)
    return found[0]


def _begin(request: Request, parts: _Parts) -> Reading:
    """A block of the photographs that the parts name, with their cameras."""
    camera_of: dict[str, str] = {}
    for part in (*parts.rays, *([parts.orientations] if parts.orientations is not None else [])):
        for image, camera in zip(part.images.tolist(), part.cameras.tolist(), strict=True):
            camera_of[image] = camera_of.get(image) or camera
    if parts.positions is not None:
        camera_of |= dict.fromkeys(parts.positions.images.tolist(), "")
    if not camera_of:
        raise InputError(
            "holds no photographs",
            "give a file with photographs, or their orientations with --orientations FILE",
            request.source,
        )
    named = np.array(sorted({name for name in camera_of.values() if name}), dtype=str)
    c_mm = np.concatenate([rays.focal_length_mm for rays in parts.rays]) if parts.rays else np.zeros(0)
    try:
        cameras = cameras_of(request.camera, parts.cameras, named, c_mm)
        if request.station_pattern and len(cameras) > 1:
            _, told = names_told(np.array(list(camera_of), dtype=str), request.station_pattern)
            camera_of = {image: name or of for (image, name), of in zip(camera_of.items(), told, strict=True)}
        cameras, camera, said = camera_of_each(cameras, list(camera_of.values()))
        said = [*said, *about_replaced(cameras, c_mm)]
    except InputError as error:
        raise InputError(error.message, error.remedy, error.file or Path(request.source), error.line) from error
    count = len(camera_of)
    images = Images(
        names=np.array(list(camera_of), dtype=str),
        camera=camera,
        strip=np.full(count, ""),
        centre=no_sigma(count),
        angles=no_sigma(count),
    )
    nothing = np.zeros(0, np.int64)
    rays = ImagePoints(nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2)))
    name = request.name or Path(request.source).stem
    block = Block(name, cameras, images, np.zeros(0, "<U1"), rays)
    return Reading(block, None, (*parts.messages, *said))


def _finished(reading: Reading, request: Request, is_new: bool) -> Reading:
    """Settings as stated, and how well image points fit the start values."""
    block, messages = replace(reading.block, name=request.name or reading.block.name), list(reading.messages)
    settings, rays = block.settings, block.image_points
    sigma_um, sigma_px = request.image_sigma_um, request.image_sigma_px
    if sigma_um is not None and sigma_px is not None:
        raise InputError("--image-sigma-um and --image-sigma-px exclude each other", "state one of the two")
    if sigma_um is None and (sigma_px is not None or is_new):
        if sigma_px is None and len(rays):
            messages.append(ABOUT_SIGMA)
        sigma_px = 1.0 if sigma_px is None else sigma_px
        sigma_um = sigma_px * block.cameras[0].pixel_um
        sigma = sigma_in_px(block, rays.image, sigma_px)
    else:
        sigma = rays.sigma if sigma_um is None else np.full_like(rays.sigma, sigma_um * 1e-3)
    if sigma_um is not None:
        settings = replace(settings, image_sigma_um=sigma_um)
    placed = len(block.control) > 0 or block.gnss_ins is not None
    if is_new and not placed:
        settings = replace(settings, adjustment=AdjustmentSettings(datum="minimal"))
    if placed and settings.adjustment.datum == "minimal" and (request.control or request.positions):
        settings = replace(settings, adjustment=replace(settings.adjustment, datum="control"))
    if request.gnss_shift is not None:
        if request.gnss_shift not in SHIFTS:
            raise InputError(f"--gnss-shift '{request.gnss_shift}' is not possible", f"give {' or '.join(SHIFTS)}")
        settings = replace(settings, gnss=replace(settings.gnss, shift=request.gnss_shift))
    elif request.positions and settings.gnss.shift != "off":
        about = f"the block estimates a shift of the GNSS positions (gnss.shift = {settings.gnss.shift})"
        messages.append(assumed(f"{about}: --gnss-shift off leaves it out"))
    block = replace(block, settings=settings, image_points=replace(rays, sigma=sigma))
    messages += [*suspicions_of_lists(block), *fit_of_start_values(block, request.stated.geoid)]
    return replace(reading, block=block, messages=tuple(messages))


def sigma_in_px(block: Block, image: np.ndarray, sigma_px: float) -> np.ndarray:
    """(m, 2) mm, σ of image points in photographs (m,), stated in pixels."""
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[image]]
    return np.repeat(sigma_px * pixel[:, None], 2, axis=1)


def fit_of_start_values(block: Block, geoid: FilePath | None = None) -> list[str]:
    """How well image points fit the orientations that were given, in words; nothing where there are none."""
    start = np.column_stack([block.images.centre, block.images.angles])
    known = np.asarray(np.isfinite(start).all(axis=1))
    rays = block.image_points
    if not known.any() or not known[rays.image].any():
        return []
    try:
        local = block if block.crs == "local" else transform_block(block, frame_of_block(block, geoid))
    except InputError as error:
        return [f"how image points fit the orientations was not computed: {error}"]
    sample = sample_of_points(local)
    found = residuals_at_start(_with_rays(local, sample))
    # in axes of their own: that control points lie elsewhere is no misfit
    of_control = np.isin(rays.point, block.control.point) & (not starts_elsewhere(block))
    control = control_at_start(_with_rays(local, np.flatnonzero(of_control)))
    said = []
    if found.count >= FEWEST:
        chosen = len(np.unique(rays.point[sample]))
        part = "" if len(sample) == len(rays) else f" of {chosen} points, a sample of {len(block.points)}"
        said.append(
            f"image points fit the given orientations to {found.median_px:.3g} px "
            f"(median of {counted(found.count, 'ray')}{part})"
        )
    if len(control):
        said.append(
            f"image points of control points fit the given coordinates to {np.median(control):.3g} px "
            f"(median of {counted(len(control), 'ray')})"
        )
    return said


def _with_rays(block: Block, rows: np.ndarray) -> Block:
    """The block with these rays alone."""
    rays = block.image_points
    own = replace(rays, image=rays.image[rows], point=rays.point[rows], xy=rays.xy[rows], sigma=rays.sigma[rows])
    return replace(block, image_points=own)
