"""Smooth errors of single photographs in the weights: σ and heights with and without, and false alarms.

The flights of `default_choice.py`: 40 photographs, four layouts of control, image errors of 2 µm RMS beside noise of
2 µm. Film (a smooth error of another shape in every photograph, length 15 mm) and matching (length 3 mm), both beside a
constant lens error, and noise alone. Adjusted with legendre:4x4 and `correlated` of [stochastic] off and on. Printed
are means over the blocks, with their standard errors, of (error/σ)² of check points, the RMS of the height errors, σ0
(the noise is 2 µm), and how often smooth errors are found.

Example: python tools/prove/photograph_fields.py --blocks 24 > tools/results/photograph_fields.md
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from itertools import product

import numpy as np

import aerotri
from aerotri import observations
from default_choice import LAYOUTS, flight, held, simulated
from runs_elsewhere import add_executor, runs_of

KINDS = ("film", "matching", "noise alone")
PARAMETERS = "legendre:4x4"


def block_of(kind: str, seed: int) -> observations.Block:
    """A block with errors of a kind."""
    layout = list(LAYOUTS)[seed % len(LAYOUTS)]
    if kind == "noise alone":
        return held(aerotri.simulate(flight(LAYOUTS[layout] == 1), seed=seed).block, layout)
    return simulated(seed, kind, layout)


def measured(block: observations.Block, correlated: str) -> tuple[list[float], bool]:
    """(error/σ)² in plan and height, the mean square height error m², σ0 µm and seconds; whether errors are found."""
    fields = observations.PhotographFieldSettings(correlated)
    block = aerotri.with_settings(block, parameters=PARAMETERS)
    block = replace(block, settings=replace(block.settings, photograph_fields=fields))
    begun = time.perf_counter()
    adjusted = aerotri.adjust(block, explain=False).adjusted
    seconds = time.perf_counter() - begun
    check, control = adjusted.check, adjusted.block.control
    given = {int(point): k for k, point in enumerate(control.point)}
    known = control.sigma[np.array([given[int(point)] for point in check.point])]
    seen = np.isfinite(check.difference).all(axis=1)
    d = check.difference[seen]
    z = d**2 / (check.total_sigma[seen] ** 2 + known[seen] ** 2)
    found = adjusted.photograph_fields
    numbers = [z[:, :2].mean(), z[:, 2].mean(), np.mean(d[:, 2] ** 2), adjusted.outcome.sigma0_um, seconds]
    return [float(number) for number in numbers], found is not None and found.counts


def one(shared: tuple[str, str], seed: int) -> tuple[list[float], bool]:
    """`measured` of a block of a kind."""
    kind, correlated = shared
    return measured(block_of(kind, seed), correlated)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=24, help="of each kind")
    add_executor(parser)
    options = parser.parse_args()
    print(
        f"# Smooth errors of single photographs, {options.blocks} blocks of a kind (tools/prove/photograph_fields.py)"
    )
    print("\n| errors | correlated | found | X, Y, total σ | Z, total σ | RMS Z cm | σ0 µm | s |")
    print("|---|---|---|---|---|---|---|---|")
    with runs_of(options) as runs:
        for kind, correlated in product(KINDS, ("off", "on")):
            rows, found = zip(*runs(one, (kind, correlated), range(1, options.blocks + 1)), strict=True)
            values = np.array(rows)
            mean, error = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
            cells = [f"{mean[k]:.2f} ± {error[k]:.2f}" for k in range(2)]
            cells += [f"{100.0 * np.sqrt(mean[2]):.1f}", f"{mean[3]:.2f} ± {error[3]:.2f}", f"{mean[4]:.1f}"]
            print(f"| {kind} | {correlated} | {sum(found)} of {len(found)} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
