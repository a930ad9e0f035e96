"""Brighton's dense surface against the point cloud of another program: cells covered, and differences.

The cloud (OpenDroneMap, from the photographs in full size) is sampled once a cell of about two GSD; a cell of ours
counts as covered where it has a height. The differences are taken after a rigid alignment; a bowl that the adjustment
leaves (no control, GNSS of metres) is in them, and is taken off in the columns that say so. z is the difference without
bowl over σ of matching (robust σ); the cloud has errors of its own, of which nothing is known. Below the table stands
what the adjustment says of heights after the alignment, by noise and by what its parameters leave of the camera's
errors; and by how much heights jump where two tiles meet, which other pairs measure, beside the same inside tiles. The
table's numbers are printed for what OpenCV's semi-global matching alone gives on the same epipolar images and for the
surface of pickets. Cells are counted where the two surfaces lie; how many are covered once ours is moved onto the
cloud, and each of its cells counts for all the cloud's cells that it lies over, stands below the table. --model takes
another set of parameters, auto the one that the program chooses. Looks inside the package on purpose. Measures: heights
of a joint covariance. Prints Markdown.

    python tools/prove/brighton_dense.py OUT --data ../shared/data/brighton > tools/results/brighton_dense.md
    python tools/prove/brighton_dense.py OUT_AUTO --model auto > tools/results/brighton_dense_auto.md
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import rasterio
from scipy.spatial.transform import Rotation

import aerotri
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.restitution import restitution_of
from aerotri.public.dense import DenseSurface
from aerotri.statistics.camera_field import known_field, noise_beside_field
from aerotri.terrain.adjustment_part import _by_unknowns as by_unknowns
from brighton_surface import GSD_M, MODELS, bowl_basis, differences, modelled, nmad, robust_fit
from dense_surface import semi_global_surface

FAR_M, SQUARE_M, LEAST_OPEN, MOST_OPEN = 0.2, 1.0, 0.01, 0.4
PER_ROW = 100_000_000
"""Of the numbers of cells: more than there are in a row."""
HEAD = "| surface | cells | covered | of the cloud's cells | NMAD m | GSD | without bowl, GSD | beyond 0.2 m |"
HEAD += " σ of matching, GSD | z |"
LANE, STEP = 100, 4
"""Cells along a border whose jumps are taken together; between lines inside tiles that are looked at beside it."""
PLACES = 400
"""Of the surface, where what the adjustment brings is computed."""


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


def covered_when_moved(raster: Path, cloud: Path, cell: float, compared: Path) -> float:
    """Share of the cloud's cells that ours lie over, moved by the alignment that the comparison wrote."""
    said = json.loads((compared / "compare.json").read_text(encoding="utf-8"))["alignment"]
    with rasterio.open(raster) as file:
        z, own = file.read(1, masked=True), file.transform.a
        rows, columns = np.nonzero(~np.ma.getmaskarray(z))
        xyz = np.column_stack([*file.xy(rows, columns), z.data[rows, columns]])
    about = np.array(said["about_m"])
    x, y, _ = (Rotation.from_rotvec(said["rotation_rad"]).apply(xyz - about) + about + said["shift_m"]).T
    quarters = [(0.25 * i * own, 0.25 * j * own) for i in (-1, 1) for j in (-1, 1)]
    ours = np.unique(np.concatenate([cells_of(x + dx, y + dy, cell) for dx, dy in quarters]))
    points = laspy.read(cloud)
    theirs = cells_of(np.asarray(points.x), np.asarray(points.y), cell)
    return len(np.intersect1d(ours, theirs)) / len(theirs)


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
    said = of_matching(raster.parent / "matching.tif", xy, rest)
    return f"| {name} | " + " | ".join([*numbers, *said]) + " |"


def of_matching(raster: Path, xy: np.ndarray, z: np.ndarray) -> tuple[str, str]:
    """Median σ of matching and the robust σ of differences over it; nothing where the surface has no such σ."""
    if not raster.exists():
        return "", ""
    with rasterio.open(raster) as read:
        at, band = ~read.transform, read.read(1, masked=True)
    column, row_ = (np.floor(v).astype(int) for v in at * (xy[:, 0], xy[:, 1]))
    inside = (column >= 0) & (row_ >= 0) & (column < band.shape[1]) & (row_ < band.shape[0])
    sigma = np.full(len(xy), np.nan)
    sigma[inside] = band.filled(np.nan)[row_[inside], column[inside]]
    known = np.isfinite(sigma) & (sigma > 0.0)
    return f"{np.median(sigma[known]) / GSD_M:.2f}", f"{nmad(z[known] / sigma[known]):.2f}"


def after_alignment(result: aerotri.Adjustment, found: DenseSurface) -> tuple[float, float]:
    """m, σ of heights of the surface less the plane through them: by noise, by what the parameters leave."""
    record, o = result.record, found.record
    places, seen = [], []
    for window, tile in o.files.read_all(list(o.windows)):
        rows, columns = np.nonzero(np.isfinite(tile.z))
        if not len(rows):
            continue
        for n in np.unique(np.linspace(0, len(rows) - 1, max(PLACES // len(o.windows), 2)).astype(int)):
            x, y = o.grid.x(window.column + columns[n]), o.grid.y(window.row + rows[n])
            places.append([x, y, tile.z[rows[n], columns[n]]])
            seen.append(o.photographs.rows[tile.measured_by(rows[n], columns[n])])
    photographs = np.full((len(seen), max(map(len, seen))), -1)
    for own, row_ in zip(seen, photographs, strict=True):
        row_[: len(own)] = own
    left, xyz = known_field(record), places_of(record).to_local(np.array(places))
    restitution = replace(restitution_of(record), left=left)
    everything = np.arange(len(record.local.block.images))
    j = by_unknowns(record, restitution, everything, xyz, photographs, plan=False)[:, 2]
    away = np.column_stack([np.ones(len(xyz)), xyz[:, :2] - xyz[:, :2].mean(axis=0)])
    j = j - away @ np.linalg.lstsq(away, j, rcond=None)[0]
    unknowns = 6 * len(record.system.unknowns.images) + len(record.system.unknowns.shared)
    j, by_errors = j[:, :unknowns], j[:, unknowns:]
    solved = record.system.factorise(record.solution.equations).solve(np.ascontiguousarray(j.T))
    noise = noise_beside_field(record) * np.sqrt(np.mean(np.einsum("nu,un->n", j, solved)))
    if left is None:
        return float(noise), 0.0
    return float(noise), float(np.sqrt(np.mean(np.sum((by_errors + j @ left.by_unknowns) ** 2, axis=1))))


def jumps(found: DenseSurface, raster: Path) -> tuple[np.ndarray, np.ndarray]:
    """m, medians over lanes of cells of the jumps at borders of tiles, and inside tiles.

    A jump is the difference of the two cells at a line less the mean of those before and after it.
    """
    with rasterio.open(raster) as file:
        z = file.read(1, masked=True).filled(np.nan).astype(float)
    o = found.record
    at, inside = [], []
    for lines, rows in (({w.column for w in o.windows}, z.T), ({w.row for w in o.windows}, z)):
        for line in range(2, len(rows) - 1):
            if line in lines:
                at.append(of_lanes(rows[line - 2 : line + 2]))
            elif line % STEP == 0 and all(abs(line - border) > STEP for border in lines):
                inside.append(of_lanes(rows[line - 2 : line + 2]))
    return np.concatenate(at), np.concatenate(inside)


def of_lanes(z: np.ndarray) -> np.ndarray:
    """Medians over lanes, half of whose cells are known, of four lines of heights."""
    jump = z[2] - z[1] - 0.5 * (z[3] - z[2] + z[1] - z[0])
    lanes = np.split(jump, range(LANE, len(jump), LANE))
    return np.array([np.nanmedian(lane) for lane in lanes if 2 * np.isfinite(lane).sum() >= LANE])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the results")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/brighton"))
    parser.add_argument(
        "--model", choices=list(MODELS), default="lens", help="parameters, as brighton_surface has them"
    )
    options = parser.parse_args()
    out, photographs = options.out, options.data / "images"
    if not (out / "block").exists():
        aerotri.tie_points(photographs).save(out / "block")
    result = aerotri.adjust(modelled(aerotri.read_block(out / "block"), options.model), explain=False)
    print("# Brighton's dense surface against another program's cloud (tools/prove/brighton_dense.py)\n")
    print(HEAD + "\n|" + "---|" * (HEAD.count("|") - 1), flush=True)
    dense = aerotri.dense_surface(result, photographs)
    dense.save(out / "dense", plots=False)
    print(row("dense", out / "dense" / "dsm.tif", options.data, out / "dense_compared"), flush=True)
    semi_global_surface(result, photographs).save(out / "semi_global", plots=False)
    print(row("semi-global alone", out / "semi_global" / "dsm.tif", options.data, out / "sgm_compared"), flush=True)
    result.save(out / "result", plots=False)
    aerotri.terrain(out / "result", photographs).save(out / "dtm", plots=False)
    said = missing(out / "dense" / "dsm.tif", options.data / "model.laz", 2.0 * GSD_M)
    print(row("pickets", out / "dtm" / "dsm.tif", options.data, out / "pickets_compared"), flush=True)
    noise, left = after_alignment(result, dense)
    moved = covered_when_moved(
        out / "dense" / "dsm.tif", options.data / "model.laz", 2.0 * GSD_M, out / "dense_compared"
    )  # fmt: skip
    print(f"\n{said} Moved onto the cloud the dense surface lies over {100.0 * moved:.1f} % of them.\n")
    s = dense.summary
    print(
        f"The surface states a σ of Z of {s['sigma_Z_m']['median']:.1f} m (median); its GSD is "
        f"{100.0 * s['gsd_m']:.2f} cm, the cloud is taken in cells of {200.0 * GSD_M:.2f} cm, "
        f"ours are {100.0 * s['cell_m']:.2f} cm.\n"
    )
    print(
        f"After the alignment the adjustment brings {noise / GSD_M:.2f} GSD by noise and {left / GSD_M:.2f} GSD by "
        "what its parameters leave of the errors of the camera."
    )
    at, inside = (jumps_ / GSD_M for jumps_ in jumps(dense, out / "dense" / "dsm.tif"))
    print(
        f"\nMedians over {LANE} cells of the jumps of heights: {np.sqrt(np.mean(at**2)):.2f} GSD RMS where two tiles "
        f"meet ({len(at)} places, largest {np.abs(at).max():.2f}), {np.sqrt(np.mean(inside**2)):.2f} inside tiles "
        f"({len(inside)} places, largest {np.abs(inside).max():.2f})."
    )


if __name__ == "__main__":
    main()
