"""Arguments and options that several commands have, and the panels in which help shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

ARGUMENTS, INPUT, CONTROL, CAMERA, PLACE, SIGMAS = (
    "Arguments", "Input", "Control and check points", "Camera", "Coordinate system", "Standard deviations",
)  # fmt: skip
METHOD, SURFACE, MACHINES, OUTPUT, HELP = "Method", "Surface and base", "Machines", "Output", "Help"
DOCUMENTS = "Documents"
"""Panels of options."""
FIRST, BLOCKS, ADJUSTMENT, IMAGE_ERRORS, TERRAIN, PLANNING = (
    "All steps", "Blocks", "Adjustment", "Image errors", "Terrain and volumes", "Before the flight",
)  # fmt: skip
"""Panels of commands."""
COMMAND_PANELS = (FIRST, BLOCKS, ADJUSTMENT, IMAGE_ERRORS, TERRAIN, PLANNING, HELP)
"""In the order in which help shows them."""

Json = Annotated[
    bool, typer.Option("--json", help="Print the outcome as JSON instead of text.", rich_help_panel=OUTPUT)
]
Overwrite = Annotated[
    bool,
    typer.Option(
        "--overwrite", help="Replace files that aerotri has not written, or that were changed since.",
        rich_help_panel=OUTPUT,
    ),
]  # fmt: skip
Workers = Annotated[
    str,
    typer.Option(
        "--executor",
        help="Where the work is done: threads, processes:N of this machine, dask:ADDRESS of a Dask scheduler, or "
        "dask:local:N. The outcome is the same.",
        rich_help_panel=MACHINES,
    ),
]
BlockFolder = Annotated[Path, typer.Argument(help="Block folder, or its block.toml.", rich_help_panel=ARGUMENTS)]
ResultFolder = Annotated[Path, typer.Argument(help="Result folder of `aerotri adjust`.", rich_help_panel=ARGUMENTS)]
GeoidGrid = Annotated[
    Path | None,
    typer.Option(
        help="Geoid grid (PROJ GeoTIFF) for heights above sea level that PROJ has no grid for.", rich_help_panel=PLACE
    ),
]
Robust = Annotated[
    str | None,
    typer.Option(
        help="Robust estimation: off, huber, danish, cauchy, adaptive or data-snooping. Default: as block.toml says.",
        rich_help_panel=METHOD,
    ),
]
MarkedControl = Annotated[
    str,
    typer.Option(
        help="Control points with their image points: gcp_list.txt of OpenDroneMap, or CSV.", rich_help_panel=CONTROL
    ),
]
CheckPoints = Annotated[
    list[str] | None,
    typer.Option(
        help="Name of a control point that is to be a check point: compared, not used. May be repeated.",
        rich_help_panel=CONTROL,
    ),
]
AxesOfLists = Annotated[
    str | None,
    typer.Option(
        help="yx where Y, or the latitude, comes first in lists that do not name their columns. Default: as their "
        "coordinate system has them. In lists with an order of their own (names of columns, gcp_list.txt, geo.txt) yx "
        "exchanges X and Y, which is told: of the control points, of positions where there are none.",
        rich_help_panel=INPUT,
    ),
]
ColumnsOfList = Annotated[
    str,
    typer.Option(
        help="Columns of a list of control points that does not name them (of positions where there are none): PNEZD, "
        "or names as name,Y,X,Z,-.",
        rich_help_panel=INPUT,
    ),
]
ControlPrefix = Annotated[
    str,
    typer.Option(
        help="What stands before the names of control points in image points or in their list alone, such as GCP_.",
        rich_help_panel=CONTROL,
    ),
]
ControlSigma = Annotated[
    str,
    typer.Option(
        help="σ of control points that have none: X,Y,Z in m, or one value for all; 0 holds them.",
        rich_help_panel=SIGMAS,
    ),
]
PositionsSigma = Annotated[
    str,
    typer.Option(
        help="σ of positions that have none: X,Y,Z in m, or one value for all.", rich_help_panel=SIGMAS
    ),
]  # fmt: skip
OrientationSigma = Annotated[
    str,
    typer.Option(
        help="Positions of --orientation are observations with this σ: X,Y,Z in m.", rich_help_panel=SIGMAS
    ),
]  # fmt: skip
AnglesSigma = Annotated[
    str,
    typer.Option(
        help="Angles of --orientation are observations with this σ: omega,phi,kappa in degrees.",
        rich_help_panel=SIGMAS,
    ),
]  # fmt: skip
PhotographPositions = Annotated[
    str,
    typer.Option(
        help="Positions of the photographs, in place of those in EXIF: a list, a trajectory (RTKLIB .pos, GrafNav), or "
        "time stamps with the drone's own solution (.MRK).",
        rich_help_panel=INPUT,
    ),
]
TimeStampsOfFlight = Annotated[
    str,
    typer.Option(
        "--time-stamps",
        help="When the photographs were taken, where --positions is a trajectory: .MRK of the drone, or a folder of "
        "them. Default: those beside the photographs.",
        rich_help_panel=INPUT,
    ),
]
CameraFile = Annotated[
    Path | None,
    typer.Option(
        help="File with the camera: tables camera.NAME as in block.toml, Metashape (XML), IGN, or orthority.",
        rich_help_panel=CAMERA,
    ),
]  # fmt: skip
CameraName = Annotated[str, typer.Option(help="Name of the camera.", rich_help_panel=CAMERA)]
CameraSize = Annotated[str, typer.Option(help="Columns and rows, pixels, as 8192x5460.", rich_help_panel=CAMERA)]
StatedPixelSize = Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel, µm.", rich_help_panel=CAMERA)]
StatedFocalLength = Annotated[
    float | None, typer.Option(min=1e-6, help="Focal length (principal distance), mm.", rich_help_panel=CAMERA)
]
FocalLength = Annotated[
    float | None,
    typer.Option(min=1e-6, help="Focal length (principal distance), mm, in place of EXIF.", rich_help_panel=CAMERA),
]
PixelSize = Annotated[
    float | None, typer.Option(min=1e-6, help="Size of a pixel, µm, in place of EXIF.", rich_help_panel=CAMERA)
]
SystemOfPhotographs = Annotated[
    str,
    typer.Option(
        help="Coordinate system, such as EPSG:25832. Default: that of the control points, else UTM by EXIF.",
        rich_help_panel=PLACE,
    ),
]  # fmt: skip
Seed = Annotated[
    int,
    typer.Option(
        help="Number that random choices start from; the same gives the same outcome.", rich_help_panel=METHOD
    ),
]


def cell_of_surface(help: str, panel: str) -> Any:
    """The option for the cells of a dense surface, by either of its names."""
    return typer.Option("--resolution", "--cell", min=1e-6, help=help, rich_help_panel=panel)


SurfaceLayer = Annotated[
    str,
    typer.Option(
        "--layer",
        help="Which surface of a folder of `aerotri dtm` or `aerotri dsm`: dsm with objects (piles are objects), or "
        "dtm, the ground alone.",
        rich_help_panel=SURFACE,
    ),
]
BoundarySigma = Annotated[
    float, typer.Option(min=0.0, help="σ of a corner of the boundary, m.", rich_help_panel=SIGMAS)
]
BoundaryOrigin = Annotated[
    str,
    typer.Option(
        help="survey: the boundary is known in space; product: it was drawn on this surface or its orthophoto and "
        "moves with it.",
        rich_help_panel=SIGMAS,
    ),
]
DensityOf = Annotated[
    float | None, typer.Option(min=1e-3, help="Mass of a cubic metre, t/m³: gives tonnes.", rich_help_panel=METHOD)
]
DensitySigma = Annotated[
    float, typer.Option(min=0.0, help="σ of the density, t/m³, common to all piles.", rich_help_panel=SIGMAS)
]
ProjectOf = Annotated[
    Path | None,
    typer.Option(
        "--project",
        help="Block, result or TOML file whose [project] stands at the head of pages. Default: that of what is given.",
        rich_help_panel=OUTPUT,
    ),
]
