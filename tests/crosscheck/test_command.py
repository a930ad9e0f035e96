"""`aerotri crosscheck` as a user meets it."""

import csv
import json
import subprocess
import sys

import pytest

from aerotri.formats.block.folder import write_block
from small_blocks import small_block


def run(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "aerotri.cli", *map(str, arguments)],
        capture_output=True, text=True, cwd=cwd, timeout=1200, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def block_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blocks") / "small"
    write_block(small_block(31, "bluh:1-4")[0], folder)
    return folder


def test_a_block_is_adjusted_and_checked(block_folder, tmp_path):
    done = run("crosscheck", block_folder, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    out = tmp_path / "small_crosscheck"
    written = {p.name for p in out.iterdir()} - {".aerotri-files"}
    assert written == {"crosscheck.json", "crosscheck.csv", "plots", "report.html"}
    assert {p.name for p in (out / "plots").iterdir()} - {".aerotri-files"} == {"crosscheck.png", "crosscheck.svg"}
    content = json.loads((out / "crosscheck.json").read_text(encoding="utf-8"))
    assert content["verdict"] == "agrees"
    assert done.stdout.startswith(content["message"])
    with open(out / "crosscheck.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["kind"] for row in rows} >= {"object points", "additional parameters"}
    assert all(float(row["max"]) < 0.05 for row in rows)


def test_a_result_is_reopened(block_folder, tmp_path):
    assert run("adjust", block_folder, "--out", tmp_path / "result", "--no-plots").returncode == 0
    done = run("crosscheck", tmp_path / "result", "--out", tmp_path / "check", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "agrees"
    again = run("crosscheck", tmp_path / "result", "--out", tmp_path / "check")
    assert again.returncode == 0, again.stderr


def test_what_cannot_be_checked(tmp_path):
    missing = run("crosscheck", tmp_path / "nothing", cwd=tmp_path)
    assert missing.returncode == 2
    assert "there is no such file or folder" in missing.stderr
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("keep me")
    foreign = run("crosscheck", tmp_path / "nothing", "--out", tmp_path / "notes")
    assert foreign.returncode == 2
    assert (tmp_path / "notes" / "mine.txt").exists()


def test_a_block_that_cannot_be_adjusted(block_folder, tmp_path):
    import shutil

    shutil.copytree(block_folder, tmp_path / "loose")
    (tmp_path / "loose" / "control.csv").unlink()
    done = run("crosscheck", tmp_path / "loose", cwd=tmp_path)
    assert done.returncode == 1
    assert "rank deficient" in done.stderr
    assert not (tmp_path / "loose_crosscheck").exists()
