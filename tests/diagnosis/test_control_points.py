"""What is wrong with control points and their marks is said before an adjustment, and by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.spatial

import aerotri
from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import start_values_at
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.solve import SolveOptions
from aerotri.adjustment.system import build_system
from aerotri.diagnosis.control_points import doubts_of_control
from aerotri.observations.block import Edits
from aerotri.pipeline.contradicting_marks import with_fitting_marks
from aerotri.statistics.summarise import count_observations
from ten_photographs import ten_photographs


@pytest.fixture(scope="module")
def ten():
    return ten_photographs(navigated=False)


def marked_often(block, fewest=4):
    """Rows of the marks of a control point with so many."""
    points = block.control.point[~block.control.is_check]
    rows = [np.flatnonzero(block.image_points.point == point) for point in points]
    return next(own for own in rows if len(own) >= fewest)


def with_mark_moved(block, row, px):
    xy = block.image_points.xy.copy()
    xy[row] += px * block.cameras[0].pixel_mm * np.array([0.6, 0.8])
    return replace(block, image_points=replace(block.image_points, xy=xy))


def with_heights(block, change):
    control = block.control
    xyz = control.xyz.copy()
    xyz[:, 2] = change(xyz[:, 2])
    return replace(block, control=replace(control, xyz=xyz))


def about_control(texts):
    return [text for text in texts if text.startswith(("control point", "the heights of all"))]


def test_a_mark_that_does_not_meet_the_others(ten):
    """Named with its photograph by check, at start values of a metre, and by adjust, where they are adjusted."""
    rows = marked_often(ten)
    image, point = (str(names[k]) for names, k in (
        (ten.images.names, ten.image_points.image[rows[1]]), (ten.points, ten.image_points.point[rows[1]]),
    ))  # fmt: skip
    for moved, texts in (
        (400.0, lambda block: aerotri.check(block).warnings),
        (40.0, lambda block: aerotri.adjust(aerotri.with_settings(block, robust="huber")).warnings),
    ):
        block = with_mark_moved(ten, rows[1], moved)
        (said,) = about_control(texts(block))
        assert f"control point {point}: its mark in {image} does not meet" in said
        assert "the rays pass one another at" in said
        assert about_control(texts(ten)) == []
        # once the operator has taken it out nothing is left to say
        off = Edits(ten.image_points.image[rows[1:2]], ten.image_points.point[rows[1:2]], np.array(["off"]),
                    np.array([""]))  # fmt: skip
        assert about_control(texts(replace(block, edits=off))) == []


def test_a_mark_far_off_is_left_out_of_a_robust_adjustment(ten):
    """Named, and the same as if the operator had taken it out."""
    row = marked_often(ten)[1]
    block = aerotri.with_settings(with_mark_moved(ten, row, 400.0), robust="huber")
    off = Edits(block.image_points.image[[row]], block.image_points.point[[row]], np.array(["off"]), np.array([""]))
    result, wanted = aerotri.adjust(block), aerotri.adjust(replace(block, edits=off))
    point, image = ten.points[ten.image_points.point[row]], ten.images.names[ten.image_points.image[row]]
    assert f"1 mark left out, far from where the other photographs see it: {point} in {image}" in result.warnings
    assert list(np.flatnonzero(np.asarray(result.rays["status"]) == "contradicting mark")) == [row]
    assert result.sigma0 == pytest.approx(wanted.sigma0, rel=1e-6)
    assert not any("left out" in text for text in aerotri.adjust(aerotri.with_settings(ten, robust="huber")).warnings)


def test_a_mark_that_fits_after_all_comes_back(ten):
    """Its photograph stood wrong at first."""
    prepared = prepare(aerotri.with_settings(ten, robust="huber"))
    status = prepared.ray_status.copy()
    status[marked_often(ten)[1]] = RayStatus.CONTRADICTING
    system, state = build_system(
        prepared.system.unknowns.block, start_values_at(prepared.system.unknowns, prepared.state), status
    )
    options = SolveOptions(robust="huber")
    left = replace(prepared, system=system, state=state, ray_status=status)
    redundancy = count_observations(system).redundancy
    system, solution = minimise_at_adjusted(system, state, redundancy, options)
    back, again = with_fitting_marks(replace(left, system=system), solution, options)
    assert again.status == "converged"
    assert (back.ray_status == prepared.ray_status).all()
    assert len(back.system.unknowns.rays.image) == len(system.unknowns.rays.image) + 1


def test_two_marks_do_not_tell_which_is_wrong(ten):
    """Both photographs are named, and by how many metres the rays pass."""
    rows = marked_often(ten)
    rays = ten.image_points
    keep = np.setdiff1d(np.arange(len(rays)), rows[2:])
    block = with_mark_moved(ten, rows[1], 500.0)
    rays = block.image_points
    block = replace(
        block, image_points=replace(rays, image=rays.image[keep], point=rays.point[keep], xy=rays.xy[keep],
                                    sigma=rays.sigma[keep]),
    )  # fmt: skip
    said = about_control(aerotri.check(block).warnings)
    names = ten.images.names[ten.image_points.image[rows[:2]]]
    assert len(said) == 1
    assert f"its marks in {names[0]} and {names[1]} do not meet: their rays pass one another at" in said[0]


def test_a_point_behind_a_camera(ten):
    """Marks on the wrong sides of two photographs: the rays meet above, if at all."""
    rows = marked_often(ten)[:2]
    keep = np.setdiff1d(np.arange(len(ten.image_points)), marked_often(ten)[2:])
    xy = ten.image_points.xy.copy()
    xy[rows] = xy[rows][::-1] * 1.2
    rays = replace(ten.image_points, xy=xy)
    block = replace(ten, image_points=replace(rays, image=rays.image[keep], point=rays.point[keep], xy=xy[keep],
                                              sigma=rays.sigma[keep]))  # fmt: skip
    (said,) = about_control(aerotri.check(block).warnings)
    assert "and it would lie behind" in said


def test_two_points_at_one_pixel(ten):
    rays, control = ten.image_points, ten.control
    first = int(np.flatnonzero(np.isin(rays.point, control.point))[0])
    other = int(next(point for point in control.point if point != rays.point[first]))
    has = (rays.image == rays.image[first]) & (rays.point == other)
    xy = np.where(has[:, None], rays.xy[first], rays.xy)
    added = replace(rays, xy=xy)
    if not has.any():
        added = replace(
            rays, image=np.append(rays.image, rays.image[first]), point=np.append(rays.point, other),
            xy=np.vstack([rays.xy, rays.xy[first]]), sigma=np.vstack([rays.sigma, rays.sigma[first]]),
        )  # fmt: skip
    (said,) = doubts_of_control(replace(ten, image_points=added))
    assert f"are marked at one place of {ten.images.names[rays.image[first]]} (0 px apart)" in said
    assert str(ten.points[other]) in said


def test_marks_of_all_photographs_are_searched_at_once(ten, monkeypatch):
    """One search for two marks at one place, whatever the number of photographs."""
    searches, tree = [], scipy.spatial.KDTree
    monkeypatch.setattr("scipy.spatial.KDTree", lambda places: searches.append(len(places)) or tree(places))
    assert doubts_of_control(ten) == ()
    assert searches == [int(np.isin(ten.image_points.point, ten.control.point).sum())]


def test_one_point_typed_twice(ten):
    control = ten.control
    xyz = control.xyz.copy()
    xyz[3] = xyz[1] + [0.0, 0.0, 0.5]
    (said,) = doubts_of_control(replace(ten, control=replace(control, xyz=xyz)))
    names = {str(name) for name in ten.points[control.point[[1, 3]]]}
    assert names <= set(said.replace(",", " ").split())
    assert "have the same X and Y and heights 0.5 m apart: is one point there twice?" in said


def test_heights_of_zero_are_asked_about(ten):
    (said,) = doubts_of_control(with_heights(ten, np.zeros_like))
    assert said.startswith(f"the heights of all {len(ten.control)} control points are 0: were they surveyed?")
    assert doubts_of_control(with_heights(ten, lambda z: np.where(np.arange(len(z)) == 0, 0.0, z))) == ()
