"""What `aerotri plan` writes."""

from __future__ import annotations

from aerotri.reference.head import HEAD
from aerotri.reference.records import DescribedFile, Item, within

PLACE = "folder of plan"
KINDS = {
    "asprs": "RMS of the errors in plan and in height over the area.",
    "sigma-z": "σ of Z on 95 % of the area.",
    "sigma-volume": "σ of the volume over the area.",
}
ACCURACY = within(
    "accuracy",
    Item("ground_points", "whole", "Ground points over the area."),
    Item("cell_m", "number", "Their distance, the cell of sigma_z.tif.", "m"),
    Item(
        "rmse_h_m",
        "number",
        "RMS of the errors in plan to be expected over the area; the RMSE_H of a test has the "
        "error of its check points in addition.",
        "m",
    ),
    Item("rmse_v_m", "number", "The same in height.", "m"),
    Item("sigma_z_median_m", "number", "σ of Z, median of the ground points.", "m"),
    Item("sigma_z_95_m", "number", "σ of Z that 95 % of the ground points keep.", "m"),
    Item("sigma_z_largest_m", "number", "Largest σ of Z.", "m"),
    Item("shared_z_95_m", "number", "The same as sigma_z_95_m without the noise of the single point.", "m"),
    Item("largest_mode_share", "number", "Share of that variance that one common deformation has, 0 to 1."),
    Item("sigma_volume_m3", "number", "σ of the volume over the area above a known base.", "m³"),
)
FLIGHT = within(
    "flight",
    Item("strips", "whole", "Strips."),
    Item("photographs", "whole", "Photographs."),
    Item("direction_deg", "number", "Direction of the strips, clockwise from grid north.", "deg"),
    Item("length_m", "number", "Length of the flight, straight from strip to strip.", "m"),
    Item("time_s", "number", "Time from the first exposure to the last.", "s"),
    Item("altitude_m[]", "number", "Lowest and highest altitude.", "m"),
    Item("shortest_interval_s", "number?", "Shortest time between two exposures of a strip.", "s"),
    Item("gsd_m[]", "number", "Smallest and largest GSD on the ground of the area.", "m"),
    Item("forward_overlap", "number", "Overlap in a strip on the ground, at least, 0 to 1."),
    Item("side_overlap", "number", "Overlap of strips on the ground, at least, 0 to 1."),
    Item("least_rays", "whole", "Photographs of a place of the area, at least."),
)
ASKED = within(
    "asked",
    Item("gsd_m", "number", "GSD on the mean ground.", "m"),
    Item("forward_overlap", "number", "Overlap in a strip, 0 to 0.95."),
    Item("side_overlap", "number", "Overlap of strips, 0 to 0.95."),
    Item("cross_strips", "whole", "Strips across."),
    Item("height_mode", "text", "How altitudes are chosen.", values={
        "constant": "One altitude.", "follow": "Every strip over its own mean ground."}),
    Item("rays", "whole", "Photographs of every place, at least."),
    Item("speed_m_s", "number", "Speed.", "m/s"),
    Item("turn_s", "number", "Time from a strip to the next.", "s"),
    Item("positions_sigma_m[]", "number", "σ of camera positions in plan and height; empty without.", "m"),
    Item("control_sigma_m[]", "number", "σ of control in plan and height.", "m"),
    Item("tie_points", "whole", "Image points expected in a photograph."),
    Item("tie_probability", "number", "Probability that a photograph that sees a tie point measures it."),
    Item("image_sigma_px", "number", "σ of an image coordinate.", "px"),
    Item("self_calibration", "text", "Additional parameters, as in block.toml."),
)  # fmt: skip
PLAN = (
    *HEAD,
    Item("area", "object", "Where is flown."),
    Item("area.name", "text", "File of the area."),
    Item("area.crs", "text", "Coordinate system of the plan; local where none is known."),
    Item("area.size_m2", "number", "Size.", "m²"),
    Item("area.wkt", "text", "Its polygon as WKT, in the coordinate system of the plan."),
    Item("ground", "text", "Where the heights of the ground come from."),
    Item("camera", "object", "The camera."),
    Item("camera.name", "text", "Its name."),
    Item("camera.size_px[]", "whole", "Columns and rows.", "px"),
    Item("camera.pixel_um", "number", "Size of a pixel.", "µm"),
    Item("camera.focal_length_mm", "number", "Principal distance.", "mm"),
    Item("camera.format_mm[]", "number", "Format along and across the flight.", "mm"),
    Item("asked", "object", "What was asked for and assumed."),
    *ASKED,
    Item("flight", "object", "The flight."),
    *FLIGHT,
    Item("accuracy", "object", "Accuracy to be expected."),
    *ACCURACY,
    Item("target", "object?", "The target; null without."),
    Item("target.kind", "text", "What is judged.", values=KINDS),
    Item("target.value", "number", "What was asked for, in unit."),
    Item("target.unit", "text", "Its unit."),
    Item("target.predicted", "number", "What is expected, in unit."),
    Item("target.met", "yes/no", "Whether it is met."),
    Item("piles[]", "object", "The piles, where the area or --piles has polygons of them."),
    Item("piles[].name", "text", "Name of the pile."),
    Item("piles[].area_m2", "number", "Size of the pile.", "m²"),
    Item("piles[].sigma_m3", "number", "σ of its volume to be expected from orientations and control.", "m³"),
    Item("piles[].places", "whole", "Places of the pile from which it was found."),
    Item("control[]", "object", "One entry a control point: those given, then those added in the order of their gain."),
    *within(
        "control[]",
        Item("point", "text", "Name."),
        *(Item(axis, "number", f"{axis} of the point.", "m") for axis in "XYZ"),
        Item("order", "whole", "Order in which it was added; 0 for control that was given."),
        Item("before", "number?", "What is judged without it, m or m³; null where the block then has no position."),
        Item("after", "number?", "What is judged with it, m or m³."),
    ),
    Item("warnings[]", "text", "What a reader of the plan has to know."),
)
WAYPOINTS = (
    Item("image", "text", "Name of the photograph: strip and number."),
    Item("strip", "text", "Strip; C1 and so on across the others."),
    *(Item(axis, "number", f"{axis} of the exposure.", "m") for axis in "XY"),
    Item("Z", "number", "Altitude, in the heights of the DEM.", "m"),
    Item("longitude", "number?", "On WGS 84; empty without a CRS.", "deg"),
    Item("latitude", "number?", "On WGS 84; empty without a CRS.", "deg"),
    Item("height_above_ground_m", "number", "Height over the ground below.", "m"),
    Item("heading_deg", "number", "Direction of flight, clockwise from grid north.", "deg"),
    Item("time_s", "number", "Time since the first exposure.", "s"),
)


def plan_files() -> tuple[DescribedFile, ...]:
    """The files of the folder."""
    bands = (
        "Band 1 expected σ of Z, m; band 2 the part of it that neighbours share, m; bands 3 and 4 σ of X and Y, m; "
        "band 5 photographs."
    )
    layers = "Layers area, strips, exposures, footprints and control, the last in the order of its gain."
    return (
        DescribedFile("plan.json", PLACE, "json", "The plan in numbers.", PLAN),
        DescribedFile("request.json", PLACE, "other", "Arguments of `plan_flight`, from which the bench plans again."),
        DescribedFile("waypoints.csv", PLACE, "table", "Exposures in the order flown.", WAYPOINTS),
        DescribedFile("sigma_z.tif", PLACE, "raster", bands),
        DescribedFile("plan.gpkg", PLACE, "other", layers),
        DescribedFile("plan.kml", PLACE, "other", "The same without footprints as KML.", when="with a CRS"),
        DescribedFile("plan.html", PLACE, "page", "The plan with maps of σ, to print and hand over."),
        DescribedFile("block", PLACE, "folder", "One simulated flight as a block, with truth/."),
    )
