"""Gross errors at full count: power, false alarms, bulk and wrong control, by every robust method. Prints Markdown.

Bounds: single errors of the size ∇0 found with the probability stated (80 %; band: binomial, 99.9 %), false alarms at
α; 10 % of the rays off by 10–100 σ: at least 99 % of those above ∇0 flagged, at most 0.5 % of the good rays lost,
max |x − x_clean|/σ < 3 for the orientation. Flagged is what data snooping removed and what an estimator left less than
half its weight. A good ray counts as lost where at least two good rays of its point could have stayed; the share of all
good rays stands in brackets. x_clean: least squares without the errors, a wrong control point being a check point.

Example: python tools/prove/recovery_blunders.py --seeds 200 --demo-seeds 20

Last result, of 40 and 3 seeds:

    | single errors | found | expected |
    |---|---|---|
    | errors of the size ∇0 with w beyond the limit | 0.772 of 320 | 0.80 (0.725 to 0.869) |
    | the same, removed by data snooping | 0.762 | the same |
    | w beyond the limit without an error | 1.066 ‰ of 238171 | 1.000 ‰ |
    | rays removed without an error | 2.03 ‰ of 120900 | 2.00 ‰ (two tests) |

    | block | method | seeds | above ∇0 flagged | good lost (of all) | max off, σ | control named | s |
    |---|---|---|---|---|---|---|---|
    | 29 photographs | data-snooping | 40 | 99.56 % | 0.36 % (0.86 %) | 1.14 | 40 | 0.13 |
    | 29 photographs | adaptive | 40 | 98.66 % | 0.48 % (0.92 %) | 1.26 | 40 | 0.10 |
    | 29 photographs | danish | 40 | 98.07 % | 0.35 % (0.75 %) | 1.29 | 40 | 0.10 |
    | 29 photographs | cauchy | 40 | 96.46 % | 2.54 % (2.80 %) | 1.23 | 40 | 0.18 |
    | 29 photographs | huber | 40 | 98.86 % | 0.57 % (1.02 %) | 2.46 | 40 | 0.12 |
    | the same, C03 10 m off | data-snooping | 40 | 98.98 % | 0.37 % (0.81 %) | 1.13 | 40 | 0.26 |
    | sample block, 132 | data-snooping | 3 | 99.72 % | 0.43 % (0.69 %) | 2.69 | 3 | 1.50 |
    | sample block, 132 | adaptive | 3 | 99.08 % | 0.54 % (0.74 %) | 2.45 | 3 | 0.98 |
    | sample block, 132 | danish | 3 | 98.64 % | 0.52 % (0.70 %) | 2.54 | 3 | 1.10 |
    | sample block, 132 | cauchy | 3 | 98.15 % | 3.10 % (3.20 %) | 2.52 | 3 | 0.86 |
    | sample block, 132 | huber | 3 | 99.10 % | 0.65 % (0.86 %) | 3.38 | 3 | 0.59 |
    | the same, C05 10 m off | data-snooping | 3 | 99.64 % | 0.41 % (0.66 %) | 2.68 | 3 | 1.16 |

Data snooping keeps the bounds; with a control point 10 m off beside 10 % of gross errors 98.98 % are flagged.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import binom, norm

import aerotri
from runs_elsewhere import Runs, add_executor, runs_of

DEMO = Path(__file__).parents[2] / "blocks" / "frederiksstad_ultracam" / "simulation.toml"
METHODS = ("data-snooping", "adaptive", "danish", "cauchy", "huber")
BULK = {"gross_errors": {"fraction": 0.10, "range_sigma": [10.0, 100.0]}}
ALPHA, POWER, FEWEST = 0.001, 0.80, 5
SMALL = {
    "name": "small",
    "camera": {"ucd": {"preset": "ultracam_d"}},
    "flight": {
        "gsd_m": 0.1, "strips": 3, "images_per_strip": 8, "end_lap": 0.8, "side_lap": 0.6, "heading_deg": 30.0,
        "cross_strips": [{"position": 0.5, "images": 5}], "attitude_sigma_deg": [1.0, 1.0, 2.0],
        "position_sigma_m": [5.0, 5.0, 3.0],
    },
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
    "tie_points": {"per_image": 100, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8},
    "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
}  # fmt: skip


@dataclass(frozen=True)
class Bulk:
    """Counts of one block: above ∇0, of these flagged; keepable and all good rays, of both lost; orientation in σ."""

    above: int
    flagged: int
    keepable: int
    lost: int
    good: int
    lost_of_good: int
    off: float
    seconds: float
    named: bool


def adjust(block: aerotri.Block, method: str | None = None) -> aerotri.Adjustment:
    """The block adjusted by a robust method."""
    return aerotri.adjust(block, robust=method, explain=False)


def flagged(result: aerotri.Adjustment) -> np.ndarray:
    """(m,) rays taken for gross errors."""
    return (result.rays["status"] == "removed") | (np.nan_to_num(result.rays["weight"], nan=1.0) < 0.5)


def pair_of(result: aerotri.Adjustment, x: str, y: str) -> np.ndarray:
    """(m, 2) values of two columns of the rays."""
    return np.column_stack([result.rays[x], result.rays[y]])


def single_blunder(_: None, seed: int) -> list[int]:
    """Of one block: w tested, false alarms, errors, of these beyond the limit and removed; rays and rays lost."""
    rng = np.random.default_rng([1, seed])
    block = aerotri.simulate(SMALL, seed).block
    clean, snooped = adjust(block), adjust(block, "data-snooping")
    foul, rows, axes = with_single_errors(block, clean, rng)
    found, plain = adjust(foul, "data-snooping"), adjust(foul)
    w = pair_of(clean, "wx", "wy")[pair_of(clean, "rx", "ry") > 1e-3]
    limit = norm.ppf(1.0 - ALPHA / 2.0)
    return [
        w.size, int(np.sum(np.abs(w) > limit)), len(rows),
        int(np.sum(np.abs(pair_of(plain, "wx", "wy")[rows, axes]) > limit)),
        int(flagged(found)[rows].sum()), len(block.image_points), int(flagged(snooped).sum()),
    ]  # fmt: skip


def single_blunders(seeds: Iterable[int], runs: Runs) -> list[str]:
    """Lines of the table on single errors."""
    counts = np.sum(runs(single_blunder, None, seeds), axis=0)
    tested, alarms, errors, beyond, removed, rays, lost = counts.tolist()
    low, high = binom.ppf([0.0005, 0.9995], errors, POWER) / errors
    return [
        f"| errors of the size ∇0 with w beyond the limit | {beyond / errors:.3f} of {errors} | "
        f"{POWER:.2f} ({low:.3f} to {high:.3f}) |",
        f"| the same, removed by data snooping | {removed / errors:.3f} | the same |",
        f"| w beyond the limit without an error | {1e3 * alarms / tested:.3f} ‰ of {tested} | {1e3 * ALPHA:.3f} ‰ |",
        f"| rays removed without an error | {1e3 * lost / rays:.2f} ‰ of {rays} | {2e3 * ALPHA:.2f} ‰ (two tests) |",
    ]


def with_single_errors(block: aerotri.Block, clean: aerotri.Adjustment, rng: np.random.Generator):
    """Errors of ∇0 in points of five rays or more, each in a point and photograph of its own: block, rows, axes."""
    rays, rows, seen = block.image_points, [], set()
    often = np.bincount(rays.point)[rays.point] >= FEWEST
    for k in rng.permutation(np.flatnonzero(often)):
        own = {("point", int(rays.point[k])), ("image", int(rays.image[k]))}
        if not own & seen and len(rows) < 8:
            rows.append(int(k))
            seen |= own
    axes, xy = rng.integers(0, 2, len(rows)), rays.xy.copy()
    xy[rows, axes] += rng.choice([-1.0, 1.0], len(rows)) * pair_of(clean, "x_mde_x", "x_mde_y")[rows, axes]
    return replace(block, image_points=replace(rays, xy=xy)), np.array(rows), axes


def bulk(clean: aerotri.Block, flight, method: str) -> Bulk:
    """Counts of one block by one method."""
    foul, truth = flight.block, flight.truth
    wrong_control = foul.points[foul.control.point[truth.control_blunders]].tolist()
    reference = adjust(aerotri.edit(clean, check=wrong_control))
    begun = time.perf_counter()
    result = adjust(foul, method)
    seconds = time.perf_counter() - begun
    rays, m = foul.image_points, len(foul.image_points)
    wrong, size = np.zeros(m, dtype=bool), np.zeros((m, 2))
    wrong[truth.gross_errors], size[truth.gross_errors] = True, np.abs(truth.gross_error_mm)
    # an error of δ0·σ/√r is found with the probability POWER
    delta = norm.ppf(1.0 - ALPHA / 2.0) + norm.ppf(POWER)
    with np.errstate(divide="ignore"):
        above = (size > delta * rays.sigma / np.sqrt(pair_of(reference, "rx", "ry"))).any(axis=1)
    keepable = ~wrong & (np.bincount(rays.point[~wrong], minlength=len(foul.points))[rays.point] >= 2)
    gone = flagged(result)
    there, then = (np.concatenate([r.centre, r.angles], axis=1)
                   for r in (result.adjusted.images, reference.adjusted.images))  # fmt: skip
    named = {b.point for b in result.adjusted.blunders if b.action == "control removed"} == set(wrong_control)
    return Bulk(
        int(above.sum()), int((above & gone).sum()), int(keepable.sum()), int((keepable & gone).sum()),
        int((~wrong).sum()), int((~wrong & gone).sum()),
        float((np.abs(there - then) / reference.adjusted.images.sigma).max()), seconds, named,
    )  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A plan, the method, and what differs in the control of the flights with gross errors."""

    plan: dict
    method: str
    control: dict | None = None


def one_bulk(case: Case, seed: int) -> Bulk:
    """Counts of one block of a case."""
    return bulk(*pair(case.plan, seed, case.control), case.method)


def bulk_line(name: str, case: Case, seeds: Iterable[int], computed: Runs) -> str:
    """One line of the table on gross errors in bulk."""
    runs: list[Bulk] = computed(one_bulk, case, seeds)
    total = {key: sum(getattr(run, key) for run in runs) for key in ("above", "flagged", "keepable", "lost", "good")}
    lost_of_good = sum(run.lost_of_good for run in runs)
    off, seconds = max(run.off for run in runs), float(np.median([run.seconds for run in runs]))
    return (
        f"| {name} | {case.method} | {len(runs)} | {100 * total['flagged'] / total['above']:.2f} % | "
        f"{100 * total['lost'] / total['keepable']:.2f} % ({100 * lost_of_good / total['good']:.2f} %) | {off:.2f} | "
        f"{sum(run.named for run in runs)} | {seconds:.2f} |"
    )


def pair(plan: dict, seed: int, control: dict | None = None) -> tuple:
    """The block of a seed without gross errors, and the flight with them."""
    foul = plan | BULK | {"control": plan["control"] | (control or {})}
    return aerotri.simulate(plan, seed).block, aerotri.simulate(foul, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200, help="of the small block")
    parser.add_argument("--demo-seeds", type=int, default=20, help="of the sample block")
    add_executor(parser)
    arguments = parser.parse_args()
    small, demo = range(1, arguments.seeds + 1), range(1, arguments.demo_seeds + 1)
    plan = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    print("| single errors | found | expected |\n|---|---|---|")
    with runs_of(arguments) as runs:
        print("\n".join(single_blunders(range(1001, 1001 + arguments.seeds), runs)), flush=True)
        _print_bulk(small, demo, plan, runs)


def _print_bulk(small: Iterable[int], demo: Iterable[int], plan: dict, runs: Runs) -> None:
    print("\n| block | method | seeds | above ∇0 flagged | good lost (of all) | max off, σ | control named | s |")
    print("|---|---|---|---|---|---|---|---|")
    for name, own, point, seeds in (("29 photographs", SMALL, "C03", small), ("sample block, 132", plan, "C05", demo)):
        wrong = {"blunders": [{"point": point, "error_m": [0.0, 0.0, 10.0]}]}
        for method in METHODS:
            print(bulk_line(name, Case(own, method), seeds, runs), flush=True)
        print(bulk_line(f"the same, {point} 10 m off", Case(own, METHODS[0], wrong), seeds, runs), flush=True)


if __name__ == "__main__":
    main()
