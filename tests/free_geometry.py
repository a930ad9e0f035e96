"""Simulated blocks of any geometry: photographs that look at a point each, points that they see, noise of the rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    Control,
    GnssIns,
    ImagePoints,
    Images,
    Prior,
    Settings,
)

SIZE_PX, PIXEL_UM, FOCAL_MM = (3000, 2000), 5.0, 12.0
SIGMA_MM = 0.001
"""A fifth of a pixel."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Where photographs stand (n, 3) m, what they look at (n, 3) m, turned about their axes (n,) rad, and the object
    points (N, 3) m with the directions (N, 3) from which they can be seen."""

    centre: np.ndarray
    aim: np.ndarray
    roll: np.ndarray
    points: np.ndarray
    normal: np.ndarray


def circle(rng: np.random.Generator) -> Scene:
    """Sixteen photographs about an object, all looking at its middle."""
    around = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    height = rng.uniform(4.0, 9.0, 16)
    centre = np.column_stack([30.0 * np.cos(around), 30.0 * np.sin(around), height])
    points = np.column_stack([rng.uniform(-8.0, 8.0, (120, 2)), rng.uniform(0.0, 6.0, 120)])
    aim = np.tile([0.0, 0.0, 2.0], (16, 1)) + rng.normal(0.0, 0.5, (16, 3))
    return Scene(centre, aim, rng.normal(0.0, 0.05, 16), points, np.zeros_like(points))


def facade(rng: np.random.Generator) -> Scene:
    """Two rows of photographs along the front of a house, axes horizontal: ω = 90°, some turned on their side."""
    along = np.tile(np.linspace(0.0, 40.0, 9), 2)
    height = np.repeat([2.0, 8.0], 9)
    centre = np.column_stack([along, np.full(18, -20.0) + rng.normal(0.0, 1.0, 18), height])
    aim = np.column_stack([along + rng.normal(0.0, 2.0, 18), np.zeros(18), height + rng.normal(0.0, 0.5, 18)])
    points = np.column_stack([rng.uniform(-6.0, 46.0, 300), rng.uniform(0.0, 2.0, 300), rng.uniform(0.0, 12.0, 300)])
    return Scene(centre, aim, np.where(np.arange(18) % 5 == 2, np.pi / 2, 0.0), points, np.zeros_like(points))


def facade_east(rng: np.random.Generator) -> Scene:
    """The front turned to the east: φ = −90°, where ω and κ cannot be told apart."""
    found = facade(rng)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    centre = found.centre @ turn.T
    return replace(found, centre=centre, aim=centre * [0.0, 1.0, 1.0], points=found.points @ turn.T)


def oblique(rng: np.random.Generator) -> Scene:
    """A block flown to and fro, the camera tilted by 45° to the side: two strips each way."""
    x = np.tile(np.linspace(0.0, 240.0, 7), 4)
    y = np.repeat([0.0, 60.0, 120.0, 180.0], 7)
    side = np.repeat([1.0, -1.0, 1.0, -1.0], 7)
    centre = np.column_stack([x, y, np.full(28, 100.0)]) + rng.normal(0.0, 2.0, (28, 3))
    aim = np.column_stack([x, y + 60.0 * side, np.zeros(28)]) + rng.normal(0.0, 3.0, (28, 3)) * [1.0, 1.0, 0.0]
    return Scene(centre, aim, np.where(side > 0, 0.0, np.pi), _ground(rng, 900, (-60.0, 300.0), (-120.0, 300.0)),
                 np.zeros((900, 3)))  # fmt: skip


def cross_strips(rng: np.random.Generator) -> Scene:
    """Two strips along X and two along Y."""
    along = np.linspace(0.0, 200.0, 6)
    first = [np.column_stack([along, np.full(6, y), np.full(6, 100.0)]) for y in (40.0, 140.0)]
    second = [np.column_stack([np.full(6, x), along, np.full(6, 100.0)]) for x in (40.0, 140.0)]
    centre = np.concatenate([*first, *second]) + rng.normal(0.0, 2.0, (24, 3))
    aim = centre * [1.0, 1.0, 0.0] + rng.normal(0.0, 4.0, (24, 3)) * [1.0, 1.0, 0.0]
    roll = np.repeat([0.0, np.pi / 2], 12)
    return Scene(centre, aim, roll, _ground(rng, 900, (-70.0, 270.0), (-70.0, 270.0)), np.zeros((900, 3)))


def _ground(rng: np.random.Generator, count: int, x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    return np.column_stack([rng.uniform(*x, count), rng.uniform(*y, count), rng.uniform(0.0, 12.0, count)])


def rotations(scene: Scene) -> np.ndarray:
    """(n, 3, 3) camera → object: z against the direction of view, x horizontal where there is no roll."""
    back = scene.centre - scene.aim
    back /= np.linalg.norm(back, axis=1, keepdims=True)
    up = np.where(np.abs(back[:, 2:]) > 0.9, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]])
    right = np.cross(up, back)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    high = np.cross(back, right)
    cos, sin = np.cos(scene.roll)[:, None], np.sin(scene.roll)[:, None]
    return np.stack([cos * right + sin * high, cos * high - sin * right, back], axis=2)


def block_of(
    scene: Scene, rng: np.random.Generator, *, gnss_m: float | None = 0.02, control: int = 0,
    stated: Prior | None = None, k1: float = 0.0, **settings: object,
) -> tuple[Block, np.ndarray, np.ndarray]:  # fmt: skip
    """The block without orientations, and the true centres (n, 3) m and angles (n, 3) rad.

    Parameters
    ----------
    gnss_m : σ of the positions; None: there are none. control : number of control points, of 5 mm.
    stated : what the block says of the principal distance; the truth, held, where None. k1 : of the lens.
    """
    rotation = rotations(scene)
    u = np.einsum("nji,npj->npi", rotation, scene.points[None] - scene.centre[:, None])
    tangent = -u[..., :2] / u[..., 2:]
    radius = (tangent**2).sum(axis=2, keepdims=True)
    xy = FOCAL_MM * tangent * (1.0 + k1 * radius)
    half = np.array(SIZE_PX) * PIXEL_UM * 0.5e-3
    image, point = np.nonzero((u[..., 2] < 0.0) & (np.abs(xy) < half).all(axis=2) & (radius[..., 0] < 1.0))
    measured = xy[image, point] + rng.normal(0.0, SIGMA_MM, (len(image), 2))
    n, count = len(scene.centre), len(scene.points)
    interior = {"focal_length_mm": stated or Prior(FOCAL_MM, fixed=True), "x0_mm": Prior(0.0, fixed=True),
                "y0_mm": Prior(0.0, fixed=True)}  # fmt: skip
    nothing = np.full((n, 3), np.nan)
    seen = np.bincount(point, minlength=count)
    known = rng.choice(np.flatnonzero(seen >= 4), control, replace=False)
    sigma = np.full((control, 3), 0.005)
    positions = None
    if gnss_m is not None:
        positions = GnssIns(np.arange(n), scene.centre + rng.normal(0.0, gnss_m, (n, 3)), np.full((n, 3), gnss_m),
                            nothing, nothing, np.full(n, np.nan))  # fmt: skip
    block = Block(
        name="scene",
        cameras=(Camera("cam", "frame", SIZE_PX, PIXEL_UM, interior),),
        images=Images(np.array([f"p{k:02d}" for k in range(n)]), np.zeros(n, np.int64), np.full(n, ""), nothing,
                      nothing.copy()),
        points=np.array([f"t{k:04d}" for k in range(count)]),
        image_points=ImagePoints(image, point, measured, np.full((len(image), 2), SIGMA_MM)),
        control=Control(known, scene.points[known] + rng.normal(0.0, sigma), sigma, np.zeros(control, bool)),
        gnss_ins=positions,
        settings=Settings(adjustment=AdjustmentSettings(**settings), image_sigma_um=1e3 * SIGMA_MM),
    )  # fmt: skip
    return block, scene.centre, angles_from_rotation(rotation)


def with_orientations(block: Block, centre: np.ndarray, angles: np.ndarray) -> Block:
    """The block with these start values."""
    return replace(block, images=replace(block.images, centre=centre, angles=angles))
