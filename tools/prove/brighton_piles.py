"""Two raised areas of Brighton's dense surface, their outlines fixed in space and drawn on the surface.

The flight has no control and GNSS of metres: an outline that is fixed in space stays where it is when the block errs,
one that was drawn on the surface moves with it (`boundary_from`). Circles over a base through them. Prints Markdown.

    python tools/prove/brighton_piles.py OUT --data ../shared/data/brighton > tools/results/brighton_piles.md
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import shapely

import aerotri
from brighton_surface import modelled

AREAS = {"mound": ((576709.0, 5188164.0), 8.0), "steep heap": ((576711.0, 5188139.0), 5.0)}
"""Middle, m (EPSG:32615), and radius, m."""
HEAD = "| area | m² | without heights m² | boundary | net m³ | σ m³ | adjustment | model | matching | base |"


def row(name: str, found: Any, origin: str) -> str:
    """A line of the table."""
    parts = dict(zip(found.parts["part"], found.parts["sigma_m3"], strict=True))
    numbers = [f"{parts.get(part, 0.0):.1f}" for part in ("adjustment", "model", "matching", "base")]
    cells = [name, f"{found.area:.0f}", f"{found.summary['no_data_area_m2']:.0f}", origin, f"{found.net:.1f}"]
    return "| " + " | ".join([*cells, f"{found.sigma:.1f}", *numbers]) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the results; what is there of them is used again")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/brighton"))
    options = parser.parse_args()
    out, photographs = options.out, options.data / "images"
    if not (out / "block").exists():
        aerotri.tie_points(photographs).save(out / "block")
    if not (out / "result").exists():
        block = modelled(aerotri.read_block(out / "block"), "lens")
        aerotri.adjust(block, explain=False).save(out / "result", plots=False)
    if not (out / "dense").exists():
        aerotri.dense_surface(out / "result", photographs).save(out / "dense", plots=False)
    print("# Raised areas of Brighton's dense surface (tools/prove/brighton_piles.py)\n")
    print(HEAD + "\n|" + "---|" * (HEAD.count("|") - 1))
    for name, (middle, radius) in AREAS.items():
        for origin in ("survey", "product"):
            outline = shapely.Point(*middle).buffer(radius)
            found = aerotri.volume(out / "dense", outline, adjustment=out / "result", boundary_from=origin)
            print(row(name, found, origin), flush=True)


if __name__ == "__main__":
    main()
