"""Draw the figures of the page on conventions: `python docs/figures/conventions.py [FOLDER]`.

Directions are computed by the functions that the adjustment uses, so that a figure cannot say something else.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon, Rectangle

from aerotri.adjustment.track import vertical_rotations
from aerotri.conventions import FLIGHT_AXES, px_from_mm
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

FOLDER = Path(__file__).resolve().parents[1] / "reference" / "figures"
DARK, MIDDLE, LIGHT, RAY = "#1a1a1a", "#707070", "#e8e8e8", "#b02a1a"
VIEW = rotation_from_angles(np.radians([-68.0, 0.0, 0.0])) @ rotation_from_angles(np.radians([0.0, 0.0, 28.0]))
"""Rows: what is drawn to the right, upwards and towards the reader of the oblique views."""


def seen(xyz: np.ndarray) -> np.ndarray:
    """(n, 2) where points of an oblique view are drawn."""
    return (np.atleast_2d(xyz) @ VIEW.T)[:, :2]


def plain(width: float, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of panels without axes, equal scales."""
    figure, axes = plt.subplots(1, columns, figsize=(width, height), squeeze=False)
    for one in axes.flat:
        one.set_aspect("equal")
        one.axis("off")
    return figure, list(axes.flat)


def arrow(axes: Axes, start: np.ndarray, end: np.ndarray, colour: str = DARK, width: float = 1.6) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 14}
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=style)


def label(axes: Axes, at: np.ndarray, text: str, colour: str = DARK, size: float = 11, **more: object) -> None:
    axes.text(at[0], at[1], text, color=colour, fontsize=size, **{"ha": "center", "va": "center", **more})


def frame(axes: Axes, origin: np.ndarray, rotation: np.ndarray, length: float, names: str, colour: str = DARK) -> None:
    """Three axes of a frame in an oblique view, named at their ends."""
    for axis, name in zip(rotation.T, names.split(), strict=True):
        end = origin + length * axis
        arrow(axes, seen(origin)[0], seen(end)[0], colour)
        label(axes, seen(origin + 1.16 * length * axis)[0], name, colour, style="italic", weight="bold")


def polygon(axes: Axes, corners: np.ndarray, fill: str, edge: str = DARK, **more: object) -> None:
    axes.add_patch(Polygon(seen(corners), closed=True, facecolor=fill, edgecolor=edge, **more))


def frames(figure: Figure, axes: list[Axes]) -> None:
    """Object frame, camera frame, image plane and one ray."""
    one = axes[0]
    ground = np.array([[0, 0, 0], [9, 0, 0], [9, 6, 0], [0, 6, 0]], float)
    polygon(one, ground, LIGHT, MIDDLE, lw=0.8)
    frame(one, np.zeros(3), np.eye(3), 2.2, "X Y Z")
    label(one, seen([1.4, -1.35, 0.0])[0], "object frame\n(right-handed, metres)", size=9.5)
    centre = np.array([4.6, 3.2, 6.4])
    rotation = rotation_from_angles(np.radians([6.0, -8.0, 14.0]))
    c, half = 1.9, np.array([1.5, 1.0])
    corners = np.array([[sx * half[0], sy * half[1], -c] for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    polygon(one, centre + corners @ rotation.T, "#ffffff", alpha=0.9, lw=1.2)
    point = np.array([7.3, 4.1, 0.0])
    u = rotation.T @ (point - centre)
    image = centre + rotation @ np.array([-c * u[0] / u[2], -c * u[1] / u[2], -c])
    one.plot(*seen(np.array([centre, point])).T, color=RAY, lw=1.2)
    one.plot(*seen(point)[0], "o", color=RAY, ms=5)
    one.plot(*seen(image)[0], "o", color=RAY, ms=4)
    label(one, seen(point)[0] + [0.1, -0.38], "object point (X, Y, Z)", RAY, 10)
    label(one, seen(image)[0] + [1.75, 0.02], "image point (x, y)", RAY, 10, ha="left")
    principal = centre + rotation @ np.array([0.0, 0.0, -c])
    one.plot(*seen(np.array([centre, principal])).T, color=MIDDLE, lw=1.0, ls="--")
    label(
        one, seen(centre + rotation @ np.array([0.0, 0.0, -0.62 * c]))[0] + [-0.2, 0.0], "c", MIDDLE, 11, style="italic"
    )
    one.plot(*seen(principal)[0], "x", color=MIDDLE, ms=6)
    frame(one, centre, rotation, 1.9, "x y z")
    one.plot(*seen(centre)[0], "o", color=DARK, ms=5)
    label(one, seen(centre)[0] + [-0.45, -0.2], "projection centre\n(X0, Y0, Z0)", size=10, ha="right")
    label(
        one,
        seen(centre)[0] + [2.6, 1.9],
        "camera frame:\nx to the right in the photograph,\ny up in the photograph,\nz backwards, away from the ground",
        size=9.5,
        ha="left",
    )
    one.set_xlim(-3.6, 11.4)
    one.set_ylim(-1.2, 10.6)
    figure.suptitle("Object frame, camera frame and image plane", fontsize=12)


def image_frame(figure: Figure, axes: list[Axes]) -> None:
    """Pixels and millimetres in one photograph, and the corner pixel enlarged."""
    one, two = axes
    size, pixel = (6, 4), 1.0
    one.add_patch(Rectangle((0, 0), *size, facecolor=LIGHT, edgecolor=DARK, lw=1.2))
    one.set_ylim(4.9, -0.9)
    one.set_xlim(-0.9, 6.9)
    arrow(one, (0, 0), (2.0, 0))
    arrow(one, (0, 0), (0, 2.0))
    label(one, (1.0, -0.28), "column", size=10, style="italic")
    label(one, (-0.28, 1.0), "row", size=10, style="italic", rotation=90)
    label(one, (0.1, -0.62), "(0, 0)", size=10)
    one.plot(0, 0, "o", color=DARK, ms=5)
    one.plot(3, 2, "o", color=DARK, ms=5)
    label(one, (2.85, 1.8), "image centre", size=9.5, ha="right")
    for to, name, at in (((1.5, 0.0), "x", (2.05, 0.0)), ((0.0, 1.4), "y", (0.0, 1.65))):
        end, place = px_from_mm(np.array([to, at]), size, pixel)
        arrow(one, (3, 2), end)
        label(one, place, f"{name}, mm", size=10, style="italic", weight="bold")
    one.plot(3.42, 2.3, "x", color=RAY, ms=8, mew=1.8)
    label(one, (3.42, 2.66), "principal point (x0, y0)", RAY, 9.5)
    label(one, (6, 4.3), "(columns, rows)", size=10)
    one.plot(6, 4, "o", color=DARK, ms=5)
    one.set_title("one photograph", fontsize=11)
    for i in range(3):
        for j in range(2):
            two.add_patch(Rectangle((i, j), 1, 1, facecolor=LIGHT, edgecolor=DARK, lw=1.0))
    two.plot([0, 0.5, 1, 1.5], [0, 0.5, 0, 0.5], "o", color=RAY, ms=5)
    for (x, y), text in (((0.0, -0.2), "(0, 0)"), ((0.5, 0.72), "(0.5, 0.5)"), ((1.0, -0.2), "(1, 0)"),
                         ((1.5, 0.72), "(1.5, 0.5)")):  # fmt: skip
        label(two, (x, y), text, RAY, 10)
    two.set_xlim(-0.5, 3.3)
    two.set_ylim(2.4, -0.5)
    two.set_title("its upper left pixels, enlarged", fontsize=11)
    figure.suptitle('Image coordinates: pixels (image_unit = "px") and millimetres (image_unit = "mm")', fontsize=12)


def rotations(figure: Figure, axes: list[Axes]) -> None:
    """The three rotations one at a time, positive sense."""
    names = ("ω = +20°: about X", "φ = +20°: about Y", "κ = +20°: about Z")
    for k, (one, name) in enumerate(zip(axes, names, strict=True)):
        rotation = rotation_from_angles(np.radians(np.where(np.arange(3) == k, 20.0, 0.0)))
        corners = np.array([[-1.5, -1, 0], [1.5, -1, 0], [1.5, 1, 0], [-1.5, 1, 0]])
        polygon(one, corners, "none", MIDDLE, lw=1.0, ls="--")
        polygon(one, corners @ rotation.T, LIGHT, DARK, lw=1.3, alpha=0.85)
        for axis, letter in zip(np.eye(3), "XYZ", strict=True):
            arrow(one, seen(np.zeros(3))[0], seen(1.9 * axis)[0], MIDDLE, 1.1)
            label(one, seen(2.15 * axis)[0], letter, MIDDLE, 10, style="italic")
        for axis, letter in zip(rotation.T, "xyz", strict=True):
            if not np.allclose(axis, np.eye(3)[k]):
                arrow(one, seen(np.zeros(3))[0], seen(1.75 * axis)[0])
                label(one, seen(1.98 * axis)[0] + [0.12, 0.1], letter, size=10, style="italic", weight="bold")
        turn = np.radians(np.linspace(-100.0, 170.0, 60))
        i, j = (k + 1) % 3, (k + 2) % 3
        circle = np.zeros((60, 3))
        circle[:, i], circle[:, j], circle[:, k] = 0.42 * np.cos(turn), 0.42 * np.sin(turn), 1.15
        points = seen(circle)
        one.plot(*points[:-3].T, color=RAY, lw=1.5)
        arrow(one, points[-6], points[-1], RAY, 1.5)
        one.set_title(name, fontsize=11)
        one.set_xlim(-2.5, 2.7)
        one.set_ylim(-1.9, 2.5)
    figure.suptitle("Positive rotations. The photograph before (dashed) and after (solid)", fontsize=12)


def flight_axes(figure: Figure, axes: list[Axes]) -> None:
    """A photograph on the ground for every flight axis, flown to the east; κ by the program's own function."""
    for one, name in zip(axes, FLIGHT_AXES, strict=True):
        rotation = vertical_rotations(np.array([0.0]), np.array([name]))[0]
        kappa = float(np.degrees(angles_from_rotation(rotation)[2]))
        text = f"{180.0 if kappa < -179.0 else kappa + 0.0:.0f}".replace("-", "−")
        half = np.array([1.5, 1.0])
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half @ rotation[:2, :2].T
        one.add_patch(Polygon(corners, closed=True, facecolor=LIGHT, edgecolor=DARK, lw=1.2))
        for axis, letter in zip(rotation[:2, :2].T, "xy", strict=True):
            arrow(one, (0, 0), 0.62 * axis)
            label(one, 0.8 * axis, letter, size=11, style="italic", weight="bold")
        arrow(one, (-1.8, -1.95), (1.8, -1.95), RAY, 1.6)
        one.set_title(f'flight_axis = "{name}"\nκ = {text}° when flown to the east', fontsize=10.5)
        one.set_xlim(-2.0, 2.0)
        one.set_ylim(-2.2, 1.8)
        label(one, (0, -1.72), "flight", RAY, 10)
    figure.suptitle("Photographs seen from above, X to the right (east), Y up (north)", fontsize=12)


def image_error(figure: Figure, axes: list[Axes]) -> None:
    """Ideal and measured position, d and its correction."""
    one = axes[0]
    ideal, measured, gap = np.array([0.0, 0.0]), np.array([2.6, 1.2]), np.array([0.13, 0.06])
    one.plot(*ideal, "o", mfc="white", mec=DARK, ms=9, mew=1.5)
    one.plot(*measured, "o", color=DARK, ms=9)
    arrow(one, ideal + gap, measured - gap, RAY, 2.0)
    label(one, (ideal + measured) / 2 + [-0.35, 0.3], "d(x, y)", RAY, 12)
    label(one, ideal - (0.2, 0.0), "ideal position\n(what the collinearity\nequations give)", size=10, ha="right")
    label(one, measured - (0.0, -0.38), "measured position", size=10)
    shift = np.array([0.12, -0.3])
    arrow(one, measured + shift - gap, ideal + shift + gap, MIDDLE, 1.4)
    label(one, (ideal + measured) / 2 + shift + [0.7, -0.2], "correction −d", MIDDLE, 10.5)
    one.set_xlim(-2.4, 4.8)
    one.set_ylim(-0.7, 1.95)
    figure.suptitle("Systematic image error:  measured = ideal + d,  corrected = measured − d", fontsize=12)


def lever_arm(figure: Figure, axes: list[Axes]) -> None:
    """From the projection centre to the antenna, in the camera frame."""
    one = axes[0]
    rotation = rotation_from_angles(np.radians([0.0, 0.0, 14.0]))
    centre, arm = np.zeros(3), np.array([0.3, 1.5, 1.7])
    frame(one, centre, rotation, 1.5, "x y z")
    one.plot(*seen(centre)[0], "o", color=DARK, ms=6)
    label(one, seen(centre)[0] + [-0.15, -0.3], "projection centre", size=10)
    antenna = centre + rotation @ arm
    arrow(one, seen(centre)[0], seen(antenna)[0], RAY, 2.0)
    label(one, seen(0.55 * antenna)[0] + [0.95, 0.0], "lever_arm_m = [0.3, 1.5, 1.7]", RAY, 10, ha="left")
    one.add_patch(Arc(tuple(seen(antenna)[0]), 0.9, 0.45, theta1=0.0, theta2=180.0, color=DARK, lw=2.0))
    label(one, seen(antenna)[0] + [0.55, 0.22], "antenna: what GNSS observes", size=10, ha="left")
    one.set_xlim(-1.9, 4.6)
    one.set_ylim(-0.9, 2.9)
    figure.suptitle("Lever arm: from the projection centre to the antenna, in the camera frame", fontsize=12)


def draw(folder: Path = FOLDER, suffix: str = "svg") -> None:
    """Write all figures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    mpl.rcParams.update({"svg.hashsalt": "aerotri", "font.family": "DejaVu Sans"})
    for name, function, size, columns in (
        ("frames", frames, (8.4, 6.2), 1),
        ("image_frame", image_frame, (9.6, 4.4), 2),
        ("rotations", rotations, (9.6, 3.7), 3),
        ("flight_axis", flight_axes, (10.4, 3.7), 4),
        ("image_error", image_error, (7.2, 3.2), 1),
        ("lever_arm", lever_arm, (7.2, 4.0), 1),
    ):
        figure, axes = plain(*size, columns)
        function(figure, axes)
        figure.tight_layout()
        metadata = {"Date": None} if suffix == "svg" else {}
        figure.savefig(folder / f"{name}.{suffix}", metadata=metadata, dpi=90, bbox_inches="tight")
        plt.close(figure)


if __name__ == "__main__":
    draw(*(Path(word) for word in sys.argv[1:2]))
