"""Every setting of an adjustment, with its value and whether it is the default."""

from __future__ import annotations

from dataclasses import replace

from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.block.used_settings import AT_READING, NOT_LISTED, used_settings
from aerotri.public.block_settings import with_settings
from aerotri.reference.block_keys import block_keys
from small_blocks import small_block


def by_key(block):
    return {one.key: one for one in used_settings(block)}


def test_given_and_default():
    block, _ = small_block(5, "bluh:1-12")
    found = by_key(with_settings(block, robust="huber", gnss={"shift": "strip"}, t_limit=1.0))
    assert (found["adjustment.robust"].value, found["adjustment.robust"].origin) == ("huber", "given")
    assert (found["gnss.shift"].value, found["gnss.shift"].origin) == ("strip", "given")
    assert (found["adjustment.t_limit"].value, found["adjustment.t_limit"].origin) == (1.0, "default")
    assert found["adjustment.additional_parameters"].value == ["bluh:1-12"]
    assert found["adjustment.datum"].text == '"control"'


def test_a_block_written_and_read_has_the_same_settings(tmp_path):
    block, _ = small_block(5, "bluh:1-12")
    camera = block.cameras[0]
    interior = {name: replace(one, fixed=False, sigma=0.02) for name, one in camera.interior.items()}
    block = replace(block, cameras=(replace(camera, interior=interior),))
    write_block(block, tmp_path / "block")
    assert used_settings(read_block(tmp_path / "block")) == used_settings(block)
    own = by_key(block)[f"camera.{camera.name}.interior.focal_length_mm"]
    assert own.value == {"value": camera.interior["focal_length_mm"].value, "sigma": 0.02}
    assert (own.unit, own.origin) == ("mm", "given")


def test_every_key_of_the_documentation_is_there():
    """Keys outside the tables that users name are listed one by one."""
    block, _ = small_block(5, "none")
    listed = set(by_key(block))
    for one in block_keys():
        inside = one.name.split(".")[0] in (*NOT_LISTED, "camera", "rig") or one.name in AT_READING
        assert inside or one.name in listed, one.name
