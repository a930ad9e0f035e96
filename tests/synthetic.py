"""An adjusted block made up for tests: plausible in every array, without running an adjustment."""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import AdjustmentSettings, Block, Camera, Control, ImagePoints, Images, Prior, Settings
from aerotri.results.adjusted_block import (
    AdjustedBlock,
    Blunder,
    GroundPointResults,
    ImageResults,
    ObservationGroup,
    Outcome,
    PointResults,
    RayResults,
    SharedParameters,
)

SIGMA_MM = 2.5e-3
SIGMA0 = 1.04
GSD = 0.17
CONTROL_SIGMA = 0.05


def ultracam(name: str = "ucd2", flight_axis: str = "+y") -> Camera:
    """An UltraCamD."""
    interior = {"focal_length_mm": Prior(101.4, 0.01), "x0_mm": Prior(0.0, fixed=True), "y0_mm": Prior(0.0, fixed=True)}
    return Camera(name, "ultracam_d", (11500, 7500), 9.0, interior, flight_axis=flight_axis)


def _images(camera: Camera, strips: int, per_strip: int, rng) -> tuple[Images, np.ndarray]:
    """Strips flown east and back, 80 % end lap and 60 % side lap, the camera's y along the flight."""
    height = GSD / camera.pixel_mm * camera.focal_length_mm
    base, spacing = 0.2 * camera.size_px[1] * GSD, 0.4 * camera.size_px[0] * GSD
    strip, number = np.divmod(np.arange(strips * per_strip), per_strip)
    back = strip % 2 == 1
    along = np.where(back, per_strip - 1 - number, number) * base
    centre = np.stack([612000 + along, 6562000 + strip * spacing, np.full(len(strip), height + 120.0)], axis=-1)
    centre += rng.normal(0, 12.0, centre.shape)
    angles = np.radians(
        rng.normal(0, 0.6, centre.shape) + np.stack([0 * strip, 0 * strip, np.where(back, 90, -90)], -1)
    )
    names = np.array([f"{s + 1:02d}_{n + 1:03d}" for s, n in zip(strip, number, strict=True)])
    day = np.where(strip < (strips + 1) // 2, "day 1", "day 2")
    images = Images(
        names, np.zeros(len(strip), np.int64), np.array([f"strip {s + 1}" for s in strip]), centre, angles, {"day": day}
    )
    return images, centre


def _ground(centre: np.ndarray, n_points: int, rng) -> np.ndarray:
    low, high = centre[:, :2].min(axis=0) - 350.0, centre[:, :2].max(axis=0) + 350.0
    xy = rng.uniform(low, high, (n_points, 2))
    return np.column_stack([xy, 120.0 + 30.0 * np.sin(xy[:, 0] / 700.0) * np.cos(xy[:, 1] / 500.0)])


def _project(camera: Camera, images: Images, xyz: np.ndarray):
    """All rays inside the format: image, point (m,) and x, y (m, 2) mm."""
    rotation = rotation_from_angles(images.angles)
    u = np.einsum("nki,npk->npi", rotation, xyz[None] - images.centre[:, None])
    xy = -camera.focal_length_mm * u[..., :2] / u[..., 2:]
    image, point = np.nonzero((np.abs(xy) < np.array(camera.half_format_mm)).all(axis=-1))
    return image, point, xy[image, point]


def _shared(camera: Camera, spec: str, groups: list[str], xy: np.ndarray, rng) -> SharedParameters:
    """Principal distance and additional parameters with the covariance that the rays' positions give."""
    names, columns, marks = ["focal_length_mm"], [], [""]
    for family, items in parse_parameters(spec):
        chosen = parameter_set(family, items, camera)
        names += chosen.names
        marks += ["P"] * len(items)
        columns.append(chosen.basis(*xy.T).reshape(2 * len(xy), -1))
    q_block, value_block = np.array([[0.004**2]]), np.array([101.4021])
    if columns:
        basis = np.concatenate(columns, axis=1)
        x, y = xy.T / camera.focal_length_mm
        one, zero, f = np.ones_like(x), np.zeros_like(x), camera.focal_length_mm
        # the orientation of every photograph takes these directions away from the additional parameters
        six = np.stack([one, zero, zero, one, x, y, -y, x, f * x * y, f * (1 + y * y), f * (1 + x * x), f * x * y])
        six = six.reshape(6, 2, -1).transpose(2, 1, 0).reshape(-1, 6)
        basis = basis - six @ np.linalg.lstsq(six, basis, rcond=None)[0]
        size = np.linalg.norm(basis, axis=0)
        normal = (basis / size).T @ (basis / size) + 1e-6 * np.eye(basis.shape[1])
        q = (SIGMA0 * SIGMA_MM) ** 2 * np.linalg.inv(normal) / np.outer(size, size)
        truth = rng.normal(0, 0.0005, basis.shape[1]) * np.sqrt(len(xy)) / size
        value_block = np.concatenate([value_block, truth + np.linalg.cholesky(q) @ rng.normal(size=len(q))])
        q_block = np.block([[q_block, np.zeros((1, len(q)))], [np.zeros((len(q), 1)), q]])
    s, g = len(names), len(groups)
    value = np.concatenate([value_block + (0.3 * k * np.sqrt(np.diag(q_block))) for k in range(g)])
    covariance = np.kron(np.eye(g), q_block)
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance))) - np.eye(s * g)
    largest = np.argmax(np.abs(correlation), axis=1)
    all_names, kinds = np.array(names * g), np.array((["interior"] + ["additional"] * (s - 1)) * g)
    total = 1.0 - 1.0 / (np.diag(covariance) * np.diag(np.linalg.inv(covariance)))
    return SharedParameters(
        all_names, np.repeat(groups, s), kinds, np.array(marks * g), value, covariance,
        correlation[np.arange(s * g), largest], all_names[largest], total,
        np.full(s * g, "estimated"), np.full(s * g, ""),
    )  # fmt: skip


def _tile_pattern(camera: Camera, xy: np.ndarray) -> np.ndarray:
    """What a model without tile parameters leaves: (m, 2) mm, constant in each ninth of the format."""
    column, row = (np.clip(np.floor(1.5 * (xy[:, k] / camera.half_format_mm[k] + 1)), 0, 2).astype(int) for k in (0, 1))
    shift = np.random.default_rng(5).normal(0, 1.2e-3, (3, 3, 2))
    return shift[row, column]


def _ground_results(rows: np.ndarray, xyz_sigma: np.ndarray, rays: np.ndarray, check: bool, given, rng):
    sigma = xyz_sigma[rows]
    spread = np.hypot(sigma, CONTROL_SIGMA) if check else np.full_like(sigma, 0.8 * CONTROL_SIGMA)
    w = np.where(np.isfinite(given), rng.normal(size=sigma.shape), np.nan)
    r = np.where(np.isfinite(given), np.nan if check else 0.7, np.nan)
    return GroundPointResults(rows, w * spread, sigma, r, w, rays[rows])


def make_adjusted_block(
    strips: int = 4,
    per_strip: int = 10,
    n_points: int = 300,
    n_control: int = 12,
    n_check: int = 20,
    parameters: str = "bluh:1-12,ultracam_d:42-73",
    groups: str = "camera",
    leftover: bool = False,
    camera: Camera | None = None,
    name: str = "frederiksstad",
    seed: int = 1,
) -> AdjustedBlock:
    """A block of `strips × per_strip` photographs with everything an adjustment would deliver.

    Parameters
    ----------
    groups : 'camera', 'block' or 'day' (two days).
    leftover : add a pattern of nine tiles to the residuals, as if the tile parameters were missing.
    """
    rng = np.random.default_rng(seed)
    camera = camera or ultracam()
    images, centre = _images(camera, strips, per_strip, rng)
    xyz = _ground(centre, n_points, rng)
    image, point, xy = _project(camera, images, xyz)
    rays = np.bincount(point, minlength=n_points)
    r = rng.uniform(0.45, 0.9, xy.shape)
    v = rng.normal(0, SIGMA0 * SIGMA_MM, xy.shape) * np.sqrt(r)
    if leftover:
        v -= _tile_pattern(camera, xy)
    used = rays[point] >= 2
    status = np.where(used, 0, 1)
    v[~used], r[~used] = np.nan, np.nan
    w = -v / (SIGMA_MM * np.sqrt(r))
    names = np.array([f"{i + 1001}" for i in range(n_points)])
    known = rng.permutation(np.flatnonzero(rays >= 4))[: n_control + n_check]
    given = xyz[known].copy()
    given[1:n_control:5, :2] = np.nan
    given[2:n_control:5, 2] = np.nan
    is_check = np.arange(len(known)) >= n_control
    control = Control(known, given, np.where(np.isfinite(given), CONTROL_SIGMA, np.nan), is_check)
    settings = Settings(
        AdjustmentSettings(additional_parameters=parse_parameters(parameters), parameter_groups=groups),
        image_sigma_um=SIGMA_MM * 1e3,
    )
    block = Block(name, (camera,), images, names, ImagePoints(image, point, xy, np.full(xy.shape, SIGMA_MM)), control,
                  settings=settings)  # fmt: skip
    sigma_point = np.array([0.03, 0.03, 0.08]) * np.sqrt(7.0 / np.maximum(rays, 2))[:, None]
    sigma_point[rays < 2] = np.nan
    sigma_image = np.concatenate([np.full(3, 0.06), np.radians([0.0012, 0.0012, 0.0006])])
    max_w = np.zeros(n_points)
    np.maximum.at(max_w, point[used], np.abs(w[used]).max(axis=1))
    group_names = {"camera": [camera.name], "block": ["block"], "day": ["day 1", "day 2"]}[groups]
    n = len(images)
    n_used = int(used.sum())
    unknowns = 3 * n_points + 6 * n + 45
    outcome = Outcome(
        "converged", "", 4, SIGMA0, SIGMA0 * SIGMA_MM * 1e3, 1.0 * n_used, 2 * n_used, unknowns, 0,
        2 * n_used - unknowns, ("Point 1007 was measured in one photograph and left out.",),
        {"read": 0.1, "start_values": 0.2, "solve": 0.8, "statistics": 0.4},
    )  # fmt: skip
    return AdjustedBlock(
        block,
        outcome,
        ImageResults(centre, images.angles, np.tile(np.diag(sigma_image**2), (n, 1, 1)),
                     np.bincount(image[used], minlength=n)),
        PointResults(np.where(rays[:, None] >= 2, xyz, np.nan), sigma_point[:, :, None] ** 2 * np.eye(3), rays, max_w),
        RayResults(v, r, w, np.ones(len(v)), status),
        _shared(camera, parameters, group_names, xy, rng),
        _ground_results(known[~is_check], sigma_point, rays, False, given[~is_check], rng),
        _ground_results(known[is_check], sigma_point, rays, True, given[is_check], rng),
        (ObservationGroup("image points", 2 * n_used, 2.5, 2.1, 0.66 * 2 * n_used, 2.6),
         ObservationGroup("control", 3 * n_control, 0.05, 0.045, 0.7 * 3 * n_control, 0.052)),
        (Blunder(str(images.names[-1]), names[5], 7.4, 0.0213, "reported"),),
    )  # fmt: skip
