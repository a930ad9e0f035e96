"""Orthophotos of photographs some of which were given another exposure: does it show in the orthophoto?

The values v of some photographs become f·v + o. Cells of the orthophoto are held against those of the orthophoto from
unchanged photographs: the step is the ratio of the mean values where the changed photographs are shown over that
elsewhere. One gain of all photographs is free, so 1 is right. Prints Markdown.

    aerotri run blocks/drone_site/photographs --out PROJECT --gcp blocks/drone_site/gcp_list.txt \\
      --control-sigma-m 0.01,0.01,0.02 --check K01 --check K02 --check K03 --boundary blocks/drone_site/pile.geojson
    python tools/prove/ortho_exposures.py PROJECT blocks/drone_site/photographs > tools/results/ortho_exposures.md
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from PIL import Image

import aerotri

CASES = (
    ("none", "", 1.0, 0.0),
    ("one", "1_003", 1.03, 0.0),
    ("one", "1_003", 1.10, 0.0),
    ("one", "1_003", 1.25, 8.0),
    ("two", "2_002 2_003", 1.25, 0.0),
    ("a strip of four", "3_001 3_002 3_003 3_004", 1.25, 0.0),
    ("a strip of four", "3_001 3_002 3_003 3_004", 0.70, 5.0),
    ("six of twelve", "1_001 1_003 2_001 2_003 3_001 3_003", 1.25, 0.0),
)
DARKEST, BRIGHTEST = 40, 200
"""Grey values between which ratios are taken: others are rounded much, or clipped once they are brighter."""
HEAD = "| photographs changed | factor | added | gains, unchanged | gains, changed | step without balance | step | "
HEAD += "area of the changed m² | seams differ by, % of white | notes |"


def main() -> None:
    """Run the cases and print their table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("project", type=Path, help="folder of `aerotri run`")
    parser.add_argument("photographs", type=Path)
    given = parser.parse_args()
    print(f"{HEAD}\n|{'---|' * HEAD.count(' | ')}---|")
    with tempfile.TemporaryDirectory() as folder:
        plain = _made(given.project, given.photographs, Path(folder) / "plain")
        for k, (what, names, factor, added) in enumerate(CASES):
            here = Path(folder) / f"{k}"
            changed = _changed(given.photographs, here / "photographs", names.split(), factor, added)
            found = _made(given.project, changed, here / "ortho")
            as_they_are = _made(given.project, changed, here / "as_they_are", balance=False)
            print(_row(what, names.split(), factor, added, plain, found, as_they_are), flush=True)
            shutil.rmtree(here)


def _changed(photographs: Path, folder: Path, names: list[str], factor: float, added: float) -> Path:
    shutil.copytree(photographs, folder)
    for name in names:
        path = folder / f"{name}.jpg"
        with Image.open(path) as image:
            exif = image.info.get("exif", b"")
            image.point([min(max(round(v * factor + added), 0), 255) for v in range(256)] * len(image.getbands())).save(
                path, quality=95, exif=exif
            )
    return folder


def _made(project: Path, photographs: Path, out: Path, balance: bool = True) -> Any:
    return aerotri.orthophoto(project / "result", photographs, project / "dsm", out, plots=False, balance=balance)


def _row(what: str, names: list[str], factor: float, added: float, plain: Any, found: Any, as_they_are: Any) -> str:
    photographs = found.summary["photographs"]
    is_changed = np.array([Path(one["photograph"]).stem in names for one in photographs])
    gain, area = (np.array([one[key] for one in photographs]) for key in ("gain", "area_m2"))
    gains = [f"{g.min():.3f} to {g.max():.3f}" if len(g) else "" for g in (gain[~is_changed], gain[is_changed])]
    steps = [_step(one, plain, np.flatnonzero(is_changed)) for one in (as_they_are, found)]
    seams, notes = 100.0 * found.summary["seams"]["difference"], len(found.notes)
    return (
        f"| {what} | {factor:.2f} | {added:.0f} | {gains[0]} | {gains[1]} | {steps[0]} | {steps[1]} | "
        f"{area[is_changed].sum():.0f} | {seams:.2f} | {notes} |"
    )


def _step(found: Any, plain: Any, changed: np.ndarray) -> str:
    with rasterio.open(found.path) as image, rasterio.open(plain.path) as other:
        value, before = image.read(1).astype(float), other.read(1).astype(float)
        seen = (image.read(image.count) > 0) & (other.read(other.count) > 0)
    with rasterio.open(found.folder / "photographs.tif") as numbers:
        shown = np.isin(numbers.read(1), changed)
    counts = seen & (before > DARKEST) & (before < BRIGHTEST)
    if not (shown & counts).any():
        return ""
    ratio = [value[part].sum() / before[part].sum() for part in (shown & counts, ~shown & counts)]
    return f"{ratio[0] / ratio[1]:.3f}"


if __name__ == "__main__":
    main()
