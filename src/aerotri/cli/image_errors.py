"""Command lines: what systematic image errors do, and their repair."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ARGUMENTS, IMAGE_ERRORS, INPUT, METHOD, OUTPUT, Json, Overwrite, ResultFolder, Workers
from aerotri.execution.choice import THREADS
from aerotri.rasters.photograph_settings import COMPRESSION, RESAMPLING


@app.command(
    rich_help_panel=IMAGE_ERRORS,
    epilog="Example: aerotri deform frederiksstad_ultracam_result --end-lap 0.663 --out deformation",
)
def deform(
    result: ResultFolder,
    pair: Annotated[
        tuple[str, str] | None,
        typer.Option(help="Two photographs of the block, left and right, as flown.", rich_help_panel=INPUT),
    ] = None,
    end_lap: Annotated[
        float | None,
        typer.Option(
            help="A model of two level photographs with this end lap, a share of 1 such as 0.663, over flat ground.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    block: Annotated[
        bool,
        typer.Option(
            "--block",
            help="The whole block, every place in the model nearest to it. This is the default.",
            rich_help_panel=INPUT,
        ),
    ] = False,
    step: Annotated[
        int,
        typer.Option(
            min=1,
            help="With --block: a pair is a photograph and the one this number of photographs further in its strip.",
            rich_help_panel=METHOD,
        ),
    ] = 1,
    variant: Annotated[
        str,
        typer.Option(
            help="free: orientation of the result; absorbed: as adjusted without additional parameters.",
            rich_help_panel=METHOD,
        ),
    ] = "free",
    dem: Annotated[
        Path | None,
        typer.Option(help="DEM (GeoTIFF) to take the ground from; flat without.", rich_help_panel=INPUT),
    ] = None,
    spacing: Annotated[
        float | None, typer.Option(help="Distance of the computed places, m.", rich_help_panel=METHOD)
    ] = None,
    gsd: Annotated[
        float | None,
        typer.Option(help="With --end-lap: GSD, m, in place of the block's own.", rich_help_panel=METHOD),
    ] = None,
    group: Annotated[
        str | None,
        typer.Option(
            help="With --end-lap: parameter group (camera, day). Default: that of most photographs.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_deformation here.", rich_help_panel=OUTPUT)
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw contours and profiles.", rich_help_panel=OUTPUT)] = True,
    json_: Json = False,
) -> None:
    """What the systematic image errors do to stereo models: dX, dY, dZ and the σ of every node."""
    from aerotri.commands.deform import DeformOptions, run_deform

    options = DeformOptions(pair, end_lap, block, step, variant, dem, spacing, gsd, group)
    raise typer.Exit(run_deform(result, options, out, plots, json_))


@app.command(
    rich_help_panel=IMAGE_ERRORS,
    epilog="Example: aerotri demcor drone_project/result drone_project/dtm/dsm.tif --pair 2_001.jpg 2_002.jpg "
    "--out dsm_corrected.tif",
)
def demcor(
    result: Annotated[
        Path,
        typer.Argument(help="Result folder of `aerotri adjust` with additional parameters.", rich_help_panel=ARGUMENTS),
    ],
    dem: Annotated[
        Path, typer.Argument(help="DEM to correct (GeoTIFF), in the CRS of the block.", rich_help_panel=ARGUMENTS)
    ],
    out: Annotated[
        Path,
        typer.Option(help="Corrected DEM to write; dZ, σ and a JSON file stand beside it.", rich_help_panel=OUTPUT),
    ],
    pair: Annotated[
        tuple[str, str] | None,
        typer.Option(help="The two photographs the DEM was made of, left and right.", rich_help_panel=INPUT),
    ] = None,
    models: Annotated[
        Path | None,
        typer.Option(
            help="Map of the models: polygons (GeoPackage, GeoJSON, Shapefile, FlatGeobuf) with left and right, or a "
            "raster.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    model_table: Annotated[
        Path | None,
        typer.Option(
            help="Table number,left,right of a raster; default models.csv or NAME.csv beside it.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    dem_orientation: Annotated[
        str | None,
        typer.Option(
            help="Orientation the DEM was made with: images.csv, a result, or absorbed. Default: that of RESULT.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    executor: Workers = THREADS,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Correct a DEM for the deformation of its models: heights and plan, window by window, with σ."""
    from aerotri.commands.demcor import run_demcor

    code = run_demcor(result, dem, out, pair, models, model_table, dem_orientation, json_, overwrite, executor)
    raise typer.Exit(code)


@app.command(
    rich_help_panel=IMAGE_ERRORS,
    epilog="Example: aerotri imgeo drone_project/result blocks/drone_site/photographs/2_002.jpg --out ideal",
)
def imgeo(
    result: ResultFolder,
    photographs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Photographs, TIFF or JPEG, named as in the block. Without any: the other files alone.",
            rich_help_panel=ARGUMENTS,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write.", rich_help_panel=OUTPUT)] = Path("ideal"),
    resampling: Annotated[str, typer.Option(help="bicubic or lanczos.", rich_help_panel=METHOD)] = RESAMPLING,
    compression: Annotated[
        str, typer.Option(help="keep, deflate, lzw, zstd or none.", rich_help_panel=OUTPUT)
    ] = COMPRESSION,
    group: Annotated[
        str | None,
        typer.Option(
            help="Parameter group (camera, day) of photographs that are not in the block.", rich_help_panel=METHOD
        ),
    ] = None,
    executor: Workers = THREADS,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Photographs without systematic image errors, their camera, and the errors for other programs."""
    from aerotri.commands.imgeo import ImgeoOptions, run_imgeo

    options = ImgeoOptions(cast(Any, resampling), cast(Any, compression), group)
    run_imgeo(result, photographs or [], out, options, json_, overwrite, executor)
