"""Where an orthophoto shows details, against where they are, over the σ it states: several draws of rendered scenes.

Photographs of known ground are rendered, adjusted with errors of tie points and control, the surface is measured
densely with that adjustment, and the orthophoto is made over it. Around every tenth coarse cell the grey values of the
orthophoto are held against the true ground: the shift that fits best by least squares is the displacement of the detail
there. What the fit itself cannot tell is small and not taken off. Nobody points at the details, so σ is taken without
the part of the image measurement (first) and with it (total). All places of a draw share its errors of the
adjustment: z is the root mean square over all draws. As if independent: σ as it would be with the heights' σ and the
orientation's as if they had nothing in common.

Measures σ of an orthophoto by its parts: imports inside on purpose.

Last result, eight draws:

    | scene | places | displacement m | σ m | z | > 3 σ | with image part z | z of draws | as if independent z |
    |---|---|---|---|---|---|---|---|---|
    | undulating | 12189 | 0.171 | 0.162 | 1.05 | 0.08 % | 0.56 | 0.74 to 1.41 | 0.94 |
    | hill | 12173 | 0.181 | 0.177 | 1.10 | 1.38 % | 0.60 | 0.85 to 1.37 | 0.99 |
    | houses | 12012 | 0.168 | 0.168 | 1.02 | 0.55 % | 0.55 | 0.66 to 1.57 | 0.92 |

    python tools/prove/ortho_sigma.py [FOLDER] [--draws 5] [--scenes houses …] [--figure FILE]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

import aerotri
from aerotri.rasters.grids import Grid
from aerotri.rasters.mosaics import read_mosaic
from aerotri.simulation import _rendering_kernels as rendering
from aerotri.simulation.rendering_texture import Texture

GSD_M, EVERY, HALF, ROUNDS = 0.5, 4, 10, 6
"""m; coarse cells between two places, cells of the orthophoto around one, and rounds of the fit."""
WORST_FIT = 0.25
"""Share of the contrast that may remain after the fit: beyond it a place shows a wall, or a seam."""
SPEC = {
    "name": "ortho",
    "camera": {"cam": {"size_px": [1000, 750], "pixel_um": 30.0, "focal_length_mm": 30.0}},
    "flight": {"gsd_m": GSD_M, "strips": 2, "images_per_strip": 4, "end_lap": 0.7, "side_lap": 0.4, "heading_deg": 30.0,
               "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [3.0, 3.0, 2.0]},
    "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 0.0, "stated_sigma_um": 15.0, "margin_px": 5.0},
    "control": {"distance_bases": 2.0, "sigma_m": [0.0] * 3, "stated_sigma_m": [0.1] * 3},
}  # fmt: skip
TIE_SIGMA_MM, CONTROL_SIGMA_M = 0.015, 0.1
HOUSES = [
    [-120.0 + 60.0 * i, -100.0 + 70.0 * j, 22.0, 14.0, 6.0 + 3.0 * ((i + j) % 3)] for i in range(5) for j in range(4)
]
SCENES = {
    "undulating": {"kind": "undulating", "relief_rms_m": 6.0, "wavelength_m": 150.0},
    "hill": {"kind": "hill", "hill_height_m": 60.0, "hill_radius_m": 80.0},
    "houses": {"kind": "undulating", "relief_rms_m": 2.0, "wavelength_m": 150.0, "houses": HOUSES},
}
TERRAIN = {"height_m": 50.0}
HEAD = (
    "| scene | places | displacement m | σ m | z | > 3 σ | with image part z | z of draws | as if independent z |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True, eq=False)
class Places:
    """(n, 2) m displacements; (n,) m σ without the image part, with it, and as if heights and plan were independent."""

    off: np.ndarray
    geometry: np.ndarray
    total: np.ndarray
    apart: np.ndarray


def main() -> None:
    """Run the draws and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--figure", type=Path, help="picture of the displacements over σ")
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp())
    print(HEAD, flush=True)
    found: dict[str, list[Places]] = {}
    for name in arguments.scenes:
        found[name] = drawn(folder / name, name, arguments.draws)
        print(row(name, found[name]), flush=True)
    if arguments.figure is not None:
        draw(found, arguments.figure)


def row(name: str, draws: list[Places]) -> str:
    """A line of the table."""
    off, geometry, total, apart = (
        np.concatenate([getattr(d, of) for d in draws]) for of in ("off", "geometry", "total", "apart")
    )
    z, single = off / geometry[:, None], [rms(d.off / d.geometry[:, None]) for d in draws]
    numbers = (
        str(len(off)), f"{rms(off):.3f}", f"{rms(geometry):.3f}", f"{rms(z):.2f}",
        f"{100.0 * np.mean(np.abs(z) > 3.0):.2f} %", f"{rms(off / total[:, None]):.2f}",
        f"{min(single):.2f} to {max(single):.2f}", f"{rms(off / apart[:, None]):.2f}",
    )  # fmt: skip
    return f"| {name} | " + " | ".join(numbers) + " |"


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def drawn(folder: Path, name: str, draws: int) -> list[Places]:
    """The places of every draw, on the same photographs."""
    flight = aerotri.simulate(SPEC | {"terrain": TERRAIN | SCENES[name]}, 1)
    photographs = folder / "flown" / "photographs"
    if not photographs.exists():
        flight.save(folder / "flown", photographs=True, contrast=0.25)
    out = []
    for seed in range(draws):
        result = aerotri.adjust(with_errors(flight.block, seed), explain=False)
        surface = aerotri.dense_surface(result, photographs)
        made = aerotri.orthophoto(result, photographs, surface, folder / f"ortho_{seed}", plots=False)
        apart = aerotri.orthophoto(
            result, photographs, replace(surface, adjustment=""), folder / f"apart_{seed}", plots=False
        )
        out.append(places_of(made, apart, flight))
    return out


def with_errors(block: aerotri.Block, seed: int) -> aerotri.Block:
    """The block with errors of its image points and its control, as large as stated."""
    rng, rays, control = np.random.default_rng(seed), block.image_points, block.control
    xy = rays.xy + rng.normal(scale=TIE_SIGMA_MM, size=rays.xy.shape)
    xyz = control.xyz + rng.normal(scale=CONTROL_SIGMA_M, size=control.xyz.shape)
    return replace(block, image_points=replace(rays, xy=xy), control=replace(control, xyz=xyz))


def places_of(made: aerotri.Orthophoto, apart: aerotri.Orthophoto, flight) -> Places:
    """Displacements and σ at every few coarse cells."""
    record, bands = made.record, read_mosaic(made.path)
    grid, accuracy, step = record.grid, record.accuracy, record.candidates.step
    true = truth(grid, flight)
    slope = np.gradient(true)
    contrast = float(np.std(true))
    off, rows = [], []
    for i in range(EVERY, accuracy.total.shape[0] - EVERY, EVERY):
        for j in range(EVERY, accuracy.total.shape[1] - EVERY, EVERY):
            middle = step * i + step // 2, step * j + step // 2
            part = tuple(slice(m - HALF, m + HALF + 1) for m in middle)
            shown, mask = bands[0][part].astype(float), bands[-1][part]
            if mask.size < (2 * HALF + 1) ** 2 or not (mask > 0).all() or not np.isfinite(accuracy.total[i, j]):
                continue
            moved, left = fitted(shown, true, slope, middle)
            if left < WORST_FIT * contrast:
                off.append(moved * [grid.cell_x, -grid.cell_y])
                rows.append((i, j))
    at = tuple(np.array(rows).T)
    image = accuracy.image[at]
    total, other = accuracy.total[at], apart.record.accuracy.total[at]
    return Places(np.array(off), np.sqrt(total**2 - image**2), total, np.sqrt(other**2 - image**2))


def fitted(
    shown: np.ndarray, true: np.ndarray, slope: list[np.ndarray], middle: tuple[int, int]
) -> tuple[np.ndarray, float]:
    """(2,) cells to the right and down by which details lie off, and what remains of the grey values."""
    i, j = np.mgrid[middle[0] - HALF : middle[0] + HALF + 1, middle[1] - HALF : middle[1] + HALF + 1].astype(float)
    moved, left = np.zeros(2), np.inf
    for _ in range(ROUNDS):
        at = [i - moved[1], j - moved[0]]
        grey, down, right = (map_coordinates(v, at, order=1, mode="nearest") for v in (true, *slope))
        design = np.column_stack([right.ravel(), down.ravel(), np.ones(grey.size), grey.ravel()])
        found, *_ = np.linalg.lstsq(design, shown.ravel(), rcond=None)
        left = float(np.std(shown.ravel() - design @ found) / max(abs(found[3]), 1e-9))
        moved = moved - found[:2] / found[3]
    return moved, left


def truth(grid: Grid, flight) -> np.ndarray:
    """(rows, columns) grey values of the true ground, without unit, means over a cell as a pixel has them."""
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    places = np.stack([x, y], axis=-1)
    lattice = texture_of(flight).lattice(places.min(axis=(0, 1)), places.max(axis=(0, 1)))
    out = np.empty(x.shape, np.float32)
    rendering.texture_of_pixels(
        rendering.LatticeArrays(lattice.values, lattice.row, lattice.column, lattice.spacing),
        rendering.PixelPlaces(places, np.array([0, 0]), 1), (0, 0), out,
    )  # fmt: skip
    return out.astype(float)


def texture_of(flight) -> Texture:
    """The texture of the ground, whose finest detail has two pixels."""
    return Texture(2.0 * GSD_M, flight.seed)


def draw(found: dict[str, list[Places]], path: Path) -> None:
    """Histograms of the displacements over σ beside the normal curve."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.0 * len(found), 2.6), layout="constrained")
    axes = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    bins = np.linspace(-4.0, 4.0, 41)
    for one, (name, draws) in zip(axes, found.items(), strict=True):
        z = np.concatenate([(d.off / d.geometry[:, None]).ravel() for d in draws])
        one.hist(np.clip(z, bins[0], bins[-1]), bins=bins.tolist(), density=True, color="#bbbbbb")
        one.plot(bins, np.exp(-0.5 * bins**2) / np.sqrt(2.0 * np.pi), color="black", lw=1.0)
        one.set_title(f"{name}: RMS {rms(z):.2f}", fontsize=9)
        one.set_xlabel("displacement / σ")
    axes[0].set_ylabel("share")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
