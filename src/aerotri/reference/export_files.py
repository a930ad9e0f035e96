"""What `aerotri export` writes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aerotri.diagnosis.finding import GRADES
from aerotri.formats.gis.layers import ROLES
from aerotri.reference.adjust_tables import CONTROL, GROUND, IMAGES, POINTS, RESIDUALS, WORK
from aerotri.reference.head import GOOD_FOR
from aerotri.reference.records import DescribedFile, Item, of_axes, within

PLACE, LAYERS = "folder of export", "layers of result.gpkg"
ROLE = Item("role", "text", "Role of the point.", values=dict.fromkeys(ROLES, ""))
ELLIPSE = (
    Item("ellipse_a_m", "number?", "Longer semi-axis of the error ellipse in plan, one total σ.", "m"),
    Item("ellipse_b_m", "number?", "Shorter semi-axis of the error ellipse in plan, one total σ.", "m"),
    Item("ellipse_azimuth_deg", "number?", "Azimuth of the longer semi-axis, from +Y (north) towards +X.", "deg"),
)
K = Item("k", "number", "By how much it is drawn larger than it is.")
FOOTPRINTS = (
    Item("image", "text", "Name of the photograph."),
    Item("camera", "text", "Name of its camera."),
    Item("strip", "text?", "Name of its strip."),
    Item("rays", "whole", "Number of image points used."),
    Item("is_cut", "yes/no", "Whether it sees the horizon, or ground farther than six heights: cut off there."),
    Item("gsd_m", "number?", "Size of a pixel on the ground in the middle of the photograph, across the ray.", "m"),
    Item("height_m", "number?", "Height of the projection centre above the ground.", "m"),
    Item("tilt_deg", "number?", "Angle of the camera's axis off the vertical.", "deg"),
    Item("area_m2", "number", "Area of the footprint.", "m²"),
)
STRIPS = (
    Item("strip", "text", "Name of the strip; a number where it has none."),
    Item("is_named", "yes/no", "Whether the block names it; else it is found where the track turns."),
    Item("exposures", "whole", "Number of exposures in it."),
    Item("length_m", "number", "Length in plan.", "m"),
    Item("azimuth_deg", "number", "Azimuth from its first to its last exposure, from +Y (north) towards +X.", "deg"),
    Item("first", "text", "Photograph at its beginning."),
    Item("last", "text", "Photograph at its end."),
)
COMPONENT = Item(
    "component", "text", "What the line shows.",
    values={"plan": "the difference in plan", "height": "that in height, drawn northwards where too high"},
)  # fmt: skip
PLACES = (*of_axes("{}", "number?", "Adjusted {}.", "m"), K)
RESIDUAL_NAMES = ("image", "point", "x", "y", "vx", "vy", "rx", "ry", "wx", "wy", "weight", "status")
LARGEST = (
    *(next(item for item in RESIDUALS if item.name == name) for name in RESIDUAL_NAMES),
    Item("w", "number", "The larger one of its normalised residuals."),
    Item("axis", "text", "Which that is.", values={"x": "", "y": ""}),
    Item("error_px", "number?", "The measuring error that would explain it alone.", "px"),
    Item("limit", "number", "What a normalised residual exceeds with the probability adjustment.alpha only."),
    Item("beyond_limit", "yes/no", "Whether it does."),
)
FINDINGS = (
    Item("quantity", "text", "What was looked at."),
    Item("value", "text", "Its value, with its unit."),
    Item("expected", "text", "What it should be."),
    Item("says", "text", "What the comparison comes to."),
    Item("level", "text", "The light beside it.", values={"good": "", "note": "", "attention": ""}),
    Item("grade", "text", "The verdict as far as this number goes.", values=dict.fromkeys(GRADES, "")),
)
GEOMETRY = (
    Item("geometry", "text?", "The geometry as WKB, coordinates of the block's CRS.", "m"),
    Item("bbox", "object?", "Least and largest X and Y of the geometry: xmin, ymin, xmax, ymax.", "m"),
)
POINT_COLUMNS = (*POINTS, ROLE, *ELLIPSE)
STAC = (
    Item("type", "text", "Feature."),
    Item("stac_version", "text", "Version of STAC."),
    Item("stac_extensions[]", "text", "Extensions of STAC that are used."),
    Item("id", "text", "Name of the block."),
    Item("geometry", "object", "Ground that the photographs show, longitude and latitude on WGS 84 (EPSG:4326)."),
    Item("geometry.type", "text", "MultiPolygon."),
    Item("geometry.coordinates[]", "anything", "Corners of its polygons.", "deg"),
    Item("bbox[]", "number", "West, south, east, north.", "deg"),
    Item("properties", "object", "What is to be known of it."),
    *within(
        "properties",
        Item("datetime", "text?", "When it was flown where --flown has a time, null for a day; else as created. UTC."),
        Item("start_datetime", "text", "Begin of the day of the flight, UTC.", optional=True),
        Item("end_datetime", "text", "End of the day of the flight, UTC.", optional=True),
        Item("created", "text", "When the result was written, UTC."),
        Item("title", "text", "Name of the block."),
        Item("description", "text", "What it is."),
        Item("instruments[]", "text", "Cameras."),
        Item("gsd", "number", "Median size of a pixel on the ground.", "m", optional=True),
        Item("proj:code", "text?", "Coordinate system; null where plan and heights have no code together."),
        Item("proj:wkt2", "text", "The coordinate system as WKT.", optional=True),
        Item("proj:bbox[]", "number", "Smallest X and Y, largest X and Y.", "m"),
        Item("processing:software", "object", "The program."),
        Item("processing:software.aerotri", "text", "Its version."),
        Item("aerotri:verdict", "text", "accepted, doubtful or rejected."),
        Item("aerotri:good_for", "text", "What it is good for.", values=GOOD_FOR),
        Item("aerotri:reasons[]", "text", "Why it is not simply accepted."),
        Item("aerotri:sigma0", "number?", "σ0; 1 where the stated σ are right."),
        Item("aerotri:photographs", "whole", "Photographs adjusted."),
        Item("aerotri:points", "whole", "Object points adjusted."),
        Item("aerotri:control_points", "whole", "Control points."),
        Item("aerotri:check_points", "whole", "Check points."),
        *of_axes("aerotri:check_rms_{}_m", "number?", "RMS of the differences in {} at the check points.", "m"),
    ),
    Item("links[]", "text", "None."),
    Item("assets", "object", "Files of the result that are there, by name."),
    *within(
        "assets.*",
        Item("href", "text", "Its path, from the folder of the item."),
        Item("title", "text", "What it is."),
        Item("type", "text", "Media type."),
        Item("roles[]", "text", "data, metadata or overview."),
    ),
)


def export_files() -> tuple[DescribedFile, ...]:
    """The files of the folder, and the layers of result.gpkg."""
    return (
        DescribedFile("result.gpkg", PLACE, "other",
                      "GeoPackage with the layers listed below, their styles for QGIS, and a spatial index.",
                      when="with --to gpkg"),
        DescribedFile("points.parquet", PLACE, "table", "Object points as GeoParquet.",
                      (*POINT_COLUMNS, *GEOMETRY), "with --to geoparquet"),
        DescribedFile("rays.parquet", PLACE, "table",
                      "Image points as GeoParquet, lines from the projection centre to the object point.",
                      (*RESIDUALS, *GEOMETRY), "with --to geoparquet"),
        DescribedFile("item.json", PLACE, "json", "The result as an item of a STAC catalogue.", STAC, "with --to stac"),
        DescribedFile("adjustment.pdf", PLACE, "other", "Report of the adjustment.", when="with --to pdf"),
        DescribedFile("calibration.pdf", PLACE, "other", "Calibration certificate of the cameras.",
                      when="with --to pdf --document calibration"),
        DescribedFile("volume.pdf", PLACE, "other", "Certificate of a volume.",
                      when="with --to pdf, of a folder of volume"),
        DescribedFile("change.pdf", PLACE, "other", "Certificate of a change.",
                      when="with --to pdf, of a folder of change"),
        *layers(),
    )  # fmt: skip


def layers() -> tuple[DescribedFile, ...]:
    """The layers of result.gpkg."""

    def layer(name: str, text: str, items: Sequence[Item]) -> DescribedFile:
        return DescribedFile(name, LAYERS, "other", text, tuple(items))

    ellipses = tuple(replace(item, kind="number") for item in ELLIPSE)
    return (
        layer("footprints", "Polygons: where photographs lie on the ground.", FOOTPRINTS),
        layer("projection_centres", "Points: the rows of images.csv.", IMAGES),
        layer("strips", "Lines: strips.", STRIPS),
        layer("points", "Points: the rows of points.csv, with error ellipses.", POINT_COLUMNS),
        layer("error_ellipses", "Polygons: error ellipses in plan, drawn larger.",
              (Item("point", "text", "Name of the object point."), ROLE, *ellipses,
               Item("sigma_Z_m", "number?", "Total standard deviation of Z.", "m"), K)),
        layer("control_vectors", "Lines: differences at control points, drawn larger, with the columns of control.csv.",
              (COMPONENT, *CONTROL, *PLACES)),
        layer("check_vectors", "Lines: differences at check points, drawn larger, with the columns of check.csv.",
              (COMPONENT, *GROUND, *PLACES)),
        layer("largest_residuals", "Points: image points with the largest residuals, at their object points.", LARGEST),
        layer("work_list", "Points: the rows of work_list.csv, where they are.",
              (Item("number", "whole", "Place in the list."), *WORK)),
        layer("findings", "Table: the numbers that the verdict rests on.", FINDINGS),
    )  # fmt: skip


def column_texts(described: DescribedFile) -> dict[str, str]:
    """What the columns of a table or layer are, with their units, by name."""
    return {
        item.name: f"{item.text} Unit: {item.unit}." if item.unit else item.text for item in described.items
    }  # fmt: skip
