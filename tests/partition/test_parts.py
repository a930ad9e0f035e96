"""A block in parts against the same block in one piece: values, σ, redundancy numbers and tests."""

import csv
from dataclasses import replace

import killed_parts
import numpy as np
import pyarrow.parquet as pq
import pytest

import aerotri
from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.solve import SolveOptions
from aerotri.diagnosis import judge
from aerotri.execution.work import TasksFailedError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.partition import adjusting, course, joints, part_tasks
from aerotri.partition.adjusting import part_folders
from aerotri.partition.dividing import SHARED, divide, part_of
from aerotri.partition.tree import tree_over
from aerotri.statistics.summarise import count_observations, summarise
from small_blocks import LONG_FLIGHT, small_block, with_adjustment

POSITIONS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.03, 0.03, 0.03]}}


def flown(parameters="brown:K1+K2,bluh:1-2", **settings):
    block, _ = small_block(seed=4, parameters=parameters, flight=LONG_FLIGHT, **POSITIONS)
    gnss = replace(block.settings.gnss, shift="strip")
    return with_adjustment(replace(block, settings=replace(block.settings, gnss=gnss)), model_part="off", **settings)


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def in_one_piece(block, robust="off"):
    """The result with more digits than `adjust` needs: minimised again from the minimum."""
    prepared = prepare(block)
    counts = count_observations(prepared.system)
    options = SolveOptions(robust=robust)
    system, solution = minimise_at_adjusted(prepared.system, prepared.state, counts.redundancy, options)
    return summarise(system, solution, system.factorise(solution.equations), prepared.ray_status, ())


def test_a_division_keeps_points_whole_and_shares_photographs():
    block = flown()
    division = divide(block, 3)
    assert division.count == 3
    rays = block.image_points
    inner = division.of_image[rays.image] != SHARED
    assert np.array_equal(division.of_image[rays.image[inner]], division.of_point[rays.point[inner]])
    parts = [part_of(block, division, k) for k in range(3)]
    assert sum(len(part.image_points) for part in parts) == len(rays)
    assert sum(len(part.gnss_ins) for part in parts if part.gnss_ins) == len(block.images)
    names = np.concatenate([part.points for part in parts])
    assert len(np.unique(names)) == len(names) == len(block.points)
    _, times = np.unique(np.concatenate([part.images.names for part in parts]), return_counts=True)
    assert len(times) == len(block.images)
    assert 0 < (times > 1).sum() <= (division.of_image == SHARED).sum()
    for part in parts:
        row = {name: k for k, name in enumerate(block.points)}
        measured = {tuple(xy) for xy in part.image_points.xy}
        of_point = np.isin(rays.point, [row[name] for name in part.points])
        assert measured == {tuple(xy) for xy in rays.xy[of_point]}


@pytest.mark.parametrize("parts", [2, 7])
def test_numbers_are_those_of_one_piece(parts, tmp_path):
    block = flown()
    whole = in_one_piece(block)
    folder = aerotri.divide(block, tmp_path / "parts", parts=parts)
    found = aerotri.adjust_parts(folder, tmp_path / "result", plots=False)
    assert (found.status, found.verdict, found.redundancy) == (
        "converged", judge(whole).level, whole.outcome.redundancy
    )  # fmt: skip
    assert found.sigma0 == pytest.approx(whole.outcome.sigma0, rel=1e-10)
    sigma = np.sqrt(np.diagonal(whole.parameters.covariance))
    order = [list(zip(found.parameters["name"], found.parameters["group"], strict=True)).index(key)
             for key in zip(whole.parameters.names, whole.parameters.groups, strict=True)]  # fmt: skip
    values = np.asarray(found.parameters["value"], float)[order]
    np.testing.assert_array_less(np.abs(values - whole.parameters.value), 1e-8 * sigma)
    np.testing.assert_allclose(np.asarray(found.parameters["sigma"], float)[order], sigma, rtol=1e-9)
    image = {name: k for k, name in enumerate(block.images.names)}
    point = {name: k for k, name in enumerate(block.points)}
    ray = {(i, p): k for k, (i, p) in enumerate(zip(block.image_points.image, block.image_points.point, strict=True))}
    seen = set()
    for part in found.parts:
        place = tmp_path / "result" / "parts" / part
        for line in rows_of(place / "images.csv"):
            k = image[line["image"]]
            centre, of_centre = [float(line[x]) for x in ("X0", "Y0", "Z0")], whole.images.sigma[k, :3]
            assert np.abs(centre - whole.images.centre[k]).max() < 1e-7 * of_centre.min()
            np.testing.assert_allclose([float(line[x]) for x in ("sX0", "sY0", "sZ0")], of_centre, rtol=1e-9)
        for line in rows_of(place / "points.csv"):
            k = point[line["point"]]
            seen.add(k)
            of_point = whole.points.sigma[k]
            assert np.abs([float(line[x]) for x in "XYZ"] - whole.points.xyz[k]).max() < 1e-7 * of_point.min()
            np.testing.assert_allclose([float(line[x]) for x in ("sX", "sY", "sZ")], of_point, rtol=1e-9)
        table = pq.read_table(place / "residuals.parquet").to_pydict()
        rows = [ray[image[i], point[p]] for i, p in zip(table["image"], table["point"], strict=True)]
        r, w = np.array(table["rx"], dtype=float), np.array(table["wy"], dtype=float)
        np.testing.assert_allclose(r, whole.rays.r[rows, 0], atol=1e-9)
        np.testing.assert_allclose(w, whole.rays.w[rows, 1], atol=1e-6)
    assert seen == set(point.values())
    assert not (tmp_path / "result" / "work").exists()


def test_robust_weights_follow_the_residuals_of_all_parts(tmp_path):
    block = flown("none")
    rng = np.random.default_rng(1)
    xy = block.image_points.xy.copy()
    wrong = rng.choice(len(xy), 30, replace=False)
    xy[wrong] += rng.normal(0.0, 0.05, (30, 2))
    block = replace(block, image_points=replace(block.image_points, xy=xy))
    whole = in_one_piece(block, "huber")
    folder = aerotri.divide(block, tmp_path / "parts", parts=3)
    found = aerotri.adjust_parts(folder, tmp_path / "result", robust="huber", plots=False)
    assert found.sigma0 == pytest.approx(whole.outcome.sigma0, rel=1e-3)
    image = {name: k for k, name in enumerate(block.images.names)}
    for part in found.parts:
        for line in rows_of(tmp_path / "result" / "parts" / part / "images.csv"):
            k = image[line["image"]]
            apart = np.abs([float(line[x]) for x in ("X0", "Y0", "Z0")] - whole.images.centre[k])
            assert (apart < 0.02 * whole.images.sigma[k, :3]).all()


def test_errors_over_sigma_are_normal(tmp_path):
    """Recovered from simulated truth: check points over their σ, of blocks in parts."""
    normed = []
    for seed in range(6):
        block, truth = small_block(seed=seed + 20, flight=LONG_FLIGHT)
        folder = aerotri.divide(with_adjustment(block, model_part="off"), tmp_path / f"{seed}", parts=2)
        found = aerotri.adjust_parts(folder, tmp_path / f"{seed}_result", plots=False)
        row = {name: k for k, name in enumerate(block.points)}
        for part in found.parts:
            for line in rows_of(tmp_path / f"{seed}_result" / "parts" / part / "points.csv"):
                error = [float(line[x]) for x in "XYZ"] - truth.points[row[line["point"]]]
                normed.append(error / [float(line[f"s{x}"]) for x in "XYZ"])
    assert np.abs(np.sqrt(np.mean(np.square(normed), axis=0)) - 1.0).max() < 0.2


def grown(columns, rows):
    """Parts on a grid whose neighbours, also across a corner, share a photograph; where they lie."""
    corners = [(i, j) for i in range(columns + 1) for j in range(rows + 1)]
    number = {corner: k for k, corner in enumerate(corners)}
    parts = [(i, j) for i in range(columns) for j in range(rows)]
    images = [np.array(sorted(number[i + a, j + b] for a in (0, 1) for b in (0, 1))) for i, j in parts]
    return images, np.array(parts, dtype=float), len(corners)


@pytest.mark.parametrize(("columns", "rows"), [(2, 1), (5, 3), (8, 8)])
def test_every_shared_photograph_is_eliminated_once_and_when_all_who_see_it_have_met(columns, rows):
    images, middle, n = grown(columns, rows)
    tree = tree_over(images, middle, n)
    assert sorted(tree.rank) == list(range(n))
    own = np.concatenate([joint.images[: joint.own] for joint in tree.joints])
    assert np.array_equal(own, np.arange(n))
    assert not len(tree.joints[-1].rows)
    assert len(tree.joints) == len(images) - 1
    parents = tree.parents()
    for node, above in enumerate(parents[:-1]):
        left = tree.of_parts[node] if node < len(images) else tree.joints[node - len(images)].rows
        assert np.array_equal(tree.joints[above].images[tree.place(node, above)], left)
    assert sorted(k for level in tree.upwards() for k in level) == list(range(len(tree.joints)))
    if columns == rows == 8:
        assert max(len(joint.images) for joint in tree.joints) <= 3 * 9


@pytest.fixture
def divided(tmp_path):
    return aerotri.divide(flown(), tmp_path / "parts", parts=3)


def tables_of(folder):
    """Contents of the tables by name."""
    found = {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.csv"))}
    of_rays = sorted(folder.rglob("*.parquet"))
    return found | {str(path.relative_to(folder)): repr(pq.read_table(path).to_pydict()) for path in of_rays}


def test_files_are_the_same_wherever_parts_are_computed(divided, tmp_path):
    pytest.importorskip("distributed")
    aerotri.adjust_parts(divided, tmp_path / "threads", plots=False)
    expected = tables_of(tmp_path / "threads")
    assert len([name for name in expected if name.endswith(".csv")]) == 4 + 3 * 5 + 3
    assert len([name for name in expected if name.endswith(".parquet")]) == 3
    for executor in ("processes:2", "dask:local:2"):
        aerotri.adjust_parts(divided, tmp_path / executor, executor=executor, plots=False)
        assert tables_of(tmp_path / executor) == expected


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(executor, divided, tmp_path, monkeypatch):
    """Of every kind of task one is killed, in the same run."""
    pytest.importorskip("distributed")
    aerotri.adjust_parts(divided, tmp_path / "threads", plots=False)
    marks = tmp_path / "marks"
    marks.mkdir()
    monkeypatch.setenv(killed_parts.MARKS, str(marks))
    for name, function in killed_parts.KILLED.items():
        place = next(module for module in (course, joints, adjusting) if hasattr(module, name))
        monkeypatch.setattr(place, name, function)
    aerotri.adjust_parts(divided, tmp_path / "killed_result", executor=executor, plots=False)
    assert {path.name for path in marks.iterdir()} == set(killed_parts.KILLED)
    assert tables_of(tmp_path / "killed_result") == tables_of(tmp_path / "threads")


def test_a_part_without_a_result_is_named(divided, tmp_path, monkeypatch):
    monkeypatch.setattr(course, "move_part", killed_parts.never)
    with pytest.raises(
        TasksFailedError, match=r"1 of 3 parts could not be computed: part 0001 \(RuntimeError: no luck"
    ):
        aerotri.adjust_parts(divided, tmp_path / "result", plots=False)
    assert not (tmp_path / "result").exists()


def test_parts_that_do_not_belong_together_are_refused(divided, tmp_path):
    first, second, _ = part_folders(divided)
    block = read_block(second)
    write_block(with_adjustment(block, additional_parameters=()), second, tables="parquet")
    with pytest.raises(aerotri.InputError, match=r"block\.toml of part 0001 differs from that of part 0000"):
        aerotri.adjust_parts(divided, tmp_path / "result", plots=False)
    points = block.points.copy()
    points[int(block.image_points.point[0])] = read_block(first).points[0]
    write_block(replace(block, points=points), second, tables="parquet")
    with pytest.raises(aerotri.InputError, match="stands in the parts 0000 and 0001"):
        aerotri.adjust_parts(divided, tmp_path / "result", plots=False)


def test_parts_that_nothing_holds_are_refused(tmp_path):
    block = flown("none")
    folder = aerotri.divide(replace(block, gnss_ins=None, control=block.control.empty()), tmp_path / "parts", parts=2)
    with pytest.raises(aerotri.InputError, match="the observations do not determine the block"):
        aerotri.adjust_parts(folder, tmp_path / "result", plots=False)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"datum": "inner"}, 'datum = "inner"'),
        ({"robust": "danish"}, 'robust = "danish"'),
        ({"parameter_selection": "on"}, "parameter_selection"),
        ({"variance_components": "on"}, "variance_components"),
        ({"additional_parameters": (("auto", ()),)}, 'additional_parameters = "auto"'),
    ],
)
def test_what_parts_cannot_is_refused_by_name(changes, said, tmp_path):
    with pytest.raises(aerotri.InputError, match=said):
        aerotri.divide(flown("none", **changes), tmp_path / "parts", parts=2)


def test_too_many_parts_are_told_with_what_is_possible(tmp_path, capsys):
    from aerotri.cli.app import invoke

    short, _ = small_block(flight={**LONG_FLIGHT, "strips": 2, "images_per_strip": 6, "end_lap": 0.75})
    short = with_adjustment(short, model_part="off")
    with pytest.raises(aerotri.InputError, match="12 photographs cannot be divided into 50 parts") as caught:
        aerotri.divide(short, tmp_path / "parts", parts=50)
    assert "only one part is possible — adjust it in one piece" in str(caught.value)
    write_block(flown("none"), tmp_path / "block")
    assert invoke(["divide", str(tmp_path / "block"), "--out", str(tmp_path / "parts"), "--parts", "50"]) == 0
    count = len(list((tmp_path / "parts" / "parts").iterdir()))
    assert f"(50 were asked for; the block can be cut into {count} at most)" in capsys.readouterr().out


def test_photographs_without_orientation_are_named(tmp_path):
    block = flown("none")
    angles = block.images.angles.copy()
    angles[3] = np.nan
    lost = replace(block, images=replace(block.images, angles=angles))
    with pytest.raises(aerotri.InputError, match=f"photograph '{block.images.names[3]}' has no orientation"):
        aerotri.divide(lost, tmp_path / "parts", parts=2)


def test_commands(tmp_path, capsys):
    from aerotri.cli.app import invoke

    write_block(flown("brown:K1"), tmp_path / "block")
    assert invoke(["divide", str(tmp_path / "block"), "--out", str(tmp_path / "parts"), "--parts", "2"]) == 0
    assert "2 parts of" in capsys.readouterr().out
    out = str(tmp_path / "result")
    assert invoke(["adjust", str(tmp_path / "parts"), "--out", out]) == 0
    said = capsys.readouterr().out
    assert "verdict: accepted" in said
    assert "2 parts, 42 photographs" in said
    with pytest.raises(aerotri.InputError, match="--parameters is not for a block in parts"):
        invoke(["adjust", str(tmp_path / "parts"), "--parameters", "none"])
    with pytest.raises(aerotri.InputError, match="aerotri divide"):
        invoke(["adjust", str(tmp_path / "block"), "--executor", "processes:2"])


def test_no_equations_are_taken_where_the_last_step_leads(divided, tmp_path, monkeypatch):
    """A round of positions begins with equations, and every step but its last leads to some; then those of the end."""
    seen = []
    eliminate = part_tasks.eliminate_inner

    def counted(symbolic, matrix):
        seen.append(symbolic)
        return eliminate(symbolic, matrix)

    monkeypatch.setattr(part_tasks, "eliminate_inner", counted)
    found = aerotri.adjust_parts(divided, tmp_path / "result", plots=False)
    assert found.status == "converged"
    assert len(seen) == len(found.parts) * (found.record.outcome.iterations + 1)
