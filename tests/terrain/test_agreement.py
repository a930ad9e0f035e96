"""Many photographs that agree below the threshold, on rendered ground that changes between exposures as leaves do."""

from dataclasses import replace

import numpy as np
import pytest
from rendered_blocks import Rendered, rendered_block, write_photograph
from scipy.ndimage import gaussian_filter

from aerotri.rasters.images import open_photograph
from aerotri.simulation.rendering import RenderOptions
from aerotri.terrain.error_pickets import with_error_pickets
from aerotri.terrain.matching import measure
from aerotri.terrain.pickets import MatchOptions, Pickets

LEAVES = 0.7
METRES_PER_PX = 9.0
"""Of height, of neighbours at 85 % end lap."""


def with_leaves(pixels: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Grey values with a texture of many scales that no other photograph has, as strong as a share of their own."""
    leaves = np.zeros(pixels.shape)
    for scale in (0.5, 1.0, 2.0, 4.0):
        layer = gaussian_filter(rng.normal(0.0, 1.0, pixels.shape), scale)
        leaves += layer / layer.std()
    own = np.sqrt(gaussian_filter((pixels - gaussian_filter(pixels, 6.0)) ** 2, 12.0))
    return np.clip(pixels + share * own * leaves / leaves.std(), 0, 65535).astype(np.uint16)


@pytest.fixture(scope="module")
def leafy(tmp_path_factory) -> Rendered:
    folder = tmp_path_factory.mktemp("leafy")
    flight = {"end_lap": 0.85, "images_per_strip": 9}
    rendered = rendered_block(folder / "clear", options=RenderOptions(detail_px=1.0), flight=flight)
    paths = []
    for k, path in enumerate(rendered.paths):
        with open_photograph(path) as photograph:
            pixels = photograph.read(0, photograph.rows)[0].astype(float)
        paths.append(write_photograph(folder / path.name, with_leaves(pixels, LEAVES, np.random.default_rng(k + 7))))
    return replace(rendered, paths=tuple(paths))


def measured(rendered: Rendered, **options) -> Pickets:
    known = rendered.calibration.result.points.xyz
    return measure(rendered.photographs(), known, MatchOptions(interval=12.0, edge=0.02, **options))


def errors(rendered: Rendered, pickets: Pickets, own: np.ndarray) -> np.ndarray:
    return pickets.xyz[own, 2] - rendered.truth(pickets.xyz[own])


@pytest.fixture(scope="module")
def pickets(leafy) -> Pickets:
    return measured(leafy)


def test_agreeing_photographs_measure_where_two_do_not(leafy, pickets):
    """Hardly a pair reaches 0.90 in leaves; four fifths of the nodes are measured all the same, by three at least."""
    alone = measured(leafy, agreeing=1.0)
    seen = pickets.status != 1
    assert alone.accepted.sum() < 0.15 * seen.sum()
    assert pickets.accepted.sum() > 0.75 * seen.sum()
    rays = (pickets.photographs[pickets.accepted] >= 0).sum(axis=1)
    low = pickets.correlation[pickets.accepted] < 0.90
    assert rays[low].min() >= 3
    assert pickets.correlation[pickets.accepted].min() >= 0.50


def test_no_gross_error_comes_in_with_low_correlation(leafy, pickets):
    """No accepted height is off by a pixel of parallax, before error pickets are sought and after."""
    for found in (pickets, with_error_pickets(pickets, METRES_PER_PX)):
        away = np.abs(errors(leafy, found, found.accepted))
        assert (away > METRES_PER_PX).sum() == 0


def test_sigma_of_noisy_windows_is_right(leafy, pickets):
    """Normalised errors, all and at low and at high correlation: noise in the template is no information."""
    own = pickets.accepted
    z = errors(leafy, pickets, own) / pickets.sigma[own, 2]
    correlation = pickets.correlation[own]
    assert abs(z.mean()) < 3.3 / np.sqrt(own.sum() / 2) + 0.15
    for part in (np.ones(len(z), bool), correlation < 0.70, (correlation >= 0.70) & (correlation < 0.85)):
        assert part.sum() > 300
        assert 0.8 < z[part].std() < 1.25
    assert (np.abs(z) > 5.0).mean() < 0.001


def test_what_no_photographs_have_in_common_stays_a_hole(leafy, tmp_path):
    """Photographs of leaves alone: nothing agrees."""
    rng, paths = np.random.default_rng(3), []
    for path in leafy.paths:
        with open_photograph(path) as photograph:
            shape = photograph.rows, photograph.columns
        pixels = 16000.0 + 3000.0 * gaussian_filter(rng.normal(0.0, 1.0, shape), 1.0) / 0.28
        paths.append(write_photograph(tmp_path / path.name, np.clip(pixels, 0, 65535).astype(np.uint16)))
    found = with_error_pickets(measured(replace(leafy, paths=tuple(paths))), METRES_PER_PX)
    assert (found.status != 1).sum() > 2000
    assert found.accepted.sum() <= 2
