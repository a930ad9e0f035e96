"""`aerotri diff` and `adjust --check-free` as a user meets them."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from test_cli import run

from aerotri.commands.diff import run_diff
from aerotri.conventions import InputError
from aerotri.formats.block.folder import write_block
from small_blocks import small_block, with_adjustment


@pytest.fixture(scope="module")
def block():
    return small_block(31, "bluh:1-4")[0]


@pytest.fixture(scope="module")
def results(block, tmp_path_factory):
    """Two results: as it is, and without self-calibration, with one control point a metre off; checked free."""
    folder = tmp_path_factory.mktemp("diff")
    xyz = block.control.xyz.copy()
    row = np.flatnonzero(~block.control.is_check)[3]
    xyz[row, 0] += 1.0
    bad = replace(block, control=replace(block.control, xyz=xyz))
    write_block(block, folder / "good")
    write_block(with_adjustment(bad, additional_parameters=()), folder / "bad")
    first = run("adjust", folder / "good", "--out", folder / "first", "--no-plots")
    second = run("adjust", folder / "bad", "--out", folder / "second", "--check-free")
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    return folder, str(block.points[block.control.point[row]]), second.stdout


def test_diff_says_what_changed(results):
    folder, name, _ = results
    done = run("diff", folder / "first", folder / "second", "--top", "2")
    assert done.returncode == 0, done.stderr
    for words in ("bluh:1-4", f"{name} X", "σ is that of the second run", "Photographs that changed most",
                  "Parameters of one run only", "check points in common"):  # fmt: skip
        assert words in done.stdout, words
    assert "Rays used differently" not in done.stdout


def test_diff_json_is_against_the_written_results(results):
    folder, name, _ = results
    content = json.loads(run("diff", folder / "first", folder / "second", "--json").stdout)
    written = [json.loads((folder / r / "adjustment.json").read_text(encoding="utf-8")) for r in ("first", "second")]
    sigma0 = next(change for change in content["outcome"] if change["name"] == "sigma0")
    assert [sigma0["first"], sigma0["second"]] == pytest.approx([w["sigma0"] for w in written], rel=1e-9)
    for axis in "XYZ":
        for which, result in zip(("rms_first", "rms_second"), written, strict=True):
            assert content["check_points"][which][axis] == pytest.approx(result["check_points"]["rms"][axis], abs=1e-9)
    assert [change["name"] for change in content["control"]] == [f"{name} X"]
    assert [p["name"] for p in content["parameters"] if p["second"] is None] == [f"bluh.{k}" for k in range(1, 5)]
    rows = {result: (folder / result / "images.csv").read_text().splitlines() for result in ("first", "second")}
    x0 = [dict(zip(lines[0].split(","), lines[1].split(","), strict=True)) for lines in rows.values()]
    delta = float(x0[1]["X0"]) - float(x0[0]["X0"])
    one = json.loads(run("diff", folder / "first", folder / "second", "--json", "--top", "99").stdout)
    photograph = next(w for w in one["orientations"]["worst"] if w["name"] == x0[0]["image"])
    assert photograph["X0"] == pytest.approx(delta, abs=1e-6)


def test_diff_of_a_result_with_itself(results):
    folder, _, _ = results
    content = json.loads(run("diff", folder / "first", folder / "first", "--json").stdout)
    assert content["settings"] == content["control"] == []
    assert not any(content["rays"]["counts"].values())
    assert all(e["max"] == 0.0 for e in content["orientations"]["elements"])


def test_diff_refuses_what_is_no_result(results, tmp_path):
    folder, _, _ = results
    no_solution, damaged, other = (tmp_path / name for name in ("nosolution", "damaged", "other"))
    for copy in (no_solution, damaged, other):
        shutil.copytree(folder / "first", copy)
    (no_solution / "solution.npz").unlink()
    (damaged / "solution.npz").write_bytes((damaged / "solution.npz").read_bytes()[:400])
    shutil.rmtree(other / "block")
    write_block(small_block(3)[0], other / "block")
    (tmp_path / "empty").mkdir()
    for bad, words in (
        (tmp_path / "nowhere", "nowhere"), (tmp_path / "empty", "adjustment.json"), (no_solution, "solution.npz"),
        (damaged, "solution.npz"), (other, "solution.npz"), (folder / "good", "adjustment.json"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=re.escape(words)) as caught:
            run_diff(folder / "first", bad, 5, False)
        assert bad.name in str(caught.value), "both folders hold files of the same names"
    with pytest.raises(InputError, match="--top -1"):
        run_diff(folder / "first", folder / "second", -1, False)
    done = run("diff", folder / "first", no_solution)
    assert done.returncode == 2
    # on a busy machine a line of progress may stand before it
    assert done.stderr.strip().splitlines()[-1].startswith("aerotri: result ")


def test_check_free_names_the_control_point(results):
    folder, name, printed = results
    assert "free adjustment: control" in printed
    assert f"Look first at {name}: given X too large by" in printed
    content = json.loads((folder / "second" / "check_free.json").read_text(encoding="utf-8"))
    assert content["verdict"] == "control"
    assert content["stages"][1]["suspects"][0]["name"] == name
    written = json.loads((folder / "second" / "adjustment.json").read_text(encoding="utf-8"))
    assert "check_free" not in written
    assert content["sigma0_full"] == pytest.approx(written["sigma0"])
    page = (folder / "second" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Free adjustment</h2>" in page
    assert f"Look first at {name}" in page


def test_check_free_of_an_older_run_does_not_stay(results, tmp_path):
    folder, _, _ = results
    shutil.copytree(folder / "second", tmp_path / "out")
    assert run("adjust", folder / "good", "--out", tmp_path / "out", "--no-plots").returncode == 0
    assert not (tmp_path / "out" / "check_free.json").exists()


def test_check_free_of_a_free_block_is_refused(block, tmp_path):
    write_block(with_adjustment(block, datum="inner"), tmp_path / "free")
    done = run("adjust", tmp_path / "free", "--check-free", cwd=tmp_path)
    assert done.returncode == 2
    assert "--check-free" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_check_free_where_control_does_not_hold(block, tmp_path):
    """Too little control: exit 1, and the free block is judged all the same."""
    is_check = np.ones(len(block.control), dtype=bool)
    is_check[np.flatnonzero(~block.control.is_check)[0]] = False
    write_block(replace(block, control=replace(block.control, is_check=is_check)), tmp_path / "held")
    done = run("adjust", tmp_path / "held", "--check-free", cwd=tmp_path)
    assert done.returncode == 1
    assert "rank deficient" in done.stderr
    assert "The tie points fit one another" in done.stdout
    assert not (tmp_path / "held_result").exists()


def test_json_output_stays_the_adjustment(block, tmp_path):
    write_block(block, tmp_path / "b")
    done = run("adjust", tmp_path / "b", "--out", tmp_path / "o", "--check-free", "--json", "--no-plots")
    assert json.loads(done.stdout)["status"] == "converged"
    assert (tmp_path / "o" / "check_free.json").exists()
