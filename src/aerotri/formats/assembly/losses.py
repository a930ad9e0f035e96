"""What a format cannot hold of a block, in words."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from aerotri.conventions import counted
from aerotri.formats.text.notes import left_behind
from aerotri.observations import Block

Count = Callable[[Block], int]


def _lens(block: Block) -> int:
    priors = [
        prior
        for camera in block.cameras
        for prior in (*camera.brown.values(), *camera.lens.values(), *camera.parameters.values())
    ]
    return sum(prior.value != 0.0 for prior in priors)


def _principal_points(block: Block) -> int:
    return sum(any(camera.principal_point_mm) for camera in block.cameras)


def _control_sigmas(block: Block) -> int:
    return int(np.isfinite(block.control.sigma).any(axis=1).sum())


THINGS: dict[str, tuple[Count, str]] = {
    "cameras": (lambda block: len(block.cameras), "{camera}, except the name"),
    "principal points": (_principal_points, "the principal point of {camera}"),
    "lens": (_lens, "{lens parameter}; image points are as measured"),
    "image points": (lambda block: len(block.image_points), "{image point}"),
    "sigmas": (
        lambda block: len(np.unique(block.image_points.sigma)) - 1,
        "standard deviations of single image points",
    ),
    "orientations": (lambda block: int(np.isfinite(block.images.centre).all(axis=1).sum()), "{orientation}"),
    "control": (lambda block: int((~block.control.is_check).sum()), "{control point}"),
    "check points": (lambda block: int(block.control.is_check.sum()), "{check point}"),
    "control sigmas": (_control_sigmas, "the standard deviations of {ground point} (control and check)"),
    "gnss": (
        lambda block: 0 if block.gnss_ins is None else len(block.gnss_ins),
        "{observation} of GNSS and INS",
    ),
    "edits": (lambda block: 0 if block.edits is None else len(block.edits), "{decision} on rays and points"),
    "constraints": (lambda block: 0 if block.constraints is None else len(block.constraints), "{constraint}"),
    "fiducials": (lambda block: 0 if block.fiducials is None else len(block.fiducials), "{measured fiducial}"),
    "rigs": (
        lambda block: sum(rig.constraint != "off" for rig in block.rigs),
        "{rig}; photographs are written one by one",
    ),
    "crs": (lambda block: int(block.crs != "local"), "the name of the coordinate system"),
}
"""Things by name: how many of them a block has, and words for them; a noun in braces is written with its number."""


def losses(block: Block, *held: str) -> tuple[str, ...]:
    """Sentences on what cannot be carried over.

    Parameters
    ----------
    held : names of the `THINGS` that the format has a place for.
    """
    unknown = set(held) - set(THINGS)
    if unknown:
        raise ValueError(f"no such things: {unknown}")
    said = []
    for name, (count, words) in THINGS.items():
        number = 0 if name in held else count(block)
        if number > 0:
            said.append(left_behind(f"could not be carried over: {_with_number(words, number)}"))
    return tuple(said)


def _with_number(words: str, number: int) -> str:
    """'{camera}, except the name' as '2 cameras, except the name'."""
    return re.sub(r"\{(.+?)\}", lambda noun: counted(number, noun[1]), words)
