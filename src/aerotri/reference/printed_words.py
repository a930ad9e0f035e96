"""Words in the lines that commands print: what each means."""

from __future__ import annotations

from aerotri.reference.words import Word

VOLUME, DEFORM, COMPARE, DTM = "aerotri volume", "aerotri deform", "aerotri compare", "aerotri dtm"
PRINTED_WORDS = (
    Word("σ", "all commands", "Standard deviation: in two of three cases the error is smaller."),
    Word("1 σ", "all commands", "The number after ± is one standard deviation; 95 % of all cases lie within twice it."),
    Word(
        "σ0", "aerotri adjust",
        "Standard deviation of unit weight: the size of the residuals against the stated σ, 1 where they agree. It is "
        "sigma0 in adjustment.json.",
        "Above 1: look for wrong measurements, or state a larger σ. Below 1: the measurements are better than stated.",
    ),
    Word("RMS", "all commands", "Root mean square: the root of the mean of the squares of some differences."),
    Word(
        "RMSE", "all commands",
        "Root mean square error: the RMS of the differences from values that are taken as true.",
    ),
    Word(
        "RMSE_H", "aerotri adjust",
        "Horizontal root mean square error at the check points, √(RMSE_X² + RMSE_Y²), with the error of their survey: "
        "RMSE = √(RMS² + survey²) by coordinate (ASPRS, edition 2). Without it the number is called in plan.",
    ),
    Word(
        "RMSE_V", "aerotri adjust",
        "Vertical root mean square error at the check points, with the error of their survey: √(RMS_Z² + survey²).",
    ),
    Word(
        "RMSE_3D", "aerotri accuracy", "Root mean square error in space: √(RMSE_H² + RMSE_V²), with the survey error.",
    ),
    Word("NVA", "aerotri accuracy", "Vertical accuracy outside vegetation: RMSE_V of the check points on open ground."),
    Word("VVA", "aerotri accuracy", "Vertical accuracy in vegetation: RMSE_V of the check points named as vegetated."),
    Word(
        "class reached", "aerotri accuracy",
        "The accuracy class that the check points show: their RMSE rounded up to a millimetre.",
        "To claim a class, its check and control points have to be surveyed to half of it as well.",
    ),
    Word(
        "redundancy", "aerotri adjust",
        "Observations less unknowns: what tests the measurements. With none an error cannot be seen.",
    ),
    Word("observations", "aerotri adjust", "Measured numbers in the adjustment; an image point counts twice, x and y."),
    Word("unknowns", "aerotri adjust", "Numbers that the adjustment determines: orientations, points, parameters."),
    Word("ray", "aerotri adjust", "An image point: the measurement of a point in one photograph."),
    Word("left out", "aerotri adjust", "Image points that took no part; residuals.parquet says why, in status."),
    Word(
        "removed", "aerotri adjust",
        "Additional parameters that were not significant or too highly correlated; see parameter_selection.",
    ),
    Word(
        "free", "aerotri adjust --check-free",
        "The block adjusted without control and positions, to see whether the tie points fit one another.",
    ),
    Word("GSD", "all commands", "Ground sampling distance: the size of a pixel on the ground, m."),
    Word("net", VOLUME, "Cut less fill, m³: the volume above the base less the volume below it. It is net_m3."),
    Word("cut", VOLUME, "Volume of what lies above the base, m³: what would have to be removed. It is cut_m3."),
    Word("fill", VOLUME, "Volume of what is missing up to the base, m³: what would have to be added. It is fill_m3."),
    Word("prisms", VOLUME, "Method: prisms over triangles between the heights, from the base up to the surface."),
    Word("grid", VOLUME, "Method: the height of every raster cell above the base, times its area inside the boundary."),
    Word("trapezoidal", VOLUME, "Method: areas of cross sections, joined by straight lines."),
    Word("simpson", VOLUME, "Method: areas of cross sections, three at a time joined by a parabola."),
    Word("simpson38", VOLUME, "Method: areas of cross sections, four at a time joined by a cubic (3/8 rule)."),
    Word("base", VOLUME, "Surface from which the volume counts: a plane, a height or another surface (--base)."),
    Word(
        "σ by part", VOLUME,
        "What the standard deviation of the volume comes from, each cause alone; their squares add up to its square.",
    ),
    Word(
        "systematic", VOLUME,
        "What systematic image errors add to the volume where the photographs are used uncorrected.",
        "Correct the photographs (aerotri imgeo) or the DEM (aerotri demcor).",
    ),
    Word(
        "straight lines", VOLUME,
        "The surface between two measured heights is taken as straight. What the ground has beyond is estimated from "
        "its roughness.",
    ),
    Word("node", DEFORM, "Place of a regular grid on the ground, at which something is computed."),
    Word("seam", DEFORM, "Line where two neighbouring stereo models meet; a step there is a difference of their dZ."),
    Word("end lap", DEFORM, "Share of a photograph that the next one of the strip covers too."),
    Word("h/b", DEFORM, "Height-to-base ratio: flying height over the distance of the two photographs."),
    Word("x-parallax", DEFORM, "Difference of the image coordinates of a point along the base; it gives the height."),
    Word("median", COMPARE, "Half of the differences are smaller, half are larger."),
    Word(
        "largest", COMPARE, "The largest difference, without its sign.",
    ),
    Word("picket", DTM, "A point of the ground measured by image matching."),
    Word("raster", DTM, "The regular cells of the heights that are written, interpolated between the pickets."),
    Word("hole", DTM, "A place of the grid where no height could be measured."),
    Word("parallax", DTM, "Difference of where a point is measured and where the other photographs place it, px."),
    Word("y-parallax", "aerotri dsm", "Shift of one photograph of a pair against the other across their base, px."),
)  # fmt: skip
"""With the command that prints the word; columns and JSON keys of the same name are entries of their own."""
