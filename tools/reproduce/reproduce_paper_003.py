"""Paper 003 reproduced: its blocks simulated, adjusted without, with general, with special and with all parameters.

Prints a Markdown table with the paper's figures beside; with --out also writes paper_003.md and figures there. The last
answer at full size stands in tools/results/paper_003.md. --reports makes the reports of the four blocks instead.

Examples: python tools/reproduce/reproduce_paper_003.py --out results
          python tools/reproduce/reproduce_paper_003.py --reports reports
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from matplotlib.figure import Figure

from paper_003.cases import DSK, FREDERIKSSTAD, ULTRACAM, Case
from paper_003.figures import averaged_figure, check_points_figure, days_figure, errors_figure
from paper_003.reports import write_reports
from paper_003.runs import days_over_seeds, over_cameras, read_plan, rows_of, two_days, with_navigation
from paper_003.table import Answer, markdown

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "prove"))

from runs_elsewhere import Runs, add_executor, runs_of

DAY_CHANGES_UM = (0.0, 0.5)


def main() -> None:
    """Run the cases, print the answer, write it where asked."""
    options = _options()
    cases = (*FREDERIKSSTAD, *(() if options.without_dsk else (DSK,)))
    if options.reports is not None:
        for path in write_reports(((case, read_plan(case.plan_path)) for case in cases), options.reports):
            print(path)
        return
    answers, figures = [], {}
    with runs_of(options) as runs:
        for case in cases:
            answer, drawn = _answer(case, options.seeds, options.cameras, runs)
            answers.append(answer)
            figures |= drawn
    figures["paper_003_check_points"] = check_points_figure([(a.case, a.rows) for a in answers])
    seeds = f"Frederiksstad mean squares of {options.seeds} simulations, DSK-Saar one"
    text = markdown(answers, seeds)
    print(text, end="")
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "paper_003.md").write_text(text, encoding="utf-8")
        for name, figure in figures.items():
            figure.savefig(options.out / f"{name}.png", dpi=100)


def _answer(case: Case, seeds: int, cameras: int, runs: Runs) -> tuple[Answer, dict[str, Figure]]:
    plan, large = read_plan(case.plan_path), case is DSK
    _say(case.title)
    rows = rows_of(case, plan, range(1, 2 if large else seeds + 1), runs)
    drawn = {}
    if case.special:
        drawn[f"paper_003_figure_{case.figures[0]}"] = averaged_figure(case, rows)
        drawn[f"paper_003_figure_{case.figures[1]}"] = errors_figure(case, rows)
    if large:
        _say("two days, navigation")
        days = [two_days(case, plan, change_um) for change_um in DAY_CHANGES_UM]
        drawn["paper_003_figure_11"] = days_figure(case, days[0])
        return Answer(case, rows, days=days, navigation=with_navigation(case, plan)), drawn
    drawn_anew = over_cameras(case, plan, cameras, runs) if case.special and cameras else None
    day_tests = days_over_seeds(case, plan, range(1, cameras + 1), runs) if case.special == ULTRACAM else ()
    return Answer(case, rows, drawn_anew, day_tests=day_tests), drawn


def _say(text: str, _begun: float = time.monotonic()) -> None:
    """A line of progress."""
    print(f"{time.monotonic() - _begun:6.0f} s  {text}", file=sys.stderr, flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, help="folder for paper_003.md and the figures")
    parser.add_argument("--reports", type=Path, help="folder for the blocks and their report.html, nothing else")
    parser.add_argument("--seeds", type=int, default=3, help="simulations of each block of Frederiksstad")
    parser.add_argument("--cameras", type=int, default=10, help="cameras drawn at random, two-day flights; 0: none")
    parser.add_argument("--without-dsk", action="store_true", help="leave the block of 2282 photographs out")
    add_executor(parser)
    return parser.parse_args()


if __name__ == "__main__":
    main()
