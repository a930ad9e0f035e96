"""Rasters without georeference are opened without a warning, whatever other threads do; all else is still told."""

from __future__ import annotations

import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import rasterio
from rasterio.errors import NotGeoreferencedWarning

from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.rasters.images import create_image, open_photograph
from aerotri.rasters.mosaics import read_heights, read_mosaic
from aerotri.rasters.quiet import quietly


@pytest.fixture
def photograph(tmp_path):
    path = tmp_path / "photograph.tif"
    with create_image(path, 40, 30, 1, "uint8") as writer:
        writer.write(0, np.zeros((1, 30, 40), np.uint8))
    return path


@pytest.fixture
def said():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield found


def georeference(said):
    return [one for one in said if issubclass(one.category, NotGeoreferencedWarning)]


def test_filters_stay_as_they_are(photograph):
    before = list(warnings.filters)
    with quietly():
        assert warnings.filters == before
        with rasterio.open(photograph):
            pass
    with pytest.raises(KeyError), quietly():
        raise KeyError
    assert warnings.filters == before


def test_the_user_is_warned_of_what_he_opens_himself(photograph, said):
    """Also while another thread is inside, and afterwards."""
    with rasterio.open(photograph):
        pass
    assert len(georeference(said)) == 1
    with quietly(), ThreadPoolExecutor(1) as other:
        with rasterio.open(photograph):
            pass
        assert len(georeference(said)) == 1
        other.submit(lambda: rasterio.open(photograph).close()).result()
        assert len(georeference(said)) == 2
    with rasterio.open(photograph):
        pass
    assert len(georeference(said)) == 3
    # where the user looks for it
    assert georeference(said)[-1].filename == rasterio.__file__


def test_other_warnings_of_rasterio_are_told(said):
    with quietly():
        rasterio._base.warnings.warn("another", UserWarning)
        rasterio._base.warnings.warn("without georeference", NotGeoreferencedWarning, stacklevel=1)
    assert [str(one.message) for one in said] == ["another"]
    assert said[0].filename == __file__


def test_left_in_another_thread_it_ends_all_the_same(photograph, said):
    inside = quietly()
    inside.__enter__()
    with ThreadPoolExecutor(1) as other:
        other.submit(inside.__exit__, None, None, None).result()
    with rasterio.open(photograph):
        pass
    assert len(georeference(said)) == 1


def test_filters_that_another_thread_brings_back_change_nothing(photograph, said):
    """As numba does where it compiles: `catch_warnings` again and again beside threads that open photographs."""
    ended = threading.Event()

    def compiling():
        while not ended.is_set():
            with warnings.catch_warnings():
                ended.wait(0.0005)

    other = threading.Thread(target=compiling)
    other.start()
    try:
        for _ in range(300):
            with open_photograph(photograph):
                pass
    finally:
        ended.set()
        other.join()
    assert georeference(said) == []


def test_whatever_is_opened_or_written_warns_of_nothing(photograph, said, tmp_path):
    grid = Grid(30, 40, 0.0, 30.0, 1.0, 1.0)
    write_raster(tmp_path / "raster.tif", np.ones((30, 40)), grid, None, "Z, m")
    with RasterReader(tmp_path / "raster.tif") as reader:
        reader.read(0, 0, 30, 40)
    read_mosaic(photograph)
    read_heights(photograph, 20)
    with ThreadPoolExecutor(8) as threads:

        def read(_: int) -> int:
            with open_photograph(photograph) as opened:
                return opened.dataset.width

        assert set(threads.map(read, range(200))) == {40}
    assert georeference(said) == []
