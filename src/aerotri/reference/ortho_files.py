"""What ortho writes."""

from __future__ import annotations

from aerotri.reference.head import ADJUSTED, ARGUMENTS, BLOCK, HEAD
from aerotri.reference.records import DescribedFile, Item, within

ORTHO = "folder of ortho"
AREAS = (
    ("surface", "Area whose height is known."),
    ("orthophoto", "Area that a photograph shows."),
    ("without_photograph", "Area whose height is known and that no photograph sees."),
    ("other_photograph", "Area that is hidden in the photograph of its surroundings and is taken from another."),
    ("bridged", "Area of the orthophoto over holes of the surface that were bridged (--fill); σ is not known there."),
)
QUANTILES = (
    ("median", "Half of the area is below."), ("q90", "90 % of the area are below."),
    ("q95", "95 % of the area are below."), ("max", "Largest value."),
)  # fmt: skip


def _quantiles(name: str, text: str, unit: str, kind: str = "object") -> tuple[Item, ...]:
    keys = (Item(key, "number?", meaning, unit) for key, meaning in QUANTILES)
    return (Item(name, kind, text, unit), *within(name, *keys))  # pyright: ignore[reportArgumentType]


ORTHO_JSON = (
    *HEAD,
    BLOCK,
    Item("surface", "text", "The surface that heights were taken from."),
    Item("photographs_missing[]", "text", "Photographs of the block that were not among the files given."),
    Item("cell_m", "number", "Cell of the orthophoto.", "m"),
    Item("columns", "whole", "Cells from west to east."),
    Item("rows", "whole", "Cells from north to south."),
    Item("bands", "whole", "Bands of colours; the mask stands behind them in the file."),
    Item("pixel_type", "text", "Type of its values.", values={"uint8": "8 bit", "uint16": "16 bit"}),
    Item("gsd_m", "number", "Size of a pixel on the ground, median of the photographs.", "m"),
    Item(
        "resampling",
        "text",
        "Interpolation in the photographs.",
        values={"bicubic": "", "bilinear": "", "nearest": ""},
    ),
    Item("tiles_resumed", "whole", "Pieces that an earlier run, which was ended, had made."),
    Item("of_one_adjustment", "yes/no", "Whether the surface was measured with the adjustment of the photographs."),
    Item("area_m2", "object", "Areas.", "m²"),
    *(Item(f"area_m2.{name}", "number", text, "m²") for name, text in AREAS),
    Item("sigma_m", "object", "Standard deviation of X and Y of what the orthophoto shows, each.", "m"),
    *_quantiles("sigma_m.total", "All parts together.", "m"),
    *_quantiles(
        "sigma_m.surface",
        "From the heights of the surface, without the adjustment where of_one_adjustment; null where it has no σ.",
        "m",
        "object?",
    ),
    *_quantiles(
        "sigma_m.orientation",
        "From the adjustment; what it does to the surface counts too where of_one_adjustment.",
        "m",
    ),
    *_quantiles("sigma_m.image", "From the measurement of an image point.", "m"),
    *_quantiles(
        "sigma_m.relative",
        "All parts together, relative to the whole orthophoto: after a similarity (shift, rotation, scale) of it; for "
        "lengths and areas. Null where the surface has another adjustment.",
        "m",
        "object?",
    ),
    *_quantiles("viewing_angle_deg", "Angle of the ray off the vertical.", "deg"),
    Item("seams", "object", "Seams between photographs, on the coarse grid on which they are laid."),
    Item("seams.length_m", "number", "Their length.", "m"),
    Item("seams.difference", "number?", "Mean difference of the two photographs along them, share of white."),
    Item("seams.length_of_best_m", "number", "Length, were every cell taken from its best photograph.", "m"),
    Item("seams.difference_of_best", "number?", "Mean difference in that case, share of white."),
    Item("seams.cell_m", "number", "Cell of the coarse grid.", "m"),
    Item("balance", "object", "How well the colours of two photographs agree on the same ground, share of white."),
    Item("balance.difference_before", "number?", "Robust standard deviation of the differences as photographed."),
    Item("balance.difference_after", "number?", "The same with gains and offsets."),
    Item("points[]", "object", "Control and check points in the orthophoto."),
    Item("points[].point", "text", "Name of the point."),
    Item("points[].role", "text", "Its role.", values={"control": "", "check": ""}),
    Item("points[].X", "number", "X as given.", "m"),
    Item("points[].Y", "number", "Y as given.", "m"),
    Item("points[].column", "number", "Column of this place; 0 is the left edge of the first cell."),
    Item("points[].row", "number", "Row of this place; 0 is the upper edge of the first cell."),
    Item("points[].sigma", "number?", "Standard deviation of X and Y of the orthophoto there.", "m"),
    Item("photographs[]", "object", "The photographs."),
    Item("photographs[].number", "whole", "Number in photographs.tif."),
    Item("photographs[].photograph", "text", "Name of the photograph."),
    Item("photographs[].area_m2", "number", "Area taken from it.", "m²"),
    Item("photographs[].gain[]", "number", "Factor of its colours, by band."),
    Item("photographs[].offset[]", "number", "Added to its colours, by band, share of white."),
    Item(
        "photographs[].difference",
        "number?",
        "Robust standard deviation of the difference from other photographs of the same ground, with gains and "
        "offsets, share of white; null where it has no ground in common with others.",
    ),
    *ADJUSTED,
    Item("notes[]", "text", "What was done with the input, and what σ lacks, in sentences."),
    *ARGUMENTS,
)


def ortho_files() -> tuple[DescribedFile, ...]:
    """The files of ortho."""
    return (
        DescribedFile("ortho.json", ORTHO, "json", "Size, accuracy and sources of the orthophoto.", ORTHO_JSON),
        DescribedFile(
            "ortho.tif", ORTHO, "raster",
            "The orthophoto, cloud-optimised with overviews. The last band is the mask, 0 where no photograph sees.",
        ),
        DescribedFile(
            "photographs.tif", ORTHO, "raster",
            "Number of the photograph of every cell, −1 for none. With --fill a second band: 1 where the height was "
            "bridged.",
        ),
        DescribedFile(
            "sigma.tif", ORTHO, "raster", "Standard deviation of X and Y, each, on the coarse grid of the seams, m."
        ),
        DescribedFile(
            "seams.gpkg", ORTHO, "other",
            "GeoPackage on the coarse grid: layer photographs, polygons of the area of each; layer seams, the lines "
            "between two of them.",
        ),
        DescribedFile(
            "plots", ORTHO, "folder", "Orthophoto, its σ, its seams, and the points in it, PNG and SVG.",
            when="unless --no-plots",
        ),
        DescribedFile("ortho.html", ORTHO, "page", "The orthophoto on one page.", when="unless --no-plots"),
    )  # fmt: skip
