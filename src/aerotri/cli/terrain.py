"""Command lines: surfaces by image matching, and their comparison."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app, predict
from aerotri.cli.options import (
    ARGUMENTS,
    INPUT,
    METHOD,
    OUTPUT,
    TERRAIN,
    Json,
    ProjectOf,
    ResultFolder,
    Workers,
    cell_of_surface,
)  # fmt: skip
from aerotri.execution.choice import THREADS
from aerotri.terrain.settings import (
    ALIGNMENT,
    DEFAULTS,
    DENSE_DEFAULTS,
    FEWEST_PHOTOGRAPHS,
    INTERPOLATION,
    LARGEST_EDGE,
    MOST_PAIRS,
    MOST_PHOTOGRAPHS,
    MOST_WIDE_M,
    DenseSettings,
    TerrainSettings,
)

GRID, MATCHING, FORMULA, PILOT = "Points and raster", "Matching", "By formula", "By a pilot"


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri dtm drone_project/result blocks/drone_site/photographs --interval 3 --out drone_dtm",
)
def dtm(
    result: ResultFolder,
    photographs: Annotated[
        list[Path],
        typer.Argument(help="Folders or files of the photographs, TIFF or JPEG.", rich_help_panel=ARGUMENTS),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_dtm here.", rich_help_panel=OUTPUT)
    ] = None,
    interval: Annotated[
        str,
        typer.Option(
            help="Distance of the points that are measured (pickets), m, or auto: from the GSD and the relief.",
            rich_help_panel=GRID,
        ),
    ] = "auto",
    cell: Annotated[
        float | None,
        typer.Option(
            "--cell",
            "--resolution",
            min=1e-6,
            help="Cell of the rasters, m. Default: half of the interval.",
            rich_help_panel=GRID,
        ),
    ] = None,
    pairs: Annotated[
        bool,
        typer.Option(
            "--pairs",
            help="Measure every point in its best pair of photographs, as demcor needs it. Default: in all.",
            rich_help_panel=MATCHING,
        ),
    ] = False,
    step: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="With --pairs: a pair is a photograph and the one this number of photographs further in its strip.",
            rich_help_panel=MATCHING,
        ),
    ] = None,
    subset: Annotated[
        str,
        typer.Option(help="all, or even or odd photographs of every strip.", rich_help_panel=MATCHING),
    ] = DEFAULTS.subset,
    area: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            metavar="X Y X Y", help="X Y of the lower left, X Y of the upper right corner, m.", rich_help_panel=GRID
        ),
    ] = None,
    window: Annotated[
        int,
        typer.Option(help="Side of the windows that are matched, pixels, odd.", rich_help_panel=MATCHING),
    ] = DEFAULTS.window,
    threshold: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, help="Correlation (0 to 1) from which a match counts.", rich_help_panel=MATCHING
        ),
    ] = DEFAULTS.threshold,
    agreeing: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help="The same (0 to 1) of three photographs and more whose rays meet; 1: never.",
            rich_help_panel=MATCHING,
        ),
    ] = DEFAULTS.agreeing,
    edge: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=LARGEST_EDGE,
            help="Share of the photograph at its edge that is not used. Default: 0.02, with --pairs 0.10.",
            rich_help_panel=MATCHING,
        ),
    ] = None,
    most_photographs: Annotated[
        int,
        typer.Option(
            min=FEWEST_PHOTOGRAPHS,
            max=MOST_PHOTOGRAPHS,
            help="Number of photographs a point is measured in, at most.",
            rich_help_panel=MATCHING,
        ),
    ] = DEFAULTS.most_photographs,
    breaklines: Annotated[
        Path | None,
        typer.Option(help="Lines with heights: .gpkg, .geojson, .shp, .fgb or .dxf.", rich_help_panel=INPUT),
    ] = None,
    ground_within: Annotated[
        str | None,
        typer.Option(
            help="Outline within which all is ground, a stockpile: .gpkg, .geojson or WKT. Elsewhere what is steep, as "
            "a house, is taken off the DTM.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    ideal: Annotated[
        bool,
        typer.Option(
            "--ideal", help="The photographs are those of imgeo, without image errors.", rich_help_panel=INPUT
        ),
    ] = False,
    executor: Workers = THREADS,
    plots: Annotated[bool, typer.Option(help="Draw the surface and the points.", rich_help_panel=OUTPUT)] = True,
    json_: Json = False,
) -> None:
    """Ground points by image matching (pickets), each with σ, and the surfaces with and without objects."""
    from aerotri.commands.dtm import metres_or_auto, run_dtm

    settings = TerrainSettings(
        metres_or_auto(interval), cell, pairs, step, cast(Any, subset), area, window, threshold, agreeing, edge,
        most_photographs, breaklines, ground_within, ideal,
    )  # fmt: skip
    raise typer.Exit(run_dtm(result, photographs, out, settings, plots, json_, executor))


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri dsm drone_project/result blocks/drone_site/photographs --out drone_dsm",
)
def dsm(
    result: ResultFolder,
    photographs: Annotated[
        list[Path],
        typer.Argument(help="Folders or files of the photographs, TIFF or JPEG.", rich_help_panel=ARGUMENTS),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write; default NAME_dsm here. Tiles lie beside it, in a folder .tiles, until all is done.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    resolution: Annotated[
        float | None, cell_of_surface("Cell of the surface, m. Default: two pixels on the ground.", GRID)
    ] = DENSE_DEFAULTS.resolution,
    area: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            metavar="X Y X Y", help="X Y of the lower left, X Y of the upper right corner, m.", rich_help_panel=GRID
        ),
    ] = DENSE_DEFAULTS.area,
    most_pairs: Annotated[
        int,
        typer.Option(
            min=1,
            max=MOST_PAIRS,
            help="Number of pairs of photographs that measure a piece of ground, at most. Up to 8 where cells stay "
            "without a height.",
            rich_help_panel=MATCHING,
        ),
    ] = DENSE_DEFAULTS.most_pairs,
    edge: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=LARGEST_EDGE,
            help="Share of the photograph at its edge that is not used.",
            rich_help_panel=MATCHING,
        ),
    ] = DENSE_DEFAULTS.edge,
    ideal: Annotated[
        bool,
        typer.Option(
            "--ideal", help="The photographs are those of imgeo, without image errors.", rich_help_panel=INPUT
        ),
    ] = DENSE_DEFAULTS.ideal,
    ground: Annotated[
        bool,
        typer.Option("--ground", help="Write the ground without objects besides, dtm.tif.", rich_help_panel=OUTPUT),
    ] = DENSE_DEFAULTS.ground,
    widest_object: Annotated[
        float,
        typer.Option(
            min=1.0, max=MOST_WIDE_M, help="Widest object that is taken off the ground, m.", rich_help_panel=OUTPUT
        ),
    ] = DENSE_DEFAULTS.widest_object,
    executor: Workers = THREADS,
    plots: Annotated[
        bool,
        typer.Option(
            help="Draw heights with their σ, and colours: PNG and SVG in the folder plots; write the page dsm.html.",
            rich_help_panel=OUTPUT,
        ),
    ] = True,
    json_: Json = False,
) -> None:
    """The whole surface by dense matching: a height and its standard deviation for every cell."""
    from aerotri.commands.dsm import run_dsm

    settings = DenseSettings(resolution, area, most_pairs, edge, ideal, ground, widest_object)
    raise typer.Exit(run_dsm(result, photographs, out, settings, plots, json_, executor))


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri compare drone_project/dtm blocks/drone_site/truth/surface.tif --out difference",
)
def compare(
    test: Annotated[
        Path,
        typer.Argument(
            help="Surface to judge: GeoTIFF, LAZ, pickets.parquet, or the folder that dtm or dsm wrote.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    control: Annotated[Path, typer.Argument(help="Control surface of the same kinds.", rich_help_panel=ARGUMENTS)],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default TEST_comparison here.", rich_help_panel=OUTPUT)
    ] = None,
    method: Annotated[
        str, typer.Option(help="Interpolation of both: linear or spline.", rich_help_panel=METHOD)
    ] = INTERPOLATION,
    align: Annotated[
        str, typer.Option(help="Move the first onto the second: none, shift or rigid.", rich_help_panel=METHOD)
    ] = ALIGNMENT,
    cell: Annotated[
        float | None,
        typer.Option("--cell", "--resolution", min=1e-6, help="Cell of the differences, m.", rich_help_panel=METHOD),
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw map and histogram.", rich_help_panel=OUTPUT)] = True,
    project: ProjectOf = None,
    json_: Json = False,
) -> None:
    """Differences of two surfaces: RMSE, bias, NMAD, LE90, map and histogram."""
    from aerotri.commands.compare import run_compare

    run_compare(test, control, out, cast(Any, method), cast(Any, align), cell, project, plots, json_)


@predict.command("picket-interval", epilog="Example: aerotri predict picket-interval --scan-um 28 --scale 7000")
def predict_picket_interval(
    scan_um: Annotated[
        float | None, typer.Option(min=1e-6, help="Size of a pixel in the photograph, µm.", rich_help_panel=FORMULA)
    ] = None,
    scale: Annotated[
        float | None, typer.Option(min=1.0, help="Photo scale, 1 over this number.", rich_help_panel=FORMULA)
    ] = None,
    gsd: Annotated[
        float | None, typer.Option(min=1e-6, help="Size of a pixel on the ground, m.", rich_help_panel=FORMULA)
    ] = None,
    k: Annotated[
        float | None,
        typer.Option(
            min=1e-6, help="Coefficient k, a number: 0.08 to 0.09 in mountains, 0.1 in plains.", rich_help_panel=FORMULA
        ),
    ] = None,
    pilot: Annotated[
        Path | None,
        typer.Option(help="Result folder of `aerotri adjust`: measure a part and see.", rich_help_panel=PILOT),
    ] = None,
    photographs: Annotated[
        list[Path] | None,
        typer.Option(help="With --pilot: folder or files. May be repeated.", rich_help_panel=PILOT),
    ] = None,
    area: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            metavar="X Y X Y",
            help="With --pilot: X Y of the lower left, X Y of the upper right corner, m.",
            rich_help_panel=PILOT,
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            min=1e-9,
            help="With --pilot: allowed RMSE between points, m. Default: σ of a point.",
            rich_help_panel=PILOT,
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """How far apart measured ground points should be: by formula from scan and scale or GSD, or by a pilot."""
    from aerotri.commands.predict_interval import IntervalQuestion, run_predict_interval

    question = IntervalQuestion(scan_um, scale, gsd, k, pilot, tuple(photographs or ()), area, tolerance)
    run_predict_interval(question, json_)
