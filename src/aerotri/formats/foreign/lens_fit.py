"""The lens of another basis that is nearest to a given one, and what it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import mm_from_px
from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.observations import Camera, Prior

GRID = 41, 31
"""Places over the format at which two lenses are compared, along the longer and the shorter side [C]."""
ROUNDS = 15
"""Gauss-Newton steps [C]: polynomials are linear and take one, a denominator a few."""
SMALLEST = 1e-12
"""Singular value, of the largest, below which combinations of terms are left at zero [C]: radial terms of high order
are nearly alike."""


@dataclass(frozen=True, eq=False)
class FittedLens:
    """A lens fitted to positions over the format.

    Parameters
    ----------
    parameters : (14,) in the order of `lens.COLUMNS`.
    rms_px, max_px : distance of the two lenses' image positions over the format, in pixels.
    """

    parameters: np.ndarray
    rms_px: float
    max_px: float

    @property
    def text(self) -> str:
        """The residual in words."""
        return f"RMS {self.rms_px:.2g} px, at most {self.max_px:.2g} px over the format"

    def values(self, names: Sequence[str]) -> dict[str, float]:
        """By name."""
        return {name: float(self.parameters[lens.ITEMS.index(name)]) for name in names}


def format_grid_px(size_px: tuple[int, int]) -> np.ndarray:
    """(n, 2) column and row of places all over the format, its border included."""
    counts = GRID if size_px[0] >= size_px[1] else GRID[::-1]
    column, row = (np.linspace(0.0, size, count) for size, count in zip(size_px, counts, strict=True))
    return np.stack(np.meshgrid(column, row), axis=-1).reshape(-1, 2)


def format_grid_mm(camera: Camera) -> np.ndarray:
    """(g, 2) mm, the same places in a camera's image coordinates."""
    return mm_from_px(format_grid_px(camera.size_px), camera.size_px, camera.pixel_mm)


def fitted_lens(
    ideal: np.ndarray, bent: np.ndarray, names: Sequence[str], fisheye: bool, focal_px: float
) -> FittedLens:
    """The lens with these items that takes ideal positions to distorted ones, by least squares.

    Parameters
    ----------
    ideal, bent : (n, 2) for c = 1; ideal in the projection of the camera.
    names : items that may differ from zero.
    """
    columns = [lens.ITEMS.index(name) for name in names]
    a, b = ideal.T
    parameters = lens.vector({}, fisheye)
    for _ in range(ROUNDS if columns else 0):
        design = lens.patterns(a, b, parameters)[:, :, columns].reshape(-1, len(columns))
        size = np.linalg.norm(design, axis=0)
        gap = (bent - lens.bend(a, b, parameters)).ravel()
        step = np.linalg.lstsq(design / size, gap, rcond=SMALLEST)[0] / size
        parameters[columns] += step
        if np.linalg.norm(step * size) <= 1e-14 * np.sqrt(len(bent)):
            break
    left = np.hypot(*(bent - lens.bend(a, b, parameters)).T) * focal_px
    return FittedLens(parameters, float(np.sqrt(np.mean(left**2))), float(left.max()))


def nearest_lens(camera: Camera, names: Sequence[str]) -> FittedLens:
    """The lens with these items only that is nearest to a camera's own, over its format; the affinity counts apart.

    Positions that the camera records nowhere stay out.
    """
    own = lens.vector_of(camera)
    own[[lens.ITEMS.index("b1"), lens.ITEMS.index("b2")]] = 0.0
    bent = (format_grid_mm(camera) - np.array(camera.principal_point_mm)) / camera.focal_length_mm
    return _nearest(camera, lens.unbend(bent, own), bent, names)


def nearest_of_all(camera: Camera, names: Sequence[str], errors: np.ndarray | None = None) -> FittedLens:
    """The lens with these items only that is nearest to everything a camera does: lens, affinity, Brown's parameters.

    Parameters
    ----------
    names : items that may differ from zero.
    errors : (g, 2) mm, further image errors at `format_grid_mm`, measured = ideal + error.
    """
    c, bar = camera.focal_length_mm, format_grid_mm(camera) - np.array(camera.principal_point_mm)
    values = np.array([camera.brown[name].value if name in camera.brown else 0.0 for name in brown.ITEMS])
    free = bar - brown.image_error(bar[:, 0], bar[:, 1], values)
    ideal = lens.unbend((free if errors is None else free - errors) / c, lens.vector_of(camera))
    return _nearest(camera, ideal, bar / c, names)


def fitted_camera(
    camera: Camera, names: Sequence[str], errors: np.ndarray | None, program: str
) -> tuple[Camera, tuple[str, ...]]:
    """The camera with the nearest of a program's lenses in place of lens and additional parameters.

    Parameters
    ----------
    names, errors : see `nearest_of_all`. program : its name.

    Returns
    -------
    camera : without Brown's parameters, its lens held.
    said : what was fitted and what that leaves, in words.
    """
    best = nearest_of_all(camera, names, errors)
    fitted = {name: Prior(value, fixed=True) for name, value in best.values(names).items()}
    what = "its lens" if errors is None or not errors.any() else "its additional parameters"
    said = f"camera '{camera.name}': {program} has no words for {what}; the nearest lens is written, {best.text}"
    return replace(camera, lens=fitted, brown={}, parameters={}), (said,)


def expressible_camera(
    camera: Camera, names: Sequence[str], errors: np.ndarray | None, program: str
) -> tuple[Camera, tuple[str, ...]]:
    """The camera as it is where a program has words for all that it does, else the nearest, and what was fitted.

    Parameters
    ----------
    names, errors : see `nearest_of_all`. program : its name.
    """
    used = {name for name, prior in camera.lens.items() if prior.value}
    bent = any(prior.value for prior in camera.brown.values()) or (errors is not None and bool(errors.any()))
    return (camera, ()) if used <= set(names) and not bent else fitted_camera(camera, names, errors, program)


def _nearest(camera: Camera, ideal: np.ndarray, bent: np.ndarray, names: Sequence[str]) -> FittedLens:
    there = np.isfinite(ideal).all(axis=1)
    focal_px = camera.focal_length_mm / camera.pixel_mm
    return fitted_lens(ideal[there], bent[there], names, camera.is_fisheye, focal_px)
