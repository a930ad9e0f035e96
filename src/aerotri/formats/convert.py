"""The formats by name: which one a path holds, reading and writing any of them.

Whole blocks are read here; blocks that are put together from several files, in `project`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, regular_file
from aerotri.formats.assembly.oriented import OrientedBlock, oriented_block
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.assembly.placing import in_axes_at, in_local_frame
from aerotri.formats.block import writer as block_writer
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.foreign import bundler, colmap, opensfm, patb
from aerotri.formats.foreign.alicevision import is_alicevision, read_alicevision
from aerotri.formats.foreign.bal import is_bal, read_bal, write_bal
from aerotri.formats.foreign.bingo import write_bingo
from aerotri.formats.foreign.blocks_exchange import is_blocks_exchange, read_blocks_exchange
from aerotri.formats.foreign.blocks_exchange_writer import write_blocks_exchange
from aerotri.formats.foreign.bundler import is_bundler, read_bundler, write_bundler
from aerotri.formats.foreign.colmap import read_colmap, write_colmap
from aerotri.formats.foreign.colmap_in_place import update_colmap
from aerotri.formats.foreign.colmap_model import is_colmap
from aerotri.formats.foreign.dbat import read_dbat
from aerotri.formats.foreign.dbat_script import is_dbat
from aerotri.formats.foreign.ign import write_ign_opk
from aerotri.formats.foreign.measured_lists import write_ign_app, write_ign_mes, write_odm_geo, write_pix4d_offset
from aerotri.formats.foreign.metashape import write_metashape
from aerotri.formats.foreign.metashape_camera import write_metashape_camera
from aerotri.formats.foreign.metashape_cameras import write_metashape_cameras
from aerotri.formats.foreign.metashape_files import is_metashape_project
from aerotri.formats.foreign.metashape_project import read_metashape_project
from aerotri.formats.foreign.micmac import is_micmac, read_micmac
from aerotri.formats.foreign.nvm import is_nvm, read_nvm
from aerotri.formats.foreign.odm import write_odm_gcp
from aerotri.formats.foreign.openmvg import is_openmvg, read_openmvg
from aerotri.formats.foreign.opensfm import is_opensfm, read_opensfm, write_opensfm
from aerotri.formats.foreign.opensfm_in_place import origin_of, update_opensfm
from aerotri.formats.foreign.opf import read_opf
from aerotri.formats.foreign.opf_files import is_opf
from aerotri.formats.foreign.patb import write_patb
from aerotri.formats.foreign.pix4d import write_pix4d_eo, write_pix4d_gcp, write_pix4d_geo
from aerotri.formats.foreign.pix4d_params import is_pix4d_params, read_pix4d_params
from aerotri.formats.text.notes import left_behind
from aerotri.observations import Block


def _is_block(path: Path) -> bool:
    return path.suffix == ".toml" if path.is_file() else (path / "block.toml").is_file()


RECOGNISERS: Mapping[str, Callable[[Path], bool]] = {
    "block": _is_block,
    "colmap": is_colmap,
    "dbat": is_dbat,
    "bal": is_bal,
    "bundler": is_bundler,
    "nvm": is_nvm,
    "micmac": is_micmac,
    "opf": is_opf,
    "openmvg": is_openmvg,
    "alicevision": is_alicevision,
    "opensfm": is_opensfm,
    "metashape-project": is_metashape_project,
    "pix4d-params": is_pix4d_params,
    "blocks-exchange": is_blocks_exchange,
}


def _block_and_points(reading: Reading) -> tuple[Block, np.ndarray | None]:
    return reading.block, reading.points


READERS: Mapping[str, Callable[[Path], tuple[Block, np.ndarray | None]]] = {
    "block": lambda path: (read_block(path), None),
    "colmap": read_colmap,
    "dbat": lambda path: (read_dbat(path), None),
    "bal": read_bal,
    "bundler": lambda path: _block_and_points(read_bundler(path)),
    "nvm": lambda path: _block_and_points(read_nvm(path)),
    "micmac": lambda path: _block_and_points(read_micmac(path)),
    "opf": lambda path: _block_and_points(read_opf(path)),
    "openmvg": lambda path: _block_and_points(read_openmvg(path)),
    "alicevision": lambda path: _block_and_points(read_alicevision(path)),
    "opensfm": lambda path: _block_and_points(read_opensfm(path)),
    "metashape-project": lambda path: _block_and_points(read_metashape_project(path)),
    "pix4d-params": lambda path: _block_and_points(read_pix4d_params(path)),
    "blocks-exchange": lambda path: _block_and_points(read_blocks_exchange(path)),
}
OrientedWriter = Callable[[OrientedBlock, Path], tuple[str, ...]]
WRITERS: Mapping[str, OrientedWriter] = {
    "bal": write_bal,
    "colmap": write_colmap,
    "colmap-text": lambda oriented, path: write_colmap(oriented, path, binary=False),
    "bundler": write_bundler,
    "opensfm": write_opensfm,
}
"""Formats of orientations and points, in coordinates in which rays are straight."""
ORIENTATION_WRITERS: Mapping[str, OrientedWriter] = {
    "metashape": write_metashape,
    "metashape-camera": write_metashape_camera,
    "metashape-xml": write_metashape_cameras,
    "blocks-exchange": write_blocks_exchange,
    "opk": write_metashape,
    "pix4d-eo": write_pix4d_eo,
    "ign": write_ign_opk,
    "patb": write_patb,
}
"""Formats of orientations in the coordinates of the block; they need no object points."""
BLOCK_WRITERS: Mapping[str, Callable[[Block, Path], tuple[str, ...]]] = {
    "bingo": write_bingo,
    "pix4d-gcp": write_pix4d_gcp,
    "pix4d-geo": write_pix4d_geo,
    "pix4d-offset": write_pix4d_offset,
    "odm-gcp": write_odm_gcp,
    "odm-geo": write_odm_geo,
    "ign-mes": write_ign_mes,
    "ign-app": write_ign_app,
}
"""Formats of what was measured."""
FOLDER_TARGETS: Mapping[str, tuple[str, ...]] = {
    "block": block_writer.OWN_ENTRIES,
    "colmap": colmap.OWN_ENTRIES,
    "colmap-text": colmap.OWN_ENTRIES,
    "bundler": (bundler.BUNDLE, bundler.LIST),
    "opensfm": (opensfm.RECONSTRUCTION, opensfm.TRACKS),
    "patb": patb.FILES,
}
"""Formats that are folders, with the files written there."""
UPDATERS: Mapping[str, OrientedWriter] = {"colmap": update_colmap, "opensfm": update_opensfm}
"""Projects that are brought to an orientation in place, and then go on in their own program."""
TARGETS = ("block", *WRITERS, *ORIENTATION_WRITERS, *BLOCK_WRITERS)


def detect_format(path: FilePath) -> str:
    """The name of the format a file or folder holds.

    Raises
    ------
    InputError
        When there is nothing, or it is none of those known.
    """
    path = Path(path)
    if not path.is_dir():
        regular_file(path)
    for name, recognises in RECOGNISERS.items():
        if recognises(path):
            return name
    raise InputError("is of no known format", f"known are {', '.join(RECOGNISERS)}; or name the format", path)


def read_any(path: FilePath, format: str | None = None) -> tuple[Block, np.ndarray | None]:
    """A block of any format that is read.

    Parameters
    ----------
    path : file or folder.
    format : a key of `READERS`; found out from the path when None.

    Returns
    -------
    block : the block.
    points : (N, 3) start values of the object points where the format has them, else None.

    Raises
    ------
    InputError
    """
    name = detect_format(path) if format is None else format
    if name not in READERS:
        raise InputError(f"'{name}' is not a format that is read", f"known are {', '.join(READERS)}")
    return READERS[name](Path(path))


def write_any(block: Block, path: FilePath, format: str = "block", points: np.ndarray | None = None) -> tuple[str, ...]:
    """Write a block in a format, at its start values where the format holds orientations.

    Parameters
    ----------
    path : file or folder to be.
    format : one of `TARGETS`.
    points : (N, 3) m, the object points for formats that hold them.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
    """
    if format == "block":
        write_block(block, path)
        return about_points(points)
    if format in BLOCK_WRITERS:
        return BLOCK_WRITERS[format](block, Path(path))
    if format not in TARGETS:
        raise _unknown(format)
    if points is None:
        if format in WRITERS:
            raise InputError(f"a {format} model needs object points", "adjust the block and export the result", path)
        points = np.full((len(block.points), 3), np.nan)
    return write_oriented(oriented_block(block, points), path, format)


def about_points(points: np.ndarray | None) -> tuple[str, ...]:
    """A block folder has no place for start values of object points (N, 3)."""
    return () if points is None else (left_behind("could not be carried over: start values of object points"),)


def write_oriented(
    oriented: OrientedBlock, path: FilePath, format: str, geoid: FilePath | None = None
) -> tuple[str, ...]:
    """Write orientations in a format that holds them; see `oriented_from_adjusted` for results.

    Formats with object points know no coordinate systems: a block with a CRS is written in its local frame.

    Parameters
    ----------
    geoid : grid for the heights of the block's CRS, where PROJ does not have it.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
    """
    if format in ORIENTATION_WRITERS:
        return ORIENTATION_WRITERS[format](oriented, Path(path))
    if format not in WRITERS:
        raise _unknown(format)
    if oriented.block.crs == "local":
        return WRITERS[format](oriented, Path(path))
    local, said = in_local_frame(oriented, geoid)
    return (*WRITERS[format](local, Path(path)), said)


def update_project(
    oriented: OrientedBlock, project: FilePath, format: str, geoid: FilePath | None = None
) -> tuple[str, ...]:
    """Bring the project that a block was read from to the block's orientation; it keeps everything else.

    Parameters
    ----------
    project : its folder. format : one of `UPDATERS`. geoid : see `write_oriented`.

    Returns
    -------
    What moved along unadjusted or could not be carried over, in words.

    Raises
    ------
    InputError
    """
    if format not in UPDATERS:
        raise InputError(f"a '{format}' is not brought up to date in place", f"possible are {', '.join(UPDATERS)}")
    if oriented.block.crs == "local":
        return UPDATERS[format](oriented, Path(project))
    origin = origin_of(project) if format == "opensfm" else None
    if origin is not None:
        return UPDATERS[format](in_axes_at(oriented, origin, geoid), Path(project))
    local, said = in_local_frame(oriented, geoid)
    return (*UPDATERS[format](local, Path(project)), said)


def _unknown(format: str) -> InputError:
    return InputError(f"'{format}' is not a format that is written", f"known are {', '.join(TARGETS)}")
