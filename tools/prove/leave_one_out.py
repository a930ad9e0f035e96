"""Leave-one-out over the control points of a block: what each would be without itself, with and without GNSS.

Every control point in turn becomes a check point; the last lines take all control away. Prints a Markdown table:
± is σ of the noise, tZ the total σ of the height, with the model part.

Example: python tools/prove/leave_one_out.py cu_sbr_p1 --parameters brown:K1+K2+K3+P1+P2 --robust huber
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import aerotri


@dataclass(frozen=True)
class Line:
    """One line of the table: what was left out, and how the check points came out (m)."""

    control: str
    left_out: str
    result: aerotri.Adjustment | None
    reason: str = ""

    def cells(self) -> list[str]:
        if self.result is None:
            return [self.control, self.left_out, self.reason, "", "", "", "", ""]
        check = self.result.adjusted.check
        difference = check.difference if len(check) == 1 else np.nanmean(check.difference, axis=0, keepdims=True)
        sigma = check.sigma if len(check) == 1 else np.nanmean(check.sigma, axis=0, keepdims=True)
        total = check.total_sigma if len(check) == 1 else np.nanmean(check.total_sigma, axis=0, keepdims=True)
        parameters = self.result.adjusted.parameters
        focal = np.flatnonzero(parameters.names == "focal_length_mm")
        c = f"{parameters.value[focal[0]]:.4f} ± {parameters.sigma[focal[0]]:.4f}" if len(focal) else "held"
        numbers = [f"{d:+.3f} ± {s:.3f}" for d, s in zip(difference[0], sigma[0], strict=True)]
        return [self.control, self.left_out, *numbers, f"{total[0, 2]:.3f}", c, f"{self.result.sigma0_um:.2f}"]


def line(name: str, block: aerotri.Block, left_out: str, full: aerotri.Adjustment) -> Line:
    """Adjust one variant from the orientation of the full adjustment."""
    start = full.adjusted
    images = replace(block.images, centre=start.images.centre, angles=start.images.angles)
    try:
        return Line(name, left_out, aerotri.adjust(replace(block, images=images), points=start.points.xyz))
    except aerotri.AdjustmentFailedError as failure:
        return Line(name, left_out, None, failure.outcome.message)


def lines(block: aerotri.Block) -> list[Line]:
    """All lines of the table."""
    full = aerotri.adjust(block, explain=False)
    names = block.points[block.control.point[~block.control.is_check]].astype(str).tolist()
    variants = [("control and GNSS", block)] if block.gnss_ins is not None else []
    variants.append(("control alone", replace(block, gnss_ins=None)))
    table = []
    for variant, reduced in variants:
        for name in names:
            table.append(line(variant, aerotri.edit(reduced, check=[name]), name, full))
    if block.gnss_ins is not None:
        table.append(line("GNSS alone", aerotri.edit(block, check=names), "all (mean)", full))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("block", type=Path, help="block folder")
    parser.add_argument("--parameters", help="additional parameters, in place of block.toml's")
    parser.add_argument("--robust", help="robust estimator, in place of block.toml's")
    options = parser.parse_args()
    table = lines(aerotri.with_settings(options.block, parameters=options.parameters, robust=options.robust))
    print("| datum | left out | dX m | dY m | dZ m | tZ m | c mm | σ0 µm |\n|---|---|---|---|---|---|---|---|")
    for entry in table:
        print("| " + " | ".join(entry.cells()) + " |")
    print()
    for warning in table[-1].result.warnings if table[-1].result else ():
        print(f"- {table[-1].control}: {warning}")


if __name__ == "__main__":
    main()
