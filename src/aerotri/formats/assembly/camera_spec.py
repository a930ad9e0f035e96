"""Cameras from options or a file of their own, for image points that come without."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.foreign.bingo import format_in_name
from aerotri.formats.foreign.ign import is_ign_camera, read_ign_camera
from aerotri.formats.foreign.metashape_camera import is_metashape_camera, read_metashape_camera
from aerotri.formats.foreign.orientation_list import is_ortho_camera, read_ortho_camera
from aerotri.formats.foreign.pix4d_params import is_pix4d_camera, read_pix4d_camera
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.observations import Camera, Prior

SAME_FORMAT = 0.01
"""Relative difference between a format stated and one told by a name above which they are two."""
SAME_C = 1e-4
"""Relative difference up to which two principal distances are one that is written with fewer digits [C]."""
REMEDY = "state it: --camera FILE, or --camera-size 8192x5460 --pixel-um 4.27 --focal-length-mm 35"


@dataclass(frozen=True)
class CameraSpec:
    """What the user states of the camera.

    Parameters
    ----------
    file : tables [camera.NAME] as in block.toml, a camera of IGN, a calibration of Metashape, a .cam of Pix4D, or
        a camera of simple-ortho or orthority.
    name : '' where the files of image points name it.
    size_px : columns and rows; pixel_um; focal_length_mm : None where not stated.
    flight_axis : image axis along the flight.
    free : whether focal length and principal point are unknowns, with what is stated as start values.
    """

    file: FilePath | None = None
    name: str = ""
    size_px: tuple[int, int] | None = None
    pixel_um: float | None = None
    focal_length_mm: float | None = None
    flight_axis: str | None = None
    free: bool = False

    @property
    def describes_camera(self) -> bool:
        """Whether there is more than the size of pixels, which some formats lack."""
        return self.file is not None or self.size_px is not None or self.focal_length_mm is not None


def cameras_of(spec: CameraSpec, found: tuple[Camera, ...], named: np.ndarray, c_mm: np.ndarray) -> tuple[Camera, ...]:
    """The cameras: stated, or those that files gave.

    Parameters
    ----------
    found : cameras from the files of the project.
    named : names of cameras in the files of image points, '' left out.
    c_mm : principal distances from the files of image points.

    Raises
    ------
    InputError
        When something is missing.
    """
    if spec.file is not None:
        cameras = _from_file(Path(spec.file), spec)
    elif spec.size_px is not None:
        cameras = (_from_options(spec, named, c_mm),)
    elif found:
        _refuse_values(spec, found)
        cameras = found
    else:
        raise InputError("the camera is not known", REMEDY)
    if spec.flight_axis is not None:
        cameras = tuple(replace(camera, flight_axis=spec.flight_axis) for camera in cameras)
    return tuple(freed(camera) for camera in cameras) if spec.free else cameras


def _refuse_values(spec: CameraSpec, found: tuple[Camera, ...]) -> None:
    """Refuse values that would have to replace those of the cameras found; without a size they describe none."""
    names = ", ".join(camera.name for camera in found[:5])
    for option, value in (("--focal-length-mm", spec.focal_length_mm), ("--camera-name", spec.name or None)):
        if value is not None:
            remedy = f"leave {option} out, or describe the whole camera: --camera FILE, or --camera-size too"
            raise InputError(f"{option} {value}: the files describe their cameras ({names})", remedy)


def about_replaced(cameras: tuple[Camera, ...], c_mm: np.ndarray) -> tuple[str, ...]:
    """What to say of principal distances of files that those of the cameras stand in place of.

    Parameters
    ----------
    c_mm : principal distances from the files of image points, NaN where they say none.
    """
    known = np.unique(c_mm[np.isfinite(c_mm)])
    used = np.array([camera.focal_length_mm for camera in cameras])
    others = [c for c in known.tolist() if (np.abs(c / used - 1.0) > SAME_C).all()]
    if not others:
        return ()
    shown = ", ".join(f"{c:.6g}" for c in others[:5])
    own = ", ".join(f"{c:.6g}" for c in used.tolist())
    return (
        taken(f"the principal distance of the camera, {own} mm, is used in place of {shown} mm in the image points"),
    )


def freed(camera: Camera) -> Camera:
    """The camera with its interior elements as unknowns."""
    return replace(camera, interior={name: Prior(prior.value) for name, prior in camera.interior.items()})


def _from_file(path: Path, spec: CameraSpec) -> tuple[Camera, ...]:
    if spec.size_px is not None or spec.focal_length_mm is not None:
        raise InputError(
            "--camera FILE and single values of the camera exclude each other", "give the file or the values"
        )
    if path.suffix == ".toml":
        # pydantic is imported by the settings model only when it is needed
        from aerotri.formats.block.settings import read_cameras_toml

        return read_cameras_toml(path)
    if is_ortho_camera(path):
        return (read_ortho_camera(path),)
    for recognises, read in (
        (is_ign_camera, read_ign_camera),
        (is_metashape_camera, read_metashape_camera),
        (is_pix4d_camera, read_pix4d_camera),
    ):
        if recognises(path):
            if spec.pixel_um is None:
                raise InputError("does not tell the size of a pixel", "state it: --pixel-um 4.0", path)
            return (read(path, spec.pixel_um),)
    if not path.exists():
        raise InputError("there is no such file", "check the path", path)
    raise InputError("does not describe a camera", "give tables [camera.NAME] as in block.toml, in a .toml file", path)


def _from_options(spec: CameraSpec, named: np.ndarray, c_mm: np.ndarray) -> Camera:
    if spec.size_px is None or spec.pixel_um is None:
        raise InputError("the camera needs both the size of the photograph and the size of a pixel", REMEDY)
    focal = spec.focal_length_mm
    if focal is None:
        told = np.unique(c_mm[np.isfinite(c_mm)])
        if len(told) != 1:
            many = (
                "the principal distance is not known"
                if not len(told)
                else f"the files give {len(told)} principal distances"
            )
            raise InputError(many, "state it: --focal-length-mm 35.0")
        focal = float(told[0])
    name = spec.name or (str(named[0]) if len(named) == 1 else "camera")
    half = tuple(size * spec.pixel_um * 5e-4 for size in spec.size_px)
    for camera in named.tolist():
        told_format = format_in_name(camera)
        if told_format and any(abs(2 * h / t - 1) > SAME_FORMAT for h, t in zip(half, told_format, strict=True)):
            message = f"camera '{camera}' has a format of {told_format[0]:g} × {told_format[1]:g} mm, the options give "
            raise InputError(f"{message}{2 * half[0]:g} × {2 * half[1]:g} mm", "correct --camera-size or --pixel-um")
    held = {"focal_length_mm": focal, "x0_mm": 0.0, "y0_mm": 0.0}
    interior = {element: Prior(value, fixed=True) for element, value in held.items()}
    return Camera(name, "frame", spec.size_px, spec.pixel_um, interior)


def camera_of_each(cameras: tuple[Camera, ...], named: list[str]) -> tuple[tuple[Camera, ...], np.ndarray, list[str]]:
    """The cameras in use, the one of each photograph, and what to say of it.

    Parameters
    ----------
    named : the name of its camera for every photograph, '' where no file says.

    Raises
    ------
    InputError
        When there are several cameras and a photograph's is not among them.
    """
    distinct = sorted({name for name in named if name})
    if len(cameras) == 1:
        said = f"the photographs name the cameras {', '.join(distinct)}; all are taken as '{cameras[0].name}'"
        return cameras, np.zeros(len(named), np.int64), [assumed(said)] if len(distinct) > 1 else []
    place = {camera.name: i for i, camera in enumerate(cameras)}
    for name in named:
        if name not in place:
            known = ", ".join(place)
            who = f"camera '{name}' is not described" if name else "no file says which camera took a photograph"
            remedy = "describe it in --camera FILE, or state one camera for all photographs"
            raise InputError(f"{who}; there are {known}", remedy)
    used = sorted({place[name] for name in named})
    index = np.searchsorted(used, [place[name] for name in named])
    left = [camera.name for i, camera in enumerate(cameras) if i not in used]
    lost: list[str] = [left_behind(f"camera '{name}' has no photographs and was left out") for name in left]
    return tuple(cameras[i] for i in used), index, lost
