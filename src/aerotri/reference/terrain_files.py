"""What dtm, dsm and compare write."""

from __future__ import annotations

from aerotri.reference.head import ADJUSTED, ARGUMENTS, BLOCK, HEAD
from aerotri.reference.image_error_files import MODELS
from aerotri.reference.records import DescribedFile, Item, of_axes
from aerotri.terrain.picket_status import TEXTS, PicketStatus

DTM, DSM, COMPARE = (f"folder of {name}" for name in ("dtm", "dsm", "compare"))
PICKET_STATUS = {
    PicketStatus.ACCEPTED: "a ground point",
    PicketStatus.NOT_SEEN: "fewer than two photographs see the place",
    PicketStatus.LOW_CORRELATION: "the photographs do not look alike there",
    PicketStatus.AT_END: "the best match is at the end of the heights searched",
    PicketStatus.NO_TEXTURE: "nothing to match along the base",
    PicketStatus.BACKWARD: "matching back leads to another place",
    PicketStatus.AMBIGUOUS: "another place matches nearly as well",
    PicketStatus.NEIGHBOURS: "its height contradicts its neighbours",
    PicketStatus.PEAK: "it stands out as a lone peak or pit",
}
STATUS_WORDS = {TEXTS[status]: meaning for status, meaning in PICKET_STATUS.items()}

PICKETS = (
    *of_axes("node_{}", "number", "{} of the place where a point was planned.", "m", ("X", "Y")),
    *of_axes("{}", "number?", "Measured {}; empty where nothing was measured.", "m"),
    *of_axes("s{}", "number?", "Standard deviation of {}: matching and adjustment together.", "m"),
    *of_axes("s{}_matching", "number?", "Standard deviation of {} from matching alone.", "m"),
    Item("correlation", "number?", "Lowest correlation of its photographs, or the best that was found; 1 is equal."),
    Item("rays", "whole", "Number of photographs it was measured in."),
    Item("photographs", "list of text", "Names of these photographs; the others were matched to the first."),
    Item("status", "text", "What became of it.", values=STATUS_WORDS),
    Item("steps_aside", "whole", "How often it was moved because its first place could not be measured."),
    Item("model", "whole", "Number of the pair of photographs, −1 where all photographs were used."),
)
CLOUD = (
    *of_axes("Normal{}", "number", "{} of the normal of the surface there, which has length 1 and points upwards."),
    *(Item(f"sigma_{a}", "number", f"Standard deviation of {a.upper()}, from the adjustment.", "m") for a in "xy"),
    Item("sigma_z", "number", "Standard deviation of Z: matching and adjustment together.", "m"),
    *(
        Item(f"cov_{a}{b}", "number", f"Covariance of {a.upper()} and {b.upper()}, from the adjustment.", "m²")
        for a, b in ("xy", "xz", "yz")
    ),
    Item("sigma_z_matching", "number", "Standard deviation of Z from matching alone.", "m"),
    Item("photographs", "whole", "Number of photographs that measured the cell."),
)
"""Dimensions of dsm.laz beside those of every LAZ file."""
MISSING = (Item("photographs_missing[]", "text", "Photographs of the block that were not among the files given."),)
DTM_JSON = (
    *HEAD,
    BLOCK,
    Item("photographs", "whole", "Photographs matched."),
    *MISSING,
    Item("gsd_m", "number", "Size of a pixel on the ground.", "m"),
    Item("interval_m", "number", "Distance between the points measured (pickets).", "m"),
    Item("interval_source", "text", "Where the interval comes from."),
    Item("cell_m", "number", "Cell of the rasters.", "m"),
    Item("pickets", "object", "Number of points."),
    Item("pickets.nodes", "whole", "Places planned."),
    Item("pickets.seen", "whole", "Places that two photographs or more see."),
    Item("pickets.accepted", "whole", "Points measured and accepted."),
    Item("pickets.errors", "whole", "Points measured and rejected (error pickets)."),
    Item("pickets.stepped_aside", "whole", "Accepted points that were moved to a place nearby."),
    Item("pickets.holes", "whole", "Places where nothing could be measured."),
    Item("pickets.rays_mean", "number", "Mean number of photographs of an accepted point."),
    Item("status", "object", "Number of points by status; the words are those of pickets.parquet."),
    *(Item(f"status.{word}", "whole", f"Number of points: {meaning}.") for word, meaning in STATUS_WORDS.items()),
    Item("sigma_Z_m", "object", "Standard deviation of heights, median over the accepted points.", "m"),
    Item("sigma_Z_m.median", "number", "Of a point, all together.", "m"),
    Item("sigma_Z_m.matching", "number", "From matching alone.", "m"),
    Item("sigma_Z_m.adjustment", "number", "From the adjustment alone.", "m"),
    Item("sigma_Z_m.interpolation", "number", "Of the surface between the points, RMS.", "m"),
    Item("ray_sigma_px", "number", "Standard deviation of a matched image coordinate.", "px"),
    Item("sigma0_rays", "number", "How well the rays of a point meet, against their stated σ; 1 is as stated."),
    Item("ground_share", "number", "Share of the points that are ground, not objects."),
    Item("ground_within", "text", "Outline within which all is ground; empty where none was given."),
    Item("adjustment", "text", "Key of the adjustment; volumes tell by it what two surfaces share."),
    Item("notes[]", "text", "What was done with the input, and what σ lacks, in sentences."),
    *ARGUMENTS,
)
DSM_JSON = (
    *HEAD,
    BLOCK,
    Item("photographs", "whole", "Photographs matched."),
    *MISSING,
    Item("gsd_m", "number", "Size of a pixel on the ground.", "m"),
    Item("cell_m", "number", "Cell of the rasters.", "m"),
    Item("cells", "object", "Number of cells."),
    Item("cells.all", "whole", "Of the whole raster."),
    Item("cells.measured", "whole", "That have a height."),
    Item("area_m2", "number", "Area of the cells that have a height.", "m²"),
    Item("shown_area_m2", "number", "Ground that pairs of photographs show under an angle that can be matched.", "m²"),
    Item("coverage", "number", "Share of that ground that has heights, 0 to 1."),
    Item("pairs", "whole", "Pairs of photographs that were matched."),
    Item("tiles", "whole", "Pieces the surface was measured in."),
    Item("tiles_resumed", "whole", "Pieces that an earlier run, which was ended, had measured."),
    Item("photographs_mean", "number", "Mean number of photographs of a cell."),
    Item("sigma_Z_m", "object", "Standard deviation of heights, median over the cells.", "m"),
    Item("sigma_Z_m.median", "number", "Of a cell, all together.", "m"),
    Item("sigma_Z_m.matching", "number", "From matching alone.", "m"),
    Item("sigma_Z_m.adjustment", "number", "From the adjustment alone, which neighbouring cells share.", "m"),
    Item(
        "sigma_Z_m.relative",
        "number",
        "Of a cell relative to the whole surface: after a similarity (shift, rotation, "
        "scale) of it; for shape and volumes.",
        "m",
    ),
    Item("sigma_Z_m.adjustment_relative", "number", "The part of it that comes from the adjustment.", "m"),
    Item(
        "noise_length_m",
        "number?",
        "Side of the square whose cells have one noise, as neighbours share it; null where no two pairs overlap.",
        "m",
    ),
    Item(
        "matching_shared", "object", "Errors of the matching that neighbouring cells share and that do not average out."
    ),
    Item(
        "matching_shared.sigma_Z_m",
        "number",
        "Standard deviation of a height by them; it is part of that of matching.",
        "m",
    ),
    Item("matching_shared.length_m", "number", "Distance over which their correlation falls to 1/e.", "m"),
    Item("matching_shared.parallax_px", "number", "Their RMS as a parallax.", "px"),
    Item("y_parallax_px", "object", "Shift across the base of a pair, its median over a tile, without sign.", "px"),
    Item("y_parallax_px.median", "number", "Median of the pairs.", "px"),
    Item("y_parallax_px.largest", "number", "Largest of the pairs.", "px"),
    Item("ground", "object?", "The ground without objects; null without --ground."),
    Item("ground.measured", "whole", "Cells of the surface that are ground."),
    Item("ground.bridged", "whole", "Cells that are bridged from the ground around them."),
    Item("ground.widest_object_m", "number", "Width of the widest object that was taken off.", "m"),
    Item("ground.bridge", "object", "Error of a bridge: sigma_at_1_m · distance^power, m, distance from the ground."),
    Item("ground.bridge.sigma_at_1_m", "number", "RMS error one metre from the ground.", "m"),
    Item("ground.bridge.power", "number", "Power by which it grows with the distance."),
    Item("ground.bridge.discs", "whole", "Discs of ground that were taken out, bridged and compared to find it."),
    Item("adjustment", "text", "Key of the adjustment; volumes tell by it what two surfaces share."),
    *ADJUSTED,
    Item("notes[]", "text", "What was done with the input, and what σ lacks, in sentences."),
    *ARGUMENTS,
)
DIFFERENCE = (
    ("count", "whole", "Number of cells compared.", ""),
    ("rmse", "number", "Root mean square difference.", "m"),
    ("bias", "number", "Mean difference.", "m"),
    ("median", "number", "Median difference.", "m"),
    ("std", "number", "Standard deviation of the differences.", "m"),
    ("nmad", "number", "Standard deviation without gross errors (NMAD).", "m"),
    ("le90", "number", "90 % of the differences are smaller, without sign (LE90).", "m"),
    ("max", "number", "Largest difference, without sign.", "m"),
)
COMPARE_JSON = (
    *HEAD,
    Item("test", "text", "The surface that is judged."),
    Item("control", "text", "The surface it is held against."),
    Item("method", "text", "Interpolation of both.", values={"linear": "", "spline": ""}),
    Item("cell_m", "number", "Cell of the differences.", "m"),
    Item("difference_m", "object", "Statistics of the differences test − control.", "m"),
    *(Item(f"difference_m.{name}", kind, text, unit) for name, kind, text, unit in DIFFERENCE),  # pyright: ignore[reportArgumentType]
    Item("coverage", "number", "Share of the control surface that the test surface covers, 0 to 1."),
    Item("alignment", "object?", "How the test surface was moved before; null where it was not."),
    Item(
        "alignment.kind",
        "text",
        "Kind of movement.",
        values={"shift": "shift in X, Y, Z", "rigid": "shift and rotation"},
    ),
    Item("alignment.shift_m[]", "number", "Shift in X, Y, Z.", "m"),
    Item("alignment.rotation_rad[]", "number", "Rotation about X, Y, Z.", "rad"),
    Item("alignment.about_m[]", "number", "Point of the rotation.", "m"),
    Item(
        "sigma_bias_m",
        "number?",
        "Standard deviation of the mean difference: cells of one noise count once, and `matching_shared_m` is in it.",
        "m",
    ),
    Item(
        "matching_shared_m",
        "number",
        "The part of errors that neighbouring cells of dense surfaces share; 0 for other surfaces, and with `align`.",
        "m",
    ),
    Item("noise_length_m", "number?", "Side of the square whose cells share one noise; null where too few tell.", "m"),
    *ARGUMENTS,
)


def terrain_files() -> tuple[DescribedFile, ...]:
    """The files of dtm, dsm and compare."""
    pairs, plots, ground = "with --pairs", "unless --no-plots", "with --ground"
    return (
        DescribedFile("dtm.json", DTM, "json", "Number and accuracy of the ground points.", DTM_JSON),
        DescribedFile(
            "pickets.parquet",
            DTM,
            "table",
            "Ground points measured by image matching (pickets), and the rejected ones.",
            PICKETS,
        ),
        DescribedFile(
            "pickets.laz",
            DTM,
            "cloud",
            "The accepted points as LAZ 1.4; class 2 is ground. It has sigma_z besides.",
            (Item("sigma_z", "number", "Standard deviation of Z: matching and adjustment together.", "m"),),
        ),
        DescribedFile(
            "dsm.tif", DTM, "raster", "Surface with objects: band 1 height, band 2 its standard deviation, m."
        ),
        DescribedFile(
            "dtm.tif", DTM, "raster", "Surface without objects: band 1 height, band 2 its standard deviation, m."
        ),
        DescribedFile("model.tif", DTM, "raster", "Number of the pair of photographs of every cell.", when=pairs),
        DescribedFile("models.csv", DTM, "table", "The pairs by their numbers.", MODELS, pairs),
        DescribedFile("plots", DTM, "folder", "Surface, its σ and points, PNG and SVG.", when=plots),
        DescribedFile("dsm.json", DSM, "json", "Cells of the surface and how sure they are.", DSM_JSON),
        DescribedFile("dsm.tif", DSM, "raster", "The whole surface: band 1 height, band 2 its standard deviation, m."),
        DescribedFile("matching.tif", DSM, "raster", "Standard deviation of the heights from matching alone, m."),
        DescribedFile("photographs.tif", DSM, "raster", "Number of photographs that measured a cell; 0: none."),
        DescribedFile(
            "dtm.tif",
            DSM,
            "raster",
            "Ground without objects: band 1 height, band 2 its standard deviation, m.",
            when=ground,
        ),
        DescribedFile(
            "ground.tif",
            DSM,
            "raster",
            "Where a height of dtm.tif comes from: 1 measured, 2 bridged, 0 none.",
            when=ground,
        ),
        DescribedFile(
            "dsm.laz",
            DSM,
            "cloud",
            "The cells as COPC 1.0, which is LAZ 1.4, with colours. Class 2 is ground. Besides every point has "
            "its normal, σ and covariances.",
            CLOUD,
        ),
        DescribedFile(
            "plots",
            DSM,
            "folder",
            "The surface, its colours, its standard deviation and the number of photographs, PNG and SVG.",
            when=plots,
        ),
        DescribedFile("dsm.html", DSM, "page", "The surface on one page.", when=plots),
        DescribedFile("compare.json", COMPARE, "json", "Statistics of the differences of two surfaces.", COMPARE_JSON),
        DescribedFile("difference.tif", COMPARE, "raster", "Differences test − control, m."),
        DescribedFile("plots", COMPARE, "folder", "Map and histogram, PNG and SVG.", when=plots),
    )
