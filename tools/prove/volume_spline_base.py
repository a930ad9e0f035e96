"""A base that is a spline through the boundary: is its stated σ the scatter of what it leaves out?

Ground that nobody sees lies under a pile. It is drawn anew in every run: fractal (a random function of known exponent),
rolling waves of three lengths, with noise of the heights or without. The surface is that ground with a pile on it; the
base is the spline through the boundary, and σ of the base is judged, as always, from the ground in a ring outside.
Error: volume over the spline less the true volume of the pile. Boundaries: a circle, and a long rectangle.

Measures σ of a base alone: imports inside on purpose.

Example: python tools/prove/volume_spline_base.py --runs 200 --out results
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import chi2

from aerotri.rasters.grids import Grid
from aerotri.rasters.held import HeldRaster
from aerotri.volume.accuracy import spline_variance
from aerotri.volume.bases import parse_base
from aerotri.volume.boundary import boundary_of
from aerotri.volume.compute import compute_volumes
from aerotri.volume.settings import SectionPlan
from runs_elsewhere import add_executor, runs_of

COUNT, CELL = 192, 1.0
HALF = COUNT * CELL / 2.0
GRID = Grid(COUNT, COUNT, -HALF, HALF, CELL, CELL)
X, Y = np.meshgrid(GRID.x(np.arange(COUNT)), GRID.y(np.arange(COUNT)))
HIGH, WAVES, NOISE_M = 8.0, 12, 0.05
OUTLINES = {
    "circle": shapely.Point(0.0, 0.0).buffer(45.0),
    "rectangle": shapely.box(-70.0, -20.0, 70.0, 20.0),
}  # fmt: skip


def fractal(exponent: float) -> Callable[[np.random.Generator], np.ndarray]:
    """Ground whose increments grow with that power of the distance, from its spectrum on a larger field."""
    n = 4 * COUNT
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n)))
    amplitude = np.zeros_like(k)
    amplitude[k > 0.0] = k[k > 0.0] ** (-exponent - 1.0)

    def ground(rng: np.random.Generator) -> np.ndarray:
        z = np.real(np.fft.ifft2(amplitude * np.fft.fft2(rng.normal(size=(n, n)))))
        z = z[:COUNT, :COUNT]
        return 100.0 + 0.05 * z / np.sqrt(np.mean(np.diff(z, axis=1) ** 2))

    return ground


def rolling(length: float) -> Callable[[np.random.Generator], np.ndarray]:
    """Waves of about this length in all directions, 1 m."""

    def ground(rng: np.random.Generator) -> np.ndarray:
        angle, phase = rng.uniform(0.0, 2.0 * np.pi, (2, WAVES))
        number = 2.0 * np.pi / (length * 2.0 ** rng.uniform(-0.5, 0.5, WAVES))
        return 100.0 + np.sqrt(2.0 / WAVES) * sum(
            np.cos(k * (X * np.cos(a) + Y * np.sin(a)) + p) for k, a, p in zip(number, angle, phase, strict=True)
        )

    return ground


def noisy(
    ground: Callable[[np.random.Generator], np.ndarray], sigma: float = NOISE_M
) -> Callable[[np.random.Generator], np.ndarray]:
    """Heights with noise of their own."""
    return lambda rng: ground(rng) + rng.normal(scale=sigma, size=(COUNT, COUNT))


def both(rng: np.random.Generator) -> np.ndarray:
    """Waves of 80 m on fractal ground."""
    return rolling(80.0)(rng) + 0.5 * fractal(0.5)(rng)


GROUNDS = {
    "fractal, exponent 0.5": fractal(0.5), "fractal, exponent 0.8": fractal(0.8), "rolling, 40 m": rolling(40.0),
    "rolling, 80 m": rolling(80.0), "rolling, 200 m": rolling(200.0), "rolling, 80 m, noise": noisy(rolling(80.0)),
    "rolling, 200 m, noise": noisy(rolling(200.0)), "rolling, 80 m, on fractal": both,
    "level, noise": noisy(lambda rng: np.full((COUNT, COUNT), 100.0)),
}  # fmt: skip


def of_seed(shared: tuple[str, str], seed: int) -> tuple[float, float]:
    """Error and σ, m³, of a ground and an outline by their names."""
    ground, boundary = GROUNDS[shared[0]], boundary_of(OUTLINES[shared[1]], shared[1])
    below = ground(np.random.default_rng([seed, 3]))
    inside = np.asarray(shapely.contains_xy(boundary.polygon.buffer(-4.0), X, Y))
    pile = HIGH * inside
    surface = HeldRaster(below + pile, GRID, None, "pile")
    base = parse_base("boundary", surface, boundary)
    found = compute_volumes(surface, base, boundary, "grid", SectionPlan(20.0))
    error = found.chosen.net - float(pile.sum()) * CELL**2
    variance = spline_variance(base, boundary, surface)
    assert variance is not None
    return error, float(np.sqrt(variance))


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], options.runs) / options.runs)
    lines = ["# σ of a base that is a spline through the boundary", "",
             f"{options.runs} runs each; 99 % band of the root mean square of normal errors {low:.2f} … {high:.2f}.",
             "", "| ground | boundary | RMS error, m³ | stated σ (RMS), m³ | RMS of error / σ | largest |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    print("\n".join(lines), flush=True)
    seeds = range(options.first, options.first + options.runs)
    with runs_of(options) as runs:
        for name, shape in product(GROUNDS, OUTLINES):
            error, sigma = np.array(runs(of_seed, (name, shape), seeds)).T
            rms = [float(np.sqrt(np.mean(values**2))) for values in (error, sigma, error / sigma)]
            largest = np.abs(error / sigma).max()
            lines.append(f"| {name} | {shape} | {rms[0]:.0f} | {rms[1]:.0f} | {rms[2]:.2f} | {largest:.1f} |")
            print(lines[-1], flush=True)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_spline_base.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
