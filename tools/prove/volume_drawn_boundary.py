"""Boundaries known in space and boundaries drawn on the surface: is the stated σ of a volume its scatter?

A block of few, poor control points is simulated and adjusted again and again; pickets on a known heap are intersected
with every adjustment. The boundary is the same in space in every run (survey), or is moved with the surface as one
draws it there (product); the base is a spline through it, a plane fitted to it, or a level. Error over stated σ of
the runs, beside the 99 % band of normal errors. The surface is the TIN of the pickets in every run, and the truth that
of the true pickets: the ground that a spline cannot know is not in it.

Measures σ of pickets at stated places, for outlines that move with them: imports inside on purpose.

Example: python tools/prove/volume_drawn_boundary.py --runs 60 --out results
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import shapely
from scipy.interpolate import LinearNDInterpolator
from scipy.stats import chi2

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import nodes_of, parse_base
from aerotri.volume.boundary import boundary_of
from aerotri.volume.functionals import tin_volume, triangulated
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.response import respond
from runs_elsewhere import add_executor, runs_of
from volume_proof.simulated import MATCHING_UM, SPEC, adjusted_block, measured_pickets

POOR = SPEC | {"control": {"distance_bases": 5.0, "sigma_m": [0.4, 0.4, 0.4]}}
OUTLINE = shapely.Point(3.0, -5.0).buffer(60.0, quad_segs=16)
SPACING, REACH, GROUND, HIGH, WIDE = 4.0, 84.0, 100.0, 15.0, 25.0
BASES = ("boundary", "plane", "level:99")
ON = frozenset(["adjustment", "matching"])


class Tin:
    """Heights of a TIN, for the base."""

    grid = Grid(169, 169, -84.5, 84.5, 1.0, 1.0)

    def __init__(self, xyz: np.ndarray):
        self._of = LinearNDInterpolator(xyz[:, :2], xyz[:, 2])

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) m."""
        return self._of(x, y)


def heap() -> np.ndarray:
    """(k, 3) m, true pickets on a heap on ground that slopes."""
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.arange(-REACH, REACH, SPACING), np.arange(-REACH, REACH, SPACING))
    xy = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-1.0, 1.0, (x.size, 2))
    z = GROUND + 0.05 * xy[:, 0] + HIGH * np.exp(-np.sum(xy**2, axis=1) / (2.0 * WIDE**2))
    return np.column_stack([xy, z])


def volume_of(xyz: np.ndarray, triangles: np.ndarray, outline, stated: str, drawn: bool):
    """Volume over a base, and its gradient."""
    boundary = boundary_of(outline, "heap")
    base = parse_base(stated, Tin(xyz), boundary)
    value, functional = tin_volume(xyz, triangles, boundary, base, drawn)
    if nodes_of(base) is None:
        value -= boundary.area * base.heights(np.zeros(1), np.zeros(1))[0]
    return value, functional.gradient


def of_seed(shared: None, seed: int) -> dict[tuple[str, str], tuple[float, float]]:
    """Error and σ by setting and base."""
    calibration, truth = adjusted_block(seed, spec=POOR)
    true = heap()
    triangles = triangulated(true)
    chosen, seen = pickets_where_seen(calibration, true, 1e-3 * MATCHING_UM)
    assert seen.all(), "the block is too small for the heap"
    xyz = measured_pickets(calibration, truth, chosen, np.random.default_rng([seed, 5]), ON)
    outline = shapely.segmentize(OUTLINE, 1.0)
    # who draws follows the shape of the surface, not the noise of single pickets: a motion linear in plan
    design = np.column_stack([np.ones(len(true)), true])
    motion = np.linalg.lstsq(design, (xyz - true)[:, :2], rcond=None)[0]
    ground = Tin(true)

    def with_surface(xy: np.ndarray) -> np.ndarray:
        return xy + np.column_stack([np.ones(len(xy)), xy, ground.sample(*xy.T)]) @ motion

    found = {}
    for stated in BASES:
        wanted = volume_of(true, triangles, outline, stated, False)[0]
        for setting, drawn in (("survey", False), ("product", True)):
            own = shapely.transform(outline, with_surface) if drawn else outline
            value = volume_of(xyz, triangles, own, stated, drawn)[0]
            gradient = volume_of(xyz, triangles, own, stated, drawn)[1]
            response = respond(calibration, chosen, gradient)
            found[setting, stated] = value - wanted, float(np.sqrt(response.variance + response.noise))
    return found


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as computed:
        runs = computed(of_seed, None, range(options.first, options.first + options.runs))
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], len(runs)) / len(runs))
    lines = ["# Boundaries known in space and drawn on the surface", "",
             "| boundary | base | runs | RMS error, m³ | stated σ (RMS), m³ | RMS of error / σ | 99 % band |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for key in runs[0]:
        error, sigma = np.array([run[key] for run in runs]).T
        rms = [np.sqrt(np.mean(values**2)) for values in (error, sigma, error / sigma)]
        lines.append(
            f"| {key[0]} | {key[1]} | {len(runs)} | {rms[0]:.0f} | {rms[1]:.0f} | {rms[2]:.2f} | "
            f"{low:.2f} … {high:.2f} |"
        )
    print("\n".join(lines))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_drawn_boundary.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
