"""Change between surfaces of two adjustments: what their errors leave in it, with and without an alignment."""

from __future__ import annotations

import importlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

import aerotri
from aerotri import InputError
from aerotri.observations import Prior
from aerotri.rasters.grids import Grid
from aerotri.volume.accuracy import volume_sigma
from aerotri.volume.bases import SurfaceBase
from aerotri.volume.boundary import boundary_of
from aerotri.volume.change.adjusted import adjusted_pair
from aerotri.volume.change.alignment import NO_ALIGNMENT
from aerotri.volume.change.compute import Epoch, compute_change
from aerotri.volume.parts import part_of_cells
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.settings import SigmaOptions
from places import PROJECT

CELL, SIDE, RUNS = 12.0, 24, 8


@pytest.fixture(scope="module")
def proof():
    """The modules of the tools that simulate epochs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "prove"))
        epochs, simulated = (importlib.import_module(name) for name in ("volume_epochs", "volume_proof.simulated"))
        yield SimpleNamespace(epochs=epochs, simulated=simulated)


@pytest.fixture(scope="module")
def blocks(proof):
    return {seed: two_epochs(proof, seed) for seed in range(1, RUNS + 1)}


def two_epochs(proof, seed):
    """Two adjustments of one flight's geometry with the same errors of control, and the truth."""
    rng = np.random.default_rng([seed, 31])
    block, truth = proof.epochs.free_of_noise(seed)
    control = rng.normal(size=block.control.xyz.shape) * proof.epochs.CONTROL_SIGMA_M
    return *(proof.epochs.observed(block, 2.0, control, rng) for _ in range(2)), truth


def grid_in(truth):
    middle = np.median(truth.centre[:, :2], axis=0)
    half = 0.5 * SIDE * CELL
    return Grid(SIDE, SIDE, float(middle[0] - half), float(middle[1] + half), CELL, CELL)


def ground(grid):
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return 100.0 + 6.0 * np.sin(x / 50.0) * np.cos(y / 60.0), x, y


def measured(proof, calibration, truth, grid):
    """Heights of the cells as intersected from photographs without noise; a move in plan is one of height by slope."""
    z, x, y = ground(grid)
    true = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    chosen, seen = pickets_where_seen(calibration, true, 1e-6)
    assert seen.all()
    rng = np.random.default_rng(1)
    moved = proof.simulated.measured_pickets(calibration, truth, chosen, rng, frozenset()) - true
    down, along = np.gradient(z, CELL, CELL)
    return z + (moved[:, 2] - along.ravel() * moved[:, 0] + down.ravel() * moved[:, 1]).reshape(z.shape)


def epoch(z):
    return Epoch(z, np.full_like(z, 1e-6), np.zeros_like(z))


def ring(shape):
    """Stable ground: the border of the surface."""
    held = np.ones(shape, bool)
    held[7:-7, 7:-7] = False
    return held


@pytest.mark.parametrize("how", [None, "height", "tilt"])
def test_what_is_left_of_the_adjustments_scatters_by_its_sigma(proof, blocks, how):
    """No noise of cells: the volume inside errs by the adjustments alone; Σz² in the 99.9 % band of χ²."""
    z, cells, moved = [], [], []
    for first, second, truth in blocks.values():
        grid = grid_in(truth)
        before, after = (measured(proof, one, truth, grid) for one in (first, second))
        stable = None if how is None else ring(before.shape)
        inside = (~ring(before.shape)).astype(float)
        pair = adjusted_pair(grid, (before, after), (first, second))
        found = compute_change(grid, epoch(before), epoch(after), stable, how or "none", [("inside", inside)], pair)
        v = found.volumes[0]
        z.append(v.net / np.hypot(v.parts["net"]["adjustment"], v.parts["net"]["model"]))
        cells.append(np.sqrt(np.nanmean(found.significance[7:-7, 7:-7] ** 2)))
        moved.append(found.alignment.values / found.moved_sigma)
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    assert low < np.sum(np.square(z)) < high
    # nothing was moved in truth: what the alignment finds are errors of the adjustments
    assert (np.sum(np.square(moved), axis=0) > low).all()
    assert (np.sum(np.square(moved), axis=0) < high).all()
    # of neighbouring cells, which err alike: a few independent ones a run. With an alignment what bends stable ground
    # is in its noise as well, which makes σ of cells larger
    assert np.sqrt(np.mean(np.square(cells))) < 1.7
    assert how is not None or np.sqrt(np.mean(np.square(cells))) > 0.5


def test_control_in_common_makes_sigma_smaller_and_an_alignment_smaller_still(proof, blocks):
    first, second, truth = blocks[1]
    grid = grid_in(truth)
    z = ground(grid)[0]
    inside = (~ring(z.shape)).astype(float)
    moved = replace(
        second.result.block, control=replace(second.result.block.control, xyz=second.result.block.control.xyz + 1e-3)
    )
    own = aerotri.adjust(moved, explain=False).record
    sigma = {}
    for name, other, stable in (("own", own, None), ("shared", second, None), ("aligned", second, ring(z.shape))):
        pair = adjusted_pair(grid, (z, z), (first, other))
        how = "none" if stable is None else "tilt"
        found = compute_change(grid, epoch(z), epoch(z), stable, how, [("", inside)], pair)
        sigma[name] = found.volumes[0].parts["net"]["adjustment"]
        assert ("control points that both" in pair.in_words()) == (name != "own")
    assert sigma["shared"] < 0.8 * sigma["own"]
    assert sigma["aligned"] < 0.5 * sigma["shared"]


def test_the_same_sigma_as_volume_has(proof, blocks):
    """Without an alignment the net change is the volume over the other surface."""
    first, second, truth = blocks[2]
    grid = grid_in(truth)
    z = ground(grid)[0]
    boundary = boundary_of(shapely.box(*grid.bounds), "all")
    surfaces = [aerotri.Surface.of_array(z + up, left=grid.left, top=grid.top, cell=CELL) for up in (0.0, 5.0)]
    with surfaces[0].reader() as below, surfaces[1].reader() as above:
        base = SurfaceBase("first", below)
        options = SigmaOptions()
        parts = (
            part_of_cells(second, above, boundary, base, options),
            part_of_cells(first, below, boundary, None, options),
        )
        expected = volume_sigma(above, base, boundary, *parts, options).parts["adjustment"]
    pair = adjusted_pair(grid, (z, z + 5.0), (first, second))
    found = compute_change(grid, epoch(z), epoch(z + 5.0), None, "none", [("", np.ones_like(z))], pair)
    assert found.volumes[0].parts["net"]["adjustment"] == pytest.approx(expected, rel=0.02)


def test_one_adjustment_cancels(blocks):
    first, _, truth = blocks[3]
    grid = grid_in(truth)
    z = ground(grid)[0]
    pair = adjusted_pair(grid, (z, z.copy()), (first, first))
    found = compute_change(grid, epoch(z), epoch(z), None, "none", [("", np.ones_like(z))], pair)
    alone = np.sqrt(pair.first.parts([pair.first.gradient(np.full_like(z, CELL**2), pair.factor)])[0].response.variance)
    assert found.volumes[0].parts["net"]["adjustment"] < 1e-6 * alone
    assert "come from one adjustment" in pair.in_words()


@pytest.mark.parametrize("same", [True, False])
def test_few_factors_tell_sigma_of_all_cells(blocks, monkeypatch, same):
    """The normal equations are factorised once for all places of an epoch, and σ is what single ones give."""
    first, second, truth = blocks[3]
    grid = grid_in(truth)
    z = ground(grid)[0]
    # the second surface is higher, so that errors of one adjustment do not cancel wholly
    given = (first, first if same else second)
    pair = adjusted_pair(grid, (z, z + 20.0), given).aligned(NO_ALIGNMENT, np.zeros((*z.shape, 0)))
    kind, count = type(first.system), []
    factorise = kind.factorise
    monkeypatch.setattr(kind, "factorise", lambda self, *given: count.append(1) or factorise(self, *given))
    sigma = pair.sigma()
    assert len(count) <= 3
    for row, column in ((0, 0), (z.shape[0] - 1, z.shape[1] - 1)):
        weight = np.zeros_like(z)
        weight[row, column] = 1.0
        assert sigma[row, column] == pytest.approx(np.sqrt(sum(pair.variances(weight))), rel=1e-6)


def test_values_of_one_camera_count_once(proof):
    """The principal distance observed in both with the same value: its error cancels in the difference."""
    block, truth = proof.epochs.free_of_noise(5)
    camera = block.cameras[0]
    c = camera.interior["focal_length_mm"]
    observed, apart = (
        replace(camera, interior={**camera.interior, "focal_length_mm": Prior(c.value + more, 0.02)})
        for more in (0.0, 1e-4)
    )
    records = [
        aerotri.adjust(replace(block, cameras=(one, *block.cameras[1:])), explain=False).record
        for one in (observed, observed, apart)
    ]
    grid = grid_in(truth)
    z = ground(grid)[0]
    found = []
    for other in records[1:]:
        # other start values make another adjustment of the same numbers
        moved = replace(other, solution=replace(other.solution, state=replace(
            other.solution.state, points=other.solution.state.points + 1e-9)))  # fmt: skip
        pair = adjusted_pair(grid, (z, z), (records[0], moved))
        change = compute_change(grid, epoch(z), epoch(z), None, "none", [("", np.ones_like(z))], pair)
        found.append(change.volumes[0].parts["net"]["adjustment"])
        assert ("values of the camera" in pair.in_words()) == (other is records[1])
    assert found[0] < found[1]


def surface_of(z, grid, name):
    return aerotri.Surface.of_array(z, left=grid.left, top=grid.top, cell=CELL, sigma=np.full_like(z, 0.02), name=name)


def test_the_user_gives_two_results(blocks, proof, tmp_path):
    flight = aerotri.simulate(proof.simulated.SPEC, 4)
    results = [aerotri.adjust(flight.block, parameters="bluh:1-12", explain=False) for _ in range(2)]
    grid = grid_in(flight.truth)
    z = ground(grid)[0]
    first, second = surface_of(z, grid, "may"), surface_of(z + 0.5, grid, "june")
    found = aerotri.change(first, second, first_adjustment=results[0], second_adjustment=results[1])
    assert any("one adjustment" in text for text in found.warnings)
    # what a height of half a metre changes
    assert found.summary["volumes"][0]["parts_net_m3"]["adjustment"] < 1e-3 * CELL**2 * z.size
    with pytest.raises(InputError, match="given alone"):
        aerotri.change(first, second, first_adjustment=results[0])
    folder = results[0].save(tmp_path / "result")
    with pytest.raises(InputError, match="has no surface"):
        aerotri.change(folder, second)


def test_ground_too_level_to_tell_a_shift_in_plan_is_named(proof):
    """What tilts of the adjustments are taken for on level ground is larger than a cell; on hills it is not."""
    flights = [aerotri.simulate(proof.simulated.SPEC, seed) for seed in (4, 5)]
    results = [aerotri.adjust(flight.block, parameters="bluh:1-12", explain=False) for flight in flights]
    grid = grid_in(flights[0].truth)
    place = shapely.box(grid.left, grid.top - SIDE * CELL, grid.left + SIDE * CELL, grid.top)

    def said(relief):
        z = 100.0 + relief * (ground(grid)[0] - 100.0)
        first, second = surface_of(z, grid, "may"), surface_of(z, grid, "june")
        found = aerotri.change(
            first, second, stable=place, first_adjustment=results[0], second_adjustment=results[1]
        )  # fmt: skip
        return " ".join(found.warnings)

    assert "too level to tell a shift in plan (dX ±" in said(1e-4)
    assert "too level" not in said(10.0)
