"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON instead of text.")]
BlockFolder = Annotated[Path, typer.Argument(help="Block folder, or its block.toml.")]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace files that aerotri has not written, or that were changed since.")
]
ResultFolder = Annotated[Path, typer.Argument(help="Result folder of `aerotri adjust`.")]
GeoidGrid = Annotated[
    Path | None, typer.Option(help="Geoid grid (PROJ GeoTIFF) for heights that the CRS does not bring along.")
]
MarkedControl = Annotated[str, typer.Option(help="Control points with their image points, gcp_list.txt.")]
CheckPoints = Annotated[list[str] | None, typer.Option(help="Control point that is a check point; may repeat.")]
PhotographPositions = Annotated[str, typer.Option(help="Positions of the photographs, in place of EXIF.")]
SystemOfPhotographs = Annotated[str, typer.Option(help="Coordinate system; default that of control, else UTM of EXIF.")]
ControlSigma = Annotated[str, typer.Option(help="σ of control points without one: X,Y,Z in m; 0: without error, held.")]
PositionsSigma = Annotated[str, typer.Option(help="σ of positions without one: X,Y,Z in m.")]
OrientationSigma = Annotated[str, typer.Option(help="Orientations are observations: σ X,Y,Z in m.")]
AnglesSigma = Annotated[str, typer.Option(help="The same of omega,phi,kappa in degrees.")]
ControlPrefix = Annotated[str, typer.Option(help="What image points have before names of control.")]
GeoidOfSystem = Annotated[Path | None, typer.Option(help="Geoid grid for its heights.")]
