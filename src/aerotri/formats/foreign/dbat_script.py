"""A DBAT script as a file: its XML, the tables it names and the fields these have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from aerotri.conventions import InputError, real_path
from aerotri.formats.text.tables import Columns, Table, read_table
from aerotri.formats.text.xml_text import read_xml, text_of

TEXT_FIELDS = ("id", "label", "im", "path", "cam")
NUMBER_FIELDS = ("x", "y", "z", "sx", "sy", "sz", "sxy", "sxyz", "omega", "phi", "kappa")
IGNORED_FIELDS = ("dummy", "ignored")


@dataclass(frozen=True)
class Script:
    """A script: its file, its root, the folder its paths start from."""

    path: Path
    root: Element
    base: Path

    def table(self, file: Element, required: tuple[str, ...], optional: tuple[str, ...] = ()) -> Table:
        """The table a ``<file format="…">`` names.

        Raises
        ------
        InputError
            When the file lies outside the script's folder, is missing, or lacks a field.
        """
        path = self.file(text_of(file))
        form = file.get("format", "")
        header = tuple(
            f"x_{i}" if field in IGNORED_FIELDS else field
            for i, field in enumerate(part.strip() for part in form.split(","))
        )
        others = [field for field in header if field not in required + optional and not field.startswith("x_")]
        known = [field for field in others if field in TEXT_FIELDS + NUMBER_FIELDS]
        if len(known) < len(others):
            unknown = next(field for field in others if field not in known)
            raise InputError(f"format '{form}' has an unknown field '{unknown}'", "see DBAT's manual", self.path)
        fields = required + optional + tuple(known)
        columns = Columns(
            text=tuple(field for field in required if field in TEXT_FIELDS),
            numbers=tuple(field for field in required if field in NUMBER_FIELDS),
            optional_text=tuple(field for field in fields if field in TEXT_FIELDS and field not in required),
            optional_numbers=tuple(field for field in fields if field in NUMBER_FIELDS and field not in required),
        )
        table = read_table(path, columns, header)
        table.require(*required)
        return table

    def file(self, name: str) -> Path:
        """A file the script names; it has to lie within the script's folder.

        Raises
        ------
        InputError
        """
        try:
            path = real_path(self.base / name.replace("$HERE", str(self.path.parent)))
            there = path.is_file()
        except (OSError, ValueError) as error:
            raise InputError(f"'{name[:60]}' is no file name", "name a file beside the script", self.path) from error
        if not path.is_relative_to(self.path.parent):
            raise InputError(f"'{name}' lies outside the script's folder", "copy it there and name it so", self.path)
        if not there:
            raise InputError(f"there is no file '{name}'", "put it beside the script", self.path)
        return path

    def operations(self, tag: str) -> list[Element]:
        """What the script's operations say under a tag, in their order."""
        return self.root.findall(f"operations/operation/{tag}")


def is_dbat(path: Path) -> bool:
    """Whether a folder holds, or a file is, a DBAT script."""
    try:
        _script_file(path)
    except InputError:
        return False
    return True


def _script_file(path: Path) -> Path:
    candidates = sorted(path.glob("*.xml")) if path.is_dir() else [path] if path.is_file() else []
    scripts = [file for file in candidates if read_xml(file).get("dbat_script_version") is not None]
    if len(scripts) != 1:
        problem = "holds several DBAT scripts" if scripts else "holds no DBAT script"
        raise InputError(problem, "give the script, an XML file with dbat_script_version", path)
    return scripts[0]


def read_script(path: Path) -> Script:
    """A script from its file, or from the folder with exactly one.

    Raises
    ------
    InputError
    """
    file = real_path(_script_file(path))
    root = read_xml(file)
    source = one(root, "input", file)
    base = source.get("base_dir", "$HERE").replace("$HERE", str(file.parent))
    return Script(file, root, file.parent / base)


def one(element: Element, tag: str, path: Path) -> Element:
    """The element at a tag below another.

    Raises
    ------
    InputError
        When it is missing.
    """
    found = element.find(tag)
    if found is None:
        raise InputError(f"<{element.tag}> has no <{tag}>", f"add <{tag}>", path)
    return found
