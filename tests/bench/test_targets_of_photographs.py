"""Coded targets in whole photographs: read, and their control points marked."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import aerotri
from aerotri.bench.places import places_of
from aerotri.bench.session import Bench
from aerotri.bench.target_search import point_of_number
from aerotri.rasters.images import create_image
from small_blocks import small_block

MODULE = 6


@pytest.mark.parametrize(
    ("names", "number", "point"),
    [
        (["GCP_017", "GCP_018"], 17, "GCP_017"), (["17", "T17"], 17, ""), (["P1-17"], 17, ""), (["a"], 17, ""),
        (["T5"], None, ""), (["target 5", "target 5"], 5, "target 5"),
    ],
)  # fmt: skip
def test_point_that_a_number_names(names, number, point):
    assert point_of_number(names, number) == point


@pytest.fixture
def bench(tmp_path):
    """A block with one photograph that shows the targets 3 and 8; control points are named by numbers."""
    block, _ = small_block(seed=4, camera=SMALL)
    names = block.points.astype("<U20")
    names[block.control.point] = [f"K{k:02d}" for k in range(len(block.control))]
    from dataclasses import replace

    folder = aerotri.adjust(replace(block, points=names)).save(tmp_path / "coded_result", plots=False)
    columns, rows = block.cameras[0].size_px
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    grey = np.random.default_rng(1).normal(120, 6, (rows, columns))
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for number, (column, row) in PLACES.items():
        drawn = np.kron(
            np.pad(cv2.aruco.generateImageMarker(dictionary, number, 8), 1, constant_values=255),
            np.ones((MODULE, MODULE)),
        )
        half = len(drawn) // 2
        grey[row - half : row + half, column - half : column + half] = 30 + drawn * 0.8
    with create_image(photographs / f"{block.images.names[0]}.tif", columns, rows, 1, "uint8") as writer:
        writer.write(0, np.clip(cv2.GaussianBlur(grey, (0, 0), 0.7), 0, 255).astype(np.uint8)[None])
    made = Bench(places_of(folder), photographs)
    yield made
    made.wait()


SMALL = {"small": {"size_px": [3200, 2000], "pixel_um": 9.0, "focal_length_mm": 28.0}}
"""A camera whose photograph is searched in seconds."""
PLACES = {3: (900, 860), 8: (1800, 1200), 400: (2600, 700)}


def test_targets_are_found_and_their_points_marked(bench):
    found = {one["number"]: one for one in bench.measuring.targets(0)["targets"]}
    assert set(found) == set(PLACES)
    for number, place in PLACES.items():
        assert found[number]["place"] == pytest.approx(place, abs=0.1)
    assert (found[3]["point"], found[8]["point"], found[400]["point"]) == ("K03", "K08" if has_k08(bench) else "", "")
    said = bench.measuring.mark_targets(0)
    assert said["marked"] == [found[n]["point"] for n in found if found[n]["point"]]
    row = said["rows"][0]
    assert row["action"] == "mark"
    assert "coded target" in row["reason"]


def has_k08(bench) -> bool:
    return "K08" in bench.records.block.points.tolist()


def test_mark_on_a_target_of_another_number_tells(bench):
    column, row = PLACES[3]
    said = bench.measuring.mark(0, "K01", (column + 12.0, row - 9.0), "", snap=True)
    assert (said["read"], said["named"]) == (3, "K03")
    assert said["snapped"].startswith("coded target 3 (AprilTag 36h11)")
    assert said["rows"][0]["place"] == pytest.approx((column, row), abs=0.1)
