"""The report: self-contained, every name escaped, the numbers in it those of the result."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from aerotri.diagnosis import findings
from aerotri.image_errors import group_changes
from aerotri.report.pages.adjustment import LARGEST_SVG, Findings, report_html, write_report
from aerotri.report.pages.interactive_plan import interactive_plan
from aerotri.report.plots.overview import all_plots, save_plots
from aerotri.report.plots.rendering import RenderedPlot, render_plots
from aerotri.report.tables.adjustment import observation_groups
from aerotri.results.adjusted_block import ObservationGroup
from aerotri.results.removal import Removal
from synthetic import make_adjusted_block

HOSTILE = "<script>alert(1)</script>"
VOID = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Tags, attributes and text of a page; refuses tags that do not nest."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.words, self.open = [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(3, 8, 200)


@pytest.fixture(scope="module")
def plots(adjusted):
    return render_plots(all_plots(adjusted))


@pytest.fixture(scope="module")
def page(adjusted, plots):
    return report_html(adjusted, plots)


def hostile_block():
    adjusted = make_adjusted_block(2, 5, 80, name=HOSTILE)
    block = adjusted.block
    images = replace(
        block.images, names=np.array([f'{HOSTILE}" onload="x{i}' for i in range(len(block.images))]),
        strip=np.array([HOSTILE] * len(block.images)),
    )  # fmt: skip
    block = replace(
        block, images=images, points=np.array([f"{HOSTILE}'{i}&amp;" for i in range(len(block.points))]), crs=HOSTILE,
        cameras=(replace(block.cameras[0], name=HOSTILE),),
    )  # fmt: skip
    p = replace(adjusted.parameters, groups=np.full(len(adjusted.parameters), HOSTILE),
                reason=np.full(len(adjusted.parameters), HOSTILE))  # fmt: skip
    outcome = replace(adjusted.outcome, message=HOSTILE, warnings=(f"point {HOSTILE}",))
    blunders = tuple(replace(b, image=HOSTILE, point=HOSTILE, action=HOSTILE) for b in adjusted.blunders)
    return replace(adjusted, block=block, parameters=p, outcome=outcome, blunders=blunders)


def test_self_contained(page):
    """Nothing to load, and nothing to run but the page's own script: all sources are data, links stay in the page."""
    parsed = Page(page)
    assert not {"link", "iframe", "object", "embed", "base", "form"} & set(parsed.tags)
    assert parsed.tags.count("script") == 2
    scripts = re.findall(r"<script([^>]*)>(.*?)</script>", page, re.S)
    assert scripts[0][0] == ' type="application/json" id="plan-data"'
    assert scripts[1][0] == ""
    digest = base64.b64encode(hashlib.sha256(scripts[1][1].encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    assert dict(parsed.attributes[: parsed.attributes.index(("name", "viewport"))])["content"] == policy
    for name, value in parsed.attributes:
        assert not name.startswith("on")
        if name == "src":
            assert value.startswith("data:image/")
        if name == "href":
            assert value.startswith("#")
    assert not re.search(r"https?://|@import|url\(", page)
    assert len(page) < 4e6


def test_embedded_plots_are_the_plots(page, plots):
    sources = dict(enumerate(re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)))
    # the block plan is drawn in the page itself
    shown = {plot.svg for name, plot in plots.items() if name != "block_plan"}
    assert {base64.b64decode(s) for s in sources.values()} == shown


def test_heavy_vector_plots_become_png(adjusted, plots):
    heavy = RenderedPlot(b"<svg>" + b" " * LARGEST_SVG + b"</svg>", plots["ground_points"].png)
    text = report_html(adjusted, {"ground_points": heavy})
    assert base64.b64encode(heavy.png).decode() in text
    assert "svg+xml" not in text


def test_hostile_names_stay_text():
    adjusted = hostile_block()
    text = report_html(adjusted, all_plots(adjusted))
    parsed = Page(text)
    assert parsed.tags.count("script") == text.count("<script") == 2
    assert not any(name.startswith("on") for name, _ in parsed.attributes)
    # and they are there, as text
    assert parsed.text.count(HOSTILE) > 40
    assert f"point {HOSTILE}" in parsed.text


def test_numbers_of_the_result(adjusted, page):
    text = Page(page).text
    o = adjusted.outcome
    assert "1.040" in text
    assert "2.60 µm, 0.29 px" in text
    assert f"{o.redundancy} of {o.observations} observations" in text
    for name in adjusted.block.images.names:
        assert name in text
    row = next(r for r in re.findall(r"<tr>(.*?)</tr>", page, re.S) if "<td>bluh.4</td><td>ucd2" in r)
    t = adjusted.parameters.t[list(adjusted.parameters.names).index("bluh.4")]
    assert f">{t:.1f}<" in row


def test_reads_top_to_bottom(page):
    headings = re.findall(r"<h2[^>]*>(.*?)</h2>", page)
    assert headings == [
        "What was adjusted", "Is it good?", "Control and check points", "What the camera does wrong",
        "Which parameters matter", "What they change at check points", "Residuals",
        "The work list: what to look at first", "All settings",
    ]  # fmt: skip


def test_tables_scroll_and_long_ones_are_folded(page):
    assert page.count("<table") == page.count('<div class="scroll')
    folded = re.search(r"<details>(?:(?!</details>).)*Exterior orientation(?:(?!</details>).)*</details>", page, re.S)
    assert folded
    assert folded.group().count("<tr>") == 25


def test_dark_and_paper(page):
    assert "@media (prefers-color-scheme: dark)" in page
    assert ':root[data-theme="dark"]' in page
    assert "@media print" in page


def test_failure_is_said_first(adjusted, plots):
    outcome = replace(adjusted.outcome, status="not converged", message="the step grows")
    text = Page(report_html(replace(adjusted, outcome=outcome), plots)).text
    assert text.index("the step grows") < text.index("What was adjusted")
    assert "no result" in text


def test_without_control_check_and_parameters():
    adjusted = make_adjusted_block(2, 4, 60, parameters="none")
    empty = replace(
        adjusted.check, point=np.zeros(0, np.int64), difference=np.zeros((0, 3)), sigma=np.zeros((0, 3)),
        r=np.zeros((0, 3)), w=np.zeros((0, 3)), rays=np.zeros(0, np.int64),
    )  # fmt: skip
    bare = replace(adjusted, control=empty, check=empty, blunders=(), groups=(),
                   outcome=replace(adjusted.outcome, warnings=()))  # fmt: skip
    text = Page(report_html(bare, all_plots(bare))).text
    assert "nothing here tests the block from outside" in text
    assert "There are no check points" in text


def test_written_once_rendered_once(adjusted, tmp_path):
    """What save_plots returns goes into the report as it is."""
    rendered = save_plots({"rays_per_point": all_plots(adjusted)["rays_per_point"]}, tmp_path / "plots")
    write_report(adjusted, rendered, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert base64.b64encode((tmp_path / "plots" / "rays_per_point.svg").read_bytes()).decode() in text


def test_links_lead_somewhere(page):
    places = set(re.findall(r' id="([^"]+)"', page))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= places
    assert len(re.findall(r"<nav>(.*?)</nav>", page, re.S)[0].split("</a>")) == 10


def test_lights_are_words_and_shapes(page, adjusted):
    """Colour alone says nothing on paper: every light has its word, every number its threshold beside it."""
    rows = re.findall(r'<tr><td class="lamp">(.*?)</td>(.*?)</tr>', page, re.S)
    expected = findings(adjusted)
    assert len(rows) == len(expected)
    for (lamp, rest), finding in zip(rows, expected, strict=True):
        assert f'light {finding.level}"' in lamp
        assert f">{finding.level}<" in lamp
        cells = Page(rest.replace("&lt;", "below")).text
        assert finding.value.split()[0] in cells
        assert finding.expected.split()[0].replace("<", "below") in cells


def test_plan_has_every_photograph_and_ground_point(adjusted):
    drawn = interactive_plan(adjusted)
    block = adjusted.block
    assert [spot.name for spot in drawn.of_kind("photograph")] == block.images.names.tolist()
    assert [spot.name for spot in drawn.of_kind("control")] == block.points[adjusted.control.point].tolist()
    assert [spot.name for spot in drawn.of_kind("check")] == block.points[adjusted.check.point].tolist()
    # metres from the middle, y down
    spot = drawn.of_kind("photograph")[5]
    x, y = adjusted.images.centre[5, :2]
    assert spot.x + drawn.origin[0] == pytest.approx(x, abs=2 * drawn.unit)
    assert drawn.origin[1] - spot.y == pytest.approx(y, abs=2 * drawn.unit)
    assert len(spot.outline) == 8
    corners = np.array(spot.outline).reshape(4, 2)
    np.testing.assert_allclose(corners.mean(axis=0), (spot.x, spot.y), atol=40.0)
    left, top, width, height = drawn.view
    for one in drawn.spots:
        assert left < one.x < left + width
        assert top < one.y < top + height
    critical = 3.29
    assert {s.name for s in drawn.of_kind("point")} <= set(block.points[adjusted.points.max_abs_w > critical])


def test_groups_stand_in_their_units(adjusted):
    groups = [ObservationGroup(name, 10, 2e-4, 2e-4, 5.0, 3e-4) for name in
              ("image points", "image points day 1", "control height", "projection centres", "attitudes", "INS kappa",
               "weighted parameters")]  # fmt: skip
    shown = observation_groups(replace(adjusted, groups=tuple(groups)))
    assert [row[1] for row in shown.rows] == ["µm", "µm", "m", "m", "mgon", "mgon", "σ"]
    assert shown.rows[4][4] == pytest.approx(2e-4 * 200000 / np.pi)
    assert shown.rows[0][4] == 2e-4


def test_removed_parameters_are_listed_with_their_reason(adjusted):
    removal = Removal("bluh.4", "ucd2", "P", 2e-6, 5e-6, 0.3, "bluh.2", 0.4, 1.0, "t 0.4 below 1")
    text = Page(report_html(replace(adjusted, removals=(removal,)), {})).text
    after = text[text.index("Parameters removed") :]
    assert after.index("bluh.4") < after.index("t 0.4 below 1") < after.index("What they change")


def test_two_groups_are_compared():
    adjusted = make_adjusted_block(2, 4, 60, groups="day")
    changes = group_changes(adjusted)
    text = Page(report_html(adjusted, all_plots(adjusted, changes), Findings(changes=changes))).text
    assert "the image errors of day 1 and day 2 differ: RMS" in text
    assert "The systematic image errors of two groups and their difference" in text
