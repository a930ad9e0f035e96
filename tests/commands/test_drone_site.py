"""blocks/drone_site: the commands of its README as they are printed, from photographs to a volume within its σ; and the
examples of every command's help, most of which are about it.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil

import numpy as np
import pytest
from PIL import Image

import aerotri
from aerotri.cli import app
from aerotri.cli.app import invoke
from places import PROJECT

SITE = PROJECT / "blocks" / "drone_site"


def commands() -> dict[str, list[str]]:
    """The command lines of the README by the name of their command, without the program's name."""
    text = (SITE / "README.md").read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for block in re.findall(r"```\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
    return {words[1]: words[1:] for words in map(shlex.split, lines)}


@pytest.fixture(scope="module")
def run_once(place):
    """The exit code of the command that takes photographs to a volume."""
    return invoke(commands()["run"])


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the blocks of the project in it, where the commands are given."""
    folder = tmp_path_factory.mktemp("drone_site")
    (folder / "blocks").symlink_to(PROJECT / "blocks", target_is_directory=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


ORDER = (
    "simulate", "tiepoints", "adjust", "diff", "deform", "compare-parameters", "parameters", "dtm", "compare", "volume",
    "demcor", "imgeo", "crosscheck", "convert", "init", "check", "predict volume", "predict attitude",
    "predict picket-interval", "explain", "halves", "export", "ortho", "dsm",
    "change", "accuracy", "plan", "divide",
)  # fmt: skip
"""So that each has what it needs; that of run is the one of the README."""
BEFORE = {"diff": "adjust blocks/frederiksstad_ultracam --parameters none --no-plots --out plain_result"}
"""What else an example needs."""
WRITES = {
    "adjust": "frederiksstad_ultracam_result/adjustment.json", "deform": "deformation/deform.json",
    "compare-parameters": "frederiksstad_ultracam_compare/compare_parameters.json", "parameters": "patterns/dmc.png",
    "tiepoints": "drone_block/block.toml", "dtm": "drone_dtm/dsm.tif", "compare": "difference/compare.json",
    "plan": "plan/plan.json", "divide": "frederiksstad_ultracam_parts/parts/0003/block.toml",
    "volume": "pile_volume/volume.json", "demcor": "dsm_corrected.tif", "imgeo": "ideal/2_002.tif",
    "crosscheck": "crosscheck/crosscheck.json", "convert": "drone_colmap/images.txt", "init": "gravel_pit/block.toml",
    "halves": "frederiksstad_ultracam_halves/halves.json",
    "export": "frederiksstad_ultracam_export/result.gpkg", "ortho": "drone_ortho/ortho.tif", "dsm": "drone_dsm/dsm.tif",
    "change": "change/change.json", "accuracy": "frederiksstad_ultracam_accuracy/accuracy.json",
}  # fmt: skip


def examples() -> dict[str, list[str]]:
    """The words of every example by the name of its command, without the program's name."""
    found = {name: info.epilog.removeprefix("Example: aerotri ") for name, info in declared_commands()}
    return {name: shlex.split(text) for name, text in found.items()}


def declared_commands(program=app, before=""):
    for info in program.registered_commands:
        yield f"{before} {info.name or info.callback.__name__.replace('_', '-')}".strip(), info
    for group in program.registered_groups:
        yield from declared_commands(group.typer_instance, group.name)


def read(path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


def test_from_photographs_to_the_true_volume(place, run_once):
    """Accepted, the volume within three of the σ of its heights, below 1 %; the whole chain at full size."""
    assert run_once == 0
    adjusted = read(place / "drone_project" / "result" / "adjustment.json")
    assert adjusted["verdict"] == "accepted"
    assert 0.8 < adjusted["sigma0"] < 1.2
    measured = read(place / "drone_project" / "volume" / "volume.json")
    assert invoke(commands()["volume"]) == 0
    assert read(place / "drone_project" / "dtm" / "dtm.json")["ground_within"] == "pile.geojson"
    truth = read(place / "true_volume" / "volume.json")["net_m3"]
    # the true surface stands over a base made in the same way, so that the ground below is in neither
    sigma = measured["sigma"]
    of_heights = np.sqrt(sigma["sigma_m3"] ** 2 - sigma["parts_m3"]["base"] ** 2)
    assert abs(measured["net_m3"] - truth) < 3.0 * of_heights
    assert of_heights < 0.01 * truth
    # ground of some decimetres that rolls: not told to the centimetre from outside
    assert 0.02 * measured["boundary"]["area_m2"] < sigma["parts_m3"]["base"] < 0.3 * measured["boundary"]["area_m2"]
    assert invoke(commands()["compare"]) == 0
    assert abs(read(place / "difference" / "compare.json")["difference_m"]["bias"]) < 0.1
    # the whole surface against the true one, and what the one page shows of it
    dense = aerotri.compare(place / "drone_project" / "dsm", SITE / "truth" / "surface.tif").record
    assert dense.coverage > 0.75
    assert abs(dense.statistics.bias) < 0.1
    assert dense.statistics.nmad < 0.05
    page = (place / "drone_project" / "report.html").read_text(encoding="utf-8")
    assert all(text in page for text in ("Orthophoto", "Dense surface", "Volume: height over the base"))


def test_photographs_are_those_of_the_plan(place):
    """The same pixels but for the rounding of JPEG, the same control and truth."""
    assert invoke([*commands()["simulate"], "--only", "2_002"]) == 0
    made = place / "drone_site"
    for name in ("gcp_list.txt", "truth/images.csv", "truth/points.csv", "truth/cameras.csv"):
        assert (made / name).read_text() == (SITE / name).read_text()
    pixels = [np.asarray(Image.open(folder / "photographs" / "2_002.jpg"), float) for folder in (made, SITE)]
    assert np.abs(pixels[0] - pixels[1]).max() <= 4.0


def test_every_example_was_looked_at():
    # that of view serves until it is ended: tests/bench/test_view_command.py
    assert set(examples()) == {*ORDER, "run", "view"}
    assert examples()["run"] == commands()["run"]


def test_examples_of_help_run(place, run_once):
    """As they are printed, in a folder where nothing is but the blocks and what those before them wrote.

    One test: several processes would share the examples among them, and each needs what others wrote.
    """
    # features and matches of the run: the search for them is tested elsewhere
    shutil.copytree(place / "drone_project/block/tie_point_cache", place / "drone_block/tie_point_cache")
    for name in ORDER:
        if name in BEFORE:
            assert invoke(shlex.split(BEFORE[name])) == 0, BEFORE[name]
        shutil.rmtree(place / "difference", ignore_errors=True)
        assert invoke(examples()[name]) == 0, name
        if name in WRITES:
            assert (place / WRITES[name]).is_file(), name
