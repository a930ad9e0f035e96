"""The block of three photographs that the documentation has written by hand: every file and command as printed."""

import json
import re

import pages
import pytest

PAGE = pages.DOCS / "start" / "own_block.md"


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The folder in which the page was followed, and its commands; they draw their plots, which takes some seconds."""
    folder = tmp_path_factory.mktemp("own_block")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return folder, list(pages.follow(PAGE, folder))


def outcome(folder, name):
    return json.loads((folder / name / "adjustment.json").read_text(encoding="utf-8"))


def test_every_adjustment_of_the_page_is_accepted(followed):
    folder, run = followed
    assert [arguments[0] for arguments in run] == ["check", "adjust", "adjust"]
    for name in ("gravel_pit_result", "gravel_pit_rtk"):
        assert outcome(folder, name)["verdict"] == "accepted"


def test_what_the_page_says_of_the_first_adjustment_holds(followed):
    said = outcome(followed[0], "gravel_pit_result")
    text = PAGE.read_text(encoding="utf-8")
    printed = re.search(r"redundancy (\d+) = (\d+) observations − (\d+) unknowns", text)
    assert printed
    assert [int(n) for n in printed.groups()] == [said["redundancy"], said["observations"], said["unknowns"]]
    sigma0 = re.search(r"^sigma0 ([\d.]+)", text, re.MULTILINE)
    assert sigma0
    assert said["sigma0"] == pytest.approx(float(sigma0[1]), abs=6e-4)


def test_positions_of_rtk_bring_what_the_page_says(followed):
    folder, _ = followed
    first, second = (outcome(folder, f"gravel_pit_{name}") for name in ("result", "rtk"))
    assert (first["redundancy"], second["redundancy"]) == (12, 21)
    heights = [1e3 * one["check_points"]["points"][0]["sZ"] for one in (first, second)]
    assert [round(s) for s in heights] == [38, 29]


def test_a_refused_file_is_told_as_the_page_says(followed, monkeypatch):
    from aerotri.cli.app import invoke
    from aerotri.conventions import InputError

    folder, _ = followed
    monkeypatch.chdir(folder)
    control = folder / "gravel_pit" / "control.csv"
    content = control.read_text(encoding="utf-8")
    try:
        control.write_text(content.replace("role", "type"), encoding="utf-8")
        with pytest.raises(InputError) as refused:
            invoke(["adjust", "gravel_pit", "--no-plots"])
    finally:
        control.write_text(content, encoding="utf-8")
    assert f"`{refused.value}`" in PAGE.read_text(encoding="utf-8")
