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
from runs_elsewhere import Runs, add_executor, runs_of


@dataclass(frozen=True)
class Line:
    """One line of the table: what was left out, and how the check points came out (m)."""

    control: str
    left_out: str
    numbers: tuple[str, ...] = ("",) * 6
    warnings: tuple[str, ...] = ()

    def cells(self) -> list[str]:
        return [self.control, self.left_out, *self.numbers]


@dataclass(frozen=True, eq=False)
class Whole:
    """The block with the orientation of its full adjustment to start from, and the points there."""

    block: aerotri.Block
    points: np.ndarray


@dataclass(frozen=True)
class Variant:
    """What is left out: names of control points, as the table calls them, with or without GNSS."""

    control: str
    left_out: str
    check: tuple[str, ...]
    uses_gnss: bool

    def __str__(self) -> str:
        return f"without {self.left_out}, {self.control}"


def numbers_of(result: aerotri.Adjustment) -> tuple[str, ...]:
    """Cells on the check points, the principal distance and σ0."""
    check = result.adjusted.check
    difference = check.difference if len(check) == 1 else np.nanmean(check.difference, axis=0, keepdims=True)
    sigma = check.sigma if len(check) == 1 else np.nanmean(check.sigma, axis=0, keepdims=True)
    total = check.total_sigma if len(check) == 1 else np.nanmean(check.total_sigma, axis=0, keepdims=True)
    parameters = result.adjusted.parameters
    focal = np.flatnonzero(parameters.names == "focal_length_mm")
    c = f"{parameters.value[focal[0]]:.4f} ± {parameters.sigma[focal[0]]:.4f}" if len(focal) else "held"
    numbers = [f"{d:+.3f} ± {s:.3f}" for d, s in zip(difference[0], sigma[0], strict=True)]
    return *numbers, f"{total[0, 2]:.3f}", c, f"{result.sigma0_um:.2f}"


def line(whole: Whole, variant: Variant) -> Line:
    """Adjust one variant from the orientation of the full adjustment."""
    block = aerotri.edit(whole.block, check=list(variant.check))
    if not variant.uses_gnss:
        block = replace(block, gnss_ins=None)
    try:
        found = aerotri.adjust(block, points=whole.points)
    except aerotri.AdjustmentFailedError as failure:
        return Line(variant.control, variant.left_out, (failure.outcome.message, "", "", "", "", ""))
    return Line(variant.control, variant.left_out, numbers_of(found), tuple(found.warnings))


def variants_of(block: aerotri.Block) -> list[Variant]:
    """All that is left out, in turn."""
    names = block.points[block.control.point[~block.control.is_check]].astype(str).tolist()
    has_gnss = block.gnss_ins is not None
    kinds = [("control and GNSS", True)] if has_gnss else []
    out = [Variant(kind, name, (name,), gnss) for kind, gnss in (*kinds, ("control alone", False)) for name in names]
    return [*out, Variant("GNSS alone", "all (mean)", tuple(names), True)] if has_gnss else out


def lines(block: aerotri.Block, runs: Runs) -> list[Line]:
    """All lines of the table."""
    full = aerotri.adjust(block, explain=False).adjusted
    images = replace(block.images, centre=full.images.centre, angles=full.images.angles)
    return runs(line, Whole(replace(block, images=images), full.points.xyz), variants_of(block))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("block", type=Path, help="block folder")
    parser.add_argument("--parameters", help="additional parameters, in place of block.toml's")
    parser.add_argument("--robust", help="robust estimator, in place of block.toml's")
    add_executor(parser)
    options = parser.parse_args()
    block = aerotri.with_settings(options.block, parameters=options.parameters, robust=options.robust)
    with runs_of(options) as runs:
        table = lines(block, runs)
    print("| datum | left out | dX m | dY m | dZ m | tZ m | c mm | σ0 µm |\n|---|---|---|---|---|---|---|---|")
    for entry in table:
        print("| " + " | ".join(entry.cells()) + " |")
    print()
    for warning in table[-1].warnings:
        print(f"- {table[-1].control}: {warning}")


if __name__ == "__main__":
    main()
