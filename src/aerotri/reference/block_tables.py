"""The tables of a block folder: what each column is. Which columns there are is taken from their readers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from aerotri.formats.block.extras import CONSTRAINT_COLUMNS
from aerotri.formats.block.folder import IMAGE_COLUMNS
from aerotri.formats.block.journal import EDIT_COLUMNS
from aerotri.formats.block.points import CONTROL_COLUMNS, GNSS_COLUMNS, IMAGE_POINT_COLUMNS
from aerotri.formats.block.scanned_film import FIDUCIAL_COLUMNS
from aerotri.formats.text.tables import Columns
from aerotri.reference.records import DescribedFile, Item, of_axes

PLACE = "block folder"
ANGLE = "angle_unit"
IMAGE_UNIT = "image_unit"
PHOTOGRAPH = "Name of the photograph, as in images.csv."

IMAGES = (
    Item("image", "text", "Name of the photograph. The name of its file without ending is usual."),
    Item("camera", "text", "Name of its camera, as in [camera.NAME] of block.toml."),
    Item("strip", "text?", "Name of the strip. May be empty."),
    *of_axes("{}0", "number?", "{} of the projection centre, a start value. Empty: computed.", "m"),
    *of_axes("{}", "number?", "Angle {}, a start value. Empty: computed.", ANGLE, ("omega", "phi", "kappa")),
    Item(
        "*",
        "text?",
        "Any other column groups photographs, such as day; name it in adjustment.parameter_groups. The column station "
        "names the exposure of a rig: photographs that its cameras took together have the same one. Needed where "
        "block.toml has a [rig.NAME]; empty: the photograph belongs to no station. The column time, in seconds, says "
        "when a photograph was taken; the velocities of rolling shutters come from it where gnss_ins.csv has no times.",
        optional=True,
    ),
)
IMAGE_POINTS = (
    Item("image", "text", PHOTOGRAPH),
    Item("point", "text", "Name of the object point. The same point has the same name in all photographs."),
    Item("x", "number", "Measured x. mm and um: from the image centre to the right; px: column.", IMAGE_UNIT),
    Item("y", "number", "Measured y. mm and um: from the image centre upwards; px: row, downwards.", IMAGE_UNIT),
    Item("sx", "number?", "Standard deviation of x. Empty: stochastic.image_sigma_um.", IMAGE_UNIT),
    Item("sy", "number?", "Standard deviation of y. Empty: stochastic.image_sigma_um.", IMAGE_UNIT),
)
CONTROL = (
    Item("point", "text", "Name of the point, as in image_points.csv."),
    *of_axes("{}", "number?", "Given {}. Empty: not known (a height point has no X, Y).", "m"),
    *of_axes(
        "s{}", "number?", "Standard deviation of {}; 0 holds it without error. Empty: default_control_sigma_m.", "m"
    ),
    Item(
        "role",
        "text",
        "What the point is used for.",
        values={"control": "takes part in the adjustment", "check": "is compared only"},
    ),
)
GNSS_INS = (
    Item("image", "text", PHOTOGRAPH),
    *of_axes("{}", "number?", "Observed {} of the antenna. Empty: no position.", "m"),
    *of_axes("s{}", "number?", "Standard deviation of {}.", "m"),
    *of_axes("{}", "number?", "Observed angle {}. Empty: no angles.", ANGLE, ("omega", "phi", "kappa")),
    *of_axes("s_{}", "number?", "Standard deviation of {}.", ANGLE, ("omega", "phi", "kappa")),
    Item("time", "number?", "Time of the exposure, for drift and time offset.", "s"),
)
FIDUCIALS = (
    Item("image", "text", PHOTOGRAPH),
    Item("fiducial", "text", "Name of the fiducial mark, as in [camera.NAME.fiducials]."),
    Item("column", "number", "Measured column in the scan; 0 is the left edge of the left pixel.", "px"),
    Item("row", "number", "Measured row in the scan; 0 is the upper edge of the upper pixel.", "px"),
)
EDITS = (
    Item("image", "text?", "Photograph, where one measurement is meant; empty: the point as a whole."),
    Item("point", "text", "Name of the point."),
    Item(
        "action",
        "text",
        "What is decided.",
        values={
            "off": "leave out: the measurement, the given coordinates of a control or check point, or all measurements "
            "of a tie point",
            "check": "make a control point a check point",
            "control": "make a check point a control point",
            "on": "take back off, check or control of the same measurement or point",
            "mark": "measure the point in the photograph at column and row, whatever image_points says",
            "remove": "take the measurement out of image_points",
            "new_control": "make the point a control point with X, Y, Z and their σ, as a row of control.csv does",
            "new_check": "make the point a check point with X, Y, Z and their σ",
            "undo": "take back the last row that still stands; image and point stay empty",
        },
    ),
    Item("time", "text?", "When it was decided, UTC. With this column later rows overrule earlier ones."),
    Item("column", "number?", "Of a mark: column in the photograph; 0 is the left edge of the left pixel.", "px"),
    Item("row", "number?", "Of a mark: row in the photograph; 0 is the upper edge of the upper pixel.", "px"),
    Item("old_column", "number?", "Column before, for the record.", "px"),
    Item("old_row", "number?", "Row before, for the record.", "px"),
    *(Item(axis, "number?", f"Of a new control or check point: {axis}.", "m") for axis in "XYZ"),
    *(Item(f"s{axis}", "number?", f"Of a new control or check point: σ of {axis}.", "m") for axis in "XYZ"),
    Item("reason", "text?", "Why, for the record."),
)
CONSTRAINTS = (
    Item(
        "kind",
        "text",
        "Kind of condition.",
        values={
            "vertical": "two points or more have the same X and Y",
            "horizontal": "two points or more have the same Z",
            "height_difference": "Z of the second point less Z of the first is value",
            "distance": "two points are value apart",
            "plane": "four points or more lie on a plane",
            "line": "three points or more lie on a straight line",
        },
    ),
    Item("points", "text", "Names of the points, separated by blanks."),
    Item("value", "number?", "Of height_difference and distance; empty for the others.", "m"),
    Item("sigma", "number", "Standard deviation of the condition.", "m"),
)
NEEDED = {
    "images.csv": "always",
    "image_points.csv": "always",
    "control.csv": "where the datum comes from control; may be empty",
}

_FILES = (
    ("images.csv", "The photographs, a row each.", IMAGES),
    ("image_points.csv", "The measured image points, a row for every point in every photograph.", IMAGE_POINTS),
    ("control.csv", "Control and check points.", CONTROL),
    ("gnss_ins.csv", "Observed positions and angles of the photographs.", GNSS_INS),
    ("fiducials.csv", "Fiducial marks measured in scanned film.", FIDUCIALS),
    ("edits.csv", "The operator's decisions, kept apart from the measurements.", EDITS),
    ("constraints.csv", "Conditions between object points.", CONSTRAINTS),
)
READERS: Mapping[str, Columns] = {
    "images.csv": IMAGE_COLUMNS,
    "image_points.csv": IMAGE_POINT_COLUMNS,
    "control.csv": CONTROL_COLUMNS,
    "gnss_ins.csv": GNSS_COLUMNS,
    "fiducials.csv": FIDUCIAL_COLUMNS,
    "edits.csv": EDIT_COLUMNS,
    "constraints.csv": CONSTRAINT_COLUMNS,
}
"""What the readers of the tables take."""


def block_table_files() -> tuple[DescribedFile, ...]:
    """The tables of a block folder; columns that the reader does not insist on are optional."""
    return tuple(
        DescribedFile(
            name, PLACE, "table", text, _as_read(items, READERS[name]), NEEDED.get(name, "where there are any")
        )
        for name, text, items in _FILES
    )


def _as_read(items: tuple[Item, ...], columns: Columns) -> tuple[Item, ...]:
    return tuple(replace(one, optional=one.name not in columns.required) for one in items)
