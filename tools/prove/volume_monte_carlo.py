"""Is the stated σ of a volume its scatter? Simulated blocks with self-calibration, pickets measured in them.

Every source of error alone, then all together: Σz² over the runs against the 99.9 % band of χ², z = error / stated σ;
on ground of several kinds. The line "after curvature" takes the ground that straight triangles are expected to leave
out off the error, and its own σ for that. Prints Markdown tables; with --out writes volume_monte_carlo.md there. The
last answer stands in tools/results/volume_monte_carlo.md.

Example: python tools/prove/volume_monte_carlo.py --runs 200 --out results
"""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from runs_elsewhere import Runs, add_executor, runs_of
from volume_proof.simulated import ALL, PARTS, Run, run
from volume_proof.sites import Site, sites

HEADER = """| source of error | runs | scatter (RMS error), m³ | stated σ (RMS), m³ | mean z | Σz² | 99.9 % band | |
|---|---|---|---|---|---|---|---|"""
ALONE = "interpolation"
ONLY_INTERPOLATION = ("rolling, every 25 m", "dump, every 8 m", "benches, every 6 m")
"""Ground that differs from another site in what lies between the pickets alone."""


def row(name: str, error: np.ndarray, sigma: np.ndarray) -> str:
    """A line of the table."""
    z = error / sigma
    low, high = chi2.ppf([0.0005, 0.9995], len(z))
    total = float(np.sum(z**2))
    verdict = "inside" if low <= total <= high else "OUTSIDE"
    return (
        f"| {name} | {len(z)} | {np.sqrt(np.mean(error**2)):.0f} | {np.sqrt(np.mean(sigma**2)):.0f} | "
        f"{np.mean(z):+.2f} | {total:.1f} | {low:.1f} … {high:.1f} | {verdict} |"
    )


def rows(name: str, runs: list[Run]) -> list[str]:
    """The line of a source, and where the ground counts that after its curvature."""
    error, sigma = np.array([r.error for r in runs]), np.array([r.sigma for r in runs])
    lines = [row(name, error, sigma)]
    if runs[0].curvature[1] > 0.0:
        more = np.array([r.curvature[0] for r in runs])
        lines.append(row(f"{name}, after curvature", error + more, np.sqrt(sigma**2 - more**2)))
    return lines


def one(shared: tuple[str, frozenset[str]], seed: int) -> Run:
    """A run of a site by its name, with some sources of error on."""
    name, on = shared
    return run(made(name), seed, on)


@cache
def made(name: str) -> Site:
    """A site by its name."""
    return sites()[name]()


def of_site(name: str, seeds: range, wanted: str, runs: Runs) -> list[str]:
    """The table of a site."""
    site = made(name)
    sources = [(part, frozenset([part])) for part in PARTS] + [("all together", ALL)]
    if name in ONLY_INTERPOLATION:
        wanted = ALONE
    lines = ["", f"## {name[0].upper()}{name[1:]}, {site.polygon.area:.0f} m²", "", *HEADER.split("\n")]
    print("\n".join(lines), flush=True)
    for source, on in [(source, on) for source, on in sources if wanted in ("", source)]:
        found = rows(source, runs(one, (name, on), seeds))
        print("\n".join(found), flush=True)
        lines += found
    return lines


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--site", default="", help="only those whose name begins so")
    parser.add_argument("--source", default="", help="only this source of error")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    lines = ["# σ of a volume against its scatter"]
    print(lines[0])
    seeds = range(options.first, options.first + options.runs)
    with runs_of(options) as runs:
        for name in (name for name in sites() if name.startswith(options.site)):
            lines += of_site(name, seeds, options.source, runs)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_monte_carlo.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
