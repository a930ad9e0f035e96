"""What changed between two runs: single known values, matched by name."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import MGON_PER_RADIAN
from aerotri.observations import Prior
from aerotri.statistics.comparison import compare
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def run():
    return make_adjusted_block(2, 5, 80, n_control=6, n_check=5)


def with_images(run, **changes):
    return replace(run, images=replace(run.images, **changes))


def with_block(run, **changes):
    return replace(run, block=replace(run.block, **changes))


def only(changes):
    (change,) = changes
    return change


def test_a_run_and_itself(run):
    same = compare(run, run)
    assert same.settings == same.roles == same.warnings_gone == same.warnings_new == same.notes == ()
    assert not any(same.rays.counts.values())
    assert len(same.orientations) == 10
    assert not same.orientations.delta.any()
    assert not same.points.delta.any()
    assert len(same.orientations.worst(5)) == 0
    assert all(p.delta == 0.0 for p in same.parameters)
    assert all(change.first == change.second for change in same.outcome)


def test_one_photograph_moved(run):
    """12 cm at σ 6 cm is 2 σ; RMS 12 cm/√10; 36 µrad·… in ω at σ 0.0012°."""
    centre, angles = run.images.centre.copy(), run.images.angles.copy()
    centre[3, 1] += 0.12
    angles[7, 0] += 3.6 * np.radians(0.0012)
    d = compare(run, with_images(run, centre=centre, angles=angles)).orientations
    assert d.ratio[3, 1] == pytest.approx(2.0)
    assert d.rms[1] == pytest.approx(0.12 / np.sqrt(10))
    assert d.ratio[7, 3] == pytest.approx(3.6)
    assert d.names[d.worst(2)].tolist() == [run.block.images.names[7], run.block.images.names[3]]
    assert len(d.worst(9)) == 2


def test_kappa_across_the_date_line(run):
    first, second = run.images.angles.copy(), run.images.angles.copy()
    first[4, 2], second[4, 2] = np.pi - 1e-5, -np.pi + 2e-5
    d = compare(with_images(run, angles=first), with_images(run, angles=second)).orientations
    assert d.delta[4, 5] == pytest.approx(3e-5)
    assert d.delta[4, 5] * MGON_PER_RADIAN == pytest.approx(1.9099, abs=1e-4)


def test_sigma_is_that_of_the_second_run(run):
    xyz = run.points.xyz.copy()
    point = int(np.flatnonzero(np.isfinite(xyz).all(axis=1))[10])
    xyz[point, 2] += 0.5
    covariance = run.points.covariance.copy()
    covariance[point] = np.diag([0.01, 0.01, 0.25]) ** 2
    second = replace(run, points=replace(run.points, xyz=xyz, covariance=covariance))
    name = run.block.points[point]
    for one, two, ratio in ((run, second, 2.0), (second, run, 0.5 / run.points.sigma[point, 2])):
        d = compare(one, two).points
        assert d.names[d.worst(1)[0]] == name
        assert d.ratio[d.worst(1)[0], 2] == pytest.approx(ratio)
    d = compare(run, second).points
    assert d.rms[2] == pytest.approx(0.5 / np.sqrt(len(d)))


def test_points_are_matched_by_name(run):
    """The second run numbers its points the other way round and lacks the first ten."""
    count = len(run.block.points)
    order = np.arange(count)[:9:-1]
    new = np.full(count, -1)
    new[order] = np.arange(len(order))
    rays = run.block.image_points
    kept = new[rays.point] >= 0
    xyz = run.points.xyz[order] + [0.0, 0.0, 1.0]
    points = replace(run.points, xyz=xyz, covariance=run.points.covariance[order], rays=run.points.rays[order],
                     max_abs_w=run.points.max_abs_w[order])  # fmt: skip
    measured = replace(rays, image=rays.image[kept], point=new[rays.point[kept]], xy=rays.xy[kept],
                       sigma=rays.sigma[kept])  # fmt: skip
    results = {name: getattr(run.rays, name)[kept] for name in ("v", "r", "w", "weight", "status")}
    inside = [new[results.point] >= 0 for results in (run.control, run.check)]
    ground = [
        replace(g, **{f: getattr(g, f)[k] for f in ("difference", "sigma", "r", "w", "rays")}, point=new[g.point[k]])
        for g, k in zip((run.control, run.check), inside, strict=True)
    ]
    control = run.block.control
    own = new[control.point] >= 0
    given = replace(control, point=new[control.point[own]], xyz=control.xyz[own], sigma=control.sigma[own],
                    is_check=control.is_check[own])  # fmt: skip
    block = replace(run.block, points=run.block.points[order], image_points=measured, control=given)
    second = replace(run, block=block, points=points, rays=replace(run.rays, **results), control=ground[0],
                     check=ground[1])  # fmt: skip
    compared = compare(run, second)
    np.testing.assert_allclose(compared.points.delta, np.tile([0.0, 0.0, 1.0], (len(compared.points), 1)), atol=1e-9)
    assert compared.rays.counts["gone"] == int((~kept).sum())
    assert sum(compared.rays.counts.values()) == int((~kept).sum())
    assert compared.check_points.rms[0].tolist() == compared.check_points.rms[1].tolist()


def test_rays_used_differently(run):
    rays = run.block.image_points
    used = np.flatnonzero(run.rays.status == 0)
    status, weight, xy = run.rays.status.copy(), run.rays.weight.copy(), rays.xy.copy()
    status[used[0]] = 2
    weight[used[1]], weight[used[2]] = 0.4, 0.6
    xy[used[3]] += [0.003, 0.004]
    second = replace(
        with_block(run, image_points=replace(rays, xy=xy)), rays=replace(run.rays, status=status, weight=weight)
    )
    found = compare(run, second).rays
    assert dict(found.counts) == {"added": 0, "gone": 0, "switched": 1, "measured anew": 1, "weighted anew": 1}
    by_kind = {change.kind: change for change in found.listed}
    names = [(run.block.images.names[rays.image[k]], run.block.points[rays.point[k]]) for k in used[:4]]
    assert (by_kind["switched"].image, by_kind["switched"].point) == names[0]
    assert (by_kind["switched"].first, by_kind["switched"].second) == ("used", "off")
    assert (by_kind["weighted anew"].image, by_kind["weighted anew"].point) == names[1]
    assert by_kind["weighted anew"].second == "weight 0.4"
    assert (by_kind["measured anew"].image, by_kind["measured anew"].point) == names[3]
    assert by_kind["measured anew"].second == "5.0 µm away"


def test_a_ray_more(run):
    rays = run.block.image_points
    fewer = {name: getattr(rays, name)[1:] for name in ("image", "point", "xy", "sigma")}
    results = {name: getattr(run.rays, name)[1:] for name in ("v", "r", "w", "weight", "status")}
    less = replace(with_block(run, image_points=replace(rays, **fewer)), rays=replace(run.rays, **results))
    assert compare(less, run).rays.counts["added"] == 1
    assert compare(run, less).rays.counts["gone"] == 1
    added = only(compare(less, run).rays.listed)
    assert (added.image, added.point) == (run.block.images.names[rays.image[0]], run.block.points[rays.point[0]])


def test_control_made_check_and_moved(run):
    name = str(run.block.points[run.control.point[0]])
    keep = np.arange(len(run.control)) > 0
    control = replace(
        run.control, **{f: getattr(run.control, f)[keep] for f in ("point", "difference", "sigma", "r", "w", "rays")}
    )
    joined = {
        f: np.concatenate([getattr(run.check, f), getattr(run.control, f)[:1]])
        for f in ("point", "difference", "sigma", "r", "w", "rays")
    }
    second = replace(run, control=control, check=replace(run.check, **joined))
    given = run.block.control
    row = int(np.flatnonzero(given.point == run.control.point[3])[0])
    xyz, sigma = given.xyz.copy(), given.sigma.copy()
    xyz[row, 0] += 0.25
    sigma[row, 1] = 0.2
    compared = compare(run, with_block(second, control=replace(given, xyz=xyz, sigma=sigma)))
    moved = str(run.block.points[given.point[row]])
    changes = {change.name: (change.first, change.second) for change in compared.roles}
    assert changes.keys() == {name, f"{moved} X", f"{moved} σY"}
    assert changes[name] == ("control", "check")
    assert changes[f"{moved} X"][1] - changes[f"{moved} X"][0] == pytest.approx(0.25)
    assert changes[f"{moved} σY"] == (0.05, 0.2)
    assert compared.check_points.counts == (5, 6)
    assert len(compared.check_points.names) == 5


def test_parameters_come_go_and_change(run):
    p = run.parameters
    row = list(p.names).index("bluh.4")
    value = p.value.copy()
    value[row] += 2.5 * p.sigma[row]
    keep = np.arange(len(p)) != list(p.names).index("bluh.7")
    arrays = {f: getattr(p, f)[keep] for f in ("names", "groups", "kinds", "marks", "max_correlation",
              "max_correlation_with", "total_correlation", "status", "reason")}  # fmt: skip
    second = replace(run, parameters=replace(p, value=value[keep], covariance=p.covariance[np.ix_(keep, keep)],
                                             **arrays))  # fmt: skip
    changes = {change.name: change for change in compare(run, second).parameters}
    assert changes["bluh.4"].ratio == pytest.approx(2.5)
    assert changes["bluh.3"].delta == 0.0
    assert np.isnan(changes["bluh.7"].second)
    assert changes["focal_length_mm"].first == pytest.approx(101.4021)
    assert "x0_mm" not in changes, "held alike in both"


def test_principal_point_held_elsewhere(run):
    camera = run.block.cameras[0]
    other = replace(camera, interior={**camera.interior, "x0_mm": Prior(0.012, fixed=True)})
    compared = compare(run, with_block(run, cameras=(other,)))
    change = next(p for p in compared.parameters if p.name == "x0_mm")
    assert (change.first, change.second, change.kind) == (0.0, 0.012, "interior")
    assert np.isnan(change.ratio)
    assert [c.name for c in compared.settings] == ["camera.ucd2.interior.x0_mm.value"]


def test_settings_and_outcome(run):
    settings = run.block.settings
    other = replace(settings, adjustment=replace(settings.adjustment, robust="huber"), image_sigma_um=3.0)
    outcome = replace(run.outcome, sigma0=0.9, warnings=("new one", *run.outcome.warnings[1:]))
    compared = compare(run, replace(with_block(run, settings=other), outcome=outcome))
    assert [(c.name, c.first, c.second) for c in compared.settings] == [
        ("adjustment.robust", "off", "huber"), ("image_sigma_um", 2.5, 3.0),
    ]  # fmt: skip
    assert next((c.first, c.second) for c in compared.outcome if c.name == "sigma0") == (1.04, 0.9)
    assert compared.warnings_new == ("new one",)
    assert compared.warnings_gone == run.outcome.warnings[:1]


def test_check_points_of_both_runs_only(run):
    difference = run.check.difference + [0.1, 0.0, -0.2]
    compared = compare(run, replace(run, check=replace(run.check, difference=difference))).check_points
    first = run.check.difference
    np.testing.assert_allclose(compared.rms[0], np.sqrt(np.nanmean(first**2, axis=0)))
    np.testing.assert_allclose(compared.rms[1], np.sqrt(np.nanmean(difference**2, axis=0)))


def test_what_cannot_be_compared_is_not(run):
    elsewhere = compare(run, with_block(run, crs="EPSG:25832"))
    assert len(elsewhere.orientations) == len(elsewhere.points) == 0
    assert "EPSG:25832" in elsewhere.notes[0]
    other_order = compare(run, with_block(run, rotation="phi-omega-kappa"))
    assert np.isnan(other_order.orientations.delta[:, 3:]).all()
    assert np.isfinite(other_order.orientations.delta[:, :3]).all()
    adjustment = replace(run.block.settings.adjustment, datum="inner")
    free = with_block(run, settings=replace(run.block.settings, adjustment=adjustment))
    assert "motion of the whole block" in only(compare(run, free).notes)
    failed = replace(run, outcome=replace(run.outcome, status="not converged"))
    assert "second run" in only(compare(run, failed).notes)
