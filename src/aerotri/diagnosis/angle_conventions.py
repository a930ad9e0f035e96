"""What users get wrong with angles, undone: units, order, sense, axes of the camera and of the ground.

Every convention is a function from angles (k, 3) rad, as they were read, to angles as they may be meant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from aerotri.diagnosis import changes
from aerotri.functional_model.rotation import (
    OMEGA_PHI_KAPPA,
    angles_from_rotation,
    logarithm,
    rotation_from_angles,
)

ANGLE_UNITS = (
    (0.9, "gon in place of degrees"), (1.0 / 0.9, "degrees in place of gon"),
    (180.0 / np.pi, "radians in place of degrees"), (np.pi / 180.0, "degrees in place of radians"),
    (200.0 / np.pi, "radians in place of gon"), (np.pi / 200.0, "gon in place of radians"),
)  # fmt: skip
"""Factors that undo a mistaken unit of angles: 360° = 400 gon = 2π."""
ALIKE = np.radians(10.0)
"""Rotations that count as the same: start values err by some degrees."""
MOST = 0.8
"""Share of the photographs that a convention has to bring there."""


@dataclass(frozen=True)
class Convention:
    """A mistaken convention.

    Parameters
    ----------
    remedy : with what angles fit: '180° added to kappa'. change : of the angles (k, 3) rad.
    """

    remedy: str
    change: changes.Positions


def conventions(order: str) -> Iterator[Convention]:
    """The usual ones, the likeliest first; `order` of the rotations of the block."""
    yield Convention("180° added to kappa", changes.turned_about(np.pi))
    yield Convention("90° added to kappa", changes.turned_about(np.pi / 2.0))
    yield Convention("90° taken from kappa", changes.turned_about(-np.pi / 2.0))
    for factor, unit in ANGLE_UNITS:
        yield Convention(f"{unit} taken for what they are", changes.scaled(factor))
    yield Convention(_order_in_words(order), _other_order(order))
    yield Convention("omega and phi exchanged", changes.exchanged_angles)
    for axis, name in enumerate(("omega", "phi", "kappa")):
        yield Convention(f"{name} negated", changes.negated(axis))
    yield Convention("all angles negated", changes.scaled(-1.0))
    yield from of_axes(order)


def of_axes(order: str) -> Iterator[Convention]:
    """Rotations between frames whose axes point elsewhere."""

    def made(remedy: str, change: Callable[[np.ndarray], np.ndarray]) -> Convention:
        return Convention(
            remedy, lambda angles: angles_from_rotation(change(rotation_from_angles(angles, order)), order)
        )

    down = np.diag([1.0, -1.0, -1.0])
    yield Convention("180° added to omega", changes.plus(np.array([np.pi, 0.0, 0.0])))
    yield Convention("180° added to phi", changes.plus(np.array([0.0, np.pi, 0.0])))
    yield made("y of the camera taken as pointing down, z forward", lambda rotation: rotation @ down)
    yield made(
        "angles that turn from ground to camera, not from camera to ground",
        lambda rotation: np.swapaxes(rotation, 1, 2),
    )
    north_east_down = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    yield made("axes of the ground taken as north, east, down", lambda rotation: north_east_down @ rotation)
    yield made(
        "axes of ground and camera taken as north, east, down and x forward",
        lambda rotation: north_east_down @ rotation @ north_east_down,
    )


def convention_between(given: np.ndarray, found: np.ndarray, order: str) -> Convention | None:
    """The convention that brings most of the given angles to those found; None where there is none.

    Parameters
    ----------
    given, found : (k, 3) rad.
    """
    wanted = rotation_from_angles(found, order)
    best, share = None, MOST
    for convention in conventions(order):
        rotation = rotation_from_angles(convention.change(given), order)
        apart = np.linalg.norm(logarithm(np.swapaxes(rotation, 1, 2) @ wanted), axis=1)
        alike = float(np.mean(apart < ALIKE))
        if alike > share or (best is None and alike >= share):
            best, share = convention, alike
    return best


def _order_in_words(order: str) -> str:
    return "the order phi-omega-kappa" if order == OMEGA_PHI_KAPPA else "the order omega-phi-kappa"


def _other_order(order: str) -> changes.Positions:
    """Angles of the other order as those of the block's."""
    other = "phi-omega-kappa" if order == OMEGA_PHI_KAPPA else OMEGA_PHI_KAPPA
    return lambda angles: angles_from_rotation(rotation_from_angles(angles, other), order)
