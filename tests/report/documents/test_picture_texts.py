"""Words in pictures of documents: every line translated, names as they are; nobody signs an empty page."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from matplotlib.text import Text

import aerotri
from aerotri.image_errors import image_groups
from aerotri.report.documents.figures import camera_figures
from aerotri.report.documents.parts import (
    MOST_ROWS,
    Document,
    heading,
    paragraph,
    signature,
    signed_together,
    table,
)  # fmt: skip
from aerotri.report.documents.picture_texts import in_language, picture_line
from aerotri.report.documents.words import Words
from aerotri.report.plots.block import plot_block_plan, plot_ground_points
from aerotri.report.plots.canvas import axes_at, new_figure, write_name
from aerotri.report.plots.rendering import render_plots
from aerotri.report.plots.volume import WORDS
from aerotri.volume.accuracy import MODEL
from synthetic import make_adjusted_block

NAMES = re.compile(r"(C|K|T|CP|P)?\d+|surface|cone.*|[a-z]+_?\d*")


def lines_of(figure):
    ticks = {id(label) for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for tick in axis.get_major_ticks()
             for label in (tick.label1, tick.label2)}  # fmt: skip
    texts = [text.get_text() for text in figure.findobj(Text) if id(text) not in ticks]
    return [line for text in texts for line in text.split("\n") if line.strip()]


def figures_of_an_adjustment():
    adjusted = make_adjusted_block(3, 8, 200)
    found = {"plan": plot_block_plan(adjusted), "ground": plot_ground_points(adjusted)}
    for group in image_groups(adjusted.block):
        found |= camera_figures(adjusted, group)
    return found, set(adjusted.block.points.tolist())


def figures_of_surfaces():
    flat = {"left": 0.0, "top": 40.0, "cell": 1.0, "sigma": np.full((40, 40), 0.02)}
    z = np.full((40, 40), 100.0)
    z[10:20, 10:20] += 1.5
    one, two = (aerotri.Surface.of_array(values, **flat) for values in (np.full((40, 40), 100.0), z))
    volume = aerotri.volume(two, base=99.0).plot.thickness()
    return {"thickness": volume} | aerotri.change(one, two, align="none").plot.all(), set()


def figures_of_clouds():
    rng = np.random.default_rng(2)
    before, after = (np.column_stack([rng.uniform(0.0, 20.0, (4000, 2)), rng.normal(0.0, 0.02, 4000)]) for _ in "ab")
    after[:, 2] += np.where(after[:, 0] < 8.0, 0.5, 0.0) - np.where(after[:, 0] > 14.0, 0.5, 0.0)
    return aerotri.cloud_change(before, after).plot.all(), set()


@pytest.mark.parametrize("drawn", [figures_of_an_adjustment, figures_of_surfaces, figures_of_clouds])
def test_every_line_is_german(drawn):
    figures, names = drawn()
    for name, figure in figures.items():
        for line in lines_of(figure):
            known = line in names or picture_line(line, "de") is not None
            assert known, (name, line)
    german = in_language(figures, "de")
    words = " ".join(line for figure in german.values() for line in lines_of(figure))
    for english in ("control", "check", "heights", "largest", "surface −", "difference", "image ["):
        assert english not in words
    assert not re.search(r"[0-9]\.[0-9]", words)
    for rendered in render_plots(german).values():
        assert rendered.svg
        assert rendered.png


def test_names_stay():
    """Also names that look like words of ours, or like numbers."""
    assert picture_line("Block plan – control 1.5", "de") == "Plan des Blocks – control 1.5"
    line = picture_line("cam 2.1: measured − ideal;  largest 3.25 µm (0.50 px),  RMS 1.00 µm (0.25 px)", "de")
    assert line == "cam 2.1: gemessen − ideal;  größter 3,25 µm (0,50 px),  RMS 1,00 µm (0,25 px)"
    assert picture_line("a.b less c.d", "de") == "a.b weniger c.d"
    assert picture_line("something else", "de") is None
    assert picture_line("control", "en") is None


def test_names_on_a_map_stay():
    """A pile that is called as one of our words."""
    figure = new_figure(3.0, "Change", "")
    write_name(axes_at(figure, 1.0, 0.5, 2.0, 1.5), (0.5, 0.5), "control")
    said = [text.get_text() for text in in_language({"map": figure}, "de")["map"].findobj(Text)]
    assert "control" in said
    assert "Änderung" in said


def test_ticks_have_a_comma():
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.add_subplot()
    axes.plot([0.0, 1.0], [0.0, 1.0])
    in_language({"one": figure}, "de")
    figure.canvas.draw()
    ticks = [label.get_text() for label in axes.get_xticklabels()]
    assert "0,5" in "".join(ticks) or "0,4" in "".join(ticks)
    assert not any("." in text for text in ticks)


def test_words_at_an_axis_are_translated():
    """The bars of the parts of σ."""
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.add_subplot()
    axes.barh([0, 1], [1.0, 2.5])
    axes.set_yticks([0, 1], ["matching of the points", "base"])
    in_language({"one": figure}, "de")
    figure.canvas.draw()
    assert [text.get_text() for text in axes.get_yticklabels()] == ["Bildzuordnung der Punkte", "Basis"]


def test_what_is_bound_to_a_signature():
    own = [heading("a"), table(["b"], [["1"]] * (MOST_ROWS + 1)), heading("c"), paragraph("d"), signature(["e"])]
    *before, signed = signed_together(own)
    assert before == own[:2]
    assert signed["before"] == own[2:4]
    assert signed_together([signature(["e"])])[0]["before"] == []


def test_a_signature_is_never_alone_on_its_page():
    """However long the text before it is."""
    pypdf = pytest.importorskip("pypdf")
    pytest.importorskip("typst")
    from datetime import UTC, datetime

    from aerotri.report.documents.typesetting import pdf_of

    head = {"language": "en", "title": "T", "subtitle": "S", "number": "N", "author": "", "logo": "", "made": "M",
            "page": "{page}/{pages}", "head": []}  # fmt: skip
    seen = set()
    for lines in range(30, 62):
        parts = signed_together([*(paragraph(f"line {k}") for k in range(lines)), signature(["Signature"])])
        file = pdf_of(Document({**head, "parts": parts}), datetime(2026, 1, 1, tzinfo=UTC))
        pages = [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(file)).pages]
        (signed,) = [text for text in pages if "Signature" in text]
        assert f"line {lines - 1}" in signed
        seen.add(len(pages))
    # the break falls everywhere between these
    assert len(seen) > 1


def test_the_part_that_photographs_share_names_no_groups_alone():
    """It holds what the parameters leave of a camera too: pictures and certificate say so, in both languages."""
    german = picture_line(WORDS[MODEL], "de")
    assert german is not None
    said = WORDS[MODEL], german, Words("en")("part.model"), Words("de")("part.model")
    for text in said:
        assert "image errors" in text or "Bildfehler" in text
        assert "group" not in text.lower()
        assert "grupp" not in text.lower()
