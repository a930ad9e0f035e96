"""Figures 5 to 8 of Spreckels, Schlienkamp and Jacobsen with dense surfaces: even against odd photographs, every cell.

The blocks are those of reproduce_paper_003_dem.py: 80 % end lap, an UltraCamD that errs by the physics of its nine
tiles, and one without errors, which tells the noise. The surface of the even and that of the odd photographs of every
strip are measured by `aerotri.dense_surface` with three adjustments: without additional parameters, with the paper's,
and with those of the tiles and a random field. Beside the spread of even − odd stands what σ of matching foretells of
it, and the spread of their ratio: 1 where σ is right and nothing is left of the image errors.

    python tools/reproduce/reproduce_paper_003_dense.py [FOLDER] [--noise 50 400] [--keep]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import aerotri
from reproduce_paper_003_dem import CM, RESULTS, SETS, SUBSETS, prepare

HEAD = """# Paper 003, figures 5 to 8, with dense surfaces: even against odd photographs

UltraCamD erring by the physics of its tiles, 0.45 px RMS; 26 photographs at 80 %, models of 60 %. Cells of two pixels
that both surfaces measured; cm at a GSD of 9 cm. Foretold: σ of matching of both. z: difference over it.

| grain | adjustment | cells | mean, cm | σ, cm | robust σ, cm | foretold, cm | σ of z | robust σ of z | beyond 4 σ |
|---|---|---|---|---|---|---|---|---|---|"""
WORDS = {"plain": "erring camera, no additional parameters", "perfect": "camera without errors"}


@dataclass(frozen=True, eq=False)
class Measured:
    """A surface: height and σ of matching by the place of the cell, m."""

    z: dict[tuple[int, int], float]
    sigma: dict[tuple[int, int], float]


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
        aerotri.dense_surface(adjustment, given).save(target, plots=False)
    z, sigma = (aerotri.Surface(target / name) for name in ("dsm.tif", "matching.tif"))
    row, column = np.nonzero(np.isfinite(z.z) & np.isfinite(sigma.z))
    at = np.column_stack([z.grid.x(column), z.grid.y(row)]) / z.grid.cell_x
    keys = list(map(tuple, np.floor(at).astype(int).tolist()))
    return Measured(
        dict(zip(keys, z.z[row, column].tolist(), strict=True)),
        dict(zip(keys, sigma.z[row, column].tolist(), strict=True)),
    )


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
    return (
        f"| {grain:g} | {name} | {len(d)} | {d.mean():+.2f} | {d.std():.2f} | {robust(d):.2f} | "
        f"{np.sqrt(np.mean(sigma**2)):.2f} | {z.std():.2f} | {robust(z):.2f} | {far:.2f} % |"
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
