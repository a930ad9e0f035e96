"""The JSON files that `aerotri adjust` and `aerotri compare-parameters` write, key by key."""

from __future__ import annotations

from aerotri.reference.adjust_models import (
    gnss_errors,
    movements,
    photograph_fields,
    ray_correlation,
    rigidity,
    rolling_shutters,
)
from aerotri.reference.adjust_tables import PARAMETERS, PLACE, RIGS, WHERE_MODEL, with_totals
from aerotri.reference.compared_contents import COMPARE_PARAMETERS
from aerotri.reference.head import BLOCK, GOOD_FOR, HEAD, ORIGINS
from aerotri.reference.records import DescribedFile, Item, axes_object, of_axes, within

STATUS_WORDS = {
    "converged": "the iterations came to an end",
    "not converged": "they did not",
    "rank deficient": "the observations do not determine all unknowns",
}
SUSPECT_UNIT = "m, mm for image points, rad for angles"


def _ground_points(name: str, what: str) -> tuple[Item, ...]:
    return (
        Item(name, "object", f"Differences at the {what} points."),
        Item(f"{name}.count", "whole", f"Number of {what} points."),
        *axes_object(f"{name}.rms", "Root mean square difference"),
        *axes_object(f"{name}.mean", "Mean difference"),
        *axes_object(f"{name}.max", "Largest difference without sign"),
        Item(f"{name}.points[]", "object", f"One entry a {what} point."),
        Item(f"{name}.points[].point", "text", "Name of the point."),
        *of_axes(f"{name}.points[].d{{}}", "number?", "Adjusted minus given {}.", "m"),
        *of_axes(f"{name}.points[].s{{}}", "number?", "Standard deviation of the adjusted {}.", "m"),
        *with_totals(f"{name}.points[].m{{}}", f"{name}.points[].t{{}}", "the adjusted {}", "m"),
    )


def _precision() -> tuple[Item, ...]:
    """Absolute and relative σ side by side."""
    said = "Median total standard deviation of the {} as the block stands (null where nothing holds it)"
    left = "The same relative to the whole block, after a similarity (shift, rotation, scale) of all points"
    found = [Item("precision", "object", "Absolute and relative standard deviations side by side.")]
    for name, what in (("points", "object points"), ("centres", "projection centres")):
        found.append(Item(f"precision.{name}", "object", f"Of the {what}."))
        found += axes_object(f"precision.{name}.absolute_m", said.format(what))
        found += axes_object(f"precision.{name}.relative_m", left)
    near = "precision.neighbours"
    return (
        *found,
        *axes_object("precision.position_m", "Standard deviation of the place of the whole block, at its middle"),
        Item("precision.rotation_deg", "object", "Standard deviation of the rotation of the whole block.", "deg"),
        *of_axes("precision.rotation_deg.{}", "number?", "About the axis {}.", "deg"),
        Item("precision.scale", "number?", "Standard deviation of the scale of the whole block: 0.01 is 1 %."),
        Item(near, "object?", "Height differences of object points half a base apart, median of some pairs."),
        Item(f"{near}.distance_m", "number", "How far apart they are in plan.", "m"),
        Item(f"{near}.pairs", "whole", "Number of pairs."),
        Item(f"{near}.sigma_dZ_m", "number?", "Total standard deviation of the difference, tilts of the block "
             "included.", "m"),
        Item(f"{near}.relative_sigma_dZ_m", "number?", "The same after a similarity of the whole block.", "m"),
    )  # fmt: skip


ADJUSTMENT = (
    *HEAD,
    BLOCK,
    Item("status", "text", "How the iterations ended.", values=STATUS_WORDS),
    Item(
        "verdict",
        "text",
        "What the result is worth.",
        values={
            "accepted": "nothing speaks against it",
            "doubtful": "look before use",
            "rejected": "do not use",
            "": "not judged",
        },
    ),
    Item("reasons[]", "text", "Why the result is doubtful or rejected, the gravest reason first."),
    Item("good_for", "text", "What the result is good for.", values=GOOD_FOR),
    Item("purpose", "text", "The same in a sentence or two, with the numbers; empty where it is not known."),
    Item("message", "text", "What is wrong, where the adjustment did not converge; else empty."),
    Item("iterations", "whole", "Number of iterations."),
    Item("sigma0", "number?", "Standard deviation of unit weight, σ0; 1 where all stated σ are right."),
    Item("sigma0_um", "number?", "σ0 as standard deviation of an image coordinate.", "µm"),
    Item("vtpv", "number?", "Weighted sum of squared residuals, vᵀPv."),
    Item("observations", "whole", "Number of observations."),
    Item("unknowns", "whole", "Number of unknowns."),
    Item("conditions", "whole", "Number of conditions that fix the datum."),
    Item("redundancy", "whole", "Observations less unknowns plus conditions."),
    Item("groups[]", "object", "One entry a group of observations, such as image points or control height."),
    Item("groups[].name", "text", "Name of the group."),
    Item("groups[].count", "whole", "Number of observations in the group."),
    Item(
        "groups[].sigma_apriori",
        "number?",
        "Stated standard deviation (median).",
        "µm for image points, rad for angles, else m",
    ),
    Item("groups[].rms", "number?", "Root mean square residual.", "µm for image points, rad for angles, else m"),
    Item("groups[].redundancy", "number?", "Share of the group in the redundancy."),
    Item(
        "groups[].sigma_aposteriori",
        "number?",
        "Standard deviation that the residuals show.",
        "µm for image points, rad for angles, else m",
    ),
    *_ground_points("check_points", "check"),
    *_ground_points("control_points", "control"),
    Item("additional_parameters[]", "object", "One entry an additional parameter; the columns of parameters.csv."),
    *within("additional_parameters[]", *(one for one in PARAMETERS if one.name not in ("mark", "x_kind"))),
    Item("cameras[]", "object", "Interior orientation of every camera after the adjustment."),
    Item("cameras[].name", "text", "Name of the camera."),
    *(
        item
        for name, what in (
            ("focal_length_mm", "Principal distance."),
            ("x0_mm", "x of the principal point."),
            ("y0_mm", "y of the principal point."),
        )
        for item in (
            Item(f"cameras[].{name}", "number?", what, "mm"),
            Item(f"cameras[].s_{name}", "number?", "Its standard deviation; 0: held.", "mm"),
            Item(f"cameras[].m_{name}", "number?", f"Model part of it.{WHERE_MODEL}", "mm", optional=True),
            Item(f"cameras[].t_{name}", "number?", f"Total of both.{WHERE_MODEL}", "mm", optional=True),
        )
    ),
    Item(
        "cameras[].held_parameters",
        "object",
        "Additional parameters of the camera that were held, by name. Only where there are any.",
        optional=True,
    ),
    Item("cameras[].held_parameters.*", "number", "The value that block.toml states."),
    Item("blunders[]", "object", "Suspected gross errors, the largest first."),
    Item("blunders[].image", "text", "Photograph; empty for a control point."),
    Item("blunders[].point", "text", "Point."),
    Item("blunders[].w", "number?", "Normalised residual."),
    Item("blunders[].estimated_mm", "number?", "Size of the error that would explain it.", "mm"),
    Item("blunders[].action", "text", "What was done with it."),
    Item("deviations", "object?", "How much parameters differ between groups of photographs ([deviations])."),
    Item("deviations.kind", "text", "independent or walk, as in [deviations]."),
    Item("deviations.total_um", "number", "Size of all deviations together as image error, µm."),
    Item("deviations.ratio", "number", "−2 ln of the likelihood of one set for all over that of the groups."),
    Item("deviations.p", "number", "Probability of such differences by chance where the groups do not differ."),
    Item("deviations.needed", "yes/no", "Whether that probability is below the significance level."),
    Item("deviations.parameters[]", "object", "One entry a parameter."),
    Item("deviations.parameters[].name", "text", "Name of the parameter."),
    Item("deviations.parameters[].groups", "whole", "Number of groups that have a value."),
    Item(
        "deviations.parameters[].sigma_um",
        "number",
        "σ of the values about their mean, or of the step, as image error, µm; 0 where none is seen.",
    ),
    Item("deviations.parameters[].sigma", "number", "The same in the unit of the parameter."),
    Item("deviations.parameters[].ratio", "number", "−2 ln of the likelihood without its deviations over that with."),
    Item("model_part", "object", "Model part of σ: errors that groups of photographs share."),
    Item("model_part.scheme", "text", "Groups whose common errors make it, such as strip; empty where there is none."),
    Item("model_part.clusters", "whole", "Number of these groups."),
    Item(
        "model_part.method",
        "text",
        "Where it is from. groups: the differences between the groups. field: random fields of image errors, where the "
        "groups are fewer than five or one is too large. control: contradictions of the control points. Empty where "
        "there is none.",
    ),
    Item("model_part.level", "number?", "Probability with which noise alone is taken for common errors."),
    Item("model_part.tests[]", "object", "One entry a way to divide the photographs into groups."),
    Item(
        "model_part.tests[].scheme",
        "text",
        "What makes a group: strip, direction of flight (of view where there are no strips), photograph, or a column "
        "of images.csv.",
    ),
    Item("model_part.tests[].clusters", "whole", "Number of groups; many strips are joined to fewer."),
    Item("model_part.tests[].freedom", "whole", "Degrees of freedom of the test."),
    Item("model_part.tests[].ratio", "number?", "Common errors over what noise explains; about 1 if there are none."),
    Item("model_part.tests[].ratio_random", "number?", "The same of random groups of the same sizes."),
    Item("model_part.tests[].p_noise", "number?", "Probability of such a ratio by noise alone."),
    Item("model_part.tests[].p_random", "number?", "Probability of such a ratio by what random groups show."),
    Item("model_part.tests[].counts", "yes/no", "Whether both probabilities are small enough."),
    Item("model_part.tests[].field_um", "number?", "σ of the random field of every group, where there is one.", "µm"),
    Item("model_part.tests[].field_mm", "number?", "Its correlation length in the image, in the largest format.", "mm"),
    Item("model_part.tests[].reason", "text", "Why there was no test; else empty."),
    Item("model_part.ratio_plan", "number", "Total σ over σ of the noise in X and Y, median of the points."),
    Item("model_part.ratio_height", "number", "The same in Z."),
    Item("model_part.reason", "text", "Why no groups of photographs add to σ; else empty."),
    Item(
        "model_part.control",
        "object?",
        "What the control points say of σ; null where there are none, in a free network, and in a block in parts.",
    ),
    Item(
        "model_part.control.coordinates", "whole", "Control coordinates looked at, of 12 points at most.", optional=True
    ),
    Item(
        "model_part.control.freedom",
        "whole",
        "Contradictions of these coordinates among themselves and with the photographs, beyond what fixes the datum.",
        optional=True,
    ),
    Item(
        "model_part.control.ratio",
        "number?",
        "RMS of the contradictions over what the noise explains; about 1 if σ is right.",
        optional=True,
    ),
    Item("model_part.control.p", "number?", "Probability of a larger ratio.", optional=True),
    Item("model_part.control.ratio_total", "number?", "The same ratio with the model part.", optional=True),
    Item("model_part.control.p_total", "number?", "Probability of a larger one.", optional=True),
    Item(
        "model_part.control.left_out",
        "number?",
        "RMS of the misses of control points, each left out in turn, over their σ.",
        optional=True,
    ),
    Item("model_part.control.left_out_total", "number?", "The same over total σ.", optional=True),
    Item(
        "model_part.control.scale",
        "number?",
        "What the residuals of control say the variances of the model part should be multiplied with; it is not done.",
        optional=True,
    ),
    Item(
        "model_part.other_set",
        "object?",
        "Additional parameters that the choice could not tell from those taken; null where the choice was not the "
        "program's, or there are none.",
    ),
    Item("model_part.other_set.set", "text", "The parameters, as on the command line.", optional=True),
    Item("model_part.other_set.weight", "number", "Probability that they are the better ones.", optional=True),
    Item("model_part.other_set.plan_m", "number?", "RMS of the change of the points in plan.", "m", optional=True),
    Item("model_part.other_set.height_m", "number?", "The same in height.", "m", optional=True),
    Item(
        "model_part.other_set.plan_sigma", "number?", "RMS of the change of X and Y over σ of the noise.", optional=True
    ),
    Item("model_part.other_set.height_sigma", "number?", "The same of Z.", optional=True),
    Item(
        "model_part.other_set.unexplained",
        "number",
        "Share of the squares of the changes that the σ of both sets do not explain. Times the probability it is what "
        "total σ² contains of them, where the change in plan or in height is larger than σ.",
        optional=True,
    ),
    Item(
        "model_part.common[]",
        "object",
        "Parts of σ of the object points, RMS over the points: what all have in common, and what is local. Their "
        "squares add up. Points with σ above three times the median are left out.",
    ),
    Item(
        "model_part.common[].part",
        "text",
        "Such as height: shift, height: tilt, height: bend, height: local, plan: turn and scale.",
    ),
    Item("model_part.common[].sigma_m", "number", "σ of the noise.", "m"),
    Item("model_part.common[].total_m", "number", "Total σ.", "m"),
    *gnss_errors(),
    *photograph_fields(),
    *ray_correlation(),
    *_precision(),
    Item("rigs[]", "object", "Cameras on rigs; where there are any.", optional=True),
    *within("rigs[]", *RIGS),
    Item("rigs[].correlations[]", "object", "Correlations of the six elements, one entry an element."),
    Item("rigs[].correlations[].element", "text", "The element."),
    *of_axes(
        "rigs[].correlations[].{}",
        "number?",
        "Its correlation with {}; empty for what is held.",
        "",
        ("x", "y", "z", "omega", "phi", "kappa"),
    ),
    Item("rig_movements[]", "object", "How cameras move on weighted rigs; where there are any.", optional=True),
    *within("rig_movements[]", *movements()),
    *rigidity(),
    *rolling_shutters(),
    Item("settings[]", "object", "Every setting that was used, by its name in block.toml."),
    Item("settings[].key", "text", "Name in full, such as camera.NAME.pixel_um."),
    Item("settings[].value", "anything", "The value; null where it is not in use."),
    Item("settings[].unit", "text", "Unit; empty where it has none."),
    Item("settings[].origin", "text", "Where it comes from.", values=ORIGINS),
    Item("notes[]", "text", "Sentences about what the program chose by itself, and why."),
    Item("warnings[]", "text", "Sentences to read: what was left out, assumed or is weak."),
    Item("timings_s", "object", "Time by stage.", "s"),
    *(
        Item(f"timings_s.{name}", "number", f"Time for {what}.", "s")
        for name, what in (
            ("read", "reading"),
            ("start_values", "start values"),
            ("solve", "the iterations"),
            ("statistics", "σ and tests"),
            ("plots", "plots and report"),
            ("write", "writing"),
        )
    ),
)

STAGES = {
    "tie points alone": "free adjustment",
    "with control": "control added",
    "with observed positions": "GNSS added",
}
CHECK_FREE = (
    Item(
        "verdict",
        "text",
        "What does not fit.",
        values={
            "fits": "all fits",
            "tie points": "the tie points",
            "control": "the control",
            "positions": "the observed positions",
            "both": "tie points and what holds the block",
            "not tested": "nothing could be tested",
            "failed": "the tie points give no block",
        },
    ),
    Item("sentence", "text", "The verdict with its reasons, in words."),
    Item("sigma0_free", "number?", "σ0 of the tie points alone."),
    Item("sigma0_full", "number?", "σ0 of the whole adjustment."),
    Item("spread_free", "number?", "Standard deviation of the normalised residuals without gross errors."),
    Item("rays_beyond", "whole", "Number of image points with residuals that chance does not explain."),
    Item("robust", "yes/no", "Whether the weights are robust; then the limits hold approximately."),
    Item("stages[]", "object", "The adjustments one after another, each with more observations."),
    Item("stages[].name", "text", "What takes part.", values=STAGES),
    Item("stages[].status", "text", "How its iterations ended."),
    Item("stages[].message", "text", "Why it has no result; else empty."),
    Item("stages[].sigma0", "number?", "Its σ0."),
    Item("stages[].vtpv", "number?", "Its weighted sum of squared residuals."),
    Item("stages[].redundancy", "whole", "Its redundancy."),
    Item("stages[].added_observations", "whole", "Observations more than in the stage before."),
    Item("stages[].ratio", "number?", "Growth of vᵀPv by redundancy gained, in σ0² of the free block."),
    Item("stages[].limit", "number?", "What the ratio may be by chance."),
    Item("stages[].largest_w", "number?", "Largest normalised residual of what was added."),
    Item("stages[].w_limit", "number?", "What it may be by chance."),
    Item("stages[].fits", "yes/no?", "Whether what was added fits; null where nothing tests it."),
    Item("stages[].suspects[]", "object", "Values with large residuals, the largest first."),
    Item("stages[].suspects[].kind", "text", "ray (image point), control, or the group of the observation."),
    Item("stages[].suspects[].name", "text", "Point, photograph or condition."),
    Item("stages[].suspects[].component", "text", "Coordinate or angle."),
    Item("stages[].suspects[].w", "number?", "Normalised residual."),
    Item("stages[].suspects[].error", "number?", "Error that would explain it.", SUSPECT_UNIT),
    Item("stages[].suspects[].error_px", "number?", "The same in pixels, of image points.", "px"),
    Item(
        "transformation", "object?", "Similarity from the free block onto the control; null where it is not determined."
    ),
    Item("transformation.translation_m[]", "number", "Shift in X, Y, Z.", "m"),
    Item("transformation.rotation_deg[]", "number", "Rotation about X, Y, Z.", "deg"),
    Item("transformation.scale_ppm", "number", "Change of scale.", "ppm"),
    Item("transformation.redundancy", "whole", "Redundancy of the transformation."),
    *axes_object("transformation.rms", "Root mean square residual"),
    Item("transformation.points[]", "object", "Residuals at the control points."),
    Item("transformation.points[].point", "text", "Name of the point."),
    *of_axes("transformation.points[].d{}", "number?", "Transformed minus given {}.", "m"),
    Item(
        "position_offset_m",
        "object?",
        "Mean of the observed positions less where control puts them; null where not known.",
        "m",
    ),
    Item("position_offset_m[]", "number", "In X, Y, Z.", "m"),
)

COMPONENTS = (
    Item("components[]", "object", "One entry a group of observations."),
    Item("components[].group", "text", "Name of the group."),
    Item("components[].unit", "text", "Unit of its σ.", values={"µm": "", "m": "", "rad": ""}),
    Item("components[].count", "whole", "Number of observations."),
    Item("components[].redundancy", "number?", "Share of the group in the redundancy."),
    Item("components[].sigma_apriori", "number?", "Stated standard deviation (median).", "unit"),
    Item("components[].factor", "number?", "Factor by which all σ of the group were multiplied."),
    Item("components[].factor_sigma", "number?", "Standard deviation of the factor."),
    Item("components[].freedom", "number?", "Degrees of freedom behind the factor."),
    Item("components[].held", "text", "Why the σ was left as stated; empty where it was estimated."),
    Item("components[].test", "object", "Test of the stated σ against the residuals."),
    Item("components[].test.group", "text", "Name of the group."),
    Item("components[].test.ratio", "number?", "σ of the residuals over stated σ."),
    Item("components[].test.freedom", "number?", "Degrees of freedom."),
    Item("components[].test.statistic", "number?", "Test value, χ² distributed."),
    Item("components[].test.low", "number?", "Smallest test value that chance allows."),
    Item("components[].test.high", "number?", "Largest test value that chance allows."),
    Item(
        "components[].test.verdict",
        "text",
        "Outcome of the test.",
        values={
            "agrees": "the stated σ fits",
            "σ given too small": "",
            "σ given too large": "",
            "not testable": "too little redundancy",
        },
    ),
    Item("rounds", "whole", "Adjustments it took."),
    Item("settled", "yes/no", "Whether the last adjustment changed no σ by 1 %."),
)
CHANGES = (
    Item("[]", "object", "One entry a pair of groups of photographs."),
    Item("[].first", "text", "First group."),
    Item("[].second", "text", "Second group."),
    Item("[].camera", "text", "Their camera."),
    Item("[].rms_um", "number", "Root mean square difference of the image errors.", "µm"),
    Item("[].max_um", "number", "Largest difference.", "µm"),
    Item("[].rms_of_sigma_um", "number", "Difference that the standard deviations alone let expect.", "µm"),
    Item("[].statistic", "number", "Test value, F distributed where nothing changed."),
    Item("[].freedom", "whole", "Degrees of freedom."),
    Item("[].p", "number", "Probability of such a test value where nothing changed."),
    Item("[].changed", "yes/no", "Whether the image errors changed (p below 0.01)."),
    Item("[].sentence", "text", "The outcome in words."),
)


def adjust_contents() -> tuple[DescribedFile, ...]:
    """The JSON files of a result, and of compare-parameters."""

    def content(name: str, text: str, items: tuple[Item, ...], when: str = "", place: str = PLACE) -> DescribedFile:
        return DescribedFile(name, place, "json", text, items, when)

    return (
        content(
            "adjustment.json", "The outcome in numbers: verdict, σ0, groups, check points, parameters.", ADJUSTMENT
        ),
        content(
            "check_free.json",
            "Whether an error is in the tie points or in the control.",
            CHECK_FREE,
            "with --check-free",
        ),
        content(
            "variance_components.json",
            "σ of groups of observations, estimated from the residuals.",
            COMPONENTS,
            'with variance_components = "on"',
        ),
        content(
            "parameter_changes.json",
            "Whether the image errors changed between groups of photographs.",
            CHANGES,
            "where groups of photographs have parameters of their own",
        ),
        content(
            "compare_parameters.json",
            "Sets of additional parameters side by side.",
            COMPARE_PARAMETERS,
            "with additional parameters auto",
        ),
        content(
            "compare_parameters.json",
            "Sets of additional parameters side by side.",
            COMPARE_PARAMETERS,
            place="folder of compare-parameters",
        ),
    )
