"""Is the stated σ of a cut, and of a fill, its scatter? Simulated blocks, pickets on ground that the base cuts.

As `volume_monte_carlo.py`, over a level that runs through the ground: every source of error alone, then all together.
Σz² over the runs against the 99.9 % band of χ², z = error / stated σ, of cut, fill and net. σ counts what straight
triangles are expected to leave out ("expected", not added to the volumes). Prints Markdown; with --out writes
volume_cut_fill.md there. The last answer stands in tools/results/volume_cut_fill.md.

Measures σ of pickets at stated places: imports inside on purpose.

Example: python tools/prove/volume_cut_fill.py --runs 200 --out results
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import chi2

from aerotri.volume.accuracy import SideSigma
from aerotri.volume.bases import level
from aerotri.volume.boundary import Boundary, boundary_of
from aerotri.volume.counted import Counted
from aerotri.volume.drawn_edge import boundary_variance
from aerotri.volume.functionals import triangulated
from aerotri.volume.parts import Part, part_of_pickets
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.rectified import LINE
from aerotri.volume.settings import SigmaOptions
from aerotri.volume.triangles import prism_sums
from runs_elsewhere import Runs, add_executor, runs_of
from volume_proof.simulated import (
    ALL,
    BASE_SIGMA,
    BOUNDARY_SIGMA,
    MATCHING_UM,
    NOISELESS_UM,
    PARTS,
    TinSurface,
    adjusted_block,
    boundary,
    free_of_error,
    measured_pickets,
)
from volume_proof.sites import Site, make_site

SITES = {
    "fractal hill, points every 14 m, over 110 m": (("fractal", 14.0, 120.0, 4.0), 110.0),
    "rolling, every 10 m, over 100 m": (("rolling", 10.0, 120.0, 2.0), 100.0),
    "dump, every 3 m, over 102 m in its loads": (("dump", 3.0, 60.0, 0.5), 102.0),
    "dump, every 8 m, over 102 m in its loads": (("dump", 8.0, 120.0, 1.0), 102.0),
    "benches, every 6 m, over 103 m": (("benches", 6.0, 100.0, 0.8), 103.0),
}  # fmt: skip
NAMES = ("cut", "fill", "net")
ALONE = "interpolation"
ONLY_INTERPOLATION = tuple(name for name in SITES if name.startswith(("dump, every 8", "benches")))
"""Ground that differs from another site in what lies between the pickets alone."""


@dataclass(frozen=True)
class Run:
    """Errors of cut, fill and net, m³, their σ, and what cut and fill are expected to hold beyond the given surface."""

    errors: tuple[float, ...]
    sigmas: tuple[float, ...]
    beyond: tuple[float, ...]


@cache
def made(name: str) -> Site:
    """A site by its name."""
    return make_site(*SITES[name][0])


def volumes(polygon: shapely.Polygon, xyz: np.ndarray, triangles: np.ndarray, height: float) -> np.ndarray:
    """Cut and fill of a TIN over a level, m³."""
    return prism_sums(polygon, xyz[triangles][:, :, :2], xyz[triangles][:, :, 2] - height)[:2]


def one(shared: tuple[str, frozenset[str]], seed: int) -> Run:
    """A run of a site by its name, with some sources of error on."""
    name, on = shared
    site, height, rng = made(name), SITES[name][1], np.random.default_rng([seed, 77])
    calibration, truth = adjusted_block(seed) if "adjustment" in on else free_of_error()
    z, dense = site.heights(rng)
    true, outline = np.column_stack([site.xy, z]), boundary(site)
    triangles = triangulated(true)
    um = MATCHING_UM if "matching" in on else NOISELESS_UM
    chosen, seen = pickets_where_seen(calibration, true, 1e-3 * um)
    assert seen.all(), "the block is too small for the site"
    found = replace(chosen, xyz=measured_pickets(calibration, truth, chosen, rng, on))
    below = height + (float(rng.normal(0.0, BASE_SIGMA)) if "base" in on else 0.0)
    value = volumes(outline.polygon, found.xyz, triangles, below)
    wanted = volumes(outline.polygon, true, triangles, height)
    if ALONE in on:
        wanted = np.array([site.weight @ np.maximum(s * (dense - height), 0.0) for s in (1.0, -1.0)])
    error = value - wanted
    if "boundary" in on:
        corners = outline.rings[0][:-1]
        moved = boundary_of(shapely.Polygon(corners + rng.normal(0.0, BOUNDARY_SIGMA, corners.shape)), "moved")
        error += volumes(moved.polygon, found.xyz, triangles, below) - value
    part = part_of_pickets(calibration, found, triangles, outline, level(below), SigmaOptions(matching_sigma_um=um))
    shared_sigma = [np.sqrt(part.response.variance) / outline.area if "adjustment" in on else 0.0]
    shared_sigma += [BASE_SIGMA if "base" in on else 0.0]
    spread = float(np.hypot(*shared_sigma))
    assert part.side is not None
    sides = [(part.side(Counted(level(below), sign, spread)), sign) for sign in (1, -1)]
    surface = TinSurface(found.xyz)
    sigmas = [sigma_of(one, surface, outline, below, sign, on) for one, sign in (*sides, (part, 0))]
    return Run(
        (*error.tolist(), float(error[0] - error[1])), tuple(one.total for one in sigmas),
        tuple(one.beyond for one in sigmas[:2]),
    )  # fmt: skip


def sigma_of(
    part: Part, surface: TinSurface, outline: Boundary, below: float, sign: int, on: frozenset[str]
) -> SideSigma:
    """σ of the sources that are on."""
    region, between = part.region, part.between
    area = outline.area if region is None else region.area
    edge = boundary_variance(surface, level(below), outline, BOUNDARY_SIGMA, sign)  # pyright: ignore[reportArgumentType]
    parts = {
        "adjustment": part.response.variance, "matching": part.response.noise,
        ALONE: between.mean_square if between is not None else 0.0, "base": (BASE_SIGMA * area) ** 2, "boundary": edge,
    }  # fmt: skip
    used = {name: float(np.sqrt(value)) for name, value in parts.items() if name in on}
    if region is not None and sign:
        used[LINE] = float(np.sqrt(region.line.mean_square))
    beyond = between.curvature if between is not None and ALONE in on else 0.0
    return SideSigma(used, beyond - (region.line.noise if region is not None and sign else 0.0))


def row(name: str, error: np.ndarray, sigma: np.ndarray, expected: str) -> str:
    """A line of the table."""
    z = error / sigma
    low, high = chi2.ppf([0.0005, 0.9995], len(z))
    total = float(np.sum(z**2))
    verdict = "inside" if low <= total <= high else "OUTSIDE"
    numbers = f"{np.sqrt(np.mean(error**2)):.0f} | {np.sqrt(np.mean(sigma**2)):.0f}"
    band = f"{low:.1f} … {high:.1f}"
    return f"| {name} | {len(z)} | {np.mean(error):+.0f} | {expected} | {numbers} | {total:.1f} | {band} | {verdict} |"


def rows(source: str, runs: list[Run]) -> list[str]:
    """The lines of a source."""
    lines = []
    for k, name in enumerate(NAMES):
        error, sigma = (np.array([getattr(run, field)[k] for run in runs]) for field in ("errors", "sigmas"))
        expected = f"{-np.mean([run.beyond[k] for run in runs]):+.0f}" if k < 2 else ""
        lines.append(row(f"{source}, {name}", error, sigma, expected))
    return lines


HEADER = """| source, volume | runs | mean error m³ | expected m³ | RMS error m³ | σ (RMS) m³ | Σz² | 99.9 % band | |
|---|---|---|---|---|---|---|---|---|"""


OfSite = Callable[[str, range, list[str], Runs], list[str]]
"""Lines of a site: of its name, the seeds, the sources that are wanted, and who does the runs."""


def of_site(name: str, seeds: range, wanted: list[str], runs: Runs) -> list[str]:
    """The table of a site."""
    sources = [(part, frozenset([part])) for part in PARTS] + [("all together", ALL)]
    if name in ONLY_INTERPOLATION:
        wanted = [ALONE]
    lines = ["", f"## {name[0].upper()}{name[1:]}, {made(name).polygon.area:.0f} m²", "", *HEADER.split("\n")]
    print("\n".join(lines), flush=True)
    for source, on in [(source, on) for source, on in sources if not wanted or source in wanted]:
        found = rows(source, runs(one, (name, on), seeds))
        print("\n".join(found), flush=True)
        lines += found
    return lines


def prove(about: str | None, title: str, tool: str, names: Iterable[str], of_site: OfSite, count: int) -> None:
    """Read the command line, run every site, print, write where asked.

    Parameters
    ----------
    about : what the tool does. names : of the sites. of_site : gives the lines of one. count : runs if none is stated.
    """
    parser = argparse.ArgumentParser(description=(about or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=count)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--site", default="", help="only those whose name begins so")
    parser.add_argument("--source", nargs="*", default=[], help="only these sources of error")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    lines = [f"# {title} (tools/prove/{tool}.py)"]
    print(lines[0])
    seeds = range(options.first, options.first + options.runs)
    with runs_of(options) as runs:
        for name in (name for name in names if name.startswith(options.site)):
            lines += of_site(name, seeds, options.source, runs)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / f"{tool}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    prove(__doc__, "σ of cut and of fill against their scatter", "volume_cut_fill", SITES, of_site, 200)
