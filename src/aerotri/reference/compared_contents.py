"""The JSON file that `aerotri compare-parameters` writes, key by key."""

from __future__ import annotations

from aerotri.reference.adjust_tables import COMPARED
from aerotri.reference.head import BLOCK, HEAD
from aerotri.reference.records import Item, axes_object, of_axes, within


def _accuracy(name: str, what: str) -> tuple[Item, ...]:
    return (
        Item(name, "object", f"Differences at {what}."),
        Item(f"{name}.count", "object", "Number of known differences, by axis."),
        *of_axes(f"{name}.count.{{}}", "whole", "Number of known differences in {}."),
        *axes_object(f"{name}.rms", "Root mean square difference"),
        *axes_object(f"{name}.low", "Lower 95 % bound of the RMS"),
        *axes_object(f"{name}.high", "Upper 95 % bound of the RMS"),
        Item(f"{name}.differences[]", "object", "One entry a point, in the order of the names at the top."),
        Item(f"{name}.differences[][]", "number?", "Differences in X, Y, Z.", "m"),
    )


def _gain(name: str, text: str) -> tuple[Item, ...]:
    return (
        Item(name, "object?", text),
        Item(f"{name}.against", "text", "The set it is held against."),
        Item(f"{name}.value", "number?", "Gain in RMS: 0.1 is 10 % smaller."),
        Item(f"{name}.standard_error", "number?", "Standard deviation of the gain."),
    )


_OF_SET = tuple(
    one
    for one in COMPARED
    if one.name
    in ("set", "status", "count", "significant", "effective", "sigma0", "sigma0_um", "aic", "bic", "verdict")
)
COMPARE_PARAMETERS = (
    *HEAD,
    BLOCK,
    Item("folds", "whole", "Parts in which control points were left out and predicted."),
    Item("robust", "text", "Robust estimation used, as adjustment.robust."),
    Item("check_points[]", "text", "Names of the check points."),
    Item("control_points[]", "text", "Names of the control points that were predicted."),
    Item("sets[]", "object", "One entry a set, in the order asked for."),
    *within("sets[]", *_OF_SET),
    *_accuracy("sets[].check", "check points"),
    *_accuracy("sets[].control", "control points, each predicted without itself"),
    Item("sets[].collocation", "object", "The random field, where the set has one."),
    Item("sets[].collocation.sigma_um", "number?", "Its standard deviation.", "µm"),
    Item("sets[].collocation.length_mm", "number?", "Its correlation length.", "mm"),
    *_gain("sets[].gain", "Gain over the best of the smaller sets it contains; null where there is none."),
    Item("sets[].groups", "text?", "Column of images.csv whose groups have values of their own; empty: one for all."),
    Item("sets[].kind", "text", "How these values are tied: free, independent or walk."),
    Item("sets[].p", "number?", "Probability of their differences by chance."),
    Item("sets[].prediction", "object", "What predictions of parts of the block by everything else say of the set."),
    Item("sets[].prediction.areas[]", "number?", "−2 ln of the density of the image points of every area."),
    Item("sets[].prediction.strips[]", "number?", "The same of every strip."),
    Item("sets[].prediction.control[]", "number?", "The same of every control point."),
    Item("sets[].prediction.sigma_height", "number?", "RMS of the σ of predicted heights.", "m"),
    Item("sets[].prediction.best", "text?", "The set that predicts best."),
    Item(
        "sets[].prediction.value", "number?", "Sum of control and the mean of areas and strips, less that of the best."
    ),
    Item("sets[].prediction.standard_error", "number?", "Standard error of value."),
    Item(
        "sets[].bends",
        "object?",
        "Where the set changes the shape of the object by more than its image points can measure; null elsewhere. auto "
        "does not take such a set.",
    ),
    Item("sets[].bends.against", "text", "The smaller set from which its object differs most."),
    Item(
        "sets[].bends.leverage",
        "number",
        "How many times farther the object differs between the two sets than their image points could move it if the "
        "photographs stayed where they are.",
    ),
    *_gain("sets[].behind", "How it stands against the best of all sets; null where it has no result."),
)
CHOICE = Item("choice", "text", "Which set auto would take and why, in a sentence.")
