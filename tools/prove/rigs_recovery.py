"""Rigs on simulated flights whose truth is known: errors over σ, false alarms and power of the tests of rigidity.

Three rigs, of which each flight has ten exposures: two heads, a nadir and four oblique cameras, four heads of a large
format. Every flight has a terrain, a flight path and noise of its own. z is (found − true)/σ.

Example: nice python tools/prove/rigs_recovery.py --seeds 200
"""

from __future__ import annotations

import argparse
import copy
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2

import aerotri
from aerotri import geometry, observations
from runs_elsewhere import Runs, add_executor, runs_of

Z = dict[tuple[str, str], float]
LETTERS = ("x", "y", "z", "omega", "phi", "kappa")
STATED = {"position_sigma_m": [0.005, 0.005, 0.005]}
FIRST = 20_000
"""Seed of the first flight."""
PLAY_DEG = 0.003
"""σ of the turns of mounted cameras where they move."""
LEVEL = 0.05
"""Probability at which false alarms are counted: at that of the block they are too rare to count."""
SPEC: dict[str, Any] = {
    "name": "rig",
    "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
               "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0]},
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
    "tie_points": {"per_image": 30, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 6},
    "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
}  # fmt: skip
GNSS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08], "lever_arm_m": [0.2, -0.3, 1.1]}}
OBLIQUE = {camera: {"focal_length_mm": 80.0} for camera in ("fore", "aft", "right", "left")}


@dataclass(frozen=True)
class Kind:
    """A rig: preset, its mounted cameras, what is stated of each, and further tables of the plan."""

    preset: str
    heads: tuple[str, ...]
    stated: dict[str, Any] = field(default_factory=lambda: STATED)
    more: dict[str, Any] = field(default_factory=dict)


KINDS = {
    "two heads": Kind("two_head", ("right",)),
    "two heads, GNSS, positions on the rig free": Kind("two_head", ("right",), {}, GNSS),
    "nadir and four oblique": Kind(
        "oblique_5",
        tuple(OBLIQUE),
        # all strips in one direction: else one camera looks out of the block on both
        more={
            "camera": {"nadir": {"focal_length_mm": 55.0}, **OBLIQUE},
            "flight": SPEC["flight"] | {"alternating": False},
        },
    ),
    "four heads of a large format": Kind("large_format_4", ("head_2", "head_3", "head_4")),
}
FLOWN: tuple[str, ...] = tuple(name for name in KINDS if "GNSS" not in name)
"""Those that are flown as weighted rigs."""
TESTED = (*FLOWN[:2], "four heads of a large format")
"""Those whose power is looked at."""


def flown(kind: Kind, seed: int, moving: dict[str, Any] | None = None, **rig: Any) -> Any:
    """A flight, block and truth; `moving` adds keys to the mounted cameras, a table a camera."""
    heads = {head: kind.stated | (moving or {}).get(head, {}) for head in kind.heads}
    plan = copy.deepcopy(SPEC | kind.more) | {"rig": {"frame": {"preset": kind.preset, "camera": heads, **rig}}}
    return aerotri.simulate(plan, seed)


def adjusted(block: aerotri.Block) -> Any:
    """The adjusted block."""
    return aerotri.adjust(block, explain=False).adjusted


def normalised(found: Any, truth: Any) -> Z:
    """z of the mountings, of two exposures, of a photograph that follows, and of two check points."""
    out: Z = {}
    for one in found.rigs:
        error = np.concatenate([one.position, one.angles]) - truth.mountings[one.camera]
        error[3:] = np.remainder(error[3:] + np.pi, 2.0 * np.pi) - np.pi
        out |= {(one.camera, letter): z for letter, z in zip(LETTERS, error / one.sigma, strict=True)}
    lead = np.flatnonzero(found.block.images.camera == 0)
    rows = {"first exposure": lead[0], "third exposure": lead[2], "photograph that follows": lead[2] + 1}
    for name, row in rows.items():
        gap = found.images.centre[row] - truth.centre[row], found.images.angles[row] - truth.angles[row]
        z = np.concatenate(gap) / found.images.sigma[row]
        out |= {(name, letter): value for letter, value in zip(LETTERS, z, strict=True)}
    for k in (0, len(found.check.w) - 1):
        out |= {("check point", f"{axis} of {k + 1}"): z for axis, z in zip("XYZ", found.check.w[k], strict=True)}
    return out


def row_of_errors(name: str, runs: list[tuple[Z, Any]]) -> str:
    """A row of the table of z; every unknown by itself."""
    n, names = len(runs), list(runs[0][0])
    z = np.array([list(one.values()) for one, _ in runs])
    bias, spread = np.abs(z.mean(axis=0)) * np.sqrt(n), np.mean(z**2, axis=0)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    vtpv, redundancy = (sum(getattr(outcome, what) for _, outcome in runs) for what in ("vtpv", "redundancy"))
    band = chi2.ppf([0.0005, 0.9995], redundancy) / redundancy
    worst = " ".join(names[int(bias.argmax())])
    return (f"| {name} | {len(names)} | {bias.max():.2f} ({worst}) | {np.sum(bias > 3.29)} | "
            f"{np.sqrt(np.mean(z**2)):.3f} | {spread.min():.2f} … {spread.max():.2f} | {low:.2f} … {high:.2f} | "
            f"{vtpv / redundancy:.4f} in {band[0]:.4f} … {band[1]:.4f} |")  # fmt: skip


HEAD_OF_ERRORS = (
    "| rig | unknowns | largest bias | beyond 3.29 | RMS z of all | mean z² of single ones | 99.9 % band | σ0² |\n"
    + "|---" * 8
    + "|"
)


def of_rigid(name: str, seed: int) -> tuple[Z, Any, Any]:
    """z, outcome and tests of rigidity of a flight."""
    flight = flown(KINDS[name], seed)
    found = adjusted(flight.block)
    return normalised(found, flight.truth), found.outcome, found.rigidity


def rigid(seeds: Iterable[int], names: Iterable[str], runs: Runs) -> dict[str, list[Any]]:
    """Rigs that are rigid: table of z; the tests of rigidity of every flight, by kind."""
    print(f"## Rigid\n\n{HEAD_OF_ERRORS}")
    out = {}
    for name in names:
        found = runs(of_rigid, name, seeds)
        out[name] = [rigidity for _, _, rigidity in found]
        print(row_of_errors(name, [(z, outcome) for z, outcome, _ in found]), flush=True)
    return out


def false_alarms(tests: dict[str, list[Any]]) -> None:
    """How often cameras and photographs that are in their places are said to move."""
    print(f"\n## False alarms\n\nAlarms of a block at {LEVEL:.0%} (all tests together), and single tests with "
          f"p below {LEVEL:.0%}.\n\n| rig | blocks with an alarm: cameras | photographs | exposures | 99.9 % up to | "
          "single tests of cameras | share of each, smallest … largest | 99.9 % band | mean p of each |\n"
          + "|---" * 9 + "|")  # fmt: skip
    for name, every in tests.items():
        n = len(every)
        p = np.array([[q for one in block.heads for q in (one.movement_p, one.drift_p)] for block in every])
        of_cameras = np.mean(p.min(axis=1) * p.shape[1] < LEVEL)
        of_photographs = np.mean([one.stations.p.min() * len(one.stations) < LEVEL for one in every])
        of_exposures = np.mean([one.whole.p.min() * len(one.whole) < LEVEL for one in every])
        share, (low, high) = (p < LEVEL).mean(axis=0), binom.ppf([0.0005, 0.9995], n, LEVEL) / n
        top = binom.ppf(0.999, n, LEVEL) / n
        alarms = " | ".join(f"{part:.3f}" for part in (of_cameras, of_photographs, of_exposures, top))
        print(f"| {name} | {alarms} | {p.shape[1]} | {share.min():.3f} … {share.max():.3f} | "
              f"{low:.3f} … {high:.3f} | {p.mean(axis=0).min():.2f} … "
              f"{p.mean(axis=0).max():.2f} |")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Before:
    """A flight that did not move: its seed, and what its tests of rigidity said."""

    seed: int
    tests: Any

    def __str__(self) -> str:
        return f"with seed {self.seed}"


def of_moving(name: str, before: Before) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    """Sizes that the tests state for a flight, and which movements of these sizes are found."""
    kind, seed, tests = KINDS[name], before.seed, before.tests
    camera, limit = kind.heads[0], tests.alpha / (2 * len(tests.heads))
    turn, shift = (tests.head("frame", camera, what) for what in ("rotation", "position"))
    axis = np.random.default_rng(seed).normal(size=3)
    axis /= np.linalg.norm(axis)
    one = tests.station_detectable["frame", camera]
    turning = {"play_rotation_deg": float(np.degrees(turn.movement_detectable))}
    shifting = {"play_position_m": shift.movement_detectable}
    drifting = {"drift_rotation_deg": np.degrees(turn.drift_detectable * axis).tolist()}
    return (turn.movement_detectable, shift.movement_detectable, turn.drift_detectable, one), (
        _head(kind, seed, camera, turning).movement_p < limit,
        _head(kind, seed, camera, shifting, "position").movement_p < limit,
        _head(kind, seed, camera, drifting).drift_p < limit,
        _single(kind, seed, camera, one * axis, tests.alpha),
    )


def power(tests: dict[str, list[Any]], seeds: Iterable[int], rigs: tuple[str, ...], runs: Runs) -> None:
    """How often movements of the size said to be detectable are found: the flights again, with a camera that moves."""
    print("\n## Movements of the detectable size\n\nOne mounted camera moves by the size that the tests state for "
          "this flight. Drifts and single turns are about any axis; their stated size is that of the worst axis.\n\n"
          "| rig | what moves | median size | found | stated power | 99.9 % band |\n" + "|---" * 6 + "|")  # fmt: skip
    for name in rigs:
        stated, jobs = tests[name][0].power, [Before(seed, each) for seed, each in zip(seeds, tests[name], strict=True)]
        sizes, hits_of = zip(*runs(of_moving, name, jobs), strict=True)
        turned, moved, drifted, single = zip(*hits_of, strict=True)
        n = len(turned)
        low, high = binom.ppf([0.0005, 0.9995], n, stated) / n
        median = np.median(np.array(sizes), axis=0) * np.array([np.degrees(3600.0), 1e3, *np.degrees([3600.0] * 2)])
        for what, size, hits, exact in (
            ("turns anew at every exposure", f"σ {median[0]:.1f}″", turned, True),
            ("shifts anew at every exposure", f"σ {median[1]:.0f} mm", moved, True),
            ("turns slowly", f"{median[2]:.1f}″", drifted, False),
            ("is turned in one photograph", f"{median[3]:.0f}″", single, False),
        ):
            band = f"{low:.3f} … {high:.3f}" if exact else f"at least {low:.3f}"
            asked = f"{stated:.2f}" if exact else f"at least {stated:.2f}"
            print(f"| {name} | {what} | {size} | {np.mean(hits):.3f} | {asked} | {band} |", flush=True)


def _head(kind: Kind, seed: int, camera: str, plays: dict[str, Any], what: str = "rotation") -> Any:
    """The test of a camera that moves."""
    return adjusted(flown(kind, seed, {camera: plays}).block).rigidity.head("frame", camera, what)


def _single(kind: Kind, seed: int, camera: str, turn: np.ndarray, alpha: float) -> bool:
    """Whether one photograph of a camera, turned about axes of the reference camera, is found."""
    flight = flown(kind, seed)
    block, truth = flight.block, flight.truth
    names = [one.name for one in block.cameras]
    own = np.flatnonzero(block.images.camera == names.index(camera))
    rays = np.bincount(block.image_points.image, minlength=len(block.images))
    row = int(own[np.argsort(rays[own])[len(own) // 2]])
    station = block.images.columns["station"]
    lead = int(np.flatnonzero((block.images.camera == 0) & (station == station[row]))[0])
    reference, before = geometry.rotation_from_angles(truth.angles[[lead, row]], block.rotation)
    axis = reference @ turn
    after = Rotation.from_rotvec(axis).as_matrix() @ before
    focal = block.cameras[int(block.images.camera[row])].focal_length_mm
    seen = block.image_points.image == row
    xy = block.image_points.xy.copy()
    rays = np.column_stack([xy[seen], np.full(int(seen.sum()), -focal)]) @ (after.T @ before).T
    xy[seen] = -focal * rays[:, :2] / rays[:, 2:]
    tests = adjusted(replace(block, image_points=replace(block.image_points, xy=xy))).rigidity.stations
    return bool(tests.p[tests.image == row][0] < alpha / len(tests))


def of_weighted(name: str, seed: int) -> tuple[tuple[Z, Any], tuple[Z, Any], Any]:
    """z and outcome of a flight with σ of the movements stated, and estimated; the movements that were found."""
    flight = flown(KINDS[name], seed, play_rotation_deg=PLAY_DEG, constraint="weighted")
    stated = adjusted(with_movement(flight.block, float(np.radians(PLAY_DEG))))
    estimated = adjusted(flight.block)
    pairs = [(normalised(found, flight.truth), found.outcome) for found in (stated, estimated)]
    return pairs[0], pairs[1], estimated.rig_movements


def weighted(seeds: Iterable[int], rigs: tuple[str, ...], runs: Runs) -> None:
    """Rigs whose cameras turn: with σ of the movements stated, and estimated."""
    print(f"\n## Weighted\n\nEvery mounted camera turns by σ {3600 * PLAY_DEG:.1f}″ between exposures."
          f"\n\n{HEAD_OF_ERRORS}")  # fmt: skip
    estimates = {}
    for name in rigs:
        stated, estimated, sizes = zip(*runs(of_weighted, name, seeds), strict=True)
        print(row_of_errors(f"{name}, movements stated", list(stated)), flush=True)
        print(row_of_errors(f"{name}, movements estimated", list(estimated)), flush=True)
        estimates[name] = sizes
    print("\n| rig | camera | true σ | found, RMS | scatter of the found ones | their σ, mean | found 0 |\n"
          + "|---" * 7 + "|")  # fmt: skip
    for name, sizes in estimates.items():
        for k, camera in enumerate(sizes[0].camera):
            found, own = (np.degrees([getattr(one, what)[k, 1] for one in sizes]) * 3600.0
                          for what in ("sigma", "sigma_sigma"))  # fmt: skip
            print(f"| {name} | {camera} | {3600 * PLAY_DEG:.1f}″ | {np.sqrt(np.mean(found**2)):.1f}″ | "
                  f"{np.std(found):.1f}″ | {np.mean(own[found > 0.0]):.1f}″ | {np.sum(found == 0.0)} |")  # fmt: skip


def with_movement(block: aerotri.Block, movement: float) -> aerotri.Block:
    """The block that states σ of the turns of its cameras, rad."""
    rig = block.rigs[0]
    cameras: dict[str, observations.Mounting] = {
        name: replace(one, movement_rad=movement) for name, one in rig.cameras.items()
    }
    return replace(block, rigs=(replace(rig, cameras=cameras),))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--rigs", nargs="*", default=list(KINDS), help="these alone")
    parser.add_argument("--rigid", action="store_true", help="no weighted rigs")
    add_executor(parser)
    options = parser.parse_args()
    seeds, rigs = range(FIRST, FIRST + options.seeds), tuple(options.rigs)
    begun = time.process_time()
    print(f"# Rigs flown and adjusted: {len(seeds)} flights a row\n")
    with runs_of(options) as runs:
        tests = rigid(seeds, rigs, runs)
        false_alarms(tests)
        power(tests, seeds, tuple(name for name in rigs if name in TESTED), runs)
        if not options.rigid:
            weighted(seeds, tuple(name for name in rigs if name in FLOWN), runs)
    print(f"\n{time.process_time() - begun:.0f} s of the processor in this process")


if __name__ == "__main__":
    main()
