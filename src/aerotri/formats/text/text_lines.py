"""Text files of words separated by blanks: their lines with numbers, and words turned into checked numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.csv_text import read_bytes
from aerotri.formats.text.encodings import decoded, head_decoded
from aerotri.formats.text.notes import assumed
from aerotri.formats.text.tables import CONTROL_CHARACTERS, LARGEST_NUMBER, LONGEST_NAME, NUMBER

HEAD = 32768
"""Bytes from which the kind of a file is told."""


class TextFile:
    """The lines of a text file that hold something; comments begin with #.

    Parameters
    ----------
    path : the file.
    comments : whether lines that begin with # are left out. keep_tabs : whether tabs at the ends of lines stay, which
        stand for empty cells. any_letters : whether UTF-16 and Windows-1252 are read too.
    part : bytes of some lines of the file, where not all are meant. first_line : number of the first of them.

    Raises
    ------
    InputError
        When it cannot be read, or is not UTF-8.
    """

    def __init__(
        self,
        path: Path,
        comments: bool = True,
        part: bytes | None = None,
        first_line: int = 1,
        any_letters: bool = False,
        keep_tabs: bool = False,
    ):
        self.path = path
        found = decoded(read_bytes(path) if part is None else part, path, first_line, any_letters)
        self.notes = (assumed(found.note),) if found.note else ()
        raw = found.text.split("\n")
        lines = [line.strip(" \r\v\f") if keep_tabs and line.strip() else line.strip() for line in raw]
        kept = [(i, line) for i, line in enumerate(lines) if line and not (comments and line[0] == "#")]
        self.numbers = [i + first_line for i, _ in kept]
        self.lines = [line for _, line in kept]
        self.is_indented = [raw[i][:1].isspace() for i, _ in kept]
        self.last_line = max(len(lines) - (not lines[-1]), 1) + first_line - 1

    def __len__(self) -> int:
        return len(self.lines)

    def words(self, separator: str | None = None) -> list[list[str]]:
        """The words of every line, stripped; separated by blanks, or as stated."""
        if separator is None:
            return [line.split() for line in self.lines]
        return [[word.strip() for word in line.split(separator)] for line in self.lines]

    def error(self, row: int, message: str, remedy: str) -> InputError:
        """An `InputError` at a row, counted from 0 among the lines kept; behind the last one it is the file's end."""
        line = self.numbers[row] if row < len(self.numbers) else self.last_line
        return InputError(message, remedy, self.path, line)

    def values(self, words: Sequence[str], rows: Sequence[int], what: str) -> np.ndarray:
        """Finite numbers of words.

        Parameters
        ----------
        words : (n,); rows : (n,) row that each stands on; what : words for what they are.

        Raises
        ------
        InputError
            At the first that is none.
        """
        try:
            found = np.array([float(word) for word in words], dtype=float)
            text = "".join(words)
            if (np.abs(found) <= LARGEST_NUMBER).all() and "_" not in text and text.isascii():
                return found
        except ValueError:
            pass
        for word, row in zip(words, rows, strict=True):
            if not is_number(word):
                remedy = "write numbers with a point as decimal sign"
                raise self.error(row, f"{what} '{word[:60]}' is not a number", remedy)
            if not abs(float(word)) <= LARGEST_NUMBER:
                raise self.error(
                    row,
                    f"{what} '{word[:60]}' is not possible",
                    "check the number; is the file damaged, or a column in the wrong place?",
                )
        raise self.error(0, f"{what} cannot be read", "write plain numbers")

    def table(self, words: Sequence[Sequence[str]], rows: Sequence[int], what: str) -> np.ndarray:
        """(n, k) finite numbers of n rows of k words each; see `values`."""
        width = len(words[0]) if words else 0
        flat = [word for row in words for word in row]
        flat_rows = [row for row, part in zip(rows, words, strict=True) for _ in part]
        return self.values(flat, flat_rows, what).reshape(len(words), width)

    def check_names(self, names: Sequence[str], rows: Sequence[int], what: str) -> None:
        """Refuse names that no table could hold.

        Raises
        ------
        InputError
            At the first that is empty, over-long or has a control character.
        """
        for name, row in zip(names, rows, strict=True):
            if not name or len(name) > LONGEST_NAME or re.search(CONTROL_CHARACTERS, name):
                raise self.error(
                    row, f"{name[:60]!r} cannot be the name of a {what}", "names are short texts on one line"
                )

    def refuse_repeated(self, names: Sequence[str], rows: Sequence[int], what: str) -> None:
        """Refuse a file that names something twice.

        Raises
        ------
        InputError
            At the second of the two rows, naming the line of the first.
        """
        if len(set(names)) == len(names):
            return
        first: dict[str, int] = {}
        for name, row in zip(names, rows, strict=True):
            if name in first:
                line = self.numbers[first[name]]
                raise self.error(row, f"{what} '{name}' is there twice, first in line {line}", "keep one of them")
            first[name] = row


def is_number(word: str) -> bool:
    """Whether a word is a finite number as written in tables."""
    return word.isascii() and re.match(NUMBER, word) is not None and math.isfinite(float(word))


def first_lines(path: Path, count: int = 8, comments: bool = True) -> list[str]:
    """Up to `count` lines at the beginning of a file that hold something; [] for what is no text file."""
    try:
        if not path.is_file():
            return []
        with path.open("rb") as file:
            raw = file.read(HEAD)
    except OSError:
        return []
    text = head_decoded(raw)
    lines = text.replace("\r", "\n").split("\n")
    if len(raw) == HEAD:
        # the last one may be cut off
        lines = lines[:-1]
    return [line.strip() for line in lines if line.strip() and not (comments and line.strip()[0] == "#")][:count]


def all_numbers(words: Sequence[str]) -> bool:
    """Whether all words are numbers, of which there is at least one."""
    return bool(words) and all(is_number(word) for word in words)


def line_of_word(raw: bytes, number: int) -> int | None:
    """Line of a file (from 1) that a word (from 0) stands on."""
    seen = 0
    for line, text in enumerate(raw.splitlines(), 1):
        seen += len(text.split())
        if seen > number:
            return line
    return None


def check_words(names: np.ndarray, what: str, format: str) -> None:
    """Refuse names that a format which separates by blanks cannot hold.

    Raises
    ------
    InputError
    """
    odd = [name for name in names.tolist() if len(name.split()) != 1]
    if odd:
        raise InputError(f"{what} {odd[0]!r} has a blank in its name, which {format} cannot hold", "rename it")
