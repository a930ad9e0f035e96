"""Photographs of a rolling shutter as the kernels of terrain take them, against the exact projection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.kernel_records import Scans
from aerotri.deformation.orientation import Orientation, photo_rows
from aerotri.functional_model._photo_kernels import partials, project
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations.rolling_shutter import READING
from aerotri.simulation import projection
from aerotri.simulation.camera_spec import CameraSpec
from aerotri.simulation.cameras import true_camera


def photograph(direction):
    """A tilted photograph that moves at 8 m/s and turns by 5 degrees a second, read in 30 ms."""
    spec = CameraSpec(
        size_px=(4000, 3000), pixel_um=2.4, focal_length_mm=8.8,
        rolling_shutter={"readout_ms": 30.0, "row_direction": direction},
    )  # fmt: skip
    camera = true_camera("cam", spec)
    velocity, spin = np.array([[7.0, 3.0, -1.0]]), np.radians([[2.0, -3.0, 4.0]])
    angles = np.radians([[3.0, -2.0, 40.0]])
    shown = projection.Photographs.of(
        np.array([[10.0, 20.0, 75.0]]), angles, "omega-phi-kappa", np.zeros(1, int), (camera,),
        projection.Motion(velocity, spin),
    )  # fmt: skip
    rotation = rotation_from_angles(angles)
    rate = 0.030 * np.array(READING[direction]) / (np.array([4000, 3000]) * 0.0024)
    moved = np.einsum("nji,nj->ni", rotation, velocity)
    scans = Scans(rate[None] / 30.0, np.full(1, 30.0), moved, spin, np.full((1, 3), -1))
    return shown, Orientation(shown.centre, rotation, np.array([[8.8, 0.0, 0.0]]), scans)


def test_projection_and_partials():
    """Within a hundredth of a pixel over the format and over relief; partials by differences."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-20, 40, 200), rng.uniform(0, 45, 200), rng.uniform(-8, 8, 200)])
    zero = np.zeros(200, int)
    for direction in READING:
        shown, orientation = photograph(direction)
        exact = projection.project(shown, points, zero, np.arange(200))
        still = projection.project(replace(shown, motion=None), points, zero, np.arange(200))
        photos = photo_rows(orientation, np.zeros(3), np.eye(3))[None]
        found = np.array([project(photos, 0, 0, *point)[:2] for point in points])
        inside = (np.abs(exact) < [4.8, 3.6]).all(axis=1)
        assert inside.sum() > 100
        assert np.abs(exact - still)[inside].max() / 0.0024 > 5.0
        assert np.abs(found - exact)[inside].max() / 0.0024 < 0.01
        h = 1e-4
        for point in points[inside][:10]:
            ahead = [project(photos, 0, 0, *(point + h * np.eye(3)[k]))[:2] for k in range(3)]
            back = [project(photos, 0, 0, *(point - h * np.eye(3)[k]))[:2] for k in range(3)]
            differences = (np.array(ahead) - np.array(back)).T / (2.0 * h)
            # the row moves with the point, which the partials leave out
            np.testing.assert_allclose(np.reshape(partials(photos, 0, 0, *point), (2, 3)), differences, atol=2e-3)
