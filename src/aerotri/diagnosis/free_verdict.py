"""What a free check found, and its verdict: tie points or control, in words that an operator can act on."""

from __future__ import annotations

from aerotri.strategies.free_stages import CONTROL, INFLATED, FreeCheck, Stage, Suspect

DECIMALS = 3
"""Of metres in sentences: mm, as precise as coordinates are given."""
ANGLES = ("omega", "phi", "kappa")


def in_words(check: FreeCheck) -> str:
    """The verdict with its reasons, in words that an operator can act on."""
    if check.verdict == "failed":
        free = check.stages[0]
        return (
            f"The tie points alone give no block ({free.status}: {free.message}): whether the control fits is not "
            "known."
        )
    parts = [_tie_points(check), *(_added(check, stage) for stage in check.stages[1:])]
    if check.robust:
        parts.append("Robust weights are those of the free block: the limits hold approximately.")
    return " ".join(parts)


def suspect_text(suspect: Suspect) -> str:
    """'C05: given X too large by 1.020 m (w 34.0)'."""
    size, w = abs(suspect.error), f"w {abs(suspect.w):.1f}"
    if suspect.kind == "ray":
        return f"{suspect.name}: {suspect.component} off by {abs(suspect.error_px):.1f} px ({w})"
    too = "large" if suspect.error > 0 else "small"
    unit, value = ("rad", f"{size:.2e}") if suspect.component in ANGLES else ("m", f"{size:.{DECIMALS}f}")
    given = "given" if suspect.kind == "control" else "observed"
    what = f"{given} {suspect.component}".rstrip()
    return f"{suspect.name}: {what} too {too} by {value} {unit} ({w})"


def _tie_points(check: FreeCheck) -> str:
    free = check.stages[0]
    stand_out = f"{check.beyond} ray{'s' if check.beyond != 1 else ''}"
    if free.redundancy <= 0:
        return "The tie points have no redundancy: nothing tests them."
    if not check.tie_points_poor:
        all_the_same = f"; {stand_out} stand{'s' if check.beyond == 1 else ''} out all the same" if check.beyond else ""
        return f"The tie points fit one another (σ0 free {free.sigma0:.2f}{all_the_same})."
    if free.sigma0 > INFLATED * check.spread and check.beyond:
        first = f" Look first at {suspect_text(free.suspects[0])}." if free.suspects else ""
        return (
            f"The tie points themselves do not fit (σ0 free {free.sigma0:.2f}, {free.sigma0 / check.spread:.1f} times "
            f"the spread of most residuals, {stand_out} beyond chance).{first}"
        )
    return (
        f"The tie points themselves do not fit (σ0 free {free.sigma0:.2f}) though few rays stand out: the a-priori σ "
        "of the image points is too small, or systematic image errors are not modelled."
    )


def _added(check: FreeCheck, stage: Stage) -> str:
    what, to, several = _subjects(check, stage)
    do_not_fit, fit = ("do not fit", "fit") if several else ("does not fit", "fits")
    if stage.status != "converged":
        return f"With {what} the adjustment has no result ({stage.status}: {stage.message})."
    if not stage.tested:
        return f"Nothing tests {what}: no redundancy is gained."
    numbers = f"vᵀPv grows by {stage.ratio:.2f} σ0² per redundancy gained, by chance up to {stage.limit:.2f}"
    if stage.fits:
        return f"{_capital(what)} {fit} {to} ({numbers})."
    return f"{_capital(what)} {do_not_fit} {to} ({numbers}). {_where_to_look(check, stage)}"


def _subjects(check: FreeCheck, stage: Stage) -> tuple[str, str, bool]:
    """What is judged, what it is held against, and whether the first is a plural."""
    if stage.name == CONTROL:
        return "the control", "the tie points", False
    if any(other.name == CONTROL for other in check.stages):
        return "the observed positions", "the tie points and the control", True
    if len(check.point):
        return "the control and the observed positions", "the tie points", True
    return "the observed positions", "the tie points", True


def _where_to_look(check: FreeCheck, stage: Stage) -> str:
    first = _first_suspect(check, stage)
    if stage.name == CONTROL or check.position_offset is None:
        return first
    x, y, z = (f"{value:+.{DECIMALS}f}" for value in check.position_offset)
    offset = f"On average they lie {x}, {y}, {z} m (X, Y, Z) from where the control alone puts the photographs."
    control = next(other for other in check.stages if other.name == CONTROL)
    # control that fitted the tie points and now complains is outvoted by a common error of the positions
    outvoted = control.fits and stage.suspects and stage.suspects[0].kind == "control"
    return offset if outvoted else f"{offset} {first}"


def _first_suspect(check: FreeCheck, stage: Stage) -> str:
    """The value to look at, or where to look when no single one explains the contradiction."""
    if stage.suspects and stage.largest_w > stage.w_limit:
        return f"Look first at {suspect_text(stage.suspects[0])}."
    largest = f" (the largest: {suspect_text(stage.suspects[0])})" if stage.suspects else ""
    shape = ""
    if check.similarity is not None:
        x, y, z = (f"{value:.{DECIMALS}f}" for value in check.similarity.rms)
        shape = f" Moved onto the control the free block is off by {x}, {y}, {z} m (RMS X, Y, Z)."
    return (
        f"No single value explains it{largest}.{shape} Look at σ, coordinate system and heights, and at systematic "
        "image errors that bend the free block."
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
