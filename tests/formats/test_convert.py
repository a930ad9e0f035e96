"""Formats are found out from what lies there, and every one that is written is read again."""

from __future__ import annotations

import numpy as np
import pytest
from format_samples import assert_same_block

from aerotri.conventions import InputError
from aerotri.formats.convert import detect_format, read_any, write_any


def test_formats_are_recognised(shared_data, small_block, tmp_path):
    folder = small_block()
    assert detect_format(folder) == "block"
    assert detect_format(folder / "block.toml") == "block"
    assert detect_format(shared_data("dbat_sxb")) == "dbat"
    assert detect_format(shared_data("dbat_roma") / "romabundledemo.xml") == "dbat"
    bal = shared_data("bal") / "problem-49-7776-pre.txt"
    assert detect_format(bal) == "bal"
    block, points = read_any(bal)
    write_any(block, tmp_path / "model", "colmap", points)
    assert detect_format(tmp_path / "model") == "colmap"


def test_unknown_things(small_block, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        detect_format(tmp_path / "nothing")
    with pytest.raises(InputError, match="of no known format"):
        read_any(small_block() / "images.csv")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="of no known format"):
        read_any(tmp_path / "empty")
    with pytest.raises(InputError, match="not a format that is read"):
        read_any(small_block(), "bingo")
    block, _ = read_any(small_block())
    with pytest.raises(InputError, match="not a format that is written"):
        write_any(block, tmp_path / "out", "dbat")
    with pytest.raises(InputError, match="needs object points"):
        write_any(block, tmp_path / "out", "bal")


def test_there_and_back(shared_data, tmp_path):
    block, points = read_any(shared_data("bal") / "problem-16-22106-pre.txt")
    assert points is not None
    assert write_any(block, tmp_path / "block") == ()
    assert_same_block(read_any(tmp_path / "block")[0], block)
    assert write_any(block, tmp_path / "again.txt", "bal", points) == ()
    again, same = read_any(tmp_path / "again.txt")
    np.testing.assert_array_equal(same, points)
    np.testing.assert_array_equal(again.image_points.xy, block.image_points.xy)
