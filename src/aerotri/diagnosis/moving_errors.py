"""Errors that strips, days or photographs have in common, in words."""

from __future__ import annotations

from aerotri.diagnosis.finding import Finding, times
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.model_part import FIELD, ControlEvidence, ModelPart

WORTH_SAYING = 1.1
"""σ total over σ from which the model part is told [C]: below, it changes no decision."""


UNLIKELY = 0.05
"""Probability of contradictions of control below which they are told [C]: what to look at, no reason to refuse."""


def percent(p: float) -> str:
    """A probability in words."""
    return f"{100.0 * p:.0f} %" if p >= 0.01 else "less than 1 %"


def model_part_in_words(part: ModelPart) -> str:
    """What a surveyor has to know of the model part, '' where there is none to speak of."""
    if not part.counts or max(part.ratio_plan, part.ratio_height) < WORTH_SAYING:
        return ""
    plan, height = (f"{ratio:.1f} times" for ratio in (part.ratio_plan, part.ratio_height))
    return (
        f"the errors of the photographs change {part.change}, more than noise explains: from the "
        f"noise alone heights would look {height} and positions {plan} too sure. The total σ (tX, tY, tZ) contain "
        f"this{_by_field(part)}"
    )


def _by_field(part: ModelPart) -> str:
    """How it was found where the groups are too few."""
    if part.method != FIELD:
        return ""
    size = next(test for test in part.tests if test.scheme == part.scheme).field_um
    shown = f"The total σ are therefore computed from the residuals, which show image errors of about {size:.2g} µm"
    if part.clusters == 1:
        return f". One strip cannot be compared with others. {shown}"
    group = "strip" if part.scheme == "strip" else "group"
    of = "" if group == part.scheme else f" ({part.scheme})"
    return f". {part.clusters} {group}s{of} are too few for a comparison. {shown} in every {group}"


def control_in_words(control: ControlEvidence | None) -> str:
    """What a surveyor has to know of contradictions of control, '' where σ explains them."""
    if control is None or not control.p < UNLIKELY or not control.left_out > WORTH_SAYING:
        return ""
    total = control.left_out_total
    in_total = f", {total:.1f} times their total σ" if abs(total - control.left_out) > 0.05 else ""
    return (
        "σ may be too small at the control points. Left out in turn, they miss by "
        f"{control.left_out:.1f} times their σ (RMS){in_total}. Chance does this in {percent(control.p)} of blocks. "
        "Look at the σ of their coordinates, at their marks in the photographs, and try other additional parameters"
    )


def of_control(adjusted: AdjustedBlock) -> list[Finding]:
    """Control points against one another and the photographs."""
    control = None if adjusted.model_part is None else adjusted.model_part.control
    if control is None or not control.freedom:
        return []
    value = f"{times(control.ratio)} as large as σ explains"
    text = f"about 1; {control.freedom} contradictions"
    says = control_in_words(control)
    return [
        Finding(
            "contradictions of control points", value, text, says or "σ explains them", "attention" if says else "good"
        )
    ]


def of_model_part(adjusted: AdjustedBlock) -> list[Finding]:
    """The test of clusters that led to the model part, or the largest of those that led to none."""
    part = adjusted.model_part
    tested = [] if part is None else [test for test in part.tests if not test.reason]
    if part is None or not tested:
        return []
    test = next((test for test in tested if test.scheme == part.scheme), max(tested, key=lambda test: test.ratio))
    name = f"errors common to a {test.scheme}"
    value = f"{times(test.ratio)} as large as noise explains"
    text = f"about 1; chance makes more with a probability of {100.0 * part.level:.2g} %"
    said = model_part_in_words(part)
    if said:
        return [Finding(name, value, text, said, "attention")]
    if part.counts:
        growth = 100.0 * (max(part.ratio_plan, part.ratio_height) - 1.0)
        says = (
            f"more than noise explains. The total σ contain it. They are {growth:.0f} % larger (median of the points)"
        )
        return [Finding(name, value, text, says, "note")]
    return [Finding(name, value, text, "the noise explains them", "good")]
