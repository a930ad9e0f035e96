"""Real blocks started from their measured points alone: no orientation, no angles, no nominal mounting.

cu_sbr_p1 (581 vertical photographs with RTK), ca502 (five heads, oblique and weakly tied, GNSS of metres; the heads as
independent cameras), ca502 as a rig of which nothing but the stations is known, and dbat_roma (60 photographs from the
ground and above, neither GNSS nor control: inner datum). Printed are the time of the start by itself, the photographs
that it orients, what its rays miss, and the adjustment that begins there beside the one that begins as usual: with
strips (cu_sbr_p1), with the nadir head turned by the nominal angles of the mounting (ca502), with the nominal mounting
(ca502 as a rig), with the orientations that the file states (dbat_roma). Seconds are those of the processor: other
programs may run beside. Prints Markdown.

Measures the start without the adjustment that follows: looks within the package on purpose.

Example: python tools/prove/starts.py ../shared/data > tools/results/starts.md
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import aerotri
from aerotri import observations
from aerotri.pipeline.starting import with_start

sys.path.insert(0, str(Path(__file__).resolve().parent))

import ca502
import rigs

ARM_SIGMA_M = 0.1
"""σ of the position of a head on the frame, of which nothing is known but that the frame is small."""
BROWN = "brown:K1+K2+K3+P1+P2"


def cu_sbr_p1(data: Path) -> tuple[aerotri.Block, aerotri.Block]:
    folder = data / "cu_sbr_p1"
    block = aerotri.read(
        folder / "tp_bingo.txt", positions=folder / "gnss_positions.csv", gnss_shift="off",
        control=folder / "control_points.csv", control_prefix="GCP_", camera_name="P1", camera_size=(8192, 5460),
        pixel_um=4.27246, focal_length_mm=35.01, free_interior=True, image_sigma_px=0.5, crs="EPSG:32647",
    ).block  # fmt: skip
    block = aerotri.with_settings(block, parameters=BROWN, robust="huber")
    return block, aerotri.with_settings(block, start="strips")


def ca502_(data: Path) -> tuple[aerotri.Block, aerotri.Block]:
    block = ca502.unoriented(data / "ca502")
    return block, ca502.oriented(block)


def ca502_rig(data: Path) -> tuple[aerotri.Block, aerotri.Block]:
    usual = rigs.whole_stations(rigs.with_rig(ca502.unoriented(data / "ca502")))
    arm = observations.Prior(0.0, ARM_SIGMA_M)
    cameras = dict.fromkeys(usual.rigs[0].cameras, observations.Mounting((arm, arm, arm), known=False))
    return replace(usual, rigs=(replace(usual.rigs[0], cameras=cameras),)), usual


def dbat_roma(data: Path) -> tuple[aerotri.Block, aerotri.Block]:
    block = aerotri.with_settings(aerotri.read(data / "dbat_roma").block, datum="inner")
    nothing = np.full((len(block.images), 3), np.nan)
    return replace(block, images=replace(block.images, centre=nothing, angles=nothing.copy())), block


CASES: dict[str, Callable[[Path], tuple[aerotri.Block, aerotri.Block]]] = {
    "cu_sbr_p1": cu_sbr_p1, "ca502": ca502_, "ca502 as a rig": ca502_rig, "dbat_roma": dbat_roma,
}  # fmt: skip


def adjusted(block: aerotri.Block) -> tuple[list[str], int, np.ndarray]:
    """Cells of the table, and whether each photograph took part."""
    begun = time.process_time()
    try:
        found = aerotri.adjust(block, explain=False, model_part="off").adjusted
    except aerotri.AdjustmentFailedError as failure:
        return [failure.outcome.status, "", "", "", f"{time.process_time() - begun:.0f}"], 0, np.zeros(0)
    o = found.outcome
    used = int((found.images.rays > 0).sum())
    rays = int((found.rays.status == 0).sum())
    cells = [o.status, f"{used}", f"{rays}", f"{o.sigma0_um:.3f}", f"{time.process_time() - begun:.0f}"]
    return cells, used, found.images.centre


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with the data sets")
    parser.add_argument("--blocks", nargs="+", choices=list(CASES), default=list(CASES))
    options = parser.parse_args()
    print("# Started from measured points alone (tools/prove/starts.py)\n")
    print("| block | photographs | start from | oriented | s of the start | status | adjusted | rays | σ0 µm | s |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    said = []
    for name in options.blocks:
        bare, usual = CASES[name](options.data)
        begun = time.process_time()
        started = with_start(aerotri.with_settings(bare, start="points"))
        seconds = time.process_time() - begun
        oriented = int(np.isfinite(started.block.images.angles).all(axis=1).sum())
        cells, _, _ = adjusted(started.block)
        count = len(bare.images)
        print(f"| {name} | {count} | points | {oriented} | {seconds:.0f} | {' | '.join(cells)} |", flush=True)
        cells, _, _ = adjusted(usual)
        print(f"| {name} | {count} | as usual | | | {' | '.join(cells)} |", flush=True)
        said.append(f"- {name}: {' '.join(started.messages)}")
    print("\n" + "\n".join(said))


if __name__ == "__main__":
    main()
