"""The commands on files: other rows, names, units and kinds of tables, and what they print is the same."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
from transformations import both, largest_difference, numbers_of, permuted, renamed, same
from typer.testing import CliRunner

from aerotri.cli import app
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.point_cloud import write_point_cloud
from aerotri.pipeline import adjust
from small_blocks import ERRING, small_block

ROWS = both(permuted(5), renamed)
OF_THE_RUN = {"timings_s", "seconds", "number"}
"""Keys about the run, and numbers given in the order of the table."""
RELATIVE, SMALL = 1e-6, 1e-9
"""By which printed numbers may differ: those of one adjustment differ by less than 1e-9 σ."""


def run(*arguments: object) -> str:
    found = CliRunner().invoke(app, [str(a) for a in arguments])
    if isinstance(found.exception, InputError):
        raise found.exception
    assert found.exit_code == 0, found.output + repr(found.exception)
    return found.stdout


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two folders, each with block, result, and the result without additional parameters; and the names."""
    here = tmp_path_factory.mktemp("metamorphic")
    block = small_block(3, "bluh:1-12", **ERRING)[0]
    changed = ROWS(block)
    for name, one in (("old", block), ("new", changed.block)):
        write_block(one, here / name / "block")
        run("adjust", here / name / "block", "--out", here / name / "result", "--no-plots")
        plain = ("--parameters", "none", "--no-plots")
        run("adjust", here / name / "block", "--out", here / name / "plain", *plain)
    return here, changed


def in_old_words(value, old):
    """What was printed with the names of the old block, lists of records in the order of their words."""
    if isinstance(value, dict):
        found = {in_old_words(k, old): in_old_words(v, old) for k, v in value.items() if k not in OF_THE_RUN}
        if {"first", "second", "mean"} <= found.keys() and found["first"] > found["second"]:
            # a step is that of one model less the other
            found |= {"first": found["second"], "second": found["first"], "mean": -found["mean"]}
        return found
    if isinstance(value, list):
        found = [in_old_words(v, old) for v in value]
        if found and all(isinstance(v, dict) for v in found):
            return sorted(found, key=lambda v: json.dumps(words_of(v)))
        return sorted(found) if found and all(isinstance(v, str) for v in found) else found
    if isinstance(value, str):
        for new in sorted(old, key=len, reverse=True):
            value = value.replace(new, old[new])
    return value


def with_points_in_order(content, old):
    """Differences at points as they stand beside the names of the points, by these names."""
    for kind in ("check", "control"):
        if "sets" in content:
            order = np.argsort([old.get(name, name) for name in content[f"{kind}_points"]])
            for one in content["sets"]:
                one[kind]["differences"] = [one[kind]["differences"][k] for k in order]
                if kind == "control":
                    said = one["prediction"]
                    said["control"] = [said["control"][k] for k in order if said["control"]]
    return content


def words_of(value):
    if isinstance(value, dict):
        return [words_of(v) for _, v in sorted(value.items())]
    return value if isinstance(value, str) else 0 if value is None else [] if isinstance(value, float | int) else 1


def assert_alike(one, other, where=""):
    if isinstance(one, dict):
        assert one.keys() == other.keys(), where
        for key in one:
            assert_alike(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), where
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            assert_alike(a, b, f"{where}[{k}]")
    elif isinstance(one, float) and one is not None:
        assert other == pytest.approx(one, rel=RELATIVE, abs=SMALL), where
    else:
        assert one == other, where


COMMANDS = {
    "deform a pair": ["deform", "{here}/result", "--pair", "2_003", "2_004", "--spacing", 40, "--out", "{here}/pair"],
    "deform the block": ["deform", "{here}/result", "--block", "--spacing", 60, "--out", "{here}/whole"],
    "imgeo": ["imgeo", "{here}/result", "--out", "{here}/ideal"],
    "diff": ["diff", "{here}/result", "{here}/plain", "--top", 0],
    "compare parameters": [
        "compare-parameters", "{here}/block", "--set", "none", "--set", "bluh:1-4", "--folds", 3,
        "--out", "{here}/sets",
    ],
}  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_same_words_and_numbers(command, made):
    here, changed = made
    old = {new: name for name, new in changed.names.items()}
    printed = []
    for name in ("old", "new"):
        called = (lambda word: word) if name == "old" else changed.name
        arguments = [called(a).replace("{here}", str(here / name)) if isinstance(a, str) else a
                     for a in COMMANDS[command]]  # fmt: skip
        text = run(*arguments, "--json").replace(str(here / name), "")
        names = old if name == "new" else {}
        printed.append(in_old_words(with_points_in_order(json.loads(text), names), names))
    assert_alike(*printed, where=command)


def scaled_table(path, factors):
    """A table with columns in another unit."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for name, factor in factors.items():
            if row.get(name):
                row[name] = repr(float(row[name]) * factor)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


@pytest.mark.parametrize(("angle", "per_degree"), [("gon", 400.0 / 360.0), ("rad", np.pi / 180.0)])
@pytest.mark.parametrize(("image", "per_mm"), [("um", 1000.0), ("px", None)])
def test_units_of_tables(angle, per_degree, image, per_mm, tmp_path):
    """Angles in gon and radians, image coordinates in µm and pixels: the block that is read is the same to rounding."""
    block = small_block(3)[0]
    write_block(block, tmp_path / "block")
    text = (tmp_path / "block" / "block.toml").read_text()
    text = re.sub(r'angle_unit = "deg"', f'angle_unit = "{angle}"', text)
    (tmp_path / "block" / "block.toml").write_text(re.sub(r'image_unit = "mm"', f'image_unit = "{image}"', text))
    scaled_table(tmp_path / "block" / "images.csv", dict.fromkeys(("omega", "phi", "kappa"), per_degree))
    points = tmp_path / "block" / "image_points.csv"
    if per_mm is not None:
        scaled_table(points, {"x": per_mm, "y": per_mm, "sx": per_mm, "sy": per_mm})
    else:
        in_pixels(points, block.cameras[0])
    before, after = numbers_of(adjust(block), same(block)), numbers_of(adjust(read := read_block(tmp_path / "block")),
                                                                       same(read))  # fmt: skip
    # pixels are rounded once more: some 1e-14 mm of 1e-3
    assert max(largest_difference(before, after).values()) < 1e-8


def in_pixels(path, camera):
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns, lines = camera.size_px
    for row in rows:
        row["x"] = repr(float(row["x"]) / camera.pixel_mm + columns / 2.0)
        row["y"] = repr(lines / 2.0 - float(row["y"]) / camera.pixel_mm)
        for name in ("sx", "sy"):
            if row.get(name):
                row[name] = repr(float(row[name]) / camera.pixel_mm)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def test_parquet_is_csv(tmp_path):
    block = small_block(3)[0]
    for tables in ("csv", "parquet"):
        write_block(block, tmp_path / tables, tables)
    one, two = (adjust(read_block(tmp_path / tables)) for tables in ("csv", "parquet"))
    np.testing.assert_array_equal(one.points.xyz, two.points.xyz)
    np.testing.assert_array_equal(one.rays.v, two.rays.v)


def test_comparison_of_points_in_any_order(tmp_path):
    """Two lists of points on one ground, one of them a grid, whose squares may be split either way."""
    rng = np.random.default_rng(2)
    x, y = (v.ravel() for v in np.meshgrid(5.0 * np.arange(20), 5.0 * np.arange(20)))
    grid = np.column_stack([x, y, 3.0 * np.sin(x / 20.0) + np.cos(y / 15.0)])
    plan = rng.uniform(5.0, 90.0, (150, 2))
    points = np.column_stack([plan, 3.0 * np.sin(plan[:, 0] / 20.0) + np.cos(plan[:, 1] / 15.0) + 0.05])
    found = []
    for number, order in enumerate((np.arange(len(grid)), rng.permutation(len(grid)))):
        here = tmp_path / str(number)
        here.mkdir()
        for name, xyz in (("grid", grid[order]), ("points", points[:: 1 - 2 * number])):
            write_point_cloud(here / f"{name}.laz", xyz, np.full(len(xyz), 0.1), np.ones(len(xyz), bool), None)
        text = run("compare", here / "grid.laz", here / "points.laz", "--out", here / "out", "--no-plots", "--json")
        found.append(in_old_words(json.loads(text.replace(str(here), "")), {}))
    assert_alike(*found)
