"""Dense surfaces of rendered photographs against the ground: coverage, bias, spread and normalised errors by scene.

Measures σ of matching alone and what semi-global matching alone gives, so it looks inside the package on purpose.
Every scene is a block of two strips with 70 % end and 40 % side lap, rendered with noise, its tie points as good as
free of error, so that what is judged is the matching. Cells that two photographs see count as coverable (from the true
ground; what a house hides is not taken off). σ is that of matching alone; in the scene of y-parallaxes, whose tie
points have half a pixel, that of all. Repeated texture, shadow, water and glass (nothing but noise) are patches of
120 m × 80 m, and the wall is the ground within 20 m of it: only there errors are looked at. z is error over σ; NMAD is
in pixels on the ground, beside the NMAD of semi-global matching (SGM) alone (OpenCV's, without least squares and
without σ) on the same pairs.
Steep: cells within four of a step of more than 3 m, six pixels, such as walls of houses. σ / e is the root mean
square of σ over that of the errors. The second table has the root mean square of sums of errors over squares of
cells of a metre, over their σ by the noise length and the lasting errors that the surface states; one between them has
std z by classes of slope.
The last table is of cameras that err, adjusted with Brown's parameters before: "self-calibrated" errs by these alone,
"errors left" by lens, film and unflatness as of `simulation.camera_errors`, 5 µm, of which parameters describe a part.
Every draw is another camera. z holds the adjustment's share of σ as well, beside z of matching alone; of all cells of
all draws, with the smallest and the largest of a draw. Residual: σ̂0 of the adjustment.

    python tools/prove/dense_surface.py [FOLDER] [--scenes hill …] [--held] > tools/results/dense_surface.md

Draws that FOLDER has from an earlier run are not measured again.

Last result: tools/results/dense_surface.md.

Steep cells of houses, few photographs, wall and trees have a table of their own as well (`--held`): eight draws on
which no constant was chosen, together, with the smallest and the largest of a draw and what the mean of draws is good
to (standard error over draws). Houses, few photographs, wall, trees and glass are twelve draws, on the first two of
which the constants were chosen, water, repeated texture and shadow four. On noisy or weak texture semi-global matching
alone scatters less: it smooths over more than a window. What is measured of the glass is its rim, whose windows see
ground. With tie points of half a pixel σ holds the adjustment, which all cells of a draw share: std z is then the root
mean square of z over all cells of twenty draws, on the same photographs, and semi-global matching is that of the first.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_dilation, grey_closing

import aerotri
from aerotri.public.dense import DenseSurface
from aerotri.rasters.grids import Grid
from aerotri.simulation.rendering_texture import Lattice, Texture
from aerotri.terrain.dense import tile
from aerotri.terrain.dense.lasting import lasting_errors
from aerotri.terrain.dense.parallaxes import Parallaxes, semi_global
from aerotri.volume.lasting import Lasting, lasting_variance_of_cells
from runs_elsewhere import Runs, add_executor, folder_of, runs_of

GSD_M, STEEP_M, FEWEST = 0.5, 1.5, 100
SPEC = {
    "name": "dense",
    "camera": {"cam": {"size_px": [1000, 750], "pixel_um": 30.0, "focal_length_mm": 30.0}},
    "flight": {"gsd_m": GSD_M, "strips": 2, "images_per_strip": 4, "end_lap": 0.7, "side_lap": 0.4, "heading_deg": 30.0,
               "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [3.0, 3.0, 2.0]},
    "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 0.0, "stated_sigma_um": 0.03, "margin_px": 5.0},
    "control": {"distance_bases": 1.0, "sigma_m": [0.0, 0.0, 0.0], "stated_sigma_m": [0.001, 0.001, 0.001]},
}  # fmt: skip
HOUSES = [
    [-120.0 + 60.0 * i, -100.0 + 70.0 * j, 22.0, 14.0, 6.0 + 3.0 * ((i + j) % 3)] for i in range(5) for j in range(4)
]
QUARRY = {"hill_height_m": -30.0, "hill_radius_m": 70.0}
SCENES: dict[str, tuple[dict, dict]] = {
    "plain": ({"kind": "flat"}, {}),
    "undulating": ({"kind": "undulating", "relief_rms_m": 6.0, "wavelength_m": 150.0}, {}),
    "hill": ({"kind": "hill", "hill_height_m": 40.0, "hill_radius_m": 80.0}, {}),
    "quarry": ({"kind": "undulating", "relief_rms_m": 2.0, "wavelength_m": 100.0, **QUARRY}, {}),
    "houses": ({"kind": "undulating", "relief_rms_m": 2.0, "wavelength_m": 150.0, "houses": HOUSES}, {}),
    "noisy": ({"kind": "undulating", "relief_rms_m": 6.0, "wavelength_m": 150.0}, {"noise": 600.0}),
    "weak texture": (
        {"kind": "undulating", "relief_rms_m": 6.0, "wavelength_m": 150.0}, {"contrast": 0.03, "noise": 150.0},
    ),
    "no texture": ({"kind": "flat"}, {"contrast": 0.004, "noise": 300.0}),
}  # fmt: skip
"""Ground and how it is rendered."""


def crowns() -> list[list[float]]:
    """Sixty blocks of 4 to 8 m, 4 to 12 m high, in no order: as trees stand, each as a box."""
    rng = np.random.default_rng(7)
    xy, side, height = rng.uniform(-130.0, 130.0, (60, 2)), rng.uniform(4.0, 8.0, 60), rng.uniform(4.0, 12.0, 60)
    return [[float(x), float(y), float(s), float(s), float(h)] for (x, y), s, h in zip(xy, side, height, strict=True)]


WALL = [[0.0, 0.0, 150.0, 4.0, 12.0], [-60.0, 60.0, 6.0, 6.0, 20.0], [60.0, -60.0, 6.0, 6.0, 20.0]]
UNDULATING = {"kind": "undulating", "relief_rms_m": 6.0, "wavelength_m": 150.0}
SCENES |= {
    "repeated texture": (UNDULATING, {}), "shadow": (UNDULATING, {}), "water": (UNDULATING, {}),
    "glass": (UNDULATING, {}), "wall": (UNDULATING | {"houses": WALL}, {}),
    "trees": (UNDULATING | {"houses": crowns()}, {}),
    "few photographs": SCENES["houses"], "tilted": (UNDULATING, {}), "y-parallax": (UNDULATING, {}),
    "self-calibrated": (UNDULATING, {}), "errors left": (UNDULATING, {}), "errors left, plain": ({"kind": "flat"}, {}),
    "errors left, noise": (UNDULATING, {}),
}  # fmt: skip
WELL_INSIDE = [[along, across] for along in (0.05, 0.35, 0.65, 0.95) for across in (0.15, 0.5, 0.85)]
"""Control, along and across the block: photographs that are tilted by chance need not show its corners."""
OTHER_SPEC: dict[str, dict[str, dict]] = {
    "few photographs": {"flight": {"strips": 1, "images_per_strip": 3}},
    "tilted": {
        "flight": {"attitude_sigma_deg": [12.0, 12.0, 10.0]},
        "control": {"distance_bases": None, "positions": WELL_INSIDE},
    },
    "errors left, noise": {"tie_points": {"per_image": 200, "sigma_um": 1.5, "stated_sigma_um": 1.5}},
    "y-parallax": {"tie_points": {"sigma_um": 0.0, "stated_sigma_um": 15.0}},
}
"""What differs from the block of the other scenes."""
BY_BROWN = {"brown": {"K1": 2e-5, "K2": -3e-8, "P1": 1e-5, "P2": -1e-5}}, "brown:K1+K2+P1+P2"
IN_PART = {"physical": {"rms_um": 5.0}}, "brown:K1+K2+K3+P1+P2"
ERRING: dict[str, tuple[dict, str]] = {
    "self-calibrated": BY_BROWN, "errors left": IN_PART, "errors left, plain": IN_PART, "errors left, noise": IN_PART,
}  # fmt: skip
"""What is wrong with the camera, and the parameters that are adjusted."""
FIRST_CAMERA, CAMERAS = 101, 12
"""Seeds of the draws of erring cameras: no constant was chosen on these. Scenes share them, a seed is one camera."""
TIE_SIGMA_MM, DRAWS = {"y-parallax": 0.015}, 20
"""Error of tie points, and of how many draws of it the errors of a scene are taken together."""
SEEDS = {
    "houses": 12, "few photographs": 12, "wall": 12, "trees": 12, "glass": 12, "water": 4, "repeated texture": 4,
    "shadow": 4, "self-calibrated": 4,
}  # fmt: skip
"""Flights and textures of a scene whose errors are taken together: where few cells tell, or a few gross errors do."""
BESIDE_STEPS, HELD = ("houses", "few photographs", "wall", "trees"), tuple(range(5, 13))
"""Scenes with steps, and draws of them on which no constant was chosen."""
PATCH_M, PERIOD_NODES, SHADOW, WATER, CONTRAST = (60.0, 40.0), 12, 0.12, 0.02, 0.25
"""Half sides of the patch that is painted, nodes after which a texture repeats (a metre each), share of the light
left in shadow, of the contrast on water, and contrast of the rendering."""


def in_patch(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (np.abs(x) < PATCH_M[0]) & (np.abs(y) < PATCH_M[1])


def near_wall(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (np.abs(x) < 90.0) & (np.abs(y) < 20.0)


JUDGED: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "repeated texture": in_patch, "shadow": in_patch, "water": in_patch, "glass": in_patch, "wall": near_wall,
}  # fmt: skip
"""Where the errors of a scene are looked at; everywhere in others."""


def painted(name: str, lattice: Lattice) -> Lattice:
    """The texture of the ground with what lies on it in a scene."""
    if name not in ("repeated texture", "shadow", "water", "glass"):
        return lattice
    values, spacing = lattice.values.copy(), lattice.spacing
    rows, columns = lattice.row + np.arange(values.shape[0]), lattice.column + np.arange(values.shape[1])
    inside = in_patch(spacing * columns[None, :], spacing * rows[:, None])
    if name == "shadow":
        other = (SHADOW - 1.0) / CONTRAST + SHADOW * values
    elif name == "water":
        other = WATER * values
    elif name == "glass":
        other = 0.0 * values
    else:
        pattern = np.random.default_rng(5).normal(scale=2.0, size=(PERIOD_NODES, PERIOD_NODES))
        other = pattern[np.ix_(rows % PERIOD_NODES, columns % PERIOD_NODES)]
    return replace(lattice, values=np.where(inside, other, values).astype(np.float32))


SLOPES = {"to 10 %": (0.0, 0.1), "10 to 30 %": (0.1, 0.3), "above 30 %": (0.3, np.inf)}
"""Classes of the slope of the true ground."""
BYTES_OF_SEED = 2_000_000_000
"""Memory of a flight with its photographs and surface; chosen [C]."""
SIDES = (5, 10, 20, 40, 80)
"""Cells along a side of the squares over which errors are added up."""
HEAD = (
    "| scene | cover | median px | NMAD px | SGM px | σ px | std z | NMAD z | > 4 σ | σ / e | steep z | > 4 σ |"
    " σ / e |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|"
)
HELD_HEAD = (
    "| beside steps, draws not used | cells | std z | ± | of draws | > 4 σ | ± | of draws | σ / e |\n"
    "|---|---|---|---|---|---|---|---|---|"
)
NARROW_HEAD = (
    "| beside steps | in gaps narrower than three cells | std z | > 4 σ | other cells | std z | > 4 σ |\n"
    "|---|---|---|---|---|---|---|"
)
ERRING_HEAD = (
    "| erring camera | residual px | cover | NMAD px | alone: σ px | std z | > 4 σ | σ px | z |"
    " ± | of draws | > 4 σ |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True, eq=False)
class Cells:
    """Errors and σ, m, of the cells that have a height; whether each is steep; share of those that could have one.

    slope : of the true ground, metres a metre. shared : m, σ by the adjustment.
    narrow : whether a cell lies in a gap narrower than three cells, with higher ground on both sides.
    sums : by side, the sums of the errors over squares over their σ, by what neighbours share.
    residual : px, σ̂0 of an image coordinate.
    """

    error: np.ndarray
    sigma: np.ndarray
    steep: np.ndarray
    slope: np.ndarray
    coverage: float
    sums: dict[int, np.ndarray]
    shared: np.ndarray
    narrow: np.ndarray
    residual: float = 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--seed", type=int, nargs="+", help="flights and textures; those of the tables where not given")
    parser.add_argument("--held", action="store_true", help="steps alone, on draws on which no constant was chosen")
    add_executor(parser)
    arguments = parser.parse_args()
    folder = folder_of(arguments.folder, arguments)
    added, by_slope, beside = [], [], {}
    with runs_of(arguments) as runs:
        if arguments.held:
            tell_held([name for name in arguments.scenes if name in BESIDE_STEPS], arguments.seed, runs, folder)
            return
        if known := [name for name in arguments.scenes if name not in ERRING]:
            print(HEAD, flush=True)
        for name in known:
            seeds = list(range(1, SEEDS.get(name, 1) + 1)) if not arguments.seed else arguments.seed
            try:
                found = runs(of_seed, (folder, name), seeds, BYTES_OF_SEED)
            except aerotri.InputError as error:
                print(f"| {name} | {str(error).partition(' — ')[0]} |", flush=True)
                continue
            own, alone = (together([pair[k] for pair in found]) for k in (0, 1))
            print(row(name, own, alone), flush=True)
            if name not in TIE_SIGMA_MM:  # all cells of a draw share the errors of its adjustment
                added.append(f"| {name} | " + " | ".join(of_sums(own.sums[side]) for side in SIDES) + " |")
            by_slope.append(f"| {name} | " + " | ".join(of_slope(own, *bounds) for bounds in SLOPES.values()) + " |")
            beside[name] = own
        if by_slope:
            print("\n| std z by slope, and beyond 4 σ | " + " | ".join(SLOPES) + " |\n|---|---|---|---|")
            print(*by_slope, sep="\n")
        if added:
            print("\n| sums over squares of, cells | " + " | ".join(map(str, SIDES)) + " |\n|---|---|---|---|---|---|")
            print(*added, sep="\n")
        tell_narrow(beside)
        tell_erring([name for name in arguments.scenes if name in ERRING], arguments.seed, runs, folder)


def tell_held(names: list[str], seeds: list[int] | None, runs: Runs, folder: Path) -> None:
    """The table of cells beside steps of draws on which no constant was chosen."""
    print(HELD_HEAD, flush=True)
    beside = {}
    for name in names:
        draws = [own for own, _ in runs(of_seed, (folder, name), seeds or HELD, BYTES_OF_SEED)]
        own, each = together(draws), [(d.error / d.sigma)[d.steep] for d in draws]
        z = (own.error / own.sigma)[own.steep]
        spreads, shares = [float(np.std(one)) for one in each], [share_beyond(one) for one in each]
        numbers = (
            f"{len(z)}", f"{np.std(z):.2f}", f"{of_mean(spreads):.2f}", f"{min(spreads):.2f} to {max(spreads):.2f}",
            f"{share_beyond(z):.2f} %", f"{of_mean(shares):.2f}", f"{min(shares):.2f} to {max(shares):.2f}",
            f"{rms(own.sigma[own.steep]) / rms(own.error[own.steep]):.2f}",
        )  # fmt: skip
        print(f"| {name} | " + " | ".join(numbers) + " |", flush=True)
        beside[name] = own
    tell_narrow(beside)


def tell_narrow(scenes: dict[str, Cells]) -> None:
    """The table of cells in narrow gaps beside steps, and of the other cells there, of the scenes that have any."""
    found = {name: own for name, own in scenes.items() if (own.narrow & own.steep).any()}
    if found:
        print("\n" + NARROW_HEAD, flush=True)
    for name, own in found.items():
        z = own.error / own.sigma
        parts = []
        for of in (own.steep & own.narrow, own.steep & ~own.narrow):
            parts += [f"{of.sum()}", f"{np.std(z[of]):.2f}", f"{share_beyond(z[of]):.2f} %"]
        print(f"| {name} | " + " | ".join(parts) + " |", flush=True)


def of_mean(values: list[float]) -> float:
    """Standard error of the mean of draws."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


def tell_erring(names: list[str], seeds: list[int] | None, runs: Runs, folder: Path) -> None:
    """The table of cameras that err."""
    if names:
        print("\n" + ERRING_HEAD, flush=True)
    for name in names:
        drawn = seeds or list(range(FIRST_CAMERA, FIRST_CAMERA + SEEDS.get(name, CAMERAS)))
        draws = [own for own, _ in runs(of_seed, (folder, name), drawn, BYTES_OF_SEED)]
        own = together(draws)
        z, total = own.error / own.sigma, own.error / np.hypot(own.sigma, own.shared)
        single = [rms(d.error / np.hypot(d.sigma, d.shared)) for d in draws]
        pixels = [
            m / GSD_M for m in (nmad(own.error), np.median(own.sigma), np.median(np.hypot(own.sigma, own.shared)))
        ]
        doubt = of_mean(np.square(single).tolist()) / (2.0 * rms(total))
        numbers = (
            f"{np.mean([d.residual for d in draws]):.3f}", f"{own.coverage:.3f}", f"{pixels[0]:.3f}",
            f"{pixels[1]:.3f}", f"{np.std(z):.2f}", f"{share_beyond(z):.2f} %", f"{pixels[2]:.3f}", f"{rms(total):.2f}",
            f"{doubt:.2f}", f"{min(single):.2f} to {max(single):.2f}", f"{share_beyond(total):.2f} %",
        )  # fmt: skip
        print(f"| {name} | " + " | ".join(numbers) + " |", flush=True)


def of_sums(sums: np.ndarray) -> str:
    """Their root mean square; '' where no square is whole."""
    return f"{rms(sums):.2f}" if len(sums) else ""


def of_slope(own: Cells, low: float, high: float) -> str:
    """std z and share beyond 4 σ of the cells off steps whose ground has that slope."""
    z = (own.error / own.sigma)[~own.steep & (own.slope >= low) & (own.slope < high)]
    return f"{np.std(z):.2f} ({share_beyond(z):.2f} %)" if len(z) > FEWEST else ""


def row(name: str, own: Cells, alone: Cells) -> str:
    """A line of the table."""
    if len(own.error) < FEWEST:
        return f"| {name} | {own.coverage:.3f} |"
    flat, z = ~own.steep, own.error / own.sigma
    steep = z[own.steep]
    beside = ("", "", "")
    if len(steep) > FEWEST:
        ratio = rms(own.sigma[own.steep]) / rms(own.error[own.steep])
        beside = (f"{np.std(steep):.2f}", f"{share_beyond(steep):.2f} %", f"{ratio:.2f}")
    numbers = (
        f"{own.coverage:.3f}", f"{np.median(own.error[flat]) / GSD_M:+.3f}", f"{nmad(own.error[flat]) / GSD_M:.3f}",
        f"{nmad(alone.error[~alone.steep]) / GSD_M:.3f}", f"{np.median(own.sigma[flat]) / GSD_M:.3f}",
        f"{rms(z[flat]) if name in TIE_SIGMA_MM else np.std(z[flat]):.2f}", f"{nmad(z[flat]):.2f}",
        f"{share_beyond(z[flat]):.2f} %", f"{rms(own.sigma[flat]) / rms(own.error[flat]):.2f}", *beside,
    )  # fmt: skip
    return f"| {name} | " + " | ".join(numbers) + " |"


def of_seed(shared: tuple[Path, str], seed: int) -> tuple[Cells, Cells]:
    """`measured` of a scene, in a folder of its own, and kept there."""
    folder, name = shared
    place = folder / name.replace(",", "").replace(" ", "_") / f"seed_{seed}"
    file = place / "cells.npz"
    if file.is_file():
        return kept(file)
    both = measured(place, name, seed)
    keep(file, both)
    return both


def keep(file: Path, both: tuple[Cells, Cells]) -> None:
    """Write the cells of a draw and those of semi-global matching alone."""
    arrays = {f"{k}_{name}": value for k, one in enumerate(both) for name, value in vars(one).items() if name != "sums"}
    sums = {f"{k}_sums_{side}": one.sums[side] for k, one in enumerate(both) for side in SIDES}
    np.savez(file, **arrays, **sums)


def kept(file: Path) -> tuple[Cells, Cells]:
    """What `keep` wrote."""
    with np.load(file) as read:
        first, second = (
            Cells(
                *(read[f"{k}_{name}"] for name in ("error", "sigma", "steep", "slope")), float(read[f"{k}_coverage"]),
                {side: read[f"{k}_sums_{side}"] for side in SIDES}, read[f"{k}_shared"], read[f"{k}_narrow"],
                float(read[f"{k}_residual"]),
            )
            for k in (0, 1)
        )  # fmt: skip
    return first, second


def measured(folder: Path, name: str, seed: int) -> tuple[Cells, Cells]:
    """The cells of one flight, and those of semi-global matching alone; of a camera that errs the same again."""
    ground, look = SCENES[name]
    spec = SPEC | {"terrain": {"height_m": 50.0} | ground}
    spec |= {table: SPEC[table] | other for table, other in OTHER_SPEC.get(name, {}).items()}
    wrong, parameters = ERRING.get(name, ({}, None))
    spec |= {"camera": {"cam": SPEC["camera"]["cam"] | {"errors": wrong}}}
    flight = aerotri.simulate(spec, seed)
    photographs = render(folder / "flown", flight, name, look)
    results = [aerotri.adjust(one, parameters=parameters, explain=False) for one in blocks(flight.block, name, seed)]
    own = together([cells_of(aerotri.dense_surface(result, photographs), flight, name) for result in results])
    if name in ERRING:
        own = replace(own, residual=results[0].adjusted.outcome.sigma0_um / SPEC["camera"]["cam"]["pixel_um"])
        return own, own
    return own, cells_of(semi_global_surface(results[0], photographs), flight, name)


def blocks(block: aerotri.Block, name: str, seed: int) -> list[aerotri.Block]:
    """The block of a scene, or several with other errors of the tie points."""
    if name not in TIE_SIGMA_MM:
        return [block]
    rng, rays = np.random.default_rng(seed), block.image_points
    noise = rng.normal(scale=TIE_SIGMA_MM[name], size=(DRAWS, *rays.xy.shape))
    return [replace(block, image_points=replace(rays, xy=rays.xy + one)) for one in noise]


def together(draws: list[Cells]) -> Cells:
    """The cells of several draws as if they were one."""
    names = "error", "sigma", "steep", "slope", "shared", "narrow"
    cells = {of: np.concatenate([getattr(d, of) for d in draws]) for of in names}
    sums = {side: np.concatenate([d.sums[side] for d in draws]) for side in SIDES}
    return Cells(**cells, coverage=float(np.mean([d.coverage for d in draws])), sums=sums)


def render(folder: Path, flight, name: str, look: dict) -> Path:
    """The folder of the photographs."""
    bare = Texture.lattice
    Texture.lattice = lambda self, low, high: painted(name, bare(self, low, high))  # type: ignore[method-assign]
    try:
        return flight.save(folder, photographs=True, **look) / "photographs"
    finally:
        Texture.lattice = bare


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def share_beyond(z: np.ndarray) -> float:
    """Per cent beyond 4 σ."""
    return 100.0 * float(np.mean(np.abs(z) > 4.0))


def nmad(values: np.ndarray) -> float:
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def semi_global_surface(result: aerotri.Adjustment, photographs: Path) -> DenseSurface:
    """The same surface with what OpenCV gives in place of our parallaxes."""
    ours = tile.parallaxes_of

    def theirs(images) -> Parallaxes:
        value = semi_global(images)
        sigma = np.where(np.isfinite(value), np.float32(0.3), np.float32(np.nan))
        return Parallaxes(value, sigma, 0.0, 1.0)

    tile.parallaxes_of = theirs
    try:
        return aerotri.dense_surface(result, photographs)
    finally:
        tile.parallaxes_of = ours


def cells_of(found: DenseSurface, flight, name: str) -> Cells:
    """The cells of a surface against the true ground, where a scene is judged."""
    o = found.record
    errors, sigmas, steeps, slopes, shares, narrow, able, measured = [], [], [], [], [], [], 0, 0
    sums: dict[int, list[float]] = {side: [] for side in SIDES}
    length = found.summary["noise_length_m"] or 0.0
    lasting = Lasting(*lasting_errors(o.pixel, float(np.median(o.photographs.gsd)) * 2**o.level))
    for window, part in o.files.read_all(list(o.windows)):
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        if min(grid.rows, grid.columns) < 2:
            # a last row or column of cells by itself has no slope
            continue
        truth = truth_on(grid, flight)
        judged = np.ones(truth.shape, bool)
        if name in JUDGED:
            x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
            judged = JUDGED[name](x, y)
        known = np.isfinite(part.z) & judged
        seen = seen_twice(o, grid, truth) & judged
        able += int(seen.sum())
        measured += int((known & seen).sum())
        change = np.maximum(*(np.abs(slope) for slope in np.gradient(truth)))
        steep = binary_dilation(change > STEEP_M, iterations=4)
        errors.append((part.z - truth)[known])
        share = o.shared.over(grid)
        sigma = np.hypot(part.sigma, share) if name in TIE_SIGMA_MM else part.sigma
        shares.append(share[known])
        narrow.append(in_narrow_gap(truth)[known])
        sigmas.append(sigma[known])
        steeps.append(steep[known])
        slopes.append(np.hypot(*np.gradient(truth, grid.cell_x))[known])
        sharing = max(1.0, length**2 / (grid.cell_x * grid.cell_y))
        for side in SIDES:
            whole = lasting_variance_of_cells(np.ones((side, side)), (grid.cell_x, grid.cell_y), lasting)
            sums[side] += sums_over_squares(part.z - truth, np.sqrt(sharing) * sigma, known & ~steep, side, whole)
    return Cells(
        *(np.concatenate(part) for part in (errors, sigmas, steeps, slopes)), measured / max(able, 1),
        {side: np.array(own) for side, own in sums.items()}, np.concatenate(shares),
        np.concatenate(narrow),
    )  # fmt: skip


def in_narrow_gap(truth: np.ndarray) -> np.ndarray:
    """(rows, columns) whether ground a step higher lies on both sides of a cell, less than three cells apart."""
    closed = np.maximum(grey_closing(truth, (3, 1)), grey_closing(truth, (1, 3)))
    return closed - truth > STEEP_M


def sums_over_squares(
    error: np.ndarray, sigma: np.ndarray, judged: np.ndarray, side: int, lasting: float
) -> list[float]:
    """Sums of errors over σ, of the squares of which nearly all cells are judged.

    Parameters
    ----------
    lasting : m², variance of the sum of a whole square by the errors that do not average out.
    """
    found = []
    for i in range(0, error.shape[0] - side + 1, side):
        for j in range(0, error.shape[1] - side + 1, side):
            own = np.s_[i : i + side, j : j + side]
            share = judged[own].mean()
            if share > 0.95:
                total = error[own][judged[own]].sum()
                found.append(float(total / np.sqrt((sigma[own][judged[own]] ** 2).sum() + share**2 * lasting)))
    return found


def truth_on(grid: Grid, flight) -> np.ndarray:
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return flight.true_heights(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)


def seen_twice(o, grid: Grid, truth: np.ndarray) -> np.ndarray:
    """Whether two photographs show the true ground of a cell."""
    from aerotri.terrain.dense.place import place_at

    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    xyz = np.column_stack([x.ravel(), y.ravel(), truth.ravel()])
    place = place_at(o.photographs, xyz.mean(axis=0), 500.0, 0.005)
    q = place.from_crs(xyz)
    return (sum(place.seen(k, q).astype(int) for k in range(len(o.photographs))) >= 2).reshape(truth.shape)


if __name__ == "__main__":
    main()
