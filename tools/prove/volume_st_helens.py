"""The dome of Mount St. Helens: volumes of three epochs against 2000-09-25, by every method, with σ from stable ground.

Outside the part that was measured anew the later DEMs are the one of 2000, cell by cell: what tells their accuracy is
the ground inside that part which did not grow. Differences there have a mean, which counts for the whole volume, and a
scatter with a correlation length, which averages out over the dome's area.

Needs ../shared/data/st_helens. Prints Markdown; with --out also writes st_helens.md and a map of every epoch. The last
answer stands in tools/results/st_helens.md.

Example: python tools/prove/volume_st_helens.py --out results
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.figure import Figure
from scipy import ndimage

import aerotri

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "st_helens"
BEFORE, EPOCHS = "2000_09_25", ("2004_10_04", "2004_10_13", "2005_01_03")
GROWN_M, AROUND = 8.0, 4
"""A cell has grown from so many metres on; so many cells around it are not taken for stable."""
LAGS = 12


def stable_sigma(difference: np.ndarray, cell: float, area: float) -> tuple[float, float, float, int, float]:
    """σ of the mean height over an area from the ground that did not grow.

    Returns
    -------
    sigma, mean, NMAD (m), number of stable cells, correlation length (m).
    """
    stable = stable_cells(difference)
    values = difference[stable]
    mean, nmad = float(values.mean()), float(1.4826 * np.median(np.abs(values - np.median(values))))
    centred = np.where(stable, difference - mean, np.nan)
    variance = float(np.nanmean(centred**2))
    length = 0.0
    for lag in range(1, LAGS):
        pairs = np.concatenate([(centred[lag:] * centred[:-lag]).ravel(),
                                (centred[:, lag:] * centred[:, :-lag]).ravel()])  # fmt: skip
        pairs = pairs[np.isfinite(pairs)]
        if len(pairs) < 30 or pairs.mean() < variance / np.e:
            break
        length = lag * cell
    # an exponential correlation of that length covers 2πℓ² of the area
    scatter = variance * min(1.0, 2.0 * np.pi * max(length, cell) ** 2 / area)
    return float(np.sqrt(mean**2 + scatter)), mean, nmad, len(values), length


def epoch(name: str) -> tuple[Any, Figure, float, tuple[float, float, float, int, float]]:
    """Volumes, map, area measured anew (m²) and stable ground of an epoch."""
    after, before = (aerotri.Surface(DATA / f"{one}.tif") for one in (name, BEFORE))
    difference, grid = after.z - before.z, after.grid
    row, column = np.nonzero(difference)
    anew = shapely.MultiPoint(np.column_stack([grid.x(column), grid.y(row)])).convex_hull.buffer(grid.cell_x)
    found = aerotri.volume(after, anew, base=before, section_spacing=20.0, azimuth=0.0)
    area = float((difference != 0.0).sum()) * grid.cell_x * grid.cell_y
    return found.record, found.plot.thickness(), area, stable_sigma(difference, grid.cell_x, area)


def changed(name: str) -> str:
    """A line of the table of `aerotri.change`, aligned in height on the ground that did not grow."""
    after, before = (aerotri.Surface(DATA / f"{one}.tif") for one in (name, BEFORE))
    difference, grid = after.z - before.z, after.grid
    new, still = difference != 0.0, stable_cells(difference)
    row, column = np.nonzero(new)
    anew = shapely.MultiPoint(np.column_stack([grid.x(column), grid.y(row)])).convex_hull.buffer(grid.cell_x)
    row, column = np.nonzero(still)
    half = 0.5 * grid.cell_x
    ground = shapely.union_all(shapely.box(grid.x(column) - half, grid.y(row) - half, grid.x(column) + half,
                                           grid.y(row) + half))  # fmt: skip
    v = aerotri.change(before, after, stable=ground, align="height", area=anew).summary["volumes"][-1]
    said = (f"{1e-6 * v[f'{of}_m3']:.2f} ± {1e-6 * v[f'sigma_{of}_m3']:.3f}" for of in ("gained", "lost", "net"))
    return f"| {name} | {' | '.join(said)} | {len(row)} |"


def stable_cells(difference: np.ndarray) -> np.ndarray:
    """Cells that were measured anew and did not grow."""
    grown = ndimage.binary_opening(np.abs(difference) > GROWN_M)
    return (difference != 0.0) & ~ndimage.binary_dilation(grown, iterations=AROUND)


def main() -> None:
    """Compute, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    if not DATA.exists():
        raise SystemExit("the DEMs are not beside the project (../shared/data/st_helens)")
    lines = [
        "# Mount St. Helens: volumes against 2000-09-25", "",
        "10⁶ m³; σ from the ground that was measured anew and did not grow (stable cells, mean and NMAD of their "
        "differences, correlation length); it holds for the whole of the volume.", "",
        "| epoch | prisms net | σ | grid | trapezoidal | Simpson | Simpson 3/8 | cut | fill | stable cells | mean, m "
        "| NMAD, m | length, m |", "|" + "---|" * 13,
    ]  # fmt: skip
    for name in EPOCHS:
        volumes, figure, measured, (sigma, mean, nmad, cells, length) = epoch(name)
        v = volumes.chosen
        methods = [f"{1e-6 * one.net:.4f}" for one in volumes.by_method]
        lines.append(
            f"| {name} | {methods[0]} | {1e-6 * sigma * measured:.2f} | " + " | ".join(methods[1:])
            + f" | {1e-6 * v.cut:.3f} | {1e-6 * v.fill:.3f} | {cells} | {mean:+.2f} | {nmad:.2f} | {length:.0f} |"
        )  # fmt: skip
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            figure.savefig(options.out / f"st_helens_{name}.png", dpi=110)
    lines += [
        "", "The same by `aerotri change`, which first moves every epoch in height to fit on the stable cells:", "",
        "| epoch | gained | lost | net | stable cells |", "|---|---|---|---|---|", *(changed(name) for name in EPOCHS),
    ]  # fmt: skip
    text = "\n".join(lines) + "\n"
    print(text, end="")
    if options.out is not None:
        (options.out / "st_helens.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
