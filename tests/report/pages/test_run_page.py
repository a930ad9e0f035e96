"""The page of a run: what the files of a step say, in words and units."""

from __future__ import annotations

import json

import pytest

from aerotri.report.pages.run import run_page
from aerotri.results.head import Head


def test_numbers_of_a_step_have_words_and_units(tmp_path):
    (tmp_path / "dtm").mkdir()
    numbers = {"gsd_m": 0.02, "sigma_Z_m": {"matching": 0.5}, "ray_sigma_px": 0.1, "photographs": 3}
    (tmp_path / "dtm" / "dtm.json").write_text(json.dumps(numbers), encoding="utf-8")
    step = {"name": "dtm", "folder": "dtm", "what": "Terrain", "status": "done", "reason": "", "seconds": 1.0,
            "arguments": ["dtm"]}  # fmt: skip
    page = run_page({"source": "photographs", "steps": [step], "seconds": 1.0}, tmp_path, Head())
    for words in ("GSD [m]", "σ of heights [m]: matching", "σ of a matched image coordinate [px]", "photographs"):
        assert f"<th>{words}</th>" in page
    assert "<th>gsd m</th>" not in page


def test_plots_of_a_step_come_in_their_order_with_what_they_show(tmp_path):
    (tmp_path / "dtm" / "plots").mkdir(parents=True)
    for name in ("another_one", "pickets", "sigma", "surface"):
        (tmp_path / "dtm" / "plots" / f"{name}.png").write_bytes(name.encode())
    step = {"name": "dtm", "folder": "dtm", "what": "Terrain", "status": "done", "reason": "", "seconds": 1.0,
            "arguments": ["dtm"]}  # fmt: skip
    page = run_page({"source": "photographs", "steps": [step], "seconds": 1.0}, tmp_path, Head())
    places = [page.index(text) for text in ("Terrain with objects, lit", "σ of the heights", "Ground points (pickets)",
                                            "another one")]  # fmt: skip
    assert places == sorted(places)


@pytest.mark.parametrize("name", ["dsm", "ortho"])
def test_products_of_a_version_before_are_shown_by_their_numbers(tmp_path, name):
    """They do not say what the adjustment was like: nothing may call it accepted."""
    (tmp_path / name).mkdir()
    content = {
        "gsd_m": 0.02,
        "cell_m": 0.04,
        "sigma_Z_m": {"median": 0.1},
        "sigma_m": {"total": {"median": 0.1, "q95": 0.2}},
    }
    (tmp_path / name / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    step = {"name": name, "folder": name, "what": "Product", "status": "done", "reason": "", "seconds": 1.0,
            "arguments": [name]}  # fmt: skip
    page = run_page({"source": "photographs", "steps": [step], "seconds": 1.0}, tmp_path, Head())
    assert "GSD [m]" in page
    assert "accepted" not in page
