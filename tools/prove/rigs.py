"""A rig of five cameras, rigid and as five independent cameras (CU-SBR CA502): mountings, σ, control left out in turn.

Only the BINGO file, the GNSS positions, the control points and the nominal mounting go in: no start values. The cameras
as independent ones start from the orientations of the rigid adjustment.

Example: python tools/prove/rigs.py ca502 --leave-out
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import aerotri
from aerotri import geometry, observations
from ca502 import MOUNTING_DEG, NADIR, cells_of, exposures, left_out_in_turn, print_table, unoriented
from runs_elsewhere import add_executor, runs_of

POSITION_M = {"A": (0, -0.05, 0.02), "D": (0, 0.05, 0.02), "W": (-0.05, 0, 0.02), "X": (0.05, 0, 0.02)}
"""Nominal projection centres of the heads in the frame of the nadir head."""
NAMES = {"rigid": "Rigid", "weighted": "Weighted", "off": "Independent cameras"}
COMPARED = 40
"""Exposures whose relative orientations are compared."""
STEP_M, STEP_RAD = 1e-3, 1e-6
SIGMA_M = 0.02
"""σ of a nominal position; the nominal angles are start values only."""


def with_rig(block: aerotri.Block, constraint: str = "rigid", sigma_m: float = SIGMA_M) -> aerotri.Block:
    """The block with its five heads on one rig; an exposure is a station."""
    station = np.array([name[1:] for name in block.images.names.tolist()], dtype=object)
    cameras = {
        head: observations.Mounting(
            tuple(observations.Prior(float(v), sigma_m) for v in position),
            tuple(observations.Prior(float(np.radians(v))) for v in MOUNTING_DEG[head]),
        )
        for head, position in POSITION_M.items()
    }
    rig = observations.Rig("ca502", NADIR, cameras, constraint)
    there = {camera.name for camera in block.cameras}
    rig = replace(rig, cameras={head: mounting for head, mounting in rig.cameras.items() if head in there})
    return replace(block, rigs=(rig,), images=replace(block.images, columns={"station": station}))


def whole_stations(block: aerotri.Block) -> aerotri.Block:
    """Photographs whose exposure has none of the nadir head stand alone."""
    station = block.images.columns["station"].copy()
    names = [camera.name for camera in block.cameras]
    led = station[np.array([names[c] == NADIR for c in block.images.camera])]
    station[~np.isin(station, led)] = ""
    return replace(block, images=replace(block.images, columns={"station": station}))


def relative(found: aerotri.Adjustment, block: aerotri.Block) -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
    """Mean relative orientation of every head over some exposures (m and degrees), its σ, and how many exposures.

    σ follows from the joint covariance of the photographs: what they share, such as the principal points, does not
    become smaller with their number.
    """
    images, names = found.adjusted.images, block.images.names.tolist()
    row = {name: k for k, name in enumerate(names) if np.isfinite(images.centre[k, 0])}
    out = {}
    for head in POSITION_M:
        both = [name for name in names if name[0] == head and name in row and NADIR + name[1:] in row]
        both = both[:: max(1, len(both) // COMPARED)]
        pairs = [photograph for name in both for photograph in (NADIR + name[1:], name)]
        covariance = found.covariance(pairs).matrix
        start = np.array([[*images.centre[row[name]], *images.angles[row[name]]] for name in pairs]).reshape(-1, 12)
        six, partials = zip(*(_with_partials(twelve, block.rotation) for twelve in start), strict=True)
        value, wide = np.array(six), np.zeros((len(both), 6, len(covariance)))
        for k, own in enumerate(partials):
            wide[k, :, 12 * k : 12 * k + 12] = own
        value[:, 3:] = value[0, 3:] + (value[:, 3:] - value[0, 3:] + 180.0) % 360.0 - 180.0
        weight = 1.0 / np.einsum("kij,jl,kil->ki", wide, covariance, wide)
        weight /= weight.sum(axis=0)
        mean = np.einsum("ki,kij->ij", weight, wide)
        out[head] = (weight * value).sum(axis=0), np.sqrt(np.diagonal(mean @ covariance @ mean.T)), len(both)
    return out


def _with_partials(twelve: np.ndarray, order: str) -> tuple[np.ndarray, np.ndarray]:
    """Position (m) and angles (degrees) of one photograph in the frame of another (6,), and partials (6, 12)."""

    def relation(both: np.ndarray) -> np.ndarray:
        lead = geometry.rotation_from_angles(both[3:6], order)
        turn = lead.T @ geometry.rotation_from_angles(both[9:], order)
        return np.concatenate([lead.T @ (both[6:9] - both[:3]), np.degrees(geometry.angles_from_rotation(turn, order))])

    steps = np.tile([STEP_M, STEP_M, STEP_M, STEP_RAD, STEP_RAD, STEP_RAD], 2)
    columns = [
        (relation(twelve + step * one) - relation(twelve - step * one)) / (2.0 * step)
        for step, one in zip(steps, np.eye(12), strict=True)
    ]
    return relation(twelve), np.column_stack(columns)


def mountings(found: aerotri.Adjustment) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Position (m) and angles (degrees) of every head of a rigid rig, and their σ."""
    p, out = found.adjusted.parameters, {}
    for name in POSITION_M:
        rows = np.flatnonzero((p.kinds == "rig") & (p.groups == name))
        unit = np.where(np.arange(len(rows)) < 3, 1.0, np.degrees(1.0))
        out[name] = p.value[rows] * unit, p.sigma[rows] * unit
    return out


def print_rig(rigid: aerotri.Adjustment) -> None:
    """The mountings of the rigid rig with their σ."""
    print("| head | " + " | ".join(f"{e} | σ" for e in ("x m", "y m", "z m", "omega °", "phi °", "kappa °")) + " |")
    print("|---" * 13 + "|")
    for name, (value, sigma) in mountings(rigid).items():
        cells = " | ".join(f"{v:.4f} | {s:.4f}" for v, s in zip(value, sigma, strict=True))
        print(f"| {name} | {cells} |")
    print(flush=True)


def print_mountings(rigid: aerotri.Adjustment, off: aerotri.Adjustment, block: aerotri.Block) -> None:
    """Rigid and independent side by side."""
    print("| head | element | rigid | σ | independent (mean) | σ of it | difference over σ | exposures |")
    print("|---|---|---|---|---|---|---|---|")
    free = relative(off, block)
    for name, (value, sigma) in mountings(rigid).items():
        middle, spread, count = free[name]
        for k, element in enumerate(("x m", "y m", "z m", "omega °", "phi °", "kappa °")):
            other = value[k] + (middle[k] - value[k] + 180.0) % 360.0 - 180.0 if k > 2 else middle[k]
            ratio = (other - value[k]) / np.hypot(sigma[k], spread[k])
            numbers = " | ".join(f"{v:.4f}" for v in (value[k], sigma[k], other, spread[k]))
            print(f"| {name} | {element} | {numbers} | {ratio:+.1f} | {count} |")
    print()


def print_rigidity(found: aerotri.Adjustment) -> None:
    """What the tests say of every head."""
    tests = found.adjusted.rigidity
    if tests is None:
        return
    print("| head | what | exposures | movement σ | ± | would be found | p | largest drift over σ | p of drift |")
    print("|---|---|---|---|---|---|---|---|---|")
    for one in tests.heads:
        unit, name = (np.degrees(3600.0), "″") if one.what == "rotation" else (1000.0, "mm")
        sizes = " | ".join(f"{unit * v:.1f}" for v in (one.movement, one.movement_sigma, one.movement_detectable))
        drift = float(np.nanmax(np.abs(one.drift / one.drift_sigma)))
        print(f"| {one.camera} | {one.what} {name} | {one.stations} | {sizes} | {one.movement_p:.2g} | {drift:.1f} | "
              f"{one.drift_p:.2g} |")  # fmt: skip
    print("\n" + "\n".join(text for text in found.adjusted.outcome.warnings if " rig " in text))
    out = tests.stations
    print(f"\nPhotographs out of place: {int(out.found.sum())} of {len(out)}\n", flush=True)


def print_movements(found: aerotri.Adjustment) -> None:
    """σ of the movements of every head of a weighted rig."""
    moves = found.adjusted.rig_movements
    if moves is None:
        return
    print("| head | σ of position mm | σ of rotation ″ |\n|---|---|---|")
    for name, (position, rotation) in zip(moves.camera, moves.sigma, strict=True):
        print(f"| {name} | {1000.0 * position:.1f} | {3600.0 * np.degrees(rotation):.1f} |")
    print(flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the data")
    parser.add_argument("--exposures", type=int, default=10**6, help="the first ones only")
    parser.add_argument(
        "--constraints", default="rigid,off", help="in this order; each starts where the one before ends"
    )
    parser.add_argument("--leave-out", action="store_true", help="every control point in turn")
    parser.add_argument("--orientations", type=Path, help="file of start orientations; written where it is not there")
    parser.add_argument("--position-sigma", type=float, default=SIGMA_M, help="σ of the nominal positions, m")
    add_executor(parser)
    options = parser.parse_args()
    block = exposures(unoriented(options.folder), 0, options.exposures)
    block = whole_stations(with_rig(block, sigma_m=options.position_sigma))
    found: dict[str, aerotri.Adjustment] = {}
    for name in options.constraints.split(","):
        own = replace(block, rigs=tuple(replace(rig, constraint=name) for rig in block.rigs))
        if found:
            own = oriented_as(own, next(reversed(found.values())))
        elif options.orientations is not None and options.orientations.exists():
            with np.load(options.orientations) as kept:
                own = replace(own, images=replace(own.images, centre=kept["centre"], angles=kept["angles"]))
        started = time.perf_counter()
        found[name] = aerotri.adjust(own, explain=False)
        print(f"\n## {NAMES[name]}\n")
        print_table(found[name], time.perf_counter() - started)
        if options.orientations is not None and not options.orientations.exists():
            images = found[name].adjusted.images
            np.savez(options.orientations, centre=images.centre, angles=images.angles)
        if found[name].adjusted.rigs:
            print_rig(found[name])
            print_rigidity(found[name])
            print_movements(found[name])
        if options.leave_out:
            print("| left out | | dX m | dY m | dZ m | d/σ X | d/σ Y | d/σ Z |\n|---|---|---|---|---|---|---|---|")
            with runs_of(options) as runs:
                for point, left in left_out_in_turn(own, found[name], runs):
                    print(f"| {point} | {name} | {cells_of(left)}", flush=True)
    if {"rigid", "off"} <= found.keys():
        print("\n## Relative orientations\n")
        print_mountings(found["rigid"], found["off"], block)


def oriented_as(block: aerotri.Block, found: aerotri.Adjustment) -> aerotri.Block:
    """The block with the orientations of an adjustment as start values."""
    images = found.adjusted.images
    return replace(block, images=replace(block.images, centre=images.centre, angles=images.angles))


if __name__ == "__main__":
    main()
