"""blocks/drone_site: the commands of its README as they are printed, from photographs to a volume within its σ."""

from __future__ import annotations

import json
import re
import shlex

import numpy as np
import pytest
from PIL import Image

from aerotri.cli.app import invoke
from places import PROJECT

SITE = PROJECT / "blocks" / "drone_site"


def commands() -> dict[str, list[str]]:
    """The command lines of the README by the name of their command, without the program's name."""
    text = (SITE / "README.md").read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for block in re.findall(r"```\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
    return {words[1]: words[1:] for words in map(shlex.split, lines)}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the blocks of the project in it, where the commands are given."""
    folder = tmp_path_factory.mktemp("drone_site")
    (folder / "blocks").symlink_to(PROJECT / "blocks", target_is_directory=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


def read(path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


def test_from_photographs_to_the_true_volume(place):
    """Accepted, the volume within three of its σ and 2 % of the truth; some 40 s, the whole chain at full size."""
    assert invoke(commands()["run"]) == 0
    adjusted = read(place / "drone_project" / "result" / "adjustment.json")
    assert adjusted["verdict"] == "accepted"
    assert 0.8 < adjusted["sigma0"] < 1.2
    measured = read(place / "drone_project" / "volume" / "volume.json")
    assert invoke(commands()["volume"]) == 0
    truth = read(place / "true_volume" / "volume.json")["net_m3"]
    assert abs(measured["net_m3"] - truth) < 3.0 * measured["sigma"]["sigma_m3"]
    assert measured["sigma"]["sigma_m3"] < 0.01 * truth
    assert invoke(commands()["compare"]) == 0
    assert abs(read(place / "difference" / "compare.json")["difference_m"]["bias"]) < 0.1


def test_photographs_are_those_of_the_plan(place):
    """The same pixels but for the rounding of JPEG, the same control and truth."""
    assert invoke([*commands()["simulate"], "--only", "2_002"]) == 0
    made = place / "drone_site"
    for name in ("gcp_list.txt", "truth/images.csv", "truth/points.csv", "truth/cameras.csv"):
        assert (made / name).read_text() == (SITE / name).read_text()
    pixels = [np.asarray(Image.open(folder / "photographs" / "2_002.jpg"), float) for folder in (made, SITE)]
    assert np.abs(pixels[0] - pixels[1]).max() <= 4.0
