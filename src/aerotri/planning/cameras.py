"""The camera of a plan: one by name, or that of a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from aerotri.conventions import InputError
from aerotri.formats.block.settings import read_cameras_toml
from aerotri.observations import Camera, Prior
from aerotri.simulation.camera_spec import CameraSpec
from aerotri.simulation.cameras import block_camera
from aerotri.simulation.presets import PRESETS

INTERIOR_SHARE = 1e-3
"""σ of the interior orientation of a named camera that calibrates itself, as a share of the principal distance [C]."""


def camera_of_plan(given: str, calibrated: bool) -> Camera:
    """A camera by name, or the only one of a file with a table [camera.NAME] as block.toml has it.

    The lens errors that a file states are taken as known; their σ count.

    Parameters
    ----------
    calibrated : whether a named camera's interior orientation is to be estimated.

    Raises
    ------
    InputError
        For a name that is not known, or a camera that a plan cannot be made for.
    """
    if given in PRESETS:
        camera = block_camera(given, CameraSpec.model_validate({"preset": given}))
        sigma = INTERIOR_SHARE * camera.interior["focal_length_mm"].value
        if calibrated:
            interior = {name: Prior(prior.value, sigma) for name, prior in camera.interior.items()}
            camera = replace(camera, interior=interior)
        return camera
    if not Path(given).is_file():
        raise InputError(
            f"the camera '{given}' is not known, and no such file is there",
            f"give {', '.join(PRESETS)}, or a TOML file with a table [camera.NAME]",
        )
    cameras = read_cameras_toml(Path(given))
    if len(cameras) != 1:
        raise InputError(f"has {len(cameras)} cameras", "give a file with one", Path(given))
    camera = cameras[0]
    if camera.is_fisheye or camera.rolling_shutter is not None or camera.fiducials:
        raise InputError(
            "a plan cannot be made for a fisheye lens, a rolling shutter or scanned film",
            "leave out projection, rolling_shutter and fiducials", Path(given),
        )  # fmt: skip
    if camera.flight_axis is None:
        camera = replace(camera, flight_axis="+y")
    return replace(
        camera, brown=_known(camera.brown), lens=_known(camera.lens), parameters=_known(camera.parameters)
    )  # fmt: skip


def _known(priors: Mapping[str, Prior]) -> dict[str, Prior]:
    """The same σ around 0: image coordinates of a plan are free of lens errors."""
    return {name: replace(prior, value=0.0) for name, prior in priors.items()}
