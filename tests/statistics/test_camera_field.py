"""What parameters leave of a camera's errors: found in residuals, and in σ of what is measured with the orientation."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from aerotri.deformation.restitution import restitution_of
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.truth import Truth
from aerotri.statistics.camera_field import CameraField, camera_field, known_field, missing_in_sigma, not_looked_for
from aerotri.statistics.cluster_fields import field_equations, half_formats, node_counts
from aerotri.statistics.clusters import Clusters
from aerotri.terrain.adjustment_part import variances_at
from aerotri.volume.pickets import Pickets
from aerotri.volume.response import respond
from small_blocks import with_adjustment

SIGMA_UM = 1.0
SPEC = {
    "name": "strips",
    "camera": {"cam": {"size_px": [6000, 4000], "pixel_um": 6.0, "focal_length_mm": 35.0}},
    "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.7, "side_lap": 0.4,
               "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0]},
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 5.0, "wavelength_m": 200.0},
    "tie_points": {"per_image": 250, "probability": 0.9, "sigma_um": SIGMA_UM},
    "control": {"distance_bases": 1.0, "sigma_m": [0.01, 0.01, 0.01]},
}  # fmt: skip


def simulated(seed: int, parameters: str, errors_um: float = 0.0, sigma_um: float = SIGMA_UM) -> tuple[Block, Truth]:
    ties = SPEC["tie_points"] | {"sigma_um": sigma_um, "stated_sigma_um": SIGMA_UM}
    spec = SPEC | {"tie_points": ties}
    if errors_um:
        camera = SPEC["camera"]["cam"] | {"errors": {"physical": {"rms_um": errors_um}}}
        spec |= {"camera": {"cam": camera}}
    block, truth = simulate(parse_spec(spec), seed)
    return with_adjustment(block, additional_parameters=parse_parameters(parameters), model_part="off"), truth


def test_noise_alone_leaves_nothing():
    for seed in (1, 2, 3):
        assert camera_field(adjust_keeping_system(simulated(seed, "brown:K1+K2+P1+P2")[0])) is None


def measured_later(block: Block, exact: Block, chosen: np.ndarray) -> tuple[Block, Block]:
    """The block without some points, and with them at weights that move nothing: as they are intersected afterwards.

    Parameters
    ----------
    exact : the same block without noise, of which the rays of these points are.
    """
    rays = block.image_points
    later = np.isin(rays.point, chosen)
    rays = replace(rays, xy=np.where(later[:, None], exact.image_points.xy, rays.xy))
    names = [name for name, value in vars(rays).items() if isinstance(value, np.ndarray) and len(value) == len(later)]
    fewer = replace(rays, **{name: getattr(rays, name)[~later] for name in names})
    weak = replace(rays, sigma=np.where(later.reshape(-1, *[1] * (rays.sigma.ndim - 1)), 1e3, 1.0) * rays.sigma)
    return replace(block, image_points=fewer), replace(block, image_points=weak)


def rays_of(block: Block, points: np.ndarray) -> np.ndarray:
    """(n, m) photographs of points, −1 beyond those they have."""
    rays = block.image_points
    own = [rays.image[rays.point == point] for point in points]
    out = np.full((len(points), max(map(len, own))), -1)
    for k, images in enumerate(own):
        out[k, : len(images)] = images
    return out


def test_what_lens_parameters_leave_is_in_sigma_of_points_measured_later():
    """Errors of a camera of 5 µm that Brown's parameters describe in part: height errors over σ fall to about one."""
    before, after = [], []
    for seed in range(1, 7):
        block, truth = simulated(seed, "brown:K1+K2+P1+P2", 5.0)
        rays = block.image_points
        count = np.bincount(rays.point, minlength=len(truth.points))
        tie = np.setdiff1d(np.flatnonzero(count >= 3), block.control.point)
        chosen = np.random.default_rng(seed).permutation(tie)[:100]
        fewer, weak = measured_later(block, simulated(seed, "brown:K1+K2+P1+P2", 5.0, 0.0)[0], chosen)
        found = adjust_keeping_system(fewer)
        left = camera_field(found)
        assert left is not None
        assert 0.9 * SIGMA_UM < 1e3 * left.noise * np.median(rays.sigma) < 0.8 * found.local.outcome.sigma0_um
        xyz = adjust_keeping_system(weak).result.points.xyz[chosen]
        error, plain = xyz[:, 2] - truth.points[chosen, 2], restitution_of(found)
        for into, restitution in ((before, plain), (after, replace(plain, left=left))):
            given = np.arange(len(block.images)), xyz, rays_of(block, chosen)
            into.append(np.mean(error**2 / variances_at(found, restitution, *given)[:, 2]))
    assert np.sqrt(np.mean(before)) > 2.0
    assert 0.75 < np.sqrt(np.mean(after)) < 1.25
    # the residuals of a block tell its own errors: single cameras are not far off either
    assert np.sqrt(min(after)) > 0.6
    assert np.sqrt(max(after)) < 1.6


def test_a_volume_has_the_part_that_its_places_have(monkeypatch):
    """A functional that is the height of one place: its model part is that of the place, by other code."""
    found = adjust_keeping_system(simulated(3, "brown:K1+K2", 5.0)[0])
    block, left = found.local.block, camera_field(found)
    assert left is not None
    # the block has no model part, so that only the field is compared
    for module in ("aerotri.volume.response", "aerotri.statistics.camera_field"):
        monkeypatch.setattr(import_module(module), "known_field", lambda _: left)
    tie = np.setdiff1d(np.flatnonzero(found.local.points.rays >= 3), block.control.point)[:5]
    xyz, seen = found.result.points.xyz[tie], rays_of(block, tie)
    nothing = replace(left, root=0.0 * left.root, by_unknowns=0.0 * left.by_unknowns)
    given = np.arange(len(block.images)), xyz, seen
    # the noise beside the field is that of the volume as well
    without, whole = (
        variances_at(found, replace(restitution_of(found), left=one), *given)[:, 2] for one in (nothing, left)
    )
    for k in range(len(tie)):
        images = seen[k][seen[k] >= 0].astype(np.int64)
        start = np.array([0, len(images)], np.int64)
        picket = Pickets(xyz[k : k + 1], start, images, np.full(len(images), 1e-3), np.ones(1))
        response = respond(found, picket, np.array([[0.0, 0.0, 1.0]]))
        assert response.variance == pytest.approx(without[k], rel=1e-3)
        # errors of rays are bilinear between nodes here
        assert response.model == pytest.approx(whole[k] - without[k], rel=0.02)


def test_what_parameters_describe_moves_nothing():
    """A field that is b1 of the lens, which was estimated: what it does to rays and to unknowns cancels."""
    found = adjust_keeping_system(simulated(1, "brown:b1+b2")[0])
    system, block = found.system, found.local.block
    counts, half = node_counts(block.cameras), half_formats(block.cameras)
    x, _ = np.meshgrid(*(h * np.linspace(-1.0, 1.0, k) for h, k in zip(half[0], counts[0], strict=True)), indexing="ij")
    pattern = np.zeros((1, 2, x.size, 1))
    pattern[0, 0, :, 0] = 1e-3 * x.ravel()
    one = Clusters("camera", np.zeros(len(system.unknowns.images), np.int64), ("",), 1)
    factor = system.factorise(found.solution.equations)
    by = factor.solve(field_equations(system, found.solution, factor, one).sides @ pattern.reshape(-1, 1))
    left = CameraField(1.0, 1.0, 20.0, found.local.outcome.sigma0, pattern, half, counts, np.zeros(1, int), by)
    rows, seen = np.arange(len(block.images)), found.local.points.rays >= 3
    tie = np.setdiff1d(np.flatnonzero(seen), block.control.point)[:40]
    xyz, photographs = found.result.points.xyz[tie], rays_of(block, tie)
    both = variances_at(found, replace(restitution_of(found), left=left), rows, xyz, photographs)
    without = variances_at(found, restitution_of(found), rows, xyz, photographs)
    assert both == pytest.approx(without, rel=1e-4)


def test_rays_move_by_the_errors_at_their_places():
    """A field that grows with x: bilinear between nodes it is itself; the sum over rays is that of every ray."""
    camera = simulated(1, "none")[0].cameras[0]
    counts, half = node_counts([camera]), half_formats([camera])
    x, _ = np.meshgrid(*(h * np.linspace(-1.0, 1.0, k) for h, k in zip(half[0], counts[0], strict=True)), indexing="ij")
    pattern = np.zeros((1, 2, x.size, 1))
    pattern[0, 0, :, 0] = 1e-3 * x.ravel()
    left = CameraField(1.0, 1.0, 20.0, 1.0, pattern, half, counts, np.zeros(1, int), np.zeros((0, 1)))
    gain, at = np.random.default_rng(1).normal(size=(3, 2, 2)), np.array([[1.0, 2.0], [-3.0, 4.0], [8.0, 0.0]])
    moved = left.moved(gain, at, np.zeros(3, int))
    assert moved[:, :, 0] == pytest.approx(gain[:, :, 0] * 1e-3 * at[:, :1])
    assert left.summed(gain[:, 1], at, np.zeros(3, int)) == pytest.approx(moved[:, 1].sum(axis=0))


def test_a_field_that_is_switched_off_is_not_found():
    assert known_field(adjust_keeping_system(simulated(1, "brown:K1", 5.0)[0])) is None


def test_blocks_that_are_not_looked_at_say_why(monkeypatch):
    found = adjust_keeping_system(with_adjustment(simulated(1, "brown:K1")[0], model_part="on"))
    assert not_looked_for(found) == missing_in_sigma(found) == ""
    with monkeypatch.context() as changed:
        changed.setattr("aerotri.statistics.camera_field.MOST_PHOTOGRAPHS", 9)
        assert missing_in_sigma(found).startswith("the block has 10 photographs, more than 9: image errors that ")
        assert camera_field(found) is None
        off = adjust_keeping_system(simulated(1, "brown:K1")[0])
        assert not_looked_for(off)
        assert missing_in_sigma(off) == ""
    free = adjust_keeping_system(with_adjustment(simulated(1, "brown:K1")[0], model_part="on", datum="inner"))
    assert missing_in_sigma(free).startswith("the datum of the block is free: image errors that ")
