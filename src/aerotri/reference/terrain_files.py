"""What dtm, dsm, compare and volume write."""

from __future__ import annotations

from aerotri.reference.head import ADJUSTED, ARGUMENTS, BLOCK, HEAD
from aerotri.reference.image_error_files import MODELS
from aerotri.reference.records import DescribedFile, Item, of_axes
from aerotri.terrain.picket_status import TEXTS, PicketStatus
from aerotri.volume.accuracy import BRIDGED, LASTING, MODEL, PARTS
from aerotri.volume.settings import METHODS

DTM, DSM, COMPARE, VOLUME = (f"folder of {name}" for name in ("dtm", "dsm", "compare", "volume"))
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
METHOD_WORDS = dict(
    zip(
        METHODS,
        (
            "prisms of triangles",
            "cells of the grid",
            "cross sections, trapezoidal rule",
            "cross sections, Simpson's rule",
            "cross sections, Simpson's 3/8 rule",
        ),
        strict=True,
    )
)
VOLUMES = (
    ("cut_m3", "Volume above the base.", "m³"),
    ("fill_m3", "Volume below the base.", "m³"),
    ("net_m3", "Cut less fill.", "m³"),
    ("cut_area_m2", "Area above the base.", "m²"),
    ("fill_area_m2", "Area below the base.", "m²"),
    ("no_data_area_m2", "Area without heights inside the boundary.", "m²"),
)
PART_WORDS = dict(
    zip(
        PARTS,
        (
            "the adjustment: all heights together are wrong",
            "image matching",
            "the ground between the measured points",
            "the base",
            "the boundary",
        ),
        strict=True,
    )
)


def _mass(of: str) -> tuple[Item, ...]:
    """Keys of the tonnes of a volume."""
    return (
        Item(f"{of}.density_t_per_m3", "number", "Density as stated.", "t/m³"),
        Item(f"{of}.s_density_t_per_m3", "number", "Its standard deviation.", "t/m³"),
        Item(f"{of}.cut_t", "number", "Tonnes above the base.", "t"),
        Item(f"{of}.fill_t", "number", "Tonnes below the base.", "t"),
        Item(f"{of}.net_t", "number", "Tonnes above less tonnes below.", "t"),
        Item(f"{of}.sigma_t", "number?", "Standard deviation of net_t; null without --adjustment.", "t"),
        Item(
            f"{of}.stated_sigma_t", "number?",
            "What the stated σ of density, base and boundary alone make of it; null with --adjustment, or where none "
            "is stated.", "t",
        ),
    )  # fmt: skip


def _parts(of: str) -> list[Item]:
    """The parts of the standard deviation of a volume."""
    return [
        *(Item(f"{of}.{name}", "number", f"Part of {what}.", "m³") for name, what in PART_WORDS.items()),
        Item(
            f"{of}.{MODEL}",
            "number",
            "Part of image errors that noise does not explain: errors that photographs of one strip, or of another "
            "group, have in common, and errors of the camera that the additional parameters leave. Only where the "
            "residuals of the adjustment show such errors.",
            "m³",
            optional=True,
        ),
        Item(
            f"{of}.{LASTING}",
            "number",
            "Part of matching errors that neighbouring cells of a dense surface share, so that they do not average "
            "out. Only of dense surfaces.",
            "m³",
            optional=True,
        ),
        Item(
            f"{of}.{BRIDGED}",
            "number",
            "Part of ground that is bridged below objects: all cells of a bridged patch are taken to err together. "
            "Only of the ground of a dense surface (dtm.tif of `dsm --ground`).",
            "m³",
            optional=True,
        ),
    ]


def _side(of: str, name: str) -> tuple[Item, ...]:
    """σ of a cut or of a fill."""
    return (
        Item(of, "object", f"How sure the {name} is."),
        Item(f"{of}.sigma_m3", "number", f"Standard deviation of the {name}.", "m³"),
        Item(f"{of}.parts_m3", "object", "The parts of it, each alone.", "m³"),
        *_parts(f"{of}.parts_m3"),
        Item(
            f"{of}.parts_m3.zero_line", "number",
            "Part of the line between cut and fill: errors move it, and noise alone makes both larger. 0 where the "
            "base does not cut the surface.", "m³",
        ),
        Item(f"{of}.beyond", "object", "What it is expected to hold beyond what the surface shows."),
        Item(f"{of}.beyond.meaning", "text", "What it is, in words."),
        Item(f"{of}.beyond.value_m3", "number", "Its expected size.", "m³"),
    )  # fmt: skip


VOLUME_JSON = (
    *HEAD,
    Item("dtm", "text", "File of the surface."),
    Item("base", "object", "The base."),
    Item("base.name", "text", "What it is, in words."),
    Item("base.z0_m", "number", "Of a plane: height at x0, y0.", "m", optional=True),
    Item("base.x0_m", "number", "Of a plane: X of its point.", "m", optional=True),
    Item("base.y0_m", "number", "Of a plane: Y of its point.", "m", optional=True),
    Item("base.slope_x", "number", "Of a plane: slope along X.", "m/m", optional=True),
    Item("base.slope_y", "number", "Of a plane: slope along Y.", "m/m", optional=True),
    *ARGUMENTS,
    Item("boundary", "object", "The boundary."),
    Item("boundary.name", "text", "File or text it comes from."),
    Item("boundary.polygon", "text", "Name that the file gives its only polygon; else empty."),
    Item("boundary.area_m2", "number", "Area inside.", "m²"),
    Item("method", "text", "The method that counts."),
    *(Item(name, "number", text, unit) for name, text, unit in VOLUMES),
    Item("mean_thickness_m", "number", "Net volume over area.", "m"),
    Item("lowest_m", "number?", "Smallest thickness.", "m"),
    Item("highest_m", "number?", "Largest thickness.", "m"),
    Item("methods[]", "object", "The volume by every method."),
    Item("methods[].method", "text", "The method."),
    *(Item(f"methods[].{name}", "number", text, unit) for name, text, unit in VOLUMES),
    Item("methods[].note", "text", "What to bear in mind; else empty."),
    Item("sections", "object", "The cross sections."),
    Item("sections.spacing_m", "number", "Distance between them.", "m"),
    Item("sections.azimuth_deg", "number", "Direction in which they follow one another, from north.", "deg"),
    Item("sections.count", "whole", "Their number."),
    Item("sigma", "object?", "How sure the net volume is; null without --adjustment."),
    Item("sigma.sigma_m3", "number", "Standard deviation of the net volume.", "m³"),
    Item("sigma.sigma_mean_height_m", "number", "The same over the area: of the mean height.", "m"),
    Item("sigma.parts_m3", "object", "The parts of the standard deviation, each alone.", "m³"),
    *_parts("sigma.parts_m3"),
    *(item for name in ("cut", "fill") for item in _side(f"sigma.{name}", name)),
    Item("sigma.curvature", "object?", "Terrain between the measured points, listed separately; null where not known."),
    Item("sigma.curvature.meaning", "text", "What it is, in words."),
    Item("sigma.curvature.in_the_volume", "yes/no", "Whether the volume contains it."),
    Item("sigma.curvature.value_m3", "number", "Its expected size.", "m³"),
    Item("sigma.curvature.sigma_m3", "number", "Standard deviation of it.", "m³"),
    Item("sigma.systematic", "object", "What systematic image errors add, were the photographs used uncorrected."),
    Item("sigma.systematic.meaning", "text", "What it is, in words."),
    Item("sigma.systematic.in_the_volume", "yes/no", "Whether the volume contains it (--uncorrected)."),
    Item("sigma.systematic.variants[]", "object", "One entry a way of orienting the photographs."),
    Item(
        "sigma.systematic.variants[].variant",
        "text",
        "Orientation.",
        values={"free": "with additional parameters", "absorbed": "without them"},
    ),
    Item("sigma.systematic.variants[].value_m3", "number", "Wrong minus true volume.", "m³"),
    Item("sigma.systematic.variants[].sigma_m3", "number", "Standard deviation of it.", "m³"),
    Item("sigma.pickets", "whole", "Measured points behind the volume."),
    Item("sigma.rays", "whole", "Image points behind them."),
    Item("sigma.adjustment", "text", "Folder of the adjustment."),
    Item("sigma.picket_file", "text", "File of the points; empty where every cell was taken for one."),
    Item(
        "stated_sigma",
        "object?",
        "Without --adjustment: what the σ stated of base and boundary make of σ of the "
        "net volume, without the errors of the surface; null with --adjustment, or where none is stated.",
    ),
    Item("stated_sigma.meaning", "text", "What it is, in words."),
    Item("stated_sigma.sigma_m3", "number", "Both together.", "m³"),
    Item("stated_sigma.parts_m3", "object", "The parts, each alone.", "m³"),
    Item("stated_sigma.parts_m3.base", "number", "Part of the base.", "m³"),
    Item("stated_sigma.parts_m3.boundary", "number", "Part of the boundary.", "m³"),
    Item("mass", "object?", "Tonnes of the volume; null without --density."),
    *_mass("mass"),
    Item("piles[]", "object", "Every polygon by itself; empty where the boundary is one polygon."),
    Item(
        "piles[].name",
        "text",
        "Its name: attribute name, pile, label or title; else the first one that is a text and "
        "different for all; else its number in the file.",
    ),
    Item("piles[].area_m2", "number", "Area inside.", "m²"),
    Item("piles[].base", "text", "Its base, in words."),
    *(Item(f"piles[].{name}", "number", text, unit) for name, text, unit in VOLUMES),
    Item("piles[].sigma_m3", "number?", "Standard deviation of its net volume; null without --adjustment.", "m³"),
    Item("piles[].sigma_cut_m3", "number?", "The same of its cut.", "m³"),
    Item("piles[].sigma_fill_m3", "number?", "The same of its fill.", "m³"),
    Item("piles[].parts_m3", "object?", "The parts of it, each alone.", "m³"),
    *_parts("piles[].parts_m3"),
    Item("piles[].stated_sigma_m3", "number?", "As stated_sigma.sigma_m3, of the pile.", "m³"),
    Item("piles[].mass", "object?", "Its tonnes; null without --density."),
    *_mass("piles[].mass"),
    Item("warnings[]", "text", "Sentences to read."),
)
PILES = (
    Item("name", "text", "The pile; the last row is all together."),
    Item("area_m2", "number", "Area inside.", "m²"),
    Item("cut_m3", "number", "Volume above the base.", "m³"),
    Item("sigma_cut_m3", "number?", "Standard deviation of the cut.", "m³"),
    Item("fill_m3", "number", "Volume below the base.", "m³"),
    Item("sigma_fill_m3", "number?", "Standard deviation of the fill.", "m³"),
    Item("net_m3", "number", "Cut less fill.", "m³"),
    Item("sigma_m3", "number?", "Standard deviation of the net volume.", "m³"),
    Item("no_data_area_m2", "number", "Area without heights.", "m²"),
    Item("net_t", "number?", "Tonnes of the net volume.", "t"),
    Item("sigma_t", "number?", "Their standard deviation.", "t"),
)
SECTIONS = (
    Item("station_m", "number", "Place of the cross section along the azimuth.", "m"),
    Item("cut_area_m2", "number", "Its area above the base.", "m²"),
    Item("fill_area_m2", "number", "Its area below the base.", "m²"),
    Item("cut_length_m", "number", "Its length above the base.", "m"),
    Item("fill_length_m", "number", "Its length below the base.", "m"),
    Item("no_data_length_m", "number", "Its length without heights.", "m"),
)


def terrain_files() -> tuple[DescribedFile, ...]:
    """The files of dtm, dsm, compare and volume."""
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
        DescribedFile("volume.json", VOLUME, "json", "The volume, and how sure it is.", VOLUME_JSON),
        DescribedFile("thickness.tif", VOLUME, "raster", "Surface less base inside the boundary, m."),
        DescribedFile("sections.csv", VOLUME, "table", "The cross sections.", SECTIONS),
        DescribedFile("piles.csv", VOLUME, "table", "Every pile, and all together.", PILES, "with several polygons"),
        DescribedFile("plots", VOLUME, "folder", "Thickness, parts of σ, cross sections, PNG and SVG.", when=plots),
        DescribedFile("volume.html", VOLUME, "page", "The volume on one page.", when=plots),
    )
