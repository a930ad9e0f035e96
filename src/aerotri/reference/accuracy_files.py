"""What `aerotri accuracy` writes."""

from __future__ import annotations

from aerotri.reference.head import ARGUMENTS, BLOCK, HEAD
from aerotri.reference.records import DescribedFile, Item, of_axes, within

PLACE = "folder of accuracy"
OUTCOMES = {
    "met": "What was found keeps it.",
    "not met": "What was found does not keep it.",
    "cannot be said": "Something is missing to tell; says names it.",
}
ACCURACY = (
    *HEAD,
    BLOCK,
    Item("verdict", "text", "Verdict of the adjustment."),
    Item("standard", "text", "The standard whose requirements are listed."),
    Item("met", "text", "All that is required taken together.", values=OUTCOMES),
    Item("asked", "object", "The classes asked for."),
    Item("asked.horizontal", "number?", "Largest RMSE_H allowed; null where nothing is asked for.", "m"),
    Item("asked.vertical", "number?", "Largest RMSE_V allowed; null where nothing is asked for.", "m"),
    Item("reached", "object", "The classes reached: the RMSE rounded up to a millimetre."),
    Item("reached.horizontal", "number?", "In plan; null without check points.", "m"),
    Item("reached.vertical", "number?", "In height outside vegetation; null without check points.", "m"),
    Item("accuracy", "object", "Root mean square errors with the survey error of the check points."),
    Item("accuracy.RMSE_H", "number?", "In plan: √(RMSE_X² + RMSE_Y²), survey error included.", "m"),
    Item("accuracy.RMSE_V", "number?", "In height outside vegetation (NVA).", "m"),
    Item("accuracy.VVA", "number?", "In height within vegetation; null where no check point stands there.", "m"),
    Item("accuracy.RMSE_3D", "number?", "In plan and height: √(RMSE_H² + RMSE_V²).", "m"),
    Item("inspire", "object", "The same in the measures of INSPIRE, and the data they are recommended for."),
    *within(
        "inspire",
        Item("RMSEP", "number?", "Root mean square error of planimetry, measure 47.", "m"),
        Item("RMSE_x", "number?", "Root mean square error in X, adapted from measure 39.", "m"),
        Item("RMSE_y", "number?", "Root mean square error in Y, adapted from measure 39.", "m"),
        Item("RMSE_z", "number?", "Root mean square error of heights outside vegetation, measure 39.", "m"),
        Item("grid_spacing", "number?", "Of the finest elevation grid.", "m"),
        Item("contour_interval", "number?", "Of the closest contour lines.", "m"),
        Item("scale_denominator", "number?", "Of the largest scale of vector data."),
    ),
    Item("coordinates[]", "object", "X, Y, Z outside vegetation, and Z within it."),
    *within(
        "coordinates[]",
        Item("coordinate", "text", "Which coordinate.", values={"X": "X", "Y": "Y", "Z": "height"}),
        Item("vegetated", "yes/no", "Whether these are the check points in vegetation."),
        Item("count", "whole", "Check points."),
        Item("unstated", "whole", "Check points of them without a stated survey error."),
        Item("mean", "number?", "Mean of the differences adjusted − given.", "m"),
        Item("fit", "number?", "Root mean square of the differences.", "m"),
        Item("survey", "number?", "Root mean square of the survey errors of the check points.", "m"),
        Item("rmse", "number?", "Both together: √(fit² + survey²).", "m"),
        Item("largest", "number?", "Largest difference, without sign.", "m"),
        Item("skew", "number?", "Skewness of the differences; null below eight points."),
        Item("skew_sigma", "number?", "Standard deviation of the skewness of a normal sample."),
    ),
    Item("check_points", "whole", "Check points with a difference."),
    Item("control_points", "whole", "Control points."),
    Item("project_area_km2", "number?", "Project area; null where it is not known.", "km²"),
    Item("points_for_area", "number?", "Check points recommended for it; null where it is not known."),
    Item("layout", "object?", "How the check points lie; null where the ground points span no area."),
    *within(
        "layout",
        Item("area_km2", "number", "Area within the outermost ground points.", "km²"),
        Item("corners[][]", "number", "Corners of the smallest rectangle around it: X, Y of each.", "m"),
        Item("diagonal", "number", "Diagonal of the rectangle.", "m"),
        Item("quadrants[]", "whole", "Check points in each quarter; the quarter of the first corner first."),
        Item("spacing", "number?", "Smallest distance of two check points.", "m"),
        Item("crowded[]", "text", "Check points nearer to another one than a tenth of the diagonal."),
    ),
    Item("requirements[]", "object", "One entry a requirement."),
    *within(
        "requirements[]",
        Item("name", "text", "The requirement."),
        Item("source", "text", "Where it is asked for."),
        Item("weight", "text", "Whether it must be kept.",
             values={"required": "It must be kept.", "recommended": "It should be kept."}),
        Item("asked", "text", "What is asked."),
        Item("found", "text", "What was found."),
        Item("met", "text", "Whether it is kept.", values=OUTCOMES),
        Item("says", "text", "What there is to know or to do; may be empty."),
    ),
    Item("statements[]", "text", "Sentences to report, in the words of the standard."),
    Item("warnings[]", "text", "What a reader of the numbers has to know."),
    Item("suspects[]", "object", "Errors of check points that stand out."),
    *within(
        "suspects[]",
        Item("point", "text", "Name of the point."),
        Item("coordinate", "text", "X, Y or Z."),
        Item("error", "number", "Difference adjusted − given.", "m"),
        Item("reason", "text", "Why it stands out."),
    ),
    Item("points[]", "object", "One entry a check point."),
    *within(
        "points[]",
        Item("point", "text", "Name of the point."),
        *of_axes("d{}", "number?", "Difference adjusted − given in {}.", "m"),
        *of_axes("s{}", "number?", "Survey error (standard deviation) of the given {}.", "m"),
        Item("vegetated", "yes/no", "Whether it stands in vegetation."),
    ),
    *ARGUMENTS,
)  # fmt: skip


def accuracy_files() -> tuple[DescribedFile, ...]:
    """The files of the folder."""
    return (
        DescribedFile("accuracy.json", PLACE, "json", "Accuracy by check points and every requirement.", ACCURACY),
        DescribedFile("accuracy.html", PLACE, "page", "The same as a page to print and hand over."),
    )
