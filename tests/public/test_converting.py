"""Reading and writing formats of other programs from Python."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

import aerotri
from aerotri import InputError
from aerotri.conventions import FLIGHT_AXES
from aerotri.formats.assembly.project import SHIFTS
from aerotri.formats.convert import TARGETS, detect_format
from aerotri.formats.foreign.metashape import read_metashape
from aerotri.formats.foreign.patb import ROTATIONS
from aerotri.public import blocks, converting


def test_an_editor_offers_what_there_is():
    assert get_args(converting.Target) == TARGETS
    assert set(get_args(blocks.FlightAxis)) == set(FLIGHT_AXES)
    assert set(get_args(blocks.GnssShift)) == set(SHIFTS)
    assert set(get_args(blocks.PatbRotation)) == set(ROTATIONS)


def test_a_result_is_written_as_adjusted(result, tmp_path):
    """In memory and from its folder alike; the block of a result is the one that was adjusted."""
    folder = result.save(tmp_path / "result", plots=False)
    for source, name in ((result, "one.txt"), (folder, "two.txt"), (aerotri.read(folder), "three.txt")):
        aerotri.convert(source, tmp_path / name, to="opk")
        found = read_metashape(tmp_path / name)
        np.testing.assert_allclose(found.centre[:, 2], result.images["Z0"], rtol=0, atol=1e-6)
    read = aerotri.read(folder)
    assert read.is_result
    assert read.block.name == result.block.name
    assert "12 photographs" in read._repr_html_()
    with pytest.raises(InputError, match="nothing can be added"):
        aerotri.read(folder, control="x.csv")


def test_a_block_is_adjusted_where_the_target_needs_it(flight, tmp_path):
    told = []
    aerotri.convert(flight.block, tmp_path / "model", to="colmap", progress=lambda stage, share: told.append(stage))
    assert any(stage.startswith("iteration 1") for stage in told)
    assert detect_format(tmp_path / "model") == "colmap"
    said = aerotri.convert(flight.block, tmp_path / "start.txt", to="opk")
    assert said[0] == "the orientations are those of the files, not adjusted"
    assert any("control" in text for text in said[1:])
    again = aerotri.read(tmp_path / "model", pixel_um=2.4)
    assert again.points.shape == (len(again.block.points), 3)


def test_files_of_others_stay(flight, tmp_path):
    (tmp_path / "x.txt").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        aerotri.convert(flight.block, tmp_path / "x.txt", to="bingo")
    aerotri.convert(flight.block, tmp_path / "x.txt", to="bingo", overwrite=True)
    assert (tmp_path / "x.txt").read_text() != "mine"
    with pytest.raises(InputError, match="'pdf' is not a format that is written"):
        aerotri.convert(flight.block, tmp_path / "y", to="pdf")


def test_tables_as_parquet(tmp_path, flight):
    aerotri.convert(flight.block, tmp_path / "copy", tables="parquet")
    assert (tmp_path / "copy" / "image_points.parquet").is_file()
    again = aerotri.read_block(tmp_path / "copy")
    assert np.array_equal(again.image_points.xy, flight.block.image_points.xy)
    with pytest.raises(InputError, match="no tables as 'json'"):
        aerotri.convert(flight.block, tmp_path / "other", tables="json")
