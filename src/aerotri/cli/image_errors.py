"""Command lines: what systematic image errors do, and their repair."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app
from aerotri.cli.options import Json, Overwrite, ResultFolder
from aerotri.rasters.photograph_settings import COMPRESSION, RESAMPLING


@app.command(epilog="Example: aerotri deform saar_result --end-lap 0.663 --variant absorbed --out saar_deformation")
def deform(
    result: ResultFolder,
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
        int, typer.Option(min=1, help="With --block: pair every photograph with the STEP-th after it in its strip.")
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
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Free a DEM of the deformation of its models: heights and plan, window by window, with σ."""
    from aerotri.commands.demcor import run_demcor

    raise typer.Exit(run_demcor(result, dem, out, pair, models, model_table, dem_orientation, json_, overwrite))


@app.command(epilog="Example: aerotri imgeo saar_result photographs/*.tif --out ideal")
def imgeo(
    result: ResultFolder,
    photographs: Annotated[
        list[Path] | None, typer.Argument(help="TIFF or JPEG files, named as in the block; none: the exports alone.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("ideal"),
    resampling: Annotated[str, typer.Option(help="bicubic or lanczos.")] = RESAMPLING,
    compression: Annotated[str, typer.Option(help="keep, deflate, lzw, zstd or none.")] = COMPRESSION,
    group: Annotated[
        str | None, typer.Option(help="Parameter group (camera, day) of photographs that are not in the block.")
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Photographs without systematic image errors, their camera, and the errors for other programs."""
    from aerotri.commands.imgeo import ImgeoOptions, run_imgeo

    options = ImgeoOptions(cast(Any, resampling), cast(Any, compression), group)
    run_imgeo(result, photographs or [], out, options, json_, overwrite)
