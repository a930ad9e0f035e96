"""One small adjusted block for all tests of the public package."""

from __future__ import annotations

import pytest
from photographed import PLAN

import aerotri


@pytest.fixture(scope="session")
def flight():
    return aerotri.simulate(aerotri.example_flight(), seed=1)


@pytest.fixture(scope="session")
def result(flight):
    return aerotri.adjust(flight.block, parameters="brown:K1+K2")


@pytest.fixture(scope="session")
def measured(tmp_path_factory):
    """The photographs of a tiny flight, its adjustment, its terrain model, and where the latter is saved."""
    folder = tmp_path_factory.mktemp("terrain")
    flight = aerotri.simulate(PLAN, seed=3)
    flight.save(folder / "flown", photographs=True)
    result = aerotri.adjust(flight.block, parameters="bluh:1-2")
    model = aerotri.terrain(result, folder / "flown" / "photographs", interval=20.0, pairs=True)
    return folder / "flown" / "photographs", result, model, model.save(folder / "dtm")
