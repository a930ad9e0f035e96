"""The settings model of block.toml: every key, its type and its range; and its translation into the records."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from aerotri.conventions import LARGEST, InputError
from aerotri.formats.text.csv_text import BLANKS
from aerotri.formats.text.tables import CONTROL_CHARACTERS, SMALLEST_POSITIVE
from aerotri.formats.text.toml_text import line_of_key, read_toml
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import (
    AdjustmentSettings,
    Camera,
    CollocationSettings,
    GnssSettings,
    InsSettings,
    Prior,
    Settings,
)
from aerotri.observations.block import BROWN_NAMES, INTERIOR_ELEMENTS, LENS_NAMES

Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, ge=SMALLEST_POSITIVE, le=LARGEST)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
Pixels = Annotated[int, Field(gt=0, le=10_000_000)]
Three = Annotated[list[Real], Field(min_length=3, max_length=3)]
ThreeNotNegative = Annotated[list[Annotated[float, Field(ge=0, le=LARGEST)]], Field(min_length=3, max_length=3)]
ThreePositive = Annotated[list[Positive], Field(min_length=3, max_length=3)]
OffOn = Literal["off", "on"]
ORIENTATION_ELEMENTS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
REASONS = {
    "string_pattern_mismatch": "should be 'local', 'EPSG:n' or 'EPSG:n+m'",
    "dict_type": "should be a table",
    "model_type": "should be a table",
    "model_attributes_type": "should be a table",
    "list_type": "should be a list",
    "too_short": "has too few entries",
    "too_long": "has too many entries",
}
"""Words of our own for kinds of error whose message speaks of Python."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class PriorModel(_Section):
    """A start value with what is known of it: ``{ value, sigma }`` (no sigma: free) or ``fixed = true``."""

    value: Real | None = None
    sigma: Positive | None = None
    fixed: bool = False

    @model_validator(mode="after")
    def _fixed_or_observed(self) -> PriorModel:
        if self.fixed and self.sigma is not None:
            raise ValueError("fixed = true and a sigma exclude each other")
        return self

    def prior(self, otherwise: float = 0.0) -> Prior:
        return Prior(otherwise if self.value is None else self.value, self.sigma, self.fixed)


class InteriorModel(_Section):
    focal_length_mm: PriorModel | None = None
    x0_mm: PriorModel | None = None
    y0_mm: PriorModel | None = None


class BrownModel(_Section):
    K1: PriorModel | None = None
    K2: PriorModel | None = None
    K3: PriorModel | None = None
    P1: PriorModel | None = None
    P2: PriorModel | None = None
    b1: PriorModel | None = None
    b2: PriorModel | None = None


class LensModel(_Section):
    k1: PriorModel | None = None
    k2: PriorModel | None = None
    p1: PriorModel | None = None
    p2: PriorModel | None = None
    k3: PriorModel | None = None


class CameraModel(_Section):
    model: Literal["frame", "ultracam_d", "dmc"] = "frame"
    size_px: Annotated[list[Pixels], Field(min_length=2, max_length=2)]
    pixel_um: Positive
    focal_length_mm: Positive
    principal_point_mm: Annotated[list[Real], Field(min_length=2, max_length=2)] = [0.0, 0.0]
    flight_axis: Literal["+x", "-x", "+y", "-y"] | None = None
    interior: InteriorModel = InteriorModel()
    brown: BrownModel = BrownModel()
    lens: LensModel = LensModel()
    interior_orientation: Literal["affine", "projective", "similarity"] | None = None
    fiducials: dict[str, Annotated[list[Real], Field(min_length=2, max_length=2)]] = {}

    @model_validator(mode="after")
    def _focal_length_positive(self) -> CameraModel:
        given = self.interior.focal_length_mm
        if given is not None and given.value is not None and given.value <= 0:
            raise ValueError(f"interior.focal_length_mm has value = {given.value}, it should be greater than 0")
        return self

    def camera(self, name: str) -> Camera:
        """The record; interior elements that are not named are fixed at the camera's own values."""
        own = dict(zip(INTERIOR_ELEMENTS, (self.focal_length_mm, *self.principal_point_mm), strict=True))
        interior = {}
        for element, value in own.items():
            given: PriorModel | None = getattr(self.interior, element)
            interior[element] = Prior(float(value), fixed=True) if given is None else given.prior(float(value))
        return Camera(
            name=name,
            model=self.model,
            size_px=(self.size_px[0], self.size_px[1]),
            pixel_um=float(self.pixel_um),
            interior=interior,
            brown=_priors(self.brown, BROWN_NAMES),
            lens=_priors(self.lens, LENS_NAMES),
            flight_axis=self.flight_axis,
            fiducials={name: (float(x), float(y)) for name, (x, y) in self.fiducials.items()},
            interior_orientation=self.interior_orientation,
        )


def _priors(section: BaseModel, names: tuple[str, ...]) -> dict[str, Prior]:
    given = {name: getattr(section, name) for name in names}
    return {name: model.prior() for name, model in given.items() if model is not None}


class StochasticModel(_Section):
    image_sigma_um: Positive | None = None
    default_control_sigma_m: ThreeNotNegative | None = None


class AdjustmentModel(_Section):
    additional_parameters: list[str] = []
    parameter_groups: str = "camera"
    parameter_selection: OffOn = "off"
    t_limit: Annotated[float, Field(ge=0, le=LARGEST)] = 1.0
    correlation_limit: Annotated[float, Field(gt=0, le=1)] = 0.85
    robust: Literal["off", "huber", "danish", "cauchy", "adaptive", "data-snooping"] = "off"
    datum: Literal["control", "minimal", "inner", "fixed"] = "control"
    datum_points: list[str] = []
    datum_fixed: list[str] = []
    variance_components: OffOn = "off"
    alpha: Fraction = 0.001
    power: Fraction = 0.80
    max_iterations: Annotated[int, Field(ge=1, le=100_000)] = 30


class CorrectionsModel(_Section):
    refraction: Literal["off", "standard"] = "off"
    earth_curvature: OffOn = "off"


class GnssModel(_Section):
    shift: Literal["off", "block", "strip"] = "off"
    drift: Literal["off", "block", "strip"] = "off"
    lever_arm_m: Three = [0.0, 0.0, 0.0]
    lever_arm_sigma_m: ThreePositive | None = None
    time_offset: Literal["off", "block", "strip"] = "off"


class InsModel(_Section):
    boresight: Literal["off", "camera"] = "camera"
    drift: Literal["off", "strip"] = "off"


class CollocationModel(_Section):
    sigma_um: Positive | None = None
    length_mm: Positive | None = None


class BlockModel(_Section):
    """block.toml."""

    name: str | None = None
    crs: Annotated[str, Field(pattern=r"^(local|EPSG:[0-9]+(\+[0-9]+)?)$")] = "local"
    angle_unit: Literal["deg", "gon", "rad"] = "deg"
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa"] = "omega-phi-kappa"
    image_unit: Literal["mm", "um", "px"] = "mm"
    camera: Annotated[dict[str, CameraModel], Field(min_length=1)]
    stochastic: StochasticModel = StochasticModel()
    adjustment: AdjustmentModel = AdjustmentModel()
    corrections: CorrectionsModel = CorrectionsModel()
    gnss: GnssModel = GnssModel()
    ins: InsModel = InsModel()
    collocation: CollocationModel = CollocationModel()


class CamerasModel(_Section):
    """The cameras of block.toml in a file of their own."""

    camera: Annotated[dict[str, CameraModel], Field(min_length=1)]


class BlockToml:
    """A block.toml that holds what it may hold.

    Parameters
    ----------
    path : the file.
    model : its content.
    text : its text, to find the lines of keys.
    """

    def __init__(self, path: Path, model: BlockModel, text: str):
        self.path, self.model, self._text = path, model, text

    def error(self, key: tuple[str, ...], message: str, remedy: str) -> InputError:
        """An `InputError` at the line of a key."""
        return InputError(message, remedy, self.path, line_of_key(self._text, key))

    def cameras(self) -> tuple[Camera, ...]:
        """The camera records.

        Raises
        ------
        InputError
            For a name that could not stand in a table.
        """
        return _camera_records(self.model.camera, self.error)

    def settings(self, image_sigma_um: float) -> Settings:
        """The settings record; `image_sigma_um` as it stands here or, where it does not, as the table's σ tell."""
        model = self.model
        return Settings(
            adjustment=self._adjustment(),
            gnss=GnssSettings(
                shift=model.gnss.shift,
                drift=model.gnss.drift,
                lever_arm_m=_triple(model.gnss.lever_arm_m),
                lever_arm_sigma_m=None
                if model.gnss.lever_arm_sigma_m is None
                else _triple(model.gnss.lever_arm_sigma_m),
                time_offset=model.gnss.time_offset,
            ),
            ins=InsSettings(model.ins.boresight, model.ins.drift),
            collocation=CollocationSettings(model.collocation.sigma_um, model.collocation.length_mm),
            image_sigma_um=image_sigma_um,
            refraction=model.corrections.refraction,
            earth_curvature=model.corrections.earth_curvature,
        )

    def _adjustment(self) -> AdjustmentSettings:
        model = self.model.adjustment
        try:
            parameters = parse_parameters(model.additional_parameters)
        except InputError as error:
            raise self.error(("adjustment", "additional_parameters"), error.message, error.remedy) from error
        plain = model.model_dump(exclude={"additional_parameters", "datum_points", "datum_fixed"})
        return AdjustmentSettings(
            additional_parameters=parameters,
            datum_points=tuple(model.datum_points),
            datum_fixed=tuple(self._fixed_element(text) for text in model.datum_fixed),
            **plain,
        )

    def _fixed_element(self, text: str) -> tuple[str, str]:
        image, _, element = text.rpartition(":")
        if not image or element not in ORIENTATION_ELEMENTS:
            raise self.error(
                ("adjustment", "datum_fixed"),
                f"datum_fixed = {text!r} names no orientation element",
                f"write IMAGE:ELEMENT, the element one of {' '.join(ORIENTATION_ELEMENTS)}",
            )
        return image, element


def _camera_records(
    cameras: dict[str, CameraModel], error: Callable[[tuple[str, ...], str, str], InputError]
) -> tuple[Camera, ...]:
    remedy = "name it by a short text"
    for name, camera in cameras.items():
        if _is_no_name(name):
            raise error(("camera", name), f"{name[:60]!r} is no name for a camera", remedy)
        for mark in camera.fiducials:
            if _is_no_name(mark):
                raise error(("camera", name, "fiducials"), f"{mark[:60]!r} is no name for a fiducial", remedy)
    return tuple(camera.camera(name) for name, camera in cameras.items())


def read_cameras_toml(path: Path) -> tuple[Camera, ...]:
    """The cameras of a file that holds tables [camera.NAME] as block.toml does, and nothing else.

    Raises
    ------
    InputError
        As `read_block_toml`.
    """
    content, text = read_toml(path)
    try:
        model = CamerasModel.model_validate(content)
    except (ValidationError, OverflowError) as error:
        raise _as_input_error(error, path, text) from error

    def error_at(key: tuple[str, ...], message: str, remedy: str) -> InputError:
        return InputError(message, remedy, path, line_of_key(text, key))

    return _camera_records(model.camera, error_at)


def _is_no_name(name: str) -> bool:
    return not name or name != name.strip(BLANKS) or re.search(CONTROL_CHARACTERS, name) is not None


def _triple(values: list[float]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def read_block_toml(path: Path) -> BlockToml:
    """block.toml, checked.

    Raises
    ------
    InputError
        With the line and the key, for what is not TOML, an unknown or missing key, a value out of range.
    """
    content, text = read_toml(path)
    try:
        return BlockToml(path, BlockModel.model_validate(content), text)
    except (ValidationError, OverflowError) as error:
        raise _as_input_error(error, path, text) from error


def _as_input_error(error: ValidationError | OverflowError, path: Path, text: str) -> InputError:
    if not isinstance(error, ValidationError):
        return InputError("holds a number too large to be read", "give a smaller number", path)
    first = error.errors(include_url=False)[0]
    where = tuple(part for part in first["loc"])
    key = ".".join(str(part) for part in where) or "block.toml"
    line = line_of_key(text, where)
    kind, value = first["type"], first["input"]
    remedy = "correct the value"
    if kind == "missing":
        message, remedy = f"key '{key}' is missing", f"add {where[-1]} = …"
    elif kind == "extra_forbidden":
        message, remedy = f"unknown key '{key}'", _known_keys(where)
    else:
        reason = _reason(first)
        message = f"{key} = {_shown(value)}: {REASONS.get(kind, reason)}"
        if kind == "string_type":
            remedy = "put names in quotes"
    return InputError(message, remedy, path, line)


def _reason(first: Any) -> str:
    """What pydantic says of a value, in the words of this program."""
    reason = str(first["msg"]).removeprefix("Value error, ").replace("Input should be", "should be")
    # the least positive number that is taken is a bound of arithmetic, not of photogrammetry
    return reason.replace(f"greater than or equal to {SMALLEST_POSITIVE:.12f}", "greater than 0")


def _shown(value: Any) -> str:
    text = "{…}" if isinstance(value, dict) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _known_keys(where: tuple[Any, ...]) -> str:
    """The keys there are where an unknown one was found, and the likely one."""
    model: Any = BlockModel
    for part in where[:-1]:
        if model is BlockModel and part == "camera":
            model = dict
        elif model is dict:
            model = CameraModel
        else:
            annotation = model.model_fields[part].annotation
            options = [a for a in getattr(annotation, "__args__", ()) if isinstance(a, type)]
            model = next((a for a in options if issubclass(a, BaseModel)), annotation)
    known = list(model.model_fields)
    close = difflib.get_close_matches(str(where[-1]), known, 1)
    return (f"did you mean '{close[0]}'? " if close else "") + f"known are {', '.join(known)}"


def checked_adjustment_settings(values: Mapping[str, object]) -> None:
    """Settings of the adjustment given elsewhere than in block.toml are held to the same rules.

    Raises
    ------
    InputError
        Naming the setting.
    """
    try:
        AdjustmentModel.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = ".".join(str(part) for part in first["loc"])
        reason = _reason(first)
        raise InputError(f"{name} = {_shown(first['input'])}: {reason}", "correct the setting") from None
