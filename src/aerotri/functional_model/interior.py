"""Interior orientation of scanned film: from pixels to the calibrated image plane by the fiducial marks.

The measured pixel position p = (column, row) of every mark is mapped to its calibrated position in mm. With pixels
reduced and scaled, (u, v) = ((column − column₀)/s, −(row − row₀)/s), v upwards [L]:

- similarity: x = a0 + a1·u − b1·v, y = b0 + b1·u + a1·v
- affine: x = a0 + a1·u + a2·v, y = b0 + b1·u + b2·v
- projective: the affine numerators over 1 + c1·u + c2·v

Least squares on the calibrated side: residuals v = transformed − calibrated, in mm, of equal weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError

PARAMETER_NAMES = {
    "similarity": ("a0", "b0", "a1", "b1"),
    "affine": ("a0", "a1", "a2", "b0", "b1", "b2"),
    "projective": ("a0", "a1", "a2", "b0", "b1", "b2", "c1", "c2"),
}
MARKS_NEEDED = {"similarity": 2, "affine": 3, "projective": 4}
"""Fiducial marks of two coordinates each that determine 4, 6 and 8 parameters."""
WEAKEST = 0.01
"""Smallest singular value of the scaled design, relative to the largest, below which the marks do not determine it."""
MAX_ITERATIONS = 20
"""[C] A projective transformation starts from the affine one and takes a few; the bound ends marks that do not fit at
all."""


@dataclass(frozen=True, eq=False)
class FiducialFit:
    """The interior orientation of one scan from k marks.

    Parameters
    ----------
    kind : 'similarity', 'affine' or 'projective'.
    parameters : (p,) in the order of `PARAMETER_NAMES`; a and b in mm, c dimensionless.
    cofactor : (p, p), without σ0².
    origin_px : (2,) column₀, row₀; scale_px : s.
    residuals : (k, 2) mm, transformed − calibrated.
    redundancy_numbers : (k, 2).
    sigma0_mm : standard deviation of a coordinate of a mark from the residuals, mm; NaN without redundancy.
    """

    kind: str
    parameters: np.ndarray
    cofactor: np.ndarray
    origin_px: np.ndarray
    scale_px: float
    residuals: np.ndarray
    redundancy_numbers: np.ndarray
    sigma0_mm: float

    @property
    def names(self) -> tuple[str, ...]:
        return PARAMETER_NAMES[self.kind]

    @property
    def redundancy(self) -> int:
        """Observations minus unknowns."""
        return self.residuals.size - len(self.parameters)

    @property
    def sigma(self) -> np.ndarray:
        """(p,) σ of the parameters for the reduced pixels, σ̂0 included; NaN without redundancy."""
        return self.sigma0_mm * np.sqrt(np.diagonal(self.cofactor))

    @property
    def pixel_mm(self) -> float:
        """Mean size of a pixel, the root of its area, at the middle of the marks, mm."""
        slope = _by_position(self.kind, self.parameters, np.zeros((1, 2)))[0] / self.scale_px
        return float(np.sqrt(np.abs(np.linalg.det(slope))))


def fit_fiducials(column_row: np.ndarray, calibrated_mm: np.ndarray, kind: str, image: str = "") -> FiducialFit:
    """Interior orientation of one scan.

    Parameters
    ----------
    column_row : (k, 2) px, measured positions of the marks.
    calibrated_mm : (k, 2) mm, calibrated positions of the same marks.
    kind : 'similarity' (4 parameters), 'affine' (6) or 'projective' (8).
    image : name of the photograph, for messages.

    Raises
    ------
    InputError
        When there are too few marks, or they lie so that they do not determine the transformation.
    """
    column_row, calibrated = np.asarray(column_row, dtype=float), np.asarray(calibrated_mm, dtype=float)
    if kind not in MARKS_NEEDED:
        raise InputError(
            f"interior_orientation '{kind}' is not known", f"use one of {', '.join(MARKS_NEEDED)}", file="block.toml"
        )
    _check_marks(column_row, calibrated, kind, image)
    origin = column_row.mean(axis=0)
    scale = float(np.sqrt(np.mean(np.sum((column_row - origin) ** 2, axis=1)) / 2.0)) or 1.0
    position = _reduced(column_row, origin, scale)
    parameters = _affine_start(position, calibrated) if kind == "projective" else np.zeros(len(PARAMETER_NAMES[kind]))
    size = np.ones(len(parameters))
    size[6:] = np.sqrt(np.mean(calibrated**2))
    for _ in range(MAX_ITERATIONS):
        value, design = _transform(kind, parameters, position), _design(kind, parameters, position)
        step = _solve(design, (calibrated - value).ravel(), size, kind, image)
        parameters = parameters + step
        if kind != "projective" or np.abs(step).max() < 1e-12 * np.abs(parameters).max():
            break
    else:
        raise _undetermined(kind, image, "the projective transformation does not converge on them")
    design = _design(kind, parameters, position)
    cofactor = np.linalg.inv(design.T @ design)
    residuals = _transform(kind, parameters, position) - calibrated
    redundancy = residuals.size - len(parameters)
    return FiducialFit(
        kind=kind,
        parameters=parameters,
        cofactor=cofactor,
        origin_px=origin,
        scale_px=scale,
        residuals=residuals,
        redundancy_numbers=1.0 - np.einsum("ij,jk,ik->i", design, cofactor, design).reshape(-1, 2),
        sigma0_mm=float(np.sqrt(np.sum(residuals**2) / redundancy)) if redundancy > 0 else np.nan,
    )


def mm_from_scan(fit: FiducialFit, column_row: np.ndarray) -> np.ndarray:
    """Image coordinates of pixel positions.

    Parameters
    ----------
    column_row : (n, 2) px.

    Returns
    -------
    (n, 2) mm in the frame of the calibrated marks.
    """
    return _transform(fit.kind, fit.parameters, _reduced(np.asarray(column_row, float), fit.origin_px, fit.scale_px))


def scan_positions(fit: FiducialFit, xy: np.ndarray) -> np.ndarray:
    """Where image coordinates lie in the scan.

    Parameters
    ----------
    xy : (n, 2) mm in the frame of the calibrated marks.

    Returns
    -------
    (n, 2) px.
    """
    if fit.kind == "similarity":
        a0, b0, a1, b1 = fit.parameters
        forward = np.array([[a1, -b1, a0], [b1, a1, b0], [0.0, 0.0, 1.0]])
    else:
        a0, a1, a2, b0, b1, b2 = fit.parameters[:6]
        last = fit.parameters[6:] if fit.kind == "projective" else np.zeros(2)
        forward = np.array([[a1, a2, a0], [b1, b2, b0], [*last, 1.0]])
    back = np.column_stack([xy, np.ones(len(xy))]) @ np.linalg.inv(forward).T
    return back[:, :2] / back[:, 2:] * fit.scale_px * [1.0, -1.0] + fit.origin_px


def measurement_sigma(fit: FiducialFit, column_row: np.ndarray, sigma_px: np.ndarray | float) -> np.ndarray:
    """σ of image coordinates from the σ of their measurement alone: what weighs a ray.

    Parameters
    ----------
    column_row : (n, 2) px. sigma_px : (n, 2) or (2,) or scalar, of column and row, independent.

    Returns
    -------
    (n, 2) mm.
    """
    position = _reduced(np.asarray(column_row, float), fit.origin_px, fit.scale_px)
    by_px = _by_position(fit.kind, fit.parameters, position) / fit.scale_px
    variance = np.broadcast_to(np.asarray(sigma_px, dtype=float) ** 2, position.shape)
    return np.sqrt(np.einsum("nij,nj->ni", by_px**2, variance))


def transformation_sigma(fit: FiducialFit, column_row: np.ndarray) -> np.ndarray:
    """σ of image coordinates from the fit of the marks: common to all points of a photograph, so never their weight.

    Returns
    -------
    (n, 2) mm, NaN without redundancy.
    """
    position = _reduced(np.asarray(column_row, float), fit.origin_px, fit.scale_px)
    design = _design(fit.kind, fit.parameters, position)
    return fit.sigma0_mm * np.sqrt(np.einsum("ij,jk,ik->i", design, fit.cofactor, design).reshape(-1, 2))


def _check_marks(column_row: np.ndarray, calibrated: np.ndarray, kind: str, image: str) -> None:
    of_image = f" of photograph {image}" if image else ""
    needed = MARKS_NEEDED[kind]
    if len(column_row) < needed:
        raise InputError(
            f"{len(column_row)} fiducial marks{of_image} give no {kind} interior orientation, which takes {needed}",
            "measure more marks, or choose an interior orientation with fewer parameters",
            file="fiducials.csv",
        )
    if not (np.isfinite(column_row).all() and np.isfinite(calibrated).all()):
        raise InputError(
            f"a coordinate of a fiducial mark{of_image} is not a number",
            "measure the mark again, or remove its row",
            file="fiducials.csv",
        )


def _undetermined(kind: str, image: str, why: str) -> InputError:
    of_image = f" of photograph {image}" if image else ""
    return InputError(
        f"the fiducial marks{of_image} do not determine a {kind} interior orientation: {why}",
        "measure marks all around the image, or choose an interior orientation with fewer parameters",
        file="fiducials.csv",
    )


def _reduced(column_row: np.ndarray, origin: np.ndarray, scale: float) -> np.ndarray:
    return (column_row - origin) * [1.0, -1.0] / scale


def _affine_start(position: np.ndarray, calibrated: np.ndarray) -> np.ndarray:
    columns = np.column_stack([np.ones(len(position)), position])
    solved = np.linalg.lstsq(columns, calibrated, rcond=None)[0]
    return np.concatenate([solved[:, 0], solved[:, 1], [0.0, 0.0]])


def _solve(design: np.ndarray, right: np.ndarray, size: np.ndarray, kind: str, image: str) -> np.ndarray:
    """Least squares step. A weak design is an error, judged with columns divided by `size`, the unit of a parameter.

    Columns of equal length would hide marks on a line parallel to an axis.
    """
    u, singular, vt = np.linalg.svd(design / size, full_matrices=False)
    if not singular[-1] >= WEAKEST * singular[0]:
        raise _undetermined(kind, image, "they coincide or lie too near to a straight line")
    return vt.T @ (u.T @ right / singular) / size


def _transform(kind: str, parameters: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(n, 2) mm of (n, 2) reduced positions."""
    u, v = position.T
    if kind == "similarity":
        a0, b0, a1, b1 = parameters
        return np.column_stack([a0 + a1 * u - b1 * v, b0 + b1 * u + a1 * v])
    a0, a1, a2, b0, b1, b2 = parameters[:6]
    c1, c2 = parameters[6:] if kind == "projective" else (0.0, 0.0)
    return np.column_stack([a0 + a1 * u + a2 * v, b0 + b1 * u + b2 * v]) / (1.0 + c1 * u + c2 * v)[:, None]


def _design(kind: str, parameters: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(2n, p) partials by the parameters, rows x and y of the first mark, then of the next."""
    u, v = position.T
    one, zero = np.ones_like(u), np.zeros_like(u)
    if kind == "similarity":
        rows = [[one, zero, u, -v], [zero, one, v, u]]
        return np.array(rows).transpose(2, 0, 1).reshape(-1, 4)
    rows = np.array([[one, u, v, zero, zero, zero], [zero, zero, zero, one, u, v]]).transpose(2, 0, 1)
    if kind == "affine":
        return rows.reshape(-1, 6)
    below = (1.0 + parameters[6] * u + parameters[7] * v)[:, None, None]
    value = _transform(kind, parameters, position)
    by_c = -value[:, :, None] * position[:, None, :]
    return (np.concatenate([rows, by_c], axis=2) / below).reshape(-1, 8)


def _by_position(kind: str, parameters: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(n, 2, 2) partials of x, y by u, v; signs of v do not matter to the σ taken from them."""
    if kind == "similarity":
        _, _, a1, b1 = parameters
        return np.broadcast_to(np.array([[a1, -b1], [b1, a1]]), (len(position), 2, 2))
    linear = np.array([parameters[1:3], parameters[4:6]])
    if kind == "affine":
        return np.broadcast_to(linear, (len(position), 2, 2))
    c = parameters[6:]
    below = (1.0 + position @ c)[:, None, None]
    return (linear - _transform(kind, parameters, position)[:, :, None] * c) / below
