"""Which order of P1 and P2 a BlocksExchange has: the format's own, or OpenCV's, as some programs write it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.formats.assembly.reprojection import CLEAR, FEWEST, residuals_at_start, sample_of_points
from aerotri.formats.text.notes import assumed
from aerotri.observations import Block, Camera, Prior


def with_settled_lens(block: Block, geoid: FilePath | None = None) -> tuple[Block, tuple[str, ...]]:
    """The block as it is, or with P1 and P2 exchanged where image points fit clearly better so; and what to say.

    Parameters
    ----------
    block : read in the order of the format, in its coordinate system.
    geoid : grid for its heights, where PROJ does not have it.
    """
    cameras = tuple(_exchanged(camera) for camera in block.cameras)
    start = np.column_stack([block.images.centre, block.images.angles])
    if cameras == block.cameras or not np.isfinite(start).all(axis=1).any():
        return block, ()
    try:
        local = block if block.crs == "local" else transform_block(block, frame_of_block(block, geoid))
    except InputError:
        # without a grid nothing can be projected; whoever needs it says so
        return block, ()
    rows, rays = sample_of_points(local), local.image_points
    sample = replace(
        rays, image=rays.image[rows], point=rays.point[rows], xy=rays.xy[rows], sigma=rays.sigma[rows]
    )  # fmt: skip
    local = replace(local, image_points=sample)
    own, other = residuals_at_start(local), residuals_at_start(replace(local, cameras=cameras))
    if min(own.count, other.count) < FEWEST or not other.median_px < CLEAR * own.median_px:
        return block, ()
    words = f"image points fit to {other.median_px:.3g} px so, to {own.median_px:.3g} px in the order of the format"
    return replace(block, cameras=cameras), (assumed(f"P1 and P2 are taken in OpenCV's order: {words}"),)


def _exchanged(camera: Camera) -> Camera:
    """The camera with the other parameter of each; y points up here, so both change their sign as well."""
    p1, p2 = (camera.lens.get(name, Prior(0.0, fixed=True)) for name in ("p1", "p2"))
    if not (p1.value or p2.value):
        return camera
    lens = {name: prior for name, prior in camera.lens.items() if name not in ("p1", "p2")}
    turned = {"p1": replace(p2, value=-p2.value), "p2": replace(p1, value=-p1.value)}
    return replace(camera, lens=lens | turned)
