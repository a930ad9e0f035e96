"""Rigs by name, with the fields of `[rig.*]` and `[camera.*]` of a simulation; the reference camera comes first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

MEDIUM = {"size_px": [14204, 10652], "pixel_um": 3.76}
"""A medium format sensor."""
LOOKING_ASIDE = {"size_px": [11608, 8708], "pixel_um": 4.6, "focal_length_mm": 70.0}
DMC_TILT_DEG = (16.0, 11.0)
"""Of the heads of the DMC, about y and x; see `functional_model.additional_parameters.dmc`."""

# positions of heads are chosen: of the size of such frames
HEADS: Mapping[str, Mapping[str, tuple[dict[str, Any], tuple[float, float, float], tuple[float, float, float]]]] = {
    "oblique_5": {
        "nadir": ({**MEDIUM, "focal_length_mm": 90.0}, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        "fore": ({**MEDIUM, "focal_length_mm": 120.0}, (0.0, 0.12, 0.03), (45.0, 0.0, 0.0)),
        "aft": ({**MEDIUM, "focal_length_mm": 120.0}, (0.0, -0.12, 0.03), (-45.0, 0.0, 180.0)),
        "right": ({**MEDIUM, "focal_length_mm": 120.0}, (0.12, 0.0, 0.03), (0.0, -45.0, -90.0)),
        "left": ({**MEDIUM, "focal_length_mm": 120.0}, (-0.12, 0.0, 0.03), (0.0, 45.0, 90.0)),
    },
    "two_head": {
        "left": (LOOKING_ASIDE, (-0.1, 0.0, 0.0), (0.0, 14.0, 0.0)),
        "right": (LOOKING_ASIDE, (0.1, 0.0, 0.0), (0.0, -14.0, 0.0)),
    },
    "large_format_4": {
        f"head_{k}": (
            {"size_px": [7168, 4096], "pixel_um": 12.0, "focal_length_mm": 120.0},
            (0.085 * sx, 0.04 * sy, 0.0),
            (0.0, 0.0, 0.0),
        )
        for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)), start=1)
    },
}  # fmt: skip
"""Cameras, positions, m, and angles ω, φ, κ, degrees, in a frame that looks straight down, y along the flight; the
angles of the large format's heads follow from `DMC_TILT_DEG`."""


def rig_preset(name: str, order: str) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """The cameras, and the keys of `[rig.NAME]`, of a rig by name.

    Parameters
    ----------
    order : of the angles, as `rotation` of the simulation says.
    """
    heads = HEADS[name]
    rotation = {head: _rotation(name, k, angles) for k, (head, (_, _, angles)) in enumerate(heads.items())}
    reference, *others = heads
    at, turn = np.array(heads[reference][1]), rotation[reference]
    rig: dict[str, Any] = {
        "reference": reference,
        "tilt_deg": _degrees(turn, order),
        "camera": {
            head: {
                "position_m": (turn.T @ (np.array(heads[head][1]) - at)).tolist(),
                "rotation_deg": _degrees(turn.T @ rotation[head], order),
            }
            for head in others
        },
    }
    return {head: dict(camera) for head, (camera, _, _) in heads.items()}, rig


def _rotation(name: str, k: int, angles_deg: tuple[float, float, float]) -> np.ndarray:
    """(3, 3) of a head in the frame that looks straight down."""
    if name != "large_format_4":
        return rotation_from_angles(np.radians(angles_deg))
    about_y, about_x = np.radians(DMC_TILT_DEG)
    sx, sy = ((1, 1), (-1, 1), (-1, -1), (1, -1))[k]
    return rotation_from_angles(np.array([sy * about_x, -sx * about_y, 0.0]), "phi-omega-kappa")


def _degrees(rotation: np.ndarray, order: str) -> list[float]:
    return np.degrees(angles_from_rotation(rotation, order)).tolist()


def with_rig_presets(data: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a simulation with the rigs that are named by presets written out; keys that are given stay.

    Raises
    ------
    ValueError
        For a preset that is not known.
    """
    out = dict(data)
    rigs, cameras = dict(out.get("rig", {})), dict(out.get("camera", {}))
    for name, given in rigs.items():
        if not isinstance(given, Mapping) or "preset" not in given:
            continue
        own = dict(given)
        preset = own.pop("preset")
        if preset not in HEADS:
            raise ValueError(f"preset '{preset}' of the rig '{name}' is not known; known are {', '.join(HEADS)}")
        known, rig = rig_preset(preset, str(out.get("rotation", "omega-phi-kappa")))
        mounted = own.pop("camera", {})
        mounted = mounted if isinstance(mounted, Mapping) else {}
        rig["camera"] = {head: {**keys, **mounted.get(head, {})} for head, keys in rig["camera"].items()}
        rigs[name] = {**rig, **own}
        cameras = {**{head: {**keys, **cameras.get(head, {})} for head, keys in known.items()}, **{
            head: keys for head, keys in cameras.items() if head not in known}}  # fmt: skip
    if rigs:
        out["rig"] = rigs
    if cameras:
        out["camera"] = cameras
    return out
