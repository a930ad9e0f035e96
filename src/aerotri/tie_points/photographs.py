"""The photographs of a folder and their cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.formats.assembly.parts import texts
from aerotri.formats.files.photograph_files import files_of
from aerotri.formats.foreign.exif import PhotographTags, read_exif
from aerotri.formats.text.notes import taken
from aerotri.observations import Camera, Prior

ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff")
LENS = ("k1", "k2", "p1", "p2", "k3")
"""Parameters that a camera known from EXIF alone has as unknowns."""
REMEDY = "state what is missing: --focal-length-mm 8.8 --pixel-um 2.4, or --camera FILE with tables [camera.NAME]"


SAME = 1e-4
"""Relative difference up to which a stated value and that of EXIF, which is rounded, are the same [C]."""
DAY_S = 86400.0
TIME = "time"
"""Column of images.csv."""


@dataclass(frozen=True, eq=False)
class PhotographSet:
    """Photographs, n of them, in the order of their names.

    Parameters
    ----------
    paths : of the files; names : (n,) str, their names with ending, and with their subfolder where there is one.
    cameras : the cameras; camera : (n,) index into them.
    lon_lat_height : (n, 3) degrees and m; sigma_m : (n, 3) m; NaN where not known.
    ellipsoidal : (n,) bool, whether the height is said to count from the ellipsoid.
    time : (n,) s by the clock of the camera, NaN where not known.
    quality : (n,) str, kind of solution of a drone with RTK, '' where not known; None: of none.
    messages : what the user should know of them.
    """

    paths: tuple[Path, ...]
    names: np.ndarray
    cameras: tuple[Camera, ...]
    camera: np.ndarray
    lon_lat_height: np.ndarray
    sigma_m: np.ndarray
    ellipsoidal: np.ndarray
    time: np.ndarray | None = None
    quality: np.ndarray | None = None
    messages: tuple[str, ...] = ()

    @property
    def in_plan(self) -> np.ndarray:
        """(n,) bool, whether longitude and latitude are known."""
        return np.asarray(np.isfinite(self.lon_lat_height[:, :2]).all(axis=1))

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def folder(self) -> Path:
        """The folder that the names begin in."""
        depth = str(self.names[0]).count("/")
        return self.paths[0].parents[depth]

    def in_order(self, rows: np.ndarray) -> PhotographSet:
        """The photographs in another order (n,), their cameras in the order in which these use them."""
        camera = self.camera[rows]
        used = list(dict.fromkeys(camera.tolist()))
        return PhotographSet(
            paths=tuple(self.paths[k] for k in rows.tolist()),
            names=self.names[rows],
            cameras=tuple(self.cameras[c] for c in used),
            camera=np.array([used.index(c) for c in camera.tolist()], dtype=np.int64),
            lon_lat_height=self.lon_lat_height[rows],
            sigma_m=self.sigma_m[rows],
            ellipsoidal=self.ellipsoidal[rows],
            time=None if self.time is None else self.time[rows],
            quality=None if self.quality is None else self.quality[rows],
            messages=self.messages,
        )

    def time_column(self, keep: np.ndarray) -> dict[str, np.ndarray]:
        """The column `time` of images.csv for photographs (n,) bool: s of the day on which the first was taken."""
        if self.time is None or not np.isfinite(self.time[keep]).any():
            return {}
        since = self.time[keep] - np.floor(np.nanmin(self.time[keep]) / DAY_S) * DAY_S
        return {TIME: np.array(["" if np.isnan(t) else f"{t:.10g}" for t in since], dtype=object)}


@dataclass(frozen=True)
class StatedCamera:
    """What the user states of the camera; None and () where EXIF is to tell.

    Parameters
    ----------
    cameras : whole cameras, told by the size of their photographs.
    focal_length_mm, pixel_um : start values.
    """

    cameras: tuple[Camera, ...] = ()
    focal_length_mm: float | None = None
    pixel_um: float | None = None


def find_photographs(folder: Path, stated: StatedCamera = StatedCamera()) -> PhotographSet:
    """The photographs of a folder and of its subfolders.

    Raises
    ------
    InputError
        When there are fewer than two, or the camera of one is not known.
    """
    if not folder.is_dir():
        raise InputError("is no folder", "give the folder of the photographs", folder)
    paths = files_of(folder, ENDINGS)
    if len(paths) < 2:
        raise InputError(f"holds {len(paths)} photographs", f"give a folder with files {', '.join(ENDINGS)}", folder)
    tags = [read_exif(path) for path in paths]
    cameras, camera = _cameras(paths, tags, stated)
    return PhotographSet(
        paths=paths,
        names=texts([path.relative_to(folder).as_posix() for path in paths]),
        cameras=cameras,
        camera=camera,
        lon_lat_height=np.array([tag.lon_lat_height for tag in tags]),
        sigma_m=np.array([tag.sigma_m for tag in tags]),
        ellipsoidal=np.array([tag.ellipsoidal for tag in tags]),
        time=np.array([tag.time for tag in tags]),
        quality=texts([tag.quality for tag in tags]),
        messages=() if stated.cameras else _about_replaced(tags, stated),
    )


def _about_replaced(tags: Sequence[PhotographTags], stated: StatedCamera) -> tuple[str, ...]:
    """What to say of values of EXIF that a stated one stands in place of."""
    said = []
    for option, value, own, unit in (
        ("--focal-length-mm", stated.focal_length_mm, [tag.focal_length_mm for tag in tags], "mm"),
        ("--pixel-um", stated.pixel_um, [tag.pixel_um for tag in tags], "µm"),
    ):
        others = [one for one in own if one is not None and value is not None and abs(one / value - 1.0) > SAME]
        if others:
            values = ", ".join(f"{one:.6g}" for one in sorted(set(others))[:5])
            many = counted(len(others), "photograph")
            said.append(taken(f"{option} {value:g} is used in place of {values} {unit} in EXIF of {many}"))
    return tuple(said)


def _cameras(
    paths: Sequence[Path], tags: Sequence[PhotographTags], stated: StatedCamera
) -> tuple[tuple[Camera, ...], np.ndarray]:
    """The cameras in use and the one of every photograph: photographs of one model, size and focal length share it."""
    found: list[Camera] = []
    place: dict[tuple[object, ...], int] = {}
    index = np.empty(len(tags), np.int64)
    for row, (path, tag) in enumerate(zip(paths, tags, strict=True)):
        key = (tag.make, tag.model, tag.size_px, tag.focal_length_mm, tag.pixel_um)
        if key not in place:
            camera = _stated(path, tag, stated.cameras) if stated.cameras else _from_tags(path, tag, stated)
            same = [i for i, other in enumerate(found) if other is camera]
            place[key] = same[0] if same else len(found)
            if not same:
                found.append(camera)
        index[row] = place[key]
    return _named_apart(found), index


def _stated(path: Path, tag: PhotographTags, cameras: tuple[Camera, ...]) -> Camera:
    fitting = [camera for camera in cameras if camera.size_px == tag.size_px]
    named = [camera for camera in fitting if camera.name == tag.model]
    if len(named or fitting) == 1:
        return (named or fitting)[0]
    size = "{} × {}".format(*tag.size_px)
    known = ", ".join("{} {} × {}".format(camera.name, *camera.size_px) for camera in cameras)
    what = "no camera" if not fitting else f"{len(fitting)} cameras"
    message = f"has {size} pixels, and {what} of that size {'is' if len(fitting) < 2 else 'are'} described ({known})"
    raise InputError(message, "describe one camera of that size in --camera FILE", path)


def _from_tags(path: Path, tag: PhotographTags, stated: StatedCamera) -> Camera:
    """A camera all of whose interior is unknown, from EXIF and what is stated."""
    focal = stated.focal_length_mm or tag.focal_length_mm
    pixel = stated.pixel_um or tag.pixel_um
    if focal is None or pixel is None:
        missing = [what for what, value in (("focal length", focal), ("size of a pixel", pixel)) if value is None]
        raise InputError(f"does not tell the {' and the '.join(missing)} of its camera", REMEDY, path)
    return Camera(
        name=tag.model or "camera",
        model="frame",
        size_px=tag.size_px,
        pixel_um=round(pixel, 6),
        interior={"focal_length_mm": Prior(focal), "x0_mm": Prior(0.0), "y0_mm": Prior(0.0)},
        lens={name: Prior(0.0) for name in LENS},
    )


def _named_apart(cameras: list[Camera]) -> tuple[Camera, ...]:
    names = [camera.name for camera in cameras]
    return tuple(
        camera if names.count(camera.name) == 1 else replace(camera, name=f"{camera.name} {number}")
        for number, camera in enumerate(cameras, 1)
    )
