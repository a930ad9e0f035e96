"""Brighton's surface against the point cloud of another program, for several models of the camera.

The flight has no control, and GNSS of metres: place, tilt and scale of the surface are worth little, and place and tilt
are taken off by the alignment. What is left is mostly a bowl, the weak mode of parallel strips that look straight down.
Printed are the spread of the differences (NMAD), what is left of it without the bowl, and the bowl itself: its root
mean square over the surface, the standard deviation that the adjustment states for it (of the noise, and in total), and
chi² of its three coefficients over 3. 1 is right where the cloud of the other program has no bowl of its own.
Prints Markdown.

Example: python tools/prove/brighton_surface.py OUT --data ../shared/data/brighton > tools/results/brighton_surface.md
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio

import aerotri
from aerotri import observations

Parameters = str | tuple[tuple[str, tuple[str, ...]], ...]
GSD_M, FOCAL_MM = 0.0231, 3.61
POINTS = 150
"""Ground points whose joint covariance gives σ of the bowl."""
FREED = "lens, principal distance free"
LENS = (("lens", ("k1", "k2", "p1", "p2", "k3")),)
B1_B2 = ("brown", ("b1", "b2"))
MOTION_SIGMA_M_S = 0.3
HEAD = (
    "| model | σ0 | readout ms | cells | NMAD m | GSD | without bowl, GSD | bowl m | its σ m | total σ m | χ²/3 | "
    "in total |"
)


def held(
    readout_ms: float, direction: str = "down", motion: str = "track", rotation: str = "off"
) -> observations.RollingShutter:
    """A rolling shutter with a known readout time."""
    known = observations.Prior(readout_ms, fixed=True)
    return observations.RollingShutter(known, direction, motion, MOTION_SIGMA_M_S, rotation)


FREE = observations.RollingShutter(observations.Prior(0.0))
FREE_FOCAL = observations.Prior(FOCAL_MM)
MODELS: dict[str, tuple[Parameters, observations.RollingShutter | None, Mapping[str, Any]]] = {
    "lens": (LENS, None, {}),
    "none": ("none", None, {}),
    "brown": ("brown:K1+K2+K3+P1+P2", None, {}),
    "legendre:4x4": ("legendre:4x4", None, {}),
    "legendre:5x5": ("legendre:5x5", None, {}),
    "auto": ("auto", None, {}),
    "lens, a set a strip": (LENS, None, {"parameter_groups": "strip"}),
    "lens, strips differ": (LENS, None, {"parameter_groups": "strip", "deviations": {"kind": "independent"}}),
    FREED: (LENS, None, {}),
    "lens, b1, b2": ((*LENS, B1_B2), None, {}),
    "lens, readout free": (LENS, FREE, {}),
    "lens, b1, b2, readout free": ((*LENS, B1_B2), FREE, {}),
    "lens, 33 ms held": (LENS, held(33.0), {}),
    "lens, 33 ms held, from the lowest row": (LENS, held(33.0, "up"), {}),
    "lens, 33 ms, motion by photograph": (LENS, held(33.0, motion="photograph"), {}),
    "lens, 33 ms, motion and rotation by photograph": (
        LENS, held(33.0, motion="photograph", rotation="photograph"), {},
    ),
}  # fmt: skip


def modelled(block: aerotri.Block, name: str) -> aerotri.Block:
    """The block with one of the models."""
    parameters, shutter, settings = MODELS[name]
    cameras = tuple(replace(camera, rolling_shutter=shutter) for camera in block.cameras)
    if name == FREED:
        cameras = tuple(replace(c, interior={**c.interior, "focal_length_mm": FREE_FOCAL}) for c in cameras)
    block = replace(block, cameras=cameras)
    if isinstance(parameters, str):
        return aerotri.with_settings(block, parameters=parameters, **settings)
    adjustment = replace(block.settings.adjustment, additional_parameters=parameters)
    block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    return aerotri.with_settings(block, **settings)


def bowl_basis(xy: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(n, 6): 1, x, y, x², xy, y² with x, y in units of 100 m from the centre."""
    x, y = ((xy - centre) / 100.0).T
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def differences(place: Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 2) m and differences (n,) m of the cells compared."""
    with rasterio.open(place) as file:
        z = file.read(1, masked=True)
        rows, columns = np.nonzero(~np.ma.getmaskarray(z) & np.isfinite(z.data))
        x, y = file.xy(rows, columns)
    return np.column_stack([x, y]), z.data[rows, columns].astype(float)


def robust_fit(design: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Coefficients of a fit whose large residuals (houses, trees) count less."""
    weight, found = np.ones(len(z)), np.zeros(design.shape[1])
    for _ in range(30):
        found = np.linalg.lstsq(design * weight[:, None], z * weight, rcond=None)[0]
        weight = 1.0 / np.sqrt(np.maximum(1.0, np.abs(z - design @ found) / (2.0 * GSD_M)))
    return found


def nmad(values: np.ndarray) -> float:
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def spread_points(result: aerotri.Adjustment, low: np.ndarray, high: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Names and positions of points of three or more rays, far from one another."""
    table = result.points
    xyz = np.column_stack([table[axis] for axis in "XYZ"])
    inside = np.all((xyz[:, :2] > low) & (xyz[:, :2] < high), axis=1) & (table["rays"] >= 3)
    there = np.flatnonzero(inside)
    taken = [int(there[0])]
    nearest = np.full(len(there), np.inf)
    while len(taken) < min(POINTS, len(there)):
        nearest = np.minimum(nearest, np.linalg.norm(xyz[there, :2] - xyz[taken[-1], :2], axis=1))
        taken.append(int(there[np.argmax(nearest)]))
    return table["point"][taken].astype(str).tolist(), xyz[taken]


def row(block: aerotri.Block, folder: Path, data: Path, name: str) -> str:
    """One line of the table."""
    result = aerotri.adjust(modelled(block, name), explain=False)
    if result.status != "converged":
        return f"| {name} | {result.sigma0:.3f} | {result.status}" + " |" * (HEAD.count("|") - 3)
    result.save(folder / "result", plots=False)
    aerotri.terrain(folder / "result", data / "images").save(folder / "dtm", plots=False)
    compared = aerotri.compare(folder / "dtm" / "dsm.tif", data / "model.laz", align="rigid")
    compared.save(folder / "compared", plots=False)
    xy, z = differences(folder / "compared" / "difference.tif")
    centre = xy.mean(axis=0)
    design = bowl_basis(xy, centre)
    found = robust_fit(design, z)
    names, xyz = spread_points(result, xy.min(axis=0), xy.max(axis=0))
    covariance = result.covariance(names)
    per_height = np.linalg.pinv(bowl_basis(xyz[:, :2], centre))[3:]
    noise, total = (per_height @ q[2::3, 2::3] @ per_height.T for q in (covariance.matrix, covariance.total))
    plane = design[:, :3]
    shape = design[:, 3:] - plane @ np.linalg.lstsq(plane, design[:, 3:], rcond=None)[0]

    def size(c: np.ndarray) -> float:
        return float(np.sqrt(np.trace(shape.T @ shape @ c) / len(shape)))

    bowl = found[3:]
    chi2 = [float(bowl @ np.linalg.solve(c, bowl) / 3.0) for c in (noise, total)]
    shutters = result.adjusted.rolling_shutters
    readout = ""
    if shutters is not None and shutters.readouts and MODELS[name][1] is FREE:
        readout = f"{shutters.readouts[0].readout_ms:.1f} ± {shutters.readouts[0].sigma_ms:.1f}"
    spread, without = nmad(z), nmad(z - design @ found)
    sizes = [f"{size(c):.4f}" for c in (np.outer(bowl, bowl), noise, total)]
    numbers = [f"{result.sigma0:.3f}", readout, f"{len(z)}", f"{spread:.4f}", f"{spread / GSD_M:.1f}",
               f"{without / GSD_M:.2f}", *sizes, *(f"{value:.3g}" for value in chi2)]  # fmt: skip
    return "| " + " | ".join([name, *numbers]) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the results")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/brighton"))
    parser.add_argument("--models", nargs="+", choices=list(MODELS), default=list(MODELS))
    options = parser.parse_args()
    tied = options.out / "block"
    if not tied.exists():
        aerotri.tie_points(options.data / "images").save(tied)
    block = aerotri.read_block(tied)
    print("# Brighton's surface against another program's cloud (tools/prove/brighton_surface.py)\n")
    print(HEAD + "\n|" + "---|" * (HEAD.count("|") - 1))
    for name in options.models:
        try:
            line = row(
                block, options.out / name.replace(" ", "_").replace(",", "").replace(":", "_"), options.data, name
            )
        except (aerotri.InputError, aerotri.AdjustmentFailedError) as error:
            line = f"| {name} | {error} |"
        print(line, flush=True)


if __name__ == "__main__":
    main()
