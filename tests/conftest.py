"""Common to all tests: real data where it is, and small simulated blocks."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# a busy machine makes no example wrong
settings.register_profile("aerotri", deadline=None)
settings.load_profile("aerotri")


def pytest_configure(config):
    """One thread in each process of the tests: the processors are taken, and threads would only wait for one another.

    Set in the process that starts the others: OpenBLAS reads it when numpy is loaded, and there pytest loads numba, and
    with it numpy, for `filterwarnings` before any conftest.
    """
    # one time of computation for all results, so that files of two runs can be compared
    os.environ.setdefault("SOURCE_DATE_EPOCH", "1767225600")
    if config.getoption("numprocesses", None):
        for setting in ("AEROTRI_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ.setdefault(setting, "1")


SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture
def shared_data():
    """A folder of real data by name; the test is skipped where it is missing."""

    def folder(name: str) -> Path:
        path = SHARED_DATA / name
        if not path.exists():
            pytest.skip(f"real data '{name}' is not beside the project (../shared/data)")
        return path

    return folder
