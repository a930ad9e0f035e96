"""Spreckels, Schlienkamp and Jacobsen, figures 5 to 8 in our form: DEMs of even against DEMs of odd photographs.

A block flown with 80 % end lap is rendered through an UltraCamD that errs by the physics of its nine tiles. The block
is adjusted without additional parameters, and the even and the odd photographs of every strip, 60 % models both, are
matched to a DEM each. Beside their difference stands what `deform` foretells of it. Then both DEMs are corrected by
demcor, and then the photographs by imgeo and matched anew. The same with a camera without errors tells the noise.

The camera is a model of the true one with larger pixels: what counts, image errors and noise in pixels, h/b, tiles and
windows, is as it is. Heights are given as at a GSD of 9 cm.

    python tools/reproduce_paper_003_dem.py [FOLDER] [--noise 50]

Last result, even − odd in cm at a GSD of 9 cm, 3633 cells:

                                      mean       σ  σ / noise
    found, no self-calibration       −0.50   13.47      15.10
    foretold                         −0.23   14.27      16.00
    found less foretold              −0.27    6.00       6.73
    after demcor                     −0.21    5.99       6.72
    after imgeo and new matching     −0.11    4.14       4.64
    noise: a camera without errors    0.13    0.89       1.00
    correlation of the found with the foretold pattern 0.908

The noise is that of photographs without grain, 0.02 px of parallax; the paper expects 0.25 px, 9 cm. With grain:

    --noise                      800     1050
    noise                       4.04     5.33
    found / noise               3.29     2.42
    after demcor / noise        1.71     1.41
    after imgeo / noise         1.37     1.19
    correlation                0.874    0.840
    cells                       3294      747

(more grain falls below the threshold of 0.90). So a ratio of 1.2 is that of photographs with 0.15 px of matching noise,
and is missed where matching is better. What is left after imgeo is what 1–12 and 42–73 cannot follow of this camera:
0.15 px RMS of the 0.46 px that its image errors have beside the orientation. demcor leaves more, for at the borders of
models and of tiles a triangle of pickets mixes two of them.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.commands.adjust import run_adjust
from aerotri.commands.console import Console
from aerotri.commands.demcor import run_demcor
from aerotri.commands.dtm import DtmOptions, make_plan, write_terrain
from aerotri.commands.imgeo import ImgeoOptions, run_imgeo
from aerotri.commands.results import reopened
from aerotri.commands.simulate import run_simulate
from aerotri.deformation.dem_window import dem_models
from aerotri.deformation.model_map import read_number_table
from aerotri.deformation.restitution import ABSORBED, restitution
from aerotri.rasters import Grid, RasterReader
from aerotri.report.canvas import WIDTH, axes_at, new_figure, styled
from aerotri.report.rendering import save_plots
from aerotri.simulation.rendering import RenderOptions
from aerotri.terrain.dtm import make_terrain_model

SUBSETS = ("even", "odd")
PIXELS, PIXEL_UM, GSD_M, TRUE_GSD_M = (575, 375), 180.0, 1.8, 0.09
ERROR_PX, TIE_SIGMA_PX, INTERVAL_PX = 0.45, 0.1, 12.0
PARAMETERS = "bluh:1-12,ultracam_d:42-73"
CM = 100.0 * TRUE_GSD_M / GSD_M
PLAN = """
name = "{name}"
camera.ucd = {{ preset = "ultracam_d", size_px = [{px[0]}, {px[1]}], pixel_um = {pixel}{errors} }}
flight = {{ gsd_m = {gsd}, strips = 2, images_per_strip = 10, end_lap = 0.8, side_lap = 0.35, attitude_sigma_deg = \
[0.5, 0.5, 0.5], position_sigma_m = [10.0, 10.0, 5.0], \
cross_strips = [{{ position = 0.5, images = 6, end_lap = 0.6 }}] }}
terrain = {{ kind = "undulating", height_m = 300.0, relief_rms_m = 30.0, wavelength_m = 900.0 }}
tie_points = {{ per_image = 220, probability = 0.9, sigma_um = {tie} }}
control = {{ distance_bases = 2.0, sigma_m = [0.1, 0.1, 0.1], check_points = 8 }}
start_values = {{ kind = "perturbed", position_sigma_m = 5.0, angle_sigma_deg = 0.05 }}
"""


@dataclass(frozen=True, eq=False)
class Pair:
    """A DEM of the even and one of the odd photographs on their common cells (rows, columns) m."""

    grid: Grid
    even: np.ndarray
    odd: np.ndarray

    @property
    def difference(self) -> np.ndarray:
        return self.even - self.odd


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="to work in; what it holds is not made again")
    parser.add_argument("--noise", type=float, default=RenderOptions().noise, help="σ of the grey values, 16 bit")
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    looks = RenderOptions(noise=arguments.noise)
    erring, perfect = (prepare(folder, name, error, looks) for name, error in (("erring", ERROR_PX), ("perfect", 0.0)))
    noise = match(perfect, "plain", "plain_dem")
    before = match(erring, "plain", "plain_dem")
    predicted = foretold(erring, before)
    corrected = by_demcor(erring)
    ideal = by_imgeo(erring)
    tell(before, predicted, corrected, ideal, noise)
    save_plots({"even_odd": draw(before, predicted, corrected, ideal)}, folder / "plots")
    print(f"plots in {folder / 'plots'}")


def prepare(folder: Path, name: str, error_px: float, looks: RenderOptions) -> Path:
    """A rendered block with its two adjustments."""
    errors = f", errors = {{ physical = {{ rms_um = {error_px * PIXEL_UM:g}, seed = 4 }} }}" if error_px else ""
    here = folder / name
    if (here / "calibrated" / "solution.npz").exists():
        return here
    here.mkdir(parents=True, exist_ok=True)
    plan = here / "plan.toml"
    plan.write_text(
        PLAN.format(name=name, px=PIXELS, pixel=PIXEL_UM, errors=errors, gsd=GSD_M, tie=TIE_SIGMA_PX * PIXEL_UM),
        encoding="utf-8",
    )
    run_simulate(plan, here / "block", 11, True, looks)
    run_adjust(here / "block", here / "plain", "none", None, None, False, False, False)
    run_adjust(here / "block", here / "calibrated", PARAMETERS, None, None, False, False, False)
    return here


def match(here: Path, result: str, name: str, photographs: str = "block/photographs", ideal: bool = False) -> Pair:
    """Both DEMs of a block, matched with the orientation of a result."""
    calibration = reopened(here / result, Console(quiet=True))
    for subset in SUBSETS:
        target = here / f"{name}_{subset}"
        if (target / "dtm.json").exists():
            continue
        options = DtmOptions(
            interval=INTERVAL_PX * GSD_M, cell=INTERVAL_PX * GSD_M, pairs=True, step=1, subset=subset, edge=0.02,
            ideal=ideal,
        )  # fmt: skip
        plan = make_plan(calibration, [here / photographs], options)
        write_terrain(target, make_terrain_model(calibration, plan), calibration, False)
    return common([here / f"{name}_{subset}" / "dsm.tif" for subset in SUBSETS])


def common(paths: list[Path]) -> Pair:
    """Two rasters with cells of one lattice, on the cells they share."""
    readers = [RasterReader(path) for path in paths]
    grids = [reader.grid for reader in readers]
    cell = grids[0].cell_x
    left, top = max(g.left for g in grids), min(g.top for g in grids)
    right = min(g.left + g.columns * g.cell_x for g in grids)
    low = max(g.top - g.rows * g.cell_y for g in grids)
    grid = Grid(round((top - low) / cell), round((right - left) / cell), left, top, cell, cell)
    z = []
    for reader, g in zip(readers, grids, strict=True):
        place = round((g.top - top) / cell), round((left - g.left) / cell)
        z.append(reader.read(*place, grid.rows, grid.columns).astype(float))
        reader.__exit__(None, None, None)
    return Pair(grid, *z)


def foretold(here: Path, found: Pair) -> np.ndarray:
    """(rows, columns) m, what the deformation of the models lets expect of the difference."""
    calibration = reopened(here / "calibrated", Console(quiet=True))
    of = restitution(calibration, ABSORBED)
    x, y = np.meshgrid(found.grid.x(np.arange(found.grid.columns)), found.grid.y(np.arange(found.grid.rows)))
    parts = []
    for subset, z in zip(SUBSETS, (found.even, found.odd), strict=True):
        source = here / f"plain_dem_{subset}"
        table = read_number_table(source / "models.csv")
        models = dem_models(calibration, of, tuple(table[k] for k in sorted(table)))
        with RasterReader(source / "model.tif") as reader:
            row, column = (np.round(v).astype(int) for v in (reader.grid.row(y[:, 0]), reader.grid.column(x[0])))
            window = reader.read(int(row[0]), int(column[0]), len(row), len(column))
        number = np.where(np.isfinite(window), window, -1).astype(np.int32)
        xyz = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        parts.append(models.deformation_at(number.ravel(), xyz)[:, 2].reshape(x.shape))
    return parts[0] - parts[1]


def by_demcor(here: Path) -> Pair:
    for subset in SUBSETS:
        source, out = here / f"plain_dem_{subset}", here / f"corrected_{subset}.tif"
        if not out.exists():
            models = source / "model.tif"
            run_demcor(here / "calibrated", source / "dsm.tif", out, None, models, None, str(here / "plain"), True)
    return common([here / f"corrected_{subset}.tif" for subset in SUBSETS])


def by_imgeo(here: Path) -> Pair:
    if not (here / "ideal").exists():
        photographs = sorted((here / "block" / "photographs").glob("*.tif"))
        run_imgeo(here / "calibrated", photographs, here / "ideal", ImgeoOptions("lanczos"), True)
    return match(here, "calibrated", "ideal_dem", "ideal", ideal=True)


def spread(values: np.ndarray) -> float:
    """Standard deviation, cm at a GSD of 9 cm."""
    return CM * float(np.nanstd(values))


def tell(before: Pair, predicted: np.ndarray, corrected: Pair, ideal: Pair, noise: Pair) -> None:
    both = np.isfinite(before.difference) & np.isfinite(predicted)
    correlation = np.corrcoef(before.difference[both], predicted[both])[0, 1]
    n = spread(noise.difference)
    print(f"\neven − odd, cm at a GSD of 9 cm, {both.sum()} cells")
    print(f"{'':<34}{'mean':>8}{'σ':>8}{'σ / noise':>11}")
    rows = (
        ("found, no self-calibration", before.difference), ("foretold", np.where(both, predicted, np.nan)),
        ("found less foretold", before.difference - predicted), ("after demcor", corrected.difference),
        ("after imgeo and new matching", ideal.difference), ("noise: a camera without errors", noise.difference),
    )  # fmt: skip
    for text, values in rows:
        print(f"{text:<34}{CM * np.nanmean(values):>8.2f}{spread(values):>8.2f}{spread(values) / n:>11.2f}")
    print(f"correlation of the found with the foretold pattern {correlation:.3f}")


@styled
def draw(before: Pair, predicted: np.ndarray, corrected: Pair, ideal: Pair):
    """Four maps with one scale."""
    panels = (
        ("found, no self-calibration", before.grid, before.difference), ("foretold", before.grid, predicted),
        ("after demcor", corrected.grid, corrected.difference),
        ("after imgeo and new matching", ideal.grid, ideal.difference),
    )  # fmt: skip
    width = (WIDTH - 2.65) / 2.0
    height = width * before.grid.rows / before.grid.columns
    figure = new_figure(
        2 * height + 2.2, "DEM of even less DEM of odd photographs",
        "UltraCamD, 80 % flight, 60 % models; cm at a GSD of 9 cm; blue: no common ground",
    )  # fmt: skip
    limit = CM * float(np.nanpercentile(np.abs(before.difference), 98))
    image = None
    for k, (title, grid, values) in enumerate(panels):
        axes = axes_at(figure, 0.75 + (k % 2) * (width + 0.7), 0.65 + (1 - k // 2) * (height + 0.55), width, height)
        extent = (grid.left, grid.left + grid.columns * grid.cell_x, grid.top - grid.rows * grid.cell_y, grid.top)
        axes.set_facecolor("#cfe0f2")
        tones = {"cmap": "Greys_r", "vmin": -limit, "vmax": limit}
        image = axes.imshow(CM * values, extent=extent, interpolation="nearest", **tones)
        axes.set_title(f"{title}: σ {spread(values):.1f} cm", fontsize=8.5, loc="left")
        axes.set_xlabel("X [m]" if k > 1 else "")
        axes.set_ylabel("Y [m]" if k % 2 == 0 else "")
    scale = axes_at(figure, 0.75 + 2 * width + 0.85, 0.65, 0.14, 2 * height + 0.55)
    figure.colorbar(image, cax=scale).set_label("even − odd [cm]")
    return figure


if __name__ == "__main__":
    main()
