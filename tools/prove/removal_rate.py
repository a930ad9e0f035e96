"""How often the selection removes parameters: those that are zero in truth, and those that are not.

Simulated blocks without and with image errors; in each the parameters go by t < 1 alone (correlation_limit 1) and by
the full rule of models.md 5. A parameter that is zero in truth has t < 1 with probability 68.3 %; with correlated sets
the adjustment after each removal changes t of those that are left, so that the rate at the end may differ.

Of 30 seeds:

| set | zero parameters | t < 1 at once (99.9 % band) | removed by t | by the full rule | true ones lost |
|---|---|---|---|---|---|
| ebner | 360 | 0.708 in 0.600 … 0.761 | 0.661 | 0.661 | – |
| bluh:1-12 | 360 | 0.681 in 0.600 … 0.761 | 0.661 | 0.661 | – |
| bluh:1-12 | 270 | 0.707 in 0.589 … 0.774 | 0.693 | 0.693 | 0 of 90 |
| bluh:1-12,ultracam_d:42-73 | 1320 | 0.681 in 0.640 … 0.724 | 0.558 | 0.610 | – |

Example: python tools/prove/removal_rate.py --seeds 60
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import aerotri
from runs_elsewhere import Runs, add_executor, runs_of
from small_blocks import small_block

ZERO_RATE, FIRST = 0.6827, 9000
"""Probability of t < 1 where a parameter is zero, and the seed of the first block."""
TRUE = {"bluh.1": 3e-5, "bluh.2": -3e-5, "bluh.9": -6e-9}
"""Parameters that are not zero in the second experiment, each of about 2 µm at the edge of the format."""


def adjusted(block: aerotri.Block, **settings):
    """The numbers of the block adjusted with other settings."""
    return aerotri.adjust(aerotri.with_settings(block, **settings), explain=False).adjusted


def counts(shared: tuple[str, dict[str, float]], seed: int) -> tuple[int, ...]:
    """Of one block: zero parameters, with t < 1 at once, removed by t, removed by the rule; true ones lost."""
    parameters, errors = shared
    block = small_block(seed, parameters, camera={"ucd": {"preset": "ultracam_d", "errors": {"parameters": errors}}})[0]
    p = adjusted(block).parameters
    zero = ~np.isin(p.names.astype(str), list(errors))
    only_t = adjusted(block, parameter_selection="on", correlation_limit=1.0).removals
    removed = adjusted(block, parameter_selection="on").removals
    return (
        int(zero.sum()), int((p.t[zero] < 1.0).sum()), sum(r.name not in errors for r in only_t),
        sum(r.name not in errors for r in removed), sum(r.name in errors for r in removed),
    )  # fmt: skip


def rates(parameters: str, seeds: int, errors: dict[str, float], runs: Runs) -> str:
    """One line of the table."""
    found = runs(counts, (parameters, errors), range(FIRST, FIRST + seeds))
    count, at_once, by_t, by_rule, lost = np.sum(found, axis=0).tolist()
    low, high = binom.ppf([0.0005, 0.9995], count, ZERO_RATE) / count
    share = f"{lost} of {len(errors) * seeds}" if errors else "–"
    return (
        f"| {parameters} | {count} | {at_once / count:.3f} in {low:.3f} … {high:.3f} | {by_t / count:.3f} | "
        f"{by_rule / count:.3f} | {share} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=60)
    add_executor(parser)
    options = parser.parse_args()
    print("| set | zero parameters | t < 1 at once (99.9 % band) | removed by t | by the full rule | true ones lost |")
    print("|---|---|---|---|---|---|")
    both = "bluh:1-12,ultracam_d:42-73"
    with runs_of(options) as runs:
        for parameters, errors in (("ebner", {}), ("bluh:1-12", {}), ("bluh:1-12", TRUE), (both, {})):
            print(rates(parameters, options.seeds, errors, runs), flush=True)


if __name__ == "__main__":
    main()
