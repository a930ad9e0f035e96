"""A small adjusted block to open the bench with."""

from __future__ import annotations

import shutil

import pytest

import aerotri
from small_blocks import small_block

TOKEN = "the-token"


@pytest.fixture(scope="session")
def small_result(tmp_path_factory):
    """The folder of a small adjusted block, never written to."""
    block, _ = small_block(seed=4)
    return aerotri.adjust(block).save(tmp_path_factory.mktemp("bench") / "small_result", plots=False)


@pytest.fixture
def result(small_result, tmp_path):
    """A copy of it to work on."""
    return shutil.copytree(small_result, tmp_path / "small_result")


@pytest.fixture
def bench(result):
    """The bench of the result."""
    from aerotri.bench.places import places_of
    from aerotri.bench.session import Bench

    made = Bench(places_of(result))
    made.wait()
    yield made
    made.stop()
    made.wait()


@pytest.fixture
def client(bench):
    """A client that asks as a browser of this machine does."""
    pytest.importorskip("starlette", reason="the bench takes the extra 'view'")
    pytest.importorskip("httpx", reason="starlette's test client takes httpx")
    from starlette.testclient import TestClient

    from aerotri.bench.server import make_application

    return TestClient(make_application(bench, TOKEN), base_url=f"http://127.0.0.1/{TOKEN}/")
