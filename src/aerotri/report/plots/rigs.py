"""Plot of a rig: what its cameras see of the ground at one exposure."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.report.plots import plan
from aerotri.report.plots.canvas import GREY, INK, WIDTH, new_figure, plain, styled
from aerotri.results.adjusted_block import AdjustedBlock

LINES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)), (0, (9, 3)), (0, (3, 1, 1, 1, 1, 1)))
"""Line styles of the cameras, the reference camera first; with names in the middle they need no colours."""


@styled
def plot_rig(adjusted: AdjustedBlock, rig: str) -> Figure:
    """Footprints of all cameras of a rig on level ground, seen from above, in the frame of the reference camera."""
    prints = rig_footprints(adjusted, rig)
    height = height_over_ground(adjusted, rig)
    extent = plan.extent_of(*(corners for corners, _ in prints.values()))
    width, tall = plan.plan_size(extent, WIDTH - 1.4, 6.6, 3.0)
    subtitle = (
        f"ground seen by every camera from {height:.0f} m, reference camera level; "
        "numbers: angle between the axis and the plumb line"
    )
    figure = new_figure(tall + 1.6, f"Rig {plain(rig)} – {plain(adjusted.block.name)}", subtitle)
    labels = ("along x of the reference camera [m]", "along y of the reference camera [m]")
    axes = plan.plan_axes(figure, (0.95, 0.65, width, tall), extent, labels)
    for k, (camera, (corners, tilt)) in enumerate(prints.items()):
        _draw(axes, camera, corners, tilt, LINES[k % len(LINES)])
    return figure


def rig_footprints(adjusted: AdjustedBlock, rig: str) -> dict[str, tuple[np.ndarray, float]]:
    """Corners (4, 2) m of every camera on level ground below the reference camera, and its tilt, degrees.

    Corners above the horizon, or far away, are drawn at `FARTHEST_FOOTPRINT` heights.
    """
    block, height = adjusted.block, height_over_ground(adjusted, rig)
    cameras = {camera.name: camera for camera in block.cameras}
    own = [one for one in adjusted.rigs if one.rig == rig]
    mounted = {own[0].reference: (np.zeros(3), np.eye(3))} | {
        one.camera: (one.position, rotation_from_angles(one.angles, block.rotation)) for one in own
    }
    out = {}
    for name, (position, rotation) in mounted.items():
        direction = plan.corner_directions(cameras[name]) @ rotation.T
        # an oblique camera may see the horizon
        sideways = np.hypot(direction[:, 0], direction[:, 1])
        down = np.maximum(-direction[:, 2], sideways / plan.FARTHEST_FOOTPRINT)
        corners = position[:2] + (height + position[2]) * direction[:, :2] / down[:, None]
        out[name] = corners, float(np.degrees(np.arccos(np.clip(rotation[2, 2], -1.0, 1.0))))
    return out


def height_over_ground(adjusted: AdjustedBlock, rig: str) -> float:
    """Median height of the reference camera above the object points; 1 m where nothing lies below."""
    block = adjusted.block
    reference = next(one.reference for one in adjusted.rigs if one.rig == rig)
    number = [camera.name for camera in block.cameras].index(reference)
    above = np.nanmedian(adjusted.images.centre[block.images.camera == number, 2]) - np.nanmedian(
        adjusted.points.xyz[:, 2]
    )
    return float(above) if np.isfinite(above) and above > 0.0 else 1.0


def _draw(axes: Axes, camera: str, corners: np.ndarray, tilt: float, style: object) -> None:
    """An outline, its upper edge in the photograph marked, and the name in its middle."""
    closed = np.concatenate([corners, corners[:1]])
    axes.plot(*closed.T, color=INK, lw=1.3, ls=style, zorder=2)
    axes.fill(*closed.T, color=GREY, alpha=0.07, lw=0.0, zorder=1)
    # the third and the fourth corner make the upper edge
    axes.plot(*(0.5 * (corners[2] + corners[3])), marker="o", ms=4, color=INK, zorder=3)
    axes.annotate(
        f"{plain(camera, 20)}\n{tilt:.0f}°", corners.mean(axis=0), ha="center", va="center", fontsize=8.5, zorder=5,
        bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 1.5},
    )  # fmt: skip
