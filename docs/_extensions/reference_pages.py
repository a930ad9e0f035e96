"""Pages of the reference, written from the package each time the documentation is built: they cannot drift from it.

They go to docs/reference/generated/, which git does not know. Pictures and pages are written only where they change, so
that Sphinx builds anew what has to be.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterable, Mapping, Sequence
from inspect import isclass, ismodule
from pathlib import Path
from typing import Any

import aerotri
from aerotri.cli.app import app as program
from aerotri.cli.options import COMMAND_PANELS
from aerotri.reference.block_keys import BlockKey, block_keys, block_tables, plan_keys, plan_tables, prior_keys
from aerotri.reference.block_tables import block_table_files
from aerotri.reference.command_lines import CommandLine, CommandOption, command_lines
from aerotri.reference.files import described_files
from aerotri.reference.printed_words import PRINTED_WORDS
from aerotri.reference.records import DescribedFile, Item
from aerotri.reference.schemas import schema_name, schema_texts
from aerotri.reference.words import MARKS, WORDS

GROUPS = {
    "block of convert": ("convert", "Block folder of `aerotri convert`, `tiepoints` and `run`"),
    "result of adjust": ("adjust", "Result of `aerotri adjust`"),
    "folder of compare-parameters": ("compare_parameters", "Folder of `aerotri compare-parameters`"),
    "folder of halves": ("halves", "Folder of `aerotri halves`"),
    "folder of export": ("export", "Folder of `aerotri export`"),
    "layers of result.gpkg": ("export", "Layers of result.gpkg"),
    "folder of accuracy": ("accuracy", "Folder of `aerotri accuracy`"),
    "folder of plan": ("plan", "Folder of `aerotri plan`"),
    "folder of deform": ("deform", "Folder of `aerotri deform`"),
    "folder of demcor": ("demcor", "Files of `aerotri demcor`"),
    "folder of imgeo": ("imgeo", "Folder of `aerotri imgeo`"),
    "folder of crosscheck": ("crosscheck", "Folder of `aerotri crosscheck`"),
    "folder of dtm": ("dtm", "Folder of `aerotri dtm`"),
    "folder of ortho": ("ortho", "Folder of `aerotri ortho`"),
    "folder of dsm": ("dsm", "Folder of `aerotri dsm`"),
    "folder of compare": ("compare", "Folder of `aerotri compare`"),
    "folder of volume": ("volume", "Folder of `aerotri volume`"),
    "folder of change": ("change", "Folder of `aerotri change`"),
    "folder of divide": ("divide", "Block in parts, of `aerotri divide`"),
    "folder of run": ("run", "Folder of `aerotri run`"),
    "block of tiepoints": ("tiepoints", "Block of `aerotri tiepoints`"),
    "control_marks of tiepoints": ("tiepoints", "Folder control_marks"),
    "block of simulate": ("simulate", "Block of `aerotri simulate`"),
    "truth of simulate": ("simulate", "Folder truth"),
    "photographs of simulate": ("simulate", "Folder photographs"),
    "folder of parameters": ("parameters", "Folder of `aerotri parameters --out`"),
    "printed": ("printed", "What commands print with `--json`"),
}
"""Page and heading of every place that files are written to; a new one stops the build here."""
PYTHON = {
    "From files to a block": (
        "read_block", "read", "tie_points", "simulate", "example_flight", "check", "edit", "convert", "Block",
        "observations",
    ),
    "Adjustment": (
        "adjust", "open_result", "Adjustment", "Covariance", "Table", "with_settings", "changes",
        "compare_parameters", "halves", "accuracy", "crosscheck", "export", "parameters", "InputError",
        "AdjustmentFailedError",
        "TasksFailedError", "divide", "convert_parts", "simulate_parts", "adjust_parts", "PartsAdjustment",
    ),
    "Image errors, terrain, volume": (
        "ImageErrors", "deform", "correct_dem", "ideal_photographs", "terrain", "dense_surface", "Surface", "compare",
        "volume", "cloud_change", "run",
    ),
    "Before the flight": ("predict",),
    "Figures and geometry of one's own": ("drawing", "geometry"),
}  # fmt: skip
"""The public names by chapter, a module for all that it offers; a name that is not here gets a chapter of its own."""
MARK_WORDS = "; ".join(f"{mark}: {meaning}" for mark, meaning in MARKS.items())
PARAMETER = re.compile(r"^(\*{0,2}\w[\w, ]*) : (.+)$")
SPOKEN = "`aerotri explain NAME` prints the entry of a name on the screen."


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("config-inited", lambda app, config: write_pages(Path(app.srcdir) / "reference" / "generated"))
    # before numpydoc reads them
    app.connect("autodoc-process-docstring", lambda *given: with_descriptions_apart(given[-1]), priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def with_descriptions_apart(lines: list[str]) -> None:
    """Parameters of a docstring, 'name : what it is', as numpydoc has those without a type; the list is changed."""
    section, made = "", []
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        section = line.strip() if following.strip("- ") == "" and following.startswith("---") else section
        found = PARAMETER.match(line) if section in ("Parameters", "Returns") else None
        made += [found[1], f"    {found[2]}"] if found else [line]
    lines[:] = made


def write_pages(out: Path) -> None:
    """Write all pages and pictures of the reference."""
    (out / "commands").mkdir(parents=True, exist_ok=True)
    (out / "outputs").mkdir(exist_ok=True)
    (out / "schemas").mkdir(exist_ok=True)
    for name, text in schema_texts().items():
        _write(out / "schemas" / name, text)
    _write(out / "block_toml.md", block_toml_page())
    _write(out / "block_tables.md", block_tables_page())
    _write(out / "simulation_toml.md", simulation_toml_page())
    _write(out / "outputs.md", outputs_page())
    for page in dict.fromkeys(page for page, _ in GROUPS.values()):
        _write(out / "outputs" / f"{page}.md", output_page(page))
    commands = command_lines(program)
    _write(out / "commands.md", commands_page(commands))
    for command in commands:
        _write(out / "commands" / f"{_file_name(command.name)}.md", command_page(command))
    _write(out / "parameters.md", parameters_page(draw_patterns(out / "patterns")))
    _write(out / "words.md", words_page())
    _write(out / "python.md", python_page())
    (out / "api").mkdir(exist_ok=True)
    pages = [name for names in python_chapters().values() for name in names]
    for name in pages:
        _write(out / "api" / f"{name}.rst", api_page(name))
    for older in out.glob("api/*"):
        # of a name that is gone, or of another way to write these pages
        if older.name not in {f"{name}.rst" for name in pages}:
            older.unlink()


def _write(path: Path, text: str) -> None:
    text = text.rstrip() + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def block_toml_page() -> str:
    """Every key of block.toml."""
    lines = [
        "# block.toml", "",
        "`block.toml` holds the settings of a block: the cameras, standard deviations and how it is adjusted. Only one "
        "table `[camera.NAME]` has to be there. A key that the program does not know is an error; the message "
        "names the nearest one. The tables of measurements are on [the next page](block_tables.md). A block written by "
        "hand, step by step: [your own block](../../start/own_block.md).", "", SPOKEN, "",
    ]  # fmt: skip
    prior = ["### value, sigma, fixed", "", "A parameter of `interior`, `brown` or `lens` is written as",
             "`focal_length_mm = { fixed = false }` (free), `{ value = 101.4, sigma = 0.01 }` (observed) or",
             "`{ fixed = true }` (held). A free parameter starts at `value` where that is given.", "",
             *_key_table(prior_keys()), ""]  # fmt: skip
    return "\n".join([*lines, *_by_table(block_tables(), block_keys(), {"camera.NAME.interior": prior})])


def simulation_toml_page() -> str:
    """Every key of simulation.toml."""
    lines = [
        "# simulation.toml", "",
        "`simulation.toml` is the plan of a simulated flight, for `aerotri simulate`: cameras and what is wrong with "
        "them, flight, ground, tie points, control. `blocks/` in the repository has several to begin with. A name with "
        "`[]` is a list: one table `[[flight.cross_strips]]` for each strip.", "", SPOKEN, "",
    ]  # fmt: skip
    return "\n".join([*lines, *_by_table(plan_tables(), plan_keys(), {})])


def _by_table(tables: Mapping[str, str], keys: Sequence[BlockKey], after: Mapping[str, list[str]]) -> list[str]:
    lines = []
    for name, text in tables.items():
        head = (
            f"## [[{name[:-2]}]]"
            if name.endswith("[]")
            else f"## [{name}]"
            if name
            else "## Keys above the first table"
        )
        own = [key for key in keys if key.table == name]
        lines += [head, "", text if name else "", "", *(_key_table(own) if own else []), "", *after.get(name, [])]
    return lines


def _key_table(keys: Sequence[BlockKey]) -> list[str]:
    rows = []
    for key in keys:
        value = ", ".join(f"`{word}`" for word in key.values) or key.kind
        end = "**Required.**" if key.required else f"Default `{key.default}`." if key.default else ""
        rows.append((f"`{key.name.rsplit('.', 1)[-1]}`", _with_unit(value, key.unit), f"{key.text} {end}".rstrip()))
    return _table(("key", "value", "meaning"), rows, "reference")


def _with_unit(value: str, unit: str) -> str:
    return ", ".join(filter(None, (value, f"`{unit}`" if "_" in unit else unit)))


def block_tables_page() -> str:
    """Every table of a block folder."""
    lines = [
        "# Tables of a block", "",
        "A block is a folder with `block.toml` and these tables. The first row names the columns, in any order; cells "
        "are separated by commas, the decimal sign is a point, text is UTF-8. A line that begins with `#` is a "
        "comment. "
        "A `.parquet` file with the same columns is read as well. An unknown column is an error, unless its name "
        "begins with `x_`. The units `angle_unit` and `image_unit` are those stated in [block.toml](block_toml.md).",
        "", SPOKEN, "",
    ]  # fmt: skip
    for described in block_table_files():
        lines += [f"## {described.name}", "", described.text, f"Needed: {described.when}.", ""]
        lines += [*_item_table(described.items, needed=True), ""]
    return "\n".join(lines)


def outputs_page() -> str:
    """All output files with links to their pages."""
    lines = [
        "# Output files", "",
        "Every file that a command writes. Lengths on the ground are metres, image coordinates millimetres, angles "
        "degrees, unless a unit is given. Every standard deviation contains σ0. A cell that is not known is empty, "
        "a JSON value `null`. Names that begin with `x_` may change; all others stay.", "", SPOKEN, "",
        "Each JSON file has a [JSON Schema](https://json-schema.org), linked where it is described. The package brings "
        "them along, in `aerotri/reference/schema_files`.", "",
    ]  # fmt: skip
    for place, (page, title) in GROUPS.items():
        own = [one for one in described_files() if one.place == place]
        rows = [(f"[`{one.name}`](outputs/{page}.md)", one.text, one.when) for one in own]
        lines += [f"## {title}", "", *_table(("file", "content", "written"), rows), ""]
    pages = [f"outputs/{page}" for page in dict.fromkeys(page for page, _ in GROUPS.values())]
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *pages, "```"])


def output_page(page: str) -> str:
    """The columns and keys of the files of a command."""
    headings = [(place, title) for place, (own, title) in GROUPS.items() if own == page]
    lines = [f"# {headings[0][1]}", ""]
    for number, (place, title) in enumerate(headings):
        lines += [f"## {title}", ""] if number else []
        for described in (one for one in described_files() if one.place == place):
            name = f"`{described.name}`" if " " in described.name else described.name
            lines += [f"{'###' if number else '##'} {name}", "", *_head_of(described), ""]
            lines += [*_item_table(described.items), ""] if described.items else []
    return "\n".join(lines)


def _head_of(described: DescribedFile) -> Iterable[str]:
    yield described.text
    if described.when:
        yield f"Written {described.when}."
    if described.form == "json":
        yield f"{{download}}`JSON Schema <../schemas/{schema_name(described)}>`"


def _item_table(items: Sequence[Item], needed: bool = False) -> list[str]:
    rows = []
    for one in items:
        name = "*any other*" if one.name == "*" else "the list" if one.name == "[]" else f"`{one.name}`"
        kind = one.kind.rstrip("?") + (" or empty" if one.kind.endswith("?") else "")
        end = " **Required.**" if needed and not one.optional else ""
        value = _with_unit(kind.replace("yes/no", "true or false").replace("whole", "whole number"), one.unit)
        rows.append((name, value, _with_words(one, needed) + end))
    return _table(("name", "value", "meaning"), rows, "reference")


def _with_words(item: Item, needed: bool) -> str:
    """The text of an item, with the words that may stand there."""
    plain = [f"`{word}`" for word, meaning in item.values.items() if word and not meaning]
    told = [f"`{word}`: {meaning}" for word, meaning in item.values.items() if word and meaning]
    optional = "May be missing." if item.optional and not needed else ""
    words = [f"One of {', '.join(plain)}." if plain else "", "; ".join(told) + "." if told else ""]
    return " ".join(filter(None, [item.text, *words, optional]))


def commands_page(commands: Sequence[CommandLine]) -> str:
    """All commands with links to their pages."""
    panels = [panel for panel in COMMAND_PANELS if any(one.panel == panel for one in commands)]
    lines = [
        "# Commands", "",
        "`aerotri COMMAND --help` prints what stands here. `python -m aerotri COMMAND` is the same, where `aerotri` is "
        "not on the path. Every command takes `--json`, which prints its outcome for other programs. "
        "Exit codes: 0 success; 1 the adjustment failed or is rejected; 2 the input cannot be used; 3 "
        "an error of the program, to be reported. Results appear whole or not at all. The environment variable "
        "`AEROTRI_THREADS` limits the number of threads.", "",
    ]  # fmt: skip
    pages = []
    for panel in panels:
        own = [one for one in commands if one.panel == panel]
        rows = [(f"[`aerotri {one.name}`](commands/{_file_name(one.name)}.md)", one.text) for one in own]
        lines += [f"## {panel}", "", *_table(("command", "does"), rows), ""]
        pages += [f"commands/{_file_name(one.name)}" for one in own]
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *pages, "```"])


def command_page(command: CommandLine) -> str:
    """One command with its options."""
    lines = [f"# aerotri {command.name}", "", command.text, "", "```sh", command.usage, "```", ""]
    lines += ["Example:", "", "```sh", command.example, "```", ""]
    for panel in dict.fromkeys(one.panel for one in command.options):
        rows = [
            (", ".join(f"`{name}`" for name in one.names), one.kind, _option_text(one))
            for one in command.options
            if one.panel == panel
        ]
        lines += [
            f"## {panel or 'Arguments and options'}",
            "",
            *_table(("option", "value", "meaning"), rows, "reference"),
            "",
        ]
    return "\n".join(lines)


def _option_text(option: CommandOption) -> str:
    """What an option does, whether it may be repeated, and its default."""
    repeated = "May be repeated." if option.repeated and "repeat" not in option.text else ""
    stated = f"Default `{option.default}`." if option.default and "default" not in option.text else ""
    return " ".join(filter(None, (option.text, repeated, "**Required.**" if option.required else stated)))


def draw_patterns(out: Path) -> dict[str, list[str]]:
    """Pictures of every family by its name; drawn where they are not there yet, for half a minute."""
    from aerotri.functional_model.additional_parameters import FAMILIES
    from aerotri.public.parameters import draw_parameters

    stamp = out / "version.txt"
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != _patterns_key():
        for family in FAMILIES:
            draw_parameters(out, family)
        for svg in out.glob("*.svg"):
            svg.unlink()
        stamp.write_text(_patterns_key(), encoding="utf-8")
    names = sorted(path.name for path in out.glob("*.png"))
    return {
        family: [
            name
            for name in names
            if name == f"{family}.png" or (name.startswith(f"{family}_") and name[len(family) + 1].isdigit())
        ]
        for family in FAMILIES
    }


def _patterns_key() -> str:
    """Changes when a family or what draws it changes."""
    import hashlib

    import aerotri.functional_model.additional_parameters as families
    from aerotri.report.plots import panels, parameters

    modules = [parameters, panels, *(
        importlib.import_module(f"{families.__name__}.{one.name}") for one in pkgutil.iter_modules(families.__path__)
    )]  # fmt: skip
    found = hashlib.sha256(aerotri.__version__.encode())
    for module in modules:
        found.update(Path(str(module.__file__)).read_bytes())
    return found.hexdigest()


def parameters_page(pictures: dict[str, list[str]]) -> str:
    """The families of additional parameters with their patterns."""
    from aerotri.functional_model.additional_parameters import FAMILIES, describe

    lines = [
        "# Additional parameters", "",
        "Additional parameters describe systematic image errors (self-calibration). They are chosen by "
        "`adjustment.additional_parameters` in block.toml or by `--parameters`: `FAMILY:ITEMS`, items joined by `+`, "
        "ranges by `-`, families by commas, such as `bluh:1-8+12,ultracam_d:42-73`. `auto` compares the families by "
        "cross-validation. The pictures show what each parameter does over the format of a camera, much exaggerated; "
        "`aerotri parameters --out FOLDER` draws them. The formulas are in "
        "[the chapter on theory](../../theory/additional_parameters.md).", "",
        f"The column mark says where the formula comes from: {MARK_WORDS}.", "",
    ]  # fmt: skip
    entries = describe()
    for family in FAMILIES:
        own = [one for one in entries if one.family == family]
        rows = [(f"`{family}:{one.item}`", one.mark, one.text) for one in own]
        lines += [f"## {family}", "", own[0].reference.rstrip(".") + ".", ""]
        lines += [f"![Patterns of {family}](patterns/{name})\n" for name in pictures[family]]
        lines += [
            "````{dropdown} " + f"The {len(rows)} entries of {family}",
            *_table(("write", "mark", "pattern"), rows),
            "````",
            "",
        ]
    return "\n".join(lines)


def python_page() -> str:
    """The public names of the package by chapter; what each does is the first line of its docstring."""
    lines = [
        "# Python", "",
        "All names below stand in the package `aerotri`: `import aerotri`, then `aerotri.adjust(…)`. Input that cannot "
        "be used raises `aerotri.InputError` with a remedy. The commands are made of the same functions.", "",
    ]  # fmt: skip
    chapters = python_chapters()
    for title, names in chapters.items():
        listed = [f"   aerotri.{full}" for name in names for full in _offered(name)]
        lines += [f"## {title}", "", "```{eval-rst}", ".. autosummary::", "   :nosignatures:", "", *listed, "```", ""]
    pages = [f"api/{name}" for names in chapters.values() for name in names]
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *pages, "```"])


def python_chapters() -> dict[str, tuple[str, ...]]:
    """`PYTHON`, with a chapter for public names that it does not have yet."""
    chosen = {name for names in PYTHON.values() for name in names}
    further = tuple(name for name in aerotri.__all__ if name not in chosen and not name.startswith("_"))
    return {**PYTHON, "Further names": further} if further else PYTHON


def api_page(name: str) -> str:
    """One public name in full, in reStructuredText as docstrings are; of a module all that it offers."""
    found = getattr(aerotri, name)
    title = f"aerotri.{name}"
    lines = [title, "=" * len(title), "", ".. currentmodule:: aerotri", ""]
    if ismodule(found):
        lines += [str(found.__doc__).split("\n>>>")[0].split("\n\n")[0].strip(), ""]
    for full in _offered(name):
        kind = "class" if isclass(_public(full)) else "function"
        lines += [f".. auto{kind}:: aerotri::{full}", *(["   :members:"] if kind == "class" else []), ""]
    return "\n".join(lines)


def _offered(name: str) -> list[str]:
    """A name; of a module the functions and classes in it that have no name of their own in the package."""
    found = getattr(aerotri, name)
    if not ismodule(found):
        return [name]
    offered = [one for one in found.__all__ if callable(getattr(found, one))]
    return [f"{name}.{one}" for one in offered if getattr(found, one) is not getattr(aerotri, one, None)]


def _public(full: str) -> Any:
    found: Any = aerotri
    for part in full.split("."):
        found = getattr(found, part)
    return found


def words_page() -> str:
    """Words of results: what each says, and what to do."""
    lines = [
        "# Words of results", "", "Words that stand in results, what they say, and what to do then.", "",
        "Messages of the program are sorted in [from message to remedy](../../understand/remedies.md).", "",
    ]  # fmt: skip
    for place in dict.fromkeys(word.place for word in WORDS):
        rows = [(f"`{word.name}`", word.text, word.remedy or "–") for word in WORDS if word.place == place]
        title = f"{place[:1].upper()}{place[1:]}".replace("--check-free", "`--check-free`")
        lines += [f"## {title}", "", *_table(("word", "meaning", "what to do"), rows), ""]
    lines += ["## Words that commands print", "", "Columns and JSON keys have their own entries.", ""]
    rows = [(f"`{word.name}`", word.place, f"{word.text} {word.remedy}".strip()) for word in PRINTED_WORDS]
    lines += [*_table(("word", "printed by", "meaning"), rows), ""]
    return "\n".join(lines)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], looks: str = "") -> list[str]:
    """A table; `looks` is its class in _static/reference.css."""
    lines = [_row(head), _row(["---"] * len(head)), *map(_row, rows)]
    return ["```{table}", f":class: {looks}", "", *lines, "```"] if looks else lines


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _file_name(name: str) -> str:
    return "_".join("".join(c if c.isalnum() else " " for c in name).split())
