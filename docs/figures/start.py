"""Cut the pictures of the first steps from results: `python docs/figures/start.py DRONE_PROJECT DEFORMATION`.

The folders are those that the pages "From a drone flight to a volume" and "A large-format block" make.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

import aerotri

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "start" / "figures"
SITE = ROOT / "blocks" / "drone_site" / "photographs"
WIDTH, GAP, COLOURS = 1400, 20, 200
DPI = 130


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


def drawn(figure: Figure) -> Image.Image:
    """A plot as a picture."""
    content = io.BytesIO()
    figure.savefig(content, dpi=DPI)
    return Image.open(content)


def save(picture: Image.Image, name: str, colours: int = COLOURS) -> None:
    """A picture of few colours, below 150 kB."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    width = min(picture.width, WIDTH)
    size = (width, round(picture.height * width / picture.width))
    picture.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(colours).save(
        FOLDER / f"{name}.png", optimize=True
    )


def main(project: Path, deformation: Path) -> None:
    """All pictures."""
    save(beside(*(Image.open(SITE / f"2_00{k}.jpg") for k in (1, 2, 3)), height=240), "drone_photographs", 24)
    save(drawn(aerotri.Surface(project / "dtm" / "dsm.tif", name="drone_site").plot()), "drone_surface")
    volume = project / "volume" / "plots"
    save(below(*(Image.open(volume / f"{name}.png") for name in ("thickness", "budget"))), "drone_volume")
    save(Image.open(project / "ortho" / "plots" / "orthophoto.png"), "drone_ortho", 14)
    save(Image.open(deformation / "plots" / "contours.png"), "deformation")


if __name__ == "__main__":
    main(*(Path(word) for word in sys.argv[1:3]))
