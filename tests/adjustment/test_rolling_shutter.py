"""Rolling shutter: partials, what it is without readout time, recovery of the truth, velocities that stay tame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment import _point_kernels
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.scanned_rays import linearise_unknown_rays
from aerotri.adjustment.track_velocity import STRIP, TIMED, UNKNOWN, track_velocities
from aerotri.adjustment.unknowns import Step
from aerotri.conventions import InputError
from aerotri.observations import Prior, RollingShutter
from aerotri.pipeline import adjust
from dense_algebra import dense_design
from rolling_blocks import rolling_block, rolling_spec

OWN = RollingShutter(Prior(30.0, 5.0), motion="photograph", rotation="photograph")


def with_shutter(block, shutter, rows=None):
    """The block with another rolling shutter of its cameras."""
    return replace(block, cameras=tuple(replace(camera, rolling_shutter=shutter) for camera in block.cameras))


def readout(result):
    """Value and σ of the readout time, ms."""
    p = result.parameters
    k = p.names.tolist().index("rolling_shutter.readout_ms")
    return p.value[k], p.sigma[k]


@pytest.fixture(scope="module")
def simulated():
    return rolling_block(2, {"stated": {"value": 25.0}, "rotation_rate_sigma_deg_s": 3.0})


@pytest.mark.parametrize("direction", ["down", "up", "right", "left"])
def test_partials(simulated, direction):
    """What every unknown does to the image points, by differences of the predictions."""
    block = with_shutter(simulated[0], replace(OWN, row_direction=direction))
    prepared = prepare(block)
    system, state = prepared.system, prepared.state
    u, rng = system.unknowns, np.random.default_rng(3)
    shared = state.shared.copy()
    own = u.scanning.columns[:, 1:].ravel()[:, None] + np.arange(3)
    # large rates, so that the way of the rotation counts
    shared[own] = rng.normal(size=own.shape) * np.where(np.arange(len(own))[:, None] % 2, 1.0, 2.0)
    state = replace(state, shared=shared)
    partials, index, value = linearise_unknown_rays(u, state, np.arange(len(u.rays.image)))
    n, s, count = len(u.images), len(u.shared), len(u.points)
    step = Step(rng.normal(size=(n, 6)), rng.normal(size=s), rng.normal(size=(count, 3)))
    scale = np.where(np.char.startswith(np.array(u.shared.names), "rolling"), 1.0, 0.01)
    step = Step(step.images * [1, 1, 1, 0.02, 0.02, 0.02], step.shared * scale, step.points)
    h = 1e-4

    def predicted(sign):
        moved = u.advance(state, Step(sign * h * step.images, sign * h * step.shared, sign * h * step.points))
        return u.rays.xy - system.right_side(moved, LEAST_SQUARES).residual

    by_differences = (predicted(1.0) - predicted(-1.0)) / (2.0 * h)
    image, point = u.rays.image, np.repeat(np.arange(count), np.diff(u.rays.start))
    expected = np.einsum("mij,mj->mi", partials.by_orientation, step.images[image])
    expected += np.einsum("mij,mj->mi", partials.by_point, step.points[point])
    of_interior = np.where(u.lens.columns >= 0, step.shared[np.maximum(u.lens.columns, 0)], 0.0)
    expected += np.einsum("mij,mj->mi", partials.by_interior, of_interior[u.rays.lens_row])
    expected += np.einsum("mij,mj->mi", value, np.where(index >= 0, step.shared[np.maximum(index, 0)], 0.0))
    np.testing.assert_allclose(by_differences, expected, atol=2e-6 * np.abs(expected).max())
    assert (index >= 0).all()


def test_kernels_and_lists_agree(simulated):
    """The kernel of the normal equations has the partials that the list of rays has."""
    prepared = prepare(with_shutter(simulated[0], OWN))
    system, state = prepared.system, prepared.state
    u, problem, work = system.unknowns, system.problem(state, LEAST_SQUARES), system.work()
    partials, index, value = linearise_unknown_rays(u, state, np.arange(len(u.rays.image)))
    for p in (0, 7, 31):
        _point_kernels.linearise_point(p, problem.rays, problem.table, problem.values, problem.points,
                                       problem.weighting, work)  # fmt: skip
        for q in range(u.rays.start[p + 1] - u.rays.start[p]):
            ray = u.rays.start[p] + q
            sigma = u.rays.inv_sigma[ray][:, None]
            np.testing.assert_allclose(work.by_eo[q], partials.by_orientation[ray] * sigma, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(work.by_sh[q, :, :7], value[ray] * sigma, rtol=1e-9, atol=1e-9)
            assert work.union[work.columns[q, :7]].tolist() == index[ray].tolist()


def test_sigma_as_of_the_whole_equations(simulated):
    """σ of the readout time from the sparse algebra and from the whole design matrix."""
    from aerotri.pipeline.chain import adjust_keeping_system

    found = adjust_keeping_system(with_shutter(simulated[0], replace(OWN, test="off")))
    design = dense_design(found)
    unit = np.linalg.norm(design, axis=0)
    used = unit > 0.0
    whole = np.linalg.inv((design[:, used] / unit[used]).T @ (design[:, used] / unit[used]))
    n = 6 * len(found.system.unknowns.images)
    column = n + found.system.unknowns.scanning.columns[0, 0]
    at = np.flatnonzero(used).tolist().index(int(column))
    sigma = found.result.outcome.sigma0 * np.sqrt(whole[at, at]) / unit[column]
    assert readout(found.result)[1] == pytest.approx(sigma, rel=1e-6)


def test_without_readout_time_as_without_shutter(simulated):
    """A readout time of zero that is held is the same as none, bit by bit."""
    none = adjust(with_shutter(simulated[0], None))
    zero = adjust(with_shutter(simulated[0], RollingShutter(Prior(0.0, fixed=True))))
    assert (none.points.xyz == zero.points.xyz).all()
    assert (none.images.covariance == zero.images.covariance).all()


def test_nearly_zero_is_nearly_none(simulated):
    """The kernels with a readout time of a picosecond give what those without any give."""
    none = adjust(with_shutter(simulated[0], None))
    little = adjust(with_shutter(simulated[0], RollingShutter(Prior(1e-9, fixed=True))))
    np.testing.assert_allclose(none.points.xyz, little.points.xyz, atol=1e-5)


def test_readout_time_is_found():
    """The true readout time within its σ, σ0 of one, and heights of check points as without the effect."""
    block, truth = rolling_block(4)
    result = adjust(block)
    value, sigma = readout(result)
    assert sigma < 0.5
    assert abs(value - truth.readout_ms["cam"]) < 3.5 * sigma
    assert result.outcome.sigma0 == pytest.approx(1.0, abs=0.06)
    ignored = adjust(with_shutter(block, None))
    assert ignored.outcome.sigma0 > 3.0
    rms = [np.sqrt(np.mean(r.check.difference[:, 2] ** 2)) for r in (result, ignored)]
    assert rms[0] < 0.6 * rms[1]


def test_own_motion_of_photographs():
    """Photographs that turn while they are read, without times: readout time held, motion free."""
    block, _ = rolling_block(5, {"rotation_rate_sigma_deg_s": 3.0})
    timeless = replace(block, gnss_ins=replace(block.gnss_ins, time=np.full(len(block.gnss_ins), np.nan)))
    own = RollingShutter(Prior(30.0, fixed=True), motion="photograph", motion_sigma_m_s=10.0, rotation="photograph")
    result = adjust(with_shutter(timeless, own))
    assert result.outcome.sigma0 == pytest.approx(1.0, abs=0.08)
    turning = adjust(with_shutter(block, RollingShutter(Prior(30.0, fixed=True))))
    assert turning.outcome.sigma0 > 2.0


def test_free_network():
    """A free network with a rolling shutter: the readout time as in the controlled one."""
    block, _ = rolling_block(6)
    settings = replace(block.settings, adjustment=replace(block.settings.adjustment, datum="inner"))
    free = adjust(replace(block, settings=settings))
    value, sigma = readout(free)
    assert abs(value - 30.0) < 3.5 * sigma < 3.5


def velocities(block, centre, speed=np.nan):
    """Velocities of all photographs of a block."""
    n = len(block.images)
    return track_velocities(block, np.arange(n), centre, np.ones(n, bool), np.full(n, speed))


def with_times(block, time):
    """The block with other times of its photographs."""
    return replace(block, gnss_ins=replace(block.gnss_ins, time=time))


def test_velocities_of_the_track(simulated):
    """Those of the path through the projection centres."""
    block, truth = simulated
    found = velocities(block, truth.centre)
    np.testing.assert_allclose(found.velocity, truth.motion.velocity, atol=1e-6)
    assert (found.source == TIMED).all()


def test_whole_seconds(simulated):
    """Times of EXIF, whole seconds: more neighbours make up for the rounding."""
    block, truth = simulated
    time = block.gnss_ins.time
    found = velocities(with_times(block, np.floor(time)), truth.centre)
    off = np.linalg.norm(found.velocity - truth.motion.velocity, axis=1)
    # steps of 1.5 s, rounded to one
    assert np.sqrt(np.mean(off**2)) < 1.5
    assert off.max() < 3.0


def test_two_cameras_of_one_model(simulated):
    """Two aircraft at the same time, each with a camera of its own: as if each were alone."""
    block, truth = simulated
    n = len(block.images)
    cameras = (block.cameras[0], replace(block.cameras[0], name="other"))
    twice = np.repeat(np.arange(n), 2)
    number = np.tile([0, 1], n)
    images = replace(
        block.images, names=np.array([f"{block.images.names[k]}_{c}" for k, c in zip(twice, number, strict=True)]),
        camera=number, strip=block.images.strip[twice], centre=block.images.centre[twice],
        angles=block.images.angles[twice], columns={"time": np.repeat(block.gnss_ins.time, 2).astype(str)},
    )  # fmt: skip
    both = replace(block, cameras=cameras, images=images, gnss_ins=None)
    centre = truth.centre[twice] + np.where(number[:, None] == 1, [300.0, 200.0, 10.0], 0.0)
    found = velocities(both, centre)
    np.testing.assert_allclose(found.velocity, truth.motion.velocity[twice], atol=1e-6)


def test_two_aircraft_under_one_name():
    """Photographs of two aircraft mixed under one camera and strip: no velocity rather than a wild one."""
    block, truth = rolling_block(2)
    rows = np.flatnonzero(block.images.strip == "1")
    n = 2 * len(rows)
    time = 0.7 * np.arange(n)
    at = np.repeat(truth.centre[rows], 2, axis=0)
    at[1::2] += [200.0, 150.0, 0.0]
    images = replace(
        block.images, names=np.array([str(k) for k in range(n)]), camera=np.zeros(n, int), strip=np.full(n, "1"),
        centre=at, angles=np.full((n, 3), np.nan), columns={"time": time.astype(str)},
    )  # fmt: skip
    found = velocities(replace(block, images=images, gnss_ins=None), at)
    assert np.linalg.norm(found.velocity, axis=1).max() < 1.0
    assert (found.source == UNKNOWN).all()


def test_missing_and_wrong_times(simulated):
    """A photograph without a time, two with the same, one an hour late: the velocity of the strip."""
    block, truth = simulated
    time = block.gnss_ins.time.copy()
    time[2], time[6], time[8] = np.nan, time[7], time[8] + 3600.0
    found = velocities(with_times(block, time), truth.centre)
    off = np.linalg.norm(found.velocity - truth.motion.velocity, axis=1)
    assert off[:5].max() < 1.5
    assert np.linalg.norm(found.velocity, axis=1).max() < 10.0
    assert found.source[2] == STRIP


def test_hovering(simulated):
    """Positions that scatter by centimetres about one place: velocities of centimetres a second."""
    block, truth = simulated
    centre = np.random.default_rng(1).normal(size=truth.centre.shape) * 0.01 + [0.0, 0.0, 50.0]
    found = velocities(with_times(block, np.arange(len(centre)) * 2.0), centre)
    assert np.linalg.norm(found.velocity, axis=1).max() < 0.05


def test_stated_speed(simulated):
    """Without times: direction from the neighbours, speed as stated."""
    block, truth = simulated
    timeless = with_times(block, np.full(len(block.images), np.nan))
    found = velocities(timeless, truth.centre, 8.0)
    np.testing.assert_allclose(np.linalg.norm(found.velocity, axis=1), 8.0)
    direction = truth.motion.velocity / np.linalg.norm(truth.motion.velocity, axis=1, keepdims=True)
    assert (np.sum(found.velocity * direction, axis=1) > 7.8).all()
    assert (velocities(timeless, truth.centre).source == UNKNOWN).all()


def test_no_times_is_an_error(simulated):
    """Free readout time, velocities from the track, and no time anywhere."""
    block = with_times(simulated[0], np.full(len(simulated[0].images), np.nan))
    with pytest.raises(InputError, match="velocity of its photographs is not known") as raised:
        adjust(block)
    assert "speed_m_s" in raised.value.remedy


def test_too_many_own_motions(simulated):
    """Motions of their own for more photographs than the dense border takes."""
    spec = rolling_spec()
    spec["flight"] |= {"images_per_strip": 60, "strips": 2}
    spec["tie_points"] = {"per_image": 10, "probability": 0.8, "sigma_um": 0.8}
    from aerotri.simulation import parse_spec, simulate

    block = simulate(parse_spec(spec), 1)[0]
    with pytest.raises(InputError, match="unknowns of their own motion"):
        adjust(with_shutter(block, OWN))


def test_opened_again(tmp_path):
    """A saved result is opened with the same readout time, σ, velocities and residuals."""
    import aerotri

    result = aerotri.adjust(rolling_block(7)[0])
    result.save(tmp_path / "result", plots=False)
    again = aerotri.open_result(tmp_path / "result")
    one, other = result.adjusted.rolling_shutters, again.adjusted.rolling_shutters
    assert other.readouts[0].readout_ms == pytest.approx(one.readouts[0].readout_ms, rel=1e-12)
    assert other.readouts[0].sigma_ms == pytest.approx(one.readouts[0].sigma_ms, rel=1e-4)
    np.testing.assert_allclose(other.motions.velocity, one.motions.velocity, atol=1e-3)
    np.testing.assert_allclose(again.adjusted.rays.v, result.adjusted.rays.v, atol=1e-7)


def test_opened_again_with_parameters_that_noise_alone_determines(tmp_path):
    """Free nodes of a grid stay at the measured points; the velocities are those of the adjusted centres."""
    import aerotri
    from aerotri.pipeline.local import DETERMINED_BY_NOISE

    held = RollingShutter(Prior(30.0, fixed=True))
    block = with_shutter(rolling_block(7)[0], held)
    interior = {name: replace(prior, fixed=True, sigma=None) for name, prior in block.cameras[0].interior.items()}
    block = replace(block, cameras=(replace(block.cameras[0], interior=interior),))
    block = aerotri.with_settings(block, parameters="grid:5x4", model_part="off", max_iterations=100)
    result = aerotri.adjust(block, explain=False)
    assert result.status == "converged"
    assert DETERMINED_BY_NOISE in result.warnings
    result.save(tmp_path / "result", plots=False)
    again = aerotri.open_result(tmp_path / "result")
    np.testing.assert_allclose(again.adjusted.rays.v, result.adjusted.rays.v, atol=1e-7)
