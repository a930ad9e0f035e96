"""Paper 002 reproduced: its strip of 50 photographs by its three methods, theoretical and practical precision.

Prints a Markdown table with the differences explained; with --out also writes paper_002.md and paper_002.png there.
The last answer with 40 simulations stands in tools/results/paper_002.md.

Example: python tools/reproduce/reproduce_paper_002.py --out results
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from paper_002.cases import control_cases, methods, roll_cases
from paper_002.plot import precision_plot
from paper_002.strip import PHOTOGRAPHS, Case, Precision, run
from paper_002.table import markdown

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "prove"))

from runs_elsewhere import Runs, add_executor, runs_of


def main() -> None:
    """Run the cases, print the answer, write it where asked."""
    options = _options()
    with runs_of(options) as runs:
        _reproduce(options, runs)


def _reproduce(options: argparse.Namespace, runs: Runs) -> None:
    seeds = range(1, options.seeds + 1)

    def rows(cases: Sequence[Case]) -> list[tuple[Case, Precision]]:
        return [(case, run(case, seeds, runs, options.photographs)) for case in cases]

    of_methods = rows(methods(options.photographs))
    text = markdown(
        of_methods, rows(roll_cases()), rows(control_cases(options.photographs)), options.seeds, options.photographs
    )
    print(text, end="")
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "paper_002.md").write_text(text, encoding="utf-8")
        precision_plot(of_methods).savefig(options.out / "paper_002.png", dpi=150)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, help="folder for paper_002.md and paper_002.png")
    parser.add_argument("--seeds", type=int, default=20, help="simulations of each case")
    parser.add_argument("--photographs", type=int, default=PHOTOGRAPHS)
    add_executor(parser)
    return parser.parse_args()


if __name__ == "__main__":
    main()
