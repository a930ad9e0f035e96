"""What a format cannot hold of a block, in words."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from aerotri.conventions import counted
from aerotri.formats.text.notes import left_behind
from aerotri.observations import Block

Count = Callable[[Block], int]
SAME_SIGMA = 1e-9
"""Relative difference up to which two σ are one [C]: the rounding of units."""


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


def _not_a_pixel(block: Block) -> int:
    """Image points whose σ is another than a pixel, which readers take where a format has none."""
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[block.image_points.image]]
    return int((np.abs(block.image_points.sigma / pixel[:, None] - 1.0) > SAME_SIGMA).any(axis=1).sum())


THINGS: dict[str, tuple[Count, str]] = {
    "cameras": (lambda block: len(block.cameras), "{camera}, except the name"),
    "principal points": (_principal_points, "the principal point of {camera}"),
    "lens": (_lens, "{lens parameter}; image points are as measured"),
    "image points": (lambda block: len(block.image_points), "{image point}"),
    "sigmas": (_not_a_pixel, "the standard deviations of {image point}, which are read as 1 pixel then"),
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
        # of what is not there at all nobody misses the σ
        is_told = name in held or (name == "sigmas" and "image points" not in held)
        number = 0 if is_told else count(block)
        if number > 0:
            said.append(left_behind(f"could not be carried over: {_with_number(words, number)}"))
    return tuple(said)


def lost_names(names: np.ndarray, written: np.ndarray, noun: str) -> tuple[str, ...]:
    """A sentence on names for which a format has numbers only.

    Parameters
    ----------
    names, written : (n,) as they are, and as the format has them.
    """
    count = int((names.astype(str) != written.astype(str)).sum())
    words = f"could not be carried over: the names of {counted(count, noun)}, which are numbered"
    return (left_behind(words),) if count else ()


def lost_pixels(block: Block, read_as_um: float) -> tuple[str, ...]:
    """A sentence on cameras whose pixels have another size than that which readers of the format take for unknown."""
    count = sum(camera.pixel_um != read_as_um for camera in block.cameras)
    words = f"could not be carried over: the size of the pixels of {counted(count, 'camera')}"
    return (left_behind(words),) if count else ()


def _with_number(words: str, number: int) -> str:
    """'{camera}, except the name' as '2 cameras, except the name'."""
    return re.sub(r"\{(.+?)\}", lambda noun: counted(number, noun[1]), words)
