"""Tie points of rendered photographs under other names, and the first orientation in other orders of the photographs.

The first table: photographs and points under drawn names, lists in other rows; how many tie points are not the same
ray by ray, and the largest difference of the adjusted results over their σ. The second: the photographs are led through
in drawn orders, as other names did before their order hung on what they show; in how many orders photographs were left
without an orientation at the first try, and in the end.

Measures the first orientation in orders that no file gives: imports inside on purpose.

Example: python tools/prove/metamorphic_photographs.py --names 4 --orders 60
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "metamorphic"))

from test_photographs import tie_points, tied
from transformations import by_names, largest_difference, numbers_of, same

import aerotri
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.tie_points import orientation, photographs_to_block
from aerotri.tie_points.features import FeatureOptions
from aerotri.tie_points.given import Given
from aerotri.tie_points.photographs import StatedCamera, find_photographs
from aerotri.tie_points.photographs_to_block import Options, TiedBlock, tie_photographs
from rendered_photographs import SPEC, Flown, Lists, fly
from runs_elsewhere import Runs, add_executor, runs_of

LARGER = {"flight": {**SPEC["flight"], "strips": 3, "images_per_strip": 4}}


def drawn_names(flown: Flown, rng: np.random.Generator) -> Lists:
    """Other names, in an order of their own."""
    numbers = rng.permutation(1000)
    olds = [*flown.files(), *flown.control_points()]
    pairs = zip(olds, numbers[: len(olds)].tolist(), strict=True)
    names = {old: f"{number}.tif" if old.endswith(".tif") else f"P{number}" for old, number in pairs}
    return Lists(names, seed=int(rng.integers(1000)))


def print_names(flown: Flown, here: Path, count: int, runs: Runs) -> None:
    print("| names drawn | photographs | tie points | not the same | largest difference, σ |\n|---|---|---|---|---|")
    first = aerotri.adjust(tied(flown, here / "first", Lists({})), explain=False).adjusted
    for row in runs(named, (flown, here, first), range(count)):
        print(row, flush=True)


def named(given: tuple[Flown, Path, AdjustedBlock], k: int) -> str:
    """A row of the table: the block under drawn names, against the first result."""
    flown, here, first = given
    before, own = numbers_of(first, same(first.block)), tie_points(first.block, {})
    lists = drawn_names(flown, np.random.default_rng(k))
    shutil.rmtree(here / str(k), ignore_errors=True)
    result = aerotri.adjust(tied(flown, here / str(k), lists), explain=False).adjusted
    other = tie_points(result.block, lists.names)
    unlike = len(set(own.values()) ^ set(other.values()))
    worst = "–"
    if not unlike:
        found = largest_difference(before, numbers_of(result, by_names(first.block, result.block, lists.names)))
        what = max(found, key=lambda name: found[name])
        worst = f"{found[what]:.1e} ({what})"
    return f"| {k + 1} | {len(result.block.images)} | {len(other)} | {unlike} | {worst} |"


def print_orders(flown: Flown, here: Path, count: int, runs: Runs) -> None:
    # features and matches, which do not hang on the order, are kept for all
    tie(flown, here)
    at_first, in_the_end = np.sum(runs(ordered, (flown, here), range(count)), axis=0)
    print("\n| orders drawn | photographs lost at the first try | lost in the end |\n|---|---|---|")
    print(f"| {count} | {at_first} | {in_the_end} |")


def tie(flown: Flown, here: Path) -> TiedBlock:
    """The block of the photographs."""
    photographs = find_photographs(flown.photographs, StatedCamera((), 6.0, 14.4))
    return tie_photographs(photographs, Given(), Options(FeatureOptions(1000)), here / "cache", lambda *_: None)


def ordered(given: tuple[Flown, Path], k: int) -> tuple[bool, bool]:
    """Whether photographs were lost at the first try, and in the end, in a drawn order."""
    flown, here = given
    order, mapped = np.random.default_rng(k).permutation(len(flown.files())), []
    original = orientation.map_incrementally

    def spy(*arguments, **options):
        mapped.append(original(*arguments, **options))
        return mapped[-1]

    with (
        mock.patch.object(photographs_to_block, "_order_of", return_value=order),
        mock.patch.object(orientation, "map_incrementally", spy),
    ):
        block = tie(flown, here)
    return bool(np.isnan(mapped[0].centre[:, 0]).any()), bool(block.left_out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--names", type=int, default=4)
    parser.add_argument("--orders", type=int, default=60)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs, tempfile.TemporaryDirectory(dir=options.scratch) as place:
        here = Path(place).resolve()
        print_names(fly(here / "larger", **LARGER), here, options.names, runs)
        print_orders(fly(here / "photographs"), here, options.orders, runs)


if __name__ == "__main__":
    main()
