"""What was measured, written as the lists of other programs: IGN .mes and .app, ODM geo.txt, Pix4D's offset."""

from __future__ import annotations

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, px_from_mm
from aerotri.formats.assembly.losses import losses
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.text.text_lines import check_words
from aerotri.observations import Block

APP_CODE = 13
"""Code of a control point in .app files; what the codes mean is not published, the real files hold 3 and 13."""


def write_ign_mes(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write image points as ``point photo column row``.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When a name has a blank.
    """
    rays = block.image_points
    check_words(block.images.names, "photograph", ".mes")
    check_words(block.points[np.unique(rays.point)], "point", ".mes")
    px = np.empty_like(rays.xy)
    for number, camera in enumerate(block.cameras):
        own = block.images.camera[rays.image] == number
        px[own] = px_from_mm(rays.xy[own], camera.size_px, camera.pixel_mm)
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        for image, point, (column, row) in zip(rays.image.tolist(), rays.point.tolist(), px.tolist(), strict=True):
            file.write(f"{block.points[point]} {block.images.names[image]} {column:.6f} {row:.6f}\n")
    return losses(block, "image points")


def write_ign_app(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write control and check points as ``point code X Y Z``.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When there are none, or a name has a blank.
    """
    control = block.control
    rows = np.flatnonzero(np.isfinite(control.xyz).all(axis=1))
    if not len(rows):
        raise InputError(
            f"block '{block.name}' has no control points known in X, Y and Z",
            "add such points to control.csv, or write another format",
        )
    names = block.points[control.point[rows]]
    check_words(names, "point", ".app")
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        for name, xyz in zip(names.tolist(), control.xyz[rows].tolist(), strict=True):
            file.write(f'"{name}" {APP_CODE} ' + " ".join(f"{value:.4f}" for value in xyz) + "\n")
    checks, partial = int(control.is_check[rows].sum()), len(control) - len(rows)
    said = (
        (f"could not be carried over: {counted(partial, 'point')} with only plan position or height", partial),
        (f"{counted(checks, 'check point')} written like control points: the format does not tell them apart", checks),
    )
    return (*losses(block, "control", "check points"), *(words for words, count in said if count))


def write_odm_geo(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write geo.txt: observed positions with their accuracies; angles as nothing, which ODM reads as unknown.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When there are none, a name has a blank, or the block has no plane CRS.
    """
    if block.crs == "local" or "+" in block.crs:
        raise InputError(
            f"geo.txt needs a coordinate system EPSG:n, that of the block is '{block.crs}'",
            "bring the block into such a system, or write another format",
        )
    observed = block.gnss_ins
    rows = np.zeros(0, np.int64) if observed is None else np.flatnonzero(np.isfinite(observed.xyz).all(axis=1))
    if observed is None or not len(rows):
        raise InputError(
            f"block '{block.name}' has no observed positions", "add them in gnss_ins.csv, or write another format"
        )
    names = block.images.names[observed.image[rows]]
    check_words(names, "photograph", "geo.txt")
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"{block.crs}\n")
        for name, xyz, sigma in zip(names.tolist(), observed.xyz[rows].tolist(), observed.sigma[rows], strict=True):
            position = " ".join(f"{value:.6f}" for value in xyz)
            file.write(f"{name} {position} NaN NaN NaN {max(sigma[0], sigma[1]):.6f} {sigma[2]:.6f}\n")
    attitudes = int(np.isfinite(observed.angles).all(axis=1).sum())
    said = (f"could not be carried over: {counted(attitudes, 'observed attitude')}",) if attitudes else ()
    return (*losses(block, "gnss", "crs"), *said)


def write_pix4d_offset(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write the offset that belongs to the other Pix4D lists: zero, for they hold full coordinates."""
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        file.write("0.000 0.000 0.000\n")
    return ("the offset is zero: the lists written beside it hold full coordinates", *losses(block))
