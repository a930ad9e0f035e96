"""`aerotri explain`: what is found by which words, and what is said where nothing is."""

from __future__ import annotations

import json

import pytest

from aerotri.cli.app import app, invoke
from aerotri.conventions import InputError
from aerotri.reference.block_keys import block_keys, plan_keys
from aerotri.reference.command_lines import command_lines
from aerotri.reference.files import described_files
from aerotri.reference.lookup import command_entries, entries, find, names_of
from aerotri.reference.words import WORDS


@pytest.fixture(scope="module")
def known():
    return (*entries(), *command_entries(command_lines(app)))


def titles(words, known):
    return [entry.title for entry in find(words, known)]


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("gnss.shift", "gnss.shift — key of block.toml"),
        ("flight.gsd_m", "flight.gsd_m — key of simulation.toml"),
        ("shift", "gnss.shift — key of block.toml"),
        ("camera.p1.pixel_um", "camera.NAME.pixel_um — key of block.toml"),
        ("GNSS.Shift", "gnss.shift — key of block.toml"),
        ("points.csv sZ", "sZ — column of points.csv (result of adjust)"),
        ("groups.rms", "groups[].rms — JSON key of adjustment.json (result of adjust)"),
        ("volume.json net_m3", "net_m3 — JSON key of volume.json (folder of volume)"),
        ("adjust --robust", "--robust — option of aerotri adjust"),
        ("--robust", "--robust — option of aerotri adjust"),
        ("predict volume", "predict volume — command"),
        ("rank deficient", "rank deficient — word of a result of status of an adjustment"),
        ("brown.K1", "brown.K1 — parameter of additional_parameters"),
        ("gnss", "[gnss] — table of block.toml"),
    ],
)
def test_found(words, first, known):
    assert titles(words, known)[0] == first


def test_a_column_is_found_in_every_file_that_has_it(known):
    expected = {one.label for one in described_files() if one.form == "table" and "sZ" in one.columns}
    assert {entry.place for entry in find("sZ", known) if entry.kind == "column"} == expected
    assert len(expected) >= 5


def test_every_entry_is_found_by_its_name(known):
    """Keys, columns, JSON keys, files, options, words: none is out of reach."""
    names = {name for entry in known for name in names_of(entry)}
    assert names >= {
        *(key.name for key in (*block_keys(), *plan_keys())),
        *(item.name for one in described_files() for item in one.items if item.name != "[]"),
        *(one.name for one in described_files()),
        *(f"{command.name} {option.names[0]}" for command in command_lines(app) for option in command.options),
        *(word.name for word in WORDS),
    }


def test_what_is_printed(capsys):
    assert invoke(["explain", "points.csv", "sZ"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "sZ — column of points.csv (result of adjust)",
        "  Standard deviation of Z.",
        "  value: number or empty",
        "  unit: m",
    ]
    assert invoke(["explain", "adjust", "--robust", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(entry["kind"], entry["place"]) for entry in found] == [("option", "aerotri adjust")]


def test_near_names_where_nothing_is_called_so():
    with pytest.raises(InputError, match="nothing is called 'robsut'") as refused:
        invoke(["explain", "robsut"])
    assert "'robust'" in refused.value.remedy
    with pytest.raises(InputError, match="qqqq") as refused:
        invoke(["explain", "qqqq"])
    assert refused.value.remedy.startswith("ask for a key")


def test_commands_are_told_in_full():
    """Every command has an example that begins with its name, and every option says what it does."""
    for command in command_lines(app):
        assert command.text, command.name
        assert command.example.startswith(f"aerotri {command.name} "), command.name
        for option in command.options:
            assert option.text, (command.name, option.names)
