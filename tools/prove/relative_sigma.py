"""Errors of shape over the relative σ: simulated blocks against their truth, and Brighton against another's cloud.

The points of a block are laid onto their truth by a similarity of seven parameters, least squares over the points with
three rays or more; errors that are left over their relative σ (x_rX, x_rY, x_rZ) have a mean square of 1. Blocks with
control, with GNSS of metres alone, and with self-calibration. The scale of the similarity over its σ likewise.
Brighton's tie points are laid onto the point cloud of another program, point to plane, by a similarity whose large
residuals count less; the spread of what is left in height (NMAD) over the relative σ holds the errors of the cloud too.
Prints Markdown.

Example: python tools/prove/relative_sigma.py --blocks 200 --brighton BLOCK > tools/results/relative_sigma.md
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

import aerotri
from runs_elsewhere import Runs, add_executor, runs_of

FLIGHT = {"gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.3, "heading_deg": 20.0,
          "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0]}  # fmt: skip
CONTROL = {"distance_bases": 2.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 0}
NO_CONTROL = {"positions": [], "check_points": 0}
CASES = {
    "control": ({"control": CONTROL}, "none"),
    "control, brown:K1+K2+P1+P2": ({"control": CONTROL}, "brown:K1+K2+P1+P2"),
    "GNSS of 2 and 4 m": ({"control": NO_CONTROL, "gnss": {"sigma_m": [2.0, 2.0, 4.0]}}, "none"),
    "GNSS, brown:K1+K2+P1+P2": ({"control": NO_CONTROL, "gnss": {"sigma_m": [2.0, 2.0, 4.0]}}, "brown:K1+K2+P1+P2"),
}
NEIGHBOURS, ROUNDS = 12, 60
LEVEL_GROUND = 0.8
"""Vertical part of the normal of a place of the cloud, from which heights are compared."""


def spec(changes: dict[str, Any]) -> dict[str, Any]:
    """Two strips of five photographs of an UltraCamD, 60/30 %, image points of 2 µm."""
    return {
        "name": "relative", "camera": {"ucd": {"preset": "ultracam_d"}}, "flight": FLIGHT,
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
        "tie_points": {"per_image": 40, "probability": 0.9, "sigma_um": 2.0},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    } | changes  # fmt: skip


def similarity(points: np.ndarray, truth: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, float]:
    """Points (n, 3) laid onto their truth over those that are used, and the scale [L: Umeyama 1991]."""
    middle, aim = points[used].mean(axis=0), truth[used].mean(axis=0)
    u, size, v = np.linalg.svd((truth[used] - aim).T @ (points[used] - middle))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    scale = float(np.sum(size * [1.0, 1.0, np.linalg.det(u @ v)]) / np.sum((points[used] - middle) ** 2))
    return scale * (points - middle) @ turn.T + aim, scale


def of_block(case: tuple[dict[str, Any], str], seed: int) -> np.ndarray:
    """Mean squares of errors over relative σ in X, Y, Z, of the scale over its σ, and relative over absolute σ of Z."""
    changes, parameters = case
    simulated = aerotri.simulate(spec(changes), seed=seed)
    result = aerotri.adjust(simulated.block, parameters=parameters, explain=False, model_part="off")
    table, truth = result.points, simulated.truth.points
    xyz, sigma = (np.column_stack([table[start + axis] for axis in "XYZ"]) for start in ("", "x_r"))
    known = np.isfinite(sigma).all(axis=1)
    moved, scale = similarity(xyz, truth, known & (table["rays"] >= 3))
    z2 = ((moved - truth) / sigma)[known] ** 2
    return np.array([
        *z2.mean(axis=0), ((scale - 1.0) / result.precision["scale"]) ** 2,
        np.median(sigma[known, 2] / table["sZ"][known]),
    ])  # fmt: skip


def brighton(block: Path, data: Path, model_part: str) -> str:
    """A line about the flight over Brighton Beach."""
    result = aerotri.adjust(
        aerotri.read_block(block), parameters="lens:k1+k2+k3+p1+p2", explain=False, model_part=model_part
    )
    table = result.points
    xyz = np.column_stack([table[axis] for axis in "XYZ"])
    seen = np.isfinite(xyz).all(axis=1) & (table["rays"] >= 3)
    error, kept = heights_over_cloud(xyz[seen], cloud(data / "model.laz"))
    sigma = table["x_rZ"][seen][kept]
    p = result.precision
    numbers = [len(error), p["points"]["absolute_m"]["Z"], float(np.median(sigma)), nmad(error), nmad(error / sigma)]
    what = "total" if model_part == "on" else "noise alone"
    return f"| {what} | " + " | ".join(f"{value:.4g}" for value in numbers) + f" | {100.0 * p['scale']:.2g} % |"


def cloud(path: Path) -> np.ndarray:
    """(n, 3) m, the points of a cloud."""
    import laspy

    return np.asarray(laspy.read(path).xyz)


def heights_over_cloud(points: np.ndarray, ground: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) m, heights of points over a cloud after a similarity, and the rows of these points."""
    origin = ground.mean(axis=0)
    moved, tree = points - origin, KDTree(ground - origin)
    off, normal, good = np.zeros(len(points)), np.zeros_like(points), np.zeros(len(points), bool)
    for number in range(ROUNDS):
        away, near = tree.query(moved, k=NEIGHBOURS)
        place = tree.data[near]
        apart = place - place.mean(axis=1, keepdims=True)
        rough, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", apart, apart) / NEIGHBOURS)
        normal = axes[:, :, 0]
        off = np.einsum("ni,ni->n", normal, place.mean(axis=1) - moved)
        good = (away[:, 0] < max(3.0 * 0.8**number, 0.5)) & (rough[:, 0] < 0.01)
        weight = good / np.sqrt(1.0 + (off / (1.5 * np.median(np.abs(off[good])))) ** 2)
        design = np.column_stack([normal, np.cross(moved, normal), np.einsum("ni,ni->n", normal, moved)])
        step = np.linalg.lstsq(design * weight[:, None], off * weight, rcond=None)[0]
        moved = moved + step[:3] + np.cross(step[3:6], moved) + step[6] * moved
    kept = good & (np.abs(normal[:, 2]) > LEVEL_GROUND)
    return (off / normal[:, 2])[kept], kept


def nmad(values: np.ndarray) -> float:
    """Spread that outliers do not enlarge, σ of normal errors."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=200)
    parser.add_argument("--brighton", type=Path, help="block that `aerotri tiepoints` made of Brighton's photographs")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/brighton"))
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs:
        tables(options, runs)


def tables(options: argparse.Namespace, runs: Runs) -> None:
    """Print the tables of simulated blocks and of Brighton."""
    print(f"# Relative σ (tools/prove/relative_sigma.py)\n\n{options.blocks} simulated blocks of ten photographs each: "
          "RMS of errors after a similarity over their relative σ, with its scatter\n")  # fmt: skip
    print("| held by | X | Y | Z | scale | relative over absolute σ of Z |\n|---|---|---|---|---|---|")
    for name, case in CASES.items():
        found = np.array(runs(of_block, case, range(1, options.blocks + 1)))
        rms, scatter = np.sqrt(found.mean(axis=0)), found.std(axis=0) / np.sqrt(len(found))
        cells = [f"{r:.3f} ± {s / (2.0 * r):.3f}" for r, s in zip(rms[:4], scatter[:4], strict=True)]
        print(f"| {name} | {' | '.join(cells)} | {np.median(found[:, 4]):.3f} |", flush=True)
    if options.brighton is not None:
        print(
            "\nBrighton (18 photographs, GNSS of 5 m, no control), tie points against the cloud of another program:\n"
        )
        print(
            "| σ | points | σ of Z, m | relative σ of Z, m | NMAD, m | NMAD of error over relative σ | σ of the scale |"
        )
        print("|---|---|---|---|---|---|---|")
        for model_part in ("on", "off"):
            print(brighton(options.brighton, options.data, model_part), flush=True)


if __name__ == "__main__":
    main()
