"""Five heads on one frame, oblique and weakly tied (CU-SBR CA502): the block, its adjustment, control left out in turn.

The cameras of the frame are adjusted as independent ones. The nadir head is oriented along its track and adjusted by
itself; the orientation of every exposure, turned by the nominal angles of the mounting, is the start of the other
heads. Only the BINGO file, the GNSS positions, the control points and the nominal angles go in. The positions are those
of a receiver without corrections: a shift that they have in common is an unknown.

Example: python tools/prove/ca502.py ../shared/data/ca502 --leave-out
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import aerotri
from aerotri import geometry
from runs_elsewhere import BYTES_OF_RUN, Runs, add_executor, runs_of

PARAMETERS, ROBUST = "brown:K1+K2+K3+P1+P2", "huber"
FOCAL_MM = {"S": 28.0, "A": 43.0, "D": 43.0, "W": 43.0, "X": 43.0}
NADIR = "S"
MOUNTING_DEG = {"S": (0, 0, 0), "A": (0, 45, 90), "D": (0, -45, -90), "W": (45, 0, 0), "X": (-45, 0, 180)}
"""Nominal omega, phi, kappa of the heads in the frame of the nadir head."""
SIGMA_PX = 1.4
"""σ of an image coordinate: half a pixel of matching and what a lens of this kind keeps for itself."""
CAMERA = """[camera.{name}]
model = "frame"
size_px = [6000, 4000]
pixel_um = 3.92
focal_length_mm = {focal}
[camera.{name}.interior]
focal_length_mm = {{ value = {focal}, sigma = 0.5 }}
x0_mm = {{ value = 0.0, sigma = 0.5 }}
y0_mm = {{ value = 0.0, sigma = 0.5 }}
"""


def unoriented(folder: Path) -> aerotri.Block:
    """The block of the files alone, every head a camera of its own; the first letter of a photograph is its head."""
    with tempfile.TemporaryDirectory() as place:
        bingo, cameras = Path(place) / "tp_bingo.txt", Path(place) / "cameras.toml"
        text = (folder / "tp_bingo.txt").read_text(encoding="utf-8")
        bingo.write_text(re.sub(r"^([ADSWX])(\d+) H_\S+", r"\1\2 \1", text, flags=re.MULTILINE), encoding="utf-8")
        parts = [CAMERA.format(name=name, focal=focal) for name, focal in FOCAL_MM.items()]
        cameras.write_text("\n".join(parts), encoding="utf-8")
        block = aerotri.read(
            bingo, name="ca502", positions=folder / "gnss_positions.csv", control=folder / "control_points.csv",
            camera=cameras, crs="EPSG:32647", control_prefix="GCP_", control_sigma_m=(0.02, 0.02, 0.03),
            image_sigma_px=SIGMA_PX, gnss_shift="block",
        ).block  # fmt: skip
    return aerotri.with_settings(block, parameters=PARAMETERS, robust=ROBUST)


def part_of(block: aerotri.Block, keep: np.ndarray) -> aerotri.Block:
    """The block of some photographs (n,) bool."""
    row, images, rays, gnss = np.cumsum(keep) - 1, block.images, block.image_points, block.gnss_ins
    own, observed = keep[rays.image], keep[gnss.image]
    used = np.unique(images.camera[keep])
    return replace(
        block,
        cameras=tuple(block.cameras[k] for k in used),
        images=replace(
            images, names=images.names[keep], camera=np.searchsorted(used, images.camera[keep]),
            strip=images.strip[keep], centre=images.centre[keep], angles=images.angles[keep],
        ),
        image_points=replace(
            rays, image=row[rays.image[own]], point=rays.point[own], xy=rays.xy[own], sigma=rays.sigma[own]
        ),
        gnss_ins=replace(
            gnss, image=row[gnss.image[observed]], xyz=gnss.xyz[observed], sigma=gnss.sigma[observed],
            angles=gnss.angles[observed], angles_sigma=gnss.angles_sigma[observed], time=gnss.time[observed],
        ),
    )  # fmt: skip


def exposures(block: aerotri.Block, first: int, count: int) -> aerotri.Block:
    """The block of some exposures in turn."""
    number = np.array([int(name[1:]) for name in block.images.names.tolist()])
    return part_of(block, np.isin(number, np.unique(number)[first : first + count]))


def oriented(block: aerotri.Block) -> aerotri.Block:
    """The block with start values: the nadir head as adjusted by itself, turned by the nominal mounting."""
    names = block.images.names.tolist()
    nadir = np.array([name[0] == NADIR for name in names])
    alone = aerotri.adjust(part_of(block, nadir), explain=False).adjusted.images
    row = {name[1:]: k for k, name in enumerate(n for n in names if n[0] == NADIR)}
    own = np.array([row.get(name[1:], -1) for name in names])
    mounted = geometry.rotation_from_angles(np.radians([MOUNTING_DEG[name[0]] for name in names]))
    rotation = geometry.rotation_from_angles(alone.angles[own], block.rotation) @ mounted
    rotation[own < 0] = np.nan
    centre, angles = alone.centre[own], geometry.angles_from_rotation(rotation, block.rotation)
    centre[own < 0] = np.nan
    return replace(block, images=replace(block.images, centre=centre, angles=angles))


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A control point that was left out: difference, its σ, and difference over σ, (3,) each."""

    difference: np.ndarray
    sigma: np.ndarray
    w: np.ndarray


def left_out_in_turn(block: aerotri.Block, full: aerotri.Adjustment, runs: Runs) -> list[tuple[str, LeftOut | str]]:
    """Every control point as a check point, from the orientation of the full adjustment; why where there is none."""
    start = full.adjusted
    oriented = replace(block, images=replace(block.images, centre=start.images.centre, angles=start.images.angles))
    names = block.points[block.control.point].astype(str).tolist()
    found = runs(_left_out, (oriented, start.points.xyz), names, BYTES_OF_RUN + 3000 * len(block.image_points))
    return list(zip(names, found, strict=True))


def _left_out(start: tuple[aerotri.Block, np.ndarray], name: str) -> LeftOut | str:
    block, points = start
    try:
        check = aerotri.adjust(aerotri.edit(block, check=[name]), points=points).adjusted.check
    except aerotri.AdjustmentFailedError as failure:
        return failure.outcome.message
    if not len(check):
        return "no photograph here shows it"
    return LeftOut(check.difference[0], check.sigma[0], check.w[0])


def print_table(found: aerotri.Adjustment, seconds: float) -> None:
    result, o = found.adjusted, found.adjusted.outcome
    print("| status | iterations | seconds | σ0 µm | photographs | points | rays |\n|---|---|---|---|---|---|---|")
    print(
        f"| {o.status} | {o.iterations} | {seconds:.0f} | {o.sigma0_um:.2f} | {int((result.images.rays > 0).sum())} | "
        f"{int((result.points.rays > 0).sum())} | {int((result.rays.status == 0).sum())} |\n"
    )
    print("| set aside | reason | count |\n|---|---|---|")
    gone = found.set_aside
    for kind in ("photograph", "point"):
        reasons, counts = np.unique(gone["reason"][gone["kind"] == kind].astype(str), return_counts=True)
        for reason, count in zip(reasons, counts, strict=True):
            print(f"| {kind}s | {reason} | {count} |")
    print(f"\nVerdict: {o.verdict}; " + "; ".join(o.reasons) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the data")
    parser.add_argument("--exposures", type=int, default=10**6, help="the first ones only")
    parser.add_argument("--leave-out", action="store_true", help="every control point in turn")
    add_executor(parser)
    options = parser.parse_args()
    block = oriented(exposures(unoriented(options.folder), 0, options.exposures))
    started = time.perf_counter()
    result = aerotri.adjust(block, explain=False)
    print_table(result, time.perf_counter() - started)
    if options.leave_out:
        print("| left out | dX m | dY m | dZ m | d/σ X | d/σ Y | d/σ Z |\n|---|---|---|---|---|---|---|")
        with runs_of(options) as runs:
            for name, found in left_out_in_turn(block, result, runs):
                print(f"| {name} | {cells_of(found)}")


def cells_of(left: LeftOut | str) -> str:
    """The rest of a row of the table of points that were left out."""
    if isinstance(left, str):
        return f"{left} | | | | | |"
    cells = [f"{a:+.3f} ± {b:.3f}" for a, b in zip(left.difference, left.sigma, strict=True)]
    return " | ".join(cells + [f"{a:+.1f}" for a in left.w]) + " |"


if __name__ == "__main__":
    main()
