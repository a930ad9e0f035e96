"""Photographs without image errors from Python: the same ground is measured in them, by an ideal camera."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

import aerotri
from aerotri import InputError

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")


@pytest.fixture(scope="module")
def ideal(measured, tmp_path_factory):
    photographs, result, _, _ = measured
    told = []
    found = aerotri.ideal_photographs(result, photographs, tmp_path_factory.mktemp("ideal") / "out",
                                      progress=lambda stage, share: told.append((stage, share)))  # fmt: skip
    assert [share for stage, share in told if stage == "correcting"][-1] == 1.0
    return found


def test_tables_are_those_of_the_record(ideal, measured):
    photographs = measured[0]
    record = json.loads((ideal.folder / "imgeo.json").read_text(encoding="utf-8"))
    assert record == ideal.summary
    assert sorted(ideal.photographs["written"]) == sorted(path.name for path in photographs.glob("*.tif"))
    assert all((ideal.folder / name).is_file() for name in record["files"])
    (group,) = record["groups"]
    assert ideal.groups["d_rms_um"][0] == group["d_rms_um"]
    assert ideal.groups["opencv_leaves_rms_um"][0] == group["nearest"][0]["remaining_rms_um"]
    for shown in (ideal._repr_html_(), repr(ideal)):
        assert str(ideal.folder) in shown


def test_the_camera_has_no_errors(ideal):
    (camera,) = ideal.cameras.values()
    (group,) = ideal.summary["groups"]
    assert camera.focal_length_mm == group["focal_length_mm"]
    assert not camera.brown
    assert not camera.lens


def test_the_same_ground_is_measured_in_them(ideal, measured):
    """Image errors corrected while matching, or resampled away before: one surface."""
    _, result, _, _ = measured
    area = (-60.0, -60.0, 60.0, 60.0)
    own = aerotri.terrain(result, measured[0], interval=20.0, area=area)
    free = aerotri.terrain(result, ideal.folder, interval=20.0, area=area, ideal=True)
    difference = aerotri.compare(free, own)
    assert difference.coverage > 0.9
    assert difference.nmad < 3.0 * np.nanmedian(own.dsm.sigma)
    assert abs(difference.bias) < 0.1


def test_exports_alone_and_once_more(measured, tmp_path):
    _, result, _, _ = measured
    for _ in range(2):
        found = aerotri.ideal_photographs(result, out=tmp_path / "out")
    assert len(found.photographs) == 0
    assert found.photographs.columns[0] == "file"


def test_what_makes_no_sense(measured, tmp_path):
    photographs, result, _, _ = measured
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").write_text("mine")
    stranger = tmp_path / "stranger.tif"
    shutil.copy(next(photographs.glob("*.tif")), stranger)
    for match, files, out, options in (
        ("holds other files", [], "full", {}),
        ("no resampling 'nearest'", [], "out", {"resampling": "nearest"}),
        ("no compression 'jpeg'", [], "out", {"compression": "jpeg"}),
        ("is no photograph of the block", stranger, "out", {}),
        ("there is no group 'x'", [stranger], "out", {"group": "x"}),
    ):
        with pytest.raises(InputError, match=match):
            aerotri.ideal_photographs(result, files, tmp_path / out, **options)
    assert not (tmp_path / "out").exists()
