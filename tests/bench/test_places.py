"""Where the bench finds what it shows, and keeps what is decided."""

from __future__ import annotations

import json
import shutil

import pytest

from aerotri.bench.places import photographs_beside, places_of
from aerotri.conventions import InputError


def test_result_keeps_its_own_block_and_the_bench_gets_a_copy(result):
    places = places_of(result)
    assert places.result == result
    assert places.block == result.parent / "small_bench" / "block"
    assert places.readable_block == result / "block"
    places.keep_block()
    assert places.readable_block == places.block
    assert (places.block / "image_points.csv").read_bytes() == (result / "block" / "image_points.csv").read_bytes()
    assert places.next_result() == places.bench / "result_001"


def test_last_result_of_the_bench_is_taken_up(result):
    places_of(result).keep_block()
    for name in ("result_002", "result_010"):
        shutil.copytree(result, result.parent / "small_bench" / name)
    again = places_of(result)
    assert again.result == result.parent / "small_bench" / "result_010"
    assert again.next_result().name == "result_011"
    own = places_of(again.result)
    assert (own.bench, own.block, own.result) == (again.bench, again.block, again.result)


def test_block_is_edited_itself_and_shows_the_result_beside_it(result):
    block = shutil.copytree(result / "block", result.parent / "small")
    for given in (block, block / "block.toml"):
        places = places_of(given)
        assert (places.block, places.result) == (block, result)
    shutil.rmtree(result)
    assert places_of(block).result is None


def test_folder_that_is_neither_is_told(tmp_path):
    with pytest.raises(InputError, match="neither a result nor a block"):
        places_of(tmp_path)


@pytest.mark.parametrize("content", [None, "no json", "[]", '{"source": 3}', '{"source": "/no/such/folder"}'])
def test_photographs_of_a_run_that_are_not_there(tmp_path, content):
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    assert photographs_beside(tmp_path / "result") is None


def test_photographs_of_a_run(tmp_path):
    (tmp_path / "photographs").mkdir()
    (tmp_path / "run.json").write_text(json.dumps({"source": str(tmp_path / "photographs")}))
    assert photographs_beside(tmp_path / "block") == tmp_path / "photographs"
    (tmp_path / "photographs" / "block.toml").write_text("")
    assert photographs_beside(tmp_path / "block") is None
