"""Targets and matches: found within hundredths of a pixel of where they were drawn, and not where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from aerotri.bench.matching import HALF_PX, match, sampled_window
from aerotri.bench.targets import find_target

FINE = 8
SIZE = 120


def drawn(kind: str, centre: tuple[float, float], turn: float, size: float, noise: float = 2.0) -> np.ndarray:
    """A target on uneven ground as a camera sees it: drawn eight times as fine, then averaged; centre in px."""
    rng = np.random.default_rng(3)
    fine = (np.arange(SIZE * FINE) + 0.5) / FINE
    x, y = np.meshgrid(fine - centre[0], fine - centre[1])
    u, v = np.cos(turn) * x + np.sin(turn) * y, -np.sin(turn) * x + np.cos(turn) * y
    inside = np.maximum(np.abs(u), np.abs(v)) < size
    if kind == "checkerboard":
        white = inside & (u * v > 0)
    elif kind == "cross":
        white = inside & (np.minimum(np.abs(u), np.abs(v)) < size / 5)
    else:
        white = np.hypot(u, v) < size / 2
    grey = np.where(white, 220.0, np.where(inside, 30.0, 90.0))
    grey = gaussian_filter(grey, 0.6 * FINE).reshape(SIZE, FINE, SIZE, FINE).mean(axis=(1, 3))
    return grey + gaussian_filter(rng.normal(0, 20, grey.shape), 3) + rng.normal(0, noise, grey.shape)


@pytest.mark.parametrize("kind", ["checkerboard", "cross", "disc"])
@pytest.mark.parametrize("turn", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("size", [9.0, 16.0])
def test_centre_of_a_target(kind, turn, size):
    centre = (60.37, 58.81)
    found = find_target(drawn(kind, centre, turn, size), (63.0, 55.0), 8.0)
    assert found is not None
    assert (found.kind == "checkerboard") == (kind == "checkerboard")
    assert np.hypot(found.place[0] - centre[0], found.place[1] - centre[1]) < 0.1
    assert found.sigma_px < 0.1


def texture(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return 120.0 + 60.0 * gaussian_filter(rng.normal(size=(400, 400)), 2.0) / 0.14


@pytest.mark.parametrize("seed", range(12))
def test_ground_is_no_target(seed):
    assert find_target(texture(seed)[:SIZE, :SIZE], (60.0, 60.0), 8.0) is None


def test_edge_of_a_road_is_no_target():
    x = np.arange(SIZE) + 0.5
    road = np.tile(np.where(np.abs(x - 60.0) < 6.0, 200.0, 80.0), (SIZE, 1))
    road += np.random.default_rng(1).normal(0, 2, road.shape)
    assert find_target(gaussian_filter(road, 0.7), (61.0, 60.0), 8.0) is None


def test_target_beyond_reach_and_at_the_edge_of_the_photograph():
    piece = drawn("cross", (60.0, 60.0), 0.3, 12.0)
    assert find_target(piece, (85.0, 60.0), 8.0) is None
    piece[:, 55:] = np.nan
    assert find_target(piece, (60.0, 60.0), 8.0) is None


@pytest.mark.parametrize("turn", [0.0, 0.2, -0.35])
def test_match_finds_a_place_turned_scaled_and_brighter(turn):
    """The piece is the other photograph turned about a place, 10 % larger, with another contrast and noise."""
    ground = texture(5)
    affine = 1.1 * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    place, there = np.array([81.3, 78.6]), np.array([200.4, 190.7])
    rows, columns = np.meshgrid(np.arange(160) + 0.5, np.arange(160) + 0.5, indexing="ij")
    back = np.linalg.inv(affine) @ np.stack([(columns - place[0]).ravel(), (rows - place[1]).ravel()])
    piece = map_coordinates(ground, [back[1] + there[1] - 0.5, back[0] + there[0] - 0.5], order=3).reshape(160, 160)
    piece = 0.7 * piece + 40.0 + np.random.default_rng(2).normal(0, 2, piece.shape)
    template = sampled_window(ground, there)
    rough = affine @ np.array([[1.02, 0.02], [-0.02, 0.98]])
    found = match(piece, place + [4.0, -5.0], template, rough, 12)
    assert found is not None
    assert found.place == pytest.approx(place, abs=0.08)
    assert found.correlation > 0.95
    assert found.sigma_px < 0.1


@pytest.mark.parametrize("seed", range(6))
def test_other_ground_is_no_match(seed):
    template = sampled_window(texture(seed + 50), np.array([200.0, 200.0]))
    assert match(texture(seed)[:160, :160], np.array([80.0, 80.0]), template, np.eye(2), 12) is None


def test_window_without_texture_or_beyond_the_edge_is_no_match():
    flat = np.full((2 * HALF_PX + 1, 2 * HALF_PX + 1), 7.0)
    assert match(texture(1)[:160, :160], np.array([80.0, 80.0]), flat, np.eye(2), 12) is None
    piece = texture(1)[:160, :160].copy()
    piece[:, 70:] = np.nan
    template = sampled_window(texture(1), np.array([80.0, 80.0]))
    assert match(piece, np.array([80.0, 80.0]), template, np.eye(2), 12) is None
