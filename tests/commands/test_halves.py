"""`aerotri halves` on the command line."""

from __future__ import annotations

import json

import pytest

import aerotri
from aerotri.cli.app import invoke
from small_blocks import small_block


@pytest.fixture(scope="module")
def adjusted():
    """A small block with control everywhere, adjusted."""
    block, _ = small_block(1, "brown:K1+K2", control={"distance_bases": 1.0, "sigma_m": [0.03, 0.03, 0.05]})
    return aerotri.adjust(block, explain=False)


@pytest.fixture(scope="module")
def result(adjusted, tmp_path_factory):
    return adjusted.save(tmp_path_factory.mktemp("halves") / "small_result", plots=False)


def test_command(adjusted, result, tmp_path, capsys):
    """What is written and printed is what the package gives for the same adjustment before it was saved."""
    out = tmp_path / "halves"
    assert invoke(["halves", str(result), "--division", "photographs", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    found = aerotri.halves(adjusted, ["photographs"])
    assert found.conclusion[0] in printed
    content = json.loads((out / "halves.json").read_text(encoding="utf-8"))
    (division,) = content["divisions"]
    for test, (_, expected) in zip(division["tests"], found.record.comparisons[0].tests, strict=True):
        assert test["statistic"] == pytest.approx(expected.statistic, rel=1e-4)
        assert test["rms_z"] == pytest.approx(expected.rms_z, rel=1e-4)
    cells = (out / "ground_cells.csv").read_text(encoding="utf-8").splitlines()
    assert len(cells) == 1 + len(found.ground_cells)
    assert {path.name for path in (out / "plots").glob("*.png")} == {
        "heights_photographs.png", "image_errors_photographs.png",
    }  # fmt: skip


def test_refused_input(result, tmp_path):
    """A division that does not exist, a folder without a result: nothing is written."""
    refused = (result, ["--division", "days"], "'days' is no division"), (tmp_path, [], "holds no adjustment")
    for folder, words, said in refused:
        with pytest.raises(aerotri.InputError, match=said):
            invoke(["halves", str(folder), *words, "--out", str(tmp_path / "a")])
        assert not (tmp_path / "a").exists()
