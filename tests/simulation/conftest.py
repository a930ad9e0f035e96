"""Small specs that the tests of the simulation vary."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from aerotri.simulation import SimulationSpec, parse_spec

SMALL: dict[str, Any] = {
    "name": "small",
    "camera": {"cam": {"preset": "ultracam_d"}},
    "flight": {"gsd_m": 0.10, "strips": 3, "images_per_strip": 7, "end_lap": 0.6, "side_lap": 0.3},
    "tie_points": {"per_image": 60.0, "sigma_um": 2.0},
}


def merged(base: dict, change: dict) -> dict:
    """The nested tables with those of `change` laid over them; None removes a key."""
    out = copy.deepcopy(base)
    for key, value in change.items():
        if value is None:
            out.pop(key, None)
        elif isinstance(value, dict) and isinstance(out.get(key), dict):
            out[key] = merged(out[key], value)
        else:
            out[key] = value
    return out


@pytest.fixture
def small_tables():
    """The tables of the small spec with others laid over them."""
    return lambda change: merged(SMALL, change)


@pytest.fixture
def small_spec():
    """A spec of 21 photographs; tables given as keywords are laid over it."""

    def make(**tables) -> SimulationSpec:
        return parse_spec(merged(SMALL, tables))

    return make
