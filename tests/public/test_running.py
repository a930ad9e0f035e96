"""`aerotri.run`: every step in its turn, what is missing named, one report."""

from __future__ import annotations

import html
import json
import shlex

import pytest

import aerotri
from aerotri import InputError
from aerotri.execution.work import TasksFailedError
from aerotri.public.run_steps import Step, command_line
from aerotri.report.pages.run import _figures
from chain_of_fakes import Fakes, ends_of


@pytest.fixture
def fakes(monkeypatch):
    return Fakes(monkeypatch)


@pytest.fixture
def photographs(tmp_path):
    (tmp_path / "photographs").mkdir()
    return tmp_path / "photographs"


def test_a_block_is_adjusted(flight, tmp_path):
    """The real adjustment of a small block; terrain and volume need photographs."""
    told = []
    project = aerotri.run(flight.save(tmp_path / "in"), tmp_path / "out", parameters="brown:K1", plots=False,
                          on_step=lambda step, outcome: told.append((step.name, step.status)))  # fmt: skip
    assert told == [(name, end) for name in ("adjust", "accuracy") for end in ("", "done")]
    checked = json.loads((tmp_path / "out" / "accuracy" / "accuracy.json").read_text())
    assert checked["check_points"] == len(project.accuracy.record.points) > 0
    page = project.report.read_text(encoding="utf-8")
    assert f"RMSE_H {100.0 * checked['accuracy']['RMSE_H']:.2f} cm in plan" in page
    assert "that is required is met" in page
    assert "Accuracy by check points" in page
    assert (project.verdict, project.complete) == ("accepted", True)
    assert project.surface is project.volume is project.tied is None
    assert project.adjustment.parameters["name"].tolist() == ["brown.K1"]
    assert len(project.block.images) == len(flight.block.images)
    again = aerotri.open_result(project.folder / "result")
    assert again.sigma0 == pytest.approx(project.adjustment.sigma0, rel=1e-9)
    assert ends_of(project.folder)["dtm"] == ("left out", "it needs photographs, and a block was given")
    assert "Terrain" in project._repr_html_()


def test_steps_follow_one_another(fakes, photographs, tmp_path):
    """Every verb with its settings, on what those before it wrote; the record tells the command lines."""
    out = tmp_path / "out"
    project = aerotri.run(
        photographs, out, control="gcp_list.txt", check=["K1"], control_sigma_m=(0.02, 0.02, 0.03), control_prefix="G",
        focal_length_mm=8.8, seed=4, interval=5.0, boundary="pile.gpkg", base="lowest",
        boundary_from="product", density=1.8, density_sigma=0.05,
        further={"tie_points": {"features": 2000}, "volume": {"plots": False}},
    )  # fmt: skip
    tie, adjust, terrain, volume, dense, ortho, of_dense = fakes.called
    assert tie[1] == (str(photographs),)
    assert (tie[2]["control"], tie[2]["features"], tie[2]["seed"]) == ("gcp_list.txt", 2000, 4)
    assert adjust == ("adjust", (str(out / "block"), str(out / "result")), {
        "parameters": "auto", "plots": True, "photographs": (photographs,),
    })  # fmt: skip
    assert "camera" not in tie[2]
    stated = {"interval": 5.0, "ground_within": "pile.gpkg"}
    assert terrain == ("terrain", (str(out / "result"), str(photographs)), stated)
    assert volume[1] == (str(out / "dtm"),)
    assert (volume[2]["boundary"], volume[2]["base"]) == ("pile.gpkg", "lowest")
    assert volume[2]["adjustment"] == out / "result"
    assert (volume[2]["boundary_from"], volume[2]["density"], volume[2]["density_sigma"]) == ("product", 1.8, 0.05)
    assert "boundary_sigma" not in volume[2]  # nothing was stated
    assert dense == ("dense", (str(out / "result"), str(photographs)), {"tiles": out / "dsm.tiles"})
    assert ortho[1] == (str(out / "result"), str(photographs), str(out / "dsm"), str(out / "ortho"))
    lines = [step["arguments"] for step in json.loads((out / "run.json").read_text())["steps"]]
    assert lines[0] == [
        "tiepoints", str(photographs), "--out", str(out / "block"), "--gcp", "gcp_list.txt", "--control-sigma-m",
        "0.02,0.02,0.03", "--control-prefix", "G", "--focal-length-mm", "8.8", "--seed", "4", "--check", "K1",
        "--features", "2000",
    ]  # fmt: skip
    assert lines[1] == ["adjust", str(out / "block"), "--out", str(out / "result"), "--parameters", "auto"]
    assert lines[4][:4] == ["volume", str(out / "dtm"), "--adjustment", str(out / "result")]
    assert lines[4][4:] == [
        "--out", str(out / "volume"), "--boundary", "pile.gpkg", "--base", "lowest", "--layer", "dtm",
        "--boundary-from", "product", "--density", "1.8", "--density-sigma", "0.05", "--no-plots",
    ]  # fmt: skip
    assert lines[2] == ["accuracy", str(out / "result"), "--out", str(out / "accuracy")]
    assert lines[5] == ["dsm", str(out / "result"), str(photographs), "--out", str(out / "dsm")]
    assert lines[6] == ["ortho", str(out / "result"), str(photographs), str(out / "dsm"), "--out", str(out / "ortho")]
    assert project.block == "adjusted"
    # the same on the dense surface, which has objects always
    assert of_dense[1] == (str(out / "dsm"),)
    assert of_dense[2] == {name: value for name, value in volume[2].items() if name != "layer"}
    assert lines[7] == [
        *("volume", str(out / "dsm"), "--adjustment", str(out / "result"), "--out", str(out / "dsm_volume")),
        *(word for word in lines[4][6:] if word not in ("--layer", "dtm")),
    ]
    assert None not in (project.volume, project.dense, project.orthophoto, project.dense_volume)


def test_the_layer_of_the_volume_is_told(fakes, photographs, tmp_path):
    """The DTM where nothing is said, with all inside the boundary as ground; the surface with objects if asked for."""
    aerotri.run(photographs, tmp_path / "out", boundary="pile.gpkg", dense=False)
    assert ends_of(tmp_path / "out")["ortho"] == ("left out", "--no-dense was given")
    assert fakes.called[-2][2]["ground_within"] == "pile.gpkg"
    assert fakes.called[-1][2]["layer"] == "dtm"
    steps = json.loads((tmp_path / "out" / "run.json").read_text())["steps"]
    assert steps[3]["arguments"][-2:] == ["--ground-within", "pile.gpkg"]
    assert steps[4]["arguments"][-2:] == ["--layer", "dtm"]
    aerotri.run(photographs, tmp_path / "other", boundary="pile.gpkg", layer="dsm", dense=False)
    assert fakes.called[-1][2]["layer"] == "dsm"


def test_what_is_said_of_photographs_is_refused_with_a_block(fakes, tmp_path):
    """It would have no effect; check points are those of the adjustment then."""
    (tmp_path / "block").mkdir()
    (tmp_path / "block" / "block.toml").write_text("")
    with pytest.raises(InputError, match="--gcp, --pixel-um: for photographs only"):
        aerotri.run(tmp_path / "block", tmp_path / "out", control="gcp_list.txt", pixel_um=4.0)
    aerotri.run(tmp_path / "block", tmp_path / "out", check=["K1"])
    assert fakes.verbs == ["adjust"]
    assert fakes.called[0][2]["check"] == ("K1",)
    steps = json.loads((tmp_path / "out" / "run.json").read_text())["steps"]
    assert steps[0]["arguments"][-2:] == ["--check", "K1"]


def test_settings_as_a_command_line():
    settings = {"control_sigma_m": (0.1, 0.1, 0.1), "pixel_um": 6.0, "crs": "", "check": (), "plots": True}
    assert command_line(settings) == ("--control-sigma-m", "0.1", "--pixel-um", "6")


def test_a_step_that_fails_ends_the_run(fakes, photographs, tmp_path):
    """What was done stays and is told; bad input of the first step is bad input of the run."""
    out = tmp_path / "out"
    fakes.ends["adjust"] = InputError("too little ground", "give more")
    project = aerotri.run(photographs, out)
    assert ends_of(out) == {
        "tiepoints": ("done", ""),
        "adjust": ("failed", "too little ground — give more"),
        "accuracy": ("left out", "adjust is missing"),
        "dtm": ("left out", "adjust is missing"),
        "volume": ("left out", "no --boundary was given"),
        "dsm": ("left out", "adjust is missing"),
        "ortho": ("left out", "adjust is missing"),
    }
    assert (project.verdict, project.complete, project.block) == ("failed", False, "a block")
    fakes.ends["tie_points"] = InputError("2 photographs", "give more")
    with pytest.raises(InputError, match="2 photographs"):
        aerotri.run(photographs, out)
    with pytest.raises(InputError, match="neither"):
        aerotri.run(tmp_path / "nothing", out)


def test_nothing_is_built_on_a_rejected_adjustment(fakes, photographs, tmp_path):
    """What the adjustment wrote is to be looked at; only go_on builds on it."""
    out = tmp_path / "out"
    fakes.ends["adjust"] = "rejected"
    project = aerotri.run(photographs, out)
    assert fakes.verbs == ["tie_points", "adjust"]
    assert ends_of(out)["adjust"] == ("failed", "rejected: σ₀ is 522")
    assert ends_of(out)["dtm"] == ("left out", "adjust is rejected; --go-on builds on it all the same")
    assert project.verdict == "rejected"
    assert not aerotri.run(photographs, out, go_on=True).complete
    assert fakes.verbs[2:] == ["tie_points", "adjust", "terrain", "dense", "orthophoto"]


def test_a_step_ends_only_what_is_built_on_it(fakes, photographs, tmp_path):
    """Without terrain no volume, but surface and orthophoto; without surface no orthophoto, but the volume."""
    out = tmp_path / "out"
    fakes.ends["terrain"] = InputError("no ground", "fly lower")
    aerotri.run(photographs, out, boundary="pile.gpkg")
    assert fakes.verbs == ["tie_points", "adjust", "terrain", "dense", "orthophoto", "volume"]
    assert ends_of(out)["volume"] == ("left out", "dtm is missing")
    assert ends_of(out)["dsm_volume"] == ("done", "")
    del fakes.ends["terrain"]
    fakes.ends["dense"] = InputError("no texture", "fly lower")
    project = aerotri.run(photographs, out, boundary="pile.gpkg")
    ends = {step.folder: (step.status, step.reason) for step in project.steps}
    assert ends["volume"] == ("done", "")
    assert ends["ortho"] == ends["dsm_volume"] == ("left out", "dsm is missing")


def test_names_cannot_run_anything(fakes, tmp_path):
    folder = tmp_path / "<img src=x onerror=alert(1)>"
    folder.mkdir()
    project = aerotri.run(folder, tmp_path / "out")
    page = project.report.read_text(encoding="utf-8")
    for shown in (page, project._repr_html_()):
        assert "<img src=x" not in shown
        assert "<script>x" not in shown
    assert "<td>12</td>" in page


def test_the_executor_is_passed_on_and_told(fakes, photographs, tmp_path):
    out = tmp_path / "out"
    aerotri.run(photographs, out, executor="processes:2")
    ties, adjusted, terrain, dense, ortho = fakes.called
    assert all(step[2]["executor"] == "processes:2" for step in (ties, terrain, dense, ortho))
    assert "executor" not in adjusted[2]
    assert terrain[2]["scratch"].parent == out
    assert not [path for path in out.iterdir() if path.name.startswith(".")]
    lines = {s["name"]: s["arguments"] for s in json.loads((out / "run.json").read_text())["steps"]}
    for name in ("tiepoints", "dtm", "dsm", "ortho"):
        assert lines[name][-2:] == ["--executor", "processes:2"], name
    assert "--executor" not in lines["adjust"]
    with pytest.raises(InputError, match="'thread' is not an executor"):
        aerotri.run(photographs, out, executor="thread")


def test_a_step_whose_tasks_failed_is_named_and_others_go_on(fakes, photographs, tmp_path):
    fakes.ends["terrain"] = TasksFailedError([("tile 3", "no luck")], 9, "tiles", "run again")
    project = aerotri.run(photographs, tmp_path / "out", boundary="pile.gpkg")
    ends = ends_of(tmp_path / "out")
    assert ends["dtm"] == ("failed", "1 of 9 tiles could not be computed: tile 3 (no luck) — run again")
    assert ends["volume"] == ("left out", "dtm is missing")
    assert ends["ortho"][0] == "done"
    assert not project.complete


def test_command_lines_can_be_copied_with_spaces_in_names(fakes, photographs, tmp_path):
    """As a shell takes them apart again, on screen and on the page."""
    out = tmp_path / "my drone project"
    aerotri.run(photographs, out, dense=False)
    steps = json.loads((out / "run.json").read_text())["steps"]
    page = html.unescape((out / "report.html").read_text(encoding="utf-8"))
    for step in steps:
        told = Step(step["name"], step["folder"], step["what"], tuple(step["arguments"])).command
        assert shlex.split(told) == ["aerotri", *step["arguments"]]
        if step["status"] == "done":
            assert told in page
    assert f"'{out / 'result'}'" in page


def test_figures_of_steps_are_in_words(tmp_path):
    """No keys for programs, no True, no more digits than say something."""
    content = {
        "adjustment": "5640662b60", "ideal": True, "gsd_m": 0.058634, "sigma_Z_m": {"matching": 0.0007833},
        "notes": ["4 photographs are not there"],
    }  # fmt: skip
    (tmp_path / "dtm.json").write_text(json.dumps(content), encoding="utf-8")
    assert _figures(tmp_path) == [
        ("ideal", "yes"), ("GSD [m]", "0.0586"), ("σ of heights [m]: matching", "0.000783"),
        ("", "4 photographs are not there"),
    ]  # fmt: skip
