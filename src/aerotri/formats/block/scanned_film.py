"""Scanned film in a block folder: fiducials.csv, and image points between pixels of the scan and mm of the image plane.

In the folder the image points of scanned photographs are pixel positions of the scan, as measured, with σ in pixels; in
a `Block` they are mm in the frame of the calibrated fiducial marks, and `Block.interior_fits` is the way between.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.text.csv_text import is_blank
from aerotri.formats.text.table_checks import image_index, refuse_duplicates
from aerotri.formats.text.tables import Columns, Table, read_table
from aerotri.functional_model.interior import FiducialFit, fit_fiducials, measurement_sigma, mm_from_scan
from aerotri.observations import Block, Camera, Images
from aerotri.observations.block import Fiducials

FIDUCIAL_COLUMNS = Columns(text=("image", "fiducial"), numbers=("column", "row"))
SINGULAR = 1e-6
"""Relative size of a singular value from which σ along the rows and columns of a turned scan cannot be told apart."""


def read_fiducials(
    path: Path | None, images: Images, cameras: tuple[Camera, ...]
) -> tuple[Fiducials | None, dict[int, FiducialFit]]:
    """Measured fiducial marks and the interior orientation of every photograph that has them.

    Raises
    ------
    InputError
        With the line: a photograph or mark that is not known, a camera without calibrated marks or without the kind
        of its interior orientation, a mark measured twice, too few marks.
    """
    if path is None or is_blank(path):
        return None, {}
    table = read_table(path, FIDUCIAL_COLUMNS)
    if not table.length:
        return None, {}
    table.require("image", "fiducial", "column", "row")
    image, name = image_index(table, images), table.text["fiducial"].rows()
    calibrated = np.array([_calibrated(table, row, cameras[images.camera[image[row]]]) for row in range(len(image))])
    refuse_duplicates(
        table,
        image * len(table.text["fiducial"].names) + table.text["fiducial"].index,
        lambda row: f"fiducial '{name[row]}' of photograph '{table.cell('image', row)}'",
    )
    fiducials = Fiducials(image, name, table.stack("column", "row"))
    fits = {}
    for number in np.unique(image).tolist():
        rows = np.flatnonzero(image == number)
        kind = str(cameras[images.camera[number]].interior_orientation)
        try:
            fits[number] = fit_fiducials(fiducials.column_row[rows], calibrated[rows], kind, str(images.names[number]))
        except InputError as error:
            raise table.error(int(rows[0]), error.message, error.remedy) from error
    return fiducials, fits


def _calibrated(table: Table, row: int, camera: Camera) -> tuple[float, float]:
    name = table.cell("fiducial", row)
    if not camera.fiducials or camera.interior_orientation is None:
        raise table.error(
            row,
            f"camera '{camera.name}' has no calibrated fiducials, or no interior_orientation",
            f"add [camera.{camera.name}.fiducials] and interior_orientation to block.toml",
        )
    if name not in camera.fiducials:
        known = ", ".join(camera.fiducials)
        raise table.error(row, f"camera '{camera.name}' has no fiducial '{name}'", f"it has {known}")
    return camera.fiducials[name]


def refuse_unfitted(table: Table, image: np.ndarray, images: Images, fits: Mapping[int, FiducialFit]) -> None:
    """Refuse image points of a scan without fiducials beside others of the same camera that have them.

    Parameters
    ----------
    table : of image points; image : (m,) photograph of every row.

    Raises
    ------
    InputError
        At the first such image point.
    """
    fitted = np.zeros(len(images), bool)
    fitted[list(fits)] = True
    scanned = np.isin(images.camera, np.unique(images.camera[fitted]))
    rows = np.flatnonzero((scanned & ~fitted)[image])
    if len(rows):
        row = int(rows[0])
        raise table.error(
            row,
            f"photograph '{table.cell('image', row)}' has no fiducials, others of its camera have",
            "measure them: rows in fiducials.csv",
        )


def of_scans(
    table: Table, image: np.ndarray, fits: Mapping[int, FiducialFit], xy: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Image points of a table with those of scanned photographs brought to mm by their interior orientation.

    Parameters
    ----------
    table : of image points in px; image : (m,) photograph of every row.
    xy, sigma : (m, 2) mm, right for photographs that are not scanned; σ also where the table gives none.

    Returns
    -------
    xy, sigma : (m, 2) mm.
    """
    px, given = table.stack("x", "y"), table.stack("sx", "sy")
    xy, sigma = xy.copy(), sigma.copy()
    for number, fit in fits.items():
        own = np.flatnonzero(image == number)
        if len(own):
            xy[own] = mm_from_scan(fit, px[own])
            # a σ that the table does not give is the block's own, in µm
            stated = measurement_sigma(fit, px[own], np.where(np.isnan(given[own]), 0.0, given[own]))
            sigma[own] = np.where(np.isnan(given[own]), sigma[own], stated)
    return xy, sigma


def scan_from_mm(fit: FiducialFit, xy: np.ndarray) -> np.ndarray:
    """Pixel positions of image coordinates; the inverse of `functional_model.interior.mm_from_scan`.

    Parameters
    ----------
    xy : (n, 2) mm.

    Returns
    -------
    (n, 2) px, column and row.
    """
    forward = np.linalg.inv(_homogeneous(fit))
    u, v, w = forward @ np.vstack([np.asarray(xy, dtype=float).T, np.ones(len(xy))])
    return np.column_stack([u / w, -v / w]) * fit.scale_px + fit.origin_px


def _homogeneous(fit: FiducialFit) -> np.ndarray:
    """(3, 3) from reduced pixel positions (u, v, 1) to image coordinates times a factor."""
    p = fit.parameters
    if fit.kind == "similarity":
        a0, b0, a1, b1 = p
        return np.array([[a1, -b1, a0], [b1, a1, b0], [0.0, 0.0, 1.0]])
    c1, c2 = p[6:] if fit.kind == "projective" else (0.0, 0.0)
    return np.array([[p[1], p[2], p[0]], [p[4], p[5], p[3]], [c1, c2, 1.0]])


def sigma_px_from_mm(fit: FiducialFit, column_row: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """σ in pixels that `measurement_sigma` makes these σ in mm of.

    Parameters
    ----------
    column_row : (n, 2) px. sigma : (n, 2) mm.

    Returns
    -------
    (n, 2) px, of column and row; equal to each other where the scan is turned by 45°, which cannot tell them apart.
    """
    by_px = np.stack([measurement_sigma(fit, column_row, np.eye(2)[k]) ** 2 for k in range(2)], axis=2)
    solved = np.linalg.pinv(by_px, rcond=SINGULAR) @ (np.asarray(sigma) ** 2)[:, :, None]
    return np.sqrt(np.maximum(solved[:, :, 0], 0.0))


def measured_px(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """Image points of a block with scanned film as the folder has them: position and σ, each (m, 2) px."""
    rays = block.image_points
    xy, sigma = np.empty_like(rays.xy), np.empty_like(rays.sigma)
    of_camera = block.images.camera[rays.image]
    for number, camera in enumerate(block.cameras):
        own = of_camera == number
        xy[own] = px_from_mm(rays.xy[own], camera.size_px, camera.pixel_mm)
        sigma[own] = rays.sigma[own] / camera.pixel_mm
    for number, fit in block.interior_fits.items():
        own = rays.image == number
        if own.any():
            xy[own] = scan_from_mm(fit, rays.xy[own])
            sigma[own] = sigma_px_from_mm(fit, xy[own], rays.sigma[own])
    return xy, sigma
