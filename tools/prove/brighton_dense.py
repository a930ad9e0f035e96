"""Brighton's dense surface against the point cloud of another program: cells covered, and differences.

The cloud (OpenDroneMap, from the photographs in full size) is sampled once a cell of about two GSD; a cell of ours
counts as covered where it has a height. The differences are taken after a rigid alignment; a bowl that the adjustment
leaves (no control, GNSS of metres) is in them, and is taken off in the last columns. The same is printed for what
OpenCV's semi-global matching alone gives on the same epipolar images and for the surface of pickets. Looks inside the
package on purpose. Prints Markdown.

    python tools/prove/brighton_dense.py OUT --data ../shared/data/brighton > tools/results/brighton_dense.md
"""

from __future__ import annotations

import argparse
from pathlib import Path

import laspy
import numpy as np
import rasterio

import aerotri
from brighton_surface import GSD_M, bowl_basis, differences, modelled, nmad, robust_fit
from dense_surface import semi_global_surface

FAR_M, SQUARE_M, LEAST_OPEN, MOST_OPEN = 0.2, 1.0, 0.01, 0.4
PER_ROW = 100_000_000
"""Of the numbers of cells: more than there are in a row."""
HEAD = "| surface | cells | covered | of the cloud's cells | NMAD m | GSD | without bowl, GSD | beyond 0.2 m |"


def cells_with_points(raster: Path, cloud: Path, cell: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Cells of a side, m, that our heights lie in, and those of the cloud, each once; how many heights there are."""
    with rasterio.open(raster) as file:
        z = file.read(1, masked=True)
        rows, columns = np.nonzero(~np.ma.getmaskarray(z))
        x, y = file.xy(rows, columns)
    points = laspy.read(cloud)
    ours = cells_of(np.asarray(x), np.asarray(y), cell)
    return ours, cells_of(np.asarray(points.x), np.asarray(points.y), cell), len(rows)


def cells_of(x: np.ndarray, y: np.ndarray, cell: float) -> np.ndarray:
    """Numbers of the cells that hold a point, each once."""
    return np.unique(np.floor(y / cell).astype(np.int64) * PER_ROW + np.floor(x / cell).astype(np.int64))


def missing(raster: Path, cloud: Path, cell: float) -> str:
    """In how large pieces what is not covered lies, in words."""
    ours, theirs, _ = cells_with_points(raster, cloud, cell)
    side = max(round(SQUARE_M / cell), 1)
    squares = theirs // PER_ROW // side * PER_ROW + theirs % PER_ROW // side
    _, number, count = np.unique(squares, return_inverse=True, return_counts=True)
    open_cells = ~np.isin(theirs, ours)
    share = (np.bincount(number, open_cells) / count)[number]
    return (
        f"{100.0 * open_cells.mean():.1f} % of the cloud's cells are not covered, "
        f"{100.0 * np.mean(open_cells & (share > MOST_OPEN)):.1f} % in squares of {SQUARE_M:g} m of which more than "
        f"{100.0 * MOST_OPEN:.0f} % are open. {100.0 * np.mean(share < LEAST_OPEN):.0f} % of the cloud's cells lie in "
        f"squares that are covered to {100.0 * (1.0 - LEAST_OPEN):.0f} % and more."
    )


def row(name: str, raster: Path, data: Path, folder: Path) -> str:
    """One line of the table."""
    ours, theirs, cells = cells_with_points(raster, data / "model.laz", 2.0 * GSD_M)
    both = len(np.intersect1d(ours, theirs))
    compared = aerotri.compare(raster, data / "model.laz", align="rigid")
    compared.save(folder, plots=False)
    xy, z = differences(folder / "difference.tif")
    design = bowl_basis(xy, xy.mean(axis=0))
    rest = z - design @ robust_fit(design, z)
    numbers = (
        f"{cells}", f"{100.0 * both / len(theirs):.1f} %", f"{len(theirs)}", f"{nmad(z):.4f}", f"{nmad(z) / GSD_M:.2f}",
        f"{nmad(rest) / GSD_M:.2f}", f"{100.0 * np.mean(np.abs(rest) > FAR_M):.2f} %",
    )  # fmt: skip
    return f"| {name} | " + " | ".join(numbers) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the results")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/brighton"))
    options = parser.parse_args()
    out, photographs = options.out, options.data / "images"
    if not (out / "block").exists():
        aerotri.tie_points(photographs).save(out / "block")
    result = aerotri.adjust(modelled(aerotri.read_block(out / "block"), "lens"), explain=False)
    print("# Brighton's dense surface against another program's cloud (tools/prove/brighton_dense.py)\n")
    print(HEAD + "\n|" + "---|" * (HEAD.count("|") - 1), flush=True)
    aerotri.dense_surface(result, photographs).save(out / "dense", plots=False)
    print(row("dense", out / "dense" / "dsm.tif", options.data, out / "dense_compared"), flush=True)
    semi_global_surface(result, photographs).save(out / "semi_global", plots=False)
    print(row("semi-global alone", out / "semi_global" / "dsm.tif", options.data, out / "sgm_compared"), flush=True)
    result.save(out / "result", plots=False)
    aerotri.terrain(out / "result", photographs).save(out / "dtm", plots=False)
    said = missing(out / "dense" / "dsm.tif", options.data / "model.laz", 2.0 * GSD_M)
    print(row("pickets", out / "dtm" / "dsm.tif", options.data, out / "pickets_compared"), flush=True)
    print(f"\n{said}")


if __name__ == "__main__":
    main()
