"""Change between two simulated epochs: is the stated σ its scatter, and are 5 % of unchanged cells beyond the level?

Ground of hills with a dump of known volume is seen twice, with noise that neighbouring cells share, the second time
shifted, lifted and tilted. `aerotri.change` aligns it on stable ground around. Root mean square of error over σ for the
net volume and for each unknown of the alignment, beside the 99 % band of normal errors; and the share of unchanged
cells beyond the level of detection, with the stated σ right, and half of what it is.

Example: python tools/prove/change_dump.py --runs 200 --out results
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.ndimage import uniform_filter
from scipy.stats import chi2

import aerotri
from runs_elsewhere import add_executor, runs_of

SIDE, SIGMA = 200, 0.03
AT = np.arange(SIDE) + 0.5
X, Y = np.meshgrid(AT, AT[::-1])
STABLE = shapely.difference(shapely.box(0, 0, SIDE, SIDE), shapely.box(60, 60, 140, 140))
AREA = shapely.box(70, 70, 130, 130)
UNKNOWNS = ("dZ", "dX", "dY", "tilt_X", "tilt_Y")


def ground(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """m."""
    return 100.0 + 3.0 * np.sin(x / 20.0) * np.cos(y / 30.0) + 0.02 * x


def dump(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """m, a cone of 6 m."""
    return np.maximum(6.0 - 0.25 * np.hypot(x - 100.0, y - 100.0), 0.0)


def surface(z: np.ndarray, window: int, stated: float, rng: np.random.Generator) -> aerotri.Surface:
    """With noise that is the mean of a square of cells."""
    white = rng.normal(size=(SIDE + 2 * window, SIDE + 2 * window))
    noise = SIGMA * window * uniform_filter(white, window)[window:-window, window:-window]
    sigma = np.full_like(z, stated)
    return aerotri.Surface.of_array(z + noise, left=0.0, top=float(SIDE), cell=1.0, sigma=sigma)


def of_seed(seed: int, window: int, stated: float) -> tuple[dict[str, float], float]:
    """Errors over σ, and the share of unchanged cells beyond the level, per cent."""
    rng = np.random.default_rng([seed, window])
    (tx, ty), up, tilt = rng.normal(0.0, 0.2, 2), rng.normal(0.0, 0.1), rng.normal(0.0, 5e-4, 2)
    moved = ground(X - tx, Y - ty) + up + tilt[0] * X + tilt[1] * Y
    first = surface(ground(X, Y), window, stated, rng)
    second = surface(moved + dump(X - tx, Y - ty), window, stated, rng)
    found = aerotri.change(first, second, stable=STABLE, align="tilt", area=AREA)
    volume = found.summary["volumes"][0]
    errors = {"net volume": (volume["net_m3"] - float(dump(X, Y).sum())) / volume["sigma_net_m3"]}
    middle = found.record.alignment.middle
    true = dict(zip(UNKNOWNS, (up + float(tilt @ middle), tx, ty, *tilt), strict=True))
    for one in found.summary["alignment"]["unknowns"]:
        errors[one["name"]] = (one["value"] - true[one["name"]]) / one["sigma"]
    unchanged = dump(X, Y) == 0.0
    return errors, 100.0 * float(np.mean(np.abs(found.record.significance[unchanged]) > 1.96))


def one(shared: tuple[int, float], seed: int) -> Any:
    """`of_seed` for cells that share noise, and a stated σ."""
    return of_seed(seed, *shared)


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], options.runs) / options.runs)
    lines = ["# Change of a simulated dump", "",
             f"{options.runs} runs each; 99 % band of the root mean square of normal errors {low:.2f} … {high:.2f}.",
             "",
             "| cells that share noise | stated σ over true | " + " | ".join(["net volume", *UNKNOWNS])
             + " | unchanged cells beyond the level, % |", "|---" * (len(UNKNOWNS) + 4) + "|"]  # fmt: skip
    seeds, cases = range(options.first, options.first + options.runs), ((1, 1.0), (5, 1.0), (5, 0.5), (9, 1.0))
    with runs_of(options) as computed:
        found = [computed(one, (window, share * SIGMA), seeds) for window, share in cases]
    for (window, share), runs in zip(cases, found, strict=True):
        rms = [np.sqrt(np.mean([errors[name] ** 2 for errors, _ in runs])) for name in ("net volume", *UNKNOWNS)]
        beyond = np.mean([part for _, part in runs])
        numbers = " | ".join(f"{value:.2f}" for value in rms)
        lines.append(f"| {window} × {window} | {share:g} | {numbers} | {beyond:.2f} |")
        print(lines[-1], flush=True)
    print("\n".join(lines))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "change_dump.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
