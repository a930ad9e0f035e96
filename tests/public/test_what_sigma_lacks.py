"""Where errors of cameras could not be looked for, every result with a σ says so."""

from __future__ import annotations

import json

import pytest
import shapely

import aerotri
from aerotri.statistics import camera_field

REASON = "the block has 1 cameras, more than 0"
SAID = f"{REASON}: image errors that the additional parameters leave were not looked for and are not in σ"


@pytest.fixture
def too_many_cameras(monkeypatch):
    monkeypatch.setattr(camera_field, "MOST_CAMERAS", 0)
    # so small a block says nothing of such errors
    monkeypatch.setattr(camera_field, "too_little_said", lambda _: "")


def test_surfaces_and_orthophotos(measured, too_many_cameras, tmp_path):
    photographs, result, *_ = measured
    surface = aerotri.dense_surface(result, photographs, resolution=4.0)
    model = aerotri.terrain(result, photographs, interval=40.0)
    image = aerotri.orthophoto(result, photographs, surface.surface, tmp_path / "ortho", plots=False)
    assert model.notes == surface.notes == (SAID,)
    assert SAID in image.notes
    folders = surface.save(tmp_path / "dsm", False), model.save(tmp_path / "dtm", False), image.folder
    for folder, name in zip(folders, ("dsm", "dtm", "ortho"), strict=True):
        assert SAID in json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))["notes"]


def test_volumes_and_changes(measured, too_many_cameras):
    _, result, model, _ = measured
    volume = aerotri.volume(model, shapely.box(-60.0, -50.0, 60.0, 50.0), base="lowest", adjustment=result)
    assert list(volume.warnings).count(SAID) == 1
    change = aerotri.change(model.dsm, model.dtm, first_adjustment=result, second_adjustment=result)
    assert list(change.warnings).count(SAID) == 1


def test_nothing_is_said_where_they_were_looked_for(measured):
    _, result, model, _ = measured
    assert model.notes == ()
    volume = aerotri.volume(model, shapely.box(-60.0, -50.0, 60.0, 50.0), base="lowest", adjustment=result)
    assert not [text for text in volume.warnings if "additional parameters leave" in text]
