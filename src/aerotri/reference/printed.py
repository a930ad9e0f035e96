"""What commands print with --json where it is not the content of a file."""

from __future__ import annotations

from aerotri.reference.adjust_tables import MARKS
from aerotri.reference.compared_contents import CHOICE, COMPARE_PARAMETERS
from aerotri.reference.records import DescribedFile, Item, of_axes

UNIT = "m, deg for angles"


DIVIDE = (
    Item("folder", "text", "Folder of the parts."),
    Item("parts", "object", "Number of photographs of every part, by its name."),
    Item("parts.*", "whole", "Photographs of the part."),
    Item("photographs", "whole", "Photographs of the block."),
)


def _changes(name: str, text: str) -> tuple[Item, ...]:
    return (
        Item(f"{name}[]", "object", text),
        Item(f"{name}[].name", "text", "What it is."),
        Item(f"{name}[].first", "anything", "In the first run; null where it has none."),
        Item(f"{name}[].second", "anything", "In the second run; null where it has none."),
    )


def _differences(name: str, what: str, elements: tuple[str, ...]) -> tuple[Item, ...]:
    return (
        Item(name, "object", f"Differences of the {what} that both runs have, second minus first."),
        Item(f"{name}.count", "whole", f"Number of {what} in common."),
        Item(f"{name}.elements[]", "object", "One entry an element."),
        Item(f"{name}.elements[].element", "text", "Its name."),
        Item(f"{name}.elements[].unit", "text", "Unit of rms and max."),
        Item(f"{name}.elements[].rms", "number?", "Root mean square difference.", UNIT),
        Item(f"{name}.elements[].max", "number?", "Largest difference, without sign.", UNIT),
        Item(f"{name}.elements[].max_ratio", "number?", "Largest difference in standard deviations of the second run."),
        Item(f"{name}.elements[].at", "text?", "Where that is."),
        Item(f"{name}.worst[]", "object", "Those that changed most; how many: --top."),
        Item(f"{name}.worst[].name", "text", "Name."),
        *(Item(f"{name}.worst[].{one}", "number?", f"Difference of {one}.", UNIT) for one in elements),
        Item(f"{name}.worst[].max_ratio", "number?", "Its largest difference in standard deviations."),
    )


DIFF = (
    Item("first", "text", "Folder of the first run."),
    Item("second", "text", "Folder of the second run."),
    Item("verdicts[]", "object", "What each run is worth, first and second."),
    Item("verdicts[].verdict", "text", "accepted, doubtful or rejected."),
    Item("verdicts[].reasons[]", "text", "Why, the gravest reason first."),
    Item("sigma", "text", "How differences and σ are to be read."),
    Item("notes[]", "text", "What to bear in mind."),
    *_changes("outcome", "Status, σ0 and counts of both runs."),
    *_changes("settings", "Settings that differ."),
    *_changes("control", "Control and check points whose role, coordinates or σ differ."),
    Item("rays", "object", "Image points that were used differently."),
    Item("rays.counts", "object", "Their number by kind."),
    *(
        Item(f"rays.counts.{name}", "whole", f"Image points {what}.")
        for name, what in (
            ("added", "in the second run only"),
            ("gone", "in the first run only"),
            ("switched", "used in one run, left out in the other"),
            ("measured anew", "with other coordinates"),
            ("weighted anew", "with another weight"),
        )
    ),
    Item("rays.listed[]", "object", "The image points one by one."),
    Item("rays.listed[].kind", "text", "Kind of change, as in counts."),
    Item("rays.listed[].image", "text", "Photograph."),
    Item("rays.listed[].point", "text", "Point."),
    Item("rays.listed[].first", "text", "In the first run."),
    Item("rays.listed[].second", "text", "In the second run."),
    *_differences("orientations", "photographs", ("X0", "Y0", "Z0", "omega", "phi", "kappa")),
    *_differences("points", "object points", ("X", "Y", "Z")),
    Item("parameters[]", "object", "Interior orientation and additional parameters."),
    Item("parameters[].name", "text", "Name of the parameter."),
    Item("parameters[].group", "text", "What it belongs to."),
    Item("parameters[].kind", "text", "Kind of parameter."),
    Item("parameters[].first", "number?", "Value in the first run; null where it has none.", "unit of the parameter"),
    Item("parameters[].second", "number?", "Value in the second run; null where it has none.", "unit of the parameter"),
    Item("parameters[].delta", "number?", "Second minus first.", "unit of the parameter"),
    Item("parameters[].sigma", "number?", "Standard deviation in the second run.", "unit of the parameter"),
    Item("parameters[].ratio", "number?", "Difference over standard deviation."),
    Item("check_points", "object", "Check points of both runs."),
    Item("check_points.first_count", "whole", "Check points of the first run."),
    Item("check_points.second_count", "whole", "Check points of the second run."),
    Item("check_points.common_count", "whole", "Check points of both."),
    Item("check_points.rms_first", "object", "RMS at those in common, first run.", "m"),
    *of_axes("check_points.rms_first.{}", "number?", "In {}.", "m"),
    Item("check_points.rms_second", "object", "RMS at those in common, second run.", "m"),
    *of_axes("check_points.rms_second.{}", "number?", "In {}.", "m"),
    Item("warnings", "object", "Warnings of one run only."),
    Item("warnings.gone[]", "text", "Of the first run."),
    Item("warnings.new[]", "text", "Of the second run."),
)
PARAMETERS = (
    Item("[]", "object", "One entry a parameter."),
    Item("[].family", "text", "Its family, as in FAMILY:ITEMS."),
    Item("[].item", "text", "Its item, as in FAMILY:ITEMS."),
    Item("[].mark", "text", "Where the formula comes from.", values=MARKS),
    Item("[].reference", "text", "The source."),
    Item("[].text", "text", "What it does."),
)
SIMULATE = (
    Item("block", "text", "Name of the block."),
    Item("images", "whole", "Photographs."),
    Item("image_points", "whole", "Image points."),
    Item("points", "whole", "Object points."),
    Item("control", "whole", "Control points."),
    Item("check", "whole", "Check points."),
    Item("rendered", "whole", "Photographs rendered.", optional=True),
    Item("parts", "whole", "Parts, of a block simulated in parts.", optional=True),
)
INIT = (
    Item("folder", "text", "Folder that was begun."),
    Item("files[]", "text", "Files written into it."),
)
CONVERT = (
    Item("target", "text", "File or folder written."),
    Item("format", "text", "Its format."),
    Item("messages[]", "text", "What was matched, assumed, or cannot be held by the target."),
)
EXPORT = (
    Item("target", "text", "Folder written."),
    Item("format", "text", "What was written.", values={"gpkg": "", "geoparquet": "", "stac": "", "pdf": ""}),
    Item("files[]", "text", "Files written into it."),
    Item("messages[]", "text", "What is to be known of it."),
)
PREDICT_VOLUME = (
    Item("models_between_control", "whole", "Stereo models from one control point to the next."),
    Item("models_per_strip", "whole", "Stereo models in a strip."),
    Item("strips", "whole", "Strips."),
    Item("sigma0_m", "number", "Standard deviation of a height from one model.", "m"),
    Item("area_m2", "number", "Area.", "m²"),
    Item("predictions[]", "object", "One entry a way to predict."),
    Item("predictions[].by", "text", "The way."),
    Item("predictions[].sigma_mean_height_m", "number", "Standard deviation of the mean height.", "m"),
    Item("predictions[].sigma_volume_m3", "number", "Standard deviation of the volume.", "m³"),
)


def _attitude() -> tuple[Item, ...]:
    found = [
        Item("tolerance_m3", "number", "Standard deviation of the volume that is allowed.", "m³"),
        Item("angles", "object", "What is allowed of each angle."),
    ]
    for angle in ("omega", "phi", "kappa"):
        found += [
            Item(f"angles.{angle}", "object", f"Allowed standard deviation of {angle}; null: any.", "″"),
            Item(f"angles.{angle}.independent_arcsec", "number?", "Each photograph its own error.", "″"),
            Item(f"angles.{angle}.common_arcsec", "number?", "One error common to both photographs.", "″"),
            Item(
                f"angles.{angle}.all_three_arcsec", "number?", "All three angles alike, each photograph its own.", "″"
            ),
        ]
    return tuple(found)


PICKET_INTERVAL = (
    Item("gsd_m", "number", "Size of a pixel on the ground.", "m"),
    Item("interval_m", "object", "Interval by the formula, by kind of terrain.", "m"),
    Item("interval_m.*[]", "number", "Smallest and largest interval.", "m"),
    Item("older_rule_m", "number", "Interval by the older rule, 30 times the GSD.", "m"),
    Item("pilot", "object", "What the measured part says.", optional=True),
    Item("pilot.interval_m", "number", "Interval that it suggests.", "m"),
    Item("pilot.k", "number", "Coefficient of the formula that this interval means."),
    Item("pilot.area_m2", "number", "Area measured.", "m²"),
    Item("pilot.sigma_of_a_picket_m", "number", "Standard deviation of a measured height.", "m"),
    Item("pilot.tolerance_m", "number?", "RMSE allowed between points; null: the standard deviation of a point.", "m"),
    Item("pilot.tried[]", "object", "The intervals that were tried."),
    Item("pilot.tried[].interval_m", "number", "Interval.", "m"),
    Item("pilot.tried[].rmse_m", "number?", "RMSE between the points.", "m"),
    Item("pilot.tried[].pickets", "whole", "Points measured."),
    Item("pilot.tried[].errors", "whole", "Points rejected."),
)


def _ground_counts(name: str, what: str) -> tuple[Item, ...]:
    return (
        Item(name, "object", f"The {what} points."),
        Item(f"{name}.count", "whole", f"Number of {what} points."),
        Item(f"{name}.full", "whole", "With X, Y and Z."),
        Item(f"{name}.plan_only", "whole", "With X and Y alone."),
        Item(f"{name}.height_only", "whole", "With Z alone."),
        Item(f"{name}.with_image_points", "whole", "Measured in photographs."),
        Item(f"{name}.without_image_points[]", "text", "Names of those that no photograph has."),
    )


CHECK = (
    Item("block", "text", "Name of the block."),
    Item("can_be_adjusted", "yes/no", "Whether nothing is missing for an adjustment."),
    Item("missing[]", "text", "Why it cannot be adjusted, in sentences."),
    Item("warnings[]", "text", "What looks wrong, in sentences."),
    Item("notes[]", "text", "What is worth knowing, such as files that are not read."),
    Item("crs", "text", "Coordinate system."),
    Item("rotation", "text", "Order of the angles."),
    Item("angle_unit", "text", "Unit of the angles in the tables."),
    Item("image_unit", "text", "Unit of the image points in the tables."),
    Item("photographs", "whole", "Number of photographs."),
    Item("with_start_position", "whole", "Photographs with a start position."),
    Item("with_start_angles", "whole", "Photographs with start angles."),
    Item("with_gnss", "whole", "Photographs with an observed position."),
    Item("with_ins", "whole", "Photographs with observed angles."),
    Item("without_image_points[]", "text", "Photographs in which no point is measured."),
    Item("parts[]", "object", "Parts of the block that no point ties together, the largest first."),
    Item("parts[][]", "text", "Photographs of the part."),
    Item("cameras[]", "object", "The cameras."),
    Item("cameras[].name", "text", "Name of the camera."),
    Item("cameras[].model", "text", "Kind of camera."),
    Item("cameras[].size_px[]", "whole", "Columns and rows.", "px"),
    Item("cameras[].pixel_um", "number", "Size of a pixel.", "µm"),
    Item("cameras[].focal_length_mm", "number", "Principal distance.", "mm"),
    Item("cameras[].photographs", "whole", "Photographs it took."),
    Item("cameras[].projection", "text", "Kind of lens.", values={"perspective": "usual", "fisheye": "fisheye"}),
    Item("strips[]", "object", "The strips."),
    Item("strips[].name", "text", "Name of the strip."),
    Item("strips[].photographs", "whole", "Its photographs."),
    Item("strips[].common_points", "whole", "Its points that other strips have as well."),
    Item("image_points", "object", "The image points."),
    Item("image_points.count", "whole", "Their number."),
    Item("image_points.points", "whole", "Object points that they measure."),
    Item("image_points.rays_per_point[]", "object", "Points by the number of their photographs."),
    Item("image_points.rays_per_point[].photographs", "whole", "Number of photographs."),
    Item("image_points.rays_per_point[].points", "whole", "Points measured in so many."),
    Item("image_points.in_one_photograph", "whole", "Points measured in one photograph only."),
    Item("image_points.mean_rays", "number", "Mean number of photographs of a point."),
    Item("image_points.fewest", "whole", "Image points in the photograph with the fewest."),
    Item("image_points.median", "number", "Image points in a photograph, median."),
    Item("image_points.sigma_um", "number?", "Their standard deviation, median.", "µm"),
    *_ground_counts("control", "control"),
    *_ground_counts("check", "check"),
    Item("extents[]", "object", "Smallest and largest coordinates of control, GNSS and start values."),
    Item("extents[].name", "text", "What it is the extent of."),
    Item("extents[].count", "whole", "Number of positions."),
    Item("extents[].low[]", "number?", "Smallest X, Y, Z.", "m"),
    Item("extents[].high[]", "number?", "Largest X, Y, Z.", "m"),
    Item("angles[]", "object", "Smallest and largest of each angle; omega, phi, kappa."),
    Item("angles[][]", "number", "Smallest and largest.", "rad"),
)
EXPLAIN = (
    Item("[]", "object", "One entry a thing of that name."),
    Item("[].kind", "text", "What it is: key of block.toml, column, option and so on."),
    Item("[].name", "text", "Its name in full."),
    Item("[].place", "text", "The file, table or command it belongs to."),
    Item("[].text", "text", "What it means."),
    Item("[].facts", "object", "Unit, default and the like, by name."),
    Item("[].facts.*", "text", "A fact."),
    Item("[].values", "object", "The words that may stand there."),
    Item("[].values.*", "text", "What the word means; may be empty."),
)


def printed_contents() -> tuple[DescribedFile, ...]:
    """What is printed as JSON and stands in no file."""
    printed = (
        ("diff", "What changed between two runs.", DIFF),
        ("divide", "The parts of a block.", DIVIDE),
        ("parameters", "The additional parameters there are.", PARAMETERS),
        ("simulate", "How much was simulated.", SIMULATE),
        ("convert", "What was converted.", CONVERT),
        ("export", "What was exported.", EXPORT),
        ("compare-parameters", "compare_parameters.json, and the choice.", (*COMPARE_PARAMETERS, CHOICE)),
        ("init", "Which files were written.", INIT),
        ("check", "What a block holds and lacks.", CHECK),
        ("explain", "What the reference says.", EXPLAIN),
        ("predict volume", "Accuracy of a volume before the flight.", PREDICT_VOLUME),
        ("predict attitude", "Attitude accuracy that a volume tolerates.", _attitude()),
        ("predict picket-interval", "How far apart ground points should be.", PICKET_INTERVAL),
    )
    return tuple(
        DescribedFile(f"aerotri {name} --json", "printed", "json", text, items) for name, text, items in printed
    )
