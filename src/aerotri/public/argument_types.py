"""Arguments of a public function that are of another type than its annotation says are refused by name."""

from __future__ import annotations

import functools
import inspect
import numbers
import os
import re
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from typing import Any, NamedTuple, ParamSpec, TypeVar

from aerotri.conventions import InputError

P = ParamSpec("P")
R = TypeVar("R")
LONGEST_SHOWN = 40
"""Letters of a wrong value in a message."""


class Kind(NamedTuple):
    """What an argument can be: whether a value is it, and it in words."""

    holds: Callable[[Any], bool]
    words: str


def _of_class(name: str) -> Callable[[Any], bool]:
    """By the name of the class, so that nothing is imported to ask."""

    def holds(value: Any) -> bool:
        return any(kind.__name__ == name for kind in type(value).__mro__)

    return holds


def _is_a(kind: type) -> Callable[[Any], bool]:
    def holds(value: Any) -> bool:
        return isinstance(value, kind)

    return holds


def _is_path(value: Any) -> bool:
    return isinstance(value, str | os.PathLike)


def _is_surface(value: Any) -> bool:
    return (
        _is_path(value) or _of_class("Surface")(value) or _of_class("DenseSurface")(value)
        or (hasattr(value, "dsm") and hasattr(value, "dtm"))
    )  # fmt: skip


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real | Decimal) or (_of_class("ndarray")(value) and value.ndim == 0)


def _are_numbers(value: Any) -> bool:
    return isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping)


def _are_names(value: Any) -> bool:
    """Texts; of what can be read only once nothing is read."""
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    return not isinstance(value, list | tuple | set | frozenset) or all(isinstance(one, str) for one in value)


def _are_names_or_pairs(value: Any) -> bool:
    """Texts, or texts by two; of what can be read only once nothing is read."""
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    return not isinstance(value, list | tuple | set | frozenset) or all(
        isinstance(one, str) or (isinstance(one, list | tuple) and len(one) == 2) for one in value
    )


def _are_paths(value: Any) -> bool:
    return _are_numbers(value) and (not isinstance(value, list | tuple) or all(_is_path(one) for one in value))


KINDS = {
    "None": Kind(_of_class("NoneType"), ""),
    "FilePath": Kind(_is_path, "the path of a file or folder"),
    "Block": Kind(_of_class("Block"), "a block, as aerotri.read_block returns it"),
    "Adjustment": Kind(_of_class("Adjustment"), "an adjustment, as aerotri.adjust or aerotri.open_result returns it"),
    "SurfaceLike": Kind(
        _is_surface,
        "a surface: the path of a GeoTIFF or of a folder of aerotri, an aerotri.Surface, or what aerotri.terrain or "
        "aerotri.dense_surface returns",
    ),
    "BaseGeometry": Kind(_of_class("BaseGeometry"), "a polygon of shapely"),
    "Mapping[str, BaseGeometry]": Kind(_is_a(Mapping), "polygons by their names"),
    "Table": Kind(_of_class("Table"), "an aerotri.Table"),
    "np.ndarray": Kind(_of_class("ndarray"), "an array of numpy"),
    "float": Kind(_is_number, "a number"),
    "int": Kind(_is_a(numbers.Integral), "a whole number"),
    "str": Kind(_is_a(str), "a text"),
    "Iterable[str]": Kind(_are_names, "a list of names"),
    "Sequence[str]": Kind(_are_names, "a list of names"),
    "Iterable[str | tuple[str, str]]": Kind(_are_names_or_pairs, "a list of names, or of pairs of names"),
    "Sequence[FilePath]": Kind(_are_paths, "a list of files or folders"),
    "tuple[float, float, float, float]": Kind(_are_numbers, "four numbers"),
}
"""By what stands in annotations; an argument with anything else in its annotation is left to the function."""
ALTERNATIVE = re.compile(r"(?:\w[\w.]*)(?:\[.*?\]+)?(?= \||$)")
"""A name in an annotation, with what stands in brackets behind it."""


def with_checked_types(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises an `InputError` that names the argument and what it can be.

    Parameters
    ----------
    function : in a module whose annotations are kept as texts.
    """
    signature = inspect.signature(function)
    kinds = {
        name: found for name, parameter in signature.parameters.items()
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        and (found := _kinds_of(str(parameter.annotation)))
    }  # fmt: skip

    @functools.wraps(function)
    def checked(*given: P.args, **named: P.kwargs) -> R:
        try:
            arguments = signature.bind(*given, **named).arguments
        except TypeError:
            return function(*given, **named)  # Python says what is missing, or too much
        for name, value in arguments.items():
            _refuse_other(name, value, kinds.get(name, ()))
        return function(*given, **named)

    return checked


def _kinds_of(annotation: str) -> tuple[Kind, ...]:
    """What an annotation allows; empty where it is not known."""
    names = ALTERNATIVE.findall(annotation)
    return tuple(KINDS[name] for name in names) if all(name in KINDS for name in names) else ()


def _refuse_other(name: str, value: Any, kinds: tuple[Kind, ...]) -> None:
    if not kinds or any(kind.holds(value) for kind in kinds):
        return
    if value is None or isinstance(value, numbers.Real):
        shown = str(value)
    elif _is_path(value):
        shown = f"'{str(os.fspath(value))[:LONGEST_SHOWN]}'"
    else:
        shown = f"of the type {type(value).__name__}"
    possible = " or ".join(kind.words for kind in kinds if kind.words)
    raise InputError(f"{name} is {shown}", f"give {possible}")
