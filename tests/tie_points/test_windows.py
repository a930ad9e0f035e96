"""Windows are found again to a hundredth of a pixel, whatever affine map and grey values lie between."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from aerotri.tie_points import _window_kernels as kernels

RIM = kernels.HALF + 1
MIDDLE = np.array([60.5, 50.5])


def texture(noise: float, seed: int = 4) -> np.ndarray:
    """Smooth grey values around 120, so that resampling them is exact to a tenth of a grey value."""
    rng = np.random.default_rng(seed)
    return (
        120.0
        + 60.0 * (field := gaussian_filter(rng.normal(0.0, 1.0, (120, 120)), 1.5)) / field.std() / 2.0
        + (rng.normal(0.0, noise, (120, 120)) if noise else 0.0)
    )


def seen(image: np.ndarray, slope: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The image as another photograph has it, in which the point MIDDLE lies at `place`."""
    row, column = np.indices(image.shape) + 0.5
    there = np.stack([column - place[0], row - place[1]])
    u, v = np.einsum("ij,jrc->irc", np.linalg.inv(slope), there)
    return map_coordinates(image, [v + MIDDLE[1] - 0.5, u + MIDDLE[0] - 0.5], order=5, mode="reflect")


def patch_of(image: np.ndarray) -> np.ndarray:
    column, row = np.floor(MIDDLE).astype(int)
    return np.rint(image[row - RIM : row + RIM + 1, column - RIM : column + RIM + 1]).astype(np.uint8)[None]


def found(image, patches, start, slope, reach=4.0):
    place, slopes, told = np.array([start], float), np.array([slope], float), np.zeros((1, 2))
    kernels.match_windows(image, patches, np.zeros(1, np.int64), np.array([reach]), place, slopes, told)
    return place[0], slopes[0], told[0]


@pytest.mark.parametrize("start_off", [(0.0, 0.0), (1.4, -1.1)])
@pytest.mark.parametrize("slope", [
    [[1.0, 0.0], [0.0, 1.0]], [[0.0, -1.0], [1.0, 0.0]], [[0.9, 0.15], [-0.1, 1.1]],
])  # fmt: skip
def test_windows_are_found_to_a_hundredth_of_a_pixel(slope, start_off):
    """From a start a pixel and more off, with a map that is a tenth off, darker and with less contrast."""
    image, slope, place = texture(0.0), np.array(slope), np.array([57.3, 61.8])
    other = np.clip(np.rint(0.7 * seen(image, slope, place) + 10.0), 0, 255).astype(np.uint8)
    start = slope + [[0.08, -0.05], [0.04, -0.06]]
    xy, map_found, (correlation, sigma) = found(other, patch_of(image), place + start_off, start)
    assert np.abs(xy - place).max() < 0.02
    assert np.abs(map_found - slope).max() < 0.01
    assert correlation > 0.995
    assert 0.0 < sigma < 0.01


def test_standard_deviations_are_those_of_the_errors():
    """Noise in both photographs, 200 windows: errors over their σ, which least squares takes from the other's noise."""
    z = []
    for seed in range(100):
        clean, rng = texture(0.0, seed), np.random.default_rng(1000 + seed)
        place = MIDDLE + rng.uniform(-0.5, 0.5, 2)
        other = seen(clean, np.eye(2), place) + rng.normal(0.0, 6.0, clean.shape)
        one = clean + rng.normal(0.0, 6.0, clean.shape)
        xy, _, (_, sigma) = found(np.clip(np.rint(other), 0, 255).astype(np.uint8), patch_of(one), MIDDLE, np.eye(2))
        z.append((xy - place) / sigma)
    assert np.isfinite(z).all()
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.3


def test_what_is_not_there_is_not_found():
    """Another texture, a window without texture, one that leaves the photograph, and one farther away than allowed."""
    image = texture(0.0)
    same = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    *_, (correlation, _) = found(np.clip(np.rint(texture(0.0, 9)), 0, 255).astype(np.uint8), patch_of(image), MIDDLE,
                                 np.eye(2))  # fmt: skip
    assert not correlation > 0.8
    assert np.isnan(found(same, np.full_like(patch_of(image), 90), MIDDLE, np.eye(2))[2]).all()
    assert np.isnan(found(same, patch_of(image), np.array([5.0, 50.0]), np.eye(2))[2]).all()
    assert np.isnan(found(same, patch_of(image), MIDDLE + [1.2, 0.0], np.eye(2), reach=1.0)[2]).all()
    assert np.isfinite(found(same, patch_of(image), MIDDLE + [1.2, 0.0], np.eye(2), reach=2.0)[2]).all()
