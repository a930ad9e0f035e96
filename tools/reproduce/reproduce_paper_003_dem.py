"""Spreckels, Schlienkamp and Jacobsen, figures 5 to 8 in our form: DEMs of even against DEMs of odd photographs.

A block flown with 80 % end lap is rendered through an UltraCamD that errs by the physics of its nine tiles. The block
is adjusted without additional parameters, and the even and the odd photographs of every strip, 60 % models both, are
matched to a DEM each. Beside their difference stands what `deform` foretells of it. Then both DEMs are corrected by
demcor, and then the photographs by imgeo and matched anew. The same with a camera without errors tells the noise. All
of it with two sets of parameters, the paper's and the tiles' with a random field, and with three grains.

The camera is a model of the true one with larger pixels: what counts, image errors and noise in pixels, h/b, tiles and
windows, is as it is. Heights are given as at a GSD of 9 cm. One thing is not: a window of 17 pixels is a tenth of a
tile, so that 71 % of the cells have a seam in one of their four windows or lie between models; in the true camera 5 %.
Cells clear of seams therefore have a column of their own.

    python tools/reproduce/reproduce_paper_003_dem.py [FOLDER] [--noise 50 400 800] [--known] [--keep]

Last result (tools/results/paper_003_dem.md), σ of even − odd over that of the noise, all cells (clear of seams):

    grain (σ of grey values)               50           400          800
    matching noise of a DEM, px          0.015         0.042        0.085
    found                          18.2 (14.5)    6.3 (5.1)    3.2 (2.6)
    1–12, 42–73    after demcor      6.2 (3.2)    2.3 (1.4)    1.5 (1.1)
                   after imgeo       4.5 (3.3)    1.8 (1.5)    1.2 (1.2)
    42–73, field   after demcor      4.8 (1.7)    1.9 (1.1)    1.3 (1.0)
                   after imgeo       2.0 (1.6)    1.1 (1.1)    1.0 (1.1)
    correlation, found and foretold     .963         .950         .906

--known, a camera that errs by 1–12 and 42–73 themselves, tie points exact: after imgeo 1.09 (0.99), after demcor 4.8
(1.03) at the smallest grain: the corrections lose nothing; what is left is estimation, and windows across seams.

What the paper's set leaves of this camera is 0.11 px RMS of 0.45, whatever the number of tie points: the differences of
the cones' lenses within the tiles, which neither 1–12 nor similarities of tiles follow. Tiles with a random field leave
0.033 px with 220 tie points a photograph, 0.024 with the 1000 used here and 0.021 with 3000, where their σ says 0.025,
0.013 and 0.009: more than σ is left beside the seams, over which the field is continuous. Legendre's polynomials of
5 × 5 with the tiles leave 0.045, the field alone 0.075.
"""

from __future__ import annotations

import argparse
import csv
import shutil
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

import aerotri
from aerotri import drawing, geometry, parameters

SUBSETS = ("even", "odd")
PIXELS, PIXEL_UM, GSD_M, TRUE_GSD_M = (575, 375), 180.0, 1.8, 0.09
ERROR_PX, TIE_SIGMA_PX, INTERVAL_PX, TIES, SEED = 0.45, 0.1, 12.0, 1000, 11
CAMERA = 4
"""Number that the random image errors of the camera start from."""
WINDOW_PX = 17
"""Side of the windows that `aerotri.terrain` matches where nothing is stated."""
SETS = {"1–12, 42–73": "bluh:1-12,ultracam_d:42-73", "42–73, field": "ultracam_d:42-73,collocation"}
"""The paper's parameters, and the tiles with a random field, which knows no lens."""
TRUE_SET, EXACT = "1–12, 42–73", 0.02
NOISES, KEPT_NOISE = (50.0, 400.0, 800.0), 400.0
RESULTS = Path(__file__).parents[1] / "results"
HEAD = """# Paper 003, figures 5 to 8: DEMs of even against DEMs of odd photographs

UltraCamD erring by the physics of its tiles, 0.45 px RMS; 26 photographs at 80 %, models of 60 %; orientation without
additional parameters. Sets: BLUH 1–12 with 42–73, and 42–73 with a random field (`ultracam_d:42-73,collocation`).
Clear: cells with no seam of a tile in a window and no other model beside them. Photographs without grain (50) have a
matching noise of 0.015 px, those with 400 and 800 of 0.042 and 0.085 px."""
TAIL = """
![even − odd, grain 400, tiles with a random field](paper_003_dem.png)
"""
CM = 100.0 * TRUE_GSD_M / GSD_M
PLAN = """
name = "{name}"
camera.ucd = {{ preset = "ultracam_d", size_px = [{px[0]}, {px[1]}], pixel_um = {pixel}{errors} }}
flight = {{ gsd_m = {gsd}, strips = 2, images_per_strip = 10, end_lap = 0.8, side_lap = 0.35, attitude_sigma_deg = \
[0.5, 0.5, 0.5], position_sigma_m = [10.0, 10.0, 5.0], \
cross_strips = [{{ position = 0.5, images = 6, end_lap = 0.6 }}] }}
terrain = {{ kind = "undulating", height_m = 300.0, relief_rms_m = 30.0, wavelength_m = 900.0 }}
tie_points = {{ per_image = {ties}, probability = 0.9, sigma_um = {tie}, margin_px = 3.0 }}
control = {{ distance_bases = 2.0, sigma_m = [0.1, 0.1, 0.1], check_points = 8 }}
start_values = {{ kind = "perturbed", position_sigma_m = 5.0, angle_sigma_deg = 0.05 }}
"""


@dataclass(frozen=True, eq=False)
class Pair:
    """A DEM of the even and one of the odd photographs on their common cells (rows, columns) m."""

    grid: Any
    even: np.ndarray
    odd: np.ndarray

    @property
    def difference(self) -> np.ndarray:
        return self.even - self.odd


@dataclass(frozen=True, eq=False)
class Corrected:
    """What a set of parameters makes of the difference: foretold (rows, columns) m, and what corrections leave."""

    foretold: np.ndarray
    demcor: Pair
    imgeo: Pair


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="to work in; what it holds is not made again")
    parser.add_argument("--noise", type=float, nargs="*", default=NOISES, help="σ of the grey values, 16 bit")
    parser.add_argument("--known", action="store_true", help="a camera that errs by the paper's parameters, ties exact")
    parser.add_argument("--keep", action="store_true", help="write tools/results/paper_003_dem.md and its picture")
    arguments = parser.parse_args()
    folder, told = arguments.folder or Path(tempfile.mkdtemp()), []
    for noise in arguments.noise:
        here = folder / f"grain_{noise:g}"
        erring = prepare(here, "known" if arguments.known else "erring", noise)
        before = match(erring, "plain", "plain_dem")
        still = match(prepare(here, "perfect", noise), "plain", "plain_dem")
        sets = [TRUE_SET] if arguments.known else list(SETS)
        corrected = {name: corrections(erring, name, before) for name in sets}
        lines = table(noise, before, corrected, still, clear_cells(erring, before))
        print("\n".join(lines), flush=True)
        told += lines
        figures = {f"even_odd_{k}": draw(name, noise, before, corrected[name]) for k, name in enumerate(sets)}
        drawing.save_plots(figures, here / "plots")
        print(f"plots in {here / 'plots'}")
        if arguments.keep and noise == KEPT_NOISE:
            shutil.copy(here / "plots" / "even_odd_1.png", RESULTS / "paper_003_dem.png")
    if arguments.keep:
        (RESULTS / "paper_003_dem.md").write_text("\n".join([HEAD, "```", *told, "```", TAIL]), encoding="utf-8")


def prepare(folder: Path, name: str, noise: float, camera: int = CAMERA) -> Path:
    """A rendered block with its adjustments, without additional parameters and with each set; camera : its number."""
    here, plan = folder / name, folder / name / "plan.toml"
    if not (here / "block" / "photographs").exists():
        here.mkdir(parents=True, exist_ok=True)
        tie = TIE_SIGMA_PX * PIXEL_UM * (EXACT if name == "known" else 1.0)
        told = PLAN.format(
            name=name, px=PIXELS, pixel=PIXEL_UM, errors=ERRORS[name](camera), gsd=GSD_M, tie=tie, ties=TIES
        )
        plan.write_text(told, encoding="utf-8")
        aerotri.simulate(plan, SEED).save(here / "block", photographs=True, noise=noise)
    for result, spec in {"plain": "none", **SETS}.items() if name != "perfect" else (("plain", "none"),):
        if not (here / result / "solution.npz").exists():
            aerotri.adjust(here / "block", parameters=spec, explain=False).save(here / result, plots=False)
    return here


def without(_: int) -> str:
    return ""


def by_physics(number: int) -> str:
    return f", errors = {{ physical = {{ rms_um = {ERROR_PX * PIXEL_UM:g}, seed = {number} }} }}"


def by_parameters(number: int) -> str:
    """The values of the paper's parameters that come nearest to the camera that errs by physics."""
    text = PLAN.format(
        name="known", px=PIXELS, pixel=PIXEL_UM, errors=by_physics(number), gsd=GSD_M, tie=1.0, ties=TIES
    )
    flight = aerotri.simulate(tomllib.loads(text), SEED)
    camera = flight.block.cameras[0]
    true = flight.true_image_errors(nodes=115).field
    xy = np.column_stack([true.x.ravel(), true.y.ravel()])
    names, design = parameters.patterns(SETS[TRUE_SET], camera, xy)
    values = np.linalg.lstsq(design.reshape(-1, design.shape[2]), true.d.ravel(), rcond=None)[0]
    pairs = ", ".join(f'"{name}" = {value:.9e}' for name, value in zip(names, values, strict=True))
    return f", errors = {{ parameters = {{ {pairs} }} }}"


ERRORS = {"perfect": without, "erring": by_physics, "known": by_parameters}


def match(here: Path, result: str, name: str, photographs: str = "block/photographs", ideal: bool = False) -> Pair:
    """Both DEMs of a block, matched with the orientation of a result."""
    for subset in SUBSETS:
        target = here / f"{name}_{subset}"
        if (target / "dtm.json").exists():
            continue
        model = aerotri.terrain(
            here / result, here / photographs, interval=INTERVAL_PX * GSD_M, cell=INTERVAL_PX * GSD_M,
            pairs=True, step=1, subset=subset, edge=0.02, ideal=ideal,
        )  # fmt: skip
        model.save(target, plots=False)
    return common([here / f"{name}_{subset}" / "dsm.tif" for subset in SUBSETS])


def common(paths: list[Path]) -> Pair:
    """Two rasters with cells of one lattice, on the cells they share."""
    one, two = (aerotri.Surface(path) for path in paths)
    g, other = one.grid, two.grid
    left, top = max(g.left, other.left), min(g.top, other.top)
    right = min(v.left + v.columns * v.cell_x for v in (g, other))
    low = max(v.top - v.rows * v.cell_y for v in (g, other))
    row, column = round((g.top - top) / g.cell_y), round((left - g.left) / g.cell_x)
    grid = g.window(row, column, round((top - low) / g.cell_y), round((right - left) / g.cell_x))
    return Pair(grid, part_of(one, grid), part_of(two, grid))


def part_of(surface: aerotri.Surface, grid) -> np.ndarray:
    """(rows, columns) of a surface on the cells of a grid of the same lattice; NaN beyond."""
    g, out = surface.grid, np.full((grid.rows, grid.columns), np.nan)
    row, column = round((g.top - grid.top) / g.cell_y), round((grid.left - g.left) / g.cell_x)
    rows, columns = (np.arange(first, first + count) for first, count in ((row, grid.rows), (column, grid.columns)))
    there = np.ix_((rows >= 0) & (rows < g.rows), (columns >= 0) & (columns < g.columns))
    inside = rows[(rows >= 0) & (rows < g.rows)], columns[(columns >= 0) & (columns < g.columns)]
    out[there] = surface.z[np.ix_(*inside)]
    return out


def corrections(here: Path, name: str, before: Pair) -> Corrected:
    return Corrected(foretold(here, name, before), by_demcor(here, name), by_imgeo(here, name))


def models_of_cells(here: Path, subset: str, grid) -> tuple[tuple[tuple[str, str], ...], np.ndarray]:
    """The models of a DEM by number, and the number (rows, columns) that each cell belongs to; −1: none."""
    source = here / f"plain_dem_{subset}"
    with (source / "models.csv").open(newline="", encoding="utf-8") as file:
        table = {int(row["number"]): (row["left"], row["right"]) for row in csv.DictReader(file)}
    number = part_of(aerotri.Surface(source / "model.tif"), grid)
    return tuple(table[k] for k in sorted(table)), np.where(np.isfinite(number), number, -1).astype(np.int32)


def places(grid, z: np.ndarray) -> np.ndarray:
    """(n, 3) m of the cells."""
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def foretold(here: Path, name: str, found: Pair) -> np.ndarray:
    """(rows, columns) m, what the deformation of the models lets expect of the difference."""
    result, parts, g = aerotri.open_result(here / name), [], found.grid
    for subset, z in zip(SUBSETS, (found.even, found.odd), strict=True):
        dem = aerotri.Surface.of_array(z, left=g.left, top=g.top, cell=g.cell_x)
        models = here / f"plain_dem_{subset}" / "model.tif"
        parts.append(aerotri.correct_dem(dem, result, models=models, orientation="absorbed").dz.z)
    return parts[0] - parts[1]


def clear_cells(here: Path, found: Pair) -> np.ndarray:
    """(rows, columns) bool: cells whose windows lie in one tile of every photograph, and whose neighbours in one model.

    A window of 17 pixels is a tenth of a tile of this camera, and 1/200 of one of the true camera.
    """
    result, clear = aerotri.open_result(here / "plain"), np.isfinite(found.difference)
    row = {str(name): k for k, name in enumerate(result.block.images.names)}
    for subset, z in zip(SUBSETS, (found.even, found.odd), strict=True):
        names, number = models_of_cells(here, subset, found.grid)
        clear &= maximum_filter(number, 3) == minimum_filter(number, 3)
        for side in (0, 1):
            photo = np.array([row[pair[side]] for pair in names])[number.ravel()]
            away = seam_distance(result, photo, places(found.grid, z))
            clear &= (away > 0.5 * WINDOW_PX + ERROR_PX).reshape(z.shape)
    return clear


def seam_distance(result: aerotri.Adjustment, photo: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """(n,) px, from where a photograph (n,) shows a place (n, 3) to the nearest seam of its tiles."""
    images, camera = result.adjusted.images, result.block.cameras[0]
    rotation = geometry.rotation_from_angles(images.angles, result.block.rotation)
    u = np.einsum("nji,nj->ni", rotation[photo], xyz - images.centre[photo])
    xy = -camera.focal_length_mm * u[:, :2] / u[:, 2:]
    lines, away = np.array(drawing.seams(camera)), np.full(len(xyz), np.inf)
    for axis in (0, 1):
        # a seam has the same x, or the same y, at both ends
        seams = lines[np.isclose(lines[:, 0, axis], lines[:, 1, axis]), 0, axis]
        away = np.minimum(away, np.abs(xy[:, axis, None] - seams).min(axis=1))
    return away / (1e-3 * PIXEL_UM)


def by_demcor(here: Path, name: str) -> Pair:
    outs = [here / f"corrected {name} {subset}.tif" for subset in SUBSETS]
    for subset, out in zip(SUBSETS, outs, strict=True):
        source = here / f"plain_dem_{subset}"
        if not out.exists():
            aerotri.correct_dem(
                source / "dsm.tif", here / name, models=source / "model.tif", orientation=here / "plain"
            ).save(out)
    return common(outs)


def by_imgeo(here: Path, name: str) -> Pair:
    photographs = f"ideal {name}"
    if not (here / photographs).exists():
        given = sorted((here / "block" / "photographs").glob("*.tif"))
        aerotri.ideal_photographs(here / name, given, here / photographs, resampling="lanczos")
    return match(here, name, f"ideal_dem {name}", photographs, ideal=True)


def spread(values: np.ndarray) -> float:
    """Standard deviation, cm at a GSD of 9 cm."""
    return CM * float(np.nanstd(values))


def table(noise: float, before: Pair, corrected: dict[str, Corrected], still: Pair, clear: np.ndarray) -> list[str]:
    """Lines: mean and σ, cm, and σ over the noise, of all cells and of those clear of seams; for every set."""
    n = spread(still.difference)
    lines = [
        f"\ngrain {noise:g}: even − odd, cm at a GSD of 9 cm, {np.isfinite(before.difference).sum()} cells, "
        f"{100.0 * clear.sum() / np.isfinite(before.difference).sum():.0f} % clear of seams",
        f"{'':<34}{'mean':>8}{'σ':>8}{'σ / noise':>11}{'clear: σ':>11}{'σ / noise':>11}",
    ]

    def line(text: str, grid, values: np.ndarray) -> str:
        own = spread(values[inside(before.grid, clear, grid)])
        return (
            f"{text:<34}{CM * np.nanmean(values):>8.2f}{spread(values):>8.2f}{spread(values) / n:>11.2f}"
            f"{own:>11.2f}{own / n:>11.2f}"
        )

    lines += [
        line("noise: a camera without errors", still.grid, still.difference),
        line("found", before.grid, before.difference),
    ]
    for name, c in corrected.items():
        both = np.isfinite(before.difference) & np.isfinite(c.foretold)
        correlation = np.corrcoef(before.difference[both], c.foretold[both])[0, 1]
        lines += [
            f"{name}: correlation of the found with the foretold {correlation:.3f}",
            line("  foretold", before.grid, np.where(both, c.foretold, np.nan)),
            line("  found less foretold", before.grid, before.difference - c.foretold),
            line("  after demcor", c.demcor.grid, c.demcor.difference),
            line("  after imgeo and new matching", c.imgeo.grid, c.imgeo.difference),
        ]
    return lines


def inside(grid, chosen: np.ndarray, other) -> np.ndarray:
    """The cells chosen on one grid on another grid of the same lattice; False beyond."""
    row = np.round(grid.row(other.y(np.arange(other.rows)))).astype(int)
    column = np.round(grid.column(other.x(np.arange(other.columns)))).astype(int)
    rows, columns = (row >= 0) & (row < grid.rows), (column >= 0) & (column < grid.columns)
    out = np.zeros((other.rows, other.columns), bool)
    out[np.ix_(rows, columns)] = chosen[np.ix_(row[rows], column[columns])]
    return out


@drawing.styled
def draw(name: str, noise: float, before: Pair, corrected: Corrected):
    """Four maps with one scale."""
    panels = (
        ("found, no self-calibration", before.grid, before.difference), ("foretold", before.grid, corrected.foretold),
        ("after demcor", corrected.demcor.grid, corrected.demcor.difference),
        ("after imgeo and new matching", corrected.imgeo.grid, corrected.imgeo.difference),
    )  # fmt: skip
    width = (drawing.WIDTH - 2.65) / 2.0
    height = width * before.grid.rows / before.grid.columns
    figure = drawing.new_figure(
        2 * height + 2.2, "DEM of even less DEM of odd photographs",
        f"UltraCamD, 80 % flight, 60 % models; {name}; grain {noise:g}; cm at a GSD of 9 cm; blue: no common ground",
    )  # fmt: skip
    limit = CM * float(np.nanpercentile(np.abs(before.difference), 98))
    image = None
    for k, (title, grid, values) in enumerate(panels):
        axes = drawing.axes_at(
            figure, 0.75 + (k % 2) * (width + 0.7), 0.65 + (1 - k // 2) * (height + 0.55), width, height
        )
        extent = (grid.left, grid.left + grid.columns * grid.cell_x, grid.top - grid.rows * grid.cell_y, grid.top)
        axes.set_facecolor("#cfe0f2")
        tones = {"cmap": "Greys_r", "vmin": -limit, "vmax": limit}
        image = axes.imshow(CM * values, extent=extent, interpolation="nearest", **tones)
        axes.set_title(f"{title}: σ {spread(values):.1f} cm", fontsize=8.5, loc="left")
        axes.set_xlabel("X [m]" if k > 1 else "")
        axes.set_ylabel("Y [m]" if k % 2 == 0 else "")
    scale = drawing.axes_at(figure, 0.75 + 2 * width + 0.85, 0.65, 0.14, 2 * height + 0.55)
    figure.colorbar(image, cax=scale).set_label("even − odd [cm]")
    return figure


if __name__ == "__main__":
    main()
