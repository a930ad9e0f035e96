"""Cut the pictures of two pages, report and accuracy: `python docs/figures/report.py`. Takes a Chromium."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import aerotri

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "understand" / "figures"
BLOCK = ROOT / "blocks" / "frederiksstad_ultracam"
WIDTH, HEIGHT = 1100, 6000
CUTS = (
    ("accepted", "report_head", None, "adjusted"),
    ("accepted", "report_good", "good", "warnings"),
    ("accepted", "report_precision", "warnings", "ground"),
    ("doubtful", "report_doubtful", None, "adjusted"),
    ("stated", "accuracy_page", None, "errors"),
)
"""Result, name of the picture, headings at which it begins (None: the top) and ends."""
MEASURE = """<script>document.body.dataset.places = JSON.stringify(Object.fromEntries(
[...document.querySelectorAll("[id]")].map(e => [e.id, Math.round(e.getBoundingClientRect().top)])))</script>"""
PLOTS = (
    "ground_points",
    "systematic_errors",
    "averaged_residuals",
    "residual_histogram",
    "ray_correlation",
    "overlap",
    "error_ellipses",
    "column_row_residuals",
    "photograph_residuals",
)


def small(source: Path, target: Path) -> None:
    """A picture of few colours, below 150 kB."""
    from PIL import Image

    with Image.open(source) as picture:
        width = min(picture.width, 1100)
        size = (width, round(picture.height * width / picture.width))
        picture.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(200).save(target, optimize=True)


def photographed(browser: str, report: Path, shot: Path) -> dict[str, int]:
    """A picture of a whole report, and how far down its headings are, px."""
    page = report.with_name("measured.html")
    # the report lets no other script run than its own
    text = re.sub(r"<meta http-equiv=[^>]*>", "", report.read_text(encoding="utf-8"))
    page.write_text(text.replace("</body>", MEASURE + "</body>"), encoding="utf-8")
    options = (browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars")
    size = f"--window-size={WIDTH},{HEIGHT}"
    subprocess.run([*options, size, f"--screenshot={shot}", page.as_uri()], check=True, capture_output=True)
    done = subprocess.run([*options, size, "--dump-dom", page.as_uri()], check=True, capture_output=True, text=True)
    found = re.search(r'data-places="([^"]*)"', done.stdout)
    if found is None:
        raise RuntimeError("the browser did not measure the report")
    return json.loads(html.unescape(found[1]))


def cut_page(browser: str, page: Path, result: str) -> None:
    """Cut the pictures of one page."""
    from PIL import Image

    shot = page.with_name("shot.png")
    places = photographed(browser, page, shot)
    with Image.open(shot) as picture:
        for owner, name, first, last in CUTS:
            if owner == result:
                cut = page.with_name(f"{name}.png")
                picture.crop((0, places[first] - 12 if first else 0, WIDTH, places[last] - 14)).save(cut)
                small(cut, FOLDER / f"{name}.png")


def main() -> None:
    """Adjust the sample block with and without additional parameters, state its accuracy, and cut."""
    browser = next(name for name in ("chromium", "chromium-browser", "google-chrome") if shutil.which(name))
    FOLDER.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        for result, parameters in (("accepted", None), ("doubtful", "none")):
            aerotri.adjust(aerotri.read_block(BLOCK), parameters=parameters).save(work / result)
            cut_page(browser, work / result / "report.html", result)
        stated = aerotri.accuracy(work / "accepted", class_horizontal=0.075, class_vertical=0.12)
        cut_page(browser, stated.save(work / "stated") / "accuracy.html", "stated")
        for name in PLOTS:
            small(work / "accepted" / "plots" / f"{name}.png", FOLDER / f"{name}.png")


if __name__ == "__main__":
    main()
