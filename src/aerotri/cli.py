"""The commands: thin, each a few lines around the package; heavy imports only where they are used."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerotri import __version__
from aerotri.conventions import InputError

if TYPE_CHECKING:
    pass

app = typer.Typer(
    name="aerotri",
    help="Bundle block adjustment with self-calibration for aerial photographs, and how sure it is.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Json = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON instead of text.")]


def main() -> None:
    """Entry point: bad input is one line and exit 2, a failed adjustment its status and exit 1."""
    try:
        app()
    except InputError as error:
        print(f"aerotri: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except BrokenPipeError:
        raise SystemExit(0) from None
    except Exception as error:
        if os.environ.get("AEROTRI_DEBUG"):
            raise
        text = f"aerotri: unexpected {type(error).__name__}: {error} — please report it; AEROTRI_DEBUG=1 tells where"
        print(text, file=sys.stderr)
        raise SystemExit(1) from None
    except KeyboardInterrupt:
        print("aerotri: interrupted, nothing was written", file=sys.stderr)
        raise SystemExit(130) from None


@app.callback(invoke_without_command=True)
def version(show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if show:
        print(__version__)
        raise typer.Exit


@app.command(epilog="Example: aerotri adjust blocks/frederiksstad_ultracam --parameters bluh:1-12,ultracam_d:42-73")
def adjust(
    block: Annotated[Path, typer.Argument(help="Block folder, or its block.toml.")],
    out: Annotated[Path | None, typer.Option(help="Result folder; default NAME_result in the current folder.")] = None,
    parameters: Annotated[
        str | None, typer.Option(help="Additional parameters: bluh:1-8+12,ultracam_d:42-73, brown:K1+K2, none, auto.")
    ] = None,
    robust: Annotated[str | None, typer.Option(help="off, huber, danish, cauchy, adaptive or data-snooping.")] = None,
    geoid: Annotated[
        Path | None, typer.Option(help="Geoid grid (PROJ GeoTIFF) for heights that the CRS does not bring along.")
    ] = None,
    check_free: Annotated[
        bool, typer.Option("--check-free", help="Adjust free as well: is an error in the tie points or in the control?")
    ] = False,
    plots: Annotated[bool, typer.Option(help="Draw the plots and the report.")] = True,
    json_: Json = False,
) -> None:
    """Adjust a block: orientation, points, self-calibration, and σ of everything."""
    from aerotri.commands.adjust import run_adjust

    raise typer.Exit(run_adjust(block, out, parameters, robust, geoid, plots, json_, check_free))


@app.command(epilog="Example: aerotri parameters --family dmc --draw patterns")
def parameters(
    family: Annotated[str | None, typer.Option(help="One family in full, such as bluh or dmc.")] = None,
    draw: Annotated[Path | None, typer.Option(help="Folder to picture every pattern in.")] = None,
    json_: Json = False,
) -> None:
    """The sets of additional parameters: names, mark, source, pattern."""
    from aerotri.commands.parameters import run_parameters

    run_parameters(draw, family, json_)


@app.command(epilog="Example: aerotri diff before_result after_result --top 10")
def diff(
    first: Annotated[Path, typer.Argument(help="Result folder of the first run.")],
    second: Annotated[Path, typer.Argument(help="Result folder of the second run; its σ measure the changes.")],
    top: Annotated[int, typer.Option(help="How many photographs, points, rays to name.")] = 5,
    json_: Json = False,
) -> None:
    """What changed between two runs, against σ."""
    from aerotri.commands.diff import run_diff

    raise typer.Exit(run_diff(first, second, top, json_))


@app.command(epilog="Example: aerotri simulate blocks/frederiksstad_ultracam/simulation.toml --out demo --seed 1")
def simulate(
    spec: Annotated[Path, typer.Argument(help="Flight plan (TOML).")],
    out: Annotated[Path, typer.Option(help="Block folder to write; its truth/ stands inside.")],
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same block.")] = 1,
    render: Annotated[bool, typer.Option("--render", help="Photographs of it too, 16 bit TIFF.")] = False,
    only: Annotated[list[str] | None, typer.Option(help="Photograph to render; may repeat. Default: all.")] = None,
    targets: Annotated[bool, typer.Option("--targets", help="Render discs at control and check points.")] = False,
    blur_px: Annotated[float, typer.Option(min=0.0, max=20.0, help="σ of the point spread rendered, px.")] = 0.5,
    noise: Annotated[float, typer.Option(min=0.0, max=20000.0, help="σ of the grey values rendered.")] = 50.0,
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
    run_simulate(spec, out, seed, json_, options, tuple(only or ()))


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
    geoid: Annotated[Path | None, typer.Option(help="Geoid grid for its heights.")] = None,
    image_sigma_um: Annotated[float | None, typer.Option(min=1e-6, help="σ of image coordinates, µm.")] = None,
    image_sigma_px: Annotated[float | None, typer.Option(min=1e-6, help="σ of image coordinates, pixels.")] = None,
    positions_sigma_m: Annotated[str, typer.Option(help="σ of positions without one: X,Y,Z in m.")] = "",
    orientation_sigma_m: Annotated[str, typer.Option(help="Orientations are observations: σ X,Y,Z in m.")] = "",
    orientation_sigma_deg: Annotated[str, typer.Option(help="The same of omega,phi,kappa in degrees.")] = "",
    control_sigma_m: Annotated[str, typer.Option(help="σ of control points without one: X,Y,Z in m.")] = "",
    control_prefix: Annotated[str, typer.Option(help="What image points have before names of control.")] = "",
    control_heights: Annotated[str, typer.Option(help="crs, or ellipsoidal.")] = "crs",
    check: Annotated[list[str] | None, typer.Option(help="Control point that is a check point; may repeat.")] = None,
    gnss_shift: Annotated[str | None, typer.Option(help="off, block or strip.")] = None,
    axes: Annotated[str | None, typer.Option(help="Order of coordinates in lists of Pix4D: xy or yx.")] = None,
    offset: Annotated[Path | None, typer.Option(help="_offset.xyz of Pix4D, added to orientations.")] = None,
    patb_rotation: Annotated[str | None, typer.Option(help="camera-to-object or object-to-camera.")] = None,
    linear_alteration: Annotated[
        float | None, typer.Option(help="Height of the ground, where heights of .OPK are corrected for scale.")
    ] = None,
    json_: Json = False,
) -> None:
    """Convert between formats, or make a block of several files; adjusts first where the target needs it."""
    from aerotri.commands.convert import camera_spec, run_convert, three_values
    from aerotri.formats.assemble import Statements
    from aerotri.formats.project import Request

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
            control_sigma_m=three_values(control_sigma_m, "--control-sigma-m"),
            positions_sigma_m=three_values(positions_sigma_m, "--positions-sigma-m"),
            orientation_sigma_m=three_values(orientation_sigma_m, "--orientation-sigma-m"),
            orientation_sigma_deg=three_values(orientation_sigma_deg, "--orientation-sigma-deg"),
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
    run_convert(request, target, to, json_)


@app.command(epilog="Example: aerotri crosscheck blocks/frederiksstad_ultracam --out check")
def crosscheck(
    source: Annotated[Path, typer.Argument(help="A result folder, a block, or any format that convert reads.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_crosscheck here.")] = None,
    json_: Json = False,
) -> None:
    """Adjust the same block by pycolmap and by Ceres with an independent model, and compare against σ."""
    from aerotri.commands.crosscheck import run_crosscheck

    raise typer.Exit(run_crosscheck(source, out, json_))


@app.command(epilog="Example: aerotri imgeo saar_result photographs/*.tif --out ideal")
def imgeo(
    result: Annotated[Path, typer.Argument(help="Result folder of `aerotri adjust`.")],
    photographs: Annotated[
        list[Path] | None, typer.Argument(help="TIFF or JPEG files, named as in the block; none: the exports alone.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("ideal"),
    resampling: Annotated[str, typer.Option(help="bicubic or lanczos.")] = "bicubic",
    compression: Annotated[str, typer.Option(help="keep, deflate, lzw, zstd or none.")] = "keep",
    group: Annotated[
        str | None, typer.Option(help="Parameter group (camera, day) of photographs that are not in the block.")
    ] = None,
    json_: Json = False,
) -> None:
    """Photographs without systematic image errors, their camera, and the errors for other programs."""
    from aerotri.commands.imgeo import ImgeoOptions, run_imgeo

    run_imgeo(result, photographs or [], out, ImgeoOptions(resampling, compression, group), json_)


@app.command(epilog="Example: aerotri deform saar_result --end-lap 0.663 --variant absorbed --out saar_deformation")
def deform(
    result: Annotated[Path, typer.Argument(help="Result folder of `aerotri adjust`.")],
    pair: Annotated[
        tuple[str, str] | None, typer.Option(help="Two photographs of the block, left and right, as flown.")
    ] = None,
    end_lap: Annotated[
        float | None, typer.Option(help="End lap of a normal-case model, such as 0.663; its ground is flat.")
    ] = None,
    block: Annotated[
        bool, typer.Option("--block", help="The whole block, every node in the model nearest to it (the default).")
    ] = False,
    step: Annotated[
        int, typer.Option(help="With --block: pair every photograph with the STEP-th after it in its strip.")
    ] = 1,
    variant: Annotated[
        str, typer.Option(help="free: orientation of the result; absorbed: as adjusted without parameters.")
    ] = "free",
    dem: Annotated[Path | None, typer.Option(help="DEM to take the ground from (GeoTIFF); flat without.")] = None,
    spacing: Annotated[float | None, typer.Option(help="Metres between nodes.")] = None,
    gsd: Annotated[
        float | None, typer.Option(help="With --end-lap: GSD in metres, in place of the block's own.")
    ] = None,
    group: Annotated[
        str | None, typer.Option(help="With --end-lap: parameter group (camera, day), that of most photographs else.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_deformation here.")] = None,
    plots: Annotated[bool, typer.Option(help="Draw contours and profiles.")] = True,
    json_: Json = False,
) -> None:
    """What the systematic image errors do to stereo models: dX, dY, dZ and the σ of every node."""
    from aerotri.commands.deform import DeformOptions, run_deform

    options = DeformOptions(pair, end_lap, block, step, variant, dem, spacing, gsd, group)
    raise typer.Exit(run_deform(result, options, out, plots, json_))


@app.command(epilog="Example: aerotri demcor saar_result dem.tif --pair 01_003 01_004 --out dem_corrected.tif")
def demcor(
    result: Annotated[Path, typer.Argument(help="Result folder of `aerotri adjust` with additional parameters.")],
    dem: Annotated[Path, typer.Argument(help="DEM to correct (GeoTIFF), in the CRS of the block.")],
    out: Annotated[Path, typer.Option(help="Corrected DEM to write; dZ, σ and a JSON file stand beside it.")],
    pair: Annotated[
        tuple[str, str] | None, typer.Option(help="The two photographs the DEM was made of, left and right.")
    ] = None,
    models: Annotated[
        Path | None,
        typer.Option(help="Map of the models: polygons (GeoJSON, GeoPackage) with left and right, or a raster."),
    ] = None,
    model_table: Annotated[
        Path | None, typer.Option(help="Table number,left,right of a raster; default models.csv or NAME.csv beside it.")
    ] = None,
    dem_orientation: Annotated[
        str | None,
        typer.Option(
            help="Orientation the DEM was made with: images.csv, a result, or absorbed; default that of RESULT."
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """Free a DEM of the deformation of its models: heights and plan, window by window, with σ."""
    from aerotri.commands.demcor import run_demcor

    raise typer.Exit(run_demcor(result, dem, out, pair, models, model_table, dem_orientation, json_))


@app.command(epilog="Example: aerotri volume dtm.tif --boundary pile.gpkg --base boundary --adjustment saar_result")
def volume(
    dtm: Annotated[Path, typer.Argument(help="Surface (GeoTIFF).")],
    base: Annotated[
        str,
        typer.Option(
            help="level:HEIGHT, plane:X,Y,Z;X,Y,Z;X,Y,Z, plane (fitted to the boundary), boundary (spline through it), "
            "lowest (level of its lowest point), or another raster."
        ),
    ] = "boundary",
    boundary: Annotated[
        str | None, typer.Option(help="GeoPackage, GeoJSON, WKT file or WKT text; the whole surface without.")
    ] = None,
    method: Annotated[
        str, typer.Option(help="The one that counts: prisms, grid, trapezoidal, simpson, simpson38.")
    ] = "prisms",
    section_spacing: Annotated[float | None, typer.Option(min=1e-6, help="Metres between sections.")] = None,
    azimuth: Annotated[float, typer.Option(help="Degrees from north, in which sections follow one another.")] = 0.0,
    adjustment: Annotated[
        Path | None, typer.Option(help="Result folder the surface was measured with; gives the volume its σ.")
    ] = None,
    pickets: Annotated[
        Path | None, typer.Option(help="pickets.parquet of `aerotri dtm`; without, every cell is taken for one.")
    ] = None,
    base_adjustment: Annotated[Path | None, typer.Option(help="Result folder of a base that is a surface.")] = None,
    matching_sigma_um: Annotated[
        float | None, typer.Option(min=1e-6, help="σ of an image coordinate of a picket; default that of the block.")
    ] = None,
    matching_window: Annotated[
        float, typer.Option(min=0.0, help="Side of the matching window on the ground, m; its cells share noise.")
    ] = 0.0,
    base_sigma: Annotated[float, typer.Option(min=0.0, help="σ of the base's height, m, common to all of it.")] = 0.0,
    boundary_sigma: Annotated[float, typer.Option(min=0.0, help="σ of a corner of the boundary, m.")] = 0.0,
    uncorrected: Annotated[
        bool, typer.Option("--uncorrected", help="The photographs were measured with their image errors in them.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_volume here.")] = None,
    plots: Annotated[bool, typer.Option(help="Draw the plots and the page.")] = True,
    json_: Json = False,
) -> None:
    """A volume, cut and fill, and how sure it is: σ with every part named."""
    from aerotri.commands.volume import VolumeInput, run_volume
    from aerotri.volume.accuracy import SigmaOptions
    from aerotri.volume.compute import SectionPlan

    given = VolumeInput(dtm, base, boundary, method, adjustment, pickets, base_adjustment)
    options = SigmaOptions(
        matching_sigma_um, matching_window, base_sigma=base_sigma, boundary_sigma=boundary_sigma,
        corrected=not uncorrected,
    )  # fmt: skip
    raise typer.Exit(run_volume(given, SectionPlan(section_spacing, azimuth), options, out, plots, json_))


predict = typer.Typer(help="What a flight will give, before it is flown.", no_args_is_help=True, rich_markup_mode=None)
app.add_typer(predict, name="predict")


@predict.command(
    "volume", epilog="Example: aerotri predict volume --height 1500 --length 9000 --width 3600 --bridging 3600"
)
def predict_volume(
    height: Annotated[float, typer.Option(help="Flying height over the ground, m.")],
    length: Annotated[float, typer.Option(help="Of the area, along the strips, m.")],
    width: Annotated[float, typer.Option(help="Of the area, across the strips, m.")],
    bridging: Annotated[float, typer.Option(help="Distance between control points along the strips, m.")],
    sigma0_share: Annotated[float, typer.Option(help="σ of a height from one model over the flying height.")] = 2e-4,
    simulate: Annotated[bool, typer.Option("--simulate", help="Adjust a simulated flight of this design too.")] = False,
    seed: Annotated[int, typer.Option(help="Of the simulation.")] = 1,
    json_: Json = False,
) -> None:
    """The accuracy of a volume: Kubik's theory, repaired, and the adjustment of a simulated flight."""
    from aerotri.commands.predict import VolumeDesign, run_predict_volume

    run_predict_volume(VolumeDesign(height, length, width, bridging, sigma0_share), simulate, seed, json_)


@predict.command("attitude", epilog="Example: aerotri predict attitude --tolerance 1 --thickness 5")
def predict_attitude(
    tolerance: Annotated[float, typer.Option(min=1e-9, help="Of the volume, per cent, 1 σ.")],
    thickness: Annotated[float, typer.Option(help="Mean thickness of the volume, m.")],
    height: Annotated[float, typer.Option(help="Flying height over the ground, m.")] = 1500.0,
    base: Annotated[float, typer.Option(help="Between the photographs, m.")] = 900.0,
    focal_length: Annotated[float, typer.Option(help="mm.")] = 153.0,
    site: Annotated[tuple[float, float], typer.Option(help="Size along and across the base, m.")] = (400.0, 400.0),
    offset: Annotated[
        tuple[float, float], typer.Option(help="Of the site from the middle of the base, along and across it, m.")
    ] = (0.0, 0.0),
    json_: Json = False,
) -> None:
    """Which σ of ω, φ, κ the tolerance of a volume allows."""
    from aerotri.commands.predict import AttitudeDesign, run_predict_attitude

    design = AttitudeDesign(height, base, focal_length, site, offset, thickness, tolerance)
    run_predict_attitude(design, json_)


@app.command("compare-parameters", epilog="Example: aerotri compare-parameters saar --set none --set bluh:1-12")
def compare_parameters(
    block: Annotated[Path, typer.Argument(help="Block folder, or its block.toml.")],
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", help="A set, as adjust --parameters takes it; may repeat. Default: one of each family."),
    ] = None,
    folds: Annotated[
        int, typer.Option(min=2, max=1000, help="Parts in which control points are left out and predicted.")
    ] = 10,
    robust: Annotated[str | None, typer.Option(help="off, huber, danish, cauchy or adaptive.")] = None,
    geoid: Annotated[
        Path | None, typer.Option(help="Geoid grid (PROJ GeoTIFF) for heights that the CRS does not bring along.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_compare here.")] = None,
    json_: Json = False,
) -> None:
    """Sets of additional parameters side by side: fit, check points, cross-validation over control points."""
    from aerotri.commands.compare_parameters import run_compare_parameters

    raise typer.Exit(run_compare_parameters(block, sets or (), folds, robust, geoid, out, json_))


@app.command(
    epilog="Example: aerotri tiepoints photographs --out block --gcp gcp_list.txt --control-sigma-m 0.02 --check GCP7"
)
def tiepoints(
    photographs: Annotated[Path, typer.Argument(help="Folder of photographs, JPEG or TIFF.")],
    out: Annotated[Path, typer.Option(help="Block folder to write; features and matches are kept in it.")],
    gcp: Annotated[str, typer.Option(help="Control points with their image points, gcp_list.txt.")] = "",
    check: Annotated[list[str] | None, typer.Option(help="Control point that is a check point; may repeat.")] = None,
    positions: Annotated[str, typer.Option(help="Positions of the photographs, in place of EXIF.")] = "",
    orientation: Annotated[str, typer.Option(help="Orientations of the photographs; no first one is sought.")] = "",
    camera: Annotated[Path | None, typer.Option(help="Camera: [camera.NAME] tables (.toml), orthority.")] = None,
    focal_length_mm: Annotated[float | None, typer.Option(min=1e-6, help="In place of EXIF.")] = None,
    pixel_um: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel, µm, in place of EXIF.")] = None,
    free_interior: Annotated[bool, typer.Option(help="The interior of --camera is unknown.")] = False,
    crs: Annotated[str, typer.Option(help="Coordinate system; default that of control, else UTM of EXIF.")] = "",
    geoid: Annotated[Path | None, typer.Option(help="Geoid grid for its heights.")] = None,
    control_sigma_m: Annotated[str, typer.Option(help="σ of control points without one: X,Y,Z in m.")] = "",
    mark_sigma_px: Annotated[float, typer.Option(min=1e-3, help="σ of the image points of control.")] = 0.5,
    positions_sigma_m: Annotated[str, typer.Option(help="σ of positions without one: X,Y,Z in m.")] = "",
    orientation_sigma_m: Annotated[str, typer.Option(help="Orientations are observations: σ X,Y,Z in m.")] = "",
    orientation_sigma_deg: Annotated[str, typer.Option(help="The same of omega,phi,kappa in degrees.")] = "",
    points: Annotated[int, typer.Option(min=10, help="Tie points wanted in a photograph.")] = 1000,
    features: Annotated[int, typer.Option(min=100, help="Features sought in a photograph.")] = 8000,
    feature_size: Annotated[int, typer.Option(min=300, help="Features are sought in photographs of this size.")] = 2000,
    neighbours: Annotated[int, typer.Option(min=1, help="Photographs each is compared with, the nearest.")] = 20,
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same block.")] = 1,
    json_: Json = False,
) -> None:
    """From photographs to a block: tie points, first orientation, control."""
    from aerotri.commands.convert import three_values
    from aerotri.commands.tiepoints import TiePointOptions, run_tiepoints
    from aerotri.formats.assemble import Statements
    from aerotri.formats.camera_spec import CameraSpec

    stated = Statements(
        crs=crs,
        geoid=geoid,
        control_sigma_m=three_values(control_sigma_m, "--control-sigma-m"),
        positions_sigma_m=three_values(positions_sigma_m, "--positions-sigma-m"),
        orientation_sigma_m=three_values(orientation_sigma_m, "--orientation-sigma-m"),
        orientation_sigma_deg=three_values(orientation_sigma_deg, "--orientation-sigma-deg"),
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
    run_tiepoints(photographs, out, options, json_)


@app.command(epilog="Example: aerotri run photographs --out project --gcp gcp_list.txt --control-sigma-m 0.02")
def run(
    source: Annotated[Path, typer.Argument(help="Folder of photographs, or a block.")],
    out: Annotated[Path, typer.Option(help="Folder to write: block, result, dtm, volume, and one report.")],
    gcp: Annotated[str, typer.Option(help="Control points with their image points, gcp_list.txt.")] = "",
    check: Annotated[list[str] | None, typer.Option(help="Control point that is a check point; may repeat.")] = None,
    control_sigma_m: Annotated[str, typer.Option(help="σ of control points without one: X,Y,Z in m.")] = "",
    positions: Annotated[str, typer.Option(help="Positions of the photographs, in place of EXIF.")] = "",
    camera: Annotated[str, typer.Option(help="Camera: [camera.NAME] tables (.toml), orthority.")] = "",
    focal_length_mm: Annotated[str, typer.Option(help="In place of EXIF.")] = "",
    pixel_um: Annotated[str, typer.Option(help="Size of a pixel, µm, in place of EXIF.")] = "",
    crs: Annotated[str, typer.Option(help="Coordinate system; default that of control, else UTM of EXIF.")] = "",
    geoid: Annotated[str, typer.Option(help="Geoid grid for its heights.")] = "",
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same result.")] = 1,
    parameters: Annotated[str, typer.Option(help="Additional parameters of the adjustment.")] = "",
    interval: Annotated[str, typer.Option(help="Interval of the pickets of the DTM, or auto.")] = "",
    boundary: Annotated[str, typer.Option(help="Of a volume: GeoPackage, GeoJSON or WKT; no volume without.")] = "",
    base: Annotated[str, typer.Option(help="Of the volume, as aerotri volume takes it.")] = "",
    plots: Annotated[bool, typer.Option(help="Draw the plots of the adjustment.")] = True,
    json_: Json = False,
) -> None:
    """Everything: photographs to tie points, adjustment, terrain and volume, with one report."""
    from aerotri.commands.run import run_all

    def given(**values: str) -> tuple[str, ...]:
        return tuple(
            word for name, value in values.items() if value for word in (f"--{name.replace('_', '-')}", value)
        )

    passed_on = {
        "tiepoints": given(
            gcp=gcp, control_sigma_m=control_sigma_m, positions=positions, camera=camera,
            focal_length_mm=focal_length_mm, pixel_um=pixel_um, crs=crs, geoid=geoid, seed=str(seed),
        ) + tuple(word for name in check or () for word in ("--check", name)),
        "adjust": given(parameters=parameters, geoid=geoid) + (() if plots else ("--no-plots",)),
        "dtm": given(interval=interval),
        "volume": given(boundary=boundary, base=base) if boundary else (),
    }  # fmt: skip
    raise typer.Exit(run_all(source, out, passed_on, _invoke, _commands(), json_))


def _commands() -> set[str]:
    """Names of the commands there are."""
    return {info.name or info.callback.__name__ for info in app.registered_commands if info.callback is not None}


def _invoke(arguments: list[str]) -> int:
    """Exit code of a command line of this program.

    Raises
    ------
    InputError
    """
    ended = typer.main.get_command(app).main(arguments, prog_name="aerotri", standalone_mode=False)
    return ended if isinstance(ended, int) else 0


@app.command(epilog="Example: aerotri dtm saar_result photographs --out saar_dtm --interval 5")
def dtm(
    result: Annotated[Path, typer.Argument(help="Result folder of `aerotri adjust`.")],
    photographs: Annotated[list[Path], typer.Argument(help="Folders or files of the photographs, TIFF or JPEG.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_dtm here.")] = None,
    interval: Annotated[
        str, typer.Option(help="Metres between pickets, or auto: from the GSD and the relief.")
    ] = "auto",
    cell: Annotated[float | None, typer.Option(min=1e-6, help="Cell of the rasters, m; default interval / 2.")] = None,
    pairs: Annotated[
        bool, typer.Option("--pairs", help="Measure every picket in its best pair, as demcor wants it; else in all.")
    ] = False,
    step: Annotated[
        int | None, typer.Option(min=1, help="With --pairs: pair a photograph with the STEP-th after it.")
    ] = None,
    subset: Annotated[str, typer.Option(help="all, or even or odd photographs of every strip.")] = "all",
    area: Annotated[
        tuple[float, float, float, float] | None, typer.Option(help="X Y of the lower left, X Y of the upper right.")
    ] = None,
    window: Annotated[int, typer.Option(help="Pixels a side of the windows that are matched, odd.")] = 17,
    threshold: Annotated[float, typer.Option(min=0.0, max=1.0, help="Correlation from which a match counts.")] = 0.90,
    edge: Annotated[float, typer.Option(min=0.0, max=0.4, help="Share of the format at its edge not used.")] = 0.10,
    most_photographs: Annotated[int, typer.Option(min=2, max=20, help="Photographs of a picket, at most.")] = 5,
    breaklines: Annotated[Path | None, typer.Option(help="Lines with heights: .gpkg, .geojson or .dxf.")] = None,
    ideal: Annotated[
        bool, typer.Option("--ideal", help="The photographs are those of imgeo, free of image errors.")
    ] = False,
    plots: Annotated[bool, typer.Option(help="Draw the surface and the pickets.")] = True,
    json_: Json = False,
) -> None:
    """Pickets by image matching with σ, error pickets, and the surfaces they make with and without objects."""
    from aerotri.commands.dtm import DtmOptions, metres_or_auto, run_dtm

    options = DtmOptions(
        metres_or_auto(interval), cell, pairs, step, subset, area, window, threshold, edge, most_photographs,
        breaklines, ideal, plots,
    )  # fmt: skip
    raise typer.Exit(run_dtm(result, photographs, out, options, json_))


@app.command(epilog="Example: aerotri compare saar_dtm/dtm.tif laser.laz --align shift --out difference")
def compare(
    test: Annotated[Path, typer.Argument(help="Surface to judge: GeoTIFF, LAZ, pickets.parquet, or a folder of dtm.")],
    control: Annotated[Path, typer.Argument(help="Control surface of the same kinds.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default TEST_comparison here.")] = None,
    method: Annotated[str, typer.Option(help="Interpolation of both: linear or spline.")] = "linear",
    align: Annotated[str, typer.Option(help="Move the first onto the second: none, shift or rigid.")] = "none",
    cell: Annotated[float | None, typer.Option(min=1e-6, help="Cell of the differences, m.")] = None,
    plots: Annotated[bool, typer.Option(help="Draw map and histogram.")] = True,
    json_: Json = False,
) -> None:
    """Differences of two surfaces: RMSE, bias, NMAD, LE90, map and histogram."""
    from aerotri.commands.compare import run_compare

    run_compare(test, control, out, method, align, cell, plots, json_)


@predict.command("picket-interval", epilog="Example: aerotri predict picket-interval --scan-um 28 --scale 7000")
def predict_picket_interval(
    scan_um: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel in the image, µm.")] = None,
    scale: Annotated[float | None, typer.Option(min=1.0, help="Denominator of the photo scale.")] = None,
    gsd: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel on the ground, m.")] = None,
    k: Annotated[float | None, typer.Option(min=1e-6, help="Coefficient k; 0.08–0.09 mountains, 0.1 plain.")] = None,
    pilot: Annotated[Path | None, typer.Option(help="Result of `aerotri adjust`: measure a part and see.")] = None,
    photographs: Annotated[list[Path] | None, typer.Option(help="With --pilot: folder or files; may repeat.")] = None,
    area: Annotated[
        tuple[float, float, float, float] | None, typer.Option(help="With --pilot: X Y lower left, X Y upper right.")
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(min=1e-9, help="With --pilot: m, allowed RMSE between pickets; σ of a picket else.")
    ] = None,
    json_: Json = False,
) -> None:
    """How far apart pickets should be: by formula from scan and scale or GSD, or by a pilot."""
    from aerotri.commands.predict_interval import IntervalQuestion, run_predict_interval

    question = IntervalQuestion(scan_um, scale, gsd, k, pilot, tuple(photographs or ()), area, tolerance)
    run_predict_interval(question, json_)


if __name__ == "__main__":
    main()
