"""What simulate, tiepoints, convert, divide and run write, and what a result holds beside tables and JSON."""

from __future__ import annotations

from aerotri.reference.adjust_tables import PLACE as RESULT
from aerotri.reference.head import ARGUMENTS, BLOCK, HEAD
from aerotri.reference.records import DescribedFile, Item, of_axes

SIMULATED = "block of simulate"
IMPORTED = "block of convert"
TRUTH, TIEPOINTS, RUN = "truth of simulate", "block of tiepoints", "folder of run"
MARKS, PHOTOGRAPHS, PARAMETERS = "control_marks of tiepoints", "photographs of simulate", "folder of parameters"
COMPARED, DIVIDED = "folder of compare-parameters", "folder of divide"
ANGLES = ("omega", "phi", "kappa")
NAME = Item("image", "text", "Name of the photograph.")
POINT = Item("point", "text", "Name of the point.")

TRUTH_TABLES = (
    (
        "images.csv",
        "True orientations.",
        (
            NAME,
            *of_axes("{}0", "number", "True {} of the projection centre.", "m"),
            *of_axes("{}", "number", "True angle {}.", "deg", ANGLES),
        ),
    ),
    ("points.csv", "True coordinates.", (POINT, *of_axes("{}", "number", "True {}.", "m"))),
    (
        "additional_parameters.csv",
        "True additional parameters.",
        (
            Item("name", "text", "Name of the parameter."),
            Item("group", "text", "Camera it belongs to."),
            Item("value", "number", "True value.", "unit of the parameter"),
        ),
    ),
    (
        "cameras.csv",
        "True interior orientations.",
        (
            Item("name", "text", "Name of the camera."),
            Item("focal_length_mm", "number", "Principal distance.", "mm"),
            Item("x0_mm", "number", "x of the principal point.", "mm"),
            Item("y0_mm", "number", "y of the principal point.", "mm"),
        ),
    ),
    (
        "image_errors.csv",
        "True image errors on a grid.",
        (
            Item("camera", "text", "Camera."),
            Item("day", "text?", "Day; empty: all days."),
            *of_axes("{}", "number", "Place {} in the image, from the centre.", "mm", ("x", "y")),
            *of_axes("d{}", "number", "Image error in {}: measured minus ideal.", "mm", ("x", "y")),
        ),
    ),
    (
        "gross_errors.csv",
        "Gross errors of image points.",
        (NAME, POINT, *of_axes("d{}", "number", "Error in {}.", "mm", ("x", "y"))),
    ),
    (
        "control_blunders.csv",
        "Gross errors of given control.",
        (POINT, *of_axes("d{}", "number", "Error in {}.", "m")),
    ),
    (
        "readout.csv",
        "Readout times of rolling shutters, where there are any.",
        (Item("camera", "text", "Name of the camera."), Item("readout_ms", "number", "Readout time.", "ms")),
    ),
    (
        "motion.csv",
        "How photographs moved while they were read, where there are rolling shutters.",
        (
            NAME,
            *of_axes("v{}", "number", "Velocity in {}.", "m/s"),
            *of_axes("w{}", "number", "Rate of rotation about the {} axis of the camera.", "deg/s", ("x", "y", "z")),
        ),
    ),
    (
        "rigs.csv",
        "Mountings of the cameras on rigs, where there are any.",
        (
            Item("camera", "text", "Name of the camera."),
            *of_axes("{}", "number", "{} of its projection centre in the frame of the reference camera.", "m", "xyz"),
            *of_axes(
                "{}",
                "number",
                "Angle {} of R, in X_reference = position + R·X_camera.",
                "deg",
                ("omega", "phi", "kappa"),
            ),
        ),
    ),
)
TRUTH_WHEN = {
    "rigs.csv": "with a rig",
    "readout.csv": "with a rolling shutter",
    "motion.csv": "with a rolling shutter",
}
RENDERED = (
    Item("photographs[]", "text", "Files of the photographs."),
    Item("seed", "whole", "Seed of the random numbers."),
    Item("options", "object", "How they were rendered."),
    Item("options.mean", "number", "Mean grey value."),
    Item("options.contrast", "number", "RMS of the texture over the mean grey value."),
    Item("options.detail_px", "number", "Size of the finest details of the texture.", "px"),
    Item("options.blur_px", "number", "Standard deviation of the point spread.", "px"),
    Item("options.noise", "number", "Standard deviation of the grey values."),
    Item("options.targets", "yes/no", "Whether control and check points carry bright discs."),
    Item("options.target_radius_px", "number", "Radius of the discs.", "px"),
    Item("options.target_level", "number", "Grey value of the discs."),
)
TIEPOINTS_JSON = (
    *HEAD,
    BLOCK,
    Item("photographs", "whole", "Photographs in the block."),
    Item("left_out[]", "text", "Photographs that could not be tied."),
    Item("pairs", "object", "Pairs of photographs."),
    Item("pairs.compared", "whole", "Pairs that were matched."),
    Item("pairs.tied", "whole", "Pairs with tie points."),
    Item("tie_points", "whole", "Number of tie points."),
    Item("rays", "whole", "Number of their image points."),
    Item("rays_per_point", "number", "Mean number of photographs of a tie point."),
    Item("points_per_photograph", "object", "Tie points in a photograph."),
    Item("points_per_photograph.smallest", "whole", "In the photograph with the fewest."),
    Item("points_per_photograph.median", "number", "Median."),
    Item("control", "whole", "Number of control points."),
    Item("check", "whole", "Number of check points."),
    Item("median_residual_px", "number", "Median residual of the first orientation.", "px"),
    Item("cameras[]", "object", "The cameras."),
    Item("cameras[].name", "text", "Name of the camera."),
    Item("cameras[].focal_length_mm", "number", "Principal distance.", "mm"),
    Item("cameras[].pixel_um", "number", "Size of a pixel.", "µm"),
    Item("placement", "object?", "What gave the block its place; null where nothing did, or with --orientation."),
    Item("placement.by", "text", "What it was.", values={"control points": "", "positions": "of the photographs"}),
    Item("placement.fits", "yes/no", "Whether the place can be trusted: most of them agree."),
    Item("placement.problem", "text", "Why it cannot be trusted, with what to look at; else empty."),
    Item(
        "placement.bend_percent",
        "number",
        "Error of the first orientation with which they agree best, in % of the extent of the points; at least 0.1.",
        "%",
    ),
    Item("placement.points[]", "object", "The control points, or the photographs with positions."),
    Item("placement.points[].name", "text", "Name of the point or photograph."),
    Item(
        "placement.points[].offset_m[]",
        "number?",
        "dX, dY, dZ: its place by the first orientation minus the stated place; null where not compared.",
        "m",
    ),
    Item(
        "placement.points[].sigma_m[]",
        "number?",
        "σ of these: the stated one, with the errors of the marks and of the first orientation.",
        "m",
    ),
    Item("placement.points[].misfit_sigma", "number?", "Length of (dX, dY, dZ), each over its σ; up to 4 it agrees."),
    Item("placement.points[].used", "yes/no", "Whether it was used to place the block."),
    Item("placement.points[].reason", "text", "Why it was not compared; else empty."),
    Item("doubts[]", "text", "What looks wrong in the control points and the place, in sentences; also in messages."),
    Item("messages[]", "text", "What was matched, assumed or left out, in sentences."),
    Item("seconds", "number", "Time it took.", "s"),
    Item("marking_page", "text", "Page to mark control points in; empty without control."),
    *ARGUMENTS,
)
IMPORT_JSON = (
    *HEAD,
    BLOCK,
    Item("sources[]", "object", "Files and folders that were read."),
    Item("sources[].path", "text", "As it was written on the command line."),
    Item(
        "sources[].holds", "text", "What was taken from it: block, photographs, image points, control points and so on."
    ),
    Item("sources[].format", "text", "Its format, as it was recognised; empty of a camera."),
    Item("sources[].program", "text", "Program that writes the format, or the cameras of photographs; empty of lists."),
    Item("taken", "object", "What was taken."),
    Item("taken.photographs", "whole", "Number of photographs."),
    Item("taken.cameras", "whole", "Number of cameras."),
    Item("taken.image_points", "whole", "Number of image points."),
    Item("taken.points", "whole", "Number of points with image points."),
    Item("taken.control_points", "whole", "Number of control points."),
    Item("taken.check_points", "whole", "Number of check points."),
    Item("taken.gnss_positions", "whole", "Number of photographs with an observed position."),
    Item("taken.ins_attitudes", "whole", "Number of photographs with an observed attitude."),
    Item("taken.start_orientations", "whole", "Number of photographs with a start orientation."),
    Item("taken.heights", "text", "What the heights count from; empty of local coordinates."),
    Item("taken.notes[]", "text", "What was used in another way than it stands in the files, such as feet."),
    Item("assumed[]", "text", "What no file and no option said: defaults, the order of columns, standard deviations."),
    Item("left_behind[]", "text", "What stands in the files and not in the block."),
    Item("remarks[]", "text", "What else is to be known: how well things fit, what looks wrong."),
)
PREDICTED = (
    POINT,
    NAME,
    Item("column", "number", "Predicted column.", "px"),
    Item("row", "number", "Predicted row.", "px"),
    Item("marked_column", "number?", "Column as marked; empty where it is not.", "px"),
    Item("marked_row", "number?", "Row as marked; empty where it is not.", "px"),
)
PARTS_JSON = (Item("parts[]", "text", "Names of the parts, which are folders in parts: 0000, 0001 and so on."),)
RUN_JSON = (
    *HEAD,
    Item("source", "text", "What the run began with."),
    Item("steps[]", "object", "The steps in their order."),
    Item("steps[].name", "text", "Command of the step."),
    Item("steps[].folder", "text", "Folder it writes, in that of the run."),
    Item("steps[].what", "text", "The step, in words."),
    Item("steps[].arguments[]", "text", "The command line that does the same."),
    Item("steps[].status", "text", "How it ended.", values={"done": "", "failed": "", "left out": ""}),
    Item("steps[].reason", "text", "Why it is not done; else empty."),
    Item("steps[].seconds", "number", "Time it took.", "s"),
    Item("seconds", "number", "Time of all steps.", "s"),
    Item("report", "text", "The report."),
)


def block_files() -> tuple[DescribedFile, ...]:
    """The files of simulate, tiepoints, divide, run and parameters, and the rest of a result."""
    return (
        *(
            DescribedFile(name, TRUTH, "table", text, items, TRUTH_WHEN.get(name, ""))
            for name, text, items in TRUTH_TABLES
        ),
        DescribedFile(
            "surface.tif", TRUTH, "raster", "The true ground as a raster of heights, m.", when="with --render"
        ),
        DescribedFile("truth", SIMULATED, "folder", "What the block really is."),
        DescribedFile("photographs", SIMULATED, "folder", "The rendered photographs.", when="with --render"),
        DescribedFile(
            "gcp_list.txt",
            SIMULATED,
            "text",
            "Control points with their image points, as ODM has them.",
            when="with --render, of a block in a CRS",
        ),
        DescribedFile(
            "rendered.json", PHOTOGRAPHS, "json", "Which photographs were rendered, and how.", RENDERED, "with --render"
        ),
        DescribedFile(
            "PHOTOGRAPH.tif", PHOTOGRAPHS, "raster", "The rendered photographs, 16 bit.", when="with --render"
        ),
        DescribedFile(
            "import.json",
            IMPORTED,
            "json",
            "What was taken, assumed and left behind when the block was read from other files.",
            IMPORT_JSON,
            "of convert, tiepoints and run",
        ),
        DescribedFile("tiepoints.json", TIEPOINTS, "json", "How well the photographs are tied.", TIEPOINTS_JSON),
        DescribedFile(
            "tie_point_cache", TIEPOINTS, "folder", "Features and matches, kept for the next run; may be removed."
        ),
        DescribedFile(
            "control_marks", TIEPOINTS, "folder", "Control points in the photographs, to be marked.", when="with --gcp"
        ),
        DescribedFile(
            "marking.html", MARKS, "page", "Page on which control points are marked by clicks.", when="with --gcp"
        ),
        DescribedFile(
            "predicted.csv",
            MARKS,
            "table",
            "Where control points should appear, and where they were marked.",
            PREDICTED,
            "with --gcp",
        ),
        DescribedFile(
            "pieces", MARKS, "folder", "Pieces of the photographs around the predicted places.", when="with --gcp"
        ),
        DescribedFile(
            "parts.json",
            DIVIDED,
            "json",
            "The parts of a block in parts, also of convert --parts and simulate --parts. If one is listed and not "
            "there, or there and not listed, adjust stops. Without this file every folder in parts is a part.",
            PARTS_JSON,
        ),
        DescribedFile("parts", DIVIDED, "folder", "The parts, each a block folder under its name."),
        DescribedFile("run.json", RUN, "json", "The steps and how each ended.", RUN_JSON),
        DescribedFile("report.html", RUN, "page", "All steps on one page."),
        DescribedFile("block", RUN, "folder", "The block, as of tiepoints.", when="of photographs"),
        DescribedFile("result", RUN, "folder", "The adjustment, as of adjust."),
        DescribedFile("dtm", RUN, "folder", "The terrain, as of dtm.", when="of photographs"),
        DescribedFile("volume", RUN, "folder", "The volume on the terrain, as of volume.", when="with --boundary"),
        DescribedFile(
            "dsm_volume",
            RUN,
            "folder",
            "The volume on the dense surface, as of volume.",
            when="of photographs with --boundary, unless --no-dense",
        ),
        DescribedFile("dsm", RUN, "folder", "The dense surface, as of dsm.", when="of photographs, unless --no-dense"),
        DescribedFile("ortho", RUN, "folder", "The orthophoto, as of ortho.", when="of photographs, unless --no-dense"),
        DescribedFile("block", RESULT, "folder", "The block as it was adjusted."),
        DescribedFile("solution.npz", RESULT, "other", "The solution, from which later commands take covariances."),
        DescribedFile(
            "report.html", RESULT, "page", "The report, one page that needs no network.", when="unless --no-plots"
        ),
        DescribedFile("plots", RESULT, "folder", "The plots of the report, PNG and SVG.", when="unless --no-plots"),
        DescribedFile("compare_parameters.png", COMPARED, "picture", "The sets side by side; also as SVG."),
        DescribedFile("FAMILY.png", PARAMETERS, "picture", "Patterns of a family; also as SVG."),
    )
