"""Do check points confirm σ on real blocks? Control left out, for several sets of additional parameters.

cu_sbr_p1 with and without RTK: every control point left out in turn, and every pair. ca502, as
independent cameras and as one rig: every control point in turn. dbat_sxb: four control points, the rest are check
points. Printed are the RMS of the height errors, of them over the σ of the noise and over the total σ, and the same in
plan; 1 is right, and over six points a right σ gives 0.22 to 2.0 in 99.9 % of the cases. Prints Markdown.

Example: python tools/prove/real_check_points.py ../shared/data --blocks cu_sbr_p1 > tools/results/real_check_points.md
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

import aerotri

sys.path.insert(0, str(Path(__file__).resolve().parent))

import ca502
import rigs
from runs_elsewhere import Runs, add_executor, runs_of

BYTES_OF_RUN, BYTES_A_RAY = 300_000_000, 6_000
"""Memory of an adjustment, as `halves` counts it."""
ITERATIONS = 150
"""At most; a block that four points hold takes more than the usual 30."""
MEASURED = {"parameter_position": "measured"}
STRIPS = {"parameter_groups": "strip", "deviations": {"kind": "independent"}}
SETS = {
    "none": ("none", {}),
    "brown, at measured points": ("brown:K1+K2+K3+P1+P2", MEASURED),
    "brown": ("brown:K1+K2+K3+P1+P2", {}),
    "lens": ("lens:k1+k2+k3+p1+p2", {}),
    "legendre:4x4": ("legendre:4x4", {}),
    "legendre:5x5": ("legendre:5x5", {}),
    "brown, strips differ": ("brown:K1+K2+K3+P1+P2", STRIPS),
    "brown, collocation": ("brown:K1+K2+K3+P1+P2,collocation", {}),
    "auto": ("auto", {}),
}


@dataclass(frozen=True)
class Case:
    """A block and what is left out of it, in turn."""

    name: str
    block: aerotri.Block
    left_out: tuple[tuple[str, ...], ...]


def cu_sbr_p1(data: Path) -> Iterator[Case]:
    folder = data / "cu_sbr_p1"
    block = aerotri.read(
        folder / "tp_bingo.txt", positions=folder / "gnss_positions.csv", gnss_shift="off",
        control=folder / "control_points.csv", control_prefix="GCP_", camera_name="P1", camera_size=(8192, 5460),
        pixel_um=4.27246, focal_length_mm=35.01, free_interior=True, image_sigma_px=0.5, crs="EPSG:32647",
    ).block  # fmt: skip
    block = started(aerotri.with_settings(block, parameters="brown:K1+K2+K3+P1+P2", robust="huber"))
    names = control_names(block)
    left_out = (*((name,) for name in names), *combinations(names, 2))
    yield Case("cu_sbr_p1, control alone", replace(block, gnss_ins=None), left_out)
    yield Case("cu_sbr_p1, RTK and control", block, left_out)


def ca502_independent(data: Path) -> Iterator[Case]:
    block = started(ca502.oriented(ca502.unoriented(data / "ca502")))
    yield Case("ca502, independent cameras", block, tuple((name,) for name in control_names(block)))


def ca502_rig(data: Path) -> Iterator[Case]:
    block = started(rigs.with_rig(ca502.unoriented(data / "ca502")))
    yield Case("ca502, one rig", block, tuple((name,) for name in control_names(block)))


def dbat_sxb(data: Path) -> Iterator[Case]:
    block = started(aerotri.read(data / "dbat_sxb").block)
    names, xyz = control_names(block), block.control.xyz[~block.control.is_check]
    held = [int(np.argmin(xyz[:, 0]))]
    while len(held) < 4:
        apart = np.min(np.linalg.norm(xyz[:, None, :2] - xyz[None, held, :2], axis=2), axis=1)
        held.append(int(np.argmax(apart)))
    yield Case("dbat_sxb, four control points", block, (tuple(np.delete(names, held).tolist()),))


CASES: dict[str, Callable[[Path], Iterator[Case]]] = {
    "cu_sbr_p1": cu_sbr_p1,
    "ca502_independent": ca502_independent,
    "ca502_rig": ca502_rig,
    "dbat_sxb": dbat_sxb,
}


def control_names(block: aerotri.Block) -> list[str]:
    return block.points[block.control.point[~block.control.is_check]].astype(str).tolist()


def started(block: aerotri.Block) -> aerotri.Block:
    """The block with its adjusted orientations to start from."""
    images = aerotri.adjust(block, explain=False).adjusted.images
    known = np.isfinite(images.centre).all(axis=1)[:, None]
    centre = np.where(known, images.centre, block.images.centre)
    angles = np.where(known, images.angles, block.images.angles)
    return replace(block, images=replace(block.images, centre=centre, angles=angles))


def errors(block: aerotri.Block, left_out: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | str:
    """Differences (k, 3) m of the check points, their σ and their total σ; why where there are none."""
    try:
        adjusted = aerotri.adjust(aerotri.edit(block, check=list(left_out)), explain=False).adjusted
    except aerotri.AdjustmentFailedError as failure:
        return failure.outcome.message
    if adjusted.outcome.status != "converged":
        return adjusted.outcome.message
    check = adjusted.check
    return check.difference, check.sigma, check.total_sigma


def row(case: Case, name: str, runs: Runs) -> str:
    """One line of the table."""
    parameters, settings = SETS[name]
    begun = time.perf_counter()
    block = aerotri.with_settings(case.block, parameters=parameters, max_iterations=ITERATIONS, **settings)
    found = runs(errors, block, case.left_out, BYTES_OF_RUN + BYTES_A_RAY * len(block.image_points))
    there = [one for one in found if not isinstance(one, str)]
    if not there:
        return f"| {case.name} | {name} | {found[0]} | | | | | | |"
    d, s, t = (np.concatenate(parts) for parts in zip(*there, strict=True))

    def rms(values: np.ndarray) -> str:
        return f"{np.sqrt(np.nanmean(values**2)):.3g}"

    plan = [rms(d[:, :2]), rms(d[:, :2] / s[:, :2]), rms(d[:, :2] / t[:, :2])]
    height = [rms(d[:, 2]), rms(d[:, 2] / s[:, 2]), rms(d[:, 2] / t[:, 2])]
    count = f"{len(there)} of {len(found)}"
    return "| " + " | ".join([case.name, name, count, *height, *plan, f"{time.perf_counter() - begun:.0f}"]) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with the data sets")
    parser.add_argument("--blocks", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--singles", action="store_true", help="no pairs")
    parser.add_argument("--pairs", action="store_true", help="pairs alone")
    add_executor(parser)
    options = parser.parse_args()
    print("# Control left out of real blocks (tools/prove/real_check_points.py)\n")
    print("| block | parameters | adjusted | RMS dZ m | dZ/σ | dZ/total σ | RMS dX dY m | over σ | over total σ | s |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    with runs_of(options) as runs:
        for case in (case for name in options.blocks for case in CASES[name](options.data)):
            if options.singles:
                case = replace(case, left_out=tuple(one for one in case.left_out if len(one) != 2))
            if options.pairs:
                case = replace(case, left_out=tuple(one for one in case.left_out if len(one) == 2))
            for chosen in options.sets:
                print(row(case, chosen, runs), flush=True)


if __name__ == "__main__":
    main()
