"""Figures 5 to 8 of Spreckels, Schlienkamp and Jacobsen with dense surfaces: even against odd photographs, every cell.

The blocks are those of reproduce_paper_003_dem.py: 80 % end lap, an UltraCamD that errs by the physics of its nine
tiles, and one without errors, which tells the noise. The surface of the even and that of the odd photographs of every
strip are measured by `aerotri.dense_surface` with three adjustments: without additional parameters, with the paper's,
and with those of the tiles and a random field. Beside the spread of even − odd stands what σ of matching foretells of
it, and the spread of their ratio: 1 where σ is right and nothing is left of the image errors. Then the same with what
the adjustment brings, and what its parameters leave of the image errors: even and odd photographs share both, so that
the difference of what they do to either surface counts. No file has that; the tool looks inside the package for it on
purpose. Measures: a difference over a σ of all its parts.

    python tools/reproduce/reproduce_paper_003_dense.py [FOLDER] [--noise 50 400] [--cameras 11 12 …] [--keep]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import aerotri
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.restitution import restitution_of
from aerotri.public.dense import DenseSurface
from aerotri.statistics.camera_field import known_field
from aerotri.terrain.adjustment_part import _by_unknowns as by_unknowns
from aerotri.terrain.adjustment_part import _covariances as covariances
from aerotri.terrain.dense.parallaxes import WINDOW_PX
from reproduce_paper_003_dem import CM, ERROR_PX, RESULTS, SETS, SUBSETS, prepare, seam_distance

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "prove"))

from runs_elsewhere import add_executor, folder_of, runs_of

HEAD = """# Paper 003, figures 5 to 8, with dense surfaces: even against odd photographs

UltraCamD erring by the physics of its tiles, 0.45 px RMS; 26 photographs at 80 %, models of 60 %. Cells of two pixels
that both surfaces measured; cm at a GSD of 9 cm. Matching: σ of matching of both; its z: the difference less its mean
over it. Adjustment: what the adjustment and what its parameters leave bring into the difference; the z after it: the
difference, its mean included, over both together, its root mean square, in every sixth cell of every sixth row. Clear:
those of them without a seam of a tile in a window of the matching (7 pixels) in any photograph.

| grain | adjustment | cells | mean, cm | σ, cm | robust σ, cm | matching, cm | σ of z | robust σ of z | beyond 4 σ |\
 adjustment, cm | z | beyond 4 σ | clear | z | beyond 4 σ |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"""
OTHERS = """
Other cameras, grain {grain:g}, in the same cells as the last columns above:

| camera | adjustment | adjustment, cm | z | beyond 4 σ | clear | z | beyond 4 σ |
|---|---|---|---|---|---|---|---|"""
STEP = 6
"""Rows and columns between the cells for which the adjustment's part is computed."""
WORDS = {"plain": "erring camera, no additional parameters", "perfect": "camera without errors"}


@dataclass(frozen=True, eq=False)
class Measured:
    """A surface: height and σ of matching by the place of the cell, in cells.

    seen : of some cells the photographs of the block that measured them.
    """

    z: dict[tuple[int, int], float]
    sigma: dict[tuple[int, int], float]
    seen: dict[tuple[int, int], np.ndarray]


def surface(here: Path, result: str, subset: str) -> Measured:
    """Of the even or the odd photographs."""
    adjustment = aerotri.open_result(here / result)
    images = adjustment.block.images
    given = []
    for strip in sorted(set(images.strip.astype(str))):
        own = images.names[images.strip.astype(str) == strip].astype(str)
        given += [here / "block" / "photographs" / f"{name}.tif" for name in own[0 if subset == "odd" else 1 :: 2]]
    target = here / f"dense {result} {subset}"
    if not (target / "dsm.json").exists():
        found = aerotri.dense_surface(adjustment, given)
        np.savez(here / f"{target.name}.npz", **measured_by(found))
        found.save(target, plots=False)
    z, sigma = (aerotri.Surface(target / name) for name in ("dsm.tif", "matching.tif"))
    row, column = np.nonzero(np.isfinite(z.z) & np.isfinite(sigma.z))
    keys = keys_of(z.grid, row, column)
    with np.load(here / f"{target.name}.npz") as some:
        seen = dict(zip(map(tuple, some["keys"].tolist()), some["seen"], strict=True))
    return Measured(
        dict(zip(keys, z.z[row, column].tolist(), strict=True)),
        dict(zip(keys, sigma.z[row, column].tolist(), strict=True)), seen,
    )  # fmt: skip


def keys_of(grid, row: np.ndarray, column: np.ndarray) -> list[tuple[int, int]]:
    """Columns and rows as all surfaces count them: edges of grids are multiples of the cell."""
    at = np.column_stack([grid.x(column), grid.y(row)]) / grid.cell_x
    return list(map(tuple, np.floor(at).astype(int).tolist()))


def measured_by(found: DenseSurface) -> dict[str, np.ndarray]:
    """Some cells of a surface and the photographs of the block that measured them, −1 beyond."""
    o = found.record
    keys, seen = [], []
    for window, tile in o.files.read_all(list(o.windows)):
        rows, columns = np.nonzero(np.isfinite(tile.z))
        all_keys = keys_of(o.grid, window.row + rows, window.column + columns)
        for key, row, column in zip(all_keys, rows, columns, strict=True):
            if key[0] % STEP == 0 and key[1] % STEP == 0:
                keys.append(key)
                seen.append(o.photographs.rows[tile.measured_by(row, column)])
    out = np.full((len(seen), max(map(len, seen))), -1)
    for own, line in zip(seen, out, strict=True):
        line[: len(own)] = own
    return {"keys": np.array(keys), "seen": out}


def brought(adjustment: aerotri.Adjustment, xyz: np.ndarray, both: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(n,) m², variance of even − odd at places (n, 3) m by the adjustment and by the image errors that are left.

    [D] Either surface moves by J·dx and by G·e at its rays; even − odd by the difference of both.

    Parameters
    ----------
    both : (n, k) photographs that measured the place, even and odd.
    """
    record = adjustment.record
    restitution = replace(restitution_of(record), left=known_field(record))
    rows, local = np.arange(len(record.local.block.images)), places_of(record).to_local(xyz)

    def partials(part: slice) -> np.ndarray:
        one, two = (by_unknowns(record, restitution, rows, local[part], seen[part], plan=False) for seen in both)
        return one - two

    return covariances(record, restitution.left, local, partials, 3)[:, 2, 2]


def clear_of_seams(result: aerotri.Adjustment, xyz: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(n,) whether no seam lies in the windows of a place (n, 3) m in the photographs (n, k) that measured it."""
    away = np.stack([seam_distance(result, np.maximum(column, 0), xyz) for column in seen.T], axis=1)
    return (np.where(seen < 0, np.inf, away) > 0.5 * WINDOW_PX + ERROR_PX).all(axis=1)


def robust(values: np.ndarray) -> float:
    """1.4826 times the median absolute difference from the median."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def line(grain: float, name: str, here: Path, result: str) -> str:
    """A row of the table."""
    even, odd = (surface(here, result, subset) for subset in SUBSETS)
    both = sorted(even.z.keys() & odd.z.keys())
    d = CM * np.array([even.z[k] - odd.z[k] for k in both])
    sigma = CM * np.array([np.hypot(even.sigma[k], odd.sigma[k]) for k in both])
    z = (d - d.mean()) / sigma
    far = 100.0 * np.mean(np.abs(z) > 4.0)
    shared, total, clear = of_all_parts(here, result, even, odd)
    return (
        f"| {grain:g} | {name} | {len(d)} | {d.mean():+.2f} | {d.std():.2f} | {robust(d):.2f} | "
        f"{np.sqrt(np.mean(sigma**2)):.2f} | {z.std():.2f} | {robust(z):.2f} | {far:.2f} % | "
        f"{in_words(shared, total, clear)} |"
    )


def lines_of_camera(shared: tuple[Path, float], camera: int) -> list[str]:
    """Rows of the second table; shared : the folder and the grain."""
    folder, grain = shared
    here, lines = prepare(folder / f"camera_{camera}", "erring", grain, camera), []
    for name, result in [(WORDS["plain"].removeprefix("erring camera, "), "plain"), *((name, name) for name in SETS)]:
        even, odd = (surface(here, result, subset) for subset in SUBSETS)
        lines.append(f"| {camera} | {name} | {in_words(*of_all_parts(here, result, even, odd))} |")
    return lines


def in_words(shared: float, total: np.ndarray, clear: np.ndarray) -> str:
    """What `of_all_parts` gives, as columns."""
    return f"{shared:.2f} | {told(total)} | {100.0 * clear.mean():.0f} % | {told(total[clear])}"


def of_all_parts(here: Path, result: str, even: Measured, odd: Measured) -> tuple[float, np.ndarray, np.ndarray]:
    """cm, the adjustment's part; even − odd over σ of all parts (n,), and which cells are clear of seams (n,)."""
    adjustment = aerotri.open_result(here / result)
    cell = aerotri.Surface(here / f"dense {result} even" / "dsm.tif").grid.cell_x
    keys = sorted(even.seen.keys() & odd.seen.keys() & even.z.keys() & odd.z.keys())
    at = cell * (np.array(keys) + 0.5)
    xyz = np.column_stack([at, [0.5 * (even.z[k] + odd.z[k]) for k in keys]])
    both = tuple(np.array([one.seen[k] for k in keys]) for one in (even, odd))
    variance = brought(adjustment, xyz, both)
    matching = np.array([even.sigma[k] ** 2 + odd.sigma[k] ** 2 for k in keys])
    d = np.array([even.z[k] - odd.z[k] for k in keys])
    clear = clear_of_seams(adjustment, xyz, np.hstack(both))
    return CM * float(np.sqrt(variance.mean())), d / np.sqrt(matching + variance), clear


def told(z: np.ndarray) -> str:
    """Root mean square, and the share beyond 4."""
    return f"{np.sqrt(np.mean(z**2)):.2f} | {100.0 * np.mean(np.abs(z) > 4.0):.2f} %"


def main() -> None:
    """Render, adjust, match, print, write where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="to work in; what it holds is not made again")
    parser.add_argument("--noise", type=float, nargs="*", default=(50.0, 400.0), help="σ of the grey values, 16 bit")
    parser.add_argument("--cameras", type=int, nargs="*", default=tuple(range(11, 19)), help="of the second table")
    parser.add_argument("--keep", action="store_true", help="write tools/results/paper_003_dense.md")
    add_executor(parser)
    arguments = parser.parse_args()
    folder, lines = folder_of(arguments.folder, arguments), [HEAD]
    print(HEAD)
    for grain in arguments.noise:
        here = folder / f"grain_{grain:g}"
        erring, perfect = prepare(here, "erring", grain), prepare(here, "perfect", grain)
        rows = [(WORDS["perfect"], perfect, "plain"), (WORDS["plain"], erring, "plain")]
        rows += [(f"erring camera, {name}", erring, name) for name in SETS]
        for name, block, result in rows:
            lines.append(line(grain, name, block, result))
            print(lines[-1], flush=True)
    if arguments.cameras:
        lines.append(OTHERS.format(grain=min(arguments.noise)))
        print(lines[-1], flush=True)
        with runs_of(arguments) as runs:
            for own in runs(lines_of_camera, (folder, min(arguments.noise)), arguments.cameras):
                lines += own
                print("\n".join(own))
    if arguments.keep:
        (RESULTS / "paper_003_dense.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
