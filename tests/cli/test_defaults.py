"""The command line and the Python package mean the same where nothing is said."""

from __future__ import annotations

from inspect import Parameter, signature

import pytest

import aerotri
from aerotri.cli import adjusting, blocks, change, converting, ortho, run, terrain, volumes
from aerotri.public.simulating import SimulatedBlock

NOTHING = (None, "", (), [], "auto")
PAIRS = {
    "simulate": (blocks.simulate, SimulatedBlock.save),
    "seed of simulate": (blocks.simulate, aerotri.simulate),
    "convert": (converting.convert, aerotri.read),
    "tiepoints": (converting.tiepoints, aerotri.tie_points),
    "compare-parameters": (adjusting.compare_parameters, aerotri.compare_parameters),
    "dtm": (terrain.dtm, aerotri.terrain),
    "ortho": (ortho.ortho, aerotri.orthophoto),
    "dsm": (terrain.dsm, aerotri.dense_surface),
    "change": (change.change, aerotri.change),
    "volume": (volumes.volume, aerotri.volume),
    "predict volume": (volumes.predict_volume, aerotri.predict.volume),
    "predict attitude": (volumes.predict_attitude, aerotri.predict.attitude),
    "predict picket-interval": (terrain.predict_picket_interval, aerotri.predict.picket_interval),
    "run": (run.run, aerotri.run),
    "adjust": (adjusting.adjust, aerotri.adjust),
    "check": (blocks.check, aerotri.check),
}


@pytest.mark.parametrize("name", PAIRS)
def test_defaults_are_those_of_the_function(name):
    command, function = (signature(one).parameters for one in PAIRS[name])
    common = [
        key
        for key in command
        if key in function and Parameter.empty not in (command[key].default, function[key].default)
    ]
    assert common
    for key in common:
        stated = [one[key].default for one in (command, function)]
        assert stated[0] == stated[1] or all(value in NOTHING for value in stated), (key, stated)
