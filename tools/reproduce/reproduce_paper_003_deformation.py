"""Figures 16 to 20 of paper 003 in our form: what image errors do to models, by end lap, camera and parameters.

Prints Markdown tables; with --out also writes paper_003_deformation.md and three pictures there. The last answer stands
in tools/results/paper_003_deformation.md.

Example: python tools/reproduce/reproduce_paper_003_deformation.py --out results
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import aerotri
from paper_003_deformation.cases import cases
from paper_003_deformation.even_odd import EvenOdd, even_against_odd
from paper_003_deformation.figures import deformation_figure, errors_and_deformation, interval_of
from paper_003_deformation.table import Row, markdown

SEED = 1


def main() -> None:
    """Simulate, adjust, deform; print the answer, write it where asked."""
    options = _options()
    rows: list[Row] = []
    fields: dict[tuple[str, str], Any] = {}
    compared: list[tuple[str, EvenOdd]] = []
    for case in cases():
        print(f"{case.title} …", file=sys.stderr)
        flight = aerotri.simulate(case.plan, SEED)
        plain = _adjusted(flight, "none") if case.key == "ultracam_d" else None
        for heading, parameters in case.sets:
            found = _adjusted(flight, parameters)
            fields[case.key, heading] = found.image_errors().field
            rows += [Row(case, heading, p, aerotri.deform(found, end_lap=p.end_lap).record) for p in case.pictures]
            if plain is not None:
                compared.append((heading, even_against_odd(found, plain, flight)))
    text = markdown(rows, compared, cases()[0].plan["flight"]["end_lap"])
    print(text, end="")
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "paper_003_deformation.md").write_text(text, encoding="utf-8")
        _draw(options.out, rows, fields)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, help="folder for paper_003_deformation.md and the pictures")
    return parser.parse_args()


def _adjusted(flight, parameters: str) -> aerotri.Adjustment:
    return aerotri.adjust(flight.block, parameters=parameters, explain=False)


def _draw(folder: Path, rows: list[Row], fields: dict[tuple[str, str], Any]) -> None:
    ultracam, dmc, film = cases()
    subtitle = "Simulated block, image errors from physics; normal case over level ground, variant free."
    panels = []
    for picture in ultracam.pictures:
        own = [row for row in rows if row.case.key == ultracam.key and row.picture == picture]
        interval = max(interval_of(row.deformation, picture.interval_cm) for row in own)
        panels.append([(_caption(row), row.deformation, interval) for row in own])
    figure = deformation_figure("Figures 16, 17, 18: UltraCamD, DSK-Saar", subtitle, panels)
    figure.savefig(folder / "paper_003_deformation.png", dpi=110)
    for case, name in ((dmc, "dmc"), (film, "rmk")):
        own = [row for row in rows if row.case.key == case.key]
        title = f"Figure {case.pictures[0].number}: {case.title}"
        figure = errors_and_deformation(title, subtitle, [_with_field(row, own, fields) for row in own])
        figure.savefig(folder / f"paper_003_deformation_{name}.png", dpi=110)


def _with_field(row: Row, own: list[Row], fields: dict[tuple[str, str], Any]):
    """Of all sets of a camera the same interval, as the paper has it."""
    interval = max(interval_of(r.deformation, r.picture.interval_cm) for r in own)
    return _caption(row), fields[row.case.key, row.parameters], row.deformation, interval


def _caption(row: Row) -> str:
    g = row.deformation.geometry
    return f"{row.picture.number}  parameters {row.parameters}; end lap {100 * g.end_lap:.1f} %, h/b {g.h_over_b:.2f}"


if __name__ == "__main__":
    main()
