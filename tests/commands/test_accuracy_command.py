"""`aerotri accuracy` on the command line, and the page it writes."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.cli.app import invoke
from aerotri.report.pages.adjustment import report_html
from small_blocks import small_block


@pytest.fixture(scope="module")
def adjusted():
    """A small block with eight check points, adjusted."""
    return aerotri.adjust(small_block(1)[0], explain=False)


@pytest.fixture(scope="module")
def result(adjusted, tmp_path_factory):
    return adjusted.save(tmp_path_factory.mktemp("accuracy") / "small_result", plots=False)


@pytest.fixture(scope="module")
def names(adjusted):
    return adjusted.check["point"].tolist()


def test_command(adjusted, result, names, tmp_path, capsys):
    """What is written and printed is what the package gives before the result was saved, by hand from its table."""
    out, wooded = tmp_path / "page", tmp_path / "wooded.txt"
    wooded.write_text(f"point\n# along the river\n{names[0]}\n")
    words = ["--class-horizontal", "20", "--class-vertical", "30", "--vegetated", str(wooded), "--out", str(out)]
    assert invoke(["accuracy", str(result), *words]) == 0
    printed = capsys.readouterr().out
    content = json.loads((out / "accuracy.json").read_text(encoding="utf-8"))
    found = aerotri.accuracy(adjusted, class_horizontal=0.2, class_vertical=0.3, vegetated=names[:1])
    check = adjusted.check
    fit = np.sqrt(np.mean(check["dX"] ** 2) + np.mean(check["dY"] ** 2))
    assert content["accuracy"]["RMSE_H"] == pytest.approx(np.hypot(fit, np.sqrt(2.0) * 0.03), rel=1e-6)
    assert content["accuracy"]["RMSE_V"] == pytest.approx(
        np.hypot(np.sqrt(np.mean(check["dZ"][1:] ** 2)), 0.05), rel=1e-6
    )
    assert content["accuracy"]["VVA"] == pytest.approx(np.hypot(check["dZ"][0], 0.05), rel=1e-6)
    assert found.rmse_h == pytest.approx(content["accuracy"]["RMSE_H"], rel=1e-6)
    assert [one["met"] for one in content["requirements"]] == found.requirements["met"].tolist()
    page = (out / "accuracy.html").read_text(encoding="utf-8")
    for text in found.statements:
        assert text in page
        assert text in printed
    for mark in ("✓ met", "✗ not met"):
        assert mark in page
    assert page.count("<circle") == len(names)
    assert "://" not in page


def test_without_check_points(tmp_path, capsys):
    """Said plainly with what to do; the exit code is that of a doubtful result, 0."""
    block = small_block(1, control={"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05]})[0]
    folder = aerotri.adjust(block, explain=False).save(tmp_path / "bare_result", plots=False)
    assert invoke(["accuracy", str(folder), "--class-vertical", "5", "--out", str(tmp_path / "a")]) == 0
    printed = capsys.readouterr().out
    assert "Without check points no accuracy can be stated." in printed
    assert "--check NAME" in printed
    content = json.loads((tmp_path / "a" / "accuracy.json").read_text(encoding="utf-8"))
    assert (content["check_points"], content["accuracy"]["RMSE_V"]) == (0, None)
    assert [text for text in content["statements"] if "produced to meet" in text] == content["statements"]
    assert "no check points" in (tmp_path / "a" / "accuracy.html").read_text(encoding="utf-8")


def test_hostile_names_stay_text():
    """Names of points are text of the user: nothing in them runs on the page."""
    block = small_block(1)[0]
    renamed = block.points.astype(object)
    renamed[block.control.point[block.control.is_check][0]] = "<script>alert(1)</script>"
    found = aerotri.accuracy(aerotri.adjust(replace(block, points=renamed.astype(str)), explain=False))
    assert "<script>" not in found.html()
    assert "&lt;script&gt;" in found.html()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"nobody\n", "nobody' is no check point"),
        (b"", "names no point"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"TWICE\nTWICE\n", "is there twice"),
        (b"a\x07b\n", "cannot be the name"),
    ],
)
def test_lists_that_are_refused(result, names, tmp_path, content, said):
    """Each with the file, and nothing is written."""
    path, out = tmp_path / "list.txt", tmp_path / "out"
    path.write_bytes(content.replace(b"TWICE", names[0].encode()))
    with pytest.raises(aerotri.InputError, match=said) as error:
        invoke(["accuracy", str(result), "--vegetated", str(path), "--out", str(out)])
    assert "list.txt" in str(error.value)
    assert not out.exists()


def test_refused_input(adjusted, tmp_path):
    for words, said in (
        ({"class_horizontal": 0.0}, "class horizontal 0"),
        ({"class_vertical": float("nan")}, "class vertical nan"),
        ({"project_area": -1.0}, "project area"),
        ({"vegetated": ["nobody"]}, "'nobody' is no check point"),
    ):
        with pytest.raises(aerotri.InputError, match=said):
            aerotri.accuracy(adjusted, **words)
    with pytest.raises(aerotri.InputError, match="holds no adjustment"):
        invoke(["accuracy", str(tmp_path), "--out", str(tmp_path / "a")])


def test_rmse_h_is_one_number_on_every_page(adjusted):
    """Screen, report and statement have that of the standard, with the survey error; the fit has other names."""
    found = aerotri.accuracy(adjusted)
    line = re.search(
        r"check points: RMS .*; RMSE_H ([\d.]+), RMSE_V ([\d.]+) m with the survey error", adjusted.summary()
    )
    assert line is not None
    assert [float(number) for number in line.groups()] == pytest.approx([found.rmse_h, found.rmse_v], abs=6e-4)
    page = report_html(adjusted.adjusted, {})
    assert f"<b>{line[1]} / {line[2]} m</b>" in page
    assert page.count("RMSE_H, survey error included") == 1
    assert f"RMSE_H {100.0 * found.rmse_h:.2f} cm" in found.summary()
    assert not [text for text in adjusted.findings["quantity"] if "RMSE" in text]
