"""Control layouts on the sample block, a table and a picture of σ: `python docs/figures/control_layouts.py`."""

from __future__ import annotations

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
        "GNSS, c free, four in the corners": with_gnss(one(flown, CORNERS), free_c=True),
    }


def main() -> None:
    """Adjust all of them, print the table, draw the first four."""
    spec = tomllib.loads(SPEC.read_text(encoding="utf-8"))
    plain, flown = (aerotri.simulate(plan, seed=1).block for plan in (spec, {**spec, "gnss": GNSS}))
    print("| held by | verdict | σ XY cm | σ Z cm | largest σ Z cm | RMS XY cm | RMS Z cm |")
    print("|---|---|---|---|---|---|---|")
    drawn = {}
    for name, block in layouts(plain, flown).items():
        result = aerotri.adjust(block)
        local = result.adjusted
        k = np.char.startswith(local.block.points[local.check.point].astype(str), "K")
        sigma, d = 100.0 * local.check.sigma[k], 100.0 * local.check.difference[k]
        xy, z = (np.sqrt(np.mean(values**2)) for values in (sigma[:, :2], sigma[:, 2]))
        rms_xy, rms_z = (np.sqrt(np.mean(values**2)) for values in (d[:, :2], d[:, 2]))
        top = f"{sigma[:, 2].max():.1f}"
        print(f"| {name} | {result.verdict} | {xy:.1f} | {z:.1f} | {top} | {rms_xy:.1f} | {rms_z:.1f} |", flush=True)
        drawn[name] = local
        for sentence in result.warnings:
            if "share" in sentence:
                print(f"  {sentence}")
    draw({name: drawn[name] for name in list(drawn)[:4]})


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
