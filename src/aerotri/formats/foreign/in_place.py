"""Projects of other programs brought to an adjusted orientation: what was not adjusted moves along, old files stay.

The project keeps its numbers, names, colours and everything that this program does not read. Its files are replaced in
one step; those that were there before go into a folder beside them.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from aerotri.adjustment.rigging import robust_mean
from aerotri.conventions import FilePath, InputError, counted
from aerotri.coordinates.similarity import Similarity, nearest_similarity
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.files.ownership import foreign_files
from aerotri.formats.foreign.colmap_rigs import SAME_M, SAME_RAD
from aerotri.functional_model.rotation import logarithm

OLDER = "before_aerotri"
"""Folder for the files that were there before."""
ROUNDS = 3
"""Fits of the movement, of which the later ones leave out what fits badly [C]."""
FAR = 6.0
"""Times the median misfit beyond which a point does not count for the movement [C]."""
COLLINEAR = 1e-6
"""Second extent of points, of the first, below which they are a line [C]: rotation about it stays open."""


def move_between(old: np.ndarray, new: np.ndarray, project: FilePath) -> Similarity:
    """The similarity nearest to what was adjusted, by least squares; points far off do not count.

    Parameters
    ----------
    old, new : (n, 3) m, the same points in the project and as adjusted.
    project : for errors.

    Raises
    ------
    InputError
        When the points do not determine it.
    """
    use = np.isfinite(old).all(axis=1) & np.isfinite(new).all(axis=1)
    if use.sum() < 3 or _is_line(old[use]) or _is_line(new[use]):
        message = "fewer than three places that are not on a line are common to the project and the result"
        raise InputError(message, "give the project that the block was read from", project)
    move = nearest_similarity(old[use], new[use])
    for _ in range(ROUNDS - 1):
        misfit = np.linalg.norm(move(old) - new, axis=1)
        near = use & (misfit <= FAR * np.median(misfit[use]))
        if near.sum() < 3 or _is_line(old[near]):
            break
        move = nearest_similarity(old[near], new[near])
    return move


def _is_line(xyz: np.ndarray) -> bool:
    size = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(size[1] <= COLLINEAR * size[0])


def mean_pose(poses: list[np.ndarray]) -> np.ndarray:
    """(3, 4) the pose in the middle of several, robustly."""
    several = np.array(poses)
    return np.column_stack([robust_mean(several[:, :, :3]), np.median(several[:, :, 3], axis=0)])


def centre_of(pose: np.ndarray) -> np.ndarray:
    """(3,) projection centre of a pose (3, 4), world → camera."""
    return -pose[:, :3].T @ pose[:, 3]


def poses_differ(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two poses (3, 4) differ by more than rounding."""
    turn = np.abs(logarithm(one[:, :3] @ other[:, :3].T)).max()
    return bool(turn > SAME_RAD or np.abs(centre_of(one) - centre_of(other)).max() > SAME_M)


def about_others(images: int, points: int, missing: int, project: str) -> list[str]:
    """Sentences on photographs and object points that were not adjusted, and photographs that the project lacks."""
    along = [counted(images, "photograph")] * (images > 0) + [counted(points, "object point")] * (points > 0)
    said = [f"not adjusted, moved along with the others: {' and '.join(along)}"] if along else []
    if missing:
        said.append(f"could not be carried over: {counted(missing, 'photograph')} that the {project} does not have")
    return said


@contextmanager
def replaced_files(folder: FilePath, own: Collection[str]) -> Generator[Path]:
    """A folder to write new files of a project to; at the end they take their place, all at once.

    Older files of these names that this program has not written go into `before_aerotri`, everything else stays.

    Parameters
    ----------
    folder : of the project. own : names that may be written.

    Raises
    ------
    InputError
        When the place cannot be written to.
    """
    folder = Path(folder)
    older = [folder / name for name in foreign_files(folder, own)]
    with atomic_folder(folder, own=own, gone=own) as place:
        yield place
        if older:
            aside = place / _free_name(folder).name
            aside.mkdir()
            for path in older:
                _keep(path, aside / path.name)


def _free_name(folder: Path) -> Path:
    number = 2
    free = folder / OLDER
    while os.path.lexists(free):
        free, number = folder / f"{OLDER}_{number}", number + 1
    return free


def _keep(path: Path, place: Path) -> None:
    try:
        os.link(path, place)
    except OSError:
        shutil.copy2(path, place)
