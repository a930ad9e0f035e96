"""The model part of σ of a block in parts against that of the same block in one piece."""

import csv
import json
from dataclasses import replace

import killed_parts
import numpy as np
import pytest

import aerotri
from aerotri.adjustment import adjusted_positions, stopping
from aerotri.partition import course, joints, model_part, side_solver
from aerotri.partition.model_part import _median
from aerotri.simulation import parse_spec, simulate
from aerotri.statistics.cluster_test import SAMPLED_FROM, keys, thinned
from gis_blocks import in_crs
from small_blocks import with_adjustment
from statistics_blocks import DRONE, FLIGHT, drone_block, few_strips, with_changing_strips

UTM = (360000.0, 5450000.0, 0.0)


@pytest.fixture
def to_rounding(monkeypatch):
    """Both ways end where only rounding is left, so that their numbers can be compared."""
    for place, name, value in (
        (stopping, "STEP_TOLERANCE", 1e-7), (stopping, "ROUNDING", 0.0), (adjusted_positions, "MOST_ROUNDS", 20),
        (adjusted_positions, "STANDING", 1e-10), (adjusted_positions, "MOST_STEPS", 30),
        (adjusted_positions, "SETTLED", 1e-12), (course, "MOST_ROUNDS", 20), (course, "STANDING", 1e-10),
    ):  # fmt: skip
        monkeypatch.setattr(place, name, value)


def with_positions(seed=1):
    """Strips that err, with GNSS shifts, parameters, and more coordinates of control than columns are solved for."""
    spec = DRONE | {
        "flight": FLIGHT | {"strips": 6}, "gnss": {"sigma_m": [0.03, 0.03, 0.05], "shift_sigma_m": [0.1, 0.1, 0.1]},
        "control": {"distance_bases": 2.0, "sigma_m": [0.01, 0.01, 0.02], "check_points": 4},
    }  # fmt: skip
    block = with_changing_strips(simulate(parse_spec(spec), seed)[0], seed, 3.0)
    block = replace(block, settings=replace(block.settings, gnss=replace(block.settings.gnss, shift="strip")))
    return aerotri.with_settings(block, parameters="brown:K1+K2+P1+P2")


def without_control():
    """Strips that err, held by observed positions alone: nothing is known of points or parameters beforehand."""
    spec = DRONE | {"flight": FLIGHT | {"strips": 6}, "gnss": {"sigma_m": [0.03, 0.03, 0.05]}}
    block = with_changing_strips(simulate(parse_spec(spec), 2)[0], 2, 3.0)
    return aerotri.with_settings(replace(block, control=block.control.empty()), parameters="none")


def rows_of(path, key):
    with open(path, encoding="utf-8") as file:
        return {row[key]: row for row in csv.DictReader(file)}


def both(block, parts, place, **how):
    """The model part in one piece and in parts; results in folders `one` and `parts`."""
    one = aerotri.adjust(block, explain=False)
    one.save(place / "one", plots=False)
    aerotri.divide(block, place / "block", parts=parts)
    found = aerotri.adjust_parts(place / "block", place / "parts", plots=False, **how)
    return one.adjusted.model_part, found.record.record.model_part


def largest_difference(place, kind):
    """Of σ (kind s), model part (m) and total σ (t) of photographs, points and parameters, over the total σ."""
    worst = 0.0
    for table, key, axes in (
        ("images.csv", "image", ("X0", "Y0", "Z0", "_omega", "_phi", "_kappa")), ("points.csv", "point", "XYZ"),
    ):  # fmt: skip
        one, seen = rows_of(place / "one" / table, key), set()
        for part in (place / "parts" / "parts").iterdir():
            for name, row in rows_of(part / table, key).items():
                seen.add(name)
                for axis in axes:
                    apart = float(row[f"{kind}{axis}"]) - float(one[name][f"{kind}{axis}"])
                    worst = max(worst, abs(apart) / float(one[name][f"t{axis}"]))
        assert seen == set(one)
    return worst


BLOCKS = {
    "groups": (lambda: drone_block(1, 2.0)[0], 3, "groups"),
    "more parts": (lambda: drone_block(2, 2.0)[0], 6, "groups"),
    "few strips": (lambda: few_strips(1, 2.0)[0], 3, "field"),
    "GNSS, control and parameters known beforehand": (with_positions, 4, "groups"),
    "positions alone": (without_control, 3, "groups"),
}


@pytest.mark.parametrize("which", list(BLOCKS))
def test_numbers_are_those_of_one_piece(which, tmp_path, to_rounding):
    make, parts, method = BLOCKS[which]
    one, found = both(make(), parts, tmp_path)
    assert one.method == found.method == method
    assert (one.scheme, one.clusters) == (found.scheme, found.clusters)
    assert [test.scheme for test in one.tests] == [test.scheme for test in found.tests]
    for first, second in zip(one.tests, found.tests, strict=True):
        assert (first.clusters, first.freedom, first.counts, first.reason) == (
            second.clusters, second.freedom, second.counts, second.reason
        )  # fmt: skip
        assert second.ratio == pytest.approx(first.ratio, rel=1e-7, nan_ok=True)
        assert second.ratio_random == pytest.approx(first.ratio_random, rel=1e-7, nan_ok=True)
        assert second.field_um == pytest.approx(first.field_um, rel=1e-9, nan_ok=True)
    assert found.ratio_plan == pytest.approx(one.ratio_plan, rel=1e-9)
    assert found.ratio_height == pytest.approx(one.ratio_height, rel=1e-9)
    assert found.ratio_plan > 1.1
    # one piece takes it that the scores of all groups add up to nothing, as they do but for rounding
    assert largest_difference(tmp_path, "t") < 2e-9
    assert largest_difference(tmp_path, "m") < 1e-8
    whole, parts_of = (rows_of(tmp_path / place / "parameters.csv", "name") for place in ("one", "parts"))
    for name, row in whole.items():
        assert float(parts_of[name]["total_sigma"]) == pytest.approx(float(row["total_sigma"]), rel=1e-8)
    expected, said = (
        json.loads((tmp_path / place / "adjustment.json").read_text(encoding="utf-8")) for place in ("one", "parts")
    )
    # neighbouring GNSS positions, and control points with one another, are not compared in parts
    left = ("GNSS positions of", "σ may be too small at the control points")
    assert said["warnings"] == [text for text in expected["warnings"] if not text.startswith(left)]
    assert any("total σ (tX, tY, tZ)" in text for text in said["warnings"])


def test_noise_alone_has_no_model_part(tmp_path, to_rounding):
    one, found = both(drone_block(3)[0], 3, tmp_path)
    assert (found.scheme, found.reason) == ("", one.reason)
    assert found.tests[0].ratio == pytest.approx(one.tests[0].ratio, rel=1e-7)
    table = next((tmp_path / "parts" / "parts").iterdir()) / "points.csv"
    assert "tX" not in next(iter(rows_of(table, "point").values()))


def test_in_a_coordinate_system(tmp_path, to_rounding):
    one, found = both(in_crs(drone_block(1, 2.0)[0], "EPSG:25832", UTM), 3, tmp_path)
    assert one.scheme == found.scheme == "strip"
    assert largest_difference(tmp_path, "t") < 1e-8


def test_weights_of_rays_are_those_of_the_adjustment(tmp_path, to_rounding):
    block, _ = drone_block(1, 2.0)
    rays = block.image_points
    xy = rays.xy.copy()
    xy[np.random.default_rng(3).choice(len(xy), 40, replace=False)] += 0.03
    block = with_adjustment(replace(block, image_points=replace(rays, xy=xy)), robust="huber")
    one, found = both(block, 3, tmp_path)
    assert one.scheme == found.scheme == "strip"
    assert found.ratio_height == pytest.approx(one.ratio_height, rel=1e-5)


@pytest.mark.parametrize(("which", "executor"), [("groups", "processes:2"), ("few strips", "processes:2")])
def test_a_worker_killed_in_mid_run_changes_nothing(which, executor, tmp_path, monkeypatch):
    """Of every kind of task of the model part one is killed, in the same run."""
    make, parts, _ = BLOCKS[which]
    aerotri.divide(make(), tmp_path / "block", parts=parts)
    aerotri.adjust_parts(tmp_path / "block", tmp_path / "threads", plots=False)
    marks = tmp_path / "marks"
    marks.mkdir()
    monkeypatch.setenv(killed_parts.MARKS, str(marks))
    killed = {**killed_parts.OF_TESTS, **(killed_parts.OF_GROUPS if which == "groups" else killed_parts.OF_FIELDS)}
    for name, function in killed.items():
        place = next(module for module in (model_part, side_solver, course, joints) if hasattr(module, name))
        monkeypatch.setattr(place, name, function)
    aerotri.adjust_parts(tmp_path / "block", tmp_path / "killed", executor=executor, plots=False)
    assert {path.name for path in marks.iterdir()} == set(killed)
    for path in sorted((tmp_path / "threads").rglob("*.csv")):
        assert (tmp_path / "killed" / path.relative_to(tmp_path / "threads")).read_bytes() == path.read_bytes()


def test_nothing_is_computed_where_it_is_switched_off(tmp_path):
    block = with_adjustment(drone_block(1, 2.0)[0], model_part="off")
    aerotri.divide(block, tmp_path / "block", parts=2)
    found = aerotri.adjust_parts(tmp_path / "block", tmp_path / "parts", plots=False)
    assert found.record.record.model_part.reason == "switched off"
    assert found.warnings == ()


def test_points_are_thinned_alike_however_they_are_divided():
    names = np.array([f"P{k}" for k in range(3 * SAMPLED_FROM)])
    whole = set(names[thinned(names)])
    assert len(whole) == SAMPLED_FROM
    parts = np.array_split(np.random.default_rng(1).permutation(names), 4)
    told = np.concatenate([part[thinned(part)] for part in parts])
    assert set(told[np.argsort(keys(told))[:SAMPLED_FROM]]) == whole


def test_median_of_values_that_occur_several_times():
    rng = np.random.default_rng(2)
    for count in (7, 8):
        values = [np.unique(rng.integers(0, 5, count), return_counts=True) for _ in range(3)]
        all_of_them = np.concatenate([np.repeat(*one) for one in values])
        assert _median([one[0] for one in values], [one[1] for one in values]) == np.median(all_of_them)
