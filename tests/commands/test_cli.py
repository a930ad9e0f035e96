"""The commands as a user meets them: exit codes, one line of error, outputs whole or not at all."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

from aerotri.formats.block.folder import write_block
from aerotri.formats.results.adjustment import adjustment_json
from places import PROJECT
from small_blocks import small_block

DEMO = PROJECT / "blocks" / "frederiksstad_ultracam"


def run(*arguments, cwd=None, env=None):
    """The command in a process of its own, as a user runs it."""
    return subprocess.run(
        [sys.executable, "-m", "aerotri.cli", *map(str, arguments)],
        capture_output=True, text=True, cwd=cwd, env=env, timeout=1200, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def block_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blocks") / "small"
    write_block(small_block(31, "bluh:1-4")[0], folder)
    return folder


@pytest.fixture(scope="module")
def result_folder(block_folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "out"
    done = run("adjust", block_folder, "--out", out)
    assert done.returncode == 0, done.stderr
    return out


def test_adjust_writes_everything(result_folder):
    names = {p.name for p in result_folder.iterdir()}
    assert names - {".aerotri-files"} == {
        "adjustment.json", "images.csv", "points.csv", "residuals.parquet", "parameters.csv", "control.csv",
        "check.csv", "block", "solution.npz", "plots", "report.html", "work_list.csv", "parameter_effects.csv",
    }  # fmt: skip
    content = json.loads((result_folder / "adjustment.json").read_text(encoding="utf-8"))
    assert content["status"] == "converged"
    assert content["redundancy"] == content["observations"] - content["unknowns"] + content["conditions"]
    assert set(content["timings_s"]) == {"read", "start_values", "solve", "statistics", "plots", "write"}
    assert all(seconds > 0 for seconds in content["timings_s"].values())
    assert [p["name"] for p in content["additional_parameters"]] == ["bluh.1", "bluh.2", "bluh.3", "bluh.4"]
    table = pq.read_table(result_folder / "residuals.parquet")
    assert table.column_names[:12] == [
        "image", "point", "x", "y", "vx", "vy", "rx", "ry", "wx", "wy", "weight", "status",
    ]  # fmt: skip


def test_nothing_is_lost_without_plots(result_folder, block_folder, tmp_path):
    done = run("adjust", block_folder, "--out", tmp_path / "out", "--no-plots")
    assert done.returncode == 0, done.stderr
    for name in ("work_list.csv", "parameter_effects.csv"):
        text = (tmp_path / "out" / name).read_text(encoding="utf-8")
        assert text == (result_folder / name).read_text(encoding="utf-8")
        assert len(text.splitlines()) > 1


def test_result_is_the_adjustment_of_the_block_it_holds(result_folder, tmp_path):
    """The block beside the result, adjusted again, gives the same result to the last digit."""
    done = run("adjust", result_folder / "block", "--out", tmp_path / "again", "--no-plots")
    assert done.returncode == 0, done.stderr
    for name in ("images.csv", "points.csv", "parameters.csv", "control.csv"):
        assert (tmp_path / "again" / name).read_bytes() == (result_folder / name).read_bytes()


def test_command_line_settings_win(block_folder, tmp_path):
    done = run("adjust", block_folder, "--out", tmp_path / "o", "--parameters", "none", "--json", "--no-plots")
    content = json.loads(done.stdout)
    assert content["additional_parameters"] == []
    assert not (tmp_path / "o" / "report.html").exists()


def test_failed_adjustment_is_exit_1_and_leaves_the_old_result(block_folder, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(block_folder, broken)
    (broken / "control.csv").unlink()
    out = tmp_path / "out"
    assert run("adjust", block_folder, "--out", out, "--no-plots").returncode == 0
    before = (out / "adjustment.json").read_bytes()
    done = run("adjust", broken, "--out", out)
    assert done.returncode == 1
    assert "no control: the datum is free in X, Y, Z, ω, φ, κ, scale" in done.stderr
    assert "Traceback" not in done.stderr
    assert (out / "adjustment.json").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("adjust", "nowhere"), "nowhere"),
        (("adjust", "{block}", "--parameters", "bluh:1-13"), "bluh"),
        (("adjust", "{block}", "--robust", "strongly"), "robust"),
        (("adjust", "{block}", "--out", "{foreign}"), "other files"),
        (("convert", "{foreign}", "x"), "foreign"),
        (("convert", "{block}", "x", "--to", "pdf"), "pdf"),
        (("simulate", "{foreign}", "--out", "x"), ""),
        (("simulate", "{bad}", "--out", "x"), "bad.toml"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, words, block_folder, tmp_path):
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "precious.txt").write_text("do not touch")
    bad = tmp_path / "bad.toml"
    bad.write_text('name = "x"\n[flight\n')
    filled = [a.format(block=block_folder, foreign=foreign, bad=bad) for a in arguments]
    done = run(*filled, cwd=tmp_path)
    assert done.returncode == 2, done.stdout + done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stderr.startswith("aerotri: ")
    assert words in done.stderr
    assert (foreign / "precious.txt").read_text() == "do not touch"


def test_bad_table_names_file_and_line(block_folder, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(block_folder, broken)
    lines = (broken / "image_points.csv").read_text().splitlines()
    cells = lines[20].split(",")
    lines[20] = ",".join([cells[0], cells[1], "NaN", *cells[3:]])
    (broken / "image_points.csv").write_text("\n".join(lines) + "\n")
    done = run("adjust", broken, cwd=tmp_path)
    assert done.returncode == 2
    assert "image_points.csv:21:" in done.stderr


@pytest.mark.slow
def test_convert_round_trip_through_colmap_and_bal(result_folder, tmp_path):
    for to, name in (("colmap", "model"), ("colmap-text", "text"), ("bal", "problem.txt")):
        done = run("convert", result_folder, tmp_path / name, "--to", to)
        assert done.returncode == 0, done.stderr
        assert "could not be carried over" in done.stdout
        back = run("convert", tmp_path / name, tmp_path / f"{to}_block")
        assert back.returncode == 0, back.stderr
        adjusted = run("adjust", tmp_path / f"{to}_block", "--out", tmp_path / f"{to}_result", "--no-plots", "--json")
        assert adjusted.returncode == 0, adjusted.stderr
        assert json.loads(adjusted.stdout)["status"] == "converged"


def test_simulate_repeats(tmp_path):
    """The same bytes again on one processor; on another the same but for the last digit written."""
    spec = DEMO / "simulation.toml"
    for name in ("a", "b"):
        assert run("simulate", spec, "--out", tmp_path / name, "--seed", 1).returncode == 0
    for name in ("image_points.csv", "images.csv", "control.csv", "truth/points.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
        if not name.startswith("truth"):
            assert_same_table(tmp_path / "a" / name, DEMO / name)


def assert_same_table(path, stored):
    """The same words, and numbers that differ by less than a micrometre or its like."""
    found, expected = ([line.split(",") for line in p.read_text().splitlines()] for p in (path, stored))
    assert len(found) == len(expected), "the demo block is out of date"
    for cells, wanted in zip(zip(*found, strict=True), zip(*expected, strict=True), strict=True):
        if any("." in cell for cell in wanted):
            numbers = [np.array(column[1:], dtype=float) for column in (cells, wanted)]
            np.testing.assert_allclose(*numbers, rtol=0.0, atol=2e-6, err_msg="the demo block is out of date")
        else:
            assert cells == wanted, "the demo block is out of date"


def test_simulated_numbers_have_digits_that_mean_something(tmp_path):
    assert run("simulate", DEMO / "simulation.toml", "--out", tmp_path / "a", "--seed", 1).returncode == 0
    for name, decimals in (("image_points.csv", 7), ("images.csv", 9), ("control.csv", 6), ("truth/points.csv", 6)):
        longest = max(
            len(cell.partition(".")[2])
            for line in (tmp_path / "a" / name).read_text().splitlines()[1:]
            for cell in line.split(",")[1:]
            if "e" not in cell
        )
        assert 0 < longest <= decimals


def test_help_and_version():
    for command in ((), ("adjust",), ("simulate",), ("convert",)):
        done = run(*command, "--help")
        assert done.returncode == 0
        assert "Traceback" not in done.stderr
        assert not command or "Example: aerotri" in done.stdout
    assert run("--version").stdout.strip().count(".") == 2


@pytest.mark.slow
def test_read_only_installation_without_home(block_folder, tmp_path):
    """No writable place for compiled kernels: it runs, uncached, and says so."""
    package = PROJECT / "src" / "aerotri"
    site = tmp_path / "site"
    shutil.copytree(package, site / "aerotri", ignore=shutil.ignore_patterns("__pycache__"))
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA", "XDG", "HOME", "PYTHON"))}
    environment |= {"PYTHONPATH": str(site), "HOME": "/nonexistent", "PYTHONDONTWRITEBYTECODE": "1"}
    program = (
        "import numba.core.caching as c\n"
        "def nowhere(*a, **k): return None\n"
        "for locator in c.CacheImpl._locator_classes: locator.from_function = classmethod(nowhere)\n"
        "import sys; sys.argv = ['aerotri', 'adjust', sys.argv[1], '--out', sys.argv[2], '--no-plots']\n"
        "from aerotri.cli import main; main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(block_folder), str(tmp_path / "out")],
        capture_output=True, text=True, env=environment, timeout=1200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "there is no writable place" in done.stderr
    assert (tmp_path / "out" / "adjustment.json").exists()


def test_json_of_the_command_is_that_of_the_package(result_folder):
    from aerotri.formats.block.folder import read_block
    from aerotri.pipeline import adjust

    written = json.loads((result_folder / "adjustment.json").read_text(encoding="utf-8"))
    computed = adjustment_json(adjust(read_block(result_folder / "block")))
    for key in ("sigma0", "vtpv", "check_points", "control_points", "additional_parameters", "groups"):
        np.testing.assert_equal(written[key], json.loads(json.dumps(computed[key])))


def test_parameters_lists_and_draws(tmp_path):
    done = run("parameters", "--family", "bluh", "--draw", tmp_path / "drawn")
    assert done.returncode == 0, done.stderr
    assert "9            [P] radial symmetric r³" in done.stdout
    assert {p.name for p in (tmp_path / "drawn").iterdir()} == {"bluh.png", "bluh.svg"}
    entries = json.loads(run("parameters", "--json").stdout)
    families = {e["family"] for e in entries}
    assert {"bluh", "ultracam_d", "dmc", "brown", "ebner", "gruen", "fourier", "legendre"} <= families
    assert run("parameters", "--family", "nonsense").returncode == 2
