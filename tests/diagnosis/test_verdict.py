"""The verdict: faultless blocks pass it, worthless ones do not."""

from __future__ import annotations

import json

import pytest

from aerotri.commands.adjust import run_adjust
from aerotri.formats.block_folder import write_block
from aerotri.pipeline import adjust
from ten_photographs import ten_photographs, with_image_points


@pytest.mark.parametrize("navigated", [True, False])
def test_a_faultless_block_is_accepted(navigated):
    outcome = adjust(ten_photographs(navigated=navigated)).outcome
    assert (outcome.verdict, outcome.reasons) == ("accepted", ())


def test_one_photograph_negated_is_rejected_and_written(tmp_path, capsys):
    """x and y of one photograph negated: it converges, and is worth nothing."""
    block = with_image_points(ten_photographs(), 3, lambda xy: -xy)
    write_block(block, tmp_path / "block")
    out = tmp_path / "result"
    assert run_adjust(tmp_path / "block", out, None, None, None, False, True) == 1
    written = json.loads((out / "adjustment.json").read_text())
    assert written == json.loads(capsys.readouterr().out) | {"timings_s": written["timings_s"]}
    assert written["verdict"] == "rejected"
    assert written["reasons"]
    assert (out / "points.csv").is_file()
