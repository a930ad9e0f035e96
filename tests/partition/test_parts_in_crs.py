"""A block in parts in a coordinate system: the numbers of the block in one piece."""

import csv
import warnings
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.coordinates.local_frame import local_frame
from gis_blocks import in_crs
from small_blocks import LONG_FLIGHT, small_block, with_adjustment

PLACES = {"EPSG:25832": (360000.0, 5450000.0, 0.0), "EPSG:4979": (7.1, 49.2, 0.0)}


def flown(crs):
    """A block around a place of a system, with observed positions."""
    positions = {"gnss": {"sigma_m": [0.05, 0.05, 0.08]}}
    block, _ = small_block(seed=4, parameters="brown:K1+K2", flight=LONG_FLIGHT, **positions)
    given = block.gnss_ins
    frame = local_frame(crs, np.array([PLACES[crs]]))
    placed = in_crs(block, crs, PLACES[crs])
    gnss = replace(given, xyz=frame.from_local(given.xyz))
    return with_adjustment(replace(placed, gnss_ins=gnss), model_part="off")


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def numbers(row, columns):
    return np.array([float(row[name]) for name in columns])


@pytest.mark.parametrize(("crs", "metric"), [("EPSG:25832", "EPSG:25832"), ("EPSG:4979", "EPSG:32632")])
def test_numbers_are_those_of_one_piece(crs, metric, tmp_path):
    block = flown(crs)
    aerotri.adjust(block, explain=False).save(tmp_path / "one", plots=False)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        aerotri.divide(block, tmp_path / "block", parts=3)
    assert [crs in str(one.message) for one in said if "degrees" in str(one.message)] == [True] * (crs != metric)
    found = aerotri.adjust_parts(tmp_path / "block", tmp_path / "parts")
    assert (found.status, found.record.record.block.crs) == ("converged", metric)
    keys = {
        "images": ("image", ("X0", "Y0", "Z0", "omega", "phi", "kappa")), "points": ("point", ("X", "Y", "Z")),
    }  # fmt: skip
    for table, (key, columns) in keys.items():
        sigmas = [f"s{name}" if len(name) < 3 else f"s_{name}" for name in columns]
        expected = {row[key]: row for row in rows_of(tmp_path / "one" / f"{table}.csv")}
        seen = set()
        for part in found.parts:
            for row in rows_of(tmp_path / "parts" / "parts" / part / f"{table}.csv"):
                seen.add(row[key])
                whole = expected[row[key]]
                sigma = numbers(whole, sigmas)
                apart = np.abs(numbers(row, columns) - numbers(whole, columns))
                assert (apart <= 1e-5 * sigma + 1e-7).all()
                np.testing.assert_allclose(numbers(row, sigmas), sigma, rtol=1e-6)
        assert seen == set(expected)
    for table in ("control", "check"):
        columns = ("dX", "dY", "dZ", "sX", "sY", "sZ", "wX", "wY", "wZ")
        expected = {row["point"]: numbers(row, columns) for row in rows_of(tmp_path / "one" / f"{table}.csv")}
        assert expected
        for row in rows_of(tmp_path / "parts" / f"{table}.csv"):
            np.testing.assert_allclose(numbers(row, columns), expected.pop(row["point"]), rtol=1e-4, atol=1e-5)
        assert not expected
    assert metric in (tmp_path / "parts" / "report.html").read_text(encoding="utf-8")


def test_the_frame_is_that_of_one_piece(tmp_path):
    from aerotri.coordinates.blocks import frame_of_block
    from aerotri.partition.adjusting import part_folders
    from aerotri.partition.placing import place_of

    block = flown("EPSG:25832")
    place = place_of(part_folders(aerotri.divide(block, tmp_path / "block", parts=3)), None)
    whole = frame_of_block(block)
    assert place is not None
    np.testing.assert_array_equal(place.origin, whole.origin)
    np.testing.assert_array_equal(place.frame().to_local(block.images.centre), whole.to_local(block.images.centre))


def test_coordinates_that_are_partly_known_are_refused(tmp_path):
    block = flown("EPSG:25832")
    xyz = block.control.xyz.copy()
    xyz[0, 2] = np.nan
    control = replace(block.control, xyz=xyz, sigma=np.where(np.isnan(xyz), np.nan, block.control.sigma))
    with pytest.raises(aerotri.InputError, match="with empty coordinates, in a coordinate system, in a block in parts"):
        aerotri.divide(replace(block, control=control), tmp_path / "block", parts=3)


def test_parts_in_two_systems_are_refused(tmp_path):
    folder = aerotri.divide(flown("EPSG:25832"), tmp_path / "block", parts=3)
    toml = folder / "parts" / "0001" / "block.toml"
    toml.write_text(toml.read_text(encoding="utf-8").replace("25832", "25833"), encoding="utf-8")
    with pytest.raises(aerotri.InputError, match="part 0001 is in 'EPSG:25833', part 0000 in 'EPSG:25832'"):
        aerotri.adjust_parts(folder, tmp_path / "result")
