"""Is the stated σ of a cut, and of a fill, its scatter where the base is measured too? Simulated blocks, two epochs.

Two flights over one site, each with its own adjustment and its own points. Either the ground is the same in both, so
that cut and fill are nothing but errors, or the first flight saw a level floor that loads were tipped on. Σz² over the
runs against the 99.9 % band of χ², z = error / stated σ, of cut, fill and net. "Expected" is what the program says that
cut and fill are off: straight triangles make them too small, noise makes them too large. Volumes are summed over a
fine lattice. Prints Markdown; with --out writes volume_measured_base.md there.

Measures σ of pickets at stated places: imports inside on purpose.

Example: python tools/prove/volume_measured_base.py --runs 60 --out results
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from aerotri.volume.accuracy import SideSigma, VolumeSigma, volume_sigma
from aerotri.volume.bases import SurfaceBase
from aerotri.volume.boundary import Boundary
from aerotri.volume.counted import Counted
from aerotri.volume.functionals import triangulated
from aerotri.volume.parts import Part, part_of_pickets
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.settings import SigmaOptions
from aerotri.volume.shared import places_apart
from runs_elsewhere import Runs
from volume_cut_fill import HEADER, NAMES, Run, prove, row
from volume_proof.simulated import MATCHING_UM, TinSurface, adjusted_block, boundary, free_of_error, measured_pickets
from volume_proof.sites import Heights, Site, dump, make_site, rolling

FLOOR = 102.0
SITES = {
    "loads on a level floor, points every 3 m": ("dump", 3.0, 60.0, 0.5),
    "rolling ground, the same in both, points every 10 m": ("rolling", 10.0, 120.0, 2.0),
}  # fmt: skip
KINDS = {"dump": dump, "rolling": rolling}
SOURCES = {
    "matching": frozenset({"matching"}),
    "all but the adjustment": frozenset({"matching", "interpolation"}),
    "all together": frozenset({"adjustment", "matching", "interpolation"}),
}


@dataclass(frozen=True, eq=False)
class Epochs:
    """A site with points of a second flight; ground : heights of the points of both and of the fine lattice, m."""

    site: Site
    below: np.ndarray
    ground: Heights


@cache
def made(name: str) -> Epochs:
    """By its name."""
    site, other = make_site(*SITES[name]), make_site(*SITES[name], seed=2)
    places = np.concatenate([site.xy, other.xy, site.dense])
    return Epochs(site, other.xy, KINDS[SITES[name][0]](places))


def true_heights(name: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(k, 3) points of the later and of the earlier flight, and heights of both on the lattice."""
    epochs = made(name)
    z, k, m = epochs.ground(rng), len(epochs.site.xy), len(epochs.below)
    lower, dense = z[k : k + m], z[k + m :]
    floor = SITES[name][0] == "dump"
    earlier = (np.full(m, FLOOR), np.full(len(dense), FLOOR)) if floor else (lower, dense)
    return np.column_stack([epochs.site.xy, z[:k]]), np.column_stack([epochs.below, earlier[0]]), dense, earlier[1]


def part_of(
    true: np.ndarray, outline: Boundary, on: frozenset[str], seed: int, rng: np.random.Generator
) -> tuple[Part, np.ndarray]:
    """A surface measured in a block of its own, and its points."""
    calibration, truth = adjusted_block(seed) if "adjustment" in on else free_of_error()
    um = MATCHING_UM if "matching" in on else 1e-3
    chosen, seen = pickets_where_seen(calibration, true, 1e-3 * um)
    assert seen.all(), "the block is too small for the site"
    found = replace(chosen, xyz=measured_pickets(calibration, truth, chosen, rng, on))
    options = SigmaOptions(matching_sigma_um=um)
    return part_of_pickets(calibration, found, triangulated(true), outline, None, options), found.xyz


def one(shared: tuple[str, str], seed: int) -> Run:
    """A run of a site by its name, with the sources of a name on."""
    name, on = shared[0], SOURCES[shared[1]]
    rng, site = np.random.default_rng([seed, 78]), made(name).site
    upper, lower, dense, dense_below = true_heights(name, rng)
    outline = boundary(site)
    part, above = part_of(upper, outline, on, seed, rng)
    base_part, below = part_of(lower, outline, on, seed + 100_000, rng)
    surfaces = [TinSurface(xyz) for xyz in (above, below)]
    straight = [TinSurface(xyz) for xyz in (upper, lower)]
    h = np.subtract(*(one.sample(*site.dense.T) for one in surfaces))
    wanted = dense - dense_below if "interpolation" in on else np.subtract(*(s.sample(*site.dense.T) for s in straight))
    error = [site.weight @ (np.maximum(s * h, 0.0) - np.maximum(s * wanted, 0.0)) for s in (1.0, -1.0)]
    spread = np.sqrt(sum(one.response.variance for one in (part, base_part) if "adjustment" in on)) / outline.area
    net = side_sigma(part, base_part, surfaces, outline, on)
    sides = [
        SideSigma.of(side_sigma(*sided(part, base_part, surfaces, (sign, spread)), surfaces, outline, on), net)
        for sign in (1, -1)
    ]
    errors = (float(error[0]), float(error[1]), float(error[0] - error[1]))
    return Run(errors, (*(side.total for side in sides), net.total), tuple(side.beyond for side in sides))


def sided(part: Part, base_part: Part, surfaces: list[TinSurface], of: tuple[int, float]) -> tuple[Part, Part]:
    """The shares of both surfaces in a cut or a fill."""
    assert part.side is not None
    assert base_part.side is not None
    (sign, spread), apart = of, places_apart(part, base_part)
    upper, lower = (SurfaceBase("measured", one) for one in surfaces)  # pyright: ignore[reportArgumentType]
    return (
        part.side(Counted(lower, sign, spread, noise=base_part.noise_at(apart))),
        base_part.side(Counted(upper, -sign, spread, noise=part.noise_at(apart), apart=apart)),
    )


def side_sigma(
    part: Part, base_part: Part, surfaces: list[TinSurface], outline: Boundary, on: frozenset[str]
) -> VolumeSigma:
    """σ of the sources that are on."""
    base = SurfaceBase("measured", surfaces[1])  # pyright: ignore[reportArgumentType]
    found = volume_sigma(surfaces[0], base, outline, part, base_part, SigmaOptions())  # pyright: ignore[reportArgumentType]
    kept = {name: value for name, value in found.parts.items() if name in on or name == "zero_line"}
    return replace(found, parts=kept, curvature=found.curvature if "interpolation" in on else None)


def of_site(name: str, seeds: range, wanted: list[str], runs: Runs) -> list[str]:
    """The table of a site."""
    lines = ["", f"## {name[0].upper()}{name[1:]}, {made(name).site.polygon.area:.0f} m²", "", *HEADER.split("\n")]
    print("\n".join(lines), flush=True)
    for source in (source for source in SOURCES if not wanted or source in wanted):
        found = runs(one, (name, source), seeds)
        for k, volume in enumerate(NAMES):
            error, sigma = (np.array([getattr(run, field)[k] for run in found]) for field in ("errors", "sigmas"))
            expected = f"{-np.mean([run.beyond[k] for run in found]):+.0f}" if k < 2 else ""
            lines.append(row(f"{source}, {volume}", error, sigma, expected))
            print(lines[-1], flush=True)
    return lines


if __name__ == "__main__":
    prove(__doc__, "σ of cut and of fill over a measured base", "volume_measured_base", SITES, of_site, 60)
