"""The dome of Mount St. Helens against 2000-09-25: all methods agree; σ from the ground that did not grow."""

from __future__ import annotations

import importlib

import pytest

from places import PROJECT


@pytest.fixture(scope="module")
def tool():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "prove"))
        yield importlib.import_module("volume_st_helens")


def test_three_epochs(shared_data, tool):
    shared_data("st_helens")
    nets = []
    for name in tool.EPOCHS:
        volumes, _, area, (sigma, *_) = tool.epoch(name)
        nets.append(volumes.chosen.net)
        for one in volumes.by_method:
            assert one.net == pytest.approx(volumes.chosen.net, rel=0.002)
        assert volumes.chosen.no_data_area == 0.0
        assert 0.01 < sigma * area / volumes.chosen.net < 0.08
    # the difference of the cells summed up by hand: 10 m cells
    assert nets == pytest.approx([5.494e6, 1.371e7, 3.719e7], rel=1e-3)
