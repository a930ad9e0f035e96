"""Distances of the point clouds of two adjustments: is the stated σ their scatter, and are 5 % beyond the level?

Two flights over one site as in `volume_epochs`, each adjusted in a block of its own with self-calibration. Control is
surveyed anew for the second epoch, or used again with the coordinates that it has: then its errors are in both clouds.
Points on hills with a steep bank are measured in both; nothing has changed. `cloud_distances` finds the distances along
the normals, and σ follows from both adjustments; beside it from the covariances of the points alone, as if the clouds
had nothing in common. With noise of the points and without. Places of one run err alike: the band of Σz² is for one
place, the middle, of every run. Prints a Markdown table; with --out writes change_clouds.md there.

Measures σ of clouds in memory with adjustments that are simulated: imports inside on purpose.

Example: python tools/prove/change_clouds.py --runs 40 --out results
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from aerotri.volume.change.adjusted_clouds import adjusted_distances, with_adjustments
from aerotri.volume.change.clouds import Cloud, CloudDistances, Scales, cloud_distances, core_points
from aerotri.volume.pickets import pickets_where_seen
from runs_elsewhere import add_executor, runs_of
from volume_epochs import CONTROL_SIGMA_M, SIGMA_UM, free_of_noise, observed
from volume_proof.simulated import MATCHING_UM, measured_pickets

SPACING, SIDE, SCALES = 6.0, 300.0, Scales(cylinder=30.0, normal=45.0, reach=15.0)
NOISE_M = 0.15
CASES = (
    "control of their own", "control in common", "control in common, noise of the points",
    "control in common, σ as if nothing were in common", "one adjustment, noise of the points",
)  # fmt: skip


def ground(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """m, hills with a bank of 40°."""
    return 100.0 + 6.0 * np.sin(x / 50.0) * np.cos(y / 60.0) + 12.0 * np.tanh((x - 30.0) / 15.0)


def site(truth: Any) -> np.ndarray:
    """(n, 3) m, points in the middle of the flight."""
    middle = np.median(truth.centre[:, :2], axis=0)
    at = np.arange(-0.5 * SIDE, 0.5 * SIDE, SPACING)
    x, y = (axis.ravel() for axis in np.meshgrid(at, at))
    return np.column_stack([x + middle[0], y + middle[1], ground(x, y)])


def measured(calibration: Any, truth: Any, true: np.ndarray, noise: float, rng: np.random.Generator) -> Cloud:
    """A cloud as measured in the photographs of an epoch, with noise of its heights, m."""
    chosen, seen = pickets_where_seen(calibration, true, 1e-3 * MATCHING_UM)
    assert seen.all(), "the block is too small for the site"
    xyz = measured_pickets(calibration, truth, chosen, rng, frozenset())
    xyz[:, 2] += rng.normal(0.0, 1.0, len(xyz)) * noise
    covariance = np.zeros((len(xyz), 6))
    return Cloud(xyz, covariance, np.full(len(xyz), noise), np.full(len(xyz), 2.0), 0.0)


def errors_of(found: CloudDistances, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Errors and σ of all distances, and which place is nearest to the middle."""
    known = np.isfinite(found.distance)
    nearest = int(np.argmin(np.linalg.norm(found.core[known, :2] - middle, axis=1)))
    return found.distance[known], found.sigma[known], nearest


def one(shared: None, seed: int) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Errors, σ and the place in the middle, of all cases."""
    rng = np.random.default_rng([seed, 51])
    block, truth = free_of_noise(seed)
    control = [rng.normal(size=block.control.xyz.shape) * CONTROL_SIGMA_M for _ in range(2)]
    first, own = (observed(block, SIGMA_UM[k], control[k], rng) for k in range(2))
    common = observed(block, SIGMA_UM[1], control[0], rng)
    true, found = site(truth), []
    middle = true[:, :2].mean(axis=0)
    for other, noise in ((own, 0.0), (common, 0.0), (common, NOISE_M), (first, NOISE_M)):
        clouds = tuple(measured(each, truth, true, noise, rng) for each in (first, other))
        core = clouds[0].xyz[core_points(clouds[0].xyz, SCALES.cylinder)]
        inside = (np.abs(core[:, :2] - middle) < 0.5 * SIDE - SCALES.cylinder).all(axis=1)
        distances = cloud_distances(*clouds, core[inside], SCALES)
        adjusted = adjusted_distances(distances, clouds, (first, other))
        found.append(errors_of(with_adjustments(distances, clouds, adjusted), middle))
        if other is common and not noise:
            apart = errors_of(distances.with_variances(adjusted.alone.sum(axis=1)), middle)
    return [*found[:3], apart, found[3]]


def row(name: str, runs: list[tuple[np.ndarray, np.ndarray, int]]) -> str:
    """A row of the table."""
    errors, sigma = (np.concatenate([run[k] for run in runs]) for k in (0, 1))
    z = np.array([error[at] / of[at] for error, of, at in runs])
    low, high = chi2.ppf([0.0005, 0.9995], len(z))
    inside = "inside" if low < np.sum(z**2) < high else "OUTSIDE"
    beyond = 100.0 * np.mean(np.abs(errors) > 1.959964 * sigma)
    rms = [1e3 * np.sqrt(np.mean(values**2)) for values in (errors, sigma)]
    return (
        f"| {name} | {len(runs)} | {rms[0]:.0f} | {rms[1]:.0f} | {np.sqrt(np.mean((errors / sigma) ** 2)):.2f} | "
        f"{z.mean():+.2f} | {np.sum(z**2):.1f} | {low:.1f} … {high:.1f} | {inside} | {beyond:.1f} |"
    )


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as computed:
        found = computed(one, None, range(options.first, options.first + options.runs))
    lines = ["# σ of distances of two point clouds against their scatter", "",
             "| case | runs | RMS error, mm | RMS σ, mm | RMS of error / σ, all places | mean z, middle | Σz², middle "
             "| 99.9 % band | | beyond the level, % |", "|" + "---|" * 10]  # fmt: skip
    lines += [row(name, [run[k] for run in found]) for k, name in enumerate(CASES)]
    print("\n".join(lines))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "change_clouds.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
