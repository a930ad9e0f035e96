"""A block with gross errors in parts and in one piece, with Huber's estimator."""

import numpy as np
import pytest
from test_parts import flown, rows_of
from test_settled_points import with_gross_errors

import aerotri
from aerotri.adjustment import settled_points, stopping
from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.solve import SolveOptions
from aerotri.partition import course
from aerotri.statistics.summarise import count_observations, summarise


@pytest.fixture(scope="module")
def block():
    return with_gross_errors(flown("none"))


def in_one_piece(block, **options):
    prepared = prepare(block)
    counts = count_observations(prepared.system)
    chosen = SolveOptions(robust="huber", **options)
    system, solution = minimise_at_adjusted(prepared.system, prepared.state, counts.redundancy, chosen)
    assert solution.status == "converged"
    return summarise(system, solution, system.factorise(solution.equations), prepared.ray_status, ())


def in_parts(block, folder, **options):
    """Places (P, 3) of points and (n, 3) of photographs of the block in three parts; σ0."""
    divided = aerotri.divide(block, folder / "parts", parts=3)
    found = aerotri.adjust_parts(divided, folder / "result", robust="huber", plots=False, **options)
    points, images = {}, {}
    for part in found.parts:
        place = folder / "result" / "parts" / part
        points |= {line["point"]: [float(line[x]) for x in "XYZ"] for line in rows_of(place / "points.csv")}
        centres = rows_of(place / "images.csv")
        images |= {line["image"]: [float(line[x]) for x in ("X0", "Y0", "Z0")] for line in centres}
    return np.array([points[n] for n in block.points]), np.array([images[n] for n in block.images.names]), found.sigma0


def test_at_the_normal_end_no_point_is_on_its_way(block, tmp_path):
    whole = in_one_piece(block)
    points, images, sigma0 = in_parts(block, tmp_path)
    assert sigma0 == pytest.approx(whole.outcome.sigma0, rel=1e-3)
    assert (np.abs(points - whole.points.xyz) / whole.points.sigma).max() < 0.02
    assert (np.abs(images - whole.images.centre) / whole.images.sigma[:, :3]).max() < 0.02


def test_gone_on_to_rounding_they_are_the_same(block, tmp_path, monkeypatch):
    monkeypatch.setattr(stopping, "ROBUST_COST_TOLERANCE", 1e-13)
    monkeypatch.setattr(course, "ROBUST_COST_TOLERANCE", 1e-13)
    monkeypatch.setattr(course, "ROBUST_STEP_TOLERANCE", 1e-10)
    monkeypatch.setattr(settled_points, "SETTLED", 1e-8)
    whole = in_one_piece(block, max_iterations=1000, step_tolerance=1e-10)
    points, images, sigma0 = in_parts(block, tmp_path, max_iterations=1000)
    assert sigma0 == pytest.approx(whole.outcome.sigma0, rel=1e-10)
    assert (np.abs(images - whole.images.centre) / whole.images.sigma[:, :3]).max() < 1e-9
    apart = (np.abs(points - whole.points.xyz) / whole.points.sigma).max(axis=1)
    # a point whose cost has no more digits cannot be told where it is to more than their square root
    assert np.quantile(apart, 0.95) < 1e-9
    assert apart.max() < 1e-5
