"""Is the stated σ of a difference of two epochs its scatter, with control of their own and with control in common?

Two flights over one site, the second with coarser image points, each adjusted in a block of its own with
self-calibration. Control points are either surveyed anew for the second epoch or used again with the coordinates they
have: then their errors are in both volumes. Pickets are measured in both without noise, so that the adjustment's part
stands alone. Every epoch alone, then both differences, the last also as if nothing were in common. Prints a Markdown
table; with --out writes volume_epochs.md there. The last answer stands in tools/results/volume_epochs.md.

Measures the adjustment's part of σ alone, of pickets at stated places: imports inside on purpose.

Example: python tools/prove/volume_epochs.py --runs 200 --out results
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
from aerotri.volume.accuracy import volume_sigma
from aerotri.volume.bases import level
from aerotri.volume.functionals import tin_volume, triangulated
from aerotri.volume.parts import Part
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.response import respond
from aerotri.volume.settings import SigmaOptions
from runs_elsewhere import add_executor, runs_of
from volume_monte_carlo import HEADER, row
from volume_proof.simulated import MATCHING_UM, PARAMETERS, SPEC, boundary, measured_pickets
from volume_proof.sites import LEVEL, Site, make_site

SIGMA_UM = (2.0, 3.0)
CONTROL_SIGMA_M = (0.1, 0.1, 0.2)
CASES = ("first epoch", "second epoch", "difference, control of their own", "difference, control in common",
         "the same, σ as if nothing were in common")  # fmt: skip


def free_of_noise(seed: int) -> tuple[aerotri.Block, Any]:
    """The block without errors of image and control points."""
    spec = SPEC | {
        "tie_points": SPEC["tie_points"] | {"sigma_um": 0.0, "stated_sigma_um": SIGMA_UM[0]},
        "control": SPEC["control"] | {"sigma_m": [0.0, 0.0, 0.0], "stated_sigma_m": list(CONTROL_SIGMA_M)},
    }
    flight = aerotri.simulate(spec, seed)
    return aerotri.with_settings(flight.block, parameters=PARAMETERS), flight.truth


def observed(block: aerotri.Block, sigma_um: float, control: np.ndarray, rng: np.random.Generator):
    """The block with noise of its image points and errors (k, 3) m of its control points, adjusted."""
    rays = block.image_points
    xy = rays.xy + rng.normal(0.0, 1e-3 * sigma_um, rays.xy.shape)
    rays = replace(rays, xy=xy, sigma=np.full_like(rays.sigma, 1e-3 * sigma_um))
    changed = replace(block, image_points=rays, control=replace(block.control, xyz=block.control.xyz + control))
    return aerotri.adjust(changed, explain=False).record


def measured(calibration, truth, site: Site, z: np.ndarray, rng) -> tuple[float, Part]:
    """Error of the volume of an epoch, and its share in σ."""
    true = np.column_stack([site.xy, z])
    triangles = triangulated(true)
    chosen, seen = pickets_where_seen(calibration, true, 1e-3 * MATCHING_UM)
    assert seen.all(), "the block is too small for the site"
    found = replace(chosen, xyz=measured_pickets(calibration, truth, chosen, rng, frozenset()))
    value, functional = tin_volume(found.xyz, triangles, boundary(site))
    response = respond(calibration, found, functional.gradient)
    error = value - tin_volume(true, triangles, boundary(site))[0]
    return error, Part(calibration, response, None, len(found), len(found.image), 0.0)


def sigma_of(site: Site, part: Part, below: Part | None = None) -> float:
    """m³, the adjustment's part."""
    # the surface matters only for the boundary and a spline below
    surface: object = None
    return volume_sigma(surface, level(LEVEL), boundary(site), part, below, SigmaOptions()).parts["adjustment"]


@cache
def hill() -> Site:
    """The site of all runs."""
    return make_site("fractal", 14.0, 120.0, 8.0)


def one(shared: None, seed: int) -> list[tuple[float, float]]:
    """Error and σ of the cases, m³."""
    site = hill()
    rng = np.random.default_rng([seed, 99])
    block, truth = free_of_noise(seed)
    errors = [rng.normal(size=block.control.xyz.shape) * CONTROL_SIGMA_M for _ in range(2)]
    before, after = site.heights(rng)[0], site.heights(rng)[0]
    first = measured(observed(block, SIGMA_UM[0], errors[0], rng), truth, site, before, rng)
    own, again = (
        measured(observed(block, SIGMA_UM[1], control, rng), truth, site, after, rng) for control in errors[::-1]
    )
    apart = float(np.hypot(sigma_of(site, first[1]), sigma_of(site, again[1])))
    return [
        (first[0], sigma_of(site, first[1])),
        (own[0], sigma_of(site, own[1])),
        (own[0] - first[0], sigma_of(site, own[1], first[1])),
        (again[0] - first[0], sigma_of(site, again[1], first[1])),
        (again[0] - first[0], apart),
    ]


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs:
        found = np.array(runs(one, None, range(1, options.runs + 1)))
    lines = [f"# σ of a difference of two epochs against its scatter, {hill().polygon.area:.0f} m²", "",
             *HEADER.replace("source of error", "volume").split("\n")]  # fmt: skip
    lines += [row(name, *found[:, k].T) for k, name in enumerate(CASES)]
    print("\n".join(lines))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_epochs.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
