"""The keys of block.toml, taken from the models that check them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from aerotri.formats.block.settings_model import BlockModel, PriorModel

PRIOR = "{ value, sigma } or { fixed = true }"


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


def _keys(model: type[BaseModel], table: str) -> list[BlockKey]:
    found = []
    for name, field in model.model_fields.items():
        inner, repeated = _section(field.annotation)
        path = f"{table}.{name}" if table else name
        if inner is not None and inner is not PriorModel:
            found += _keys(inner, f"{path}.NAME" if repeated else path)
            continue
        extra: Any = field.json_schema_extra
        found.append(
            BlockKey(
                name=path,
                table=table,
                kind=PRIOR if inner is PriorModel else _kind(field.annotation, field.metadata),
                values=_words(field.annotation),
                default=_written(field.default),
                required=field.is_required(),
                unit=extra["unit"],
                text=str(field.description),
            )
        )
    return found


def _tables(model: type[BaseModel], table: str) -> list[tuple[str, str]]:
    found = []
    for name, field in model.model_fields.items():
        inner, repeated = _section(field.annotation)
        if inner is not None and inner is not PriorModel:
            path = f"{table}.{name}" if table else name
            path = f"{path}.NAME" if repeated else path
            found += [(path, str(field.description)), *_tables(inner, path)]
    return found


def _section(annotation: Any) -> tuple[type[BaseModel] | None, bool]:
    """The model behind an annotation, and whether it stands in a table of names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, False
    parts = get_args(annotation)
    if get_origin(annotation) is dict:
        return _section(parts[1])[0], True
    found = [inner for inner, _ in map(_section, parts) if inner is not None]
    return (found[0] if found else None), False


def _words(annotation: Any) -> tuple[str, ...]:
    if get_origin(annotation) is Literal:
        return tuple(map(str, get_args(annotation)))
    return next((words for part in get_args(annotation) if (words := _words(part))), ())


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
        return f"NAME = {_kind(parts[1], [])}"
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
    return "{}" if value == {} else str(value).replace("'", '"')
