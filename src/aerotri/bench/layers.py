"""Surfaces and orthophotos below the plan, as pictures: heights by slope and light, colours as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.bench.pictures import as_jpeg
from aerotri.conventions import InputError
from aerotri.rasters.mosaics import bounds_of, read_heights, read_mosaic

LONGEST_PX = 3000
"""Longest side of the picture [C]: more than a screen shows."""
BESIDE = ("ortho/ortho.tif", "dsm/dsm.tif", "dtm/dsm.tif")
"""Rasters of `aerotri run` beside its result."""
RECORD = "run.json"
SUN = np.array([-1.0, 1.0, 1.2]) / np.linalg.norm([-1.0, 1.0, 1.2])
"""Direction to the light: from the northwest, as on maps."""
PALE = 255


@dataclass(frozen=True)
class Layer:
    """A raster.

    Parameters
    ----------
    path : of the file. bounds : left, bottom, right, top in the CRS, m.
    """

    path: Path
    bounds: tuple[float, float, float, float]


def open_layer(path: Path) -> Layer:
    """A raster that is drawn below the plan.

    Raises
    ------
    InputError
        When it is none, or has no place.
    """
    return Layer(path, bounds_of(path))


def names_of(layers: Sequence[Layer]) -> list[str]:
    """Names of the files; with their folders where two have one name."""
    names = [one.path.name for one in layers]
    return [
        name if names.count(name) == 1 else f"{one.path.parent.name}/{name}"
        for one, name in zip(layers, names, strict=True)
    ]


def layers_beside(result: Path | None) -> list[Path]:
    """Rasters of the project of `aerotri run` that a result belongs to."""
    if result is None or not (result.parent / RECORD).is_file():
        return []
    return [result.parent / name for name in BESIDE if (result.parent / name).is_file()]


def layer_picture(layer: Layer) -> bytes:
    """The raster as JPEG; white where nothing is known.

    Raises
    ------
    InputError
    """
    values = read_mosaic(layer.path, longest=LONGEST_PX)
    left, bottom, right, top = layer.bounds
    cell = (right - left) / values.shape[2], (top - bottom) / values.shape[1]
    if values.dtype.kind == "f":
        return as_jpeg(_shaded(read_heights(layer.path, LONGEST_PX), cell))
    if values.dtype != np.uint8:
        raise InputError("has neither heights nor colours of 8 bits", "give a surface or an orthophoto", layer.path)
    has_mask = len(values) in (2, 4)
    colours = np.moveaxis(values[:3] if len(values) >= 3 else np.repeat(values[:1], 3, axis=0), 0, 2).copy()
    if has_mask:
        colours[values[-1] == 0] = PALE
    return as_jpeg(colours)


def _shaded(heights: np.ndarray, cell: tuple[float, float]) -> np.ndarray:
    """(rows, columns, 3) light on a slope, tinted by height."""
    z, known = heights, np.isfinite(heights)
    by_row, by_column = np.gradient(z, cell[1], cell[0])
    normal = np.stack([-by_column, by_row, np.ones_like(z)]) / np.sqrt(1.0 + by_row**2 + by_column**2)
    light = np.clip(np.einsum("i,ijk->jk", SUN, normal), 0.0, 1.0)
    low, high = np.nanpercentile(z, [2, 98]) if known.any() else (0.0, 1.0)
    share = np.clip((z - low) / max(high - low, 1e-9), 0.0, 1.0)
    tint = np.stack([0.75 + 0.25 * share, 0.85 + 0.05 * share, 0.75 - 0.1 * share], axis=2)
    shown = np.nan_to_num(255.0 * (0.35 + 0.65 * light)[:, :, None] * tint, nan=PALE)
    return np.clip(shown, 0, 255).astype(np.uint8)
