"""An adjustment behind the page: what goes wrong is told, a stopped one leaves nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.bench.worker import _started
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block


def test_block_that_cannot_be_read_is_told_and_the_result_stays(client, bench):
    bench.places.keep_block()
    (bench.places.block / "edits.csv").write_text("image,point,action\nno such photograph,p,off\n")
    client.post("act/adjust")
    bench.wait()
    state = client.get("data/state").json()
    assert "edits.csv:2" in state["job"]["error"]
    assert state["generation"] == 1
    assert not list(bench.places.bench.glob("result_*"))


def test_stopped_adjustment_leaves_nothing(client, bench):
    client.post("act/adjust")
    refused = client.post("act/adjust")
    assert "running already" in refused.json()["error"]
    client.post("act/stop")
    bench.wait()
    state = client.get("data/state").json()
    assert (state["job"]["running"], state["job"]["error"], state["generation"]) == (False, "stopped", 1)
    assert [one.name for one in bench.places.bench.iterdir()] == ["block"]


def test_adjustment_starts_from_the_result_before(result):
    block = read_block(result / "block")
    shifted = replace(block, images=replace(block.images, centre=block.images.centre + 50.0))
    begun = _started(shifted, result)
    assert np.abs(begun.images.centre - block.images.centre).max() < 10.0
    assert _started(shifted, None) is shifted
    held = replace(shifted.settings, adjustment=replace(shifted.settings.adjustment, datum="fixed"))
    fixed = replace(shifted, settings=held)
    assert _started(fixed, result) is fixed
    named = replace(shifted, images=replace(shifted.images, names=np.char.add(shifted.images.names.astype(str), "x")))
    assert _started(named, result) is named


def test_difference_asks_for_an_adjustment_first(bench):
    with pytest.raises(InputError, match="nothing was adjusted here yet"):
        bench.difference()
