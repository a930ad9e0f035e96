"""Tran Quoc Binh (2007), figures 4 to 7 in our form: error pickets and RMSE over the interval between pickets.

Two terrains, a plain and mountains, are rendered on grainy film-like photographs at 60 % end lap and matched at the
paper's intervals, counted in pixels on the ground: 20 to 120 m at a GSD of 1 m, as 45 to 120 m are at Lang Son's GSD of
1.12 m. What the paper's errors come from lies on the ground: fields of plants in rows, ponds that glitter anew in every
photograph, dark wood. The DTM of every interval is compared with the true surface; the law e = p·S/PSI² is drawn
through the error pickets. Below stand the intervals that the paper chose in its areas beside those of its formula.

    python tools/reproduce/reproduce_paper_004.py [FOLDER] [--keep]

Last result, in full in tools/results/paper_004.md (window 11 px, threshold 0.90):

    plain, relief 4 m RMS                    mountains, relief 30 m RMS
    PSI m  pickets  errors  law   RMSE m     pickets  errors  law  holes  RMSE m
       20      958     115  116    0.164         826      75   88    218   0.415
       30      418      55   52    0.173         421      49   39     43   0.800
       40      243      29   29    0.199         237      25   22     23   1.391
       60      116      15   13    0.273         109      12   10      6   2.927
       80       59       4    7    0.385          60       3    6      4   4.264
      100       47       3    5    0.661          43       3    4      1   8.978
      120       23       4    3    0.733          24       4    3      2   9.219
    straight line: R² 0.934                  R² 0.941
    errors go with PSI to the power −2.01    −1.77

The law holds on both (χ² 2.8 and 7.5 with 6 degrees of freedom), p 12 % on the plain as in Co Loa and Duong Lam 1 (8,
13 %). In the mountains errors are too few at 20 m: there a picket may step aside by 8 m only, and a fifth of the nodes
stay holes in the dark wood, at 30 m a tenth; the paper's software moves on until it succeeds and has none. Of 3580
accepted pickets four are off by more than 3 m. The RMSE in the mountains grows faster than in the paper's areas: relief
of 30 m RMS at a wavelength of 450 m is lost at 100 m.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

import aerotri
from aerotri import drawing, geometry, predict

INTERVALS = (20.0, 30.0, 40.0, 60.0, 80.0, 100.0, 120.0)
TERRAINS = {
    "plain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 4.0, "wavelength_m": 500.0},
    "mountains": {"kind": "undulating", "height_m": 300.0, "relief_rms_m": 30.0, "wavelength_m": 450.0},
}
LOOK = {"noise": 450.0, "contrast": 0.25, "detail_px": 2.5}
MEAN, NOISE = 16000.0, LOOK["noise"]
"""Grey values of the photographs: their mean and σ."""
PATCHES = {"plain": (("rows", 0.12), ("pond", 0.04)), "mountains": (("rows", 0.12), ("dark", 0.12))}
"""Share of the ground that is fields of plants in rows, ponds that glitter anew in every photograph, or dark wood."""
PATCH_RADIUS_M, ROWS_M, REACH_M = (25.0, 60.0), 7.0, 700.0
LOOKS = {"rows": (16000.0, 4500.0), "pond": (11000.0, 900.0), "dark": (1500.0, 0.0)}
"""Mean grey value of the patches, and how far rows rise and ponds glitter."""
NAMES = {"rows": "plants in rows", "pond": "ponds", "dark": "dark wood"}
RESULTS = Path(__file__).parents[1] / "results"
HEAD = """# Paper 004: error pickets and RMSE over the interval between pickets

Rendered film-like photographs, 60 % end lap, GSD 1 m, windows of 11 px, threshold 0.90, matched at the paper's
intervals. Error pickets are those that backward matching, a second place of nearly the same correlation, neighbours or
the TIN speak against; the law e = p·S/PSI² has the p that fits all intervals best (Poisson counts)."""
WINDOW_PX, CELL_M, MOST_PHOTOGRAPHS, GROUND_ROUNDS = 11, 5.0, 5, 25
AREAS = (
    # area, scan µm, scale, kind of terrain, intervals called optimal, of the paper's sections 3.1 to 3.4
    ("Co Loa", 28.0, 7000.0, "plain", "30–40"),
    ("Duong Lam 1, 2", 16.0, 33000.0, "plain", "50–70"),
    ("Ba Vi 1", 20.0, 32000.0, "plain", "80–100"),
    ("Ba Vi 2", 20.0, 32000.0, "mountains", "60–80"),
    ("Lang Son", 32.0, 35000.0, "mountains", "80–100"),
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="to work in")
    parser.add_argument("--keep", action="store_true", help="write tools/results/paper_004.md and its pictures")
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp())
    figures, lines = {}, [HEAD]
    for name, terrain in TERRAINS.items():
        rows, area = intervals_of(folder / name, terrain)
        lines += tell(name, rows, area)
        figures[f"paper_004_{name}"] = draw(name, rows, area)
    lines += areas()
    print("\n".join(lines))
    drawing.save_plots(figures, folder / "plots")
    print(f"\nplots in {folder / 'plots'}")
    if arguments.keep:
        (RESULTS / "paper_004.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
        for name in figures:
            shutil.copy(folder / "plots" / f"{name}.png", RESULTS)


def areas() -> list[str]:
    """The intervals the paper chose beside those of its formula and of the older rule."""
    lines = [
        "",
        "## Intervals of the paper",
        "",
        "| area | scan µm | scale | chosen m | formula m | 30·GSD m |",
        "|---|---|---|---|---|---|",
    ]
    for area_name, scan, scale, kind, chosen in AREAS:
        found = predict.picket_interval(scan_um=scan, scale=scale)
        low, high = found.by_formula[kind]
        lines.append(
            f"| {area_name} | {scan:.0f} | {scale:.0f} | {chosen} | {low:.0f}–{high:.0f} | {found.older_rule:.1f} |"
        )
    return lines


def intervals_of(folder: Path, terrain: dict) -> tuple[list[Row], float]:
    """Every interval matched and judged, and the area in m²."""
    flight = aerotri.simulate({
        "name": "pickets",
        "camera": {"rmk": {"preset": "rmk_top_15", "size_px": [800, 800], "pixel_um": 287.5}},
        "flight": {"gsd_m": 1.0, "strips": 1, "images_per_strip": 3, "end_lap": 0.6},
        "terrain": terrain,
        "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 20.0},
        "control": {"distance_bases": 1.0, "sigma_m": [0.05, 0.05, 0.05]},
        "start_values": {"kind": "perturbed"},
    }, 7)  # fmt: skip
    paint(flight, folder, patches(PATCHES[folder.name]))
    result = aerotri.adjust(flight.block, explain=False)
    rows, area = [], 0.0
    for interval in INTERVALS:
        found = aerotri.terrain(
            result, folder / "painted", interval=interval, cell=CELL_M, pairs=True, step=1, window=WINDOW_PX,
            most_photographs=MOST_PHOTOGRAPHS,
        )  # fmt: skip
        p, grid = found.record.pickets, found.dsm.grid
        own = p.accepted
        off = np.abs(p.xyz[own, 2] - flight.true_heights(p.xyz[own, :2]))
        x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
        true = flight.true_heights(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        control = aerotri.Surface.of_array(true, left=grid.left, top=grid.top, cell=CELL_M)
        rmse = aerotri.compare(found.dsm, control).rmse
        gross = int((off > 3.0).sum())
        measured = int((own | p.errors).sum())
        holes = int((p.status != 1).sum()) - measured
        rows.append(Row(interval, measured, int(p.errors.sum()), gross, rmse, holes))
        area = area or float((p.status != 1).sum() * interval**2)
    return rows, area


def patches(shares: tuple[tuple[str, float], ...]) -> list[tuple[str, float, float, float, float]]:
    """Kind, middle X and Y, radius m and direction of the rows of every patch, the same for all photographs."""
    rng, out = np.random.default_rng(3), []
    for kind, share in shares:
        area = 0.0
        # patches lie over one another at times: those of a Poisson process cover 1 − exp(−Σ area)
        while area < -np.log(1.0 - share) * (2.0 * REACH_M) ** 2:
            radius = rng.uniform(*PATCH_RADIUS_M)
            out.append((kind, *rng.uniform(-REACH_M, REACH_M, 2), radius, rng.uniform(0.0, np.pi)))
            area += np.pi * radius**2
    return out


def paint(flight, folder: Path, found: list) -> None:
    """Photographs with their patches, in painted/; those that are there stay."""
    names = flight.block.images.names.tolist()
    (folder / "painted").mkdir(parents=True, exist_ok=True)
    if all((folder / "painted" / f"{name}.tif").exists() for name in names):
        return
    flown = flight.save(folder / "flown", photographs=True, **LOOK) / "photographs"
    for k, name in enumerate(names):
        pixels = cv2.imread(str(flown / f"{name}.tif"), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(folder / "painted" / f"{name}.tif"), painted(flight, k, pixels, found))


def painted(flight, image: int, pixels: np.ndarray, found: list) -> np.ndarray:
    """The photograph with its patches."""
    camera, truth = flight.block.cameras[0], flight.truth
    column, row = np.meshgrid(np.arange(pixels.shape[1]) + 0.5, np.arange(pixels.shape[0]) + 0.5)
    xy = geometry.mm_from_px(np.column_stack([column.ravel(), row.ravel()]), camera.size_px, camera.pixel_mm)
    rotation = geometry.rotation_from_angles(truth.angles[image], flight.block.rotation)
    ray = np.column_stack([xy, np.full(len(xy), -camera.focal_length_mm)]) @ rotation.T
    centre, height = truth.centre[image], np.full(len(xy), flight.plan.terrain.height_m)
    for _ in range(GROUND_ROUNDS):
        plan = centre[:2] + (height - centre[2])[:, None] * ray[:, :2] / ray[:, 2:]
        height = flight.true_heights(plan)
    out, rng = pixels.astype(float).ravel(), np.random.default_rng(image)
    for kind, x, y, radius, direction in found:
        own = np.flatnonzero(np.hypot(plan[:, 0] - x, plan[:, 1] - y) < radius)
        mean, size = LOOKS[kind]
        # light and shade of the ground stay a little; what a pond shows is never the same again
        change = 0.15 * (out[own] - MEAN) * mean / MEAN
        if kind == "rows":
            phase = 2.0 * np.pi * (plan[own] @ (np.cos(direction), np.sin(direction))) / ROWS_M
            change = change + size * np.sin(phase)
        elif kind == "pond":
            change = size * rng.normal(size=len(own))
        out[own] = mean + change + NOISE * rng.normal(size=len(own))
    return np.clip(np.rint(out), 0.0, 65535.0).astype(np.uint16).reshape(pixels.shape)


def error_share(rows: list[Row], area: float) -> float:
    """p of the law e = p·S/PSI² through all intervals, by maximum likelihood of Poisson counts."""
    return sum(row.errors for row in rows) / sum(area / row.interval**2 for row in rows)


def tell(name: str, rows: list[Row], area: float) -> list[str]:
    share = error_share(rows, area)
    patches_text = ", ".join(f"{100 * part:.0f} % {NAMES[kind]}" for kind, part in PATCHES[name])
    lines = [
        "",
        f"## {name[0].upper() + name[1:]}: {area / 1e4:.0f} ha, relief {TERRAINS[name]['relief_rms_m']:g} m RMS, "
        f"{patches_text}",
        "",
        "| PSI m | pickets | error pickets | % | p·S/PSI² | holes | off by more than 3 m, accepted | RMSE m |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        expected, percent = predict.error_pickets(share, area, row.interval), 100.0 * row.errors / row.pickets
        lines.append(
            f"| {row.interval:.0f} | {row.pickets} | {row.errors} | {percent:.1f} | {expected:.1f} | {row.holes} "
            f"| {row.gross} | {row.rmse:.3f} |"
        )
    interval, rmse = np.array([r.interval for r in rows]), np.array([r.rmse for r in rows])
    slope, constant = np.polyfit(interval, rmse, 1)
    r2 = 1.0 - np.var(rmse - slope * interval - constant) / np.var(rmse)
    errors, law = np.array([r.errors for r in rows]), predict.error_pickets(share, area, interval)
    power = np.polyfit(np.log(interval[errors > 0]), np.log(errors[errors > 0]), 1, w=np.sqrt(errors[errors > 0]))[0]
    chi2 = float(np.sum((errors - law) ** 2 / law))
    twice = np.exp(np.interp(np.log(2.0 * rmse[0]), np.maximum.accumulate(np.log(rmse)), np.log(interval)))
    return [
        *lines,
        "",
        f"RMSE = {constant:.3f} + {slope:.5f}·PSI, R² {r2:.3f}; error pickets go with PSI to the power {power:.2f} and "
        f"leave the law by χ² = {chi2:.1f} with {len(rows) - 1} degrees of freedom. The RMSE is "
        f"twice that of the smallest interval at {twice:.0f} m.",
        "",
        f"![error pickets and RMSE over the interval](paper_004_{name}.png)",
    ]


@drawing.styled
def draw(name: str, rows: list[Row], area: float) -> Figure:
    """Error pickets and the law, RMSE on the right axis, as the paper's figures."""
    share = error_share(rows, area)
    figure = drawing.new_figure(
        4.2, f"Error pickets and RMSE – {name}", f"{area / 1e4:.0f} ha, GSD 1 m, window {WINDOW_PX} px, threshold 0.90"
    )  # fmt: skip
    axes = drawing.axes_at(figure, 0.8, 0.9, drawing.WIDTH - 1.7, 2.5)
    interval = [row.interval for row in rows]
    fine = np.linspace(interval[0], interval[-1], 200)
    axes.plot(interval, [row.errors for row in rows], "-o", ms=4, color=drawing.INK, label="error pickets")
    axes.plot(fine, predict.error_pickets(share, area, fine), ":", color=drawing.INK, label="p·S/PSI²")
    axes.set_xlabel("PSI [m]")
    axes.set_ylabel("number of error pickets")
    axes.set_ylim(bottom=0.0)
    right = axes.twinx()
    right.plot(interval, [row.rmse for row in rows], "--s", ms=4, color=drawing.GREY, label="RMSE")
    right.set_ylabel("RMSE [m]")
    right.set_ylim(bottom=0.0)
    handles = axes.get_legend_handles_labels()[0] + right.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.09, 0.06), ncols=3)
    return figure


if __name__ == "__main__":
    main()
