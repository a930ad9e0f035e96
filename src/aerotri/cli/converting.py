"""Command lines: blocks from photographs and from files of other programs, and files for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from aerotri.cli.app import app
from aerotri.cli.options import (
    ARGUMENTS,
    BLOCKS,
    CAMERA,
    CONTROL,
    INPUT,
    METHOD,
    OUTPUT,
    PLACE,
    SIGMAS,
    AnglesSigma,
    AxesOfLists,
    CameraFile,
    CameraName,
    CameraSize,
    CheckPoints,
    ColumnsOfList,
    ControlPrefix,
    ControlSigma,
    FocalLength,
    GeoidGrid,
    Json,
    MarkedControl,
    OrientationSigma,
    Overwrite,
    PhotographPositions,
    PixelSize,
    PositionsSigma,
    ProjectOf,
    Seed,
    StatedFocalLength,
    StatedPixelSize,
    SystemOfPhotographs,
    TimeStampsOfFlight,
    Workers,
)
from aerotri.execution.choice import THREADS
from aerotri.tie_points.settings import DEFAULTS, LEAST


@app.command(
    rich_help_panel=BLOCKS, epilog="Example: aerotri convert drone_project/result --to colmap-text --out drone_colmap"
)
def convert(
    source: Annotated[
        str,
        typer.Argument(
            help="Block, result, DBAT, BAL, COLMAP, Bundler, OpenSfM, Metashape (.psx, .psz, cameras XML), "
            "BlocksExchange XML, a folder of IGN or PAT-B files, image points (BINGO, .im, .mes, gcp_list.txt) or a "
            "list of orientations; PATH or kind:PATH.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    target: Annotated[Path | None, typer.Argument(hidden=True, help="The old form of --out.")] = None,
    out: Annotated[Path | None, typer.Option(help="File or folder to write.", rich_help_panel=OUTPUT)] = None,
    to: Annotated[
        str,
        typer.Option(
            help="block, bal, colmap, colmap-text, bundler, opensfm, metashape (opk), metashape-camera, metashape-xml, "
            "blocks-exchange, pix4d-eo, ign, patb, bingo, pix4d-gcp, pix4d-geo, pix4d-offset, odm-gcp, odm-geo, "
            "ign-mes, ign-app.",
            rich_help_panel=OUTPUT,
        ),
    ] = "block",
    image_points: Annotated[
        list[str] | None,
        typer.Option(help="More files of image points. May be repeated.", rich_help_panel=INPUT),
    ] = None,
    positions: Annotated[
        str,
        typer.Option(
            help="Observed positions of the photographs: a list, a trajectory (RTKLIB .pos, GrafNav), or time stamps "
            "with the drone's own solution (.MRK).",
            rich_help_panel=INPUT,
        ),
    ] = "",
    time_stamps: Annotated[
        str,
        typer.Option(
            help="When the photographs were taken, where --positions is a trajectory: .MRK of the drone, or a folder "
            "of them.",
            rich_help_panel=INPUT,
        ),
    ] = "",
    control: Annotated[str, typer.Option(help="List of control points.", rich_help_panel=CONTROL)] = "",
    orientation: Annotated[
        str, typer.Option(help="List of orientations, as start values.", rich_help_panel=INPUT)
    ] = "",
    camera: CameraFile = None,
    camera_name: CameraName = "",
    camera_size: CameraSize = "",
    pixel_um: StatedPixelSize = None,
    focal_length_mm: StatedFocalLength = None,
    flight_axis: Annotated[
        str | None,
        typer.Option(help="Image axis along the flight: +x, -x, +y, -y.", rich_help_panel=CAMERA),
    ] = None,
    free_interior: Annotated[
        bool, typer.Option(help="Focal length and principal point are unknowns.", rich_help_panel=CAMERA)
    ] = False,
    crs: Annotated[
        str,
        typer.Option(help="Coordinate system, as EPSG:32647 or EPSG:25832+7837.", rich_help_panel=PLACE),
    ] = "",
    geoid: GeoidGrid = None,
    image_sigma_um: Annotated[
        float | None, typer.Option(min=1e-6, help="σ of image coordinates, µm.", rich_help_panel=SIGMAS)
    ] = None,
    image_sigma_px: Annotated[
        float | None, typer.Option(min=1e-6, help="σ of image coordinates, pixels.", rich_help_panel=SIGMAS)
    ] = None,
    positions_sigma_m: PositionsSigma = "",
    orientation_sigma_m: OrientationSigma = "",
    orientation_sigma_deg: AnglesSigma = "",
    control_sigma_m: ControlSigma = "",
    control_prefix: ControlPrefix = "",
    control_heights: Annotated[
        str,
        typer.Option(help="Heights of control: crs (those of the system), or ellipsoidal.", rich_help_panel=PLACE),
    ] = "crs",
    check: CheckPoints = None,
    gnss_shift: Annotated[
        str | None,
        typer.Option(help="Shift of GNSS as an unknown: off (default), block or strip.", rich_help_panel=METHOD),
    ] = None,
    axes: AxesOfLists = None,
    columns: ColumnsOfList = "",
    offset: Annotated[
        Path | None, typer.Option(help="_offset.xyz of Pix4D, added to orientations.", rich_help_panel=INPUT)
    ] = None,
    patb_rotation: Annotated[
        str | None,
        typer.Option(help="Matrices of PAT-B: camera-to-object or object-to-camera.", rich_help_panel=INPUT),
    ] = None,
    linear_alteration: Annotated[
        float | None,
        typer.Option(
            help="Height of the ground, m, where heights of .OPK are corrected for scale.", rich_help_panel=INPUT
        ),
    ] = None,
    station_pattern: Annotated[
        str,
        typer.Option(
            help="Where exposure and camera of a rig stand in names of photographs: IMG_{station}_{camera}.tif.",
            rich_help_panel=INPUT,
        ),
    ] = "",
    rig_reference: Annotated[
        str,
        typer.Option(help="Reference camera of that rig; default: that with most photographs.", rich_help_panel=INPUT),
    ] = "",
    in_place: Annotated[
        bool,
        typer.Option(
            help="--out is the project that the block was read from (colmap, opensfm): it takes over the orientation.",
            rich_help_panel=OUTPUT,
        ),
    ] = False,
    parts: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="Number of parts to write the block in, for adjust --executor, never holding its image points "
            "(COLMAP, PAT-B, BINGO).",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Convert between formats, or make a block of several files; adjusts first where the target needs it."""
    from aerotri.commands.console import OldForm
    from aerotri.commands.convert import camera_spec, run_convert, run_convert_parts
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.project import Request

    form = OldForm(out, target, "the target as second argument", "--out TARGET")
    request = Request(
        source=source,
        name="",
        image_points=tuple(image_points or ()),
        orientation=orientation,
        positions=positions,
        control=control,
        camera=camera_spec(camera, camera_name, camera_size, pixel_um, focal_length_mm, flight_axis, free_interior),
        stated=Statements(
            crs=crs,
            geoid=geoid,
            **_stated_sigmas(control_sigma_m, positions_sigma_m, orientation_sigma_m, orientation_sigma_deg),
            control_prefix=control_prefix,
            control_heights=control_heights,
            linear_alteration_m=linear_alteration,
            patb_rotation=patb_rotation,
            axes=axes,
            columns=columns,
        ),
        check=tuple(check or ()),
        offset=offset,
        image_sigma_um=image_sigma_um,
        image_sigma_px=image_sigma_px,
        gnss_shift=gnss_shift,
        station_pattern=station_pattern,
        rig_reference=rig_reference,
        time_stamps=time_stamps,
    )
    if parts is None:
        run_convert(request, form.needed(), to, json_, overwrite, in_place)
    else:
        run_convert_parts(request, form.needed(), to, parts, json_, in_place)
    form.tell()


@app.command(
    rich_help_panel=BLOCKS,
    epilog="Example: aerotri tiepoints blocks/drone_site/photographs --out drone_block "
    "--gcp blocks/drone_site/gcp_list.txt --control-sigma-m 0.01,0.01,0.02 --check K01",
)
def tiepoints(
    photographs: Annotated[
        Path, typer.Argument(help="Folder of photographs, JPEG or TIFF.", rich_help_panel=ARGUMENTS)
    ],
    out: Annotated[
        Path,
        typer.Option(help="Block folder to write; features and matches are kept in it.", rich_help_panel=OUTPUT),
    ],
    gcp: MarkedControl = "",
    check: CheckPoints = None,
    positions: PhotographPositions = "",
    time_stamps: TimeStampsOfFlight = "",
    orientation: Annotated[
        str,
        typer.Option(help="List of orientations; none is sought then.", rich_help_panel=INPUT),
    ] = "",
    camera: CameraFile = None,
    focal_length_mm: FocalLength = None,
    pixel_um: PixelSize = None,
    free_interior: Annotated[
        bool, typer.Option(help="The interior orientation of --camera is unknown.", rich_help_panel=CAMERA)
    ] = False,
    crs: SystemOfPhotographs = "",
    geoid: GeoidGrid = None,
    control_sigma_m: ControlSigma = "",
    control_prefix: ControlPrefix = "",
    axes: AxesOfLists = None,
    columns: ColumnsOfList = "",
    mark_sigma_px: Annotated[
        float,
        typer.Option(
            min=LEAST["mark_sigma_px"], help="σ of the image points of control, pixels.", rich_help_panel=SIGMAS
        ),
    ] = DEFAULTS.mark_sigma_px,
    positions_sigma_m: PositionsSigma = "",
    orientation_sigma_m: OrientationSigma = "",
    orientation_sigma_deg: AnglesSigma = "",
    points: Annotated[
        int,
        typer.Option(min=LEAST["points"], help="Number of tie points wanted in a photograph.", rich_help_panel=METHOD),
    ] = DEFAULTS.points,
    features: Annotated[
        int,
        typer.Option(min=LEAST["features"], help="Number of features sought in a photograph.", rich_help_panel=METHOD),
    ] = DEFAULTS.features,
    feature_size: Annotated[
        int,
        typer.Option(
            min=LEAST["feature_size"],
            help="Longer side, pixels, to which photographs are reduced for the search.",
            rich_help_panel=METHOD,
        ),
    ] = DEFAULTS.feature_size,
    neighbours: Annotated[
        int,
        typer.Option(
            min=LEAST["neighbours"],
            help="Number of photographs that each is compared with, the nearest.",
            rich_help_panel=METHOD,
        ),
    ] = DEFAULTS.neighbours,
    seed: Seed = DEFAULTS.seed,
    project: ProjectOf = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    executor: Workers = THREADS,
) -> None:
    """From photographs to a block: tie points, first orientation, control."""
    from aerotri.commands.tiepoints import TiePointOptions, run_tiepoints
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.camera_spec import CameraSpec

    stated = Statements(
        crs=crs,
        geoid=geoid,
        **_stated_sigmas(control_sigma_m, positions_sigma_m, orientation_sigma_m, orientation_sigma_deg),
        control_prefix=control_prefix,
        axes=axes,
        columns=columns,
    )
    options = TiePointOptions(
        gcp=gcp,
        check=tuple(check or ()),
        positions=positions,
        time_stamps=time_stamps,
        orientation=orientation,
        camera=CameraSpec(camera, "", None, pixel_um, focal_length_mm, None, free_interior),
        stated=stated,
        mark_sigma_px=mark_sigma_px,
        points=points,
        features=features,
        feature_size_px=feature_size,
        neighbours=neighbours,
        seed=seed,
        executor=executor,
        project=project,
    )
    raise typer.Exit(run_tiepoints(photographs, out, options, json_, overwrite))


def _stated_sigmas(control: str, positions: str, orientation: str, angles: str) -> dict[str, Any]:
    """The σ of the command line as `Statements` takes them."""
    from aerotri.commands.convert import three_values

    return {
        "control_sigma_m": three_values(control, "--control-sigma-m", may_be_zero=True),
        "positions_sigma_m": three_values(positions, "--positions-sigma-m"),
        "orientation_sigma_m": three_values(orientation, "--orientation-sigma-m"),
        "orientation_sigma_deg": three_values(angles, "--orientation-sigma-deg"),
    }
