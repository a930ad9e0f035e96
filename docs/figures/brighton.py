"""Draw the picture of the README of 18 photographs of a drone: `python docs/figures/brighton.py DSM ORTHO`.

DSM is the folder of `aerotri dsm` of Brighton's photographs (see the page "Real blocks"), ORTHO that of
`aerotri ortho --fill 4` over it. Surface, σ of its heights by matching, and orthophoto lie side by side on one scale.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import matplotlib
import numpy as np
import rasterio
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image
from rasterio.enums import Resampling
from rasterio.windows import Window, from_bounds
from scipy.ndimage import gaussian_filter

TARGET = Path(__file__).resolve().parents[1] / "start" / "figures" / "brighton.jpg"
PARK = (576_672.0, 5_188_116.0, 576_740.0, 5_188_200.0)
"""Left, bottom, right, top, m, of what is shown."""
PANEL, GAP, TOP, BOTTOM = 2.3, 0.12, 0.42, 0.62
"""Inches: width of a panel, between panels, above and below them."""
CELL, LARGEST_CM, BAR_M = 0.12, 4.0, 20.0
"""m, of a cell that is drawn; σ that is drawn black; length of the scale bar, m."""
INK, DPI, QUALITY = "#1c242c", 180, 84
TONES = ListedColormap(colormaps["Greys"](np.linspace(0.12, 1.0, 256)).tolist())
"""Of σ: none is white, which holes are."""


def part(path: Path, bands: list[int], resampling: Resampling) -> np.ndarray:
    """(bands, rows, columns) of what is shown, NaN where there is nothing."""
    left, bottom, right, top = PARK
    shape = len(bands), round((top - bottom) / CELL), round((right - left) / CELL)
    with rasterio.open(path) as file:
        window: Window = from_bounds(left, bottom, right, top, file.transform)
        found = file.read(bands, window=window, out_shape=shape, resampling=resampling, boundless=True, masked=True)
    return found.astype(float).filled(np.nan)


def shaded(z: np.ndarray) -> np.ndarray:
    """Heights lit from the north-west, white where there are none."""
    known = np.isfinite(z)
    weight = gaussian_filter(known.astype(float), 1.0)
    level = np.nanmedian(z)
    smooth = gaussian_filter(np.where(known, z - level, 0.0), 1.0) / np.maximum(weight, 1e-6)
    lit = LightSource(315, 45).hillshade(smooth, vert_exag=3.0, dx=CELL, dy=CELL)
    return np.where(known, lit, np.nan)


def panel(figure: Figure, number: int, title: str) -> Axes:
    """One of three maps, without coordinates."""
    width, height = figure.get_size_inches()
    left = GAP + number * (PANEL + GAP)
    axes = figure.add_axes((left / width, BOTTOM / height, PANEL / width, 1.0 - (TOP + BOTTOM) / height))
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(title, fontsize=11, color=INK, pad=6)
    return axes


def scale_bar(axes: Axes, height: float) -> None:
    """A length on the ground, below a map; height : inches of the map."""
    along, below = BAR_M / (PARK[2] - PARK[0]), -0.16 / height
    axes.add_patch(
        Rectangle((0.0, below), along, 0.05 / height, transform=axes.transAxes, clip_on=False, color=INK, lw=0)
    )
    axes.text(along + 0.03, below + 0.025 / height, f"{BAR_M:g} m; north is up", transform=axes.transAxes, fontsize=11,
              va="center", color=INK)  # fmt: skip


def draw(dsm: Path, ortho: Path) -> Figure:
    """The three maps."""
    height = PANEL * (PARK[3] - PARK[1]) / (PARK[2] - PARK[0])
    figure = Figure(figsize=(3 * PANEL + 4 * GAP, height + TOP + BOTTOM), facecolor="white")
    surface = panel(figure, 0, "surface")
    (z,) = part(dsm / "dsm.tif", [1], Resampling.nearest)
    surface.imshow(shaded(z), cmap="gray", vmin=0.0, vmax=1.0, aspect="auto")
    scale_bar(surface, height)
    spread = panel(figure, 1, "σ of heights (matching) [cm]")
    (sigma,) = part(dsm / "matching.tif", [1], Resampling.nearest)
    image = spread.imshow(100.0 * sigma, cmap=TONES, vmin=0.0, vmax=LARGEST_CM, aspect="auto")
    box, high = spread.get_position(), figure.get_size_inches()[1]
    bar = figure.add_axes((box.x0, box.y0 - 0.2 / high, box.width, 0.1 / high))
    scale = figure.colorbar(image, cax=bar, orientation="horizontal")
    ticks = np.arange(0.0, LARGEST_CM + 1.0)
    scale.set_ticks(ticks.tolist(), labels=[f"{k:g}" if k < LARGEST_CM else f"≥ {k:g}" for k in ticks])
    scale.ax.tick_params(labelsize=11, length=2, colors=INK)
    picture = panel(figure, 2, "orthophoto")
    bands = part(ortho / "ortho.tif", [1, 2, 3, 4], Resampling.average)
    there = bands[3] > 0
    low, high_end = np.percentile(bands[:3][:, there], [0.5, 99.5])
    shown = np.where(there, np.clip((bands[:3] - low) / (high_end - low), 0.0, 1.0), 1.0)
    picture.imshow(np.moveaxis(shown, 0, -1), aspect="auto")
    return figure


def main(dsm: Path, ortho: Path) -> None:
    """Write the picture."""
    content = io.BytesIO()
    with matplotlib.rc_context({"font.family": "DejaVu Sans"}):
        draw(dsm, ortho).savefig(content, dpi=DPI)
    Image.open(content).convert("RGB").save(TARGET, quality=QUALITY, optimize=True)


if __name__ == "__main__":
    main(*(Path(word) for word in sys.argv[1:3]))
