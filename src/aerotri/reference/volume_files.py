"""What volume writes."""

from __future__ import annotations

from dataclasses import replace

from aerotri.reference.head import ADJUSTED, ARGUMENTS, HEAD
from aerotri.reference.records import DescribedFile, Item
from aerotri.volume.accuracy import BRIDGED, LASTING, MODEL, PARTS
from aerotri.volume.settings import METHODS

VOLUME = "folder of volume"
METHOD_WORDS = dict(
    zip(
        METHODS,
        (
            "prisms of triangles",
            "cells of the grid",
            "cross sections, trapezoidal rule",
            "cross sections, Simpson's rule",
            "cross sections, Simpson's 3/8 rule",
        ),
        strict=True,
    )
)
VOLUMES = (
    ("cut_m3", "Volume above the base.", "m³"),
    ("fill_m3", "Volume below the base.", "m³"),
    ("net_m3", "Cut less fill.", "m³"),
    ("cut_area_m2", "Area above the base.", "m²"),
    ("fill_area_m2", "Area below the base.", "m²"),
    ("no_data_area_m2", "Area without heights inside the boundary.", "m²"),
)
PART_WORDS = dict(
    zip(
        PARTS,
        (
            "the adjustment: all heights together are wrong",
            "image matching",
            "the ground between the measured points",
            "the base",
            "the boundary",
        ),
        strict=True,
    )
)


def _mass(of: str) -> tuple[Item, ...]:
    """Keys of the tonnes of a volume."""
    return (
        Item(f"{of}.density_t_per_m3", "number", "Density as stated.", "t/m³"),
        Item(f"{of}.s_density_t_per_m3", "number", "Its standard deviation.", "t/m³"),
        Item(f"{of}.cut_t", "number", "Tonnes above the base.", "t"),
        Item(f"{of}.fill_t", "number", "Tonnes below the base.", "t"),
        Item(f"{of}.net_t", "number", "Tonnes above less tonnes below.", "t"),
        Item(f"{of}.sigma_t", "number?", "Standard deviation of net_t; null without --adjustment.", "t"),
        Item(
            f"{of}.stated_sigma_t", "number?",
            "What the stated σ of density, base and boundary alone make of it; null with --adjustment, or where none "
            "is stated.", "t",
        ),
    )  # fmt: skip


def _parts(of: str) -> list[Item]:
    """The parts of the standard deviation of a volume."""
    return [
        *(Item(f"{of}.{name}", "number", f"Part of {what}.", "m³") for name, what in PART_WORDS.items()),
        Item(
            f"{of}.{MODEL}",
            "number",
            "Part of image errors that noise does not explain: errors that photographs of one strip, or of another "
            "group, have in common, and errors of the camera that the additional parameters leave. Only where the "
            "residuals of the adjustment show such errors.",
            "m³",
            optional=True,
        ),
        Item(
            f"{of}.{LASTING}",
            "number",
            "Part of matching errors that neighbouring cells of a dense surface share, so that they do not average "
            "out. Only of dense surfaces.",
            "m³",
            optional=True,
        ),
        Item(
            f"{of}.{BRIDGED}",
            "number",
            "Part of ground that is bridged below objects: all cells of a bridged patch are taken to err together. "
            "Only of the ground of a dense surface (dtm.tif of `dsm --ground`).",
            "m³",
            optional=True,
        ),
    ]


def _side(of: str, name: str) -> tuple[Item, ...]:
    """σ of a cut or of a fill."""
    return (
        Item(of, "object", f"How sure the {name} is."),
        Item(f"{of}.sigma_m3", "number", f"Standard deviation of the {name}.", "m³"),
        Item(f"{of}.parts_m3", "object", "The parts of it, each alone.", "m³"),
        *_parts(f"{of}.parts_m3"),
        Item(
            f"{of}.parts_m3.zero_line", "number",
            "Part of the line between cut and fill: errors move it, and noise alone makes both larger. 0 where the "
            "base does not cut the surface.", "m³",
        ),
        Item(f"{of}.beyond", "object", "What it is expected to hold beyond what the surface shows."),
        Item(f"{of}.beyond.meaning", "text", "What it is, in words."),
        Item(f"{of}.beyond.value_m3", "number", "Its expected size.", "m³"),
    )  # fmt: skip


VOLUME_JSON = (
    *HEAD,
    Item("dtm", "text", "File of the surface."),
    Item("base", "object", "The base."),
    Item("base.name", "text", "What it is, in words."),
    Item(
        "base.follows_surface",
        "yes/no",
        "Whether it follows from the surface along the boundary: a shift or a tilt "
        "of the whole block then cancels in the volume.",
    ),
    Item("base.z0_m", "number", "Of a plane: height at x0, y0.", "m", optional=True),
    Item("base.x0_m", "number", "Of a plane: X of its point.", "m", optional=True),
    Item("base.y0_m", "number", "Of a plane: Y of its point.", "m", optional=True),
    Item("base.slope_x", "number", "Of a plane: slope along X.", "m/m", optional=True),
    Item("base.slope_y", "number", "Of a plane: slope along Y.", "m/m", optional=True),
    replace(ADJUSTED[0], kind="object?", text="The adjustment that the surface was measured with; null without one."),
    *ADJUSTED[1:],
    *ARGUMENTS,
    Item("boundary", "object", "The boundary."),
    Item("boundary.name", "text", "File or text it comes from."),
    Item("boundary.polygon", "text", "Name that the file gives its only polygon; else empty."),
    Item("boundary.area_m2", "number", "Area inside.", "m²"),
    Item("method", "text", "The method that counts."),
    *(Item(name, "number", text, unit) for name, text, unit in VOLUMES),
    Item("mean_thickness_m", "number", "Net volume over area.", "m"),
    Item("lowest_m", "number?", "Smallest thickness.", "m"),
    Item("highest_m", "number?", "Largest thickness.", "m"),
    Item("methods[]", "object", "The volume by every method."),
    Item("methods[].method", "text", "The method."),
    *(Item(f"methods[].{name}", "number", text, unit) for name, text, unit in VOLUMES),
    Item("methods[].note", "text", "What to bear in mind; else empty."),
    Item("sections", "object", "The cross sections."),
    Item("sections.spacing_m", "number", "Distance between them.", "m"),
    Item("sections.azimuth_deg", "number", "Direction in which they follow one another, from north.", "deg"),
    Item("sections.count", "whole", "Their number."),
    Item("sigma", "object?", "How sure the net volume is; null without --adjustment."),
    Item("sigma.sigma_m3", "number", "Standard deviation of the net volume.", "m³"),
    Item("sigma.sigma_mean_height_m", "number", "The same over the area: of the mean height.", "m"),
    Item("sigma.parts_m3", "object", "The parts of the standard deviation, each alone.", "m³"),
    *_parts("sigma.parts_m3"),
    *(item for name in ("cut", "fill") for item in _side(f"sigma.{name}", name)),
    Item("sigma.curvature", "object?", "Terrain between the measured points, listed separately; null where not known."),
    Item("sigma.curvature.meaning", "text", "What it is, in words."),
    Item("sigma.curvature.in_the_volume", "yes/no", "Whether the volume contains it."),
    Item("sigma.curvature.value_m3", "number", "Its expected size.", "m³"),
    Item("sigma.curvature.sigma_m3", "number", "Standard deviation of it.", "m³"),
    Item("sigma.systematic", "object", "What systematic image errors add, were the photographs used uncorrected."),
    Item("sigma.systematic.meaning", "text", "What it is, in words."),
    Item("sigma.systematic.in_the_volume", "yes/no", "Whether the volume contains it (--uncorrected)."),
    Item("sigma.systematic.variants[]", "object", "One entry a way of orienting the photographs."),
    Item(
        "sigma.systematic.variants[].variant",
        "text",
        "Orientation.",
        values={"free": "with additional parameters", "absorbed": "without them"},
    ),
    Item("sigma.systematic.variants[].value_m3", "number", "Wrong minus true volume.", "m³"),
    Item("sigma.systematic.variants[].sigma_m3", "number", "Standard deviation of it.", "m³"),
    Item("sigma.pickets", "whole", "Measured points behind the volume."),
    Item("sigma.rays", "whole", "Image points behind them."),
    Item("sigma.adjustment", "text", "Folder of the adjustment."),
    Item("sigma.picket_file", "text", "File of the points; empty where every cell was taken for one."),
    Item(
        "stated_sigma",
        "object?",
        "Without --adjustment: what the σ stated of base and boundary make of σ of the "
        "net volume, without the errors of the surface; null with --adjustment, or where none is stated.",
    ),
    Item("stated_sigma.meaning", "text", "What it is, in words."),
    Item("stated_sigma.sigma_m3", "number", "Both together.", "m³"),
    Item("stated_sigma.parts_m3", "object", "The parts, each alone.", "m³"),
    Item("stated_sigma.parts_m3.base", "number", "Part of the base.", "m³"),
    Item("stated_sigma.parts_m3.boundary", "number", "Part of the boundary.", "m³"),
    Item("mass", "object?", "Tonnes of the volume; null without --density."),
    *_mass("mass"),
    Item("piles[]", "object", "Every polygon by itself; empty where the boundary is one polygon."),
    Item(
        "piles[].name",
        "text",
        "Its name: attribute name, pile, label or title; else the first one that is a text and "
        "different for all; else its number in the file.",
    ),
    Item("piles[].area_m2", "number", "Area inside.", "m²"),
    Item("piles[].base", "text", "Its base, in words."),
    *(Item(f"piles[].{name}", "number", text, unit) for name, text, unit in VOLUMES),
    Item("piles[].sigma_m3", "number?", "Standard deviation of its net volume; null without --adjustment.", "m³"),
    Item("piles[].sigma_cut_m3", "number?", "The same of its cut.", "m³"),
    Item("piles[].sigma_fill_m3", "number?", "The same of its fill.", "m³"),
    Item("piles[].parts_m3", "object?", "The parts of it, each alone.", "m³"),
    *_parts("piles[].parts_m3"),
    Item("piles[].stated_sigma_m3", "number?", "As stated_sigma.sigma_m3, of the pile.", "m³"),
    Item("piles[].mass", "object?", "Its tonnes; null without --density."),
    *_mass("piles[].mass"),
    Item("warnings[]", "text", "Sentences to read."),
)
PILES = (
    Item("name", "text", "The pile; the last row is all together."),
    Item("area_m2", "number", "Area inside.", "m²"),
    Item("cut_m3", "number", "Volume above the base.", "m³"),
    Item("sigma_cut_m3", "number?", "Standard deviation of the cut.", "m³"),
    Item("fill_m3", "number", "Volume below the base.", "m³"),
    Item("sigma_fill_m3", "number?", "Standard deviation of the fill.", "m³"),
    Item("net_m3", "number", "Cut less fill.", "m³"),
    Item("sigma_m3", "number?", "Standard deviation of the net volume.", "m³"),
    Item("no_data_area_m2", "number", "Area without heights.", "m²"),
    Item("net_t", "number?", "Tonnes of the net volume.", "t"),
    Item("sigma_t", "number?", "Their standard deviation.", "t"),
)
SECTIONS = (
    Item("station_m", "number", "Place of the cross section along the azimuth.", "m"),
    Item("cut_area_m2", "number", "Its area above the base.", "m²"),
    Item("fill_area_m2", "number", "Its area below the base.", "m²"),
    Item("cut_length_m", "number", "Its length above the base.", "m"),
    Item("fill_length_m", "number", "Its length below the base.", "m"),
    Item("no_data_length_m", "number", "Its length without heights.", "m"),
)


def volume_files() -> tuple[DescribedFile, ...]:
    """The files of volume."""
    plots = "unless --no-plots"
    return (
        DescribedFile("volume.json", VOLUME, "json", "The volume, and how sure it is.", VOLUME_JSON),
        DescribedFile("thickness.tif", VOLUME, "raster", "Surface less base inside the boundary, m."),
        DescribedFile("sections.csv", VOLUME, "table", "The cross sections.", SECTIONS),
        DescribedFile("piles.csv", VOLUME, "table", "Every pile, and all together.", PILES, "with several polygons"),
        DescribedFile("plots", VOLUME, "folder", "Thickness, parts of σ, cross sections, PNG and SVG.", when=plots),
        DescribedFile("volume.html", VOLUME, "page", "The volume on one page.", when=plots),
    )
