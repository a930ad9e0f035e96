"""Cut the picture of a flight plan from its page: `python docs/figures/plan.py`. Takes a Chromium."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import aerotri
from aerotri.rasters.grids import Grid
from aerotri.rasters.surface_files import write_surface
from report import WIDTH, photographed, small

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "start" / "figures" / "plan_map.png"
CRS = "EPSG:25832"
PIT = "POLYGON ((500000 5800000, 500240 5799988, 500258 5800132, 500126 5800176, 500006 5800144, 500000 5800000))"
MIDDLE, DEEP, RADIUS = (500130.0, 5800080.0), 24.0, 60.0
"""Of the bowl in level ground, m."""


def write_dem(path: Path) -> None:
    """The ground of the pit, cells of 2 m."""
    grid = Grid(200, 240, 499900.0, 5800280.0, 2.0, 2.0)
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    z = 100.0 - DEEP * np.exp(-((x - MIDDLE[0]) ** 2 + (y - MIDDLE[1]) ** 2) / (2.0 * RADIUS**2))
    write_surface(path, z, np.full_like(z, 0.1), grid, CRS, "surface")


def main() -> None:
    """Plan, photograph the page, cut."""
    browser = next(name for name in ("chromium", "chromium-browser", "google-chrome") if shutil.which(name))
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        area, dem, shot, cut = (work / name for name in ("pit.wkt", "dtm.tif", "shot.png", "cut.png"))
        area.write_text(PIT, encoding="utf-8")
        write_dem(dem)
        plan = aerotri.plan_flight(area, crs=CRS, dem=dem, camera="p1", gsd=0.02, target="sigma-z 0.03")
        places = photographed(browser, plan.save(work / "pit_plan") / "plan.html", shot)
        with Image.open(shot) as picture:
            picture.crop((0, 0, WIDTH, places["shared"] - 6)).save(cut)
        small(cut, PICTURE)


if __name__ == "__main__":
    main()
