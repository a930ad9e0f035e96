"""What Pix4Dmapper states in the folder params of its first step.

..._external_camera_parameters_error.txt has X_uncertainty … Kappa_uncertainty of every photograph, m and degrees;
..._point_uncertainties.csv x, y, z, sx, sy, sz of tie points without names, m, coordinates rounded to centimetres;
..._correlations_internals.csv the correlations of F, C0_x, C0_y, R1, R2, R3, T1, T2 of every camera. The vendor
names the files, calls them experimental, and does not say more about them: that the numbers are standard deviations
follows from the names and from the report of quality, which shows the same as "Absolute camera position and
orientation uncertainties".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from league_programs.stated import Stated, bare

COLUMNS = ("X_uncertainty", "Y_uncertainty", "Z_uncertainty", "Omega_uncertainty", "Phi_uncertainty",
           "Kappa_uncertainty")  # fmt: skip


def stated(folder: Path) -> Stated:
    """σ of the files of a folder."""
    photographs = _photographs(next(folder.glob("*external_camera_parameters_error.txt")))
    points = list(folder.glob("*point_uncertainties.csv"))
    nameless = np.loadtxt(points[0], delimiter=",", skiprows=1) if points else None
    return Stated("Pix4D", photographs=photographs, nameless=nameless)


def _photographs(file: Path) -> dict[str, np.ndarray]:
    head, *lines = file.read_text(encoding="utf-8").splitlines()
    place = [head.split(", ").index(name) for name in COLUMNS]
    rows = [line.split(", ") for line in lines if line.strip()]
    return {bare(row[0]): np.array([float(row[k]) for k in place]) for row in rows}


def correlations(folder: Path) -> list[tuple[str, list[str], np.ndarray]]:
    """Camera, names and matrix of the correlations of every camera."""
    lines = next(folder.glob("*correlations_internals.csv")).read_text(encoding="utf-8").splitlines()
    out = []
    for k in np.flatnonzero([line.startswith("F,") for line in lines]).tolist():
        names = lines[k].split(",")
        rows = [[float(cell) for cell in line.split(",")] for line in lines[k + 1 : k + 1 + len(names)]]
        out.append((lines[k - 2], names, np.array(rows)))
    return out


def matched(nameless: np.ndarray, xyz: np.ndarray, names: np.ndarray, nearest_m: float) -> dict[str, np.ndarray]:
    """σ of points by our names: each the other's nearest point, and no farther than that.

    Parameters
    ----------
    nameless : (k, 6). xyz : (N, 3) m, ours. names : (N,).
    """
    known = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    theirs, ours = cKDTree(nameless[:, :3]), cKDTree(xyz[known])
    apart, partner = theirs.query(xyz[known])
    back = ours.query(nameless[:, :3])[1]
    mutual = (back[partner] == np.arange(len(known))) & (apart < nearest_m)
    return {str(names[known[k]]): nameless[partner[k], 3:] for k in np.flatnonzero(mutual)}
