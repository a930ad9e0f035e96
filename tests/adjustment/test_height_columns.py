"""dmc.29, the offset of the projection centres of the heads: a pattern by the heights of the points."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.height_columns import relief_of
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import dmc, parameter_set
from aerotri.functional_model.additional_parameters.given_values import reason_against
from aerotri.functional_model.additional_parameters.native_frame import native_from_image
from aerotri.observations import ImagePoints
from aerotri.partition.part_system import refuse_what_parts_cannot
from aerotri.pipeline import adjust
from family_cameras import camera_for
from small_blocks import small_block

OFFSET = 0.15
"""m, true value of dmc.29."""
TWO_STRIPS = {
    "camera": {"dmc": {"preset": "dmc"}},
    "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 4, "end_lap": 0.6, "side_lap": 0.4},
    "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 1.5, "sigma_m": [0.03, 0.03, 0.05], "check_points": 2},
    "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
}


def with_offset(seed, relief, parameters="dmc:29", offset=OFFSET):
    """A block whose heads stand `offset` m from where the composed image takes them to be."""
    terrain = {"kind": "undulating", "height_m": 100.0, "relief_rms_m": relief, "wavelength_m": 500.0}
    block, truth = small_block(seed, parameters, terrain=terrain, **TWO_STRIPS)
    rays, camera = block.image_points, block.cameras[0]
    seen = np.unique(rays.point)
    ground = truth.points[seen, 2].mean()
    pattern = dmc.centre_offset(
        camera, *rays.xy.T, truth.centre[rays.image, 2] - ground, truth.points[rays.point, 2] - ground
    )
    xy = rays.xy + offset * pattern
    # a ray that the offset moves over an axis of the image would belong to another head
    keep = (np.sign(xy) == np.sign(rays.xy)).all(axis=1)
    keep &= np.bincount(rays.point[keep], minlength=len(block.points))[rays.point] > 1
    return replace(block, image_points=ImagePoints(rays.image[keep], rays.point[keep], xy[keep], rays.sigma[keep]))


@pytest.mark.parametrize("flight_axis", ["+y", "-x"])
def test_it_is_what_a_head_that_stands_elsewhere_sees(flight_axis):
    """Identity: the ray from a centre moved outwards by 1 m, and the shift that makes up for it at the mean ground."""
    camera, rng = camera_for("dmc", flight_axis), np.random.default_rng(1)
    f, flying = camera.focal_length_mm, 1000.0
    xy, above = rng.uniform(-1.0, 1.0, (200, 2)) * camera.half_format_mm, rng.uniform(-200.0, 200.0, 200)
    depth, turn = (flying - above)[:, None], native_from_image(camera)
    moved = np.where(xy @ turn.T >= 0.0, 1.0, -1.0) @ turn
    seen = f * (xy * depth / f - moved) / depth + f * moved / flying
    pattern = dmc.centre_offset(camera, *xy.T, np.full(200, flying), above)
    np.testing.assert_allclose(pattern, seen - xy, atol=1e-13)
    assert not dmc.centre_offset(camera, *xy.T, np.full(200, flying), 0.0 * above).any()


def test_what_the_heights_taken_as_known_leave_out():
    """The pattern's own change with the height of the point and of the flight, over that of the ray: P/h."""
    camera, rng = camera_for("dmc"), np.random.default_rng(2)
    xy = rng.uniform(0.2, 1.0, (200, 2)) * camera.half_format_mm
    flying, above, step = np.full(200, 1000.0), rng.uniform(-100.0, 100.0, 200), 1e-3
    by_point = dmc.centre_offset(camera, *xy.T, flying, above + step) - dmc.centre_offset(
        camera, *xy.T, flying, above - step
    )
    by_flight = dmc.centre_offset(camera, *xy.T, flying + step, above) - dmc.centre_offset(
        camera, *xy.T, flying - step, above
    )
    of_ray = np.abs(xy / (flying - above)[:, None])
    f, depth = camera.focal_length_mm, flying - above
    np.testing.assert_allclose(by_point[:, 0] / (2.0 * step), -f / depth**2, rtol=1e-6)
    np.testing.assert_allclose(by_flight[:, 0] / (2.0 * step), f / depth**2 - f / flying**2, rtol=1e-6, atol=1e-10)
    assert (OFFSET * np.abs(by_point) / (2.0 * step) / of_ray).max() < 2e-3


def test_recovered_over_relief():
    """Four blocks: normalised errors near N(0, 1), 99.9 % bounds of their mean and of the largest."""
    errors = []
    for seed in range(4):
        p = adjust(with_offset(seed, 80.0)).parameters
        assert p.names.tolist() == ["dmc.29"]
        assert 0.0 < p.sigma[0] < OFFSET
        errors.append((p.value[0] - OFFSET) / p.sigma[0])
    assert np.abs(np.mean(errors)) < 3.3 / np.sqrt(4.0)
    assert np.max(np.abs(errors)) < 3.9


def test_recovered_where_it_is_thirty_times_too_large():
    """The pattern's own change with height, which the equations leave out, then is half a per cent; nothing is lost."""
    p = adjust(with_offset(1, 80.0, offset=5.0)).parameters
    assert abs(p.value[0] - 5.0) < 3.3 * p.sigma[0]
    assert p.sigma[0] < 0.05


def test_no_effect_over_flat_ground():
    """The finding of the paper: heights that do not differ say nothing of it. The message says so."""
    with pytest.raises(InputError, match="the ground is flat: its heights differ by") as refused:
        adjust(with_offset(1, 0.0))
    assert "over flat ground it has no effect" in refused.value.remedy


def test_beside_the_other_parameters_and_at_measured_points():
    block = with_offset(2, 80.0, "dmc:29+34-41")
    measured = replace(block.settings.adjustment, parameter_position="measured")
    for settings in (block.settings.adjustment, measured):
        p = adjust(replace(block, settings=replace(block.settings, adjustment=settings))).parameters
        row = p.names.tolist().index("dmc.29")
        assert len(p) == 9
        assert abs(p.value[row] - OFFSET) < 3.9 * p.sigma[row]


def test_as_a_pattern_of_the_image_it_is_nothing():
    chosen = parameter_set("dmc", ("29", "30"), camera_for("dmc"))
    basis = chosen.basis(np.array([10.0, -20.0]), np.array([12.0, 7.0]))
    assert not basis[:, :, 0].any()
    assert basis[0, :, 1].any()
    assert "cannot be given" in reason_against("dmc.29", "dmc")


def test_heights_at_the_rays():
    centre, points = np.array([[0.0, 0.0, 1000.0], [0.0, 0.0, 1010.0]]), np.array([[0.0, 0.0, 90.0], [0.0, 0.0, 110.0]])
    relief = relief_of(centre, points, np.array([0, 1, 1]), np.array([0, 2, 3]))
    np.testing.assert_allclose(relief.flying, [900.0, 910.0, 910.0])
    np.testing.assert_allclose(relief.above, [-10.0, -10.0, 10.0])


def test_a_block_in_parts_refuses_it():
    with pytest.raises(InputError, match="mean ground of the whole block"):
        refuse_what_parts_cannot(small_block(1, "dmc:29", **TWO_STRIPS)[0])
