"""Are σ right where nothing is said of the additional parameters, and no set knows the camera's errors?

Simulated flights of 40 photographs (five strips and a cross strip, 80/60 %) whose image errors no set of parameters
contains, and that change: six kinds of errors, four layouts of control. Every block is adjusted as `aerotri adjust`
does it without `additional_parameters`, and with fixed sets. Check points: mean over the blocks of (error/σ)², with the
total σ and with that of the noise; its standard error from the scatter of the blocks; and the RMS of the height errors.
Of the default there is a line without what a set that predicts as well adds to total σ.
Last, a camera whose errors are a known set: the σ of the default over those of that set, and how often movement is
found.

Example: python tools/prove/default_choice.py --blocks 200 > tools/results/default_choice.md
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
from aerotri import observations
from runs_elsewhere import add_executor, runs_of

SETS = ("auto", "none", "brown:K1+K2+K3+P1+P2", "bluh:1-12", "legendre:5x5")
ALONE = "auto, σ of the set taken alone"
"""Without what a set that predicts as well adds to total σ."""
HALF = (17.5, 11.66)
"""Half width and half height of the photographs, mm."""
SIZE_UM = 2.0
"""RMS of a coordinate of the errors; the noise is as large."""
KINDS = ("tiles", "bumps", "drift", "direction", "matching", "film")
LAYOUTS = {
    "control everywhere": None,
    "four corners and the middle": 5,
    "three in a triangle": 3,
    "GNSS, one point": 1,
}
KNOWN = "constant"
"""A camera whose errors are bluh:1-12."""


def flight(gnss: bool) -> dict[str, Any]:
    """The block."""
    spec = {
        "name": "default",
        "camera": {"p1": {"model": "frame", "size_px": [8192, 5460], "pixel_um": 4.27, "focal_length_mm": 35.0}},
        "flight": {"gsd_m": 0.02, "strips": 5, "images_per_strip": 7, "end_lap": 0.8, "side_lap": 0.6,
                   "cross_strips": [{"position": 0.5, "images": 5}], "attitude_sigma_deg": [1.0, 1.0, 2.0]},
        "terrain": {"kind": "undulating", "height_m": 5.0, "relief_rms_m": 4.0, "wavelength_m": 120.0},
        "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 2.0},
        "control": {"distance_bases": 2.5, "sigma_m": [0.01, 0.01, 0.015], "check_points": 20},
        "start_values": {"kind": "perturbed", "position_sigma_m": 0.5, "angle_sigma_deg": 0.05},
    }  # fmt: skip
    if gnss:
        spec["gnss"] = {"sigma_m": [0.02, 0.02, 0.03]}
    return spec


def smooth(rng: np.random.Generator, length: float, count: int = 1) -> Any:
    """Random smooth functions of the place in the photograph: (count, 2) fields of RMS 1, correlation length in mm."""
    waves = rng.normal(0.0, 1.0 / length, (count, 2, 40, 2))
    phases = rng.uniform(0.0, 2.0 * np.pi, (count, 2, 40))

    def field(which: np.ndarray, xy: np.ndarray) -> np.ndarray:
        out = np.empty_like(xy)
        for axis in range(2):
            angle = np.einsum("rwk,rk->rw", waves[which, axis], xy) + phases[which, axis]
            out[:, axis] = np.cos(angle).mean(axis=1) * np.sqrt(2.0 * 40)
        return out

    return field


def errors(kind: str, block: observations.Block, rng: np.random.Generator) -> np.ndarray:
    """(m, 2) mm, image errors of the rays."""
    rays, n = block.image_points, len(block.images)
    xy, photo = rays.xy, rays.image
    zero, unit = np.zeros(len(xy), dtype=int), xy / np.array(HALF)
    lens = smooth(rng, 15.0)(zero, xy)
    order = np.linspace(-1.0, 1.0, n)
    if kind == "tiles":
        tile = np.floor((unit + 1.0) * 1.4999).clip(0, 2).astype(int) @ np.array([1, 3])
        shift, turn = rng.normal(size=(9, 2)), rng.normal(size=9)
        d = 0.5 * lens + shift[tile] + turn[tile, None] * np.column_stack([-unit[:, 1], unit[:, 0]])
    elif kind == "bumps":
        d = 0.5 * lens
        for _ in range(8):
            at, push = rng.uniform(-0.9, 0.9, 2), rng.normal(size=2)
            d = d + 3.0 * push * np.exp(-np.sum(((unit - at) / 0.15) ** 2, axis=1))[:, None]
    elif kind == "drift":
        d = 0.7 * lens + 1.2 * order[photo, None] * smooth(rng, 12.0)(zero, xy)
    elif kind == "direction":
        way = np.sign(np.cos(block.images.angles[:, 2]))
        d = 0.7 * lens + 0.8 * way[photo, None] * smooth(rng, 12.0)(zero, xy)
    elif kind == "matching":
        d = 0.7 * lens + 0.8 * smooth(rng, 3.0, n)(photo, xy)
    else:
        d = 0.7 * lens + 0.7 * smooth(rng, 15.0, n)(photo, xy)
    return 1e-3 * SIZE_UM * d / np.sqrt(np.mean(d**2))


def held(block: observations.Block, layout: str) -> observations.Block:
    """The block with the control of a layout; the rest of the control points are left out."""
    control = block.control
    rays = np.bincount(block.image_points.point, minlength=len(block.points))
    own = np.flatnonzero(~control.is_check & (rays[control.point] >= 4))
    place, names = control.xyz[own, :2], block.points[control.point[own]].astype(str)
    count = LAYOUTS[layout]
    centre = place.mean(axis=0)
    if count is None:
        return block
    if count == 1:
        kept = [int(np.argmin(np.linalg.norm(place - centre, axis=1)))]
    else:
        kept = [int(np.argmax(np.linalg.norm(place - centre, axis=1)))]
        while len(kept) < (4 if count == 5 else count):
            apart = np.min(np.linalg.norm(place[:, None] - place[None, kept], axis=2), axis=1)
            kept.append(int(np.argmax(apart + (0.0 if count == 5 else 0.3) * np.linalg.norm(place - centre, axis=1))))
        if count == 5:
            kept.append(int(np.argmin(np.linalg.norm(place - centre, axis=1))))
    others = np.setdiff1d(block.points[control.point[~control.is_check]].astype(str), names[kept])
    return aerotri.edit(block, off=others.tolist())


@dataclass(frozen=True)
class Found:
    """Of one block and set: mean (error/σ)² of plan and height with total σ and with that of the noise, squares of the
    errors, mean σ of heights, the set, whether it moves, and the first with total σ of the set taken alone."""

    total: tuple[float, float]
    noise: tuple[float, float]
    height_m2: float
    sigma_height: float
    chosen: str
    moves: bool
    alone: tuple[float, float]


def adjusted(block: observations.Block, spec: str) -> Found | str:
    try:
        result = aerotri.adjust(aerotri.with_settings(block, parameters=spec, robust="huber"), explain=False)
    except aerotri.AdjustmentFailedError as failure:
        return failure.outcome.message
    check, own = result.adjusted.check, result.adjusted.block
    given = {int(point): k for k, point in enumerate(own.control.point)}
    known = np.array([given[int(point)] for point in check.point])
    seen = np.isfinite(check.difference).all(axis=1)
    d, s = check.difference[seen], own.control.sigma[known][seen]
    total = check.total_sigma[seen] ** 2
    alone = total - of_other_set(result)[check.point[seen]]
    squares = [d**2 / (variance + s**2) for variance in (total, check.sigma[seen] ** 2, alone)]
    of_axes = [(float(z[:, :2].mean()), float(z[:, 2].mean())) for z in squares]
    settings = own.settings.adjustment
    chosen = ",".join(family for family, _ in settings.additional_parameters) or "none"
    height, sigma = float(np.mean(d[:, 2] ** 2)), float(np.mean(check.total_sigma[seen, 2]))
    moves = settings.parameter_groups == "strip"
    return Found(of_axes[0], of_axes[1], height, sigma, chosen, moves, of_axes[2])


def of_other_set(result: aerotri.Adjustment) -> np.ndarray:
    """(N, 3) m², what a set that predicts as well adds to the variances of the points."""
    found, variance = result.record.other, np.zeros((len(result.adjusted.block.points), 3))
    if found is not None:
        variance[result.record.system.unknowns.points] = found.other.share * found.points**2
    return variance


def simulated(seed: int, kind: str, layout: str) -> observations.Block:
    block = aerotri.simulate(flight(LAYOUTS[layout] == 1), seed=seed).block
    rng = np.random.default_rng(seed)
    rays = block.image_points
    if kind == KNOWN:
        names, patterns = aerotri.parameters.patterns("bluh:1-12", block.cameras[0], rays.xy)
        size = np.sqrt(np.mean(patterns**2, axis=(0, 1)))
        d = patterns @ (rng.normal(size=len(names)) / size)
        d *= 1e-3 * SIZE_UM / np.sqrt(np.mean(d**2))
    else:
        d = errors(kind, block, rng)
    return held(replace(block, image_points=replace(rays, xy=rays.xy + d)), layout)


def run(_: None, job: tuple[int, str, str]) -> dict[str, Found | str]:
    block = simulated(*job)
    return {spec: adjusted(block, spec) for spec in (SETS if job[1] != KNOWN else ("auto", "bluh:1-12"))}


def kept(folder: Path, job: tuple[int, str, str]) -> dict[str, Found | str]:
    """As `run`; what an earlier run has left in the folder is read."""
    file = folder / f"{job[0]}.json"
    if not file.is_file():
        found = {spec: one if isinstance(one, str) else asdict(one) for spec, one in run(None, job).items()}
        file.with_suffix(".part").write_text(json.dumps(found))
        file.with_suffix(".part").rename(file)
    read = json.loads(file.read_text())
    return {spec: one if isinstance(one, str) else Found(**one) for spec, one in read.items()}


def cell(values: list[float]) -> str:
    """Mean and standard error."""
    return f"{np.mean(values):.2f} ± {np.std(values, ddof=1) / np.sqrt(len(values)):.2f}" if len(values) > 1 else "–"


def line(title: str, spec: str, found: list[Found | str], total: str = "total") -> str:
    there = [one for one in found if not isinstance(one, str)]
    cells = [cell([getattr(one, which)[k] for one in there]) for which in (total, "noise") for k in range(2)]
    rms = f"{100 * np.sqrt(np.mean([one.height_m2 for one in there])):.1f}" if there else "–"
    return f"| {title} | {spec} | {len(there)} of {len(found)} | {' | '.join(cells)} | {rms} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=200, help="blocks with errors that no set contains")
    parser.add_argument("--known", type=int, default=24, help="blocks whose errors are a known set")
    add_executor(parser)
    parser.add_argument("--keep", type=Path, help="folder for the outcomes, from which a later run goes on")
    options = parser.parse_args()
    work = run
    if options.keep is not None:
        options.keep.mkdir(parents=True, exist_ok=True)
        options.keep, work = options.keep.resolve(), kept
    layouts = list(LAYOUTS)
    jobs = [(s, KINDS[s % 6], layouts[s // 6 % 4]) for s in range(1, options.blocks + 1)]
    known = [(1000 + s, KNOWN, layouts[s % 4]) for s in range(options.known)]
    with runs_of(options) as runs:
        outcomes = runs(work, options.keep, jobs + known)
    of_unknown, of_known = outcomes[: len(jobs)], outcomes[len(jobs) :]
    print(f"# Default parameters, {len(jobs)} simulated blocks (tools/prove/default_choice.py)\n")
    print("Mean of (error/σ)² at check points and its standard error; 1 is right. RMS of heights in cm.\n")
    print("| blocks | parameters | adjusted | XY, total σ | Z, total σ | XY, σ of noise | Z, σ of noise | RMS Z |")
    print("|---|---|---|---|---|---|---|---|")
    for spec in SETS:
        print(line("all", spec, [one[spec] for one in of_unknown]))
        if spec == "auto":
            print(line("all", ALONE, [one[spec] for one in of_unknown], "alone"))
    for title, at in (*((kind, 1) for kind in KINDS), *((layout, 2) for layout in LAYOUTS)):
        for spec in SETS[:3]:
            own = [one[spec] for one, job in zip(of_unknown, jobs, strict=True) if job[at] == title]
            print(line(title, spec, own))
            if spec == "auto":
                print(line(title, ALONE, own, "alone"))
    chosen: dict[str, Counter[str]] = defaultdict(Counter)
    for one, job in zip(of_unknown, jobs, strict=True):
        auto = one["auto"]
        if not isinstance(auto, str):
            chosen[job[1]][auto.chosen + (", by strip" if auto.moves else "")] += 1
    print("\n| errors | what auto took |\n|---|---|")
    for kind, counts in chosen.items():
        print(f"| {kind} | {', '.join(f'{name} {count}' for name, count in counts.most_common())} |")
    pairs = [(one["auto"], one["bluh:1-12"]) for one in of_known]
    both = [(a, b) for a, b in pairs if not isinstance(a, str) and not isinstance(b, str)]
    if both:
        ratios = [a.sigma_height / b.sigma_height for a, b in both]
        taken = Counter(a.chosen for a, _ in both)
        print(f"\nA camera that errs by bluh:1-12, {len(both)} blocks: σ of heights of the default over those of "
              f"bluh:1-12 {np.median(ratios):.2f} (median), {max(ratios):.2f} at most; movement found in "
              f"{sum(a.moves for a, _ in both)}; taken: {dict(taken)}. Mean of (error/σ)² in height "
              f"{cell([a.total[1] for a, _ in both])}.")  # fmt: skip


if __name__ == "__main__":
    main()
