"""What stands at the head of the JSON files, and the arguments they were computed with."""

from __future__ import annotations

from aerotri.reference.records import Item

VERSION = Item("aerotri", "text", "Version of aerotri that wrote the file.")
BLOCK = Item("block", "text", "Name of the block.")
PROJECT = (
    Item("project", "object", "What [project] of block.toml says; empty texts where it says nothing."),
    Item("project.title", "text", "Title of the project."),
    Item("project.client", "text", "Who ordered the work."),
    Item("project.operator", "text", "Who computes."),
    Item("project.company", "text", "Company of the operator."),
    Item("project.survey_date", "text", "Day of the survey, YYYY-MM-DD."),
    Item("project.notes", "text", "Notes."),
    Item("project.logo", "text", "Name of the logo in the block folder."),
)
CRS = Item("crs", "text", "Coordinate system: local, or EPSG codes; empty where none is stated.")
HEAD_BESIDE_CRS = (
    VERSION,
    Item("computed", "text", "When it was computed: 2026-05-04T12:30:00Z, in UTC."),
    *PROJECT,
    Item("crs_name", "text", "Name of the coordinate system; empty for local ones."),
    Item("height_system", "text", "Name of the system of the heights; empty where none is stated."),
)
HEAD = (*HEAD_BESIDE_CRS, CRS)
"""What the JSON file of every result begins with."""
GOOD_FOR = {
    "absolute": "positions and heights in the coordinate system, and the shape",
    "relative": "the shape alone: lengths, height differences, volumes",
    "neither": "neither of them",
    "": "not known",
}
ADJUSTED = (
    Item("adjusted", "object", "The adjustment that photographs were oriented by."),
    Item(
        "adjusted.verdict", "text", "Its verdict.",
        values={"accepted": "", "doubtful": "", "rejected": ""},
    ),
    Item("adjusted.reason", "text", "The first reason for the verdict; empty where it is accepted."),
    Item("adjusted.good_for", "text", "What it is good for.", values=GOOD_FOR),
    Item("adjusted.purpose", "text", "The same in a sentence or two, with the numbers; empty where it is not known."),
    Item("adjusted.scale", "number?", "σ of the scale of the whole block: 0.01 is 1 % of a length, 3 % of a volume."),
    Item("adjusted.control_points", "whole", "Its control points."),
    Item("adjusted.check_points", "whole", "Its check points."),
    Item("adjusted.rms_check_m", "object", "RMS of the differences at its check points.", "m"),
    *(Item(f"adjusted.rms_check_m.{axis}", "number?", f"RMS in {axis}; null without.", "m") for axis in "XYZ"),
)  # fmt: skip
"""What surfaces and orthophotos say of the adjustment they were made with."""
ORIGINS = {"given": "stated, or chosen by the program", "default": "the default value, stated or not"}
ARGUMENTS = (
    Item(
        "settings[]", "object", "Every argument that was used, by its name in Python, most of them options with dashes."
    ),
    Item("settings[].key", "text", "Name of the argument."),
    Item("settings[].value", "anything", "The value; null where it is not in use."),
    Item("settings[].unit", "text", "Unit; empty where it has none."),
    Item("settings[].origin", "text", "Where it comes from.", values=ORIGINS),
)
"""What the JSON file of every result but an adjustment says of how it was computed."""
