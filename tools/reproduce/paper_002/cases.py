"""What is adjusted for the table: the methods of the paper, and the cases that explain the differences."""

from __future__ import annotations

from dataclasses import replace

from paper_002.strip import TWO_POINTS, Case, pairs_every

GNSS_M = (0.25, 0.5, 1.0)
PAPER_MM = {"3": (45.0, 57.0, 197.0)}
"""RMS X, Y, Z of the pass points that the paper prints; what figures 1 and 2 show of methods 1 and 2 is not legible."""


def methods(photographs: int) -> list[Case]:
    """The three methods, GNSS with each of its σ."""
    return [
        *(Case("1", "GNSS, 2 control points", gnss, control=TWO_POINTS) for gnss in GNSS_M),
        *(Case("2", "GNSS, towers, no control", gnss, towers=True) for gnss in GNSS_M),
        Case("3", "full control, no GNSS", control=pairs_every(2, photographs)),
    ]


def roll_cases() -> list[Case]:
    """What holds the roll, and what does not."""
    return [
        Case("", "GNSS alone, exact observations, straight flight", 0.25, wander_m=0.0, exact=True),
        Case("", "GNSS alone, straight flight", 0.25, wander_m=0.0),
        Case("", "GNSS alone, flight wandering by 5 m", 0.25),
        Case("", "GNSS and towers, exact observations, straight flight", 0.25, towers=True, wander_m=0.0, exact=True),
        Case("", "GNSS and towers, straight flight", 0.25, towers=True, wander_m=0.0),
    ]


def control_cases(photographs: int) -> list[Case]:
    """Other layouts of full control, and the other flying height."""
    pairs = _layout(2)
    every_second = Case("", pairs, control=pairs_every(2, photographs))
    spaced = [Case("", _layout(bases), control=pairs_every(bases, photographs)) for bases in (1, 2, 4, 7, 10)]
    return [
        *spaced,
        *(replace(every_second, name=f"{pairs}, heights every {k}", heights_every=k) for k in (10, 12)),
        Case("", f"{pairs}, 40 m beside the axis", control=pairs_every(2, photographs, across=0.05)),
        replace(every_second, name=f"{pairs}, 900 m above ground", above_ground_m=900.0),
    ]


def _layout(bases: int) -> str:
    return "pairs at every base" if bases == 1 else f"pairs every {bases} bases"
