"""Every family of additional parameters on the blocks of paper 003 and on blocks given: who is best, what auto takes.

The blocks of blocks/ are simulated anew (seed 1; their cameras err by physics, which no set knows). Printed are σ0 and
RMS at check points and at control points predicted without themselves (X, Y, Z in cm), and how much worse than by the
best set parts of the block are predicted by the rest, as `compare-parameters` finds them. The last answer stands in
tools/results/compare_families.md.

Example: python tools/prove/compare_families.py ../cu_sbr_p1 --robust huber > tools/results/compare_families.md
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import aerotri

BLOCKS = Path(__file__).parents[2] / "blocks"
SIMULATED = ("frederiksstad_ultracam", "frederiksstad_dmc", "frederiksstad_rmk", "dsk_saar_ultracam")


def centimetres(accuracy) -> str:
    """RMS X, Y, Z; a dash where there are no points."""
    known = [f"{100 * v:.1f}" if np.isfinite(v) else "–" for v in accuracy.rms]
    return ", ".join(known) if set(known) != {"–"} else "–"


def table(block: aerotri.Block) -> list[str]:
    """Lines on one block."""
    started = time.perf_counter()
    comparison = aerotri.compare_parameters(block)
    seconds = time.perf_counter() - started
    outcomes, reason = comparison.record.outcomes, comparison.reason
    least = min(o.bic for o in outcomes if o.converged)
    prediction, error = comparison.table["prediction"].tolist(), comparison.table["prediction_error"].tolist()
    lines = [
        f"## {block.name}",
        "",
        f"{len(block.images)} photographs, {len(block.image_points)} rays; {seconds:.0f} s for all.",
        "",
        "| set | parameters (effective) | σ0 µm | check points | control without itself | ΔBIC | prediction |",
        "|---|---|---|---|---|---|---|",
    ]
    for o, value, scatter in zip(outcomes, prediction, error, strict=True):
        if not o.converged:
            lines.append(f"| {o.name} | – | {o.status} | | | | |")
            continue
        number = f"{o.count}" if abs(o.effective - o.count) < 0.5 else f"{o.count} ({o.effective:.0f})"
        name = f"**{o.name}**" if o.name == comparison.choice else o.name
        lines.append(
            f"| {name} | {number} | {o.sigma0_um:.2f} | {centimetres(o.check)} | {centimetres(o.control)} | "
            f"{o.bic - least:.0f} | {value:.0f} ± {scatter:.0f} |"
        )
    return [*lines, "", f"{reason[:1].upper()}{reason[1:]}.", ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blocks", type=Path, nargs="*", help="Block folders beside those of blocks/.")
    parser.add_argument("--robust", default="huber", help="For the blocks given.")
    options = parser.parse_args()
    blocks = [aerotri.simulate(BLOCKS / name / "simulation.toml", 1).block for name in SIMULATED]
    blocks += [aerotri.with_settings(path, robust=options.robust) for path in options.blocks]
    print("# Families of additional parameters compared\n\nBold: what `--parameters auto` takes among them.\n")
    for block in blocks:
        print("\n".join(table(block)), flush=True)


if __name__ == "__main__":
    main()
