"""The page of a run: what the files of a step say, in words and units."""

from __future__ import annotations

import json

from aerotri.report.pages.run import run_page
from aerotri.results.head import Head


def test_numbers_of_a_step_have_words_and_units(tmp_path):
    (tmp_path / "ortho").mkdir()
    numbers = {"gsd_m": 0.02, "sigma_m": {"total": {"q95": 0.5}}, "area_m2": {"surface": 7}, "bands": 3}
    (tmp_path / "ortho" / "ortho.json").write_text(json.dumps(numbers), encoding="utf-8")
    step = {"name": "other", "folder": "ortho", "what": "Orthophoto", "status": "done", "reason": "", "seconds": 1.0,
            "arguments": ["ortho"]}  # fmt: skip
    page = run_page({"source": "photographs", "steps": [step], "seconds": 1.0}, tmp_path, Head())
    for words in ("GSD [m]", "σ of positions [m]: total: 95 % below", "area [m²]: surface", "bands"):
        assert f"<th>{words}</th>" in page
    assert "<th>gsd m</th>" not in page
