"""`aerotri explain`: what is found by which words, and what is said where nothing is."""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap

import pytest

from aerotri.cli.app import app, invoke
from aerotri.commands import compare, deform, dsm, dtm, volume
from aerotri.conventions import InputError
from aerotri.formats.block.settings import read_block_toml
from aerotri.reference.block_keys import block_keys, plan_keys
from aerotri.reference.command_lines import command_lines
from aerotri.reference.files import described_files
from aerotri.reference.lookup import FIRST, KINDS, command_entries, entries, find, names_of
from aerotri.reference.printed_words import PRINTED_WORDS
from aerotri.reference.words import WORDS
from aerotri.report.tables import adjustment, work
from aerotri.simulation.reading import read_spec
from aerotri.volume.accuracy import PARTS
from aerotri.volume.settings import METHODS

EVERYDAY = {
    "a", "and", "are", "as", "at", "between", "beyond", "by", "counted", "covered", "end", "every", "expected", "f",
    "g", "heights", "in", "inside", "lap", "lines", "moved", "nearby", "neighbouring", "not", "of", "over", "place",
    "distance", "seen", "share", "straight", "that", "the", "them", "to", "warning", "with", "without", "cm", "m", "m²",
    "m³", "mm", "px", "t/m³", "µm",
}  # fmt: skip
"""Words of the printed lines that need no explanation: small words, units, parts of terms explained together."""
PRINTING = (
    adjustment.summary_lines, work.free_check_lines, volume.outcome_lines, compare._summary, deform._summary,
    dtm._summary, dsm._summary,
)  # fmt: skip


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
        ("sigma_x", "sigma_x — dimension of dsm.laz (folder of dsm)"),
        ("dsm.laz cov_xy", "cov_xy — dimension of dsm.laz (folder of dsm)"),
        ("NormalZ", "NormalZ — dimension of dsm.laz (folder of dsm)"),
    ],
)
def test_found(words, first, known):
    assert titles(words, known)[0] == first


def test_a_column_is_found_in_every_file_that_has_it(known):
    expected = {one.label for one in described_files() if one.form != "json" and "sZ" in one.columns}
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


def printed_by(function):
    """The words that stand in the texts with values, out of which a function makes the lines it prints."""
    texts = [node for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function))))
             if isinstance(node, ast.JoinedStr)]  # fmt: skip
    constants = [part.value for text in texts for part in text.values if isinstance(part, ast.Constant)]
    return {word for text in constants for word in re.findall(r"[^\W\d_][\w/̂]*(?:-parallax)?", text)}


@pytest.mark.parametrize("function", PRINTING, ids=lambda f: f"{f.__module__.rsplit('.')[-1]}.{f.__name__}")
def test_words_of_printed_lines_are_explained(function, known):
    """Whatever a command adds to its lines has to be explained, or to be a word of every day."""
    words = printed_by(function)
    assert len(words) > 5 or function is work.free_check_lines
    assert not {word for word in words - EVERYDAY if not find(word, known)}


@pytest.mark.parametrize(
    "word",
    [
        *PARTS,
        *METHODS,
        "cut",
        "fill",
        "net",
        "RMS",
        "RMSE_H",
        "RMSE_V",
        "RMSE_3D",
        "NVA",
        "VVA",
        "class reached",
        "σ0",
        "end lap",
    ],
)
def test_values_of_printed_lines_are_explained(word, known):
    assert find(word, known)


def test_the_key_of_adjustment_json_is_told_first(known):
    for word in ("sigma0", "verdict", "redundancy", "rms"):
        found = [entry for entry in find(word, known) if entry.kind in ("column", "JSON key")]
        assert found[0].place == FIRST, word
        assert len({entry.place for entry in found}) > 1


def test_without_a_word_it_says_what_can_be_asked(capsys, known):
    """Every kind with examples, which are found; as JSON all entries."""
    assert invoke(["explain"]) == 0
    said = capsys.readouterr().out
    assert {entry.kind for entry in known} == set(KINDS)
    for kind, examples in KINDS.items():
        assert f"{kind} " in said
        for example in examples:
            assert example in said
            assert kind in {entry.kind for entry in find(example, known)}, example
    assert invoke(["explain", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)) == len(known)


BARE = "[camera.a]\nsize_px = [100, 80]\npixel_um = 5.0\nfocal_length_mm = 50.0\n"


@pytest.mark.parametrize(
    ("reader", "text"),
    [
        (read_block_toml, 'image_unit = "inch"\n' + BARE),
        (read_block_toml, BARE.replace("5.0\n", "-5.0\n", 1)),
        (read_block_toml, BARE + "[camera.a.interior]\nx0_mm = { value = 1.0, sigma = -1.0 }\n"),
        (read_block_toml, BARE + "[camera.a.fiducials]\nF1 = [1.0]\n"),
        (read_block_toml, BARE + "[adjustment]\nalpha = 2.0\n"),
        (read_spec, 'name = "a"\n' + BARE + "[flight]\ngsd_m = -1.0\n"),
    ],
)
def test_a_wrong_value_leads_to_an_entry(reader, text, tmp_path, known):
    """The remedy says what to ask for, and that is found."""
    path = tmp_path / "block.toml"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        reader(path)
    asked = refused.value.remedy.partition("aerotri explain ")[2]
    assert asked
    assert find(asked, known), asked


def test_printed_words_are_one_each():
    names = [word.name for word in PRINTED_WORDS]
    assert len(set(names)) == len(names)
    assert all(word.text.endswith(".") for word in PRINTED_WORDS)
