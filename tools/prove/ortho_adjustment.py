"""Where an orthophoto shows details after an adjustment with errors, over the σ it states: many draws, no pixels.

`ortho_sigma.py` compares pictures, and can do so for a few draws alone. All details of a draw share the errors of its
adjustment, so that some draws tell little of the tails of σ. Here the same block is adjusted with many draws of errors
of tie points and control. The surface moves as points do that are intersected by the photographs that see a cell; the
ray of the photograph that shows the cell, through the true image position, meets that surface beside the true place.
The displacement is held against the adjustment's part of σ. Photographs, surface and choice are those of one draw.

Measures σ of an orthophoto by its parts: imports inside on purpose.

    python tools/prove/ortho_adjustment.py [FOLDER] [--draws 200] [--scenes hill …] [--out results]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise, predict
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.terrain.ortho.accuracy import slopes
from aerotri.volume.pickets import Pickets
from ortho_sigma import EVERY, SCENES, SPEC, TERRAIN, rms, with_errors
from volume_proof.simulated import intersected

ROUNDS = 6
HEAD = (
    "| scene | draws | places | displacement m | σ m | z | standard error of z | > 3 σ | z of places |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True, eq=False)
class Shown:
    """Cells of an orthophoto.

    Parameters
    ----------
    xyz : (n, 3) m. slope : (n, 2) of the ground. image : (n,) photograph that shows a cell.
    seen : the cells as points of the photographs that see them. sigma : (n,) m, the adjustment's part at σ̂0 = 1.
    """

    xyz: np.ndarray
    slope: np.ndarray
    image: np.ndarray
    seen: Pickets
    sigma: np.ndarray


def main() -> None:
    """Run the draws and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=["undulating", "hill"])
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp())
    lines = ["# Details in an orthophoto after an adjustment with errors (tools/prove/ortho_adjustment.py)", ""]
    lines += HEAD.split("\n")
    for name in arguments.scenes:
        lines.append(row(name, *drawn(folder / name, name, arguments.draws)))
    print("\n".join(lines))
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
        (arguments.out / "ortho_adjustment.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def row(name: str, off: np.ndarray, sigma: np.ndarray) -> str:
    """A line of the table, displacements (d, n, 2) and σ (d, n) m of all draws."""
    z = off / sigma[:, :, None]
    squares = np.mean(z**2, axis=(1, 2))
    spread = float(np.std(squares) / np.sqrt(len(z)) / (2.0 * rms(z)))
    of_places = np.sqrt(np.mean(z**2, axis=(0, 2)))
    low, high = np.quantile(of_places, [0.05, 0.95])
    return (
        f"| {name} | {len(z)} | {z.shape[1]} | {rms(off):.3f} | {rms(sigma):.3f} | {rms(z):.2f} | {spread:.2f} | "
        f"{100.0 * np.mean(np.abs(z) > 3.0):.2f} % | {low:.2f} to {high:.2f} |"
    )


def drawn(folder: Path, name: str, draws: int) -> tuple[np.ndarray, np.ndarray]:
    """(d, n, 2) m displacements and (d, n) m σ of all draws."""
    flight = aerotri.simulate(SPEC | {"terrain": TERRAIN | SCENES[name]}, 1)
    photographs = folder / "flown" / "photographs"
    if not photographs.exists():
        flight.save(folder / "flown", photographs=True, contrast=0.25)
    cells = shown_cells(flight, photographs, folder)
    out, sigma = np.empty((draws, len(cells.xyz), 2)), np.empty((draws, len(cells.xyz)))
    for seed in range(draws):
        record = aerotri.adjust(with_errors(flight.block, seed), explain=False).record
        out[seed] = displaced(flight, record, cells)
        sigma[seed] = cells.sigma * record.local.outcome.sigma0
    return out, sigma


def shown_cells(flight: Any, photographs: Path, folder: Path) -> Shown:
    """Every few coarse cells that two photographs see, with their σ."""
    result = aerotri.adjust(with_errors(flight.block, 0), explain=False)
    made = aerotri.orthophoto(
        result, photographs, aerotri.dense_surface(result, photographs), folder / "ortho", plots=False
    )
    record, candidates = made.record, made.record.candidates
    assert record.accuracy.same
    rows = np.arange(EVERY, candidates.z.shape[0] - EVERY, EVERY)
    columns = np.arange(EVERY, candidates.z.shape[1] - EVERY, EVERY)
    i, j = (v.ravel() for v in np.meshgrid(rows, columns, indexing="ij"))
    seen = candidates.found[:, i, j].T
    used = (record.choice.number[i, j] >= 0) & ((seen >= 0).sum(axis=1) >= 2)
    i, j, seen = i[used], j[used], seen[used]
    xyz = np.column_stack([candidates.grid.x(j), candidates.grid.y(i), candidates.z[i, j]])
    of_block = record.photographs.rows
    start = np.concatenate([[0], np.cumsum((seen >= 0).sum(axis=1))])
    image = of_block[seen[seen >= 0]]
    points = Pickets(xyz, start, image, np.full(len(image), 1.0), np.ones(len(xyz)))
    slope = slopes(candidates.z, candidates.grid)[i, j]
    sigma = record.accuracy.orientation[i, j] / result.record.local.outcome.sigma0
    return Shown(xyz, slope, of_block[record.choice.number[i, j]], points, sigma)


def displaced(flight: Any, record: Any, cells: Shown) -> np.ndarray:
    """(n, 2) m, by which an orthophoto over the moved surface shows the places too far along X and Y."""
    block, images = flight.block, record.result.images
    true, rotation = (rotation_from_angles(of.angles, block.rotation) for of in (flight.truth, images))
    interior = np.zeros((1, len(INTERIOR_COLUMNS)))
    interior[0, :3] = flight.truth.interior[0, :3]

    def as_seen(image: np.ndarray, point: np.ndarray) -> np.ndarray:
        zero = np.zeros(len(point), np.int64)
        return predict(true, flight.truth.centre, cells.xyz, interior, image, point, zero, np.zeros((len(point), 2)))

    seen = cells.seen
    point = np.repeat(np.arange(len(seen)), np.diff(seen.start))
    moved = intersected(rotation, images.centre, interior[0], as_seen(seen.image, point), seen) - cells.xyz
    own = np.arange(len(cells.xyz))
    shown, at = as_seen(cells.image, own), cells.xyz.copy()
    for _ in range(ROUNDS):
        zero = np.zeros(len(own), np.int64)
        ray = linearise(rotation, images.centre, at, interior, cells.image, own, zero, np.zeros_like(shown))
        along = ray.by_point[:, :, :2] + ray.by_point[:, :, 2:] * cells.slope[:, None, :]
        at[:, :2] += np.linalg.solve(along, (shown - ray.prediction)[..., None])[..., 0]
        beside = at[:, :2] - cells.xyz[:, :2] - moved[:, :2]
        at[:, 2] = cells.xyz[:, 2] + moved[:, 2] + np.sum(cells.slope * beside, axis=1)
    return at[:, :2] - cells.xyz[:, :2]


if __name__ == "__main__":
    main()
