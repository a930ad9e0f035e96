"""The keys of block.toml and simulation.toml, taken from the models that check them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from aerotri.formats.block.settings_model import BlockModel
from aerotri.formats.block.settings_types import PriorModel, ThreePriorsModel
from aerotri.simulation.camera_spec import PriorSpec
from aerotri.simulation.spec import SimulationSpec

PRIORS = (PriorModel, PriorSpec, ThreePriorsModel)
PRIOR = "{ fixed = false } (free), { value, sigma } (observed) or { fixed = true } (held)"

THREE = "{ value, sigma } (three numbers each; without sigma free), { value, fixed = true } (held)"


@dataclass(frozen=True)
class BlockKey:
    """A key of block.toml.

    Parameters
    ----------
    name : in full, such as 'gnss.shift' or 'camera.NAME.pixel_um'. table : header it stands under, '' at the top.
    kind : what is to be written, in words. values : the words that may stand there, () where it is no word.
    default : as it would be written; '' where there is none. required : whether it has to be given.
    unit : '' where it has none. text : what it does.
    """

    name: str
    table: str
    kind: str
    values: tuple[str, ...]
    default: str
    required: bool
    unit: str
    text: str


def block_keys() -> tuple[BlockKey, ...]:
    """Every key of block.toml in the order of the file, tables before what stands in them left out."""
    return tuple(_keys(BlockModel, ""))


def prior_keys() -> tuple[BlockKey, ...]:
    """The keys of a parameter, value, sigma and fixed, as `[camera.NAME.interior]` and its like have it."""
    return tuple(_keys(PriorModel, ""))


def block_tables() -> dict[str, str]:
    """The headers of block.toml and what each table is for, '' for the keys above the first header."""
    return {"": "Above the first table.", **dict(_tables(BlockModel, ""))}


def plan_keys() -> tuple[BlockKey, ...]:
    """Every key of simulation.toml, as `block_keys`."""
    return tuple(_keys(SimulationSpec, ""))


def plan_tables() -> dict[str, str]:
    """The headers of simulation.toml, as `block_tables`."""
    return {"": "Above the first table.", **dict(_tables(SimulationSpec, ""))}


def _keys(model: type[BaseModel], table: str) -> list[BlockKey]:
    found = []
    for name, field in model.model_fields.items():
        inner, below = _section(field.annotation)
        path = f"{table}.{name}" if table else name
        if inner is not None and inner not in PRIORS:
            found += _keys(inner, path + below)
            continue
        extra: Any = field.json_schema_extra
        found.append(
            BlockKey(
                name=path,
                table=table,
                kind=_kind_of_key(inner, field),
                values=_words(field.annotation),
                default=_written(field.default),
                required=field.is_required(),
                unit=extra["unit"],
                text=str(field.description),
            )
        )
    return found


def _kind_of_key(inner: type[BaseModel] | None, field: Any) -> str:
    if inner is ThreePriorsModel:
        return THREE
    return _prior(field.annotation) if inner else _kind(field.annotation, field.metadata)


def _tables(model: type[BaseModel], table: str) -> list[tuple[str, str]]:
    found = []
    for name, field in model.model_fields.items():
        inner, below = _section(field.annotation)
        if inner is not None and inner not in PRIORS:
            path = (f"{table}.{name}" if table else name) + below
            found += [(path, str(field.description)), *_tables(inner, path)]
    return found


def _prior(annotation: Any) -> str:
    is_table = get_origin(annotation) is dict
    return f"{_one_of(get_args(annotation)[0])} = {PRIOR}" if is_table else PRIOR


def _one_of(names: Any) -> str:
    """The names that the entries of a table may have, or that they may have any."""
    words = _words(names)
    return " | ".join(words) if words else "NAME"


def _section(annotation: Any) -> tuple[type[BaseModel] | None, str]:
    """The model behind an annotation, and what follows its name: '.NAME' in a table of names, '[]' in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, ""
    parts = get_args(annotation)
    if get_origin(annotation) is dict:
        return _section(parts[1])[0], ".NAME"
    found = [inner for inner, _ in map(_section, parts) if inner is not None]
    below = next((below for inner, below in map(_section, parts) if inner is not None), "")
    return (found[0] if found else None), "[]" if get_origin(annotation) is tuple else below


def _words(annotation: Any) -> tuple[str, ...]:
    """The words that may stand for a value; those for the names in a table of names are told with its kind."""
    if get_origin(annotation) is Literal:
        return tuple(map(str, get_args(annotation)))
    parts = () if get_origin(annotation) is dict else get_args(annotation)
    return next((words for part in parts if (words := _words(part))), ())


def _kind(annotation: Any, metadata: list[Any]) -> str:
    """What is to be written, in words, with the range of a number."""
    if _words(annotation):
        return "one of the words"
    if annotation in (str, bool):
        return "text" if annotation is str else "true or false"
    bounds = _bounds(metadata)
    if annotation in (int, float):
        return ("whole number" if annotation is int else "number") + _range(bounds)
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is dict:
        return f"{_one_of(parts[0])} = {_kind(parts[1], [])}"
    if origin is tuple:
        own = [_kind(part, []) for part in parts if part is not Ellipsis]
        return f"[{own[0]}, …]" if Ellipsis in parts else f"[{len(own)} {own[0].replace('number', 'numbers')}]"
    if origin is list:
        one = _kind(parts[0], [])
        return f"[{bounds['min_length']} {one.replace('number', 'numbers')}]" if bounds else f"[{one}, …]"
    return _kind(parts[0], [*metadata, *parts[1:]])


def _bounds(metadata: list[Any]) -> dict[str, float]:
    """Bounds by name, of what stands beside a type in `Annotated`, nested or not."""
    found: dict[str, float] = {}
    for one in metadata:
        found |= _bounds(list(getattr(one, "metadata", ())))
        found |= {
            name: value for name in ("gt", "ge", "lt", "min_length") if (value := getattr(one, name, None)) is not None
        }
    return found


def _range(bounds: dict[str, float]) -> str:
    if bounds.get("gt") == 0.0:
        return " between 0 and 1" if "lt" in bounds else " > 0"
    return f" ≥ {bounds['ge']:g}" if bounds.get("ge") in (0, 1) else ""


def _written(value: Any) -> str:
    """A default as block.toml has it."""
    if value is None or value is PydanticUndefined or isinstance(value, BaseModel):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if value == {} or value == ():
        return "{}" if value == {} else "[]"
    return str(list(value) if isinstance(value, tuple) else value).replace("'", '"')
