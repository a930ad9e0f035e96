"""What one file of a project says: image points, orientations, positions or object points, by name.

A block is put together from such parts (`assemble`). Names are those of the file; units are those of `conventions`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.observations import Block


@dataclass(frozen=True, eq=False)
class RayList:
    """Image points of a file.

    Parameters
    ----------
    path : the file.
    images : (n,) str; cameras : (n,) str, the camera of each, '' where the file does not say.
    points : (N,) str.
    image, point : (m,) index into these.
    xy : (m, 2) in `unit`.
    unit : 'mm' from the image centre, y up; 'px' column and row, 0 the upper left corner; 'part' of the longer side
        of the format, from the image centre, y down.
    focal_length_mm : (n,) of each photograph, NaN where the file does not say.
    messages : what the user should know.
    """

    path: Path
    images: np.ndarray
    cameras: np.ndarray
    points: np.ndarray
    image: np.ndarray
    point: np.ndarray
    xy: np.ndarray
    unit: str
    focal_length_mm: np.ndarray
    messages: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class OrientationList:
    """Orientations of photographs.

    Parameters
    ----------
    path : the file.
    images : (n,) str; cameras : (n,) str, '' where the file does not say.
    centre : (n, 3) m; rotation : (n, 3, 3) camera → object, NaN where not given.
    choices : other readings of the rotation by name, (n, 3, 3) each, where the file alone does not settle it;
        `rotation` is the first of them. Reprojection decides.
    first_unless : whether the first choice stands where reprojection cannot tell; else that is an error.
    messages : what the user should know.
    crs : coordinate system where the file names it, else ''.
    """

    path: Path
    images: np.ndarray
    cameras: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    choices: tuple[tuple[str, np.ndarray], ...] = ()
    first_unless: bool = False
    messages: tuple[str, ...] = ()
    crs: str = ""


@dataclass(frozen=True, eq=False)
class Stamps:
    """What rows of a list have in place of names: which photographs they mean is settled when these are known.

    Parameters
    ----------
    file : (n,) index into `files`, that the time stamp is from. files : the files.
    number : (n,) of the photograph, −1 where there is none.
    refused : (n,) str, why there is no position at this time, '' where there is one.
    """

    file: np.ndarray
    files: tuple[Path, ...]
    number: np.ndarray
    refused: np.ndarray


@dataclass(frozen=True, eq=False)
class PositionList:
    """Observed positions of photographs.

    Parameters
    ----------
    path : the file.
    images : (n,) str; of `stamps` names of these.
    xyz, sigma : (n, 3) m, NaN where not given.
    yaw_pitch_roll : (n, 3) rad, NaN where not given: yaw clockwise from true north to the top of the image, pitch and
        roll 0 for a photograph that looks straight down.
    crs : coordinate system where the file names it, else ''.
    messages : what the user should know.
    heights : 'ellipsoidal' or 'sea level' where the file calls them so, else ''.
    time : (n,) s, None where the file has none.
    stamps : which photographs the rows mean, where they have no names.
    of_base : whether longitude and latitude are on the datum of the base station, which files call WGS 84.
    """

    path: Path
    images: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    yaw_pitch_roll: np.ndarray
    crs: str = ""
    messages: tuple[str, ...] = ()
    heights: str = ""
    time: np.ndarray | None = None
    stamps: Stamps | None = None
    of_base: bool = False


@dataclass(frozen=True, eq=False)
class PointList:
    """Control and check points.

    Parameters
    ----------
    path : the file.
    points : (n,) str.
    xyz : (n, 3) m, NaN where unknown; sigma : (n, 3) m, NaN where not given.
    is_check : (n,) bool.
    crs : coordinate system where the file names it, else ''.
    heights : 'ellipsoidal' where the file calls them so, else ''.
    rays : image points of these points, where the file has them.
    messages : what the user should know.
    """

    path: Path
    points: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    is_check: np.ndarray
    crs: str = ""
    heights: str = ""
    rays: RayList | None = None
    messages: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Reading:
    """A block as far as files gave it.

    Parameters
    ----------
    block : the block.
    points : (N, 3) m, start values of object points, None where there are none.
    messages : what the user should know.
    origin : longitude, latitude (degrees) and ellipsoidal height (m) on WGS 84 of a local block whose axes point east,
        north and up there; None where nothing is known.
    """

    block: Block
    points: np.ndarray | None = None
    messages: tuple[str, ...] = ()
    origin: tuple[float, float, float] | None = None


def no_sigma(count: int) -> np.ndarray:
    """(n, 3) of NaN: nothing is said about the accuracy, the values or the angles."""
    return np.full((count, 3), np.nan)


def texts(names: list[str]) -> np.ndarray:
    """(n,) str array of names."""
    return np.array(names, dtype=str) if names else np.zeros(0, "<U1")
