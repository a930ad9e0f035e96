"""The sentences in which a tested or intended accuracy is reported.

Their words are fixed by the standard [L: ASPRS Positional Accuracy Standards for Digital Geospatial Data, edition 2,
version 2 (2024), 7.16]: one for thirty or more check points, one for fewer, one for none ("produced to meet").
"""

from __future__ import annotations

from aerotri.diagnosis.accuracy_rules import ENOUGH, ROUNDING, class_text, reached, smallest_class
from aerotri.results.accuracy import AccuracyRecord

STANDARD = "ASPRS Positional Accuracy Standards for Digital Geospatial Data, Edition 2, Version 2 (2024)"
PLAN, HEIGHT = "Horizontal Positional Accuracy Class", "Vertical Accuracy Class"
FOUND = {
    "H": "The tested horizontal positional accuracy was found to be RMSE_H = {}(cm)",
    "NVA": "The Non-Vegetated Vertical Accuracy (NVA) was found to be RMSE_V = {}(cm)",
    "VVA": "The Vegetated Vertical Accuracy (VVA) was found to be RMSE_V = {}(cm)",
}


def statements(r: AccuracyRecord) -> tuple[str, ...]:
    """Of plan, height, height in vegetation: those that the check points allow; none of a rejected result.

    A class that was asked for stands there where the RMSE and the surveys of check and control points allow it. Thirty
    check points or more show the smallest class that they allow otherwise; fewer only show what was found: nothing was
    "produced to meet" a class that nobody asked for. Without stated survey errors the RMSE are not known: no sentence.
    Without check points a class is there where the survey of control allows it.
    """
    if r.verdict == "rejected":
        return ()
    plan, height, wooded = r.errors[0], r.errors[2], r.errors[3]
    found = []
    if not max(plan.unstated, r.errors[1].unstated):
        found.append(_statement("H", f"RMSE_H {PLAN}", r.asked.horizontal, smallest_class(r, 0), plan.count, r.rmse_h))
    if not height.unstated:
        found.append(_statement("NVA", f"RMSE_V {HEIGHT}", r.asked.vertical, smallest_class(r, 1), height.count, r.nva))
    if wooded.count and not wooded.unstated and height.count:
        # VVA has no limit: it is reported beside the class of the heights outside vegetation
        least = smallest_class(r, 1)
        found.append(_statement("VVA", f"RMSE_V {HEIGHT}", r.asked.vertical, least, wooded.count, r.vva))
    return tuple(text for text in found if text)


def _statement(of: str, what: str, asked: float | None, least: float, count: int, rmse: float) -> str:
    """The sentence of one measure; least : the smallest class that may be claimed, m."""
    allowed = asked is not None and least <= asked * (1.0 + ROUNDING)
    if count == 0:
        return _produced(of, asked) if asked is not None and allowed else ""
    value = FOUND[of].format(f"{100.0 * rmse:.2f}")
    if count >= ENOUGH:
        name = class_text(asked if asked is not None and allowed else reached(least))
        return f"This data set was tested to meet {STANDARD} for a {name}(cm) {what}. {value}."
    meant = f"This data set was produced to meet a {class_text(asked)}(cm) {what}. " if asked and allowed else ""
    return (
        f"This data set was tested as required by {STANDARD}. Although the Standards call for a minimum of thirty (30) "
        f"checkpoints, this test was performed using ONLY {count} checkpoints. {meant}{value} using the reduced number "
        "of checkpoints."
    )


def _produced(of: str, asked: float) -> str:
    what = f"RMSE_H {PLAN}" if of == "H" else "RMSE_V Non-Vegetated Vertical Accuracy (NVA) Class"
    return f"This data set was produced to meet {STANDARD} for a {class_text(asked)}(cm) {what}."
