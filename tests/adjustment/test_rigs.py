"""Rigid rigs: partials and covariances against a dense adjustment of stations and mountings, starts, GNSS, datum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.adjustment import rigging
from aerotri.adjustment.carry_over import start_values_at
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import Step
from aerotri.conventions import InputError
from aerotri.formats.results.rigs import rig_columns, rigs_json
from aerotri.functional_model.rotation import angles_from_rotation, logarithm, rotation_from_angles
from aerotri.observations import AdjustmentSettings, GnssSettings, InsSettings, Mounting, Prior
from aerotri.pipeline import adjust
from normalised_errors import assert_normal
from rig_blocks import EXACT, MOUNTINGS, rig_block
from small_blocks import with_adjustment

TWO = ("left", "fore")
GNSS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08], "lever_arm_m": [0.2, -0.3, 1.1]}}


def with_mountings(block, **changes):
    """The block with something of every mounting of its rig changed."""
    rig = block.rigs[0]
    cameras = {name: replace(mounting, **changes) for name, mounting in rig.cameras.items()}
    return replace(block, rigs=(replace(rig, cameras=cameras),))


def with_rig(block, **changes):
    """The block with something of its rig changed."""
    return replace(block, rigs=(replace(block.rigs[0], **changes),))


def values_of(result):
    """Value and σ of the elements of the mountings, by (camera, element)."""
    p = result.parameters
    rows = np.flatnonzero(p.kinds == "rig")
    return {(p.groups[k], p.names[k].removeprefix("rig.")): (p.value[k], p.sigma[k]) for k in rows}


def true_values(truth):
    """The same in truth."""
    letters = ("x", "y", "z", "omega", "phi", "kappa")
    return {(c, letter): v for c, six in truth.mountings.items() for letter, v in zip(letters, six, strict=True)}


@pytest.fixture(scope="module")
def simulated():
    return rig_block(3, cameras=TWO)


@pytest.fixture(scope="module")
def adjusted(simulated):
    return adjust(simulated[0])


def test_partials_by_station_and_mounting(simulated):
    """What a step of stations and mountings does to every photograph, by differences of the states it leads to."""
    prepared = prepare(simulated[0])
    u, state = prepared.system.unknowns, prepared.state
    chain, own = u.chain(state), u.rigging
    rng, h = np.random.default_rng(1), 1e-6
    step = Step(rng.normal(size=(len(u.images), 6)) * [1, 1, 1, 0.1, 0.1, 0.1], rng.normal(size=len(state.shared)),
                np.zeros_like(state.points))  # fmt: skip
    there, back = (u.advance(state, Step(s * h * step.images, s * h * step.shared, step.points)) for s in (1, -1))
    moved = (there.centre - back.centre) / (2.0 * h)
    turned = logarithm(there.rotation @ np.swapaxes(back.rotation, 1, 2)) / (2.0 * h)
    of_station = np.einsum("nij,nj->ni", chain.by_station, step.images[own.lead])
    columns = np.where(chain.columns >= 0, step.shared[np.maximum(chain.columns, 0)], 0.0)
    expected = of_station + np.einsum("nij,nj->ni", chain.by_mounting, columns)
    rows = own.followers
    assert len(rows) > 10
    np.testing.assert_allclose(moved[rows], expected[rows, :3], atol=1e-7)
    np.testing.assert_allclose(turned[rows], expected[rows, 3:], atol=1e-7)
    assert (u.turn(state) == np.eye(3)).all()


def _dense(block, result):
    """Covariance of stations (6 each, angles), mountings and points by numeric partials of the whole."""
    used = result.rays.status == 0
    image, point, xy = (getattr(block.image_points, name)[used] for name in ("image", "point", "xy"))
    sigma = block.image_points.sigma[used]
    stations = np.asarray(block.images.columns["station"])
    names = [camera.name for camera in block.cameras]
    camera = np.array(names)[block.images.camera]
    leads = np.flatnonzero(camera == "nadir")
    lead = np.array([leads[list(stations[leads]).index(s)] for s in stations])
    points = np.unique(point)
    focal = np.array([c.focal_length_mm for c in block.cameras])[block.images.camera[image]]
    heads = [name for name in names if name != "nadir"]
    given = np.flatnonzero(~block.control.is_check & np.isin(block.control.point, points))
    start = np.concatenate([
        np.concatenate([result.images.centre[leads], result.images.angles[leads]], axis=1).ravel(),
        [values_of(result)[head, e][0] for head in heads for e in ("x", "y", "z", "omega", "phi", "kappa")],
        result.points.xyz[points].ravel(),
    ])  # fmt: skip
    a, b = 6 * len(leads), 6 * len(leads) + 6 * len(heads)

    def predicted(y):
        six, mount, xyz = y[:a].reshape(-1, 6), y[a:b].reshape(-1, 6), np.full((len(block.points), 3), np.nan)
        xyz[points] = y[b:].reshape(-1, 3)
        row = np.searchsorted(leads, lead[image])
        rotation, centre = rotation_from_angles(six[row, 3:]), six[row, :3]
        for k, head in enumerate(heads):
            own = camera[image] == head
            centre[own] += rotation[own] @ mount[k, :3]
            rotation[own] = rotation[own] @ rotation_from_angles(mount[k, 3:])
        v = np.einsum("mji,mj->mi", rotation, xyz[point] - centre)
        measured = -focal[:, None] * v[:, :2] / v[:, 2:]
        observed = xyz[block.control.point[given]] / block.control.sigma[given]
        return np.concatenate([(measured / sigma).ravel(), observed.ravel()])

    columns = []
    for k in range(len(start)):
        h = 1e-6 if (k < b and k % 6 >= 3) else 1e-3
        forth, back = start.copy(), start.copy()
        forth[k] += h
        back[k] -= h
        columns.append((predicted(forth) - predicted(back)) / (2.0 * h))
    design = np.array(columns).T
    size = np.linalg.norm(design, axis=0)
    inverse = np.linalg.inv((design / size).T @ (design / size)) / np.outer(size, size)
    freedom = 1.0 - np.einsum("ij,jk,ik->i", design, inverse, design)
    gap = np.concatenate([(xy / sigma).ravel(), (block.control.xyz[given] / block.control.sigma[given]).ravel()])
    gradient = (inverse @ design.T @ (gap - predicted(start))) / np.sqrt(np.diagonal(inverse))
    return inverse, leads, heads, points, freedom[: 2 * len(image)].reshape(-1, 2), gradient, (a, b)


def test_covariance_as_of_a_dense_adjustment(simulated, adjusted):
    """Minimum, σ of stations, mountings and points, and redundancy numbers, with partials by differences."""
    block, result = simulated[0], adjusted
    inverse, leads, heads, points, freedom, gradient, (a, b) = _dense(block, result)
    scale = result.outcome.sigma0**2
    assert np.abs(gradient).max() < 1e-3
    six = scale * np.array([inverse[k : k + 6, k : k + 6] for k in range(0, a, 6)])
    np.testing.assert_allclose(result.images.covariance[leads], six, rtol=1e-4, atol=1e-6 * np.abs(six).max())
    p = result.parameters
    own = np.array([k for head in heads for k in np.flatnonzero((p.kinds == "rig") & (p.groups == head))])
    of_mountings = scale * inverse[a:b, a:b]
    np.testing.assert_allclose(p.sigma[own], np.sqrt(np.diagonal(of_mountings)), rtol=1e-4)
    d = np.sqrt(np.diagonal(of_mountings))
    np.testing.assert_allclose(
        p.covariance[np.ix_(own, own)] / np.outer(d, d), of_mountings / np.outer(d, d), atol=1e-4
    )
    three = scale * np.array([inverse[k : k + 3, k : k + 3] for k in range(b, len(inverse), 3)])
    np.testing.assert_allclose(result.points.covariance[points], three, rtol=1e-3, atol=1e-6 * np.abs(three).max())
    np.testing.assert_allclose(result.rays.r[result.rays.status == 0], freedom, atol=1e-5)


def test_sigma_of_a_photograph_that_follows(simulated, adjusted):
    """Through station and mounting, propagated by differences from the dense covariance."""
    block, result = simulated[0], adjusted
    inverse, leads, heads, _, _, _, (a, _) = _dense(block, result)
    camera = np.array([c.name for c in block.cameras])[block.images.camera]
    follower = int(np.flatnonzero((camera == "fore") & (result.images.rays > 0))[2])
    row = list(block.images.columns["station"][leads]).index(block.images.columns["station"][follower])
    which = np.concatenate([6 * row + np.arange(6), a + 6 * heads.index("fore") + np.arange(6)])
    lead = leads[row]
    mounting = [values_of(result)["fore", e][0] for e in ("x", "y", "z", "omega", "phi", "kappa")]
    start = np.concatenate([result.images.centre[lead], result.images.angles[lead], mounting])

    def orientation(y):
        at = rotation_from_angles(y[3:6])
        return np.concatenate([y[:3] + at @ y[6:9], angles_from_rotation(at @ rotation_from_angles(y[9:]))])

    np.testing.assert_allclose(orientation(start)[:3], result.images.centre[follower], atol=1e-8)
    np.testing.assert_allclose(orientation(start)[3:], result.images.angles[follower], atol=1e-11)
    unit = np.eye(12) * np.where(np.arange(12) % 6 < 3, 1e-3, 1e-6)
    partial = np.array([(orientation(start + e) - orientation(start - e)) / (2.0 * e.max()) for e in unit]).T
    expected = result.outcome.sigma0**2 * partial @ inverse[np.ix_(which, which)] @ partial.T
    found = result.images.covariance[follower]
    size = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(found / np.outer(size, size), expected / np.outer(size, size), atol=1e-4)


def test_a_rig_of_one_camera_changes_nothing(simulated):
    """To the last bit, as does a rig that is off."""
    block = simulated[0]
    plain = adjust(replace(block, rigs=()))
    for rigs in ((replace(block.rigs[0], cameras={}),), (replace(block.rigs[0], constraint="off"),)):
        found = adjust(replace(block, rigs=rigs))
        for name in ("centre", "angles", "covariance"):
            np.testing.assert_array_equal(getattr(found.images, name), getattr(plain.images, name))
        np.testing.assert_array_equal(found.points.covariance, plain.points.covariance)


def test_rigid_has_fewer_unknowns_and_smaller_sigma(simulated, adjusted):
    alone = adjust(replace(simulated[0], rigs=()))
    stations = len(set(simulated[0].images.columns["station"]))
    both = (adjusted.images.rays > 0) & (alone.images.rays > 0)
    followers = both & (simulated[0].images.camera > 0)
    free = alone.outcome.unknowns - 3 * int((alone.points.rays > 0).sum())
    rigid = adjusted.outcome.unknowns - 3 * int((adjusted.points.rays > 0).sum())
    assert free == 6 * int((alone.images.rays > 0).sum())
    assert rigid == 6 * stations + 12
    assert (adjusted.images.sigma[followers] < 1.02 * alone.images.sigma[followers]).all()
    assert np.median(adjusted.images.sigma[followers] / alone.images.sigma[followers]) < 0.6


@pytest.mark.parametrize("off_deg", [10.0, -8.0])
def test_starts_from_nominal_angles(simulated, adjusted, off_deg):
    """Without start values, positions by GNSS alone and stated angles wrong by up to 10 degrees."""
    stated = {
        name: {
            "stated_rotation_deg": [a + off_deg * s for a, s in zip(MOUNTINGS[name]["rotation_deg"], t, strict=True)]
        }
        for name, t in (("left", (0.3, 0.5, -0.8)), ("fore", (-0.6, 0.5, 0.6)))
    }
    block, truth = rig_block(3, cameras=TWO, start_values={"kind": "none"}, **GNSS)
    rig = block.rigs[0]
    cameras = {}
    for name, changed in stated.items():
        angles = np.radians(changed["stated_rotation_deg"])
        priors = tuple(replace(p, value=float(v)) for p, v in zip(rig.cameras[name].rotation, angles, strict=True))
        cameras[name] = replace(rig.cameras[name], rotation=priors)
    result = adjust(replace(block, rigs=(replace(rig, cameras=cameras),)))
    assert result.outcome.status == "converged"
    assert 0.9 < result.outcome.sigma0 < 1.1
    for key, true in true_values(truth).items():
        value, sigma = values_of(result)[key]
        assert abs(value - true) < 4.5 * sigma, key


def test_starts_from_the_photographs_orientations(simulated, adjusted):
    """Without stated angles, from the mean over the stations."""
    found = values_of(adjust(with_mountings(simulated[0], known=False)))
    for key, (value, sigma) in values_of(adjusted).items():
        assert abs(found[key][0] - value) < 1e-3 * sigma, key


def test_nothing_says_how_a_camera_is_turned():
    block, _ = rig_block(3, cameras=("left",), start_values={"kind": "none"}, tie_points={
        "per_image": 4, "probability": 0.5, "sigma_um": 2.0})  # fmt: skip
    centre, angles = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3), np.nan)
    lead = block.images.camera == 0
    truth = rig_block(3, cameras=("left",))[1]
    centre[lead], angles[lead] = truth.centre[lead], truth.angles[lead]
    block = replace(block, images=replace(block.images, centre=centre, angles=angles))
    few = np.isin(block.image_points.image, np.flatnonzero(lead)) | (block.image_points.point % 17 == 0)
    rays = block.image_points
    rays = replace(rays, image=rays.image[few], point=rays.point[few], xy=rays.xy[few], sigma=rays.sigma[few])
    result = adjust(with_mountings(replace(block, image_points=rays), known=False))
    assert "left" not in result.parameters.groups
    assert any("without start values" in warning for warning in result.outcome.warnings)


def test_gnss_acts_once_a_station(simulated):
    """Rows of the other photographs of a station change nothing, with the lever arm in the reference camera's frame."""
    block, _ = rig_block(3, cameras=TWO, **GNSS)
    block = replace(block, settings=replace(block.settings, gnss=GnssSettings("off", lever_arm_m=(0.2, -0.3, 1.1))))
    once = adjust(block)
    gnss, stations = block.gnss_ins, np.asarray(block.images.columns["station"])
    row = {stations[image]: k for k, image in enumerate(gnss.image)}
    all_rows = np.array([row[s] for s in stations])
    parts = {name: getattr(gnss, name)[all_rows] for name in ("xyz", "sigma", "angles", "angles_sigma", "time")}
    often = adjust(replace(block, gnss_ins=replace(gnss, image=np.arange(len(stations)), **parts)))
    assert often.outcome.observations == once.outcome.observations
    np.testing.assert_array_equal(often.points.covariance, once.points.covariance)
    every = adjust(replace(often.block, rigs=()))
    assert every.outcome.observations > once.outcome.observations


def test_attitudes_act_once_a_station():
    block, truth = rig_block(
        5, cameras=TWO, gnss={"sigma_m": [0.05, 0.05, 0.08]},
        ins={"sigma_deg": [0.002, 0.002, 0.004], "boresight_deg": [0.05, -0.03, 0.1]},
    )  # fmt: skip
    result = adjust(replace(block, settings=replace(block.settings, ins=InsSettings("camera", "off"))))
    stations = len(set(block.images.columns["station"]))
    attitudes = next(group for group in result.groups if group.name == "attitudes")
    assert attitudes.count == 3 * stations
    assert 0.9 < result.outcome.sigma0 < 1.1
    for key, true in true_values(truth).items():
        value, sigma = values_of(result)[key]
        assert abs(value - true) < 4.5 * sigma, key


def test_held_and_observed_elements(simulated):
    """Held ones keep their value and have no unknown; observed ones have the smaller σ."""
    block = simulated[0]
    held, observed = (lambda p: replace(p, fixed=True)), (lambda p: replace(p, sigma=1e-3))
    rig = block.rigs[0]
    left, fore = rig.cameras["left"], rig.cameras["fore"]
    cameras = {
        "left": replace(left, position=tuple(held(p) for p in left.position)),
        "fore": replace(fore, position=tuple(observed(p) for p in fore.position)),
    }
    result = adjust(replace(block, rigs=(replace(rig, cameras=cameras),)))
    found = values_of(result)
    assert {element for camera, element in found if camera == "left"} == {"omega", "phi", "kappa"}
    assert all(found["fore", axis][1] < 1.2e-3 for axis in "xyz")
    camera = np.array([c.name for c in block.cameras])[block.images.camera]
    row = int(np.flatnonzero((camera == "left") & (result.images.rays > 0))[0])
    lead = int(np.flatnonzero(block.images.columns["station"] == block.images.columns["station"][row])[0])
    at = rotation_from_angles(result.images.angles[lead])
    arm = at.T @ (result.images.centre[row] - result.images.centre[lead])
    np.testing.assert_allclose(arm, MOUNTINGS["left"]["position_m"], atol=1e-7)


def test_angles_of_a_steep_mounting_run_from_its_start(simulated, adjusted, monkeypatch):
    """Other unknowns for the same mounting: points and their σ stay the same."""
    monkeypatch.setattr(rigging, "STEEP", 0.1)
    steep, plain = adjust(simulated[0]), adjusted
    assert np.abs(values_of(steep)["left", "phi"][0]) < 0.1
    np.testing.assert_allclose(steep.points.xyz, plain.points.xyz, atol=1e-7)
    np.testing.assert_allclose(steep.points.covariance, plain.points.covariance, rtol=1e-6, atol=1e-12)


def test_single_angles_of_a_steep_mounting_are_refused():
    block, _ = rig_block(4, cameras=("left",), start_values={"kind": "perturbed"})
    angles = np.radians([0.0, -90.0, 0.0])
    rotation = tuple(Prior(float(v), 0.01 if k == 0 else None) for k, v in enumerate(angles))
    images = block.images
    lead, other = images.camera == 0, images.camera == 1
    turned = rotation_from_angles(images.angles[lead]) @ rotation_from_angles(angles)
    own = images.angles.copy()
    own[other] = angles_from_rotation(turned)
    block = replace(block, images=replace(images, angles=own))
    block = with_rig(block, cameras={"left": Mounting(rotation=rotation)})
    with pytest.raises(InputError, match="middle angle near 90 degrees"):
        adjust(block)


@pytest.mark.parametrize("datum", ["minimal", "inner"])
def test_a_free_block_takes_its_scale_from_no_free_arm(simulated, adjusted, datum):
    """Seven motions are free with free arms; the same shape and the same mounting as with control held loosely."""
    result = adjust(with_adjustment(simulated[0], datum=datum))
    assert result.outcome.status == "converged"
    assert result.outcome.conditions == (7 if datum == "inner" else 0)
    for (camera, element), (value, sigma) in values_of(result).items():
        if element in ("omega", "phi", "kappa"):
            assert abs(value - values_of(adjusted)[camera, element][0]) < 3.0 * sigma


def test_an_arm_that_is_known_gives_the_scale(simulated):
    """With arms held, six motions are free."""
    block = with_mountings(simulated[0], position=tuple(
        replace(p, fixed=True, value=v) for p, v in zip(simulated[0].rigs[0].cameras["left"].position, (3.0, 0.0, 0.0),
                                                        strict=True)))  # fmt: skip
    prepared = prepare(with_adjustment(block, datum="inner"))
    assert prepared.system.unknowns.motions.count == 6


@pytest.mark.parametrize("steep", [75.0, 5.0])
def test_a_saved_result_opens_as_it_was(simulated, tmp_path, monkeypatch, steep):
    """Re-linearised at its solution, whichever angles the mountings have as unknowns."""
    monkeypatch.setattr(rigging, "STEEP", np.radians(steep))
    for known in (True, False):
        found = aerotri.adjust(with_mountings(simulated[0], known=known))
        found.save(tmp_path / "result", plots=False)
        again = aerotri.open_result(tmp_path / "result")
        np.testing.assert_allclose(again.adjusted.images.covariance, found.adjusted.images.covariance, rtol=1e-8)
        for one, other in zip(again.adjusted.rigs, found.adjusted.rigs, strict=True):
            np.testing.assert_allclose(one.angles, other.angles, atol=1e-12)
            np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-6, atol=1e-18)


def test_joint_covariance_of_photographs_of_a_station(simulated):
    """Q of one photograph by columns is that on the pattern; lead and follower are as one where the arms are."""
    found = aerotri.adjust(simulated[0])
    block = simulated[0]
    lead = int(np.flatnonzero(found.adjusted.images.rays > 40)[0])
    names = [str(block.images.names[lead]), str(block.points[found.adjusted.points.rays > 3][0])]
    joint = found.covariance(names).matrix
    np.testing.assert_allclose(joint[:6, :6], found.adjusted.images.covariance[lead], rtol=1e-6, atol=1e-15)


def test_mountings_of_the_result(simulated, adjusted):
    """rigs.csv and adjustment.json say what the parameters say, in degrees, with the correlations."""
    truth = simulated[1]
    columns, content = rig_columns(adjusted.rigs), rigs_json(adjusted.rigs)
    assert columns["camera"].tolist() == list(TWO)
    assert columns["reference"].tolist() == ["nadir", "nadir"]
    for k, camera in enumerate(TWO):
        for element in ("x", "y", "z"):
            value, sigma = values_of(adjusted)[camera, element]
            assert (columns[element][k], columns[f"s{element}"][k]) == pytest.approx((value, sigma))
            assert abs(value - true_values(truth)[camera, element]) < 4.5 * sigma
        for element in ("omega", "phi", "kappa"):
            value, sigma = np.degrees(values_of(adjusted)[camera, element])
            assert (columns[element][k], columns[f"s_{element}"][k]) == pytest.approx((value, sigma))
            assert content[k][element] == pytest.approx(value)
        table = np.array([[row[e] for e in ("x", "y", "z", "omega", "phi", "kappa")] for row in
                          content[k]["correlations"]])  # fmt: skip
        np.testing.assert_allclose(np.diagonal(table), 1.0)
        np.testing.assert_allclose(table, table.T)
        assert (columns["stations"] > 5).all()


def test_elements_of_a_follower_cannot_carry_the_datum(simulated):
    block = simulated[0]
    names = block.images.names[block.images.camera == 1]
    with pytest.raises(InputError, match="follows another one"):
        adjust(with_adjustment(block, datum="fixed", datum_fixed=((str(names[0]), "X0"),)))


def test_a_reference_photograph_without_image_points(simulated):
    """It carries its station all the same, and gets its orientation and σ."""
    block = simulated[0]
    gone = int(np.flatnonzero(block.images.camera == 0)[4])
    rays = block.image_points
    kept = rays.image != gone
    rays = replace(rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept])
    result = adjust(replace(block, image_points=rays))
    assert result.outcome.status == "converged"
    assert result.images.rays[gone] == 0
    error = result.images.centre[gone] - simulated[1].centre[gone]
    assert (np.abs(error) < 4.5 * result.images.sigma[gone, :3]).all()
    assert (result.images.sigma[gone, :3] < 1.0).all()


def test_a_follower_without_a_reference_that_is_oriented(simulated):
    """It is adjusted on its own."""
    block = simulated[0]
    lead = int(np.flatnonzero(block.images.camera == 0)[4])
    follower = lead + 1
    prepared = prepare(block)
    u = prepared.system.unknowns
    start = start_values_at(u, prepared.state)
    start.centre[lead], start.rotation[lead] = np.nan, np.nan
    status = np.where(np.isin(block.image_points.image, [lead]), 3, prepared.ray_status)
    system, state = build_system(block, start, status)
    rows = system.unknowns.images.tolist()
    assert lead not in rows
    assert np.isfinite(state.centre).all()
    if follower in rows:
        assert system.unknowns.rigging.mounting[rows.index(follower)] == -1


def test_rays_without_a_station_stay_as_they_are(simulated):
    """Photographs with an empty station are independent."""
    block = simulated[0]
    station = np.asarray(block.images.columns["station"], dtype=object).copy()
    station[block.images.camera > 0] = ""
    loose = adjust(replace(block, images=replace(block.images, columns={"station": station})))
    plain = adjust(replace(block, rigs=()))
    np.testing.assert_array_equal(loose.points.xyz, plain.points.xyz)
    assert not (loose.parameters.kinds == "rig").any()


def test_with_self_calibration_gross_errors_and_robust_weights(simulated):
    """Beside other shared parameters and with weights: mountings within their σ."""
    block, truth = rig_block(
        8, cameras=TWO, mounting=EXACT, gross_errors={"fraction": 0.02},
        camera={name: {"size_px": [6000, 4000], "pixel_um": 4.0, "focal_length_mm": f,
                       "interior": {"focal_length_mm": {"sigma": 0.02}, "x0_mm": {"sigma": 0.02}}}
                for name, f in (("nadir", 25.0), ("left", 35.0), ("fore", 35.0))},
    )  # fmt: skip
    settings = AdjustmentSettings(additional_parameters=(("brown", ("K1", "K2")),), robust="huber")
    result = adjust(replace(block, settings=replace(block.settings, adjustment=settings)))
    assert result.outcome.status == "converged"
    for key, true in true_values(truth).items():
        value, sigma = values_of(result)[key]
        assert abs(value - true) < 4.5 * sigma, key


@pytest.mark.slow
@pytest.mark.parametrize("case", ["free arms", "observed arms and GNSS"])
def test_recovery(case):
    """Normalised errors of mountings, a station, a photograph that follows and a point over 50 seeds: N(0, 1)."""
    changes = {} if case == "free arms" else {"mounting": EXACT, **GNSS}
    runs = [_normalised_errors(seed, **changes) for seed in range(1000, 1050)]
    assert_normal(runs, case)


def _normalised_errors(seed, **changes):
    block, truth = rig_block(seed, cameras=TWO, **changes)
    result = adjust(block)
    found = values_of(result)
    z = {key: (found[key][0] - true) / found[key][1] for key, true in true_values(truth).items()}
    for name in ("1_003", "1_003_left"):
        row = block.images.names.tolist().index(name)
        found, true = result.images, truth
        gap = np.concatenate([found.centre[row] - true.centre[row], found.angles[row] - true.angles[row]])
        z |= {(name, k): value for k, value in enumerate(gap / result.images.sigma[row])}
    point = int(np.flatnonzero(result.points.rays == 3)[seed % 5])
    gap = (result.points.xyz[point] - truth.points[point]) / result.points.sigma[point]
    z |= {("point", k): value for k, value in enumerate(gap)}
    return z, result.outcome.vtpv, result.outcome.redundancy
