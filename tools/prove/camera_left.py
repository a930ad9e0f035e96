"""What parameters leave of a camera's errors: σ of heights measured with the orientation, without photographs.

Every draw is another camera: lens, film and unflatness as of `simulation.camera_errors`, 5 µm (0.17 pixel), of which
the parameters describe a part. Half of the tie points take no part in the adjustment; they are intersected afterwards
from rays that have the camera's errors and no noise, as a surface is measured. z is the error of their heights over
the adjustment's share of σ with a noise of matching of 0.04 m (0.08 pixel) beside it, of all points of all draws; ± is
its standard error by draws. Three σ are compared: without the field (the adjustment alone, with σ̂0), with the field
as it is known before anything is measured (σ_f² R), and given the residuals, as the program has it. Measures z of each
of them, so it looks inside the package on purpose. Prints Markdown.

    python tools/prove/camera_left.py [--runs 25] [--first 201] [--blocks …] > tools/results/camera_left.md
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

import aerotri
from aerotri.deformation.restitution import restitution_of
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import CameraField, camera_field
from aerotri.statistics.cluster_fields import correlations, field_equations
from aerotri.statistics.clusters import CAMERA, Clusters
from aerotri.terrain.adjustment_part import variances_at
from dense_surface import GSD_M, IN_PART, SPEC, UNDULATING, of_mean, rms, share_beyond
from runs_elsewhere import add_executor, runs_of

MATCHING_M, FIRST = 0.04, 201
"""σ of a height by matching, and the first draw: no constant was chosen on these."""
NOISE = {"per_image": 400, "sigma_um": 1.5, "stated_sigma_um": 1.5}
"""Half of the tie points take part in the adjustment."""
WEIGHTS = {"radial": 0.0, "tangential": 0.0, "affine": 0.0, "film": 0.0, "unflatness": 0.0}
BROWN = IN_PART[1]
BLOCKS: dict[str, tuple[dict[str, dict[str, Any]], str]] = {
    "two strips of four": ({}, BROWN),
    "the same, tie points free of noise": ({"tie_points": {"per_image": 160, "sigma_um": 0.0}}, BROWN),
    "the same, noise 0.15 pixel": ({"tie_points": {"sigma_um": 4.5, "stated_sigma_um": 4.5}}, BROWN),
    "one strip of six": ({"flight": {"strips": 1, "images_per_strip": 6}}, BROWN),
    "three strips of five, 60 and 20 %": (
        {"flight": {"strips": 3, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.2}}, BROWN,
    ),
    "irregular film alone": ({"weights": {"film": 1.0}}, BROWN),
    "affine film alone": ({"weights": {"affine": 1.0}}, BROWN),
    "no parameters": ({}, "none"),
    "legendre:3x3": ({}, "legendre:3x3"),
    "Brown's and a random field": ({}, f"{BROWN},collocation"),
}  # fmt: skip
"""What differs from two strips of four, and the parameters."""
KINDS = ("without", "beforehand", "given the residuals")
HEAD = (
    "| block | errors px | found | without: z | beforehand: z | ± | of draws | given the residuals: z | ± | of draws |"
    " > 4 σ |\n|---|---|---|---|---|---|---|---|---|---|---|"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--first", type=int, default=FIRST, help="seed of the first draw")
    parser.add_argument("--blocks", nargs="+", choices=list(BLOCKS), default=list(BLOCKS))
    add_executor(parser)
    arguments = parser.parse_args()
    print("# What parameters leave of a camera's errors (tools/prove/camera_left.py)\n\n" + HEAD, flush=True)
    with runs_of(arguments) as runs:
        for name in arguments.blocks:
            print(row(name, runs(measured, name, range(arguments.first, arguments.first + arguments.runs))), flush=True)


def row(name: str, draws: list[tuple[np.ndarray, bool, list[np.ndarray]]]) -> str:
    """A line of the table."""
    cells = [f"{rms(np.concatenate([error for error, _, _ in draws])) / GSD_M:.3f}"]
    cells.append(f"{sum(there for _, there, _ in draws)} of {len(draws)}")
    for k, kind in enumerate(KINDS):
        z, single = np.concatenate([own[k] for _, _, own in draws]), [rms(own[k]) for _, _, own in draws]
        cells.append(f"{rms(z):.2f}")
        if kind != "without":
            doubt = of_mean(np.square(single).tolist()) / (2.0 * rms(z))
            cells += [f"{doubt:.2f}", f"{min(single):.2f} to {max(single):.2f}"]
    return f"| {name} | " + " | ".join([*cells, f"{share_beyond(z):.2f} %"]) + " |"


def spec_of(name: str) -> tuple[dict[str, Any], str]:
    """The flight, and the parameters."""
    other, parameters = BLOCKS[name]
    errors = {"physical": {"rms_um": 5.0} | ({"weights": WEIGHTS | other["weights"]} if "weights" in other else {})}
    spec = SPEC | {"terrain": {"height_m": 50.0} | UNDULATING, "tie_points": SPEC["tie_points"] | NOISE}
    spec |= {table: spec[table] | own for table, own in other.items() if table != "weights"}
    return spec | {"camera": {"cam": SPEC["camera"]["cam"] | {"errors": errors}}}, parameters


def measured(name: str, seed: int) -> tuple[np.ndarray, bool, list[np.ndarray]]:
    """Errors of heights, whether there is a field, and z for each of `KINDS`, of one camera."""
    spec, parameters = spec_of(name)
    flight = aerotri.simulate(spec, seed)
    exact = aerotri.simulate(spec | {"tie_points": spec["tie_points"] | {"sigma_um": 0.0}}, seed).block.image_points
    block, rays, truth = flight.block, flight.block.image_points, flight.truth.points
    count = np.bincount(rays.point, minlength=len(truth))
    tie = np.setdiff1d(np.flatnonzero(count >= 2), block.control.point)
    chosen = np.sort(np.random.default_rng(seed).permutation(tie)[: len(tie) // 2])
    later = np.isin(rays.point, chosen)
    rays = replace(rays, xy=np.where(later[:, None], exact.xy, rays.xy))
    names = [key for key, value in vars(rays).items() if isinstance(value, np.ndarray) and len(value) == len(later)]
    fewer = replace(rays, **{key: getattr(rays, key)[~later] for key in names})
    weak = replace(rays, sigma=np.where(later.reshape(-1, *[1] * (rays.sigma.ndim - 1)), 1e3, 1.0) * rays.sigma)
    found, intersected = (
        aerotri.adjust(replace(block, image_points=own), parameters=parameters, explain=False).record
        for own in (fewer, weak)
    )
    xyz = intersected.result.points.xyz[chosen]
    error = xyz[:, 2] - truth[chosen, 2]
    noise = np.random.default_rng(seed).normal(scale=MATCHING_M, size=len(error))
    left, out = camera_field(found), []
    for own in (None, None if left is None else beforehand(found, left), left):
        given = found, replace(restitution_of(found), left=own), np.arange(len(block.images)), xyz
        out.append((error + noise) / np.sqrt(variances_at(*given, photographs_of(rays, chosen))[:, 2] + MATCHING_M**2))
    return error, left is not None, out


def photographs_of(rays: aerotri.observations.ImagePoints, points: np.ndarray) -> np.ndarray:
    """(n, m) of points, −1 beyond those they have."""
    own = [rays.image[rays.point == point] for point in points]
    out = np.full((len(own), max(map(len, own))), -1)
    for images, filled in zip(own, out, strict=True):
        filled[: len(images)] = images
    return out


def beforehand(found: Adjustment, left: CameraField) -> CameraField:
    """The same field as it is known when nothing but its size and its length is."""
    u = found.system.unknowns
    factor = found.system.factorise(found.solution.equations)
    one = Clusters(CAMERA, np.zeros(len(u.images), np.int64), ("",), 1)
    sides = field_equations(found.system, found.solution, factor, one).sides
    # there is one camera
    power, patterns = np.linalg.eigh(left.sigma**2 * correlations(u.block.cameras, left.length, True)[0])
    root = np.kron(np.eye(2 * len(left.root)), patterns * np.sqrt(np.maximum(power, 0.0)))
    by_unknowns = factor.solve(np.ascontiguousarray(sides @ root))
    by_unknowns[: 6 * len(u.images)] *= u.eo_free.reshape(-1, 1)
    return replace(left, root=root.reshape(len(left.root), 2, -1, root.shape[1]), by_unknowns=by_unknowns)


if __name__ == "__main__":
    main()
