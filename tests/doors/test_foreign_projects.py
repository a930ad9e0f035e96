"""Projects of other programs: nothing in them is taken for what it is not."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.foreign_json import read_foreign_json
from aerotri.formats.block.folder import read_block
from places import SHARED_DATA


def test_a_second_component_of_metashape_is_named(door, run):
    door("metashape_two_components")
    found = run("convert twocomp.xml --image-points pts_n.mes --out B --image-sigma-px 0.3")
    assert found.exit_code == 0
    assert "2 photographs of component 'Component 2' without orientation" in found.output
    block = read_block("B")
    names = block.images.names
    there = np.isfinite(block.images.centre).all(axis=1)
    assert set(names[~there].tolist()) == {"IMG_21.JPG", "IMG_22.JPG"}
    fit = float(found.output.split("fit the given orientations to ")[1].split(" px")[0])
    assert fit < 1.0


def test_aspect_is_estimated_where_the_script_estimates_all(run, tmp_path, monkeypatch):
    source = SHARED_DATA / "camcaldemo"
    if not source.is_dir():
        pytest.skip("real data: camcaldemo is not beside the project")
    folder = shutil.copytree(source, tmp_path / "camcaldemo")
    monkeypatch.chdir(tmp_path)
    script = folder / "camcaldemo.xml"
    script.chmod(0o644)
    text = script.read_text()
    for name, changed in (("all", text), ("said", text.replace("<all>true</all>\n          <skew>", "<all>true</all>"
        "<aspect>true</aspect>\n          <skew>"))):  # fmt: skip
        script.write_text(changed)
        assert run(f"convert {script} --out {name}").exit_code == 0
        assert read_block(name).settings.adjustment.additional_parameters == (
            ("brown", ("K1", "K2", "K3", "P1", "P2", "b1")),
        )
    script.write_text(text.replace("<skew>false", "<skew>true"))
    with pytest.raises(InputError, match="the script estimates skew"):
        run(f"convert {script} --out skew")


def test_opensfm_without_positions(door, run):
    door("opensfm_no_gps")
    found = run("convert . --out B --pixel-um 7.5 --image-sigma-px 0.15")
    assert found.exit_code == 0
    assert "12 photographs without GNSS position" in found.output
    assert "add control points" in found.output
    assert "around latitude" not in found.output
    block = read_block("B")
    assert block.gnss_ins is None
    assert block.settings.adjustment.datum == "minimal"


def test_half_a_character_of_a_name(door, run):
    door("opensfm_surrogate")
    with pytest.raises(InputError, match=r"reconstruction\.json:1: a text has half a character, \\ud83d"):
        run("convert . --out B")


@pytest.mark.parametrize(
    ("text", "half"),
    [
        (r"\ud83d", r"\ud83d"), (r"\\ud83d\ude00", r"\ude00"), (r"\ud83d\\ude00", r"\ud83d"),
        (r"\ude00\ud83d", r"\ude00"), (r"a\"\uDC00", r"\udc00"), (r"\ud83d\ude00", ""), (r"\\ud83d", ""),
        (r"\\\ud83d\ude00", ""),
    ],
)  # fmt: skip
def test_halves_of_characters(tmp_path, text, half):
    """Behind an escaped backslash there is no escape."""
    path = tmp_path / "names.json"
    path.write_text('{"other": "x",\n "name": "' + text + '", "' + text + '": 1}')
    if not half:
        json.dumps(read_foreign_json(path, ""), ensure_ascii=False).encode("utf-8")
        return
    with pytest.raises(InputError, match=re.escape(f"half a character, {half}")) as caught:
        read_foreign_json(path, "")
    assert caught.value.line == 2
