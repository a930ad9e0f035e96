"""What became of photographs as plain values."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.tie_points.photographs_to_block import TiedBlock


def tie_points_json(tied: TiedBlock, seconds: float) -> dict[str, Any]:
    """The content of tiepoints.json but for its head and the page to mark control points in.

    Parameters
    ----------
    seconds : that it took.
    """
    block, rays = tied.block, tied.block.image_points
    is_control = np.isin(rays.point, block.control.point)
    per_point = np.bincount(rays.point[~is_control], minlength=len(block.points))
    per_image = np.bincount(rays.image[~is_control], minlength=len(block.images))
    return {
        "block": block.name,
        "photographs": len(block.images),
        "left_out": list(tied.left_out),
        "pairs": {"compared": tied.pairs[0], "tied": tied.pairs[1]},
        "tie_points": int((per_point > 0).sum()),
        "rays": int((~is_control).sum()),
        "rays_per_point": float(per_point[per_point > 0].mean()),
        "points_per_photograph": {"smallest": int(per_image.min()), "median": float(np.median(per_image))},
        "control": int((~block.control.is_check).sum()),
        "check": int(block.control.is_check.sum()),
        "median_residual_px": tied.median_px,
        "cameras": [
            {"name": camera.name, "focal_length_mm": camera.focal_length_mm, "pixel_um": camera.pixel_um}
            for camera in block.cameras
        ],
        "placement": None if tied.placed is None else tied.placed.as_json(),
        "doubts": list(tied.doubts),
        "messages": list(tied.messages),
        "seconds": round(seconds, 1),
    }
