"""block.toml read: what its keys hold, checked, and translated into the records; the keys are in `settings_model`."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from aerotri.conventions import InputError
from aerotri.formats.block.camera_model import CameraModel
from aerotri.formats.block.project_model import ProjectFileModel
from aerotri.formats.block.settings_model import BlockModel, CamerasModel
from aerotri.formats.block.settings_types import PriorModel
from aerotri.formats.text.csv_text import BLANKS
from aerotri.formats.text.tables import CONTROL_CHARACTERS, SMALLEST_POSITIVE
from aerotri.formats.text.toml_text import line_of_key, read_toml
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import (
    AdjustmentSettings,
    Camera,
    CollocationSettings,
    DeviationSettings,
    GnssSettings,
    InsSettings,
    PhotographFieldSettings,
    Rig,
    Settings,
)
from aerotri.observations.project import Project

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

    def rigs(self) -> tuple[Rig, ...]:
        """The rig records.

        Raises
        ------
        InputError
            For a camera that does not exist or belongs to two rigs, and for a name that could not stand in a table.
        """
        taken: dict[str, str] = {}
        for name, rig in self.model.rig.items():
            if _is_no_name(name):
                raise self.error(("rig", name), f"{name[:60]!r} is no name for a rig", "name it by a short text")
            keys = {rig.reference: ("rig", name, "reference")}
            if rig.reference in rig.camera:
                message = f"the reference camera '{rig.reference}' has a mounting of its own"
                remedy = f"remove [rig.{name}.camera.{rig.reference}]: its position and rotation are zero"
                raise self.error(("rig", name, "camera", rig.reference), message, remedy)
            keys |= {camera: ("rig", name, "camera", camera) for camera in rig.camera}
            for camera, at in keys.items():
                if camera not in self.model.camera:
                    known = ", ".join(self.model.camera)
                    raise self.error(at, f"there is no camera '{camera}'", f"there are {known}; or add [camera.…]")
                if camera in taken:
                    message = f"camera '{camera}' belongs to the rigs '{taken[camera]}' and '{name}'"
                    raise self.error(at, message, "give every rig cameras of its own")
                taken[camera] = name
        return tuple(rig.rig(name) for name, rig in self.model.rig.items())

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
                correlated=model.gnss.correlated,
                correlation_time_s=model.gnss.correlation_time_s,
                correlated_sigma_m=_by_coordinate(model.gnss.correlated_sigma_m),
                noise_factor=_factors(model.gnss.noise_factor),
            ),
            ins=InsSettings(model.ins.boresight, model.ins.drift),
            collocation=CollocationSettings(model.collocation.sigma_um, model.collocation.length_mm),
            deviations=DeviationSettings(model.deviations.kind, model.deviations.sigma_um or None),
            photograph_fields=PhotographFieldSettings(
                model.stochastic.correlated,
                model.stochastic.correlated_sigma_um,
                model.stochastic.correlation_length_mm,
            ),
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
        try:
            return fixed_element(text)
        except InputError as error:
            raise self.error(("adjustment", "datum_fixed"), error.message, error.remedy) from error


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


@dataclass(frozen=True)
class ProjectToml:
    """A TOML file whose only table is [project]. path : of the file. project : what it says. text : its text."""

    path: Path
    project: Project
    text: str

    def error(self, key: tuple[str, ...], message: str, remedy: str) -> InputError:
        """An `InputError` at the line of a key."""
        return InputError(message, remedy, self.path, line_of_key(self.text, key))


def read_project_toml(path: Path) -> ProjectToml | None:
    """The file, where [project] is all that it has; None for others, such as a block.toml.

    Raises
    ------
    InputError
        As `read_block_toml`.
    """
    content, text = read_toml(path)
    if set(content) != {"project"}:
        return None
    try:
        return ProjectToml(path, ProjectFileModel.model_validate(content).project.project(), text)
    except (ValidationError, OverflowError) as error:
        raise _as_input_error(error, path, text) from error


def _is_no_name(name: str) -> bool:
    return not name or name != name.strip(BLANKS) or re.search(CONTROL_CHARACTERS, name) is not None


def _triple(values: list[float]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _by_coordinate(values: list[float] | None) -> tuple[float, float, float] | None:
    """σ of X, Y, Z from these, or from plan and height."""
    if values is None:
        return None
    return _triple(values if len(values) == 3 else [values[0], values[0], values[1]])


def _factors(values: list[float] | str) -> tuple[float, float] | None:
    return None if isinstance(values, str) else (float(values[0]), float(values[1]))


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
    first = _first(error)
    where = tuple(part for part in first["loc"])
    key = ".".join(str(part) for part in where) or "block.toml"
    line = line_of_key(text, where)
    kind, value = first["type"], first["input"]
    remedy = _look_up(where)
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


def _look_up(where: tuple[Any, ...]) -> str:
    """Where the values stand that a key may have."""
    names = [str(part) for part in where if isinstance(part, str)]
    if names and names[-1] in PriorModel.model_fields:
        # of a parameter
        names = names[-1:]
    if "fiducials" in names:
        names = names[: names.index("fiducials") + 1]
    return f"what it may be: aerotri explain {'.'.join(names)}" if names else "write key = value under [table]"


def _first(error: ValidationError) -> Any:
    """The mistake to say first: a key that is unknown before one that is missing, which it may be misspelt."""
    found = error.errors(include_url=False)
    return next((one for one in found if one["type"] == "extra_forbidden"), found[0])


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
        inner = get_args(model) if get_origin(model) is dict else ()
        if inner:
            model = inner[1]
        elif get_origin(model.model_fields[part].annotation) is dict:
            model = model.model_fields[part].annotation
        else:
            annotation = model.model_fields[part].annotation
            options = [a for a in getattr(annotation, "__args__", ()) if isinstance(a, type)]
            model = next((a for a in options if issubclass(a, BaseModel)), annotation)
    known = list(model.model_fields)
    close = difflib.get_close_matches(str(where[-1]), known, 1)
    return (f"did you mean '{close[0]}'? " if close else "") + f"known are {', '.join(known)}"


def checked_settings(table: str, values: Mapping[str, object]) -> dict[str, Any]:
    """Settings given elsewhere than in block.toml, held to the same rules; as the records have them.

    Parameters
    ----------
    table : of block.toml, such as 'adjustment' or 'gnss'.

    Raises
    ------
    InputError
        Naming the setting.
    """
    model: Any = BlockModel.model_fields[table].annotation
    listed: dict[str, Any] = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
    try:
        model.model_validate(listed)
    except ValidationError as error:
        first = _first(error)
        name = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            raise InputError(f"there is no setting '{name}'", _known_keys((table, name))) from None
        reason = _reason(first)
        raise InputError(f"{name} = {_shown(first['input'])}: {reason}", _look_up((table, *first["loc"]))) from None
    found = {key: tuple(value) if isinstance(value, list) else value for key, value in listed.items()}
    if "additional_parameters" in found:
        found["additional_parameters"] = parse_parameters(listed["additional_parameters"])
    if "correlated_sigma_m" in found:
        found["correlated_sigma_m"] = _by_coordinate(listed["correlated_sigma_m"])
    if "noise_factor" in found:
        found["noise_factor"] = _factors(listed["noise_factor"])
    if "datum_fixed" in found:
        found["datum_fixed"] = tuple(fixed_element(text) for text in found["datum_fixed"])
    return found


def fixed_element(text: str) -> tuple[str, str]:
    """Photograph and element of orientation that a datum holds, from 'IMAGE:ELEMENT'.

    Raises
    ------
    InputError
    """
    image, _, element = text.rpartition(":")
    if not image or element not in ORIENTATION_ELEMENTS:
        raise InputError(
            f"datum_fixed = {text!r} names no orientation element",
            f"write PHOTOGRAPH:ELEMENT, the element one of {' '.join(ORIENTATION_ELEMENTS)}",
        )
    return image, element
