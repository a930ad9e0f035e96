"""Planted problems come out on top of the work list, each under its own name."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.control_rays import control_rays
from aerotri.diagnosis.ties import intersection_angles, photograph_ties
from aerotri.diagnosis.work_list import WorkLimits, work_list
from aerotri.pipeline import adjust
from aerotri.results.adjusted_block import ObservationResults
from small_blocks import small_block
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def block():
    return small_block(1)[0]


@pytest.fixture(scope="module")
def made_up():
    return make_adjusted_block(3, 6, 150, n_control=6, n_check=6)


def keep_rays(block, keep):
    rays = block.image_points
    return replace(block, image_points=replace(rays, image=rays.image[keep], point=rays.point[keep], xy=rays.xy[keep],
                                               sigma=rays.sigma[keep]))  # fmt: skip


def shifted(block, row, mm):
    xy = block.image_points.xy.copy()
    xy[row] += mm
    return replace(block, image_points=replace(block.image_points, xy=xy))


def control_points(block):
    return block.control.point[~block.control.is_check]


def rays_of(block, point):
    return np.flatnonzero(block.image_points.point == point)


def place(block, row):
    rays = block.image_points
    return f"{block.points[rays.point[row]]} in {block.images.names[rays.image[row]]}"


def test_clean_block_has_nothing_wrong_or_weak(block):
    work = work_list(adjust(block))
    assert all(item.priority == 3 for item in work.items)
    assert set(work.found) <= {"ray", "control ray", "point"}


def test_gross_error_in_a_tie_point(block):
    counts = np.bincount(block.image_points.point)
    point = int(np.flatnonzero(counts == counts.max())[0])
    row = rays_of(block, point)[2]
    top = work_list(adjust(shifted(block, row, [0.04, 0.0]))).items[0]
    assert (top.priority, top.kind, top.where) == (1, "ray", place(block, row))
    assert "wx +" in top.what
    error_px = float(top.what.split("(")[1].split(" px")[0])
    assert error_px == pytest.approx(40.0 / 9.0, abs=1.0)


def test_one_of_many_rays_of_a_control_point(block):
    """The other rays of the point are good: an average over them would hide it."""
    point = control_points(block)[4]
    rows = rays_of(block, point)
    row = rows[1]
    adjusted = adjust(shifted(block, row, [0.0, -0.03]))
    top = work_list(adjusted).items[0]
    assert (top.priority, top.kind, top.where) == (1, "control ray", place(block, row))
    listed = control_rays(adjusted)
    assert listed.row[0] == row
    assert set(listed.row[: len(rows)].tolist()) == set(rows.tolist()), "the point stands together"
    measured = np.isin(block.image_points.point, block.control.point)
    assert len(listed) == measured.sum(), "every ray of every control and check point"
    assert (listed.role == "check").sum() > 0


def test_wrong_control_coordinate(block):
    xyz = block.control.xyz.copy()
    row = np.flatnonzero(~block.control.is_check)[3]
    xyz[row, 0] += 1.0
    work = work_list(adjust(replace(block, control=replace(block.control, xyz=xyz))))
    top = work.items[0]
    name = str(block.points[block.control.point[row]])
    assert (top.priority, top.kind, top.where) == (1, "control", name)
    assert top.what.startswith("X: adjusted − given -")
    assert "given value off by +" in top.what


def test_wrong_check_point(block):
    xyz = block.control.xyz.copy()
    row = np.flatnonzero(block.control.is_check)[2]
    xyz[row, 2] -= 3.0
    top = work_list(adjust(replace(block, control=replace(block.control, xyz=xyz)))).items[0]
    assert (top.kind, top.where) == ("check point", str(block.points[block.control.point[row]]))
    assert top.what.startswith("Z: adjusted − given +")


def test_control_rays_of_one_photograph_to_one_side(block):
    """2.5 µm on the control rays of one photograph: no single one stands out."""
    known = np.isin(block.image_points.point, block.control.point)
    image = int(np.argmax(np.bincount(block.image_points.image[known])))
    rows = np.flatnonzero(known & (block.image_points.image == image))
    assert len(rows) >= 3
    work = work_list(adjust(shifted(block, rows, [0.009, 0.0])))
    items = [item for item in work.items if "on average" in item.what]
    assert [item.where for item in items] == [str(block.images.names[image])]
    assert items[0].what.startswith("control rays off by +")


def test_photograph_left_out(block):
    work = work_list(adjust(keep_rays(block, block.image_points.image != 7)))
    top = work.items[0]
    assert (top.priority, top.kind, top.where) == (1, "left out", str(block.images.names[7]))
    assert "0 image points measured" in top.what


def test_control_point_not_measured(block):
    point = control_points(block)[4]
    items = work_list(adjust(keep_rays(block, block.image_points.point != point))).items
    assert any(item.kind == "left out" and item.where == str(block.points[point]) for item in items)


def test_weakly_tied_photograph(block):
    image = 8
    own = np.flatnonzero(block.image_points.image == image)
    keep = np.ones(len(block.image_points), dtype=bool)
    keep[own[5:]] = False
    items = work_list(adjust(keep_rays(block, keep))).items
    assert (items[0].priority, items[0].kind, items[0].where) == (2, "photograph", str(block.images.names[image]))
    assert "points in common with all others" in items[0].what
    assert "σ of the" in items[0].what


def test_weakly_tied_part(block):
    """Two strips that share six points with the other photographs."""
    rays = block.image_points
    far = np.isin(block.images.strip, np.unique(block.images.strip)[:1])
    sides = [np.isin(np.arange(len(block.points)), rays.point[far[rays.image] == side]) for side in (True, False)]
    across = np.flatnonzero(sides[0] & sides[1])
    cut = np.setdiff1d(across, across[:: len(across) // 6][:6])
    removed = far[rays.image] & np.isin(rays.point, cut)
    items = work_list(adjust(keep_rays(block, ~removed))).items
    part = next(item for item in items if item.kind == "part")
    assert part is items[0]
    assert part.what == f"{far.sum()} photographs with 6 points in common with all others"


def test_parameters_that_cannot_be_told_apart(made_up):
    p = made_up.parameters
    r, partner = np.zeros(len(p)), p.max_correlation_with.astype(object).copy()
    a, b = (list(p.names).index(name) for name in ("bluh.3", "bluh.5"))
    r[[a, b]], partner[a], partner[b] = -0.99995, "bluh.5", "bluh.3"
    total = np.full(len(p), 0.5)
    total[list(p.names).index("bluh.9")] = 0.9999
    changed = replace(made_up, parameters=replace(p, max_correlation=r, max_correlation_with=partner,
                                                  total_correlation=total))  # fmt: skip
    found = [item for item in work_list(changed).items if item.kind == "parameters"]
    assert [item.where for item in found] == ["bluh.3 and bluh.5", "bluh.9 (ucd2)"]
    assert "-99.995 %" in found[0].what
    assert found[0].severity == pytest.approx(20.0)


def test_points_with_poor_rays(made_up):
    """A point of two rays from photographs 40 m apart at 1900 m distance: 1.2°."""
    rays = made_up.block.image_points
    counts = np.bincount(rays.point[made_up.rays.status == 0], minlength=len(made_up.block.points))
    point = int(np.flatnonzero(counts >= 4)[0])
    rows = rays_of(made_up.block, point)
    status, centre = made_up.rays.status.copy(), made_up.images.centre.copy()
    status[rows[2:]] = 2
    first, second = rays.image[rows[:2]]
    to_point = made_up.points.xyz[point] - centre[first]
    side = np.cross(to_point, [0.0, 0.0, 1.0])
    centre[second] = centre[first] + 0.02 * np.linalg.norm(to_point) * side / np.linalg.norm(side)
    thinned = made_up.points.rays.copy()
    thinned[point] = 2
    changed = replace(made_up, rays=replace(made_up.rays, status=status),
                      images=replace(made_up.images, centre=centre),
                      points=replace(made_up.points, rays=thinned))  # fmt: skip
    assert intersection_angles(changed)[point] == pytest.approx(np.arctan(0.02), rel=1e-6)
    found = {item.where: item for item in work_list(changed, WorkLimits(per_kind=99, items=999)).items}
    item = found[str(made_up.block.points[point])]
    assert item.kind == "point"
    assert item.what.startswith("2 rays meet at 1.1°")
    assert item.severity == pytest.approx(4.0 / np.degrees(np.arctan(0.02)), rel=1e-6)


def test_points_with_a_large_sigma(made_up):
    covariance = made_up.points.covariance.copy()
    covariance[20, 2, 2] *= 30.0**2
    changed = replace(made_up, points=replace(made_up.points, covariance=covariance))
    item = next(item for item in work_list(changed).items if item.kind == "point")
    assert item.where == str(made_up.block.points[20])
    assert "times the median" in item.what


def test_noisy_photograph(made_up):
    w = made_up.rays.w.copy()
    w[made_up.block.image_points.image == 9] *= 2.6
    item = next(i for i in work_list(replace(made_up, rays=replace(made_up.rays, w=w))).items if i.kind == "photograph")
    assert item.where == str(made_up.block.images.names[9])
    assert "residuals 2." in item.what
    assert item.hint.startswith("blurred")


def test_observed_position_that_contradicts(made_up):
    names = np.array(["projection centres"] * 2, dtype=object)
    observed = ObservationResults(
        names, np.array(["01_002", "01_003"], dtype=object), np.array(["X", "Z"], dtype=object),
        np.array([0.01, -1.3]), np.full(2, 0.05), np.full(2, 0.8), np.array([-0.2, 29.1]),
    )  # fmt: skip
    item = work_list(replace(made_up, observations=observed)).items[0]
    assert (item.priority, item.kind, item.where) == (1, "observation", "01_003")
    assert item.what == "projection centres Z: adjusted − observed -1.300 m, w +29.1"


def test_ties_are_counted(made_up):
    """Against the sets of points, photograph by photograph."""
    rays = made_up.block.image_points
    used = made_up.rays.status == 0
    sees = [set(rays.point[used & (rays.image == image)].tolist()) for image in range(18)]
    ties = photograph_ties(made_up, 10)
    for image in range(18):
        others = set().union(*(sees[other] for other in range(18) if other != image))
        assert ties.shared[image] == len(sees[image] & others)
        assert ties.strongest[image] == max(len(sees[image] & sees[other]) for other in range(18) if other != image)
        assert ties.strongest[image] == len(sees[image] & sees[ties.neighbour[image]])
    assert ties.cuts == ()


def test_parts_without_any_tie(made_up):
    rays = made_up.block.image_points
    alone = made_up.block.images.strip[rays.image] == "strip 1"
    shared = np.intersect1d(rays.point[alone], rays.point[~alone])
    status = made_up.rays.status.copy()
    status[alone & np.isin(rays.point, shared)] = 2
    changed = replace(made_up, rays=replace(made_up.rays, status=status))
    (cut,) = photograph_ties(changed, 1).cuts
    assert cut.common == 0
    assert set(cut.part.tolist()) == set(np.flatnonzero(made_up.block.images.strip == "strip 1").tolist())
    item = next(item for item in work_list(changed).items if item.kind == "part")
    assert item.priority == 1
    assert item.severity == np.inf


def test_lists_are_limited_and_counted(made_up):
    w = made_up.rays.w.copy()
    tie = ~np.isin(made_up.block.image_points.point, made_up.block.control.point)
    rows = np.flatnonzero(tie & (made_up.rays.status == 0))[::12][:40]
    w[rows, 0] = 50.0
    changed = replace(made_up, rays=replace(made_up.rays, w=w))
    work = work_list(changed, WorkLimits(per_kind=4, items=6))
    assert sum(item.kind == "ray" for item in work.items) == 4
    assert work.found["ray"] > 4
    assert work.unlisted == sum(work.found.values()) - len(work.items)
    order = [(item.priority, -item.severity) for item in work.items]
    assert order == sorted(order)
