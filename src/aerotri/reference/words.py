"""Words that results use: what each says, and what to do then."""

from __future__ import annotations

from dataclasses import dataclass

MARKS = {
    "P": "printed in one of the papers this program follows",
    "L": "other literature",
    "D": "derived for this program",
    "C": "chosen for this program",
}
POINT_STATUS = {"used": "it was adjusted", "set aside": "it was left out; reason says why"}
RAY_STATUS_MEANING = (
    "it took part",
    "the point was measured in one photograph only",
    "switched off in edits.csv",
    "photograph or point has no start value: its rays do not intersect",
    "its prediction is not a finite number",
    "removed by data snooping",
    "its point is not fixed by its rays",
    "its photograph is too weakly tied to the others",
    "a mark of a control point, far from where the other photographs see the point",
)


REASONS = {
    "too weakly tied to the others": (
        "The photograph has too few points in common with the others, or they lie too close together.",
        "Measure more tie points with the neighbours, spread over the photograph.",
    ),
    "no start value": (
        "Nothing tells where the photograph was: no start value, no position, too few known points in it.",
        "Give X0 … kappa in images.csv or a position in gnss_ins.csv, or tie it to its neighbours.",
    ),
    "its points are not fixed by their rays": (
        "All points of the photograph are seen under such small angles that their distance is not known.",
        "Tie it to photographs taken from farther away.",
    ),
    "nearly all its rays contradict the block": (
        "Data snooping removed nearly all image points of the photograph.",
        "Check its name, camera, start values and whether x and y are exchanged.",
    ),
    "its rays are switched off": ("edits.csv leaves out all image points.", "Remove the rows where that is not meant."),
    "no point in common with another photograph": (
        "No point of the photograph is measured in another one.",
        "Measure tie points, or check the names of points.",
    ),
    "its rays are not finite": (
        "The image coordinates could not be predicted.",
        "Check start values and the interior orientation.",
    ),
    "no image points": ("image_points.csv has no row of the photograph.", "Measure points in it, or leave it out."),
    "its rays do not fix it in distance": (
        "The rays of the point are nearly parallel, so that its distance is not known.",
        "Measure it in a photograph from farther away, or leave it out.",
    ),
    "measured in photographs that are too weakly tied": (
        "The photographs of the point were set aside.",
        "Tie these photographs first.",
    ),
    "its rays contradict each other": (
        "Data snooping removed its image points.",
        "Look whether different points carry this name.",
    ),
    "its rays do not intersect, or its photographs have no start value": (
        "The rays of the point pass each other.",
        "Look whether different points carry this name.",
    ),
    "switched off": ("edits.csv leaves it out.", "Remove the row where that is not meant."),
    "measured in one photograph only": (
        "One ray gives no point.",
        "Measure it in a second photograph, or leave it out.",
    ),
    "not measured": ("The point is in control.csv only.", "Measure it in photographs, or check its name."),
}
"""Why photographs and points are set aside: what it means, and what to do."""


@dataclass(frozen=True)
class Word:
    """A word of a result.

    Parameters
    ----------
    name : as results have it. place : where it stands. text : what it says. remedy : what to do, '' for nothing.
    """

    name: str
    place: str
    text: str
    remedy: str = ""


WORDS = (
    Word("accepted", "verdict of an adjustment", "Nothing speaks against the result."),
    Word(
        "doubtful",
        "verdict of an adjustment",
        "The result may be used only after a look at the reasons.",
        "Read the reasons and the work list of report.html, mend the first, and adjust again.",
    ),
    Word(
        "rejected",
        "verdict of an adjustment",
        "The result is wrong and must not be used; the exit code is 1.",
        "Read the reasons: where a usual mistake explains the block it is named with its remedy.",
    ),
    Word("converged", "status of an adjustment", "The iterations came to an end."),
    Word(
        "not converged",
        "status of an adjustment",
        "The iterations did not come to an end.",
        "Look for gross errors first: try --robust huber and --check-free; then check start values and units.",
    ),
    Word(
        "rank deficient",
        "status of an adjustment",
        "The observations do not determine all unknowns; they are named.",
        'Add control, positions or ties, hold the named parameters, or choose datum = "minimal" or "inner".',
    ),
    Word(
        "fits",
        "verdict of --check-free",
        "Tie points, control and positions fit one another.",
    ),
    Word(
        "tie points",
        "verdict of --check-free",
        "The tie points do not fit one another; the error is in the image measurements.",
        "Look at the image points with the largest w, or adjust with --robust.",
    ),
    Word(
        "control",
        "verdict of --check-free",
        "The tie points fit one another, the control does not fit them.",
        "Check the named control point: coordinates, name, place in the photograph, coordinate system, heights.",
    ),
    Word(
        "positions",
        "verdict of --check-free",
        "The observed positions do not fit tie points and control.",
        "Check coordinate system, heights, lever arm and names; let gnss.shift be an unknown if they may be shifted.",
    ),
    Word(
        "both",
        "verdict of --check-free",
        "Neither the tie points nor what holds the block fit.",
        "Begin with the tie points.",
    ),
    Word(
        "not tested", "verdict of --check-free", "Control and positions add no redundancy, so that nothing tests them."
    ),
    Word("failed", "verdict of --check-free", "The tie points alone give no block.", "Measure more tie points."),
    Word("agrees", "verdict of crosscheck", "The other program finds the same result."),
    Word("differs", "verdict of crosscheck", "The other program finds another result.", "Please report it."),
    Word(
        "parameters not checked",
        "verdict of crosscheck",
        "Points and orientation agree, but no other program has the block's parameters; they are named.",
        "Cross-check with a set that the independent model has, such as bluh or brown.",
    ),
    Word("not checked", "verdict of crosscheck", "No other program could adjust the block; the reasons are given."),
    *(Word(name, "reason in images.csv and points.csv", *said) for name, said in REASONS.items()),
)
