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

FAR_M = 0.2
HEAD = "| surface | cells | covered | of the cloud's cells | NMAD m | GSD | without bowl, GSD | beyond 0.2 m |"


def covered(raster: Path, cloud: Path, cell: float) -> tuple[int, int, int]:
    """Cells with a height, those of the cloud that have one, and those of the cloud, in cells of a side, m."""
    with rasterio.open(raster) as file:
        z = file.read(1, masked=True)
        rows, columns = np.nonzero(~np.ma.getmaskarray(z))
        x, y = file.xy(rows, columns)
    points = laspy.read(cloud)
    ours = cells_of(np.asarray(x), np.asarray(y), cell)
    theirs = cells_of(np.asarray(points.x), np.asarray(points.y), cell)
    return len(rows), len(np.intersect1d(ours, theirs)), len(theirs)


def cells_of(x: np.ndarray, y: np.ndarray, cell: float) -> np.ndarray:
    """Numbers of the cells that hold a point, each once."""
    return np.unique(np.floor(y / cell).astype(np.int64) * 100_000_000 + np.floor(x / cell).astype(np.int64))


def row(name: str, raster: Path, data: Path, folder: Path) -> str:
    """One line of the table."""
    cells, both, theirs = covered(raster, data / "model.laz", 2.0 * GSD_M)
    compared = aerotri.compare(raster, data / "model.laz", align="rigid")
    compared.save(folder, plots=False)
    xy, z = differences(folder / "difference.tif")
    design = bowl_basis(xy, xy.mean(axis=0))
    rest = z - design @ robust_fit(design, z)
    numbers = (
        f"{cells}", f"{100.0 * both / theirs:.1f} %", f"{theirs}", f"{nmad(z):.4f}", f"{nmad(z) / GSD_M:.2f}",
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
    print(row("pickets", out / "dtm" / "dsm.tif", options.data, out / "pickets_compared"), flush=True)


if __name__ == "__main__":
    main()
