"""Marks snapped in rendered photographs: brought back to where the point is."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri
from aerotri.bench.places import places_of
from aerotri.bench.session import Bench
from rendered_photographs import fly


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    place = tmp_path_factory.mktemp("flown")
    found = fly(place / "photographs")
    folder = aerotri.adjust(found.block).save(place / "flown_result", plots=False)
    return folder, found.photographs


@pytest.fixture
def bench(flown, tmp_path):
    folder, photographs = flown
    import shutil

    made = Bench(places_of(shutil.copytree(folder, tmp_path / "flown_result")), photographs)
    made.wait()
    return made


def test_photographs_are_found_by_name(bench):
    assert bench.summary()["pictures"] == list(range(len(bench.records.block.images)))


def test_marks_off_by_two_pixels_are_matched_back(bench):
    """Of the points seen by four photographs or more; what was measured is 0.1 px exact."""
    block = bench.records.block
    often = np.flatnonzero(np.bincount(block.image_points.point) >= 4)[:25]
    errors, left = [], 0
    for point in often.tolist():
        rays = bench.point(point)["rays"]
        image, px = rays["image"][0], np.array(rays["px"][0])
        if (px < 30).any() or (px > np.array([400, 300]) - 30).any():
            continue
        said = bench.measuring.mark(image, str(block.points[point]), tuple(px + [1.5, -1.3]), "", snap=True)
        if not said["snapped"].startswith("matched"):
            left += 1
            continue
        errors.append(np.array(said["rows"][0]["place"]) - px)
        bench.measuring.undo()
    assert len(errors) > 3 * left
    assert np.median(np.hypot(*np.array(errors).T)) < 0.35


def test_rays_of_a_point_meet_where_it_is_predicted(bench):
    """Predicted places are those of the residuals; the epipolar lines of the other photographs pass there."""
    block = bench.records.block
    point = int(np.argmax(np.bincount(block.image_points.point)))
    rays = bench.point(point)["rays"]
    image = rays["image"][0]
    adjusted = np.array(rays["px"][0]) + rays["v"][0]
    expected = {k: (column, row) for k, column, row in bench.point(point)["expected"]}
    assert expected[image] == pytest.approx(adjusted, abs=0.01)
    assert set(rays["image"]) <= set(expected)
    lines = bench.epipolar(image, point)["lines"]
    assert sorted(one["image"] for one in lines) == sorted(rays["image"][1:])
    for one in lines:
        line = np.array(one["line"])
        along = np.diff(line, axis=0)
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        gap = np.abs(np.einsum("ij,ij->i", normal, adjusted - line[:-1])).min()
        # what is left is the residual of the ray in the other photograph
        assert gap < 1.0
