"""Cameras of different formats in one block: each has the errors of its own format."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.deformation.restitution import restitution_of
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.observations.block import ImagePoints
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.truth import Truth
from aerotri.statistics.camera_field import camera_field
from aerotri.statistics.cluster_fields import alike, correlations, half_formats, node_counts, nodes_at, roots_of_fields
from aerotri.terrain.adjustment_part import variances_at
from small_blocks import with_adjustment

LANDSCAPE = {"size_px": [6000, 4000], "pixel_um": 6.0, "focal_length_mm": 35.0}
PORTRAIT = LANDSCAPE | {"size_px": [4000, 6000]}
LARGE = {"size_px": [10000, 7500], "pixel_um": 5.3, "focal_length_mm": 50.0}
SMALL = {"size_px": [4250, 2750], "pixel_um": 4.0, "focal_length_mm": 16.0}
"""53 × 40 mm and 17 × 11 mm."""


def flown(cameras: tuple[dict, dict], seed: int, sigma_um: float) -> tuple[Block, Truth]:
    """Two strips with a rig of two cameras that err by 5 µm."""
    errors = {"errors": {"physical": {"rms_um": 5.0}}}
    mounting = {"position_m": [0.1, 0.0, 0.0], "rotation_deg": [0.3, -0.5, 0.8]}
    spec = {
        "name": "rig",
        "camera": {name: own | errors for name, own in zip(("first", "second"), cameras, strict=True)},
        "rig": {"frame": {"reference": "first", "camera": {"second": mounting}}},
        "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.7, "side_lap": 0.4,
                   "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0]},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 5.0, "wavelength_m": 200.0},
        "tie_points": {"per_image": 250, "probability": 0.9, "sigma_um": sigma_um, "stated_sigma_um": 1.0},
        "control": {"distance_bases": 1.0, "sigma_m": [0.01, 0.01, 0.01]},
    }  # fmt: skip
    block, truth = simulate(parse_spec(spec), seed)
    lens = parse_parameters("brown:K1+K2+P1+P2")
    return with_adjustment(block, additional_parameters=lens, model_part="off"), truth


def taken(rays: ImagePoints, rows: np.ndarray) -> ImagePoints:
    own = {name: value[rows] for name, value in vars(rays).items() if isinstance(value, np.ndarray)}
    return replace(rays, **own)


def squares(cameras: tuple[dict, dict], seed: int) -> list[float]:
    """The mean square of height errors over σ of points that one camera alone measures later, for each camera."""
    (block, truth), (exact, _) = (flown(cameras, seed, sigma) for sigma in (1.0, 0.0))
    rays, rng = block.image_points, np.random.default_rng(seed)
    camera, owner = block.images.camera[rays.image], np.full(len(truth.points), -1)
    for k in (0, 1):
        count = np.bincount(rays.point[camera == k], minlength=len(owner))
        free = np.setdiff1d(np.flatnonzero((count >= 3) & (owner < 0)), block.control.point)
        owner[rng.permutation(free)[:100]] = k
    later = owner[rays.point] >= 0
    # without noise, and at weights that move nothing: as they are intersected afterwards
    xy = np.where(later[:, None], exact.image_points.xy, rays.xy)
    sigma = np.where(later[:, None], 1e3, 1.0) * rays.sigma
    weak = replace(block, image_points=taken(replace(rays, xy=xy, sigma=sigma), ~later | (owner[rays.point] == camera)))
    found = adjust_keeping_system(replace(block, image_points=taken(rays, ~later)))
    xyz, restitution = adjust_keeping_system(weak).result.points.xyz, restitution_of(found)
    restitution, out = replace(restitution, left=camera_field(found)), []
    assert restitution.left is not None
    for k in (0, 1):
        own = np.flatnonzero(owner == k)
        images = [weak.image_points.image[weak.image_points.point == point] for point in own]
        seen = np.full((len(own), max(map(len, images))), -1)
        for row, of_point in zip(seen, images, strict=True):
            row[: len(of_point)] = of_point
        variance = variances_at(found, restitution, np.arange(len(block.images)), xyz[own], seen)[:, 2]
        out.append(float(np.mean((xyz[own, 2] - truth.points[own, 2]) ** 2 / variance)))
    return out


@pytest.mark.parametrize("cameras", [(LANDSCAPE, PORTRAIT), (LARGE, SMALL)], ids=["turned", "of two sizes"])
def test_errors_of_both_cameras_are_in_sigma(cameras):
    """Without the fields errors are three to nine σ."""
    z = np.sqrt(np.mean([squares(cameras, seed) for seed in (1, 2, 3, 4)], axis=0))
    assert (z > 0.7).all()
    assert (z < 1.45).all()


def cameras_of(*specs: dict):
    return [flown((own, own), 1, 1.0)[0].cameras[0] for own in specs]


def test_a_portrait_camera_is_a_landscape_camera_turned():
    cameras = cameras_of(LANDSCAPE, PORTRAIT)
    assert node_counts(cameras).tolist() == [[7, 5], [5, 7]]
    # nodes of 7 × 5 as those of 5 × 7
    turned = np.arange(35).reshape(7, 5).T.ravel()
    for smooth in (False, True):
        one, other = correlations(cameras, 0.4, smooth)
        assert other == pytest.approx(one[np.ix_(turned, turned)])
    xy = np.random.default_rng(1).uniform(-11.0, 11.0, (50, 2))
    (_, counts), half = node_counts(cameras), half_formats(cameras)
    node, weight = nodes_at(xy, half[np.ones(50, int)], np.tile(counts, (50, 1)))
    there, share = nodes_at(xy[:, ::-1], half[np.zeros(50, int)], np.tile([7, 5], (50, 1)))
    onto = np.zeros((2, 50, 35))
    np.put_along_axis(onto[0], turned[node], weight, axis=1)
    np.put_along_axis(onto[1], there, share, axis=1)
    assert onto[0] == pytest.approx(onto[1])


def test_correlations_are_the_same_in_a_camera_of_twice_the_size():
    one, other = cameras_of(LANDSCAPE, LANDSCAPE | {"pixel_um": 12.0})
    small, large = correlations([one, other], 0.8, True)
    assert large == pytest.approx(small, rel=1e-12)


def test_cameras_of_one_format_have_one_correlation_matrix():
    """R of one camera does not depend on which others there are, to the last bit, and neither does its root."""
    landscape, portrait, large = cameras_of(LANDSCAPE, PORTRAIT, LARGE)
    alone = correlations([landscape], 0.4, True)[0]
    together = correlations([landscape, portrait, large, landscape], 0.4, True)
    assert np.array_equal(together[0], alone)
    assert np.array_equal(together[3], alone)
    assert [own.tolist() for own in sorted(alike(together), key=len)][-1] == [0, 3]
    half, (along_x, along_y) = landscape.half_format_mm, (7, 5)
    x, y = np.meshgrid(half[0] * np.linspace(-1, 1, along_x), half[1] * np.linspace(-1, 1, along_y), indexing="ij")
    xy = np.column_stack([x.ravel(), y.ravel()])
    squares = np.sum((xy[:, None] - xy) ** 2, axis=2) / (float(np.hypot(*half)) * 0.4) ** 2
    assert np.array_equal(alone, np.exp(-0.5 * squares))
    roots = roots_of_fields(together)
    assert np.array_equal(roots[0], roots[3])
    for root, r in zip(roots, together, strict=True):
        assert root @ root.T == pytest.approx(r, abs=2e-3 * np.linalg.eigvalsh(r)[-1])
