"""What a dense surface has beside the walls of a house: a section through rendered ground of known height.

A flight over level ground with a house is rendered and measured with its true orientation, so that only the matching
errs. Drawn are the true heights, those of the cells with two σ of matching, and σ from above.

Example: python docs/figures/steps.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

import aerotri

FIGURE = Path(__file__).resolve().parents[2] / "docs" / "theory" / "figures" / "steps.png"
GROUND, HOUSE = 50.0, (0.0, 0.0, 24.0, 16.0, 8.0)
"""m; X and Y of its middle, length along X, width and height of the house."""
SPEC = {
    "name": "steps",
    "camera": {"cam": {"size_px": [800, 600], "pixel_um": 30.0, "focal_length_mm": 30.0}},
    "flight": {"gsd_m": 0.25, "strips": 2, "images_per_strip": 4, "end_lap": 0.75, "side_lap": 0.6},
    "terrain": {"kind": "flat", "height_m": GROUND, "houses": [list(HOUSE)]},
    "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 0.0, "stated_sigma_um": 1.0},
    "control": {"distance_bases": 1.0, "sigma_m": [0.0] * 3, "stated_sigma_m": [0.01] * 3},
}  # fmt: skip
REACH = 24.0
"""m, of the section to either side of the middle of the house."""


def measured() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """X and Y of columns and rows, heights over the ground and σ of matching (rows, columns), m, about the house."""
    flight = aerotri.simulate(SPEC, 3)
    with tempfile.TemporaryDirectory() as folder:
        flight.save(Path(folder) / "flown", photographs=True, contrast=0.25)
        result = aerotri.adjust(flight.block, explain=False)
        # its tiles last as long as it does
        surface = aerotri.dense_surface(result, Path(folder) / "flown" / "photographs")
        found = surface.record
        grid = found.grid
        z, sigma = (np.full((grid.rows, grid.columns), np.nan) for _ in range(2))
        for window, tile in found.files.read_all(list(found.windows)):
            place = np.s_[window.row : window.row + window.rows, window.column : window.column + window.columns]
            z[place], sigma[place] = tile.z, tile.sigma
    x, y = grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows))
    columns, rows = np.flatnonzero(np.abs(x) < REACH), np.flatnonzero(np.abs(y) < REACH)
    part = np.ix_(rows, columns)
    return x[columns], y[rows], z[part] - GROUND, sigma[part]


def main() -> None:
    """Draw it."""
    x, y, h, sigma = measured()
    row = int(np.argmin(np.abs(y)))
    figure, (section, plan) = plt.subplots(1, 2, figsize=(9.6, 3.6), width_ratios=(1.7, 1.0), layout="constrained")
    half = 0.5 * HOUSE[2]
    walls = np.array([-REACH, -half, -half, half, half, REACH])
    section.plot(walls, [0.0, 0.0, HOUSE[4], HOUSE[4], 0.0, 0.0], color="#0b5cad", lw=1.2, label="true")
    section.errorbar(x, h[row], 2.0 * sigma[row], fmt=".", ms=2.5, color="black", ecolor="#999999", elinewidth=0.8,
                     label="cells, ± 2 σ")  # fmt: skip
    section.set_xlabel("X [m]")
    section.set_ylabel("height over the ground [m]")
    section.legend(frameon=False, loc="center")
    cell = x[1] - x[0]
    extent = (x[0] - 0.5 * cell, x[-1] + 0.5 * cell, y[-1] - 0.5 * cell, y[0] + 0.5 * cell)
    image = plan.imshow(sigma, cmap="Greys", norm="log", extent=extent, interpolation="nearest")
    plan.axhline(y[row], color="#0b5cad", lw=0.8)
    plan.set_xlabel("X [m]")
    plan.set_ylabel("Y [m]")
    figure.colorbar(image, ax=plan, label="σ of matching [m]")
    for axes in (section, plan):
        axes.spines[["top", "right"]].set_visible(False)
    FIGURE.parent.mkdir(exist_ok=True)
    figure.savefig(FIGURE, dpi=110)


if __name__ == "__main__":
    main()
