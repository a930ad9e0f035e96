"""The σ that `aerotri plan` predicts against the errors of simulated flights.

A plan is flown many times with other errors of its measurements, each flight is adjusted by `aerotri.adjust`, and the
errors of the ground points are divided by the predicted σ. Their standard deviation over the flights has to be 1 within
its own uncertainty, at every ground point.

    python tools/prove/plan.py --flights 100 --out tools/results/plan.md
    python tools/prove/plan.py --flights 400 --piles-only --only "four corners"
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

import aerotri
from runs_elsewhere import Runs, add_executor, runs_of

AREA = "POLYGON ((0 0, 320 20, 300 210, 60 180, 0 0))"
PLANS: dict[str, dict[str, Any]] = {
    "four corners": {"control": 4},
    "control to a target": {"target": "sigma-z 0.035"},
    "GNSS, one control point": {"control": 1, "positions_sigma": (0.03, 0.05)},
    "GNSS, lens calibrated": {
        "control": 3, "positions_sigma": (0.03, 0.05), "self_calibration": "brown:K1+K2+P1+P2", "cross_strips": 1,
    },
}  # fmt: skip
PILES = "MULTIPOLYGON (((60 40, 90 45, 85 75, 58 70, 60 40)), ((130 70, 260 80, 250 180, 140 160, 130 70)))"
PILE_PLANS = ("four corners", "GNSS, one control point")
"""Plans whose σ of piles are checked too."""
CELLS = 5
"""Of the map along each side, in the table."""


def planned(name: str) -> Any:
    """One of the plans."""
    piles = PILES if name in PILE_PLANS else None
    return aerotri.plan_flight(
        AREA, camera="p1", gsd=0.03, ground=100.0, tie_points=100, forward_overlap=0.7, side_overlap=0.5,
        piles=piles, **PLANS[name],
    )  # fmt: skip


def normalised(plan: Any, seed: int) -> np.ndarray:
    """(g, 3) errors of the ground points of a flight over their predicted σ."""
    table = plan.ground_points
    truth = np.column_stack([table[axis] for axis in "XYZ"])
    sigma = np.column_stack([table[f"s{axis}"] for axis in "XYZ"])
    result = aerotri.adjust(plan.fly(seed))
    row = {name: k for k, name in enumerate(result.points["point"].tolist())}
    own = [row[name] for name in table["point"].tolist()]
    return (np.column_stack([result.points[axis] for axis in "XYZ"])[own] - truth) / sigma


def cell_numbers(xy: np.ndarray) -> np.ndarray:
    """(g,) cell of every ground point, row by row."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    place = np.minimum((CELLS * (xy - low) / (high - low)).astype(int), CELLS - 1)
    return CELLS * place[:, 1] + place[:, 0]


def lines_of(name: str, plan: Any, errors: np.ndarray) -> list[str]:
    """What one plan showed."""
    table = plan.ground_points
    cell = cell_numbers(np.column_stack([table["X"], table["Y"]]))
    flights = len(errors)
    by_point = np.sqrt((errors**2).mean(axis=0))
    low, high = (np.sqrt(chi2.ppf(p, flights) / flights) for p in (0.025, 0.975))
    inside = ((by_point >= low) & (by_point <= high)).mean(axis=0)
    whole = np.sqrt((errors**2).mean(axis=(0, 1)))
    out = [
        f"## {name}", "",
        f"{len(plan.exposures)} photographs, {len(plan.control)} control points, {len(table)} ground points, {flights} "
        f"flights. σ of Z predicted: median {np.median(table['sZ']):.3f} m, largest {np.max(table['sZ']):.3f} m.", "",
        "| | X | Y | Z |", "|---|---|---|---|",
        "| standard deviation of error over σ, all | " + " | ".join(f"{v:.3f}" for v in whole) + " |",
        "| smallest of a ground point | " + " | ".join(f"{v:.2f}" for v in by_point.min(axis=0)) + " |",
        "| largest of a ground point | " + " | ".join(f"{v:.2f}" for v in by_point.max(axis=0)) + " |",
        f"| ground points between {low:.2f} and {high:.2f} (95 % expected) | "
        + " | ".join(f"{100 * v:.0f} %" for v in inside) + " |", "",
        "Z by cells of the area, north at the top:", "",
        "|" + " |" * CELLS, "|" + "---|" * CELLS,
    ]  # fmt: skip
    for row in reversed(range(CELLS)):
        values = [errors[:, cell == CELLS * row + column, 2] for column in range(CELLS)]
        out.append("| " + " | ".join(f"{np.sqrt((v**2).mean()):.2f}" if v.size else "" for v in values) + " |")
    return [*out, ""]


def pile_errors(plan: Any, seed: int) -> list[float]:
    """Errors of the volumes of a flight, m³: size of a pile times the mean error of its places, as measured."""
    block, record = plan.expected_block, plan.record
    at = {name: k for k, name in enumerate(block.points.tolist())}
    result = aerotri.adjust(plan.fly(seed), explain=False, model_part="off")
    z = dict(zip(result.points["point"].tolist(), result.points["Z"].tolist(), strict=True))
    return [
        float(one.area * np.mean([z[name] - record.expected.xyz[at[name], 2] for name in one.points]))
        for one in record.piles
    ]


def errors_of(name: str, seed: int) -> np.ndarray:
    """`normalised` of a plan by its name."""
    return normalised(planned(name), seed)


def pile_errors_of(name: str, seed: int) -> list[float]:
    """`pile_errors` of a plan by its name."""
    return pile_errors(planned(name), seed)


def pile_lines(name: str, plan: Any, errors: np.ndarray) -> list[str]:
    """σ of every pile beside the scatter of its simulated volumes."""
    flights = len(errors)
    low, high = (np.sqrt(chi2.ppf(p, flights) / flights) for p in (0.025, 0.975))
    out = [
        f"## Single piles: {name}", "",
        f"Volumes of {flights} flights from the mean height of the places of a pile, whose noise averages out in part. "
        f"The last column lies between {low:.2f} and {high:.2f} in 95 % of such tests.", "",
        "| pile | size, m² | σ to be expected, m³ | with the noise of its places, m³ | simulated, m³ | simulated over "
        "expected |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for k, one in enumerate(plan.record.piles):
        rms = float(np.sqrt((errors[:, k] ** 2).mean()))
        out.append(f"| {one.name} | {one.area:.0f} | {one.sigma:.2f} | {one.measured:.2f} | {rms:.2f} | "
                   f"{rms / one.measured:.2f} |")  # fmt: skip
    return [*out, ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--piles-only", action="store_true", help="the σ of single piles alone")
    parser.add_argument("--only", help="name of one of the plans")
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    given = parser.parse_args()
    with runs_of(given) as runs:
        _print_plans(given, runs)


def _print_plans(given: argparse.Namespace, runs: Runs) -> None:
    seeds = range(given.first_seed, given.first_seed + given.flights)
    lines = ["# Predicted σ of planned flights against simulated flights", "",
             "The ground points of one flight share their errors, so the numbers of neighbouring cells move together.",
             ""]  # fmt: skip
    for name in PLANS:
        if given.only not in (None, name):
            continue
        plan = planned(name)
        if not given.piles_only:
            lines += lines_of(name, plan, np.array(runs(errors_of, name, seeds)))
        if name in PILE_PLANS:
            lines += pile_lines(name, plan, np.array(runs(pile_errors_of, name, seeds)))
        print("\n".join(lines), flush=True)
        if given.out is not None:
            given.out.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
