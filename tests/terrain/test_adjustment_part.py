"""What the adjustment adds to the variance of pickets, against the covariances of the adjusted object points."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerotri.deformation.restitution import restitution_of
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise
from aerotri.pipeline import adjust_keeping_system
from aerotri.simulation import parse_spec, simulate
from aerotri.statistics.camera_field import known_field
from aerotri.statistics.image_sigma import image_sigma_of_cameras
from aerotri.terrain.adjustment_part import adjustment_variances, covariances_at
from aerotri.terrain.photographs import photographs_of
from aerotri.terrain.pickets import Pickets
from aerotri.volume.pickets import Pickets as PicketsOfVolume
from aerotri.volume.pickets import pickets_of_names
from aerotri.volume.response import respond
from rig_blocks import NADIR, rig_block
from rolling_blocks import rolling_spec
from small_blocks import small_block, with_adjustment

BLOCKS = {
    "none": lambda: small_block(2, "none")[0],
    "bluh": lambda: small_block(2, "bluh:1-12,ultracam_d:42-73")[0],
    "inner datum": lambda: with_adjustment(small_block(2, "bluh:1-12")[0], datum="inner"),
    "rolling shutter": lambda: _weak_readout(),
}


def _weak_readout():
    """Strips in one direction over a plane: the readout time is determined badly."""
    spec = rolling_spec(terrain={"kind": "flat"})
    spec["flight"] |= {"cross_strips": [], "attitude_sigma_deg": [0.0] * 3, "alternating": False}
    block = simulate(parse_spec(spec), 2)[0]
    shutter = replace(block.cameras[0].rolling_shutter, test="off")
    adjustment = replace(block.settings.adjustment, additional_parameters=(("brown", ("b1", "b2")),), model_part="off")
    camera = replace(block.cameras[0], rolling_shutter=shutter)
    return replace(block, cameras=(camera,), settings=replace(block.settings, adjustment=adjustment))


@pytest.mark.parametrize("name", list(BLOCKS))
def test_point_after_the_adjustment_is_as_sure_as_in_it(name):
    """A point intersected with the adjusted orientation has the variance of its rays and that of the orientation.

    In the adjustment it has a little less, for its own rays have helped the orientation.
    """
    found = adjust_keeping_system(BLOCKS[name]())
    block, points = found.result.block, found.result.points
    restitution = restitution_of(found)
    rays = block.image_points
    tie = np.setdiff1d(np.flatnonzero(points.rays >= 3), block.control.point)[:60]
    used = [rays.image[rays.point == p] for p in tie]
    photographs = np.full((len(tie), 12), -1)
    for k, images in enumerate(used):
        photographs[k, : len(images)] = images[:12]
    n = len(tie)
    pickets = Pickets(
        points.xyz[tie, :2], points.xyz[tie], np.zeros((n, 3, 3)), np.zeros(n, np.int8), np.zeros(n, np.int16),
        photographs, np.ones(n), np.full(n, -1), np.zeros(n), block.images.names, 1.0,
    )  # fmt: skip
    adjustment = adjustment_variances(found, restitution, np.arange(len(block.images)), pickets)
    picket, column = np.nonzero(photographs >= 0)
    image = photographs[picket, column]
    interior = np.zeros((len(restitution.true), len(INTERIOR_COLUMNS)))
    interior[:, :3] = restitution.true.interior
    by_point = linearise(
        restitution.true.rotation,
        restitution.true.centre,
        points.xyz[tie],
        interior,
        image,
        picket,
        image,
        np.zeros((len(image), 2)),
    ).by_point
    normal = np.zeros((n, 3, 3))
    sigma = found.result.outcome.sigma0_um * 1e-3
    np.add.at(normal, picket, np.einsum("rki,rkj->rij", by_point, by_point) / sigma**2)
    matching = np.diagonal(np.linalg.inv(normal), axis1=1, axis2=2)
    ratio = (adjustment + matching) / points.sigma[tie] ** 2
    # the rays of the comparison know no rolling shutter
    assert ratio.min() > (0.995 if name == "rolling shutter" else 0.999)
    if name == "rolling shutter":
        assert np.percentile(ratio, 95.0) < 1.05
    assert np.median(ratio) < 1.12
    assert (adjustment > 0.0).all()


@pytest.mark.parametrize("parameters", ["none", "bluh:1-12"])
def test_variances_of_a_free_block_are_those_of_its_datum(parameters):
    """In the inner datum, along X, Y and Z, as a volume has them by other code."""
    block = with_adjustment(small_block(2, parameters)[0], datum="inner")
    found = adjust_keeping_system(block)
    assert known_field(found) is None
    rays, names = block.image_points, block.images.names
    tie = np.flatnonzero(found.result.points.rays >= 3)[:6]
    images = [rays.image[rays.point == point] for point in tie]
    seen = np.full((len(tie), max(map(len, images))), -1)
    for k, own in enumerate(images):
        seen[k, : len(own)] = own
    xyz = found.result.points.xyz[tie]
    covariance = covariances_at(found, restitution_of(found), np.arange(len(names)), xyz, seen)
    for k, own in enumerate(images):
        picket = pickets_of_names(block, xyz[k : k + 1], [names[own].tolist()], 1e-3)
        for axis, along in enumerate(np.eye(3)):
            response = respond(found, picket, along[None])
            assert covariance[k, axis, axis] == pytest.approx(response.variance + response.model, rel=1e-3)


def test_rays_of_an_accurate_camera_count_more():
    """A second head with a σ four times as large, as a volume has it by other code, which is given σ of every ray."""
    oblique = NADIR | {"pixel_um": 4.0 * NADIR["pixel_um"], "size_px": [1500, 1000]}
    block, _ = rig_block(1, cameras=("fore",), camera={"nadir": NADIR, "fore": oblique})
    rays, names = block.image_points, block.images.names
    factor = np.where(block.images.camera[rays.image] == 1, 4.0, 1.0)[:, None]
    block = with_adjustment(replace(block, image_points=replace(rays, sigma=factor * rays.sigma)), model_part="off")
    found = adjust_keeping_system(block)
    of_camera = image_sigma_of_cameras(found)
    images = [rays.image[rays.point == point] for point in range(len(block.points))]
    both = [k for k, own in enumerate(images) if len(own) >= 3 and len(set(block.images.camera[own])) == 2][:8]
    seen = np.full((len(both), max(len(images[k]) for k in both)), -1)
    for row, k in zip(seen, both, strict=True):
        row[: len(images[k])] = images[k]
    xyz = found.result.points.xyz[both]
    covariance = covariances_at(found, restitution_of(found), np.arange(len(names)), xyz, seen)
    for place, (k, point) in enumerate(zip(both, xyz, strict=True)):
        sigma = of_camera[block.images.camera[images[k]]]
        start = np.array([0, len(sigma)], np.int64)
        picket = PicketsOfVolume(point[None], start, images[k].astype(np.int64), sigma, np.ones(1))
        for axis, along in enumerate(np.eye(3)):
            assert covariance[place, axis, axis] == pytest.approx(
                respond(found, picket, along[None]).variance, rel=1e-3
            )


@pytest.mark.parametrize("parameters", ["legendre:3x3", "brown:K1+K2+b1"])
def test_parameters_err_in_photographs_freed_of_errors_as_in_those_taken(parameters):
    """Photographs are freed with the parameters as estimated: what is wrong with these stays, whatever their family."""
    found = adjust_keeping_system(small_block(2, parameters)[0])
    rows, points, rays = np.arange(len(found.result.block.images)), found.result.points, found.result.block.image_points
    tie = np.setdiff1d(np.flatnonzero(points.rays >= 3), found.result.block.control.point)[:20]
    seen = np.array([rays.image[rays.point == p][:3] for p in tie])
    paths = [Path(f"{name}.tif") for name in found.result.block.images.names]
    taken, freed = (
        covariances_at(found, photographs_of(found, rows, paths, ideal).restitution, rows, points.xyz[tie], seen)
        for ideal in (False, True)
    )
    assert freed == pytest.approx(taken, rel=1e-12)
