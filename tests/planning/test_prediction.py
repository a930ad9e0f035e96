"""Predicted covariances against the adjustment of the same block; control against trying every candidate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.planning.covariance import joint_covariance
from aerotri.planning.expected_block import measured
from aerotri.planning.options import PlanOptions, Target, parse_target
from planned_flights import hill, planned

OPTIONS = PlanOptions(gsd=0.03, tie_points=60, forward_overlap=0.7, side_overlap=0.5)


@pytest.fixture(scope="module")
def plain():
    return planned(OPTIONS, wanted=5)


@pytest.mark.parametrize("calibration", ["none", "brown:K1+K2+P1+P2"])
def test_sigma_is_that_of_the_adjustment(calibration):
    """σ of the check points over σ̂0; they change by the noise of the measurements only in second order."""
    options = replace(OPTIONS, positions_sigma=(0.03, 0.05), self_calibration=calibration)
    found = planned(options, hill(), wanted=2)
    result = aerotri.adjust(measured(found.block, 3))
    assert result.status == "converged"
    row = {name: k for k, name in enumerate(result.points["point"].tolist())}
    names = found.block.points[found.expected.ground]
    own = [row[name] for name in names.tolist()]
    by_adjustment = np.column_stack([result.points[f"s{axis}"][own] for axis in "XYZ"]) / result.sigma0
    assert by_adjustment == pytest.approx(found.sigma, rel=0.02)


def test_parts_add_up(plain):
    own = np.diagonal(plain.own, axis1=1, axis2=2)
    assert plain.deformation**2 + own == pytest.approx(plain.sigma**2)
    assert (own > 0.0).all()


@pytest.mark.parametrize("text", ["asprs 0.001", "sigma-z 0.001", "sigma-volume 0.01"])
def test_control_is_where_it_helps_most(text):
    """Every candidate tried by a new factorisation: the plan took the best, and said what it gains."""
    target = parse_target(text)
    options = replace(OPTIONS, positions_sigma=(0.05, 0.08))
    found = planned(options, target=target, wanted=2)
    expected, area = found.expected, found.area.polygon.area
    chosen: list[int] = []
    for step in found.added:
        tried = [by_force(found, [*chosen, c], area, target) for c in range(len(expected.candidates))]
        names = expected.block.points[expected.candidates].tolist()
        best = names.index(step.name)
        assert tried[best] == pytest.approx(min(tried), rel=1e-7)
        assert step.after == pytest.approx(tried[best], rel=1e-6)
        assert step.before == pytest.approx(by_force(found, chosen, area, target), rel=1e-6)
        chosen.append(best)


def by_force(found, chosen, area, target):
    """The quantity of a target by a covariance of its own."""
    expected = found.expected
    block = expected.with_control(np.array(chosen, dtype=np.int64))
    q = joint_covariance(block, expected.xyz, expected.ground)
    z = np.diagonal(q)[2::3]
    if target.kind == "sigma-z":
        return np.quantile(np.sqrt(z), 0.95)
    if target.kind == "asprs":
        return max(np.sqrt(z.mean()), np.sqrt((np.diagonal(q)[::3] + np.diagonal(q)[1::3]).mean()))
    g = len(z)
    return area / g * np.sqrt(q[2::3, 2::3].sum() - found.own[:, 2, 2].sum())


def test_volume_has_what_heights_share():
    """At most the area times the largest shared σ; less with a control point."""
    options = replace(OPTIONS, positions_sigma=(0.03, 0.05))
    without, held = planned(options, wanted=0), planned(options, wanted=1, target=Target("sigma-volume", 1.0))
    for found in (without, held):
        assert 0.0 < found.volume_sigma < found.area.polygon.area * found.deformation[:, 2].max()
    assert held.volume_sigma < 0.7 * without.volume_sigma


def test_target_ends_the_adding():
    few = planned(OPTIONS, target=Target("sigma-z", 1.0))
    assert few.met
    assert len(few.added) == 4
    never = planned(OPTIONS, target=Target("sigma-z", 1e-6), wanted=6)
    assert never.met is False
    assert len(never.added) == 6
    after = [one.after for one in never.added[3:]]
    assert (np.diff(after) < 0.0).all()
    assert after[-1] == pytest.approx(never.judged, rel=1e-6)


def test_block_without_position_is_refused():
    with pytest.raises(aerotri.InputError, match="do not hold a block"):
        planned(OPTIONS, wanted=2)


@pytest.mark.parametrize(
    "text", ["", "asprs", "sigma-z -1", "sigma-z nan", "sigma-x 3", "asprs 0cm", "sigma-volume inf"]
)
def test_unknown_targets(text):
    with pytest.raises(aerotri.InputError, match="target"):
        parse_target(text)


def test_targets():
    assert parse_target("ASPRS 5cm") == Target("asprs", 0.05)
    assert parse_target("asprs 5-cm class".removesuffix(" class")) == Target("asprs", 0.05)
    assert parse_target("sigma-z 0.03") == Target("sigma-z", 0.03)
    assert parse_target("sigma-volume 20m3".removesuffix("m3")).unit == "m³"


def test_predicted_sigma_against_flights():
    """Errors of the ground points of 12 flights over their predicted σ, by coordinate and by quarter of the area.

    The points of a flight share their errors, so a flight counts as few independent numbers: for 12 flights the bound
    holds at four standard deviations of a single one.
    """
    found = planned(replace(OPTIONS, positions_sigma=(0.03, 0.05)), wanted=3)
    names = found.block.points[found.expected.ground].tolist()
    errors = []
    for seed in range(1, 13):
        result = aerotri.adjust(measured(found.block, seed))
        row = {name: k for k, name in enumerate(result.points["point"].tolist())}
        xyz = np.column_stack([result.points[axis] for axis in "XYZ"])[[row[name] for name in names]]
        errors.append((xyz - found.ground_points) / found.sigma)
    xy = found.ground_points[:, :2]
    quarter = (xy > np.median(xy, axis=0)) @ [1, 2]
    for q in range(4):
        rms = np.sqrt((np.array(errors)[:, quarter == q] ** 2).mean(axis=(0, 1)))
        assert (rms > 1.0 - 4.0 / np.sqrt(24)).all()
        assert (rms < 1.0 + 4.0 / np.sqrt(24)).all()
