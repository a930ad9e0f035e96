"""Words inside pictures in other languages than English: a picture is translated before it is rendered."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import Formatter

from aerotri.report.documents.words import languages
from aerotri.report.plots.canvas import OWN_NAME
from aerotri.report.plots.rendering import save_plots

POINT = re.compile(r"(?<=[0-9])\.(?=[0-9])")
MARKS = {"name": "\ue000", "other": "\ue001"}
"""What stands for names while the numbers around them are written anew: places of no letter."""


class _Localised(Formatter):
    """The numbers of an axis with a decimal comma, and the words where it has words."""

    def __init__(self, formatter: Formatter, language: str) -> None:
        self._formatter, self._language = formatter, language

    def set_locs(self, locs: list[float]) -> None:
        self._formatter.set_locs(locs)

    def __call__(self, x: float, pos: int | None = None) -> str:
        text = self._formatter(x, pos)
        return picture_line(text, self._language) or POINT.sub(",", text)


def in_language(figures: Mapping[str, Figure], language: str) -> dict[str, Figure]:
    """Figures with their words in a language; a line without a translation stays English.

    Parameters
    ----------
    figures : by name; they are changed. language : its code; 'en' changes nothing.
    """
    if _lines(language):
        for figure in figures.values():
            _translate(figure, language)
    return dict(figures)


def save_translated(name: str, draw: Callable[[], Figure], folder: Path) -> None:
    """Write `<name>.<language>.svg` and `.png` of a figure, for a document that is made of the folder later.

    Parameters
    ----------
    draw : makes the figure anew, for every language but English.
    """
    for language in languages():
        if language != "en":
            save_plots({f"{name}.{language}": in_language({name: draw()}, language)[name]}, folder)


def picture_line(line: str, language: str) -> str | None:
    """A line of a text in a picture in a language; None where there is no translation."""
    for pattern, replacement in _lines(language):
        found = pattern.fullmatch(line)
        if found is not None:
            names = {name: found[name] for name in MARKS if name in pattern.groupindex}
            masked = replacement
            for name in names:
                masked = masked.replace(rf"\g<{name}>", MARKS[name])
            text = POINT.sub(",", found.expand(masked))
            for name, own in names.items():
                text = text.replace(MARKS[name], own)
            return text
    return None


@cache
def _lines(language: str) -> tuple[tuple[re.Pattern[str], str], ...]:
    """Patterns of English lines and what stands in their place."""
    file = files("aerotri.report.documents.picture_texts").joinpath(f"{language}.toml")
    if not file.is_file():
        return ()
    content = tomllib.loads(file.read_text(encoding="utf-8"))
    return tuple((re.compile(english), other) for english, other in content["lines"])


def _translate(figure: Figure, language: str) -> None:
    axes = [axis for one in figure.axes for axis in (one.xaxis, one.yaxis)]
    for axis in axes:
        axis.set_major_formatter(_Localised(axis.get_major_formatter(), language))
    of_ticks = {id(text) for axis in axes for text in _tick_texts(axis)}
    for text in figure.findobj(Text):
        said = text.get_text()
        if said.strip() and id(text) not in of_ticks and text.get_label() != OWN_NAME:
            text.set_text("\n".join(picture_line(line, language) or line for line in said.split("\n")))


def _tick_texts(axis: Axis) -> list[Text]:
    return [label for tick in axis.get_major_ticks() for label in (tick.label1, tick.label2)]
