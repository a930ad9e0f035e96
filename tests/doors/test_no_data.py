"""A surface whose holes hold 0 and do not say so."""

import pytest

from aerotri.conventions import InputError


def test_holes_of_zero_are_asked_about(door, run):
    door("nodata_zero")
    with pytest.raises(InputError, match=r"zero\.tif: has cells of exactly 0 m among heights of 9\d") as caught:
        run("volume zero.tif --boundary b.geojson --base level:101 --out O --no-plots")
    assert "gdal_edit.py -a_nodata 0 zero.tif" in caught.value.remedy
