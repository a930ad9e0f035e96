"""The table of paper 002, ours beside the paper's, in Markdown, with the differences explained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paper_002.cases import PAPER_MM
from paper_002.strip import Case, Precision

Rows = Sequence[tuple[Case, Precision]]

HEADER = (
    "| method | σ GNSS m | μX | μY | μZ | μ | RMS X | RMS Y | RMS Z | RMS | σ roll ° | paper RMS X, Y, Z |",
    "|---|---|---|---|---|---|---|---|---|---|---|---|",
)

EXPLANATION = """\
μ is the theoretical precision √(tr Q/3n)·σ̂0 of the pass points, RMS the practical one against the simulated truth, both
over all simulations; ± is the scatter of the RMS of single simulations. All in mm. Figures below are those of 50
photographs.

Where ours and the paper's differ, and where the paper differs from itself:

1. **Scale and height.** 1:5000 with f = 152 mm is flown 760 m above the ground, not 900 m. Both hold where 900 m counts
   from the sea and the ground lies at 140 m ± 75 m. We fly 760 m above ground: the scale settles what 5 µm are on the
   ground (25 mm). At 900 m above ground everything grows by some 8 % (the image part by 18 %, the part of the control
   not at all): it explains no difference.
2. **Full control.** The paper prints 45, 57 and 197 mm and not where its control lies. Pairs left and right at every
   base or every second come to its X and Y. Its Z does not go with them: with h/b = 1.65 rays of 5 µm give μZ/μX of 1.5
   to 1.8 in every layout of full control points; the paper has 4.4. Control close to the axis loosens the roll and
   raises Z alone, but to 124 mm only, and where full points ever farther apart bring Z to 197 mm, X and Y are twice the
   paper's. What gives all three is plan control at every second base with heights at every 10th to 12th only: 50, 53
   and 176 to 216 mm. The page does not say whether that was it, or whether 197 is a misprint.
3. **Figures 1 and 2** show the RMS of methods 1 and 2 without legible numbers. What the text says of them holds here:
   GNSS alone leaves an "if not singular system", and towers stand in for control: μ of method 2 is within 15 % of that
   with two control points.
4. **What holds the roll.** The centres of a straight flight lie on a line and leave the roll about it free: with exact
   observations the adjustment is rank deficient and says so. Errors of the GNSS bend that line by decimetres, so that
   the equations seem regular while σ of the roll is tens of degrees; a flight that wanders by 5 m brings it to a third
   of a degree, metres in Y. Towers bring it to 0.015°, whatever the GNSS is worth: 50 of 15 m, each top known against
   its foot to some 28 mm. That is 0.2 m in Y at the distance of the ground, the floor of Y in method 2, while X and Z
   follow the σ of GNSS.
5. **Practical against theoretical.** The errors of a strip move together, so the RMS of one simulation scatters by a
   fifth to a third about μ; over all simulations they agree.\
"""


def markdown(methods: Rows, roll: Rows, control: Rows, runs: int, photographs: int) -> str:
    """The whole answer."""
    parts = [
        f"# Paper 002: a strip of {photographs} photographs by three methods, {runs} simulations each",
        _table(methods),
        "## What holds the roll",
        _table(roll),
        "## Layouts of full control",
        _table(control),
        "## Explanation",
        EXPLANATION,
    ]
    return "\n\n".join(parts) + "\n"


def _table(rows: Rows) -> str:
    return "\n".join([*HEADER, *(_row(case, precision) for case, precision in rows)])


def _row(case: Case, found: Precision) -> str:
    name = f"({case.method}) {case.name}" if case.method else case.name
    gnss = "–" if case.gnss_m is None else f"{case.gnss_m:g}"
    if found.failure:
        return f"| {name} | {gnss} | {found.failure.replace('|', '/')} " + "| " * 9 + "|"
    practical = [_with_spread(*pair) for pair in zip(found.practical, found.spread, strict=True)]
    paper = PAPER_MM.get(case.method)
    cells = [
        name,
        gnss,
        *(_mm(value) for value in found.theoretical),
        _mm(_over_coordinates(found.theoretical)),
        *practical,
        _mm(_over_coordinates(found.practical)),
        f"{found.roll_deg:.3g}",
        "not legible" if case.method and paper is None else ", ".join(f"{mm:.0f}" for mm in paper or ()),
    ]
    return "| " + " | ".join(cells) + " |"


def _over_coordinates(values: np.ndarray) -> float:
    """μ of the paper, over X, Y and Z."""
    return float(np.sqrt(np.mean(values**2)))


def _mm(metres: float) -> str:
    return "–" if not np.isfinite(metres) else f"{1e3 * metres:.0f}"


def _with_spread(metres: float, spread: float) -> str:
    return "–" if not np.isfinite(metres) else f"{1e3 * metres:.0f} ± {1e3 * spread:.0f}"
