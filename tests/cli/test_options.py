"""The whole program looked over: panels, help texts with units, examples, and options that mean the same everywhere."""

from __future__ import annotations

import re
import shlex
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

import pytest
import typer
from typer.models import CommandInfo, OptionInfo

from aerotri.cli import app
from aerotri.cli.app import invoke
from aerotri.conventions import InputError
from aerotri.reference.command_lines import command_lines
from aerotri.reference.files import described_files

WITHOUT_TARGET = {
    "view", "init", "check", "diff", "explain", "predict volume", "predict attitude", "predict picket-interval",
}  # fmt: skip
"""Commands that print what they find; the folder of init is what it is about."""
UNIT = re.compile(
    r"\b(m|mm|cm|km²|µm|t/m³|pixels|degrees|per cent|[Ss]hare|0 to 1|a number|grey values|1 over this number)\b"
)
COUNT = re.compile(r"\b(number|pixels|Number)\b")
DIFFERENT = {
    "area": "a rectangle to measure, or the polygons of a change",
    "base": "of a volume, or between photographs",
    "camera": "a camera by its name too where a flight is planned",
    "ground": "a table of ground points, or the height of level ground",
    "offset": "a file of Pix4D, or the place of a site",
    "photos": "several for the pictures of a report, one folder on the bench",
}
"""Options of one name that differ in what they take, and why."""


@dataclass(frozen=True)
class Given:
    """An argument or option as it is declared: the type of its value, and what typer is told of it."""

    name: str
    kind: Any
    info: Any

    @property
    def is_option(self) -> bool:
        return isinstance(self.info, OptionInfo)

    @property
    def names(self) -> tuple[str, ...]:
        return self.info.param_decls or (f"--{self.name.replace('_', '-')}",)

    def holds(self, kind: type) -> bool:
        """Whether it takes values of a type, alone or in a tuple."""
        return kind in (self.kind, *get_args(self.kind), *(of for one in get_args(self.kind) for of in get_args(one)))


def commands(program: typer.Typer = app, before: str = "") -> Iterator[tuple[str, CommandInfo]]:
    for info in program.registered_commands:
        assert info.callback is not None
        yield f"{before} {info.name or info.callback.__name__.replace('_', '-')}".strip(), info
    for group in program.registered_groups:
        yield from commands(group.typer_instance, f"{before} {group.name}".strip())


ALL = dict(commands())


def given(name: str) -> list[Given]:
    """What help shows of a command."""
    hints = get_type_hints(ALL[name].callback, include_extras=True)
    found = [Given(key, *get_args(hint)[:2]) for key, hint in hints.items() if key != "return"]
    return [one for one in found if not one.info.hidden]


@pytest.mark.parametrize("name", ALL)
def test_every_option_has_a_panel_and_a_text_with_its_unit(name):
    for one in given(name):
        assert isinstance(one.info.rich_help_panel, str), one.name
        assert one.info.help.rstrip().endswith((".", "?")), one.info.help
        if one.is_option and one.holds(float):
            assert UNIT.search(one.info.help), one.info.help
        if one.is_option and one.holds(int):
            assert COUNT.search(one.info.help), one.info.help


@pytest.mark.parametrize("name", ALL)
def test_every_command_has_an_example_that_can_be_read(name):
    """Its words are those of a command line; tests/commands/test_drone_site.py runs them all."""
    example = ALL[name].epilog or ""
    assert example.startswith(f"Example: aerotri {name} ")
    command: Any = typer.main.get_command(app)
    for word in name.split():
        command = command.commands[word]
    command.make_context(name, shlex.split(example.removeprefix(f"Example: aerotri {name} ")))


@pytest.mark.parametrize("name", sorted(set(ALL) - WITHOUT_TARGET))
def test_a_target_is_given_by_out(name):
    """And by nothing else that help shows."""
    assert [one.name for one in given(name) if one.is_option and "--out" in one.names] == ["out"]
    assert not {one.name for one in given(name) if not one.is_option} & {"target", "out"}


def test_options_of_one_name_take_the_same():
    """Kind of value and spelling; the options that many commands have, the same words too."""
    kinds, words = defaultdict(set), defaultdict(set)
    for name in ALL:
        for one in given(name):
            if one.is_option:
                kind = re.sub(r"<class '(.*)'>", r"\1", str(one.kind)).removesuffix(" | None")
                kinds[one.name].add((kind, one.names))
                words[one.name].add(one.info.help)
    assert {name for name, found in kinds.items() if len(found) > 1} == set(DIFFERENT)
    for name in ("check", "control_prefix", "control_sigma_m", "geoid", "json_", "overwrite", "seed", "layer"):
        assert len(words[name]) == 1, words[name]


@pytest.mark.parametrize("name", ["", *ALL])
def test_help_shows_the_panels(name, capsys):
    invoke([*name.split(), "--help"])
    told = capsys.readouterr().out
    panels = {one.info.rich_help_panel for one in given(name)} if name else {"All steps", "Blocks", "Adjustment"}
    assert all(f"─ {panel} ─" in told for panel in panels)
    assert name == "" or "Example: aerotri" in told


def test_old_forms_work_and_say_so(tmp_path, capsys):
    """The target of convert as its second argument, pictures of parameters by --draw."""
    assert invoke(["parameters", "--family", "brown", "--draw", str(tmp_path / "old")]) == 0
    assert "--draw DIR is the old form; write --out DIR" in capsys.readouterr().err
    assert invoke(["parameters", "--family", "brown", "--out", str(tmp_path / "new")]) == 0
    assert "old form" not in capsys.readouterr().err
    assert sorted(p.name for p in (tmp_path / "old").iterdir()) == sorted(p.name for p in (tmp_path / "new").iterdir())
    with pytest.raises(InputError, match="both given"):
        invoke(["parameters", "--out", str(tmp_path / "a"), "--draw", str(tmp_path / "b")])
    with pytest.raises(InputError, match="--out is missing"):
        invoke(["convert", "anything"])


def test_plots_names_the_page_that_is_written_with_it():
    """Of every command whose page is drawn with its plots, and no other command speaks of a page it does not write."""
    pages = {one.place.removeprefix("folder of "): one.name for one in described_files()
             if one.form == "page" and one.when == "unless --no-plots"}  # fmt: skip
    told = {command.name: option.text for command in command_lines(app) for option in command.options
            if "--plots" in option.names}  # fmt: skip
    assert pages.keys() >= {"dsm", "ortho"}
    for name in pages.keys() & told.keys():
        assert pages[name] in told[name] or "the page" in told[name], name
    assert not [name for name, text in told.items() if "page" in text and name not in pages]
