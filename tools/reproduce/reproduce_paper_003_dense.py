"""Figures 5 to 8 of Spreckels, Schlienkamp and Jacobsen with dense surfaces: even against odd photographs, every cell.

The blocks are those of reproduce_paper_003_dem.py: 80 % end lap, an UltraCamD that errs by the physics of its nine
tiles, and one without errors, which tells the noise. The surface of the even and that of the odd photographs of every
strip are measured by `aerotri.dense_surface` with three adjustments: without additional parameters, with the paper's,
and with those of the tiles and a random field. Beside the spread of even − odd stands what σ of matching foretells of
it, and the spread of their ratio: 1 where σ is right and nothing is left of the image errors. Then the same with what
the adjustment brings, and what its parameters leave of the image errors: even and odd photographs share both, so that
the difference of what they do to either surface counts. No file has that; the tool looks inside the package for it on
purpose. Measures: a difference over a σ of all its parts.

    python tools/reproduce/reproduce_paper_003_dense.py [FOLDER] [--noise 50 400] [--keep]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import KDTree

import aerotri
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.restitution import restitution_of
from aerotri.public.dense import DenseSurface
from aerotri.statistics.camera_field import known_field
from aerotri.terrain.adjustment_part import _by_unknowns as by_unknowns
from aerotri.terrain.adjustment_part import _covariances as covariances
from reproduce_paper_003_dem import CM, RESULTS, SETS, SUBSETS, prepare

HEAD = """# Paper 003, figures 5 to 8, with dense surfaces: even against odd photographs

UltraCamD erring by the physics of its tiles, 0.45 px RMS; 26 photographs at 80 %, models of 60 %. Cells of two pixels
that both surfaces measured; cm at a GSD of 9 cm. Matching: σ of matching of both; its z: the difference less its mean
over it. Adjustment: what the adjustment and what its parameters leave bring into the difference; the last z: the
difference, its mean included, over both together, its root mean square.

| grain | adjustment | cells | mean, cm | σ, cm | robust σ, cm | matching, cm | σ of z | robust σ of z | beyond 4 σ |\
 adjustment, cm | z | beyond 4 σ |
|---|---|---|---|---|---|---|---|---|---|---|---|---|"""
PLACES, EACH, NEAR_M = 4000, 10, 30.0
"""Places of a surface whose photographs are kept, each how many of them tells the adjustment's part, and m to the place
of the other surface that stands for it: less than a tenth of a base."""
WORDS = {"plain": "erring camera, no additional parameters", "perfect": "camera without errors"}


@dataclass(frozen=True, eq=False)
class Measured:
    """A surface: height and σ of matching by the place of the cell, m.

    places : (n, 3) m, some of its cells. seen : (n, k) photographs of the block that measured them, −1 beyond.
    """

    z: dict[tuple[int, int], float]
    sigma: dict[tuple[int, int], float]
    places: np.ndarray
    seen: np.ndarray


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
    at = np.column_stack([z.grid.x(column), z.grid.y(row)]) / z.grid.cell_x
    keys = list(map(tuple, np.floor(at).astype(int).tolist()))
    with np.load(here / f"{target.name}.npz") as some:
        return Measured(
            dict(zip(keys, z.z[row, column].tolist(), strict=True)),
            dict(zip(keys, sigma.z[row, column].tolist(), strict=True)),
            some["places"], some["seen"],
        )  # fmt: skip


def measured_by(found: DenseSurface) -> dict[str, np.ndarray]:
    """Some cells of a surface and the photographs that measured them, as `Measured` has them."""
    o = found.record
    places, seen = [], []
    for window, tile in o.files.read_all(list(o.windows)):
        rows, columns = np.nonzero(np.isfinite(tile.z))
        if not len(rows):
            continue
        for n in np.unique(np.linspace(0, len(rows) - 1, max(PLACES // len(o.windows), 4)).astype(int)):
            x, y = o.grid.x(window.column + columns[n]), o.grid.y(window.row + rows[n])
            places.append([x, y, tile.z[rows[n], columns[n]]])
            seen.append(o.photographs.rows[tile.measured_by(rows[n], columns[n])])
    out = np.full((len(seen), max(map(len, seen))), -1)
    for own, row in zip(seen, out, strict=True):
        row[: len(own)] = own
    return {"places": np.array(places), "seen": out}


def brought(adjustment: aerotri.Adjustment, even: Measured, odd: Measured) -> LinearNDInterpolator:
    """m² by X and Y, variance of even − odd by the adjustment and by what its parameters leave of image errors.

    [D] Either surface moves by J·dx and by G·e at its rays; even − odd by the difference of both.
    """
    record = adjustment.record
    restitution = replace(restitution_of(record), left=known_field(record))
    apart, near = KDTree(odd.places[:, :2]).query(even.places[::EACH, :2])
    own = apart < NEAR_M
    xyz, rows = even.places[::EACH][own], np.arange(len(record.local.block.images))
    local = places_of(record).to_local(xyz)
    both = even.seen[::EACH][own], odd.seen[near[own]]

    def partials(part: slice) -> np.ndarray:
        one, two = (by_unknowns(record, restitution, rows, local[part], seen[part], plan=False) for seen in both)
        return one - two

    covariance = covariances(record, restitution.left, local, partials, 3)
    return LinearNDInterpolator(xyz[:, :2], covariance[:, 2, 2])


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
    cell = aerotri.Surface(here / f"dense {result} even" / "dsm.tif").grid.cell_x
    shared = CM * np.sqrt(brought(aerotri.open_result(here / result), even, odd)(cell * (np.array(both) + 0.5)))
    total = (d / np.hypot(sigma, shared))[np.isfinite(shared)]
    beyond = 100.0 * np.mean(np.abs(total) > 4.0)
    return (
        f"| {grain:g} | {name} | {len(d)} | {d.mean():+.2f} | {d.std():.2f} | {robust(d):.2f} | "
        f"{np.sqrt(np.mean(sigma**2)):.2f} | {z.std():.2f} | {robust(z):.2f} | {far:.2f} % | "
        f"{np.sqrt(np.nanmean(shared**2)):.2f} | {np.sqrt(np.mean(total**2)):.2f} | {beyond:.2f} % |"
    )


def main() -> None:
    """Render, adjust, match, print, write where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="to work in; what it holds is not made again")
    parser.add_argument("--noise", type=float, nargs="*", default=(50.0, 400.0), help="σ of the grey values, 16 bit")
    parser.add_argument("--keep", action="store_true", help="write tools/results/paper_003_dense.md")
    arguments = parser.parse_args()
    folder, lines = arguments.folder or Path(tempfile.mkdtemp()), [HEAD]
    print(HEAD)
    for grain in arguments.noise:
        here = folder / f"grain_{grain:g}"
        erring, perfect = prepare(here, "erring", grain), prepare(here, "perfect", grain)
        rows = [(WORDS["perfect"], perfect, "plain"), (WORDS["plain"], erring, "plain")]
        rows += [(f"erring camera, {name}", erring, name) for name in SETS]
        for name, block, result in rows:
            lines.append(line(grain, name, block, result))
            print(lines[-1], flush=True)
    if arguments.keep:
        (RESULTS / "paper_003_dense.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
