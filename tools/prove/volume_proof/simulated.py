"""One run: a block is simulated and adjusted, pickets are measured in it, and their volume is compared with the truth.

The camera errs by BLUH's parameters, which the adjustment estimates. The ground between the pickets is that of a site.
Every source of error can be switched on alone.

Measures the parts of σ one by one, of pickets at stated places: imports inside on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import shapely

import aerotri
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise, predict
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.image_errors import image_groups
from aerotri.image_errors.error_function import ErrorFunction, error_function
from aerotri.volume.accuracy import PARTS
from aerotri.volume.bases import level
from aerotri.volume.boundary import Boundary, boundary_of
from aerotri.volume.drawn_edge import boundary_variance
from aerotri.volume.functionals import tin_volume, triangulated
from aerotri.volume.parts import part_of_pickets
from aerotri.volume.pickets import Pickets, pickets_where_seen
from aerotri.volume.response import respond
from aerotri.volume.roughness import Between
from aerotri.volume.settings import SigmaOptions
from volume_proof.sites import LEVEL, Site

SPEC = {
    "name": "volume",
    "camera": {
        "ucd": {
            "preset": "ultracam_d",
            "errors": {"parameters": {"bluh.1": 4e-6, "bluh.2": -6e-6, "bluh.9": 3e-10, "bluh.10": 2e-5}},
        }
    },
    "flight": {
        "gsd_m": 0.1, "strips": 3, "images_per_strip": 6, "end_lap": 0.6, "side_lap": 0.4,
        "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
    },
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 15.0, "wavelength_m": 900.0},
    "tie_points": {"per_image": 40, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05]},
    "start_values": {"kind": "perturbed", "position_sigma_m": 0.5, "angle_sigma_deg": 0.02},
}  # fmt: skip
PARAMETERS = "bluh:1-12"
MATCHING_UM, NOISELESS_UM = 3.0, 1e-3
BASE_SIGMA, BOUNDARY_SIGMA = 0.03, 0.5
ALL = frozenset(PARTS)


def boundary(site: Site) -> Boundary:
    """That of a site, as the inside of the package has it."""
    return boundary_of(site.polygon, site.name)


@dataclass(frozen=True)
class Run:
    """Error of the volume and its σ, m³, the σ of every part, and the curvature foretold with its σ."""

    error: float
    sigma: float
    curvature: tuple[float, float]
    parts: dict[str, float]


def run(site: Site, seed: int, on: frozenset[str] = ALL) -> Run:
    """One simulation with some sources of error on."""
    rng = np.random.default_rng([seed, 77])
    calibration, truth = adjusted_block(seed) if "adjustment" in on else free_of_error()
    z, dense = site.heights(rng)
    true = np.column_stack([site.xy, z])
    triangles = triangulated(true)
    # pickets measured without noise say so
    chosen, seen = pickets_where_seen(calibration, true, 1e-3 * (MATCHING_UM if "matching" in on else NOISELESS_UM))
    assert seen.all(), "the block is too small for the site"
    found = replace(chosen, xyz=measured_pickets(calibration, truth, chosen, rng, on))
    value, functional = tin_volume(found.xyz, triangles, boundary(site))
    between = Between()
    if "interpolation" in on:
        part = part_of_pickets(calibration, found, triangles, boundary(site), level(LEVEL), SigmaOptions())
        response, between = part.response, part.between or between
    else:
        response = respond(calibration, found, functional.gradient)
    wanted = tin_volume(true, triangles, boundary(site))[0]
    if "interpolation" in on:
        wanted = float(site.weight @ dense)
    error = value - wanted
    if "base" in on:
        error += float(rng.normal(0.0, BASE_SIGMA)) * boundary(site).area
    surface = TinSurface(found.xyz)
    if "boundary" in on:
        error += _boundary_error(boundary(site), found.xyz, triangles, value, rng)
    parts = {
        "adjustment": np.sqrt(response.variance),
        "matching": np.sqrt(response.noise),
        "interpolation": np.sqrt(between.mean_square),
        "base": BASE_SIGMA * boundary(site).area,
        "boundary": np.sqrt(boundary_variance(surface, level(LEVEL), boundary(site), BOUNDARY_SIGMA)),
    }  # fmt: skip
    sigma = np.sqrt(sum(parts[name] ** 2 for name in on))
    curvature = between.curvature, float(np.sqrt(between.variance))
    return Run(float(error), float(sigma), curvature, {name: float(v) for name, v in parts.items()})


@cache
def free_of_error() -> tuple[Any, Any]:
    """The block adjusted from observations without error: its orientation is the true one."""
    return adjusted_block(1, False)


def adjusted_block(seed: int, noisy: bool = True, spec: dict = SPEC) -> tuple[Any, Any]:
    """A simulated block and its adjustment; without noise its σ stay those of the noise it states."""
    used = spec
    if not noisy:
        used = spec | {
            "tie_points": spec["tie_points"] | {"sigma_um": 0.0, "stated_sigma_um": 2.0},
            "control": spec["control"] | {"sigma_m": [0.0, 0.0, 0.0], "stated_sigma_m": [0.03, 0.03, 0.05]},
        }
    flight = aerotri.simulate(used, seed)
    return aerotri.adjust(flight.block, parameters=PARAMETERS, explain=False).record, flight.truth


def measured_pickets(calibration, truth, pickets: Pickets, rng: np.random.Generator, on: frozenset[str]) -> np.ndarray:
    """(k, 3) m, pickets measured in the true photographs and intersected with the adjusted orientation."""
    block = calibration.result.block
    true = rotation_from_angles(truth.angles, block.rotation)
    xy = true_image_points(calibration, truth, true, pickets)
    if "matching" in on:
        xy = xy + rng.normal(0.0, 1e-3 * MATCHING_UM, xy.shape)
    images = calibration.result.images
    function = error_function(calibration.local, image_groups(block)[0])
    rotation = rotation_from_angles(images.angles, block.rotation)
    return intersected(rotation, images.centre, function.interior, xy - function.of_measured(xy), pickets)


def true_image_points(calibration, truth, rotation: np.ndarray, pickets: Pickets) -> np.ndarray:
    """(r, 2) mm, where the erring camera shows the pickets, without noise."""
    function = error_function(calibration.local, image_groups(calibration.result.block)[0])
    values = dict(zip(truth.parameter_names, truth.parameter_values, strict=True))
    sets = tuple((chosen, np.array([values.get(name, 0.0) for name in chosen.names])) for chosen, _ in function.linear)
    erring = ErrorFunction(function.camera, function.group, truth.interior[0], sets, np.zeros(7), np.zeros(14))
    point = np.repeat(np.arange(len(pickets)), np.diff(pickets.start))
    zero = np.zeros(len(point), np.int64)
    ideal = predict(rotation, truth.centre, pickets.xyz, _interior(truth.interior[0]), pickets.image, point, zero,
                    np.zeros((len(point), 2)))  # fmt: skip
    return erring.measured(ideal)


def intersected(rotation, centre, interior, xy: np.ndarray, pickets: Pickets) -> np.ndarray:
    """(k, 3) m, by least squares on the collinearity equations, rays of equal weight."""
    points, count = pickets.xyz.copy(), np.diff(pickets.start)
    point = np.repeat(np.arange(len(points)), count)
    zero = np.zeros(len(point), np.int64)
    for _ in range(5):
        lin = linearise(rotation, centre, points, _interior(interior), pickets.image, point, zero, np.zeros_like(xy))
        normal, right = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
        np.add.at(normal, point, np.einsum("rai,raj->rij", lin.by_point, lin.by_point))
        np.add.at(right, point, np.einsum("rai,ra->ri", lin.by_point, xy - lin.prediction))
        points += np.linalg.solve(normal, right[..., None])[..., 0]
    return points


def _interior(values: np.ndarray) -> np.ndarray:
    table = np.zeros((1, len(INTERIOR_COLUMNS)))
    table[0, :3] = values[:3]
    return table


def _boundary_error(boundary: Boundary, xyz, triangles, value: float, rng: np.random.Generator) -> float:
    """Volume with corners off by their σ, less the volume; over the level."""
    corners = boundary.rings[0][:-1]
    moved = boundary_of(shapely.Polygon(corners + rng.normal(0.0, BOUNDARY_SIGMA, corners.shape)), "moved")
    return tin_volume(xyz, triangles, moved)[0] - LEVEL * moved.area - (value - LEVEL * boundary.area)


class TinSurface:
    """A TIN, sampled."""

    def __init__(self, xyz: np.ndarray):
        from scipy.interpolate import LinearNDInterpolator

        self._of = LinearNDInterpolator(xyz[:, :2], xyz[:, 2])

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self._of(x, y)
