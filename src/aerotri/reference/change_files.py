"""What change writes."""

from __future__ import annotations

from aerotri.reference.head import ARGUMENTS, HEAD
from aerotri.reference.records import DescribedFile, Item
from aerotri.volume.change.alignment import ALIGNS
from aerotri.volume.change.compute import PARTS

CHANGE, SURFACES = "folder of change", "of surfaces"
AREAS = (
    ("area_m2", "Area with heights in both surfaces."),
    ("no_data_area_m2", "Area without, also where it lies outside of a surface."),
    ("gained_area_m2", "Area that gained beyond the level of detection."),
    ("lost_area_m2", "Area that lost beyond the level of detection."),
)
SUMS = (
    ("gained", "Volume gained, of the cells beyond the level of detection."),
    ("lost", "Volume lost, of the cells beyond the level of detection."),
    ("net", "Volume of the difference over all cells."),
)
PART_WORDS = {
    "noise": "Noise of the cells, with the length over which neighbours share it.",
    "alignment": "Alignment on stable ground.",
    "adjustment": "What the adjustments add: by their equations where both are given; else to all cells alike, 0 with "
    "an alignment or one adjustment.",
    "model": "What image errors add that noise does not explain: errors that photographs of one strip, or of another "
    "group, have in common, and errors of the camera that the additional parameters leave. 0 where the residuals show "
    "none, or where the adjustments are not given.",
    "matching_shared": "Matching errors that neighbouring cells of dense surfaces share and that do not average out; 0 "
    "of other surfaces.",
    "bridged": "Ground that is bridged below objects (dtm.tif of `dsm --ground`): all cells of a bridged patch are "
    "taken to err together; 0 of other surfaces.",
}


def _sums(of: str, with_parts: bool) -> list[Item]:
    items: list[Item] = []
    for name, text in SUMS:
        items.append(Item(f"{of}{name}_m3", "number", text, "m³"))
        items.append(Item(f"{of}sigma_{name}_m3", "number", "Standard deviation of it.", "m³"))
        if with_parts:
            items.append(Item(f"{of}parts_{name}_m3", "object", "The parts of it, each alone.", "m³"))
            items += [Item(f"{of}parts_{name}_m3.{part}", "number", PART_WORDS[part], "m³") for part in PARTS]
    return items


CHANGE_JSON = (
    *HEAD,
    Item("first", "text", "The earlier surface."),
    Item("second", "text", "The later surface."),
    *ARGUMENTS,
    Item("cell_m", "number", "Cell of the difference.", "m"),
    Item("cells", "whole", "Cells with heights in both."),
    Item("level_of_detection_sigma", "number", "Standard deviations beyond which a change is told from noise, 95 %."),
    Item("level_of_detection_m", "number?", "The same in metres, median of the cells.", "m"),
    Item("beyond_level_percent", "number", "Share of the cells beyond it.", "%"),
    Item("sigma_m", "number?", "Standard deviation of the difference, median of the cells.", "m"),
    Item("noise_length_m", "number", "Side of the square whose cells share one noise.", "m"),
    Item("alignment", "object?", "How the second surface was aligned; null without --stable."),
    Item("alignment.how", "text", "What it was moved by.", values=dict.fromkeys(ALIGNS, "")),
    Item("alignment.stable", "text", "File or text of the stable ground."),
    Item("alignment.cells", "whole", "Cells on it."),
    Item("alignment.cells_used", "whole", "Cells that took part."),
    Item("alignment.noise_factor", "number?", "Noise there over the stated one; null where a surface states none."),
    Item("alignment.unknowns[]", "object", "What it was moved by."),
    Item("alignment.unknowns[].name", "text", "dZ, dX, dY (m), tilt_X, tilt_Y (m/m)."),
    Item("alignment.unknowns[].value", "number", "Second surface less first."),
    Item(
        "alignment.unknowns[].sigma",
        "number",
        "Standard deviation of it, with the part of the adjustments where given.",
    ),
    Item("volumes[]", "object", "One entry an area; the last is all together."),
    Item("volumes[].name", "text", "Its name."),
    *(Item(f"volumes[].{name}", "number", text, "m²") for name, text in AREAS),
    *_sums("volumes[].", True),
    Item("warnings[]", "text", "Sentences to read."),
)
CHANGE_TABLE = (
    Item("name", "text", "The area."),
    *(Item(name, "number", text, "m²") for name, text in AREAS),
    *_sums("", False),
)


CLOUD_JSON = (
    *HEAD,
    Item("first", "text", "The earlier cloud."),
    Item("second", "text", "The later cloud."),
    Item("cylinder_m", "number", "Diameter of the cylinder whose points are averaged.", "m"),
    Item("normal_m", "number", "Diameter of the ball whose points give a normal.", "m"),
    Item("reach_m", "number", "Largest distance that was sought.", "m"),
    Item("spacing_m", "number", "Spacing of the places.", "m"),
    Item("points_first", "whole", "Points of the earlier cloud."),
    Item("points_second", "whole", "Points of the later cloud."),
    Item("core_points", "whole", "Places."),
    Item("with_distance", "whole", "Places with a distance: both clouds have four points or more there."),
    Item(
        "sigma_from",
        "text",
        "What σ is from.",
        values={
            "adjustments": "both adjustments, and what the points have for themselves",
            "points": "σ and covariances of the points; of one adjustment their noise alone",
            "scatter": "scatter of the points along the normal",
        },
    ),
    Item("adjustments_m", "number?", "What both adjustments bring to it, median; null where not given.", "m"),
    Item("registration_m", "number", "Error of the position of one cloud to the other, 1 σ.", "m"),
    Item("stable", "object?", "Stable ground; null without --stable."),
    Item("stable.core_points", "whole", "Places with a distance on it."),
    Item("stable.mean_m", "number", "Mean distance on it.", "m"),
    Item("sigma_m", "number", "Standard deviation of a distance, median of the places.", "m"),
    Item("level_of_detection_m", "number", "Level of detection (95 %), median of the places.", "m"),
    Item("beyond_level_percent", "number", "Share of the places beyond it.", "%"),
    Item("gained_percent", "number", "Share beyond it that gained: the second cloud lies above the first.", "%"),
    Item("lost_percent", "number", "Share beyond it that lost.", "%"),
    Item("distance_m", "object", "The distances.", "m"),
    Item("distance_m.median", "number", "Median.", "m"),
    Item("distance_m.smallest", "number", "The smallest, negative where ground was lost.", "m"),
    Item("distance_m.largest", "number", "The largest.", "m"),
    Item("warnings[]", "text", "Sentences to read."),
    *ARGUMENTS,
)
CLOUD_TABLE = (
    *(Item(axis, "number", f"{axis} of the place.", "m") for axis in "XYZ"),
    *(Item(f"normal_{axis}", "number?", f"{axis} of the normal, of length 1, upwards.") for axis in "XYZ"),
    Item("distance", "number?", "Second cloud less first, along the normal.", "m"),
    Item("sigma", "number?", "Standard deviation of it.", "m"),
    Item("level_of_detection", "number?", "Level of detection, 95 %.", "m"),
    Item("beyond", "yes/no", "Whether the distance is beyond it."),
    Item("points_first", "whole", "Points of the earlier cloud in the cylinder."),
    Item("points_second", "whole", "Points of the later cloud in the cylinder."),
)


def change_files() -> tuple[DescribedFile, ...]:
    """The files of change."""
    plots = "unless --no-plots"
    return (
        DescribedFile(
            "change.json", CHANGE, "json", "Volumes gained and lost, alignment, σ.", CHANGE_JSON, when=SURFACES
        ),
        DescribedFile(
            "change.tif",
            CHANGE,
            "raster",
            "Band 1 difference, m; band 2 its standard deviation, m; band 3 their ratio.",
            when=SURFACES,
        ),
        DescribedFile("change.csv", CHANGE, "table", "Volumes of every area.", CHANGE_TABLE, when=SURFACES),
        DescribedFile(
            "cloud_change.json", CHANGE, "json", "Distances of two clouds in short.", CLOUD_JSON, when="of point clouds"
        ),
        DescribedFile(
            "distances.parquet",
            CHANGE,
            "table",
            "Distances of two clouds, a row a place.",
            CLOUD_TABLE,
            when="of point clouds",
        ),
        DescribedFile(
            "plots", CHANGE, "folder", "Maps of the change and of its σ; histogram of distances.", when=plots
        ),
        DescribedFile("change.html", CHANGE, "page", "The change on one page.", when=plots),
    )
