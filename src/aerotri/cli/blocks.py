"""Command lines: where blocks come from, where they go, and their check by other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from aerotri.cli.app import app
from aerotri.cli.options import (
    AnglesSigma,
    BlockFolder,
    CheckPoints,
    ControlPrefix,
    ControlSigma,
    GeoidGrid,
    GeoidOfSystem,
    Json,
    MarkedControl,
    OrientationSigma,
    Overwrite,
    PhotographPositions,
    PositionsSigma,
    SystemOfPhotographs,
)
from aerotri.conventions import InputError
from aerotri.tie_points.settings import DEFAULTS, LEAST


@app.command(epilog="Example: aerotri simulate blocks/frederiksstad_ultracam/simulation.toml --out demo --seed 1")
def simulate(
    spec: Annotated[Path, typer.Argument(help="Flight plan (TOML).")],
    out: Annotated[Path, typer.Option(help="Block folder to write; its truth/ stands inside.")],
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same block.")] = 1,
    render: Annotated[
        bool, typer.Option("--render", help="Photographs too: 16 bit TIFF, or JPEG with EXIF if the plan says so.")
    ] = False,
    only: Annotated[list[str] | None, typer.Option(help="Photograph to render; may repeat. Default: all.")] = None,
    targets: Annotated[bool, typer.Option("--targets", help="Render discs at control and check points.")] = False,
    blur_px: Annotated[float, typer.Option(min=0.0, max=20.0, help="σ of the point spread rendered, px.")] = 0.5,
    noise: Annotated[float, typer.Option(min=0.0, max=20000.0, help="σ of the grey values rendered.")] = 50.0,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Make a block with known truth from a flight plan, and photographs of it."""
    from aerotri.commands.simulate import run_simulate

    options = None
    if render:
        from aerotri.simulation.rendering import RenderOptions

        options = RenderOptions(blur_px=blur_px, noise=noise, targets=targets)
    elif only or targets:
        raise InputError("--only and --targets are about photographs", "add --render")
    run_simulate(spec, out, seed, json_, options, tuple(only or ()), overwrite)


@app.command(epilog="Example: aerotri convert bingo.txt block --positions rtk.csv --control gcp.csv --camera p1.toml")
def convert(
    source: Annotated[
        str,
        typer.Argument(
            help="Block, result, DBAT, BAL, COLMAP, Bundler, OpenSfM, a folder of IGN or PAT-B files, image points "
            "(BINGO, .im, .mes, gcp_list.txt) or a list of orientations; PATH or kind:PATH."
        ),
    ],
    target: Annotated[Path, typer.Argument(help="File or folder to write.")],
    to: Annotated[
        str,
        typer.Option(
            help="block, bal, colmap, colmap-text, bundler, opensfm, metashape (opk), pix4d-eo, ign, patb, bingo, "
            "pix4d-gcp, pix4d-geo, pix4d-offset, odm-gcp, odm-geo, ign-mes, ign-app."
        ),
    ] = "block",
    image_points: Annotated[list[str] | None, typer.Option(help="More image points; may be repeated.")] = None,
    positions: Annotated[str, typer.Option(help="Observed positions of the photographs.")] = "",
    control: Annotated[str, typer.Option(help="Control points.")] = "",
    orientation: Annotated[str, typer.Option(help="Orientations, as start values.")] = "",
    camera: Annotated[Path | None, typer.Option(help="Camera: [camera.NAME] tables (.toml), IGN, orthority.")] = None,
    camera_name: Annotated[str, typer.Option(help="Name of the camera.")] = "",
    camera_size: Annotated[str, typer.Option(help="Columns and rows, as 8192x5460.")] = "",
    pixel_um: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel, µm.")] = None,
    focal_length_mm: Annotated[float | None, typer.Option(min=1e-6, help="Principal distance, mm.")] = None,
    flight_axis: Annotated[str | None, typer.Option(help="Image axis along the flight: +x, -x, +y, -y.")] = None,
    free_interior: Annotated[bool, typer.Option(help="Focal length and principal point are unknowns.")] = False,
    crs: Annotated[str, typer.Option(help="Coordinate system, as EPSG:32647 or EPSG:25832+7837.")] = "",
    geoid: GeoidOfSystem = None,
    image_sigma_um: Annotated[float | None, typer.Option(min=1e-6, help="σ of image coordinates, µm.")] = None,
    image_sigma_px: Annotated[float | None, typer.Option(min=1e-6, help="σ of image coordinates, pixels.")] = None,
    positions_sigma_m: PositionsSigma = "",
    orientation_sigma_m: OrientationSigma = "",
    orientation_sigma_deg: AnglesSigma = "",
    control_sigma_m: ControlSigma = "",
    control_prefix: ControlPrefix = "",
    control_heights: Annotated[str, typer.Option(help="crs, or ellipsoidal.")] = "crs",
    check: CheckPoints = None,
    gnss_shift: Annotated[str | None, typer.Option(help="Shift of GNSS: off (default), block or strip.")] = None,
    axes: Annotated[str | None, typer.Option(help="Order of coordinates in lists of Pix4D: xy or yx.")] = None,
    offset: Annotated[Path | None, typer.Option(help="_offset.xyz of Pix4D, added to orientations.")] = None,
    patb_rotation: Annotated[str | None, typer.Option(help="camera-to-object or object-to-camera.")] = None,
    linear_alteration: Annotated[
        float | None, typer.Option(help="Height of the ground, where heights of .OPK are corrected for scale.")
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Convert between formats, or make a block of several files; adjusts first where the target needs it."""
    from aerotri.commands.convert import camera_spec, run_convert
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.project import Request

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
        ),
        check=tuple(check or ()),
        axes=axes,
        offset=offset,
        image_sigma_um=image_sigma_um,
        image_sigma_px=image_sigma_px,
        gnss_shift=gnss_shift,
    )
    run_convert(request, target, to, json_, overwrite)


@app.command(
    epilog="Example: aerotri tiepoints photographs --out block --gcp gcp_list.txt --control-sigma-m 0.02 --check GCP7"
)
def tiepoints(
    photographs: Annotated[Path, typer.Argument(help="Folder of photographs, JPEG or TIFF.")],
    out: Annotated[Path, typer.Option(help="Block folder to write; features and matches are kept in it.")],
    gcp: MarkedControl = "",
    check: CheckPoints = None,
    positions: PhotographPositions = "",
    orientation: Annotated[str, typer.Option(help="Orientations of the photographs; no first one is sought.")] = "",
    camera: Annotated[Path | None, typer.Option(help="Camera: [camera.NAME] tables (.toml), orthority.")] = None,
    focal_length_mm: Annotated[float | None, typer.Option(min=1e-6, help="In place of EXIF.")] = None,
    pixel_um: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel, µm, in place of EXIF.")] = None,
    free_interior: Annotated[bool, typer.Option(help="The interior of --camera is unknown.")] = False,
    crs: SystemOfPhotographs = "",
    geoid: GeoidOfSystem = None,
    control_sigma_m: ControlSigma = "",
    control_prefix: ControlPrefix = "",
    mark_sigma_px: Annotated[
        float, typer.Option(min=LEAST["mark_sigma_px"], help="σ of the image points of control.")
    ] = DEFAULTS.mark_sigma_px,
    positions_sigma_m: PositionsSigma = "",
    orientation_sigma_m: OrientationSigma = "",
    orientation_sigma_deg: AnglesSigma = "",
    points: Annotated[
        int, typer.Option(min=LEAST["points"], help="Tie points wanted in a photograph.")
    ] = DEFAULTS.points,
    features: Annotated[
        int, typer.Option(min=LEAST["features"], help="Features sought in a photograph.")
    ] = DEFAULTS.features,
    feature_size: Annotated[
        int, typer.Option(min=LEAST["feature_size"], help="Features are sought in photographs of this size.")
    ] = DEFAULTS.feature_size,
    neighbours: Annotated[
        int, typer.Option(min=LEAST["neighbours"], help="Photographs each is compared with, the nearest.")
    ] = DEFAULTS.neighbours,
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same block.")] = DEFAULTS.seed,
    overwrite: Overwrite = False,
    json_: Json = False,
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
    )
    options = TiePointOptions(
        gcp=gcp,
        check=tuple(check or ()),
        positions=positions,
        orientation=orientation,
        camera=CameraSpec(camera, "", None, pixel_um, focal_length_mm, None, free_interior),
        stated=stated,
        mark_sigma_px=mark_sigma_px,
        points=points,
        features=features,
        feature_size_px=feature_size,
        neighbours=neighbours,
        seed=seed,
    )
    run_tiepoints(photographs, out, options, json_, overwrite)


def _stated_sigmas(control: str, positions: str, orientation: str, angles: str) -> dict[str, Any]:
    """The σ of the command line as `Statements` takes them."""
    from aerotri.commands.convert import three_values

    return {
        "control_sigma_m": three_values(control, "--control-sigma-m", may_be_zero=True),
        "positions_sigma_m": three_values(positions, "--positions-sigma-m"),
        "orientation_sigma_m": three_values(orientation, "--orientation-sigma-m"),
        "orientation_sigma_deg": three_values(angles, "--orientation-sigma-deg"),
    }


@app.command(epilog="Example: aerotri init gravel_pit --camera-size 8192x5460 --pixel-um 4.4 --focal-length-mm 35")
def init(
    folder: Annotated[Path, typer.Argument(help="Folder of the new block; no file in it is replaced.")],
    camera_name: Annotated[str, typer.Option(help="Name of the camera.")] = "camera",
    camera_size: Annotated[str, typer.Option(help="Columns and rows, px, as 8192x5460.")] = "",
    pixel_um: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel, µm.")] = None,
    focal_length_mm: Annotated[float | None, typer.Option(min=1e-6, help="Principal distance, mm.")] = None,
    json_: Json = False,
) -> None:
    """Begin a block: block.toml with every key explained, and empty tables with their columns."""
    from aerotri.commands.init import run_init

    run_init(folder, camera_name, camera_size, pixel_um, focal_length_mm, json_)


@app.command(epilog="Example: aerotri check blocks/frederiksstad_ultracam")
def check(
    block: BlockFolder,
    control_prefix: ControlPrefix = "",
    geoid: GeoidGrid = None,
    json_: Json = False,
) -> None:
    """Read a block without adjusting it: what it holds, what looks wrong, what an adjustment lacks."""
    from aerotri.commands.check import run_check

    raise typer.Exit(run_check(block, control_prefix, geoid, json_))


@app.command(epilog="Example: aerotri crosscheck blocks/frederiksstad_ultracam --out check")
def crosscheck(
    source: Annotated[Path, typer.Argument(help="A result folder, a block, or any format that convert reads.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_crosscheck here.")] = None,
    json_: Json = False,
) -> None:
    """Adjust the same block by pycolmap and by Ceres with an independent model, and compare against σ."""
    from aerotri.commands.crosscheck import run_crosscheck

    raise typer.Exit(run_crosscheck(source, out, json_))
