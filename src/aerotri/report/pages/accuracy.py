"""One self-contained page about the accuracy: the numbers, every requirement, the sentences to report, the points."""

from __future__ import annotations

from pathlib import Path

from aerotri.diagnosis.accuracy_rules import cm, reached
from aerotri.diagnosis.accuracy_sentences import STANDARD
from aerotri.report.pages.accuracy_plan import check_plan
from aerotri.report.pages.head import page_environment, page_head
from aerotri.report.quality import printable
from aerotri.report.tables.accuracy import (
    MARKS,
    conclusion,
    errors_table,
    inspire_table,
    inspire_words,
    points_table,
)
from aerotri.results.accuracy import AccuracyRecord

BOXES = {"met": "passed", "not met": "banner", "cannot be said": "warnings"}


def accuracy_html(r: AccuracyRecord) -> str:
    """The page as text."""
    environment = page_environment()
    return environment.get_template("accuracy.html.j2").render(
        name=printable(r.block), standard=STANDARD, box=BOXES[r.met], conclusion=conclusion(r),
        cards=_cards(r), warnings=[printable(text, 1000) for text in r.warnings], statements=r.statements,
        rows=[(one, printable(one.found, 500), MARKS[one.met]) for one in r.requirements],
        errors=errors_table(r), inspire=inspire_table(r), inspire_words=inspire_words(r),
        points=points_table(r), head=page_head(r.head),
        plan=None if r.layout is None or not len(r.points) else check_plan(r.points, r.layout),
        vegetated=bool(r.points.vegetated.any()), rejected=r.verdict == "rejected",
    )  # fmt: skip


def write_accuracy_page(r: AccuracyRecord, path: Path) -> None:
    """Write the page."""
    path.write_text(accuracy_html(r), encoding="utf-8")


def _cards(r: AccuracyRecord) -> list[tuple[str, str, str]]:
    if not len(r.points):
        return []
    plan, height = r.errors[0].count, r.errors[2].count
    cards = [
        ("RMSE_H, in plan", cm(r.rmse_h), f"{plan} check points; class reached {cm(reached(r.rmse_h))}"),
        ("RMSE_V, in height", cm(r.nva), f"{height} check points; class reached {cm(reached(r.nva))}"),
        ("RMSE_3D", cm(r.rmse_3d), "plan and height together"),
    ]
    if r.errors[3].count:
        cards.append(("RMSE_V in vegetation", cm(r.vva), f"{r.errors[3].count} check points (VVA)"))
    return cards
