"""What `aerotri halves` writes."""

from __future__ import annotations

from aerotri.reference.head import ARGUMENTS, HEAD
from aerotri.reference.records import DescribedFile, Item, of_axes, within
from aerotri.results.halves import DIVISIONS

PLACE = "folder of halves"
DIVISION = Item("division", "text", "How the photographs were divided.", values=DIVISIONS)
TEST = (
    Item("of", "text", "What is compared."),
    Item("statistic", "number", "Quadratic form of the differences over its degrees of freedom; 1 by noise alone."),
    Item("freedom", "whole", "Degrees of freedom: independent differences."),
    Item("redundancy", "number", "Redundancy of both halves together."),
    Item("p_statistic", "number", "Probability of so large a statistic by noise alone."),
    Item("rms_z", "number", "Root mean square of difference over σ."),
    Item("p_rms", "number", "Probability of so large a root mean square by noise alone, correlations considered."),
    Item("p", "number", "Both probabilities together: twice the smaller one."),
    Item("differs", "yes/no", "Whether the halves differ by more than noise: p below alpha."),
    Item("factor", "number", "By how much the differences exceed what σ says."),
    Item("max_z", "number", "Largest difference over σ."),
    Item("expected_max_z", "number", "Mean of that by noise alone."),
    Item("usual_max_z", "number", "What noise alone exceeds in one case of twenty."),
)
HALVES = (
    *HEAD,
    Item("block", "text", "Name of the block."),
    Item("alpha", "number", "Probability below which a test says that the halves differ."),
    Item("robust", "text", "Robust estimator of the result; its final weights stay."),
    Item("found[]", "text", "Divisions whose halves differ.", values=DIVISIONS),
    Item("conclusion[]", "text", "What all divisions say together and what to do, a sentence each."),
    Item("divisions[]", "object", "One entry a division."),
    *within(
        "divisions[]",
        DIVISION,
        Item("text", "text", "The division in words."),
        Item("halves[]", "object", "The two halves."),
        *within(
            "halves[]",
            Item("name", "text", "What it consists of."),
            Item("photographs", "whole", "Photographs adjusted."),
            Item("points", "whole", "Object points adjusted."),
            Item("sigma0", "number?", "σ0 of the half; null where it was not adjusted."),
            Item("loose[]", "text", "Photographs not tied to the others of the half, left out."),
        ),
        Item("reason", "text", "Why the block cannot be divided so; empty where it can."),
        Item("same_as", "text", "An earlier division with the same halves; empty where there is none."),
        Item("sentence", "text", "The outcome in a sentence."),
        Item("notes[]", "text", "How it was done."),
        Item("sigma0", "number?", "σ0 of both halves together; null where they were not compared."),
        Item("transformed", "yes/no", "Whether one half was first transformed onto the other with seven parameters."),
        Item("differs", "yes/no", "Whether a test says that the halves differ."),
        Item("tests[]", "object", "One entry a test."),
        *within("tests[]", *TEST),
        Item("image_errors[]", "object", "Difference of the image errors, one entry a group of photographs."),
        *within(
            "image_errors[]",
            Item("group", "text", "Group of photographs with common parameters."),
            Item("camera", "text", "Camera."),
            Item("rms_um", "number", "Root mean square length of the differences.", "µm"),
            Item("rms_of_sigma_um", "number", "The length that σ lets expect.", "µm"),
        ),
        Item("parameters[]", "object", "Interior orientation and additional parameters of both halves."),
        *within(
            "parameters[]",
            Item("name", "text", "Name of the parameter."),
            Item("group", "text", "Camera or group it belongs to."),
            Item("first", "number?", "Value in the first half."),
            Item("second", "number?", "Value in the second half."),
            Item("sigma", "number?", "Standard deviation of the difference."),
            Item("z", "number?", "Difference over its standard deviation."),
        ),
        Item("points", "object?", "Ground points that both halves have; null where they were not compared."),
        *within(
            "points",
            Item("count", "whole", "Points in common."),
            Item("cells", "whole", "Cells in plan."),
            Item("cell_m", "number", "Side of a cell.", "m"),
            Item("rms", "object", "Root mean square of the mean differences of the cells.", "m"),
            *of_axes("rms.{}", "number?", "The same in {}.", "m"),
            Item("rms_of_sigma", "object", "What σ lets expect.", "m"),
            *of_axes("rms_of_sigma.{}", "number?", "The same in {}.", "m"),
        ),
    ),
    *ARGUMENTS,
)
IMAGE_CELLS = (
    DIVISION,
    Item("group", "text", "Group of photographs with common parameters."),
    Item("camera", "text", "Camera."),
    Item("x", "number", "Middle of the cell, x in the image.", "mm"),
    Item("y", "number", "Middle of the cell, y in the image.", "mm"),
    Item("dx", "number", "Difference of the image errors in x, first half − second half.", "µm"),
    Item("dy", "number", "Difference of the image errors in y, first half − second half.", "µm"),
    Item("s_dx", "number", "Standard deviation of dx.", "µm"),
    Item("s_dy", "number", "Standard deviation of dy.", "µm"),
    Item("z_x", "number", "dx over its standard deviation."),
    Item("z_y", "number", "dy over its standard deviation."),
)
GROUND_CELLS = (
    DIVISION,
    *of_axes("{}", "number", "{} of the middle of the cell.", "m", "XY"),
    Item("points", "whole", "Points in the cell."),
    *of_axes("d{}", "number", "Weighted mean difference of {}, first half − second half.", "m"),
    *of_axes("s_d{}", "number", "Standard deviation of d{}.", "m"),
    *of_axes("z_{}", "number", "d{} over its standard deviation."),
)
GROUND_POINTS = (
    DIVISION,
    Item("point", "text", "Name of the point."),
    *of_axes("{}", "number", "{} in the result of all photographs.", "m"),
    *of_axes("d{}", "number", "Difference of {}, first half − second half.", "m"),
    *of_axes("s_d{}", "number", "Standard deviation of d{}.", "m"),
)


def halves_files() -> tuple[DescribedFile, ...]:
    """The files of the folder."""
    return (
        DescribedFile("halves.json", PLACE, "json", "Two halves of the block adjusted apart and compared.", HALVES),
        DescribedFile("image_cells.csv", PLACE, "table", "Differences of the image errors by cell of the format.",
                      IMAGE_CELLS),
        DescribedFile("ground_cells.csv", PLACE, "table", "Mean differences of the ground points by cell in plan.",
                      GROUND_CELLS),
        DescribedFile("ground_points.csv", PLACE, "table", "Differences of the ground points.", GROUND_POINTS),
        DescribedFile("plots", PLACE, "folder", "Image errors and heights of every division, PNG and SVG."),
    )  # fmt: skip
