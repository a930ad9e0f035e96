"""Heights of 60 % models of the even and of the odd photographs of an 80 % flight, before and after the correction.

The photographs show true points with the true errors of the camera; they are intersected with the orientation of an
adjustment without parameters, as in the paper. The correction knows the self-calibration alone, not the truth.

Measures the deformation at single points intersected with another orientation, where the package corrects whole
rasters: imports inside on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import aerotri
from aerotri.deformation import restitution_of
from aerotri.deformation.dem_window import dem_models
from aerotri.deformation.orientation import Orientation, calibrated_orientation
from aerotri.deformation.stereo_model import intersect, project
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.simulation.projection import measured_positions
from aerotri.simulation.rendering import make_scene

REACH_M = 250.0
NODES = 15
PAIRS = ([0, 2], [1, 3])
"""Of four photographs, the even and the odd ones."""


@dataclass(frozen=True)
class EvenOdd:
    """RMS in m over all nodes: difference even − odd before and after, error of the heights before and after."""

    count: int
    difference: tuple[float, float]
    error: tuple[float, float]


def even_against_odd(self_calibrated: aerotri.Adjustment, plain: aerotri.Adjustment, flight) -> EvenOdd:
    """Compare the two DEMs over all fours of photographs that follow one another in a strip."""
    calibrated, truth = self_calibrated.record, flight.truth
    block = calibrated.local.block
    scene = make_scene(flight.plan, flight.seed, block, truth)
    true = Orientation(
        truth.centre, rotation_from_angles(truth.angles, block.rotation), truth.interior[block.images.camera]
    )
    used = calibrated_orientation(plain.record)
    restitution = restitution_of(calibrated, used=used)
    names, fours = block.images.names.astype(str), _fours(block.images.strip)
    pairs = [tuple(names[four[pair]]) for four in fours for pair in PAIRS]
    models, parts = dem_models(calibrated, restitution, tuple(pairs)), []
    for k, four in enumerate(fours):
        points = _nodes(truth.centre[four], truth.points[:, 2].mean())
        seen, xy = _measured(true, four, points, scene)
        heights = []
        for number, pair in enumerate(PAIRS, start=2 * k):
            wrong, _ = intersect(used.take(four[pair]), xy[pair][:, seen], points[seen])
            back = wrong - models.deformation_at(np.full(len(wrong), number, np.int32), wrong)
            heights.append(np.column_stack([wrong[:, 2], back[:, 2]]) - points[seen, 2:])
        parts.append(np.stack(heights, axis=1))
    off = np.concatenate(parts)
    off = off[np.isfinite(off).all(axis=(1, 2))]
    rms = [float(np.sqrt(np.mean((off[:, 0, when] - off[:, 1, when]) ** 2))) for when in (0, 1)]
    error = [float(np.sqrt(np.mean(off[:, :, when] ** 2))) for when in (0, 1)]
    return EvenOdd(len(off), (rms[0], rms[1]), (error[0], error[1]))


def _fours(strips: np.ndarray) -> list[np.ndarray]:
    """Rows of every four photographs that follow one another in a strip."""
    members = [np.flatnonzero(strips == strip) for strip in dict.fromkeys(strips.tolist())]
    return [rows[k : k + 4] for rows in members for k in range(len(rows) - 3)]


def _nodes(centre: np.ndarray, ground: float) -> np.ndarray:
    """(n, 3) m around the middle of the photographs, on level ground."""
    middle, step = centre.mean(axis=0), np.linspace(-REACH_M, REACH_M, NODES)
    x, y = np.meshgrid(middle[0] + step, middle[1] + 2.0 * step)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, ground)])


def _measured(true: Orientation, rows: np.ndarray, points: np.ndarray, scene) -> tuple[np.ndarray, np.ndarray]:
    """(n,) which points all photographs show, and (k, n, 2) mm where."""
    seen, xy = np.ones(len(points), bool), []
    for row in rows.tolist():
        ideal = project(true, row, points)
        at, solved = measured_positions(ideal, scene.fields[row])
        seen &= solved & (np.abs(at) <= scene.photographs.cameras[0].nominal.half_format_mm).all(axis=1)
        xy.append(at)
    return seen, np.stack(xy)
