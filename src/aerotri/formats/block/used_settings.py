"""Every setting that a block was adjusted with, those included that nobody stated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel

from aerotri.conventions import InputError
from aerotri.formats.block.settings_model import BlockModel
from aerotri.formats.block.settings_types import PriorModel, ThreePriorsModel
from aerotri.formats.block.writer import settings_content
from aerotri.formats.text.toml_text import key_text, value_text
from aerotri.observations import Block

NOT_LISTED = ("name", "crs", "project", "angle_unit", "image_unit")
"""Keys that stand in the head, and the units of tables, which are those of the files of the result."""
AT_READING = ("stochastic.default_control_sigma_m",)
"""Keys that only fill in what a table lacks: the values stand in the table of the result."""
SHORT = ("interior", "brown", "lens", "rolling_shutter")
"""Tables of a camera that are one line where nothing in them is stated."""

PRIORS = (PriorModel, ThreePriorsModel)
Origin = Literal["given", "default"]


@dataclass(frozen=True)
class UsedSetting:
    """A setting.

    Parameters
    ----------
    key : in full, as in block.toml: 'camera.ucd8.pixel_um'.
    value : number, text, list or table; None where it is not in use.
    unit : '' where it has none.
    origin : 'default' where it has its default value, whether that was stated or not; else 'given'.
    """

    key: str
    value: Any
    unit: str
    origin: Origin

    @property
    def text(self) -> str:
        """The value as block.toml writes it; '' where it is not in use."""
        return "" if self.value is None else value_text(self.value)


def used_settings(block: Block) -> tuple[UsedSetting, ...]:
    """All settings of a block, in the order of the documentation."""
    content = {name: value for name, value in settings_content(block).items() if name != "project"}
    try:
        model = BlockModel.model_validate(content)
    except (ValueError, InputError):
        # a block made in Python may hold what a file may not: what it states is listed as it is
        return tuple(_stated(content, ""))
    return tuple(_settings(model, ""))


def _settings(model: BaseModel, before: str, short: bool = False) -> Iterator[UsedSetting]:
    """The settings of a table; of a `short` one without those that are not in use."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if (not before and name in NOT_LISTED) or (short and value is None):
            continue
        is_default = not field.is_required() and value == field.get_default(call_default_factory=True)
        key, extra = f"{before}{key_text(name)}", field.json_schema_extra
        if key in AT_READING:
            continue
        unit = str(extra.get("unit", "")) if isinstance(extra, Mapping) else ""
        origin: Origin = "default" if is_default else "given"
        if name in SHORT and is_default:
            yield UsedSetting(key, None, unit, origin)
        elif isinstance(value, PRIORS):
            yield UsedSetting(key, value.model_dump(exclude_defaults=True), unit, origin)
        elif isinstance(value, BaseModel):
            yield from _settings(value, f"{key}.", name in SHORT)
        elif isinstance(value, Mapping) and any(isinstance(one, BaseModel) for one in value.values()):
            for part, inner in value.items():
                yield from _of_part(inner, f"{key}.{key_text(part)}", unit)
        else:
            yield UsedSetting(key, value, unit, origin)


def _of_part(value: BaseModel, key: str, unit: str) -> Iterator[UsedSetting]:
    """Of a table with a name of the user: a camera, a rig, a parameter."""
    if isinstance(value, PRIORS):
        yield UsedSetting(key, value.model_dump(exclude_defaults=True), unit, "given")
    else:
        yield from _settings(value, f"{key}.")


def _stated(content: Mapping[str, Any], before: str) -> Iterator[UsedSetting]:
    for name, value in content.items():
        if not before and name in NOT_LISTED:
            continue
        if isinstance(value, Mapping):
            yield from _stated(value, f"{before}{key_text(name)}.")
        else:
            yield UsedSetting(f"{before}{key_text(name)}", value, "", "given")
