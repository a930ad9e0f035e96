"""A new block folder: block.toml with every key, its unit, default and effect as comments, and empty tables.

Keys and words are those of the models that check the file, columns those of the readers: it cannot drift from them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from aerotri.conventions import FilePath, InputError
from aerotri.formats.block.points import CONTROL_COLUMNS, GNSS_COLUMNS, IMAGE_POINT_COLUMNS
from aerotri.formats.block.settings_model import BlockModel
from aerotri.formats.block.settings_types import PriorModel, Section, ThreePriorsModel
from aerotri.formats.block.unread import TABLES
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.text.tables import Columns
from aerotri.formats.text.toml_text import key_text, value_text

EMPTY_TABLES: dict[str, Columns] = {
    "images": TABLES["images"],
    "image_points": IMAGE_POINT_COLUMNS,
    "control": CONTROL_COLUMNS,
    "gnss_ins": GNSS_COLUMNS,
}
WIDTH = 110
EXAMPLES: dict[str, Any] = {
    "name": "my_block",
    "camera.NAME.flight_axis": "+y",
    "camera.NAME.interior_orientation": "affine",
    "camera.NAME.parameters": {"bluh.9": {"value": 1.2e-7, "fixed": True}},
    "camera.NAME.rolling_shutter.readout_ms": {"value": 30.0},
    "camera.NAME.rolling_shutter.speed_m_s": 8.0,
    "camera.NAME.fiducials": {"1": [-106.0, -106.0]},
    "stochastic.default_control_sigma_m": [0.02, 0.02, 0.03],
    "gnss.lever_arm_sigma_m": [0.01, 0.01, 0.01],
    "gnss.correlation_time_s": 60.0,
    "gnss.correlated_sigma_m": [0.02, 0.03],
    "stochastic.correlated_sigma_um": 1.5,
    "stochastic.correlation_length_mm": 5.0,
    "collocation.sigma_um": 2.0,
    "collocation.length_mm": 10.0,
    "rig.NAME.camera.NAME.position_m": {"value": [0.0, -0.05, 0.02], "sigma": [0.01, 0.01, 0.01]},
    "rig.NAME.camera.NAME.rotation_deg": {"value": [0.0, 45.0, 90.0]},
}
"""What stands where there is no default: an example, never in force before the user takes the # away."""
NAMES = {"rig.NAME.camera.NAME": "rig.my_rig.camera.oblique", "rig.NAME": "rig.my_rig"}
"""Examples of names of rigs and of the cameras on them."""
FREE = {"fixed": False}
"""The example of a parameter: an unknown without an observed value."""
DECIDE = {
    "image_unit": "Set here to px. Write the unit of your table.",
    "stochastic.image_sigma_um": "Set here to half a pixel, a usual value. Write yours.",
}
"""Keys that everybody has to think about: they are in force, with a sentence on what stands there."""
HEADING = (
    "The settings of a block. Every key stands here. A key behind a # has its default or is not set; to set it take "
    "the # away and change the value.",
    "Beside this file stand the tables {tables} (.csv or .parquet); there may be {others} as well.",
    "`aerotri check` tells what is missing, `aerotri explain KEY` what a key means.",
)
EXAMPLE = "The camera below is an example: write yours."


@dataclass(frozen=True)
class NewCamera:
    """The camera of a new block; what is None is written as an example.

    Parameters
    ----------
    name : as images.csv is going to have it. size_px : columns and rows. pixel_um, focal_length_mm : as in block.toml.
    """

    name: str = "main"
    size_px: tuple[int, int] | None = None
    pixel_um: float | None = None
    focal_length_mm: float | None = None

    @property
    def values(self) -> dict[str, Any]:
        """Of the keys that have no default, with examples in place of what is not given."""
        size = None if self.size_px is None else list(self.size_px)
        given = {"size_px": size, "pixel_um": self.pixel_um, "focal_length_mm": self.focal_length_mm}
        examples = {"size_px": [6000, 4000], "pixel_um": 4.0, "focal_length_mm": 24.0}
        return {name: examples[name] if value is None else value for name, value in given.items()}

    @property
    def decided(self) -> dict[str, Any]:
        """What stands at the keys of `DECIDE`."""
        return {"image_unit": "px", "stochastic.image_sigma_um": round(0.5 * self.values["pixel_um"], 3)}

    @property
    def is_example(self) -> bool:
        """Whether the camera is not stated in full."""
        return None in (self.size_px, self.pixel_um, self.focal_length_mm)


def write_template(folder: FilePath, camera: NewCamera = NewCamera()) -> tuple[str, ...]:
    """Write block.toml and empty tables; nothing that is there is replaced.

    Returns
    -------
    The names of the files.

    Raises
    ------
    InputError
        When one of them is there already, as CSV or Parquet, or the folder cannot be written to.
    """
    target = Path(folder)
    tables = [f"{name}.csv" for name in EMPTY_TABLES]
    for name in ("block.toml", *tables, *(f"{name}.parquet" for name in EMPTY_TABLES)):
        if (target / name).exists():
            raise InputError("exists already", "give another folder: aerotri init replaces no file", target / name)
    with atomic_folder(target, own=("block.toml", *tables)) as place:
        (place / "block.toml").write_text(block_toml_text(camera), encoding="utf-8")
        for name, columns in EMPTY_TABLES.items():
            (place / f"{name}.csv").write_text(",".join(columns.known) + "\n", encoding="utf-8")
    return ("block.toml", *tables)


def example_in_words(toml: Path, model: BlockModel) -> tuple[str, ...]:
    """A sentence about each camera of a block.toml that still is the example of a new block."""
    if _comment(EXAMPLE)[0] not in toml.read_text(encoding="utf-8"):
        return ()
    example = NewCamera().values
    return tuple(
        f"camera '{name}' is the example that aerotri init wrote: write size_px, pixel_um and focal_length_mm of yours"
        for name, camera in model.camera.items()
        if {key: getattr(camera, key) for key in example} == example
    )


def block_toml_text(camera: NewCamera = NewCamera()) -> str:
    """The text of a block.toml in which every key stands."""
    names = {
        "tables": ", ".join(EMPTY_TABLES),
        "others": ", ".join(name for name in TABLES if name not in EMPTY_TABLES),
    }
    heading = [line for text in HEADING for line in _comment(text.format(**names))]
    return "\n".join(
        [*heading, *(_comment(EXAMPLE) if camera.is_example else ()), "", *_section(BlockModel, "", camera)]
    )


def _section(model: type[BaseModel], table: str, camera: NewCamera) -> Iterator[str]:
    """Lines of a table: its keys, then the tables in it."""
    inner = {name: found for name, field in model.model_fields.items() if (found := _table_of(field.annotation))}
    for name, field in model.model_fields.items():
        if name not in inner:
            yield from _key(f"{table}.{name}" if table else name, field, camera)
    for name, found in inner.items():
        field = model.model_fields[name]
        path = f"{table}.{name}" if table else name
        named = f"{path}.NAME" if get_origin(field.annotation) is dict else path
        lines = [f"[{_header(named, camera)}]", *_section(found, named, camera)]
        yield from _comment(str(field.description))
        # most blocks have no rig, and one that is there must be whole
        yield from [f"#{line}" if line and not line.startswith("#") and path == "rig" else line for line in lines]


def _header(path: str, camera: NewCamera) -> str:
    """The header of a table, with examples of names."""
    for name, example in NAMES.items():
        path = path.replace(name, example)
    return path.replace("NAME", key_text(camera.name))


def _key(path: str, field: Any, camera: NewCamera) -> Iterator[str]:
    name = path.rpartition(".")[2]
    is_set = path in DECIDE
    yield from _comment(" ".join(part for part in (str(field.description), _facts(field, is_set)) if part))
    if is_set:
        yield from _comment(DECIDE[path])
        yield f"{name} = {value_text(camera.decided[path])}"
    elif field.is_required():
        yield f"{name} = {value_text(camera.name if path == 'rig.NAME.reference' else camera.values[name])}"
    else:
        yield f"#{name} = {value_text(_shown(path, field))}"
    yield ""


def _facts(field: Any, is_set: bool) -> str:
    """Unit, words and default in brackets; `is_set` is whether the key is in force though it has no default."""
    unit = field.json_schema_extra["unit"]
    words = _words(field.annotation)
    facts = [f"unit {unit}"] if unit else []
    if words:
        facts.append("one of " + ", ".join(words))
    if field.is_required():
        facts.append("required")
    elif field.default is None or _is_prior(field.annotation):
        facts += [] if is_set else ["not set"]
    else:
        facts.append(f"default {value_text(field.default)}")
    return f"[{'; '.join(facts)}]"


def _shown(path: str, field: Any) -> Any:
    """The default, or an example where there is none."""
    if _is_prior(field.annotation) and path not in EXAMPLES:
        return FREE
    if path in EXAMPLES:
        return EXAMPLES[path]
    if field.default is None or field.default is PydanticUndefined:
        raise ValueError(f"{path} has neither a default nor an example")
    return field.default


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)]


def _table_of(annotation: Any) -> type[BaseModel] | None:
    """The model behind a key that is a table of its own, or a table of names; None of all others."""
    found = get_args(annotation)[1] if get_origin(annotation) is dict else annotation
    is_table = isinstance(found, type) and issubclass(found, Section) and found not in (PriorModel, ThreePriorsModel)
    return found if is_table else None


def _is_prior(annotation: Any) -> bool:
    one = get_origin(annotation) is not dict and PriorModel in get_args(annotation)
    return one or annotation in (PriorModel, ThreePriorsModel)


def _words(annotation: Any) -> tuple[str, ...]:
    if get_origin(annotation) is Literal:
        return tuple(map(str, get_args(annotation)))
    return next((words for part in get_args(annotation) if (words := _words(part))), ())
