"""The page in a headless browser: no errors, hostile names stay text, tables sort and filter, the plan answers."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pytest
from test_html import HOSTILE, hostile_block

from aerotri.report.pages.adjustment import report_html
from synthetic import make_adjusted_block

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--window-size=1400,3000",
    "--enable-logging=stderr", "--v=0",
)  # fmt: skip

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no chromium to open the page in")


@pytest.fixture(scope="module")
def page():
    return report_html(make_adjusted_block(3, 8, 200), {})


def opened(text: str, folder: Path, script: str = "") -> tuple[str, list[str]]:
    """The page's tree after its scripts have run, and the lines it wrote to the console.

    The page's policy lets only its own script run, so one appended by a test is added to the policy by its digest.
    """
    if script:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        text = text.replace("script-src '", f"script-src 'sha256-{digest}' '", 1)
        text = text.replace("</body>", f"<script>{script}</script></body>")
    path = folder / "page.html"
    path.write_text(text, encoding="utf-8")
    call = [str(BROWSER), *FLAGS, f"--user-data-dir={folder / 'profile'}", "--dump-dom", path.as_uri()]
    done = subprocess.run(call, capture_output=True, text=True, timeout=120, check=True)
    assert "</html>" in done.stdout
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def told(text: str, folder: Path, expression: str):
    """The value of a JavaScript expression in the page, through JSON."""
    script = f"""
const say = document.createElement("pre");
say.id = "told";
say.textContent = JSON.stringify((() => {{ {expression} }})());
document.body.append(say);
"""
    dom, console = opened(text, folder, script)
    assert console == []
    found = re.search(r'<pre id="told">(.*?)</pre>', dom, re.S)
    assert found
    return json.loads(unescape(found[1]))


def test_opens_without_a_word_on_the_console(page, tmp_path):
    dom, console = opened(page, tmp_path)
    assert console == []
    assert 'id="theme"' in dom


def test_hostile_names_stay_text(tmp_path):
    """A name that is a script neither runs nor becomes an element, also where the page's script writes it."""
    text = report_html(hostile_block(), {})
    result = told(text, tmp_path, """
      const map = document.querySelector("svg.map");
      const [, x, y] = JSON.parse(document.getElementById("plan-data").textContent)[0];
      const frame = map.getBoundingClientRect(), view = map.viewBox.baseVal;
      map.dispatchEvent(new PointerEvent("pointermove", {
        clientX: frame.left + (x - view.x) / view.width * frame.width,
        clientY: frame.top + (y - view.y) / view.height * frame.height }));
      return {
        scripts: document.scripts.length,
        on: document.querySelectorAll("[onload], [onerror]").length,
        said: document.querySelector(".plan output").textContent,
        cells: Array.from(document.querySelectorAll("td")).filter((one) => one.textContent.includes("<script>")).length,
      };
    """)  # fmt: skip
    assert result["scripts"] == 3  # the data of the plan, the page's script, this one
    assert result["on"] == 0
    assert HOSTILE in result["said"]
    assert result["cells"] > 40


def test_nothing_else_may_run(page, tmp_path):
    """A script that the policy does not know is refused."""
    dom, console = opened(page.replace("</body>", "<script>document.title = 'mine'</script></body>"), tmp_path)
    assert "<title>mine" not in dom
    assert any("Content Security Policy" in line for line in console)


def test_tables_sort(page, tmp_path):
    """By number, what is not known last both ways; a third click brings the first order back."""
    result = told(page, tmp_path, """
      const table = Array.from(document.querySelectorAll("table.list")).find((one) =>
        one.tHead.textContent.includes("largest r"));
      const heads = Array.from(table.tHead.rows[0].cells);
      const column = heads.findIndex((head) => head.textContent.trim() === "t");
      const read = () => Array.from(table.tBodies[0].rows).map((row) => row.cells[column].textContent);
      const orders = [read()];
      for (let k = 0; k < 3; k++) { heads[column].querySelector("button").click(); orders.push(read()); }
      heads[0].querySelector("button").click();
      return { orders, names: Array.from(table.tBodies[0].rows).map((row) => row.cells[0].textContent),
               aria: heads.map((head) => head.getAttribute("aria-sort")) };
    """)  # fmt: skip
    first, falling, rising, again = result["orders"]
    numbers = [float(text) for text in falling if text != "–"]
    assert numbers == sorted(numbers, reverse=True) != [float(text) for text in first if text != "–"]
    assert [float(text) for text in rising if text != "–"] == numbers[::-1]
    assert again == first
    names = result["names"]
    assert names.index("bluh.2") < names.index("bluh.10"), "numbers inside names count as numbers"
    assert result["aria"][0] == "ascending"
    assert set(result["aria"][1:]) == {None}


def test_tables_filter(page, tmp_path):
    result = told(page, tmp_path, """
      const table = Array.from(document.querySelectorAll("table.list")).find((one) =>
        one.tHead.textContent.includes("largest r"));
      const field = table.parentElement.previousElementSibling.querySelector("input");
      const shown = () => Array.from(table.tBodies[0].rows).filter((row) => !row.hidden).length;
      const all = shown();
      field.value = "BLUH ucd2"; field.dispatchEvent(new Event("input"));
      const some = shown();
      const rows = Array.from(table.tBodies[0].rows).map((row) => row.textContent);
      const wanted = rows.filter((text) => text.includes("bluh") && text.includes("ucd2")).length;
      const count = field.nextElementSibling.textContent;
      field.value = "no such thing"; field.dispatchEvent(new Event("input"));
      const none = shown();
      field.value = ""; field.dispatchEvent(new Event("input"));
      return [all, some, none, shown(), count, wanted];
    """)  # fmt: skip
    every, some, none, again, count, wanted = result
    assert every == again > some == wanted > 0
    assert none == 0
    assert count == f"{some} of {every} rows"


def test_the_plan_zooms_and_says_what_is_under_the_pointer(page, tmp_path):
    """A photograph in the middle of the screen is named before and after zooming; the outline is its footprint."""
    result = told(page, tmp_path, """
      const map = document.querySelector("svg.map");
      const said = document.querySelector(".plan output");
      const spots = JSON.parse(document.getElementById("plan-data").textContent);
      const answers = [];
      const at = (spot) => {
        const frame = map.getBoundingClientRect(), view = map.viewBox.baseVal;
        return { clientX: frame.left + (spot[1] - view.x) / view.width * frame.width,
                 clientY: frame.top + (spot[2] - view.y) / view.height * frame.height };
      };
      const ask = (spot) => {
        map.dispatchEvent(new PointerEvent("pointermove", at(spot)));
        answers.push([spot[3], said.querySelector("b")?.textContent, map.querySelector(".chosen").getAttribute("d")]);
      };
      const wide = map.viewBox.baseVal.width;
      for (const kind of ["photograph", "control", "check"]) ask(spots.find((spot) => spot[0] === kind));
      const photograph = spots.find((spot) => spot[0] === "photograph");
      map.focus();
      for (let k = 0; k < 4; k++) {
        map.dispatchEvent(new WheelEvent("wheel", { deltaY: -1, cancelable: true, ...at(photograph) }));
      }
      ask(photograph);
      const zoomed = map.viewBox.baseVal.width;
      const length = document.querySelector(".length-text").textContent;
      map.dispatchEvent(new PointerEvent("pointermove", { clientX: -500, clientY: -500 }));
      const hint = said.textContent;
      Array.from(document.querySelectorAll(".tools button")).find((one) => one.textContent === "whole block").click();
      return { answers, wide, zoomed, length, hint, again: map.viewBox.baseVal.width };
    """)  # fmt: skip
    for name, answer, _ in result["answers"]:
        assert answer == name
    assert result["answers"][0][2].startswith("M")
    assert result["answers"][1][2] == ""
    assert result["zoomed"] == pytest.approx(result["wide"] * 0.8**4)
    assert result["again"] == pytest.approx(result["wide"])
    assert re.fullmatch(r"[125]0* (m|km)", result["length"])
    assert "Point at" in result["hint"]


def test_dark_and_light(page, tmp_path):
    """The button changes the colours of the page, and back."""
    result = told(page, tmp_path, """
      const paint = () => getComputedStyle(document.body).backgroundColor;
      const button = document.getElementById("theme");
      const first = paint();
      button.click();
      const second = paint();
      button.click();
      return [first, second, paint()];
    """)  # fmt: skip
    assert result[0] == result[2] != result[1]
