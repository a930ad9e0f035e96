"""One small adjusted block for all tests of the public package."""

from __future__ import annotations

import pytest

import aerotri


@pytest.fixture(scope="session")
def flight():
    return aerotri.simulate(aerotri.example_flight(), seed=1)


@pytest.fixture(scope="session")
def result(flight):
    return aerotri.adjust(flight.block, parameters="brown:K1+K2")
