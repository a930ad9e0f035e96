"""Cut the pictures of the first steps from results: `python docs/figures/start.py DRONE_PROJECT DEFORMATION [ORTHO]`.

The folders are those that the pages "From a drone flight to a volume" and "A large-format block" make. ORTHO is that of
`aerotri ortho --fill 4` of Brighton's photographs over their dense surface, for the picture of the README.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import rasterio
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "start" / "figures"
SITE = ROOT / "blocks" / "drone_site" / "photographs"
WIDTH, GAP, COLOURS = 1400, 20, 200
PARK, JPEG_WIDTH, SMALLER = (0.135, 0.95), 640, 7
"""Share of the columns of Brighton's orthophoto that is shown, and pixels of the picture; cells of a pixel read."""


def beside(*pictures: Image.Image, height: int) -> Image.Image:
    """Pictures in a row, of one height."""
    scaled = [p.convert("RGB").resize((round(p.width * height / p.height), height)) for p in pictures]
    row = Image.new("RGB", (sum(p.width for p in scaled) + GAP * (len(scaled) - 1), height), "white")
    left = 0
    for picture in scaled:
        row.paste(picture, (left, 0))
        left += picture.width + GAP
    return row


def below(*pictures: Image.Image) -> Image.Image:
    """Pictures under one another, of the width of the first."""
    width = pictures[0].width
    scaled = [p.convert("RGB").resize((width, round(p.height * width / p.width))) for p in pictures]
    column = Image.new("RGB", (width, sum(p.height for p in scaled) + GAP * (len(scaled) - 1)), "white")
    top = 0
    for picture in scaled:
        column.paste(picture, (0, top))
        top += picture.height + GAP
    return column


def save(picture: Image.Image, name: str, colours: int = COLOURS) -> None:
    """A picture of few colours, below 150 kB."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    width = min(picture.width, WIDTH)
    size = (width, round(picture.height * width / picture.width))
    picture.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(colours).save(
        FOLDER / f"{name}.png", optimize=True
    )


def brighton(folder: Path) -> None:
    """The orthophoto, white where there is none."""
    with rasterio.open(folder / "ortho.tif") as file:
        shape = file.count, file.height // SMALLER, file.width // SMALLER
        bands = file.read(out_shape=shape, resampling=rasterio.enums.Resampling.average)
    shown = np.where(bands[3] > 0, bands[:3], 255)[:, :, slice(*(round(share * shape[2]) for share in PARK))]
    picture = Image.fromarray(shown.transpose(1, 2, 0).astype(np.uint8))
    height = round(picture.height * JPEG_WIDTH / picture.width)
    picture.resize((JPEG_WIDTH, height), Image.Resampling.LANCZOS).save(FOLDER / "brighton_ortho.jpg", quality=82)


def main(project: Path, deformation: Path, ortho: Path | None = None) -> None:
    """All pictures."""
    save(beside(*(Image.open(SITE / f"2_00{k}.jpg") for k in (1, 2, 3)), height=240), "drone_photographs", 24)
    save(Image.open(project / "dtm" / "plots" / "surface.png"), "drone_surface")
    volume = project / "volume" / "plots"
    save(below(*(Image.open(volume / f"{name}.png") for name in ("thickness", "budget"))), "drone_volume")
    save(Image.open(project / "ortho" / "plots" / "orthophoto.png"), "drone_ortho")
    save(Image.open(deformation / "plots" / "contours.png"), "deformation")
    if ortho is not None:
        brighton(ortho)


if __name__ == "__main__":
    main(*(Path(word) for word in sys.argv[1:4]))
