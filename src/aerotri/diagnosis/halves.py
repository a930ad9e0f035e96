"""What two halves adjusted apart say about a block, in sentences."""

from __future__ import annotations

from aerotri.results.halves import DIVISIONS, AgreementTest, HalvesComparison, HalvesRecord

CHANGING = {
    "strips": "from strip to strip",
    "directions": "with the direction of flight",
    "time": "over the flight",
}
"""What changes where the halves of a division differ and those of alternate photographs do not."""


AS_STATED = 1.1
"""RMS of difference/σ of single points up to which their σ hold: a tenth changes no decision."""


def division_sentence(one: HalvesComparison) -> str:
    """One division in a sentence."""
    what = DIVISIONS[one.division]
    if one.reason:
        return f"{what}: not possible, {one.reason}"
    if one.same_as:
        return f"{what}: the same halves as {DIVISIONS[one.same_as]}; the block cannot tell the two apart"
    beyond = [f"{name} {_size(test)}" for name, test in one.tests if test.differs]
    if beyond:
        return f"{what}: the halves differ by more than σ says: {'; '.join(beyond)}"
    close = [name for name, test in one.tests if test.is_too_close]
    if close:
        return (
            f"{what}: the halves agree better than σ says ({', '.join(close)}): photographs near each other share "
            "their errors, and this division does not show them"
        )
    return f"{what}: the halves agree within σ"


def _size(test: AgreementTest) -> str:
    return f"{test.factor:.1f} times σ (p {test.p:.1g})"


def conclusion(record: HalvesRecord) -> tuple[str, ...]:
    """What all divisions say together, and what to do, in sentences."""
    if not record.compared:
        return ("No division was possible: the block is too small or too weak for this test. Use check points.",)
    if not record.found:
        return (
            "No model error was found.",
            "An error that both halves have in common does not show here: check points are still needed.",
        )
    return (*_factors(record), *_causes(record))


def _factors(record: HalvesRecord) -> tuple[str, ...]:
    """By how much σ of ground points are too small: of means over areas, and of single points."""
    said = []
    for what, name, axes in (("Heights", "ground points in height", [2]), ("Plan", "ground points in plan", [0, 1])):
        found = [
            (test.factor, one) for one in record.comparisons for own, test in one.tests if own == name and test.differs
        ]
        points = [(factor, one, one.points) for factor, one in found if one.points is not None]
        if points:
            factor, one, compared = max(points, key=lambda entry: entry[0])
            single = compared.rms_z_of_points(axes)
            of_single = f", of single points by {single:.1f}" if single > AS_STATED else "; σ of single points hold"
            said.append(
                f"{what}: means over areas of {compared.size:.3g} m differ by {factor:.1f} times their σ, single "
                f"points by {single:.1f} times ({DIVISIONS[one.division]}). Until check points say better, multiply "
                f"the σ of volumes and of means by {factor:.1f}{of_single}."
            )
    if not said:
        said.append("The camera differs between the halves; the ground points do not show it beyond their σ.")
    return tuple(said)


def _causes(record: HalvesRecord) -> tuple[str, ...]:
    if "photographs" in record.found:
        return (
            "Alternate photographs differ: the parameters do not describe the camera, or rays have gross errors.",
            "What to do: adjust with --robust huber, and look for a better set with `aerotri compare-parameters`.",
        )
    changes = " and ".join(CHANGING[division] for division in record.found)
    also = next((one for one in record.comparisons if one.same_as in record.found and one.same_as), None)
    if also is not None:
        changes += f" (or {CHANGING[also.division]}: here both are the same)"
    said = [
        f"Errors of the camera are left over. They change {changes}, or they are constant and the parameters do not "
        "describe them.",
        "What to do: look for a better set with `aerotri compare-parameters`. If the halves still differ, give groups "
        'of photographs parameters of their own (parameter_groups = "strip", or a column of images.csv with parts of '
        "the flight). More control or observed positions (RTK) make the remaining errors harmless.",
    ]
    if "photographs" in record.compared:
        said.insert(0, "Alternate photographs agree: the differences are no noise of the image points.")
    return tuple(said)
