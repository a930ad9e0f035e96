"""Rasters without georeference are opened without a warning, whatever other threads do."""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import rasterio
from rasterio.errors import NotGeoreferencedWarning

from aerotri import cli
from aerotri.rasters.images import create_image, open_photograph
from aerotri.rasters.quiet import MESSAGE, quietly


def test_threads_that_overlap_leave_the_filters_as_they_were():
    """The first that came in leaves first: the other one is still without warnings, and afterwards all is as before."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        before = list(warnings.filters)
        first, second = quietly(), quietly()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        warnings.warn("no georeference", NotGeoreferencedWarning, stacklevel=1)
        second.__exit__(None, None, None)
        assert said == []
        assert warnings.filters == before
        warnings.warn("no georeference", NotGeoreferencedWarning, stacklevel=1)
        assert len(said) == 1


def test_an_error_inside_brings_the_filters_back():
    before = list(warnings.filters)
    with pytest.raises(KeyError), quietly():
        raise KeyError
    assert warnings.filters == before


def test_photographs_read_by_many_threads_warn_of_nothing(tmp_path):
    path = tmp_path / "photograph.tif"
    with create_image(path, 40, 30, 1, "uint8") as writer:
        writer.write(0, np.zeros((1, 30, 40), np.uint8))

    def read(_: int) -> int:
        with open_photograph(path) as photograph:
            return photograph.dataset.width

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with ThreadPoolExecutor(8) as threads:
            assert set(threads.map(read, range(200))) == {40}
        assert said == []


def test_filters_that_another_library_brings_back_do_not_make_the_program_warn(monkeypatch):
    """One thread compiles with numba, which leaves its own `catch_warnings` while another one opens a photograph."""
    monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        cli._warn_in_lines()
        other = warnings.catch_warnings()
        other.__enter__()
        with quietly():
            other.__exit__(None, None, None)
            warnings.warn(f"{MESSAGE}, gcps, or rpcs.", NotGeoreferencedWarning, stacklevel=1)
        assert said == []


def test_the_message_is_that_of_rasterio(tmp_path):
    path = tmp_path / "photograph.tif"
    with create_image(path, 40, 30, 1, "uint8") as writer:
        writer.write(0, np.zeros((1, 30, 40), np.uint8))
    with pytest.warns(NotGeoreferencedWarning, match=f"^{MESSAGE}"), rasterio.open(path):
        pass
