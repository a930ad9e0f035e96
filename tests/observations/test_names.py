"""Names that do not meet: what is near, what is said before adjusting, and control renamed."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.commands.adjust import run_adjust
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.observations.block import Edits
from aerotri.observations.names import in_words, near_names, partnerless_in_words, prefix_of, with_control_prefix
from aerotri.pipeline import AdjustmentFailedError, adjust
from dense_algebra import TINY
from small_blocks import small_block


@pytest.mark.parametrize(
    ("name", "known", "near"),
    [
        ("1", ["GCP1", "GCP11", "T0001", "21"], ("GCP1", "T0001")),
        ("1", ["GCP 1", "GCP 2"], ("GCP 1",)),
        ("gcp1", ["GCP1"], ("GCP1",)),
        ("GCP 01", ["GCP1", "GCP10"], ("GCP1",)),
        ("007", ["7", "70"], ("7",)),
        ("A-12", ["a_12"], ("a_12",)),
        ("P1", ["P1_top", "P12"], ("P1_top",)),
        ("А1", ["A1"], ("A1",)),
        ("GCPO1", ["GCP01"], ("GCP01",)),
        ("P1", ["Ｐ１"], ("Ｐ１",)),
        ("photos/a.JPG", ["a.jpg", "b.jpg"], ("a.jpg",)),
        ("a", ["a.jpg", "b.jpg"], ("a.jpg",)),
        ("100", ["1000", "2100"], ()),
        ("x", [], ()),
    ],
)
def test_near_names(name, known, near):
    assert near_names([name], known)[name] == near


def test_near_names_among_a_million_tie_points():
    known = [f"T{k:07d}" for k in range(300_000)] + ["GCP17"]
    assert near_names(["17"], known)["17"][-1] in ("GCP17", "T0000017")
    assert "GCP17" in near_names(["17"], known)["17"]


def test_the_prefix_of_most():
    assert prefix_of(["1", "2", "3"], ["GCP 1", "GCP 2", "X3", "15"]) == "GCP "
    assert prefix_of(["1"], ["11", "21"]) is None


def test_characters_that_look_alike_are_named():
    assert "cyrillic capital letter a" in in_words(["А1"], ["A1"])


def named(block, rename):
    """The block with names that image points have changed, control apart from them."""
    names = block.points.astype(object)
    added, point = list(names), block.control.point.copy()
    for k in range(len(block.control)):
        new = rename(k)
        if new is not None:
            added.append(new)
            point[k] = len(added) - 1
    return replace(block, points=np.array(added, dtype=str), control=replace(block.control, point=point))


@pytest.fixture(scope="module")
def whole():
    return small_block(2, **TINY)[0]


def without_letters(block, k):
    """Of control points: check points have another letter."""
    if block.control.is_check[k]:
        return None
    return str(block.points[block.control.point[k]]).lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")


def point_of(block):
    """The first point of control, which is no check point."""
    assert not block.control.is_check[0]
    return block.control.point[0]


def test_a_name_that_nothing_else_has_met_comes_first():
    """The measured name of the missing control point, not the tie point that is a part of its name."""
    known = ["7", "8", "C1"]
    assert in_words(["C7"], known) == "'C7' (near: '7')"
    assert in_words(["C7"], known, ["C1"]) == "'C7' (near: 'C1', '7')"
    assert in_words(["c1"], ["C1", "C9"], ["C9"]) == "'c1' (near: 'C1')"


@pytest.mark.parametrize("new", ["{}7", "X{}"])
def test_renamed_control_is_near_its_measured_name(whole, new):
    """Names such as GCP… are built alike: what is measured and has no coordinates is what is meant."""
    chosen = int(np.flatnonzero(~whole.control.is_check)[0])
    name = str(whole.points[whole.control.point[chosen]])
    block = named(whole, lambda k: new.format(name) if k == chosen else None)
    assert f"(near: '{name}'" in " ".join(partnerless_in_words(block))


def test_control_without_any_partner_is_named(whole):
    block = named(whole, lambda k: without_letters(whole, k))
    with pytest.raises(AdjustmentFailedError) as failed:
        adjust(block)
    text = str(failed.value)
    first = str(whole.points[whole.control.point[~whole.control.is_check][0]])
    assert "control points have no image points" in text
    assert f"near: '{first}'" in text
    assert "--control-prefix" in text


def test_some_without_partner_are_a_warning_and_the_prefix_makes_them_meet(whole):
    chosen = int(np.flatnonzero(~whole.control.is_check)[0])
    block = named(whole, lambda k: without_letters(whole, k) if k == chosen else None)
    name = str(whole.points[whole.control.point[chosen]])
    found = adjust(block)
    assert any(f"near: '{name}'" in text for text in found.outcome.warnings)
    prefix = name[: len(name) - len(without_letters(whole, chosen))]
    met = with_control_prefix(block, prefix)
    assert partnerless_in_words(met) == ()
    assert met.points.tolist() == whole.points.tolist()
    np.testing.assert_array_equal(met.control.point, whole.control.point)
    assert not any("image points" in text for text in adjust(met).outcome.warnings)


def test_all_names_in_place_say_nothing(whole):
    assert partnerless_in_words(whole) == ()


def test_decisions_follow_the_new_name(whole):
    block = named(whole, lambda k: without_letters(whole, k))
    point = int(block.control.point[0])
    edits = Edits(np.array([-1]), np.array([point]), np.array(["off"]), np.array([""]))
    prefix = str(whole.points[point_of(whole)])[: -len(without_letters(whole, 0))]
    moved = with_control_prefix(replace(block, edits=edits), prefix)
    assert moved.edits is not None
    assert moved.points[moved.edits.point[0]] == whole.points[whole.control.point[0]]


@pytest.mark.parametrize("prefix", ["XX", "GCP"])
def test_a_prefix_that_meets_nothing_is_refused(whole, prefix):
    with pytest.raises(InputError, match="--control-prefix"):
        with_control_prefix(whole, prefix)


def test_on_the_command_line(whole, tmp_path):
    block = named(whole, lambda k: without_letters(whole, k))
    write_block(block, tmp_path / "block")
    prefix = str(whole.points[point_of(whole)])[: -len(without_letters(whole, 0))]
    assert run_adjust(tmp_path / "block", tmp_path / "none", None, None, None, False, True) == 1
    assert run_adjust(tmp_path / "block", tmp_path / "met", None, None, None, False, True, False, prefix) == 0
    content = json.loads((tmp_path / "met" / "adjustment.json").read_text())
    assert content["control_points"]["count"] == int((~whole.control.is_check).sum())
    again = read_block(tmp_path / "met" / "block")
    assert set(again.points[again.control.point]) == set(whole.points[whole.control.point])


def test_a_photograph_without_its_ending_is_near(whole, tmp_path):
    write_block(whole, tmp_path / "block")
    path = tmp_path / "block" / "image_points.csv"
    first = str(whole.images.names[0])
    lines = path.read_text().splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith(f"{first},"))
    lines[row] = lines[row].replace(f"{first},", f"photos/{first}.TIF,", 1)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=f"'{first}'") as refused:
        read_block(tmp_path / "block")
    assert "write it as there" in str(refused.value)
