"""The Fourier series of models.md 4."""

import numpy as np
import pytest

from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters, text_of
from aerotri.functional_model.additional_parameters.registry import default_items
from aerotri.observations import Camera
from family_cameras import INTERIOR

CAMERA = Camera("c", "frame", (11500, 7500), 9.0, INTERIOR)
HALF = CAMERA.half_format_mm


def test_by_formula():
    """dx = cos, sin of mu + nv with u = πx/bx, v = πy/by; dy its own."""
    x, y = np.array([10.0, -51.0, 3.0]), np.array([-20.0, 33.0, 0.0])
    u, v = np.pi * x / HALF[0], np.pi * y / HALF[1]
    items = ["xc1p0", "xs0p1", "xs2m1", "yc3p2", "ys1m6"]
    chosen = parameter_set("fourier", items, CAMERA)
    found = dict(zip(chosen.items, np.moveaxis(chosen.basis(x, y), 2, 0), strict=True))
    expected = {
        "xc1p0": (np.cos(u), 0),
        "xs0p1": (np.sin(v), 0),
        "xs2m1": (np.sin(2 * u - v), 0),
        "yc3p2": (0, np.cos(3 * u + 2 * v)),
        "ys1m6": (0, np.sin(u - 6 * v)),
    }
    for item, (dx, dy) in expected.items():
        np.testing.assert_allclose(found[item][:, 0], dx, atol=1e-12)
        np.testing.assert_allclose(found[item][:, 1], dy, atol=1e-12)
    assert text_of("fourier", "xs2m1") == "dx = sin(2u − v)"


@pytest.mark.parametrize(("size", "count"), [("1x1", 16), ("2x1", 28), ("1x2", 28), ("2x2", 48), ("6x6", 336)])
def test_counts(size, count):
    """4·(M·(2N + 1) + N)."""
    ((_, items),) = parse_parameters(f"fourier:{size}")
    assert len(items) == len(set(items)) == count


@pytest.mark.parametrize("size", ["1x1", "3x2"])
def test_waves_are_orthogonal_over_the_format(size):
    ((_, items),) = parse_parameters(f"fourier:{size}")
    x, y = ((2 * (np.arange(n) + 0.5) / n - 1) * h for n, h in zip((24, 20), HALF, strict=True))
    x, y = (g.ravel() for g in np.meshgrid(x, y))
    basis = parameter_set("fourier", items, CAMERA).basis(x, y).reshape(-1, len(items))
    np.testing.assert_allclose(basis.T @ basis / len(x), np.eye(len(items)) / 2, atol=1e-12)


def test_edges_meet():
    """Periodic over the format."""
    chosen = parameter_set("fourier", default_items("fourier"), CAMERA)
    y = np.linspace(-HALF[1], HALF[1], 7)
    np.testing.assert_allclose(chosen.basis(np.full(7, -HALF[0]), y), chosen.basis(np.full(7, HALF[0]), y), atol=1e-12)
