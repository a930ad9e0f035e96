"""Control layouts on the sample block: a table, the mean of several simulated blocks, and a picture of σ of the first.

Example: python docs/figures/control_layouts.py --seeds 8
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image

mpl.use("Agg")
import matplotlib.pyplot as plt

import aerotri
from aerotri.observations import Block, GnssSettings, Prior

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "docs" / "understand" / "figures"
SPEC = ROOT / "blocks" / "frederiksstad_ultracam" / "simulation.toml"
NINE = tuple(f"C0{k}" for k in range(1, 10))
CORNERS = ("C01", "C03", "C07", "C09")
WEST = ("C01", "C02", "C03", "C04")
GNSS = {"sigma_m": [0.05, 0.05, 0.08]}


def with_control(block: Block, names: tuple[str, ...]) -> Block:
    """Only these control points; the others of the nine are check points."""
    is_check = ~np.isin(block.points[block.control.point], names)
    return replace(block, control=replace(block.control, is_check=is_check))


def with_height(block: Block, name: str) -> Block:
    """The block with one control point of which only the height is known; all others are check points."""
    block = with_control(block, (name,))
    held = ~block.control.is_check
    xyz, sigma = block.control.xyz.copy(), block.control.sigma.copy()
    xyz[held, :2], sigma[held, :2] = np.nan, np.nan
    return replace(block, control=replace(block.control, xyz=xyz, sigma=sigma))


def with_gnss(block: Block, shift: str = "off", free_c: bool = False) -> Block:
    """A GNSS shift, and a free principal distance."""
    camera = block.cameras[0]
    if free_c:
        interior = {**camera.interior, "focal_length_mm": Prior(camera.focal_length_mm)}
        block = replace(block, cameras=(replace(camera, interior=interior),))
    return replace(block, settings=replace(block.settings, gnss=GnssSettings(shift=shift)))


def layouts(plain: Block, flown: Block) -> dict[str, Block]:
    """The blocks to compare, by what holds them; `flown` has GNSS positions."""
    one: Callable[..., Block] = with_control
    return {
        "nine control points": one(plain, NINE),
        "four in the corners": one(plain, CORNERS),
        "corners and the middle": one(plain, (*CORNERS, "C05")),
        "GNSS alone": one(flown, ()),
        "four in the west": one(plain, WEST),
        "GNSS and four in the corners": one(flown, CORNERS),
        "GNSS, shift free, four in the corners": with_gnss(one(flown, CORNERS), "block"),
        "GNSS alone, c free": with_gnss(one(flown, ()), free_c=True),
        "GNSS, c free, one height in the middle": with_gnss(with_height(flown, "C05"), free_c=True),
        "GNSS, c free, four in the corners": with_gnss(one(flown, CORNERS), free_c=True),
    }


def main() -> None:
    """Adjust all of them, print the table, draw the first four of the first simulation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8, help="simulated blocks, each with other errors")
    count = parser.parse_args().seeds
    spec = tomllib.loads(SPEC.read_text(encoding="utf-8"))
    sigma, error, top, verdicts, drawn = {}, {}, {}, {}, {}
    for seed in range(1, count + 1):
        plain, flown = (aerotri.simulate(plan, seed=seed).block for plan in (spec, {**spec, "gnss": GNSS}))
        for name, block in layouts(plain, flown).items():
            result = aerotri.adjust(block, explain=False)
            local = result.adjusted
            k = np.char.startswith(local.block.points[local.check.point].astype(str), "K")
            sigma.setdefault(name, []).append(100.0 * local.check.sigma[k])
            error.setdefault(name, []).append(100.0 * local.check.difference[k])
            top.setdefault(name, []).append(100.0 * local.check.sigma[k][:, 2].max())
            verdicts.setdefault(name, []).append(result.verdict)
            if seed == 1:
                drawn[name] = local
                for sentence in result.warnings:
                    if "share" in sentence:
                        print(f"{name}: {sentence}\n")
    print("| held by | accepted | σ XY cm | RMS XY cm | σ Z cm | RMS Z cm | RMS Z by block | largest σ Z cm |")
    print("|---|---|---|---|---|---|---|---|")
    for name in sigma:
        s, d = np.array(sigma[name]), np.array(error[name])
        each = np.sqrt(np.mean(d[:, :, 2] ** 2, axis=1))
        cells = [rms(s[:, :, :2]), rms(d[:, :, :2]), rms(s[:, :, 2]), rms(d[:, :, 2])]
        cells += [f"{each.min():.1f} to {each.max():.1f}", f"{np.mean(top[name]):.1f}"]
        print("| " + " | ".join([name, f"{verdicts[name].count('accepted')} of {count}", *cells]) + " |")
    draw({name: drawn[name] for name in list(drawn)[:4]})


def rms(values: np.ndarray) -> str:
    return f"{np.sqrt(np.mean(values**2)):.1f}"


def draw(results: dict) -> None:
    """σ of the heights of all points, one panel a layout."""
    figure, axes = plt.subplots(1, 4, figsize=(11.0, 3.6), sharey=True, constrained_layout=True)
    drawn = None
    for one, (name, local) in zip(axes, results.items(), strict=True):
        xyz, sigma = local.points.xyz / 1000.0, 100.0 * local.points.sigma[:, 2]
        order = np.argsort(sigma)
        norm = mpl.colors.LogNorm(5.0, 200.0)
        drawn = one.scatter(*xyz[order, :2].T, c=sigma[order], s=7, cmap="cividis_r", norm=norm, linewidths=0)
        control = local.block.points[local.block.control.point[~local.block.control.is_check]]
        at = xyz[np.isin(local.block.points, control)]
        one.plot(*at[:, :2].T, "^", color="black", mec="white", ms=9)
        one.set_title(name, fontsize=10)
        one.set_aspect("equal")
        one.set_xlabel("X, km")
    axes[0].set_ylabel("Y, km")
    bar = figure.colorbar(drawn, ax=axes, label="σ of the height, cm", shrink=0.9, ticks=[5, 10, 20, 50, 100, 200])
    bar.ax.set_yticklabels(["5", "10", "20", "50", "100", "200"])
    FIGURES.mkdir(parents=True, exist_ok=True)
    path = FIGURES / "control_layouts.png"
    figure.savefig(path, dpi=100)
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(128)
    few.save(path, optimize=True)


if __name__ == "__main__":
    main()
