"""A block simulated in parts against the same plan in one piece, and its adjustment against the truth."""

import csv
from copy import deepcopy

import numpy as np
import pytest

import aerotri
from aerotri.formats.block.folder import read_block
from aerotri.partition.adjusting import part_folders


def plan():
    """Four strips of sixteen photographs with positions and check points."""
    its = deepcopy(aerotri.example_flight())
    its["flight"] |= {"strips": 4, "images_per_strip": 16}
    its["control"]["check_points"] = 6
    its["gnss"] = {"sigma_m": [0.02, 0.02, 0.03]}
    return its


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("simulated") / "parts"
    aerotri.simulate_parts(plan(), place, parts=5, seed=3)
    return place


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_photographs_positions_and_control_are_those_of_one_piece(folder):
    whole = aerotri.simulate(plan(), seed=3).block
    row = {name: k for k, name in enumerate(whole.images.names)}
    signals = {whole.points[p]: xyz for p, xyz in zip(whole.control.point, whole.control.xyz, strict=True)}
    seen, observed, given = set(), [], []
    for part in map(read_block, part_folders(folder)):
        rows = [row[name] for name in part.images.names]
        np.testing.assert_allclose(part.images.centre, whole.images.centre[rows], atol=1e-4)
        np.testing.assert_allclose(part.images.angles, whole.images.angles[rows], atol=1e-6)
        seen |= set(rows)
        of_part = [rows[k] for k in part.gnss_ins.image]
        np.testing.assert_allclose(part.gnss_ins.xyz, whole.gnss_ins.xyz[of_part], atol=1e-4)
        observed += of_part
        for point, xyz in zip(part.control.point, part.control.xyz, strict=True):
            np.testing.assert_allclose(xyz, signals[part.points[point]], atol=1e-4)
            given.append(part.points[point])
    assert seen == set(row.values())
    assert sorted(observed) == sorted(row.values())
    assert sorted(given) == sorted(signals)


def test_points_belong_to_one_part_and_photographs_have_as_many_as_the_plan_says(folder):
    parts = [read_block(part) for part in part_folders(folder)]
    names = np.concatenate([part.points for part in parts])
    assert len(np.unique(names)) == len(names)
    images = {name for part in parts for name in part.images.names}
    ties = sum(int(np.sum(~np.isin(part.image_points.point, part.control.point))) for part in parts)
    assert ties / len(images) == pytest.approx(plan()["tie_points"]["per_image"], rel=0.02)
    twice = sum(len(part.images) for part in parts) - len(images)
    assert 0 < twice < 2 * len(images)


def test_errors_over_sigma_are_normal(folder, tmp_path):
    found = aerotri.adjust_parts(folder, tmp_path / "result", plots=False)
    assert (found.status, found.verdict) == ("converged", "accepted")
    normed = []
    for part in found.parts:
        truth = {line["point"]: line for line in rows_of(folder / "parts" / part / "truth" / "points.csv")}
        for line in rows_of(tmp_path / "result" / "parts" / part / "points.csv"):
            true = truth[line["point"]]
            normed.append([(float(line[x]) - float(true[x])) / float(line[f"s{x}"]) for x in "XYZ"])
    assert np.abs(np.sqrt(np.mean(np.square(normed), axis=0)) - 1.0).max() < 0.2


def test_the_same_seed_gives_the_same_parts(folder, tmp_path):
    aerotri.simulate_parts(plan(), tmp_path / "again", parts=5, seed=3)
    for path in sorted(folder.rglob("*.csv")):
        assert (tmp_path / "again" / path.relative_to(folder)).read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"towers": {"per_image": 1, "height_m": 10.0}}, "towers in a block simulated in parts"),
        ({"tie_points": {"per_image": 80, "sigma_um": 1.2, "distribution": "nodes"}}, "the distribution 'nodes'"),
        ({"start_values": {"kind": "none"}}, "has no orientation to begin with"),
    ],
)
def test_what_parts_cannot_is_refused_by_name(changes, said, tmp_path):
    with pytest.raises(aerotri.InputError, match=said):
        aerotri.simulate_parts(plan() | changes, tmp_path / "parts", parts=2)


def test_parts_for_which_there_are_too_few_photographs_are_refused(tmp_path):
    with pytest.raises(aerotri.InputError, match="give fewer parts"):
        aerotri.simulate_parts(plan(), tmp_path / "parts", parts=100)


def test_command(tmp_path, capsys):
    from aerotri.cli.app import invoke

    (tmp_path / "plan.toml").write_text(PLAN)
    out = str(tmp_path / "parts")
    assert invoke(["simulate", str(tmp_path / "plan.toml"), "--parts", "2", "--out", out]) == 0
    assert f"2 parts: aerotri adjust {out}" in capsys.readouterr().out
    assert invoke(["adjust", out, "--out", str(tmp_path / "result")]) == 0
    with pytest.raises(aerotri.InputError, match="not for parts"):
        invoke(["simulate", str(tmp_path / "plan.toml"), "--parts", "2", "--render", "--out", out])


PLAN = """
name = "strip"
[camera.cam]
preset = "ultracam_d"
[flight]
gsd_m = 0.1
strips = 2
images_per_strip = 16
[tie_points]
per_image = 60
probability = 0.9
sigma_um = 2.0
[control]
distance_bases = 4.0
sigma_m = [0.03, 0.03, 0.03]
[start_values]
kind = "perturbed"
position_sigma_m = 1.0
angle_sigma_deg = 0.05
"""
