"""Projects of other programs brought to an adjusted orientation: what was not adjusted moves along, old files stay.

The project keeps its numbers, names, colours and everything that this program does not read. Its files are replaced in
one step; those that were there before go into a folder beside them.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.files.ownership import foreign_files

OLDER = "before_aerotri"
"""Folder for the files that were there before."""
ROUNDS = 3
"""Fits of the movement, of which the later ones leave out what fits badly [C]."""
FAR = 6.0
"""Times the median misfit beyond which a point does not count for the movement [C]."""
COLLINEAR = 1e-6
"""Second extent of points, of the first, below which they are a line [C]: rotation about it stays open."""


@dataclass(frozen=True, eq=False)
class Move:
    """How a project moves: X_new = scale·R·X_old + translation.

    Parameters
    ----------
    scale : > 0. rotation : (3, 3). translation : (3,) m.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray

    def points(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) points of the project where they are now."""
        return self.scale * xyz @ self.rotation.T + self.translation


def move_between(old: np.ndarray, new: np.ndarray, project: FilePath) -> Move:
    """The similarity nearest to what was adjusted, by least squares [L: Umeyama 1991]; points far off do not count.

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
    move = _similarity(old[use], new[use])
    for _ in range(ROUNDS - 1):
        misfit = np.linalg.norm(move.points(old) - new, axis=1)
        near = use & (misfit <= FAR * np.median(misfit[use]))
        if near.sum() < 3 or _is_line(old[near]):
            break
        move = _similarity(old[near], new[near])
    return move


def _is_line(xyz: np.ndarray) -> bool:
    size = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(size[1] <= COLLINEAR * size[0])


def _similarity(old: np.ndarray, new: np.ndarray) -> Move:
    p, q = old - old.mean(axis=0), new - new.mean(axis=0)
    u, size, vt = np.linalg.svd(q.T @ p)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * sign) @ vt
    scale = float(size @ sign / (p**2).sum())
    return Move(scale, rotation, new.mean(axis=0) - scale * rotation @ old.mean(axis=0))


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
