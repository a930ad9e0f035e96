"""The tables of the deformation, in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paper_003_deformation.cases import Case, Picture
from paper_003_deformation.even_odd import EvenOdd

X_PARALLAX_PX = 0.25
"""[P] "the operational x-parallax accuracy of 0.25 pixels"."""

HEADER = """\
| figure | camera, block | parameters | end lap % | b mm | h/b | paper | 1 µm of x-parallax cm | dZ cm | RMS dZ | \
RMS less a surface of second order | RMS dX, dY | mean σ of dZ |
|---|---|---|---|---|---|---|---|---|---|---|---|---|"""

EXPLANATION = """\
dX, dY, dZ are wrong minus true over the normal-case model on level ground, variant free: the orientation of the
self-calibrated block, the photographs used uncorrected. σ comes from the covariance of the additional parameters.

What can be compared with the paper, whose blocks are not published:

1. **Geometry.** Base, h/b and the effect of a micrometre follow from end lap, format and focal length: h/b to the
   printed digit (the paper cuts off after the first decimal).
2. **End lap.** The same image errors make another deformation in every end lap: its lines are not those of 66.3 % drawn
   smaller or larger. The effect of an x-parallax grows with h/b, while a small base sees less of a smooth error.
3. **Parameters.** With 1–12 alone the deformation is smooth; with the camera's own parameters it gets the pattern of
   the image's parts, and steps where they meet. The kinks at the projection centres belong to the terms of 1–12 in
   the polar angle, which have no derivative in the centre of the image.
4. **Cameras.** What is left after a surface of second order is taken off is the local part: large for the UltraCamD,
   small for the DMC ("the influence to the height is smoother for the DMC while it is more complex and local for the
   UltraCamD"). X and Y suffer less than Z in all of them.
5. **9.2 cm.** For 0.25 px of x-parallax at 66 % the paper expects 9.2 cm. By its own h/b and flying height it is
   {expected:.1f} cm.
"""

EVEN_ODD = """\
UltraCamD, end lap {end_lap:.2f} %: models of every second photograph, oriented by an adjustment without parameters,
intersected from the true image errors and corrected by what the self-calibration knows of them. The paper reports some
25 cm before. Noise of matching is left out: 0.25 px of x-parallax in both models would put {noise:.1f} cm into the
difference, more than what the correction leaves.
"""


@dataclass(frozen=True, eq=False)
class Row:
    """A deformation with what it was made of."""

    case: Case
    parameters: str
    picture: Picture
    deformation: Any


def markdown(rows: Sequence[Row], compared: Sequence[tuple[str, EvenOdd]], end_lap: float) -> str:
    """The whole answer."""
    first = rows[0].deformation.geometry
    expected = X_PARALLAX_PX * 9.0 * first.cm_per_um
    lines = [
        "# Paper 003, section 6: model deformation",
        "",
        HEADER,
        *(_row(row) for row in sorted(rows, key=lambda row: row.picture.number)),
        "",
        EXPLANATION.format(expected=expected),
        "## Heights of even and of odd photographs",
        "",
        EVEN_ODD.format(end_lap=100.0 * end_lap, noise=np.sqrt(2.0) * expected),
        "| correction with | points | even − odd before, RMS cm | after | error of a height before, RMS cm | after |",
        "|---|---|---|---|---|---|",
        *(
            f"| {name} | {found.count} | {100 * found.difference[0]:.1f} | {100 * found.difference[1]:.1f} | "
            f"{100 * found.error[0]:.1f} | {100 * found.error[1]:.1f} |"
            for name, found in compared
        ),
        "",
    ]
    return "\n".join(lines)


def _row(row: Row) -> str:
    d, g = row.deformation, row.deformation.geometry
    dz = 100.0 * d.d[..., 2]
    plan = 100.0 * np.sqrt(np.nanmean(d.d[..., :2] ** 2, axis=(0, 1)))
    printed = "" if row.picture.h_over_b is None else f"{row.picture.h_over_b:g}"
    return (
        f"| {row.picture.number} | {row.case.title} | {row.parameters} | {100 * g.end_lap:.1f} | {g.base_mm:.2f} | "
        f"{g.h_over_b:.2f} | {printed} | {g.cm_per_um:.2f} | {np.nanmin(dz):+.0f} … {np.nanmax(dz):+.0f} | "
        f"{np.sqrt(np.nanmean(dz**2)):.1f} | {_local_rms(d, dz):.1f} | {plan[0]:.1f}, {plan[1]:.1f} | "
        f"{100 * np.nanmean(d.sigma[..., 2]):.1f} |"
    )


def _local_rms(d, dz: np.ndarray) -> float:
    """RMS of what a surface of second order leaves."""
    x, y = np.meshgrid(d.x / np.abs(d.x).max(), d.y / np.abs(d.y).max())
    known = np.isfinite(dz)
    terms = np.stack([x * 0 + 1, x, y, x * y, x * x, y * y], axis=-1)[known]
    left = dz[known] - terms @ np.linalg.lstsq(terms, dz[known], rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))
