"""A block in parts of which one is missing is not adjusted as if it were whole."""

from __future__ import annotations

import pytest

from aerotri.conventions import InputError
from aerotri.partition.part_list import part_folders, write_part_list


@pytest.fixture
def in_parts(tmp_path):
    """Folders of three parts, and their list."""
    for name in ("0000", "0001", "0002"):
        (tmp_path / "parts" / name).mkdir(parents=True)
        (tmp_path / "parts" / name / "block.toml").touch()
    write_part_list(tmp_path)
    return tmp_path


def test_all_parts_are_found_in_order(in_parts):
    assert [part.name for part in part_folders(in_parts)] == ["0000", "0001", "0002"]


def test_a_missing_part_is_named(in_parts):
    (in_parts / "parts" / "0001").rename(in_parts / "elsewhere")
    with pytest.raises(InputError, match="1 of 3 parts missing: 0001 — put it back"):
        part_folders(in_parts)


def test_a_part_without_its_file_is_named(in_parts):
    (in_parts / "parts" / "0002" / "block.toml").unlink()
    with pytest.raises(InputError, match=r"part 0002 has no block\.toml"):
        part_folders(in_parts)


def test_a_part_of_another_block_is_named(in_parts):
    (in_parts / "parts" / "0000").rename(in_parts / "parts" / "0007")
    (in_parts / "parts" / "0000").mkdir()
    (in_parts / "parts" / "0000" / "block.toml").touch()
    with pytest.raises(InputError, match=r"parts that parts\.json does not list: 0007"):
        part_folders(in_parts)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"parts": 3}'])
def test_a_damaged_list_is_told(in_parts, text):
    (in_parts / "parts.json").write_text(text)
    with pytest.raises(InputError, match="list of parts"):
        part_folders(in_parts)


def test_parts_made_by_hand_need_no_list(in_parts):
    (in_parts / "parts.json").unlink()
    assert len(part_folders(in_parts)) == 3
