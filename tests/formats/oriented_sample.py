"""A small block whose image points are exact projections of its points, for formats that hold orientations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.formats.assembly.oriented import OrientedBlock, oriented_block
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, Camera, Control, GnssIns, ImagePoints, Images, Prior, Settings

CENTRES = np.array([[1000.0, 2000, 600], [1120, 2005, 605], [1240, 1995, 598], [1110, 2090, 602]])
ANGLES = np.radians([[1.0, -2.0, 5.0], [-1.5, 0.5, 3.0], [0.7, 1.2, -4.0], [2.1, -0.4, -176.0]])
CAMERA = Camera(
    name="cam",
    model="frame",
    size_px=(8000, 6000),
    pixel_um=5.0,
    interior={
        "focal_length_mm": Prior(40.0, fixed=True),
        "x0_mm": Prior(0.0, fixed=True),
        "y0_mm": Prior(0.0, fixed=True),
    },
)


def oriented_sample(camera: Camera = CAMERA, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OrientedBlock:
    """Four photographs of twenty points, three of them control, one a check point; `shift` moves all of it."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(950, 1300, 20), rng.uniform(1950, 2120, 20), rng.uniform(90, 130, 20)])
    points, centre = points + shift, CENTRES + shift
    rotation = rotation_from_angles(ANGLES)
    image, point = np.divmod(np.arange(80), 20)
    u = np.einsum("mji,mj->mi", rotation[image], points[point] - centre[image])
    xy = -camera.focal_length_mm * u[:, :2] / u[:, 2:] + np.array(camera.principal_point_mm)
    inside = np.flatnonzero((np.abs(xy) < np.array(camera.half_format_mm)).all(axis=1))
    control = np.array([0, 7, 13, 16])
    unknown = np.full((4, 3), np.nan)
    block = Block(
        name="sample",
        cameras=(camera,),
        images=Images(np.array([f"p{i}.jpg" for i in range(4)]), np.zeros(4, int), np.full(4, ""), centre, ANGLES),
        points=np.array([f"t{i}" for i in range(20)]),
        image_points=ImagePoints(image[inside], point[inside], xy[inside], np.full((len(inside), 2), 0.005)),
        control=Control(control, points[control], np.full((4, 3), 0.02), np.array([False, False, False, True])),
        gnss_ins=GnssIns(np.arange(4), centre + 0.1, np.full((4, 3), 0.05), unknown, unknown, unknown[:, 0]),
        settings=Settings(image_sigma_um=5.0),
    )
    return oriented_block(block, points)


def without_orientation(block: Block) -> Block:
    """The block with nothing known of its photographs."""
    nothing = np.full((len(block.images), 3), np.nan)
    return replace(block, images=replace(block.images, centre=nothing, angles=nothing))


def prediction(block: Block, points: np.ndarray) -> np.ndarray:
    """(m, 2) mm, where the rays should be by the collinearity equations and the forward lens of the cameras."""
    rays = block.image_points
    rotation = rotation_from_angles(block.images.angles, block.rotation)[rays.image]
    u = np.einsum("mji,mj->mi", rotation, points[rays.point] - block.images.centre[rays.image])
    found = np.empty_like(rays.xy)
    for number, camera in enumerate(block.cameras):
        own = block.images.camera[rays.image] == number
        a, b = (-u[own, :2] / u[own, 2:]).T
        k1, k2, p1, p2, k3 = (camera.lens[n].value if n in camera.lens else 0.0 for n in ("k1", "k2", "p1", "p2", "k3"))
        rho2 = a * a + b * b
        radial = 1 + k1 * rho2 + k2 * rho2**2 + k3 * rho2**3
        x = a * radial + 2 * p1 * a * b + p2 * (rho2 + 2 * a * a)
        y = b * radial + p1 * (rho2 + 2 * b * b) + 2 * p2 * a * b
        c, b1 = camera.focal_length_mm, camera.brown["b1"].value if "b1" in camera.brown else 0.0
        # d = −b1·x̄ at the measured position
        found[own] = np.column_stack([c * x / (1.0 + b1), c * y]) + np.array(camera.principal_point_mm)
    return found
