"""The head of pages and files: whose a result is, when it was computed, in which system; hostile texts stay text."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
import pytest
from PIL import Image

import aerotri
from aerotri import InputError
from aerotri.observations.project import Project
from aerotri.public.projects import project_of
from aerotri.results.head import CLOCK, Head, time_of
from gis_blocks import in_crs
from planned_flights import FIELD
from small_blocks import small_block

HOSTILE = "<script>alert('x')</script>"
SHOWN = "&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;"
KEYS = ["aerotri", "computed", "project", "crs", "crs_name", "height_system"]


def picture() -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (40, 20), (10, 90, 170)).save(file, "PNG")
    return file.getvalue()


PROJECT = Project(
    HOSTILE, "Kieswerk Nörd", "A. Operator", "Survey GmbH", "2026-05-31", "one\ntwo", "logo.png", picture()
)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """Folder of an adjustment in a CRS with a system of heights."""
    block, _ = small_block(5, "none")
    folder = tmp_path_factory.mktemp("heads") / "result"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CLOCK, "1767225600")
        return aerotri.adjust(replace(in_crs(block), project=PROJECT), explain=False).save(folder)


def head_in(page: str) -> None:
    """The whole head is on a page, as text, and the page may show its logo."""
    for word in (
        SHOWN,
        "Kieswerk Nörd",
        "A. Operator",
        "Survey GmbH",
        "2026-05-31",
        "one",
        "two",
        "Date of computation",
    ):
        assert word in page, word
    assert f"<h1>{SHOWN}</h1>" in page
    assert HOSTILE not in page
    assert 'class="logo" src="data:image/png;base64,' in page
    assert "Content-Security-Policy" not in page or "img-src data:" in page


def test_report(result):
    page = (result / "report.html").read_text(encoding="utf-8")
    head_in(page)
    assert "2026-01-01 00:00 UTC" in page
    content = json.loads((result / "adjustment.json").read_text())
    assert list(content)[:6] == KEYS
    assert content["computed"] == "2026-01-01T00:00:00Z"
    assert content["crs_name"] in page
    assert content["crs_name"]


def test_accuracy(result, tmp_path):
    found = aerotri.accuracy(result)
    found.save(tmp_path / "accuracy")
    head_in((tmp_path / "accuracy" / "accuracy.html").read_text(encoding="utf-8"))
    content = json.loads((tmp_path / "accuracy" / "accuracy.json").read_text())
    assert list(content)[:6] == KEYS
    assert content["project"] == PROJECT.as_dict()


def test_volume_and_change_take_it_from_what_they_are_given(result, tmp_path):
    x, y = (float(v) for v in aerotri.open_result(result).adjusted.points.xyz[:, :2].mean(axis=0))
    flat = {"left": x - 20.0, "top": y + 20.0, "cell": 1.0, "sigma": np.full((40, 40), 0.02)}
    one, two = (aerotri.Surface.of_array(np.full((40, 40), z), **flat) for z in (100.0, 101.0))
    volume = aerotri.volume(one, base=95.0, project=result)
    change = aerotri.change(one, two, align="none", project=result / "block" / "block.toml")
    compared = aerotri.compare(two, one, project=result)
    for found, name in ((volume, "volume"), (change, "change")):
        found.save(tmp_path / name)
        head_in((tmp_path / name / f"{name}.html").read_text(encoding="utf-8"))
        assert json.loads((tmp_path / name / f"{name}.json").read_text())["project"] == PROJECT.as_dict()
        # a result knows its project again, but for the picture
        assert project_of(None, tmp_path / name) == replace(PROJECT, logo="", logo_content=b"")
    points = np.column_stack([np.random.default_rng(1).uniform(0.0, 10.0, (900, 2)), np.zeros(900)])
    aerotri.cloud_change(points, points, project=result).save(tmp_path / "clouds", plots=False)
    assert project_of(None, tmp_path / "clouds") == replace(PROJECT, logo="", logo_content=b"")
    assert compared.summary["project"] == PROJECT.as_dict()
    assert list(compared.summary)[:6] == KEYS


def test_plan(result, tmp_path):
    plan = aerotri.plan_flight(
        FIELD, camera="p1", gsd=0.03, ground=100.0, control=5, tie_points=40, project=result / "block"
    )
    plan.save(tmp_path / "plan")
    head_in((tmp_path / "plan" / "plan.html").read_text(encoding="utf-8"))
    assert json.loads((tmp_path / "plan" / "plan.json").read_text())["project"] == PROJECT.as_dict()


def test_run_page(result, tmp_path):
    found = aerotri.run(result / "block", tmp_path / "run", plots=False)
    head_in(found.report.read_text(encoding="utf-8"))
    assert json.loads((tmp_path / "run" / "run.json").read_text())["project"] == PROJECT.as_dict()
    # what lies in the folder of a run belongs to its project
    assert project_of(None, tmp_path / "run" / "dtm" / "dtm.tif") == PROJECT


def test_named_project_must_be_there(tmp_path):
    with pytest.raises(InputError, match=r"holds no block\.toml"):
        project_of(tmp_path)
    (tmp_path / "block.toml").write_text("name = ", encoding="utf-8")
    with pytest.raises(InputError):
        project_of(tmp_path)
    # looked for beside a surface, a block that cannot be read is no reason to stop
    assert project_of(None, tmp_path) == Project()


def test_time_is_written_and_read_again():
    moment = datetime(2026, 5, 4, 12, 30, 59, tzinfo=UTC)
    assert time_of(Head(computed=moment).as_dict()["computed"]) == moment
    assert time_of("yesterday") is None
    assert time_of(None) is None


def test_system_of_heights():
    content = Head(crs="EPSG:25832+7837").as_dict()
    assert (content["crs_name"], content["height_system"]) == ("ETRS89 / UTM zone 32N", "DHHN2016 height")


def test_a_file_with_a_project_alone(tmp_path):
    """For runs of photographs, which have no block.toml yet."""
    (tmp_path / "logo.png").write_bytes(picture())
    file = tmp_path / "project.toml"
    file.write_text('[project]\ntitle = "Quarry"\nlogo = "logo.png"\n', encoding="utf-8")
    found = project_of(file)
    assert (found.title, found.logo_content) == ("Quarry", picture())
    file.write_text('[project]\ntitel = "Quarry"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"unknown key 'project.titel'.*did you mean 'title'"):
        project_of(file)
    file.write_text('[project]\nlogo = "other.png"\n', encoding="utf-8")
    with pytest.raises(InputError, match="is missing") as told:
        project_of(file)
    assert told.value.line == 2
    (tmp_path / "block").mkdir()
    (tmp_path / "block" / "block.toml").write_text("")
    with pytest.raises(InputError, match="--project: for photographs only"):
        aerotri.run(tmp_path / "block", tmp_path / "out", project=file)


def test_photographs_get_a_project(tmp_path, monkeypatch):
    """The block that is written has it, with the picture; all later steps take it from there."""
    from types import SimpleNamespace

    from aerotri.formats.block.folder import read_block, write_block
    from aerotri.public import tying

    block, _ = small_block(5, "none")

    @dataclass(frozen=True)
    class Tied:
        block: object

    record = tying.TiedPhotographs(Tied(block), SimpleNamespace(), SimpleNamespace(), 0.0)
    monkeypatch.setattr(tying, "_tied", lambda *given: record)
    (tmp_path / "logo.png").write_bytes(picture())
    (tmp_path / "p.toml").write_text('[project]\ntitle = "Quarry"\nlogo = "logo.png"\n', encoding="utf-8")
    assert aerotri.tie_points(tmp_path).block.project == Project()
    found = aerotri.tie_points(tmp_path, project=tmp_path / "p.toml")
    write_block(found.block, tmp_path / "block")
    assert read_block(tmp_path / "block").project == Project("Quarry", logo="logo.png", logo_content=picture())
