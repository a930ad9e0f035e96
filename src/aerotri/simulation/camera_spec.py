"""The cameras of a simulation, with what is wrong with them: `[camera.NAME]` of `simulation.toml`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import model_validator

from aerotri.formats.text.described_key import key
from aerotri.simulation.presets import PRESETS
from aerotri.simulation.spec_table import (
    BrownName,
    Count,
    InteriorName,
    LensName,
    NotNegative,
    Number,
    Number0,
    Positive,
    Table,
)


class PriorSpec(Table):
    """What the block says of an unknown beforehand; without a value the camera's own."""

    value: Number | None = key(
        None, "Start value that the block states; the camera's own where it is not given.", "unit of the parameter"
    )
    sigma: Positive | None = key(
        None, "Standard deviation that the block states; without it the parameter is free.", "unit of the parameter"
    )
    fixed: bool = key(False, "true: the block holds the value.")


class PhysicalErrorSpec(Table):
    """Image errors from the physics of the camera.

    `rms_um` is the RMS of a coordinate of the error over the format. `weights` sets the relative sizes of the causes
    (see `camera_errors`), `seed` fixes the camera while the seed of the simulation changes.
    """

    rms_um: Positive = key(..., "RMS of the image error in a coordinate, over the format.", "µm")
    day_change_um: NotNegative = key(0.0, "RMS of the change of the image error from day to day.", "µm")
    seed: Number0 | None = key(
        None, "Seed of the camera; the camera then stays the same when the simulation takes another seed."
    )
    weights: dict[str, NotNegative] = key(
        {}, "Relative sizes of the causes of the error; the known causes are named where one is wrong."
    )


class ErrorSpec(Table):
    """What is wrong with a camera. `interior` is true minus calibrated; `parameters` by name, 'bluh.1'."""

    parameters: dict[str, Number] = key(
        {}, 'True additional parameters by name, such as "bluh.1" = 1e-4.', "unit of the parameter"
    )
    brown: dict[BrownName, Number] = key({}, "True lens parameters of Brown.", "as in block.toml")
    lens: dict[LensName, Number] = key({}, "True lens parameters of the OpenCV model.", "as in block.toml")
    interior: dict[InteriorName, Number] = key({}, "True less stated interior orientation.", "mm")
    physical: PhysicalErrorSpec | None = key(None, "Image errors from the physics of the camera.")


class RollingShutterSpec(Table):
    """A rolling shutter in truth, and what the block states of it. Photographs move along the track of their strip."""

    readout_ms: NotNegative = key(..., "True time from the exposure of the first row to that of the last.", "ms")
    row_direction: Literal["down", "up", "right", "left"] = key(
        "down", "Direction in the image in which the rows are read, as in block.toml."
    )
    rotation_rate_sigma_deg_s: NotNegative = key(
        0.0, "Standard deviation of the true rates of rotation during the readout.", "deg/s"
    )
    stated: PriorSpec = key(
        PriorSpec(value=0.0), "What the block states of readout_ms, as in block.toml; fixed = true with value = 0 "
        "stands for a block that knows nothing of it.", "ms"
    )  # fmt: skip
    motion: Literal["track", "photograph"] = key("track", "What the block states, as in block.toml.")
    rotation: Literal["off", "photograph"] = key("off", "What the block states, as in block.toml.")


class CameraSpec(Table):
    """A camera as block.toml has it, and its errors."""

    model: Literal["frame", "ultracam_d", "dmc"] = key("frame", "Kind of camera, as in block.toml.")
    size_px: tuple[Count, Count] = key(..., "Columns, rows.", "px")
    pixel_um: Positive = key(..., "Size of a pixel.", "µm")
    focal_length_mm: Positive = key(..., "Principal distance.", "mm")
    principal_point_mm: tuple[Number, Number] = key((0.0, 0.0), "Principal point x0, y0.", "mm")
    projection: Literal["perspective", "fisheye"] = key("perspective", "Kind of lens, as in block.toml.")
    flight_axis: Literal["+x", "-x", "+y", "-y"] = key("+y", "Image axis along the flight.")
    interior: dict[InteriorName, PriorSpec] = key(
        {}, "What the block states of the interior orientation, as in block.toml.", "mm"
    )
    brown: dict[BrownName, PriorSpec] = key({}, "What the block states of Brown's lens parameters.", "as in block.toml")
    lens: dict[LensName, PriorSpec] = key(
        {}, "What the block states of the OpenCV lens parameters.", "as in block.toml"
    )
    errors: ErrorSpec = key(ErrorSpec(), "What is wrong with the camera in truth.")
    rolling_shutter: RollingShutterSpec | None = key(
        None, "Rolling shutter; without this table all rows are exposed at the same time."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or "preset" not in data:
            return data
        own = dict(data)
        name = own.pop("preset")
        if not isinstance(name, str) or name not in PRESETS:
            raise ValueError(f"preset '{name}' is not known; known are {', '.join(PRESETS)}")
        return {**PRESETS[name], **own}
