"""What the adjustment adds to the variance of pickets, against the covariances of the adjusted object points."""

import numpy as np
import pytest

from aerotri.deformation.restitution import restitution_of
from aerotri.functional_model.collinearity import linearise
from aerotri.pipeline import adjust_keeping_system
from aerotri.terrain.adjustment_part import adjustment_variances
from aerotri.terrain.pickets import Pickets
from small_blocks import small_block


@pytest.mark.parametrize("parameters", ["none", "bluh:1-12,ultracam_d:42-73"])
def test_point_after_the_adjustment_is_as_sure_as_in_it(parameters):
    """A point intersected with the adjusted orientation has the variance of its rays and that of the orientation.

    In the adjustment it has a little less, for its own rays have helped the orientation.
    """
    found = adjust_keeping_system(small_block(2, parameters)[0])
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
    interior = np.zeros((len(restitution.true), 15))
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
    assert ratio.min() > 0.999
    assert np.median(ratio) < 1.12
    assert (adjustment > 0.0).all()
