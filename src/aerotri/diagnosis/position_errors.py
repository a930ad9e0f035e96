"""Errors of GNSS positions that stay for a while, in words."""

from __future__ import annotations

from aerotri.diagnosis.finding import Finding
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.position_errors import PositionErrors

NOISE = 'noise_factor = "estimated"'
SETTING = 'correlated = "on" in [gnss] of block.toml'


def position_errors_in_words(errors: PositionErrors | None) -> str:
    """What a surveyor has to know of them, '' where there is nothing to say."""
    if errors is None:
        return ""
    if errors.counts:
        return _of_model(errors)
    tested, alike = errors.likelihood_ratio == errors.likelihood_ratio, f"correlation {errors.neighbours:.2f}"
    if not tested and not errors.neighbours_agree:
        return ""
    if not tested:
        return (
            f"GNSS positions of neighbouring photographs have errors in common ({alike}; by chance with a probability "
            f"of {_probability(errors.neighbours_p)}). The adjustment takes them for independent, and σ may be "
            f"too small. Set {SETTING}"
        )
    said = (
        "GNSS positions show no errors that stay from photograph to photograph beside the noise that is stated (by "
        f"chance with a probability of {_probability(errors.p)}): they were adjusted as independent"
    )
    if not errors.neighbours_agree:
        return said
    return (
        f"{said}. Yet the residuals of neighbours are alike ({alike}): the stated σ are larger than the errors that "
        f"the flight shows. {NOISE} estimates both"
    )


def _of_model(errors: PositionErrors) -> str:
    unit = "s" if errors.time_unit == "s" else "exposures (the photographs have no times)"
    size = f"{100.0 * errors.plan_m:.2g} cm in plan and {100.0 * errors.height_m:.2g} cm in height"
    said = f"GNSS positions have errors that stay for a while: σ {size}, correlation time {errors.time:.3g} {unit}"
    if errors.source == "given":
        return f"{said}, as given in block.toml"
    return f"{said} (estimated; by chance with a probability of {_probability(errors.p)})"


def _probability(p: float) -> str:
    return f"{100.0 * p:.2g} %" if p >= 1e-5 else "less than 0.001 %"


def of_positions(adjusted: AdjustedBlock) -> list[Finding]:
    """The test of the positions that was made."""
    errors = adjusted.position_errors
    said = position_errors_in_words(errors)
    if errors is None or errors.reason:
        return []
    name = "GNSS errors in time"
    if errors.counts:
        size = f"σ {100.0 * errors.plan_m:.2g} cm plan, {100.0 * errors.height_m:.2g} cm height"
        return [Finding(name, size, "beside the noise of single positions", said, "note")]
    if errors.neighbours != errors.neighbours:
        return []
    value, expected = f"neighbours correlate by {errors.neighbours:.2f}", "about 0 if errors are independent"
    if errors.neighbours_agree:
        return [Finding(name, value, expected, said, "attention")]
    return [Finding(name, value, expected, "positions are independent", "good")]
