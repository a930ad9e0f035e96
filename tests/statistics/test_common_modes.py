"""Common and local parts of σ: against dense algebra, and in what an adjustment delivers."""

import numpy as np
import pytest

import aerotri
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.statistics.common_modes import common_parts, modes, usual_points
from dense_algebra import dense_design
from small_blocks import small_block
from statistics_blocks import drone_block


@pytest.fixture(scope="module")
def small():
    adjustment = adjust_keeping_system(small_block(5)[0])
    return adjustment, adjustment.system.factorise(adjustment.solution.equations)


def test_modes_are_orthonormal_and_contain_shift_tilt_and_bowl():
    xyz = np.random.default_rng(1).normal(size=(50, 3)) * [100.0, 300.0, 10.0] + [5e5, 6e6, 100.0]
    columns = modes(xyz).reshape(-1, 10)
    assert columns.T @ columns == pytest.approx(np.eye(10), abs=1e-12)
    x, y = (xyz - xyz.mean(axis=0))[:, :2].T
    change = np.zeros((50, 3))
    change[:, 2] = 0.3 + 1e-3 * x - 2e-3 * y + 1e-5 * (x * x + y * y)
    change[:, 0], change[:, 1] = 0.1 + 1e-4 * x - 3e-4 * y, -0.2 + 3e-4 * x + 1e-4 * y
    rest = change.ravel() - columns @ (columns.T @ change.ravel())
    assert np.abs(rest).max() < 1e-9


def test_parts_are_those_of_dense_algebra(small):
    adjustment, factor = small
    u, sigma0 = adjustment.system.unknowns, adjustment.local.outcome.sigma0
    covariance = adjustment.local.points.covariance[u.points]
    parts = {p.part: p for p in common_parts(adjustment.system, adjustment.solution, factor, covariance, sigma0)}
    design = dense_design(adjustment)
    scale = 1.0 / np.linalg.norm(design, axis=0)
    q = np.linalg.inv((design * scale).T @ (design * scale)) * np.outer(scale, scale)
    at = 6 * len(u.images) + len(u.shared)
    rows = usual_points(adjustment.system, adjustment.solution, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))
    own = (at + 3 * rows[:, None] + np.arange(3)).ravel()
    dense = sigma0**2 * q[np.ix_(own, own)]
    columns = modes(adjustment.solution.state.points[rows]).reshape(-1, 10)
    variance = np.diagonal(columns.T @ dense @ columns) / len(rows)
    bounds = {"height: shift": (0, 1), "height: tilt": (1, 3), "height: bend": (3, 6), "plan: shift": (6, 8)}
    for name, (first, last) in bounds.items():
        assert parts[name].sigma_m == pytest.approx(np.sqrt(variance[first:last].sum()), rel=1e-5)
        assert parts[name].total_m == pytest.approx(parts[name].sigma_m)
    heights = np.diagonal(dense)[2::3].mean()
    assert sum(p.sigma_m**2 for name, p in parts.items() if name.startswith("height")) == pytest.approx(
        heights, rel=1e-5
    )


def test_what_strips_have_in_common_is_mostly_common():
    """Lens errors from strip to strip bend the block: the bend grows, what is local hardly does."""
    found = aerotri.adjust(drone_block(1, 2.0)[0], explain=False)
    parts = {part.part: part for part in found.adjusted.model_part.common}
    assert found.adjusted.model_part.scheme == "strip"
    bend, local = parts["height: bend"], parts["height: local"]
    assert bend.total_m / bend.sigma_m > local.total_m / local.sigma_m
    assert found.adjusted.model_part.as_dict()["common"][0]["part"] == "height: shift"
