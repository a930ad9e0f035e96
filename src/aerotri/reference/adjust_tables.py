"""The tables that `aerotri adjust` writes, column by column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.diagnosis.work_items import KINDS
from aerotri.reference.records import AXES, DescribedFile, Item, of_axes
from aerotri.reference.words import MARKS, POINT_STATUS, RAY_STATUS_MEANING, REASONS
from aerotri.statistics.set_aside import PHOTOGRAPH_REASONS, POINT_REASONS

PLACE = "result of adjust"
ANGLES = ("omega", "phi", "kappa")
EFFECTS = {
    "r": "Redundancy number of {}: 0, nothing checks the value; 1, it is fully checked by others.",
    "w": "Normalised residual of {}: the residual over its standard deviation. Beyond 3.3 it is a suspected error.",
    "tau": "Test value of {} that does not rely on the stated σ (Pope's τ): w over σ0.",
    "mde": "Marginally detectable error of {}: an error of this size is found with the probability adjustment.power.",
    "external": "Largest effect of an undetected error of {} on any result, in standard deviations of that result.",
}
WHERE_MODEL = " Only where groups of photographs share errors."
RELATIVE = "Total standard deviation of {} relative to the whole block: after a similarity of all points."


def with_totals(model: str, total: str, what: str, unit: str, axes: Sequence[str] = AXES) -> tuple[Item, ...]:
    """Columns of the model part of σ and of the total, which stand beside those of σ where there is a model part."""
    whole = f"Total standard deviation of {what}, model part included.{WHERE_MODEL}"
    found = (
        *of_axes(model, "number?", f"Model part of the standard deviation of {what}.{WHERE_MODEL}", unit, axes),
        *of_axes(total, "number?", whole, unit, axes),
    )
    return tuple(replace(item, optional=True) for item in found)


def _relative(name: str, what: str) -> tuple[Item, ...]:
    """Columns of σ after a similarity of the whole block, where the adjustment has a final σ0."""
    return tuple(replace(item, optional=True) for item in of_axes(name, "number?", RELATIVE.format(what), "m"))


STATUS = Item("status", "text", "Whether it took part in the adjustment.", values=POINT_STATUS)

IMAGES = (
    Item("image", "text", "Name of the photograph."),
    Item("camera", "text", "Name of its camera."),
    Item("strip", "text?", "Name of its strip."),
    *of_axes("{}0", "number?", "Adjusted {} of the projection centre.", "m"),
    *of_axes("{}", "number?", "Adjusted angle {}.", "deg", ANGLES),
    *of_axes("s{}0", "number?", "Standard deviation of {}0.", "m"),
    *of_axes("s_{}", "number?", "Standard deviation of {}.", "deg", ANGLES),
    *with_totals("m{}0", "t{}0", "{}0", "m"),
    *with_totals("m_{}", "t_{}", "{}", "deg", ANGLES),
    Item("rays", "whole", "Number of image points used."),
    STATUS,
    Item(
        "reason",
        "text?",
        "Why it was set aside.",
        values={name: REASONS[name][0] for name in (*PHOTOGRAPH_REASONS.values(), "no image points")},
    ),
    *_relative("x_r{}0", "{}0"),
    *of_axes("x_s_{}_mgon", "number?", "Standard deviation of {}.", "mgon", ANGLES),
)
POINTS = (
    Item("point", "text", "Name of the object point."),
    *of_axes("{}", "number?", "Adjusted {}.", "m"),
    *of_axes("s{}", "number?", "Standard deviation of {}.", "m"),
    *with_totals("m{}", "t{}", "{}", "m"),
    Item("rays", "whole", "Number of photographs used."),
    Item("max_abs_w", "number?", "Largest normalised residual of its image coordinates, without sign."),
    STATUS,
    Item(
        "reason",
        "text?",
        "Why it was set aside.",
        values={name: REASONS[name][0] for name in (*POINT_REASONS.values(), "not measured")},
    ),
    *_relative("x_r{}", "{}"),
)


def _by_xy(name: str, text: str, unit: str = "") -> tuple[Item, ...]:
    return of_axes(name, "number?", text, unit, ("x", "y"))


RESIDUALS = (
    Item("image", "text", "Name of the photograph."),
    Item("point", "text", "Name of the object point."),
    *_by_xy("{}", "Measured {}, from the image centre (x right, y up).", "mm"),
    *_by_xy("v{}", "Residual of {}: adjusted minus measured.", "mm"),
    *_by_xy("r{}", EFFECTS["r"]),
    *_by_xy("w{}", EFFECTS["w"]),
    Item("weight", "number", "Factor of robust estimation: 1 full weight, near 0 practically left out."),
    Item(
        "status",
        "text",
        "Whether the image point was used.",
        values=dict(zip(RAY_STATUS, RAY_STATUS_MEANING, strict=True)),
    ),
    *_by_xy("x_tau_{}", EFFECTS["tau"]),
    *_by_xy("x_mde_{}", EFFECTS["mde"], "mm"),
    *_by_xy("x_external_{}", EFFECTS["external"]),
    *_by_xy(
        "x_effect_{}", "Largest effect of an undetected error of {} on a single unknown, in its standard deviations."
    ),
    *of_axes("x_effect_on_{}", "text?", "The unknown that an undetected error of {} acts on most.", "", ("x", "y")),
)
PARAMETERS = (
    Item("name", "text", "Name of the parameter, such as focal_length_mm, bluh.1 or gnss.shift_X."),
    Item("group", "text", "What it belongs to: a camera, strip, day, or the block."),
    Item("mark", "text?", "Where the formula comes from.", values=MARKS),
    Item("value", "number?", "Adjusted value.", "unit of the parameter"),
    Item("sigma", "number?", "Standard deviation of the value.", "unit of the parameter"),
    Item("t", "number?", "Value over standard deviation, without sign; below 2 it is not significant."),
    *(
        Item(name, "number?", f"{text}{WHERE_MODEL}", "unit of the parameter", optional=True)
        for name, text in (
            ("model_sigma", "Model part of the standard deviation."),
            ("total_sigma", "Total standard deviation: noise and model part."),
        )
    ),
    Item("max_correlation", "number?", "Largest correlation with another of these parameters, −1 to 1."),
    Item("max_correlation_with", "text?", "The parameter it is most correlated with."),
    Item("total_correlation", "number?", "Correlation with all other parameters together, 0 to 1."),
    Item(
        "status",
        "text",
        "How the parameter was treated.",
        values={
            "estimated": "a free unknown",
            "weighted": "an unknown with a given σ",
            "fixed": "held",
            "removed": "taken out by the selection",
        },
    ),
    Item("reason", "text?", "Why it was removed."),
    Item(
        "x_kind",
        "text",
        "Kind of parameter.",
        values={
            "interior": "interior orientation",
            "additional": "additional parameter (self-calibration)",
            "gnss": "shift, drift, lever arm or time offset of GNSS",
            "ins": "boresight or drift of the INS",
            "rig": "position (m) or angle (rad) of a camera on a rig",
            "constraint": "unknown of a condition",
            "point": "coordinate of a point in a condition",
        },
    ),
)
GROUND = (
    Item("point", "text", "Name of the point."),
    *of_axes("d{}", "number?", "Adjusted minus given {}.", "m"),
    *of_axes("s{}", "number?", "Standard deviation of the adjusted {}.", "m"),
    *with_totals("m{}", "t{}", "the adjusted {}", "m"),
    *of_axes("r{}", "number?", EFFECTS["r"].replace("{}", "the given {}")),
    *of_axes("w{}", "number?", EFFECTS["w"].replace("{}", "{} (check points: difference over its own σ)")),
    Item("rays", "whole", "Number of photographs used."),
)
CONTROL = (
    *GROUND,
    *of_axes("x_tau{}", "number?", EFFECTS["tau"].replace("{}", "the given {}")),
    *of_axes("x_mde{}", "number?", EFFECTS["mde"].replace("{}", "the given {}"), "m"),
    *of_axes("x_external{}", "number?", EFFECTS["external"].replace("{}", "the given {}")),
)
OBSERVATIONS = (
    Item(
        "group",
        "text",
        "What was observed.",
        values={
            "projection centres": "positions of gnss_ins.csv",
            "attitudes": "angles of gnss_ins.csv",
            "constraints": "conditions of constraints.csv",
        },
    ),
    Item("label", "text", "The photograph, or the condition with its points."),
    Item("component", "text?", "X, Y, Z, omega, phi or kappa; empty for a condition."),
    Item("v", "number", "Residual: adjusted minus observed.", "m, deg for angles"),
    Item("sigma", "number", "Stated standard deviation.", "m, deg for angles"),
    *(
        Item(
            name,
            "number?",
            EFFECTS[name].replace("{}", "the observation"),
            "m, deg for angles" if name == "mde" else "",
        )
        for name in EFFECTS
    ),
    Item("effect", "number?", "Largest effect of an undetected error on a single unknown, in its standard deviations."),
    Item("effect_on", "text?", "The unknown that an undetected error acts on most."),
)
CHANGES = (
    Item("first", "text", "First group of photographs."),
    Item("second", "text", "Second group of photographs."),
    *_by_xy("{}", "Place {} in the image, from the centre.", "mm"),
    *_by_xy("d{}", "Image error of the first group less that of the second, {}.", "mm"),
    *_by_xy("s_d{}", "Standard deviation of the difference in {}.", "mm"),
    Item("significant", "whole", "1 where the difference is significant, else 0."),
)
COMPARED = (
    Item("set", "text", "The set of additional parameters."),
    Item("status", "text", "converged, or why the set could not be adjusted."),
    Item("count", "number", "Number of parameters estimated."),
    Item("effective", "number?", "The same, counting of a random field only what the measurements determine."),
    Item("significant", "number", "Number of them with |value|/σ above 1.96."),
    Item("sigma0", "number?", "σ0 of the adjustment; 1 where the stated σ are right."),
    Item("sigma0_um", "number?", "σ0 as standard deviation of an image coordinate.", "µm"),
    Item("aic", "number?", "Akaike's criterion; the smaller the better."),
    Item("bic", "number?", "Bayes' criterion; the smaller the better."),
    *(
        item
        for where, what in (("check", "check points"), ("control", "control points, each predicted without itself"))
        for kind, words in (
            ("rms", "RMS of {}"),
            ("low", "Lower 95 % bound of the RMS of {}"),
            ("high", "Upper 95 % bound of the RMS of {}"),
        )
        for item in of_axes(f"{where}_{kind}_{{}}", "number?", f"{words} at {what}.", "m")
    ),
    Item("gain", "number?", "Gain over the best of the smaller sets it contains: 0.1 is 10 % smaller RMS."),
    Item("gain_against", "text?", "The set that the gain refers to."),
    Item(
        "prediction",
        "number?",
        "−2 ln of the density with which areas, strips and control points are predicted by "
        "everything else, less that of the best set: 0 is the best.",
    ),
    Item("prediction_error", "number?", "Standard error of prediction."),
    Item("verdict", "text?", "Whether the set earns its parameters, in a few words."),
)
WORK = (
    Item(
        "level",
        "text",
        "How urgent it is.",
        values={"wrong": "chance does not explain it", "weak": "little holds or checks it", "doubtful": "worth a look"},
    ),
    Item("kind", "text", "What it is about.", values=dict.fromkeys(KINDS, "")),
    Item("where", "text", "Where to look."),
    Item("what", "text", "What was found."),
    Item("times_limit", "number?", "How many times the limit it is."),
    Item("do", "text", "What to do."),
)
EFFECTS_OF_PARAMETERS = (
    Item("left_out", "text", "What is left out: nothing, all additional parameters, a family, or one parameter."),
    Item("group", "text?", "Camera or group of a single parameter."),
    Item("t", "number?", "Value over standard deviation of a single parameter."),
    *of_axes("rms_{}", "number?", "Root mean square difference in {} at the check points without it.", "m"),
    Item("verdict", "text?", "Whether leaving it out makes a difference."),
)
RIGS = (
    Item("rig", "text", "Name of the rig."),
    Item("reference", "text", "Its reference camera."),
    Item("camera", "text", "The camera, in the frame of the reference camera: X_reference = position + R·X_camera."),
    *of_axes("{}", "number", "{} of its projection centre.", "m", ("x", "y", "z")),
    *of_axes("{}", "number", "Angle {} of R.", "deg", ("omega", "phi", "kappa")),
    *of_axes("s{}", "number", "Standard deviation of {}; 0: held.", "m", ("x", "y", "z")),
    *of_axes("s_{}", "number", "Standard deviation of the angle {}; 0: held.", "deg", ("omega", "phi", "kappa")),
    Item("stations", "whole", "Photographs of the camera that took part."),
)
RIG_MOVEMENTS = (
    Item("image", "text", "Name of the photograph."),
    Item("station", "text", "Its exposure."),
    Item("rig", "text", "Name of the rig."),
    Item("camera", "text", "Camera."),
    *of_axes("moved_{}", "number", "Deviation from its place on the rig along {} of the reference camera.", "m",
             ("x", "y", "z")),
    *of_axes("turned_{}", "number", "Rotation from its place on the rig about {} of the reference camera.", "deg",
             ("x", "y", "z")),
    *of_axes("s_moved_{}", "number", "Standard deviation of the deviation along {}.", "m", ("x", "y", "z")),
    *of_axes("s_turned_{}", "number", "Standard deviation of the rotation about {}.", "deg", ("x", "y", "z")),
)  # fmt: skip
RIG_STATIONS = (
    Item("image", "text", "Name of the photograph."),
    Item("station", "text", "Its exposure."),
    Item("rig", "text", "Name of the rig."),
    Item("camera", "text", "Camera."),
    *of_axes(
        "turned_{}",
        "number?",
        "Rotation about {} of the reference camera that would suit its rays better than its place on the rig.",
        "deg",
        ("x", "y", "z"),
    ),
    *of_axes("s_turned_{}", "number?", "Standard deviation of the rotation about {}.", "deg", ("x", "y", "z")),
    Item("freedom", "whole", "Degrees of freedom of the test, 6 where its rays fix all of position and rotation."),
    Item("f", "number?", "Value of the F test; about 1 where the photograph is in its place."),
    Item("p", "number", "Probability of such a value by chance."),
    Item("found", "yes/no", "Whether it is out of its place, all photographs of rigs taken together (Holm)."),
    Item("station_freedom", "whole", "Degrees of freedom of the test whether the photographs of its exposure stand to "
         "one another as the rig says."),
    Item("station_f", "number?", "Value of this F test."),
    Item("station_p", "number", "Probability of such a value by chance."),
    Item("station_found", "yes/no", "Whether the exposure does not fit the rig, all exposures taken together (Holm)."),
)  # fmt: skip
MOTIONS = (
    Item("image", "text", "Name of the photograph."),
    *of_axes("v{}", "number", "Velocity in {} while the photograph was read; with an EPSG code in east, north and up.",
             "m/s"),
    *of_axes("w{}", "number", "Rate of rotation about the {} axis of the camera.", "deg/s", ("x", "y", "z")),
    Item("source", "text", "Where the velocity comes from.", values={
        "time": "times of the photograph and its neighbours", "strip": "the other photographs of its strip",
        "speed": "the direction of its neighbours and the stated speed", "unknown": "nowhere, it is zero"}),
)  # fmt: skip


def adjust_tables() -> tuple[DescribedFile, ...]:
    """The tables of a result."""

    def table(name: str, text: str, items: tuple[Item, ...], when: str = "") -> DescribedFile:
        return DescribedFile(name, PLACE, "table", text, items, when)

    return (
        table("images.csv", "Orientation of every photograph with its standard deviations.", IMAGES),
        table("points.csv", "Coordinates of every object point with their standard deviations.", POINTS),
        table(
            "residuals.parquet", "Residuals and reliability of every image point, in the order of the input.", RESIDUALS
        ),
        table("parameters.csv", "Interior orientation, additional parameters, GNSS and INS parameters.", PARAMETERS),
        table("control.csv", "Residuals and reliability of the control points.", CONTROL),
        table("check.csv", "Differences at the check points.", GROUND),
        table("work_list.csv", "What to look at next, the most urgent first.", WORK),
        table(
            "parameter_effects.csv",
            "What the additional parameters bring at the check points.",
            EFFECTS_OF_PARAMETERS,
            "with additional parameters and check points",
        ),
        table(
            "observations.csv",
            "Residuals of positions, angles and conditions.",
            OBSERVATIONS,
            "where any were observed",
        ),
        table("rigs.csv", "Position and rotation of the cameras on rigs.", RIGS, "with a rig"),
        table(
            "rig_movements.csv",
            "Deviation of every photograph from its place on a weighted rig.",
            RIG_MOVEMENTS,
            "with a weighted rig",
        ),
        table(
            "rig_stations.csv",
            "Test of every photograph of a rigid rig against its place.",
            RIG_STATIONS,
            "with a rigid rig",
        ),
        table("motion.csv", "How photographs moved while they were read.", MOTIONS, "with a rolling shutter"),
        table(
            "parameter_changes.csv",
            "Change of the image errors between two groups of photographs, on a grid over the image.",
            CHANGES,
            "where groups of photographs have parameters of their own",
        ),
        table(
            "compare_parameters.csv",
            "Sets of additional parameters side by side.",
            COMPARED,
            "with additional parameters auto",
        ),
    )
