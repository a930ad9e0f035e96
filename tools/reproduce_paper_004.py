"""Tran Quoc Binh (2007), figures 4 to 7 in our form: error pickets and RMSE over the interval between pickets.

Two terrains, a plain and mountains, are rendered on grainy film-like photographs at 60 % end lap and matched at the
paper's intervals, counted in pixels on the ground: 20 to 120 m at a GSD of 1 m, as 45 to 120 m are at Lang Son's GSD of
1.12 m. The DTM of every interval is compared with the true surface; e = p·S/PSI² is drawn through the error pickets of
the smallest interval. Below stand the intervals that the paper chose in its areas beside those of its formula.

    python tools/reproduce_paper_004.py [FOLDER]

Last result (window 11 px, threshold 0.90; no accepted picket of any interval is off by more than 3 m):

    plain, relief 4 m RMS            mountains, relief 30 m RMS
    PSI m  pickets  errors  RMSE m   pickets  errors  holes  RMSE m
       20     1010       3   0.143       972       4     66   0.365
       30      437       3   0.144       460       2      0   0.638
       40      249       0   0.160       257       0      0   1.013
       60      119       0   0.244       114       1      0   2.297
       80       61       4   0.359        62       0      0   3.793
      100       48       0   0.532        44       1      0   7.288
      120       24       0   0.704        26       0      0   8.236
    straight line: R² 0.945                      R² 0.955

    area             scan µm   scale   chosen m  formula m  30·GSD m
    Co Loa                28    7000      30–40      42–46       5.9
    Duong Lam 1, 2        16   33000      50–70      69–76      15.8
    Ba Vi 1               20   32000     80–100      76–84      19.2
    Ba Vi 2               20   32000      60–80      64–72      19.2
    Lang Son              32   35000     80–100      85–95      33.6

Matching finds so few errors that the law e = p·S/PSI² cannot be told from chance: the paper's 5 to 30 % come from
shadows, water and plants, which these photographs do not have. The paper's Lang Son interval of 80–100 m and the
formula's are for its GSD of 1.12 m.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from aerotri.pipeline import adjust_keeping_system
from aerotri.rasters_images import create_image
from aerotri.report.canvas import GREY, INK, WIDTH, axes_at, new_figure, styled
from aerotri.report.rendering import save_plots
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.rendering import RenderOptions, make_scene, render
from aerotri.terrain.compare import RasterHeights, compare
from aerotri.terrain.dtm import TerrainPlan, make_terrain_model
from aerotri.terrain.interval import (
    K_MOUNTAINS,
    K_PLAIN,
    chosen_interval,
    expected_error_pickets,
    interval_by_formula,
    interval_by_rule,
)
from aerotri.terrain.surface import grid_over

INTERVALS = (20.0, 30.0, 40.0, 60.0, 80.0, 100.0, 120.0)
TERRAINS = {
    "plain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 4.0, "wavelength_m": 500.0},
    "mountains": {"kind": "undulating", "height_m": 300.0, "relief_rms_m": 30.0, "wavelength_m": 450.0},
}
GRAIN = RenderOptions(noise=450.0, contrast=0.25, detail_px=2.5)
WINDOW_PX, CELL_M = 11, 5.0
AREAS = (
    # area, scan µm, scale, k, intervals called optimal, of the paper's sections 3.1 to 3.4
    ("Co Loa", 28.0, 7000.0, K_PLAIN, "30–40"),
    ("Duong Lam 1, 2", 16.0, 33000.0, K_PLAIN, "50–70"),
    ("Ba Vi 1", 20.0, 32000.0, K_PLAIN, "80–100"),
    ("Ba Vi 2", 20.0, 32000.0, K_MOUNTAINS, "60–80"),
    ("Lang Son", 32.0, 35000.0, K_MOUNTAINS, "80–100"),
)


@dataclass(frozen=True)
class Row:
    """One interval: pickets measured, of them in error, gross errors left, RMSE m, holes."""

    interval: float
    pickets: int
    errors: int
    gross: int
    rmse: float
    holes: int


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    figures = {}
    for name, terrain in TERRAINS.items():
        rows, area = intervals_of(folder / name, terrain)
        tell(name, rows, area)
        figures[name] = draw(name, rows, area)
    save_plots(figures, folder / "plots")
    print(f"\nplots in {folder / 'plots'}")
    print(f"\n{'area':<16}{'scan µm':>9}{'scale':>8}{'chosen m':>11}{'formula m':>14}{'30·GSD m':>10}")
    for area_name, scan, scale, k, chosen in AREAS:
        low, high = (interval_by_formula(scan, scale, value) for value in k)
        rule = interval_by_rule(1e-6 * scan * scale)
        print(f"{area_name:<16}{scan:>9.0f}{scale:>8.0f}{chosen:>11}{f'{low:.0f}–{high:.0f}':>14}{rule:>10.1f}")


def intervals_of(folder: Path, terrain: dict) -> tuple[list[Row], float]:
    """Every interval matched and judged, and the area in m²."""
    folder.mkdir(parents=True, exist_ok=True)
    spec = parse_spec({
        "name": "pickets",
        "camera": {"rmk": {"preset": "rmk_top_15", "size_px": [800, 800], "pixel_um": 287.5}},
        "flight": {"gsd_m": 1.0, "strips": 1, "images_per_strip": 3, "end_lap": 0.6},
        "terrain": terrain,
        "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 20.0},
        "control": {"distance_bases": 1.0, "sigma_m": [0.05, 0.05, 0.05]},
        "start_values": {"kind": "perturbed"},
    })  # fmt: skip
    block, truth = simulate(spec, 7)
    scene = make_scene(spec, 7, block, truth, GRAIN)
    paths = []
    for k, name in enumerate(scene.names):
        paths.append(folder / f"{name}.tif")
        if not paths[-1].exists():
            pixels = render(scene, k)
            with create_image(paths[-1], *pixels.shape[::-1], 1, "uint16") as writer:
                writer.write(0, pixels[None])
    calibration = adjust_keeping_system(block)
    rows, area = [], 0.0
    for interval in INTERVALS:
        plan = TerrainPlan(
            np.arange(len(paths)), tuple(paths), interval, CELL_M, pairs=True, step=1, window_px=WINDOW_PX
        )  # fmt: skip
        found = make_terrain_model(calibration, plan)
        p = found.pickets
        own = p.accepted
        off = np.abs(p.xyz[own, 2] - scene.terrain.height(p.xyz[own, :2]))
        grid = grid_over(p.xyz[own, :2], CELL_M)
        x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
        control = scene.terrain.height(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        judged = compare(RasterHeights(found.dsm.grid, found.dsm.z), RasterHeights(grid, control), grid)
        gross = int((off > 3.0).sum())
        measured = int((own | p.errors).sum())
        holes = int((p.status != 1).sum()) - measured
        rows.append(Row(interval, measured, int(p.errors.sum()), gross, judged.statistics.rmse, holes))
        area = area or float((p.status != 1).sum() * interval**2)
    return rows, area


def tell(name: str, rows: list[Row], area: float) -> None:
    share = rows[0].errors / max(rows[0].pickets, 1)
    print(f"\n{name}: {area / 1e4:.0f} ha, window {WINDOW_PX} px, threshold 0.90")
    heads = ("interval m", 10), ("pickets", 9), ("errors", 8), ("p·S/PSI²", 10), ("over 3 m left", 15), ("holes", 7)
    print("".join(f"{text:>{width}}" for text, width in heads) + f"{'RMSE m':>9}")
    for row in rows:
        expected = expected_error_pickets(share, area, row.interval)
        print(f"{row.interval:>10.0f}{row.pickets:>9}{row.errors:>8}{expected:>10.1f}{row.gross:>15}{row.holes:>7}"
              f"{row.rmse:>9.3f}")  # fmt: skip
    interval, rmse = np.array([r.interval for r in rows]), np.array([r.rmse for r in rows])
    slope, constant = np.polyfit(interval, rmse, 1)
    r2 = 1.0 - np.var(rmse - slope * interval - constant) / np.var(rmse)
    print(f"RMSE = {constant:.3f} + {slope:.5f}·PSI, R² {r2:.3f}")
    twice = chosen_interval(interval, rmse, 2.0 * rmse[0])
    print(f"interval at which the RMSE is twice that of the smallest: {twice:.0f} m")


@styled
def draw(name: str, rows: list[Row], area: float) -> Figure:
    """Error pickets and the law through the first, RMSE on the right axis, as the paper's figures."""
    share = rows[0].errors / max(rows[0].pickets, 1)
    figure = new_figure(
        4.2, f"Error pickets and RMSE – {name}", f"{area / 1e4:.0f} ha, GSD 1 m, window {WINDOW_PX} px, threshold 0.90"
    )  # fmt: skip
    axes = axes_at(figure, 0.8, 0.9, WIDTH - 1.7, 2.5)
    interval = [row.interval for row in rows]
    fine = np.linspace(interval[0], interval[-1], 200)
    axes.plot(interval, [row.errors for row in rows], "-o", ms=4, color=INK, label="error pickets")
    axes.plot(fine, expected_error_pickets(share, area, fine), ":", color=INK, label="p·S/PSI²")
    axes.set_xlabel("PSI [m]")
    axes.set_ylabel("number of error pickets")
    axes.set_ylim(bottom=0.0)
    right = axes.twinx()
    right.plot(interval, [row.rmse for row in rows], "--s", ms=4, color=GREY, label="RMSE")
    right.set_ylabel("RMSE [m]")
    right.set_ylim(bottom=0.0)
    handles = axes.get_legend_handles_labels()[0] + right.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.09, 0.06), ncols=3)
    return figure


if __name__ == "__main__":
    main()
