"""Small flights measured without error, from which the blocks of the proof are put together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri import Block, geometry
from aerotri import observations as obs

HEIGHT, BASE, SPACING, FOCAL = 1000.0, 300.0, 500.0, 100.0
SIGMA_MM, SIGMA_CONTROL = 2e-3, 0.03


@dataclass(frozen=True)
class Flight:
    """What a block looks like.

    Parameters
    ----------
    strips, per_strip : numbers of photographs. relief : m, half the height differences. tilt : degrees, σ of ω, φ.
    wander : m, σ of the centres about the straight line. seed : of all random numbers.
    """

    strips: int = 2
    per_strip: int = 4
    relief: float = 60.0
    tilt: float = 1.0
    wander: float = 8.0
    seed: int = 1


def camera(**priors: obs.Prior) -> obs.Camera:
    """A camera of 160 × 110 mm, held unless said otherwise."""
    held = {
        "focal_length_mm": obs.Prior(FOCAL, fixed=True), "x0_mm": obs.Prior(0.0, fixed=True),
        "y0_mm": obs.Prior(0.0, fixed=True),
    }  # fmt: skip
    return obs.Camera("cam", "frame", (16000, 11000), 10.0, held | priors, flight_axis="+y")


def flown(flight: Flight) -> Block:
    """A block flown east, without control."""
    rng = np.random.default_rng(flight.seed)
    n = flight.strips * flight.per_strip
    strip, number = np.divmod(np.arange(n), flight.per_strip)
    centre = np.stack([number * BASE, strip * SPACING, np.full(n, HEIGHT)], axis=1)
    centre = centre + rng.normal(0.0, flight.wander, centre.shape) if flight.wander else centre
    angles = np.zeros((n, 3))
    angles[:, 2] = np.pi / 2
    angles += np.radians(flight.tilt) * rng.normal(size=angles.shape)
    east, north = (flight.per_strip - 1) * BASE, (flight.strips - 1) * SPACING
    x, y = np.meshgrid(np.arange(-200.0, east + 201.0, 140.0), np.arange(-450.0, north + 451.0, 170.0))
    xyz = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    xyz[:, :2] += rng.uniform(-40.0, 40.0, (len(xyz), 2))
    xyz[:, 2] = flight.relief * rng.uniform(-1.0, 1.0, len(xyz))
    names = np.array([f"p{k:03d}" for k in range(n)])
    images = obs.Images(names, np.zeros(n, np.int64), np.array([f"s{k}" for k in strip]), centre, angles)
    settings = obs.Settings(image_sigma_um=SIGMA_MM * 1e3, gnss=obs.GnssSettings(shift="off"))
    block = Block("proof", (camera(),), images, np.zeros(0, str), measured(images, xyz), settings=settings)
    return with_points(block, np.array([str(k) for k in range(len(xyz))]), xyz)


def measured(images: obs.Images, xyz: np.ndarray) -> obs.ImagePoints:
    """All rays inside the format."""
    u = np.einsum("nki,npk->npi", geometry.rotation_from_angles(images.angles), xyz[None] - images.centre[:, None])
    xy = -FOCAL * u[..., :2] / u[..., 2:]
    image, point = np.nonzero((np.abs(xy) < [80.0, 55.0]).all(axis=-1))
    return obs.ImagePoints(image, point, xy[image, point], np.full((len(image), 2), SIGMA_MM))


def with_points(block: Block, names: np.ndarray, xyz: np.ndarray) -> Block:
    """The block with its points named, and their true coordinates kept as check points."""
    everywhere = np.arange(len(xyz))
    truth = obs.Control(everywhere, xyz, np.full(xyz.shape, SIGMA_CONTROL), np.ones(len(xyz), dtype=bool))
    return replace(block, points=names, control=truth)


def rays_of(block: Block) -> np.ndarray:
    """(N,) rays of every point."""
    return np.bincount(block.image_points.point, minlength=len(block.points))


def only_rays(block: Block, keep: np.ndarray) -> Block:
    """The block with some of its rays, (m,) bool."""
    rays = block.image_points
    return replace(
        block, image_points=obs.ImagePoints(rays.image[keep], rays.point[keep], rays.xy[keep], rays.sigma[keep])
    )


def with_control(block: Block, rows: np.ndarray, axes: str = "XYZ") -> Block:
    """The block with points as control, in some of the coordinates."""
    control, known = block.control, np.array([letter in axes for letter in "XYZ"])
    is_check, xyz = control.is_check.copy(), control.xyz.copy()
    is_check[rows] = False
    xyz[np.ix_(rows, ~known)] = np.nan
    return replace(block, control=replace(control, is_check=is_check, xyz=xyz))


def with_gnss(block: Block, shift: str = "off", drift: str = "off") -> Block:
    """The block with observed projection centres."""
    n = len(block.images)
    none = np.full((n, 3), np.nan)
    time = np.arange(n, dtype=float)
    observed = obs.GnssIns(np.arange(n), block.images.centre.copy(), np.full((n, 3), 0.05), none, none, time)
    settings = replace(block.settings, gnss=obs.GnssSettings(shift=shift, drift=drift))
    return replace(block, gnss_ins=observed, settings=settings)


def with_camera(block: Block, **priors: obs.Prior) -> Block:
    """The block with elements of the interior orientation free or observed."""
    return replace(block, cameras=(camera(**priors),))


def corners(block: Block, count: int) -> np.ndarray:
    """Rows of points near the corners of the block, in three photographs or more where there are any."""
    xyz, rays = block.control.xyz, rays_of(block)
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    wanted = [(0.1, 0.2), (0.9, 0.8), (0.1, 0.8), (0.9, 0.2), (0.5, 0.1), (0.5, 0.9)]
    rows: list[int] = []
    for share in wanted[:count]:
        off = np.linalg.norm(xyz[:, :2] - (low + np.array(share) * (high - low)), axis=1)
        off[rays < min(3, rays.max())] = np.inf
        off[rows] = np.inf
        rows.append(int(np.argmin(off)))
    return np.array(rows)
