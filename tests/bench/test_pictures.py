"""Tiles and cut-outs of photographs: the pixels that the files have, at their places."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from aerotri.bench.pictures import TILE_PX, Pictures, corner_of
from aerotri.conventions import InputError
from aerotri.rasters.images import create_image
from small_blocks import small_block

COLUMNS, ROWS = 1500, 1100


@pytest.fixture(scope="module")
def block():
    found = small_block()[0]
    return replace(found, cameras=(replace(found.cameras[0], size_px=(COLUMNS, ROWS)),))


def scene() -> np.ndarray:
    """(rows, columns) with a bright square whose place is known."""
    pixels = np.tile(np.linspace(40, 120, COLUMNS, dtype=np.float32), (ROWS, 1))
    pixels[700:740, 1100:1160] = 250
    return pixels


def write(folder, name: str, pixels: np.ndarray) -> None:
    bands = pixels if pixels.ndim == 3 else pixels[None]
    with create_image(folder / f"{name}.tif", bands.shape[2], bands.shape[1], len(bands), pixels.dtype.name) as writer:
        writer.write(0, bands)


@pytest.fixture
def pictures(block, tmp_path):
    write(tmp_path, str(block.images.names[0]), scene().astype(np.uint8))
    write(tmp_path, str(block.images.names[1]), (scene() * 16).astype(np.uint16))
    write(tmp_path, str(block.images.names[2]), np.stack([scene()] * 3).astype(np.uint8)[:, :-1])
    return Pictures(block, tmp_path)


def opened(jpeg: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def test_tiles_put_together_are_the_photograph(pictures):
    whole = np.vstack([np.hstack([opened(pictures.tile(0, 0, c, r)) for c in range(3)]) for r in range(3)])
    assert whole.shape == (ROWS, COLUMNS, 3)
    assert np.abs(whole[:, :, 1].astype(float) - scene()).mean() < 2.0


def test_coarser_levels_are_half_as_large(pictures):
    assert opened(pictures.tile(0, 2, 0, 0)).shape == (ROWS // 4, COLUMNS // 4, 3)
    last = opened(pictures.tile(0, 2, 0, 0))[:, :, 0].astype(float)
    assert last[180, 282] == pytest.approx(250, abs=12)
    with pytest.raises(InputError, match="no level 3"):
        pictures.tile(0, 3, 0, 0)
    with pytest.raises(InputError, match="no tile 9, 0"):
        pictures.tile(0, 0, 9, 0)


def test_photograph_of_sixteen_bits_is_stretched(pictures):
    shown = opened(pictures.tile(1, 0, 0, 0))[:, :, 0]
    assert shown.shape == (TILE_PX, TILE_PX)
    assert shown.min() < 5
    assert opened(pictures.tile(1, 0, 2, 1))[200, 100, 0] == 255


def test_cutout_is_where_it_is_asked_for(pictures):
    left, top = corner_of((1130.0, 720.0), 100)
    part = opened(pictures.cutout(0, left, top, 100))[:, :, 0].astype(int)
    rows, columns = np.nonzero(part > 200)
    assert (rows.min() + top, rows.max() + top + 1) == (700, 740)
    assert (columns.min() + left, columns.max() + left + 1) == (1100, 1160)


def test_cutout_beyond_the_edge_is_filled(pictures):
    part = opened(pictures.cutout(0, -50, ROWS - 50, 100))
    assert part.shape == (100, 100, 3)
    assert np.abs(part[60:, :, :].astype(int) - 42).max() < 8
    grey = pictures.grey(0, -50, ROWS - 50, 100)
    assert np.isnan(grey[:, :50]).all()
    assert grey[:50, 50:] == pytest.approx(scene().astype(np.uint8)[-50:, :50])


def test_photograph_of_another_size_and_a_missing_one_are_told(pictures):
    with pytest.raises(InputError, match="1500 × 1099 pixels large, its camera has 1500 × 1100"):
        pictures.tile(2, 0, 0, 0)
    with pytest.raises(InputError, match="no file of photograph 5"):
        pictures.cutout(5, 0, 0, 64)
    assert 5 not in pictures
    assert pictures.size(5) == (COLUMNS, ROWS)


def test_folder_without_photographs_of_the_block_is_told(block, tmp_path):
    write(tmp_path, "another", scene().astype(np.uint8))
    with pytest.raises(InputError, match="holds no photograph of the block"):
        Pictures(block, tmp_path)
