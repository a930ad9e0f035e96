"""The first steps as printed: the large-format block, files of other programs, and the command of the drone flight.

Each page is followed once, command by command, which takes half a minute; the run over the drone flight itself is
followed by tests/commands/test_drone_site.py.
"""

import json

import pages
import pytest

from places import PROJECT, SHARED_DATA

START = pages.DOCS / "start"
DATA_SETS = ("cu_sbr_p1", "ultracam_eagle_m3", "dbat_sxb", "dbat_roma", "bal", "dmc_ngi")


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder that looks like the repository with the public data sets beside its blocks."""
    (tmp_path / "blocks").symlink_to(PROJECT / "blocks", target_is_directory=True)
    for name in DATA_SETS:
        if (SHARED_DATA / name).is_dir():
            (tmp_path / name).symlink_to(SHARED_DATA / name, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(page, caption):
    """The output that a page shows under a caption, the last one."""
    return [text for _, shown, text in pages.fences(START / page) if shown == caption][-1]


def read(path):
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_large_format_block(place):
    run = list(pages.follow(START / "large_format.md", place))
    assert [words[0] for words in run] == ["adjust", "adjust", "diff", "deform", "deform", "deform", "imgeo"]
    results = {name: read(place / name / "adjustment.json") for name in ("frederiksstad_ultracam_result",
                                                                         "without_parameters")}  # fmt: skip
    assert [result["verdict"] for result in results.values()] == ["accepted", "doubtful"]
    shown = (START / "large_format.md").read_text(encoding="utf-8")
    for result in results.values():
        rms = result["check_points"]["rms"]
        assert f"check points: RMS X {rms['X']:.3f}, Y {rms['Y']:.3f}, Z {rms['Z']:.3f} m" in shown
    assert {path.name for path in (place / "deformation").glob("*.tif")} >= {"dZ.tif", "sigma_dZ.tif"}


def test_other_programs(place):
    missing = {name for name in DATA_SETS if not (place / name).exists()}
    made_of = {"p1": "cu_sbr_p1", "eagle": "ultracam_eagle_m3", "bal16": "bal"}

    def can_run(words):
        names = {made_of.get(word, word).split("/")[0] for word in words}
        return not names & missing

    run = list(pages.follow(START / "other_programs.md", place, can_run))
    made = {words[words.index("--out") + 1] for words in run if words[0] == "convert"}
    assert {"from_metashape", "from_opk", "from_colmap", "from_bundler", "from_opensfm"} <= made
    for name in made:
        if (place / name / "block.toml").is_file():
            assert (place / name / "image_points.csv").is_file()
    for result in place.glob("*_result/adjustment.json"):
        assert read(result)["verdict"] == "accepted", result.parent.name
    if missing:
        pytest.skip(f"followed but for the data sets that are not there: {', '.join(sorted(missing))}")


@pytest.mark.slow
def test_ppk_flight(place):
    """Positions of the page hold the block alone; control points, none of which is used, are right to centimetres."""
    run = list(pages.follow(START / "ppk.md", place))
    assert [words[0] for words in run] == ["tiepoints", "adjust"]
    result = read(place / "ppk_block_result" / "adjustment.json")
    assert result["verdict"] == "accepted"
    rms = result["check_points"]["rms"]
    assert max(rms.values()) < 0.06
    assert "12 fixed" in " ".join(read(place / "ppk_block" / "import.json")["taken"]["notes"])


def test_page_of_the_drone_flight_has_the_commands_of_its_data():
    """These are run, as they stand there, by the test of the data set."""
    text = (PROJECT / "blocks" / "drone_site" / "README.md").read_text(encoding="utf-8")
    own = list(pages.commands("\n".join(block for block in text.split("```")[1::2])))
    for words in pages.page_commands(START / "drone.md"):
        assert words in own
