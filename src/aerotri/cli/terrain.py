"""Command lines: surfaces by image matching, and their comparison."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app, predict
from aerotri.cli.options import Json, ResultFolder
from aerotri.terrain.settings import (
    ALIGNMENT,
    DEFAULTS,
    FEWEST_PHOTOGRAPHS,
    INTERPOLATION,
    LARGEST_EDGE,
    MOST_PHOTOGRAPHS,
    TerrainSettings,
)


@app.command(epilog="Example: aerotri dtm saar_result photographs --out saar_dtm --interval 5")
def dtm(
    result: ResultFolder,
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
    subset: Annotated[str, typer.Option(help="all, or even or odd photographs of every strip.")] = DEFAULTS.subset,
    area: Annotated[
        tuple[float, float, float, float] | None, typer.Option(help="X Y of the lower left, X Y of the upper right.")
    ] = None,
    window: Annotated[int, typer.Option(help="Pixels a side of the windows that are matched, odd.")] = DEFAULTS.window,
    threshold: Annotated[float, typer.Option(min=0.0, max=1.0, help="Correlation from which a match counts.")] = (
        DEFAULTS.threshold
    ),
    agreeing: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="The same of three photographs and more whose rays meet; 1: never.")
    ] = DEFAULTS.agreeing,
    edge: Annotated[
        float | None,
        typer.Option(min=0.0, max=LARGEST_EDGE, help="Share of the format at its edge not used; 0.02, pairs 0.10."),
    ] = None,
    most_photographs: Annotated[
        int, typer.Option(min=FEWEST_PHOTOGRAPHS, max=MOST_PHOTOGRAPHS, help="Photographs of a picket, at most.")
    ] = DEFAULTS.most_photographs,
    breaklines: Annotated[Path | None, typer.Option(help="Lines with heights: .gpkg, .geojson or .dxf.")] = None,
    ideal: Annotated[
        bool, typer.Option("--ideal", help="The photographs are those of imgeo, free of image errors.")
    ] = False,
    plots: Annotated[bool, typer.Option(help="Draw the surface and the pickets.")] = True,
    json_: Json = False,
) -> None:
    """Pickets by image matching with σ, error pickets, and the surfaces they make with and without objects."""
    from aerotri.commands.dtm import metres_or_auto, run_dtm

    settings = TerrainSettings(
        metres_or_auto(interval), cell, pairs, step, cast(Any, subset), area, window, threshold, agreeing, edge,
        most_photographs, breaklines, ideal,
    )  # fmt: skip
    raise typer.Exit(run_dtm(result, photographs, out, settings, plots, json_))


@app.command(epilog="Example: aerotri compare saar_dtm/dtm.tif laser.laz --align shift --out difference")
def compare(
    test: Annotated[Path, typer.Argument(help="Surface to judge: GeoTIFF, LAZ, pickets.parquet, or a folder of dtm.")],
    control: Annotated[Path, typer.Argument(help="Control surface of the same kinds.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default TEST_comparison here.")] = None,
    method: Annotated[str, typer.Option(help="Interpolation of both: linear or spline.")] = INTERPOLATION,
    align: Annotated[str, typer.Option(help="Move the first onto the second: none, shift or rigid.")] = ALIGNMENT,
    cell: Annotated[float | None, typer.Option(min=1e-6, help="Cell of the differences, m.")] = None,
    plots: Annotated[bool, typer.Option(help="Draw map and histogram.")] = True,
    json_: Json = False,
) -> None:
    """Differences of two surfaces: RMSE, bias, NMAD, LE90, map and histogram."""
    from aerotri.commands.compare import run_compare

    run_compare(test, control, out, cast(Any, method), cast(Any, align), cell, plots, json_)


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
