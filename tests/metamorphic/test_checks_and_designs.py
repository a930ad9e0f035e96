"""Crosscheck, simulate, predict and parameters: other rows, names and units, and what is found is the same."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from transformations import about_z, both, moved, permuted, renamed, same

from aerotri.commands.parameters import run_parameters
from aerotri.commands.predict import AttitudeDesign, run_predict_attitude, run_predict_volume
from aerotri.commands.predict_interval import IntervalQuestion, run_predict_interval
from aerotri.crosscheck import crosscheck
from aerotri.functional_model import additional_parameters
from aerotri.functional_model.additional_parameters import FAMILIES, description, registry
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES, default_items, parameter_set
from aerotri.pipeline import adjust
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.designs import VolumeDesign
from small_blocks import small_block, small_spec

ROWS = both(permuted(6), renamed)
FRAME = both(permuted(7), moved(about_z(37.0), [300.5, -200.25, 64.0]))
PEER = 1e-5
"""σ. The peers stop by criteria of their own, some 1e-6 σ away, by other steps for other rows; the limit is 0.05 σ."""


@pytest.mark.parametrize("change", [ROWS, FRAME], ids=["rows and names", "frame"])
def test_crosscheck(change, checked):
    block, before = checked
    after = crosscheck(adjust(change(block).block), adjust)
    assert after.verdict == before.verdict == "agrees"
    for one, other in zip(before.checks, after.checks, strict=True):
        for name in ("peer", "status", "observations", "unknowns"):
            assert getattr(other, name) == getattr(one, name), name
        assert other.vtpv == pytest.approx(one.vtpv, rel=1e-9)
        assert other.vtpv_peer == pytest.approx(one.vtpv_peer, rel=1e-8)
        assert {d.kind: d.count for d in other.differences} == {d.kind: d.count for d in one.differences}
        largest = {d.kind: d.max for d in one.differences}
        for d in other.differences:
            assert abs(d.max - largest[d.kind]) < PEER, (one.peer, d.kind)


@pytest.fixture(scope="module")
def checked():
    block = same(small_block(3, "bluh:1-4")[0]).block
    return block, crosscheck(adjust(block), adjust)


EVERYTHING = {
    "gnss": {"sigma_m": [0.05, 0.05, 0.05], "shift_sigma_m": [0.1, 0.1, 0.1]},
    "gross_errors": {"fraction": 0.02},
}


def arrays(record):
    """All numbers of a record and of the records in it, by place."""
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            yield field.name, value
        elif hasattr(value, "__dataclass_fields__"):
            yield from ((f"{field.name}.{inner}", a) for inner, a in arrays(value))


def assert_same_numbers(one, other):
    for (name, a), (_, b) in zip(arrays(one), arrays(other), strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


def test_simulate_camera_by_another_name():
    """Errors that are stated belong to the camera whatever its name; those that are drawn are drawn by its name, so
    that a further camera does not change what the others have, and are not tested here."""
    errors = {"parameters": {"bluh.1": 1e-5}, "brown": {"K1": 1e-9}, "interior": {"focal_length_mm": 0.01}}
    found = [
        simulate(parse_spec(small_spec(camera={name: {"preset": "ultracam_d", "errors": errors}}, **EVERYTHING)), 5)
        for name in ("ucd", "Kamera 東")
    ]
    for one, other in zip(*found, strict=True):
        assert_same_numbers(one, other)
    one, other = (block for block, _ in found)
    assert other.cameras[0].name == "Kamera 東"
    assert replace(other.cameras[0], name="ucd") == one.cameras[0]
    assert other.points.tolist() == one.points.tolist()
    assert other.images.names.tolist() == one.images.names.tolist()


def test_simulate_tables_in_any_order():
    """The tables of a plan and the keys in them, last first."""

    def turned_round(value):
        return {k: turned_round(v) for k, v in reversed(value.items())} if isinstance(value, dict) else value

    plan = small_spec(**EVERYTHING)
    found = [simulate(parse_spec(tables), 5) for tables in (plan, turned_round(plan))]
    for one, other in zip(*found, strict=True):
        assert_same_numbers(one, other)


def printed(capsys, call):
    capsys.readouterr()
    call()
    return json.loads(capsys.readouterr().out)


def test_predicted_volume_in_another_unit(capsys):
    """A design in feet, as it were: σ in feet, volumes in cubic feet; a power of two, so that nothing is rounded."""
    design, times = VolumeDesign(1500.0, 7200.0, 1800.0, 3600.0), 4.0
    large = VolumeDesign(*(times * v for v in (1500.0, 7200.0, 1800.0, 3600.0)))
    one, other = (printed(capsys, lambda d=d: run_predict_volume(d, False, 1, True)) for d in (design, large))
    assert other["area_m2"] == pytest.approx(times**2 * one["area_m2"], rel=1e-12)
    assert other["sigma0_m"] == pytest.approx(times * one["sigma0_m"], rel=1e-12)
    for a, b in zip(one["predictions"], other["predictions"], strict=True):
        assert b["sigma_mean_height_m"] == pytest.approx(times * a["sigma_mean_height_m"], rel=1e-12)
        assert b["sigma_volume_m3"] == pytest.approx(times**3 * a["sigma_volume_m3"], rel=1e-12)


@pytest.mark.parametrize("focal", [1.0, 3.0])
def test_attitude_in_another_unit(capsys, focal):
    """Metres times 4, and the camera by itself times 1 or 3: the angles that are allowed are the same."""
    designs = (
        AttitudeDesign(t * 1500.0, t * 900.0, f * 153.0, (t * 400.0, t * 300.0), (t * 100.0, t * 50.0), t * 5.0, 1.0)
        for t, f in ((1.0, 1.0), (4.0, focal))
    )
    one, other = (printed(capsys, lambda d=d: run_predict_attitude(d, True)) for d in designs)
    assert other["tolerance_m3"] == pytest.approx(64.0 * one["tolerance_m3"], rel=1e-12)
    for angle, allowed in one["angles"].items():
        for name, value in allowed.items():
            # None: any σ will do
            expected = None if value is None else pytest.approx(value, rel=1e-9)
            assert other["angles"][angle][name] == expected, (angle, name)


def test_picket_interval_in_another_unit(capsys):
    """The interval goes with √GSD, the older rule with the GSD; scan and scale say what the GSD says."""
    questions = (
        IntervalQuestion(gsd=0.25), IntervalQuestion(gsd=1.0), IntervalQuestion(scan_um=25.0, scale=10000.0)
    )  # fmt: skip
    one, four, scanned = (printed(capsys, lambda q=q: run_predict_interval(q, True)) for q in questions)
    assert four["older_rule_m"] == pytest.approx(4.0 * one["older_rule_m"], rel=1e-12)
    for kind, found in one["interval_m"].items():
        assert four["interval_m"][kind] == pytest.approx([2.0 * v for v in found], rel=1e-12)
        assert scanned["interval_m"][kind] == pytest.approx(found, rel=1e-12)


def listed(capsys, family=None):
    capsys.readouterr()
    run_parameters(None, family, True)
    return json.loads(capsys.readouterr().out)


def test_families_listed_in_any_order(capsys, monkeypatch):
    """The families last first, and one by one: the same lines of every family."""
    lines = listed(capsys)
    names = list(dict.fromkeys(line["family"] for line in lines))
    assert len(names) == len(FAMILIES) > 10
    by_family = {name: [line for line in lines if line["family"] == name] for name in names}
    assert {name: listed(capsys, name) for name in reversed(names)} == by_family
    turned = dict(reversed(FAMILIES.items()))
    for module in (additional_parameters, description, registry):
        monkeypatch.setattr(module, "FAMILIES", turned)
    assert listed(capsys) == [line for name in reversed(names) for line in by_family[name]]


def test_families_drawn_in_any_order(capsys, monkeypatch, tmp_path):
    """Each picture is the same whichever was drawn before it."""
    few = {name: FAMILIES[name] for name in ("ebner", "gruen")}
    for name in few:
        run_parameters(tmp_path / "one", name, True)
    for module in (additional_parameters, description, registry):
        monkeypatch.setattr(module, "FAMILIES", dict(reversed(few.items())))
    run_parameters(tmp_path / "other", None, True)
    one, other = ({p.name: p.read_bytes() for p in (tmp_path / f).iterdir()} for f in ("one", "other"))
    assert len(one) >= 2
    assert other == one
    capsys.readouterr()


def test_patterns_of_items_in_any_order():
    """Items of a set in another order, or named twice, are the same set with the same patterns."""
    camera = small_block(3)[0].cameras[0]
    xy = np.random.default_rng(1).uniform(-30.0, 30.0, (40, 2))
    for family in LINEAR_FAMILIES:
        if not LINEAR_FAMILIES[family].fits(camera):
            continue
        items = default_items(family)
        one, other = parameter_set(family, items, camera), parameter_set(family, (*items[::-1], *items[:2]), camera)
        assert one.items == other.items
        np.testing.assert_array_equal(one.basis(*xy.T), other.basis(*xy.T))
        # a part of the items has the same patterns as within the whole, but where parameters share one pattern
        if not LINEAR_FAMILIES[family].is_grid:
            few = parameter_set(family, items[1:6][::-1], camera)
            rows = [one.items.index(item) for item in few.items]
            np.testing.assert_array_equal(few.basis(*xy.T), one.basis(*xy.T)[:, :, rows])
