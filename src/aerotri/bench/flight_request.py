"""What the page of a plan may change before it is planned again: texts as a user writes them, checked one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from aerotri.conventions import InputError


def changed_request(before: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of `plan_flight` with what the page says instead.

    Parameters
    ----------
    before : arguments of the plan that is shown. given : texts by name, of those in `ASKED`; others stay.

    Raises
    ------
    InputError
        For a name that cannot be changed, or a text that is no such value.
    """
    found = dict(before)
    for name, text in given.items():
        if name not in ASKED:
            raise InputError(f"'{str(name)[:30]}' cannot be changed on the page", f"known are {', '.join(ASKED)}")
        if not isinstance(text, str):
            raise InputError(f"{name} is no text", "load the page again")
        if text.strip() != text_of(before.get(name)):
            found[name] = ASKED[name](name, text.strip())
    return found


def texts_of(request: Mapping[str, Any]) -> dict[str, str]:
    """What the fields of the page hold at first."""
    return {name: text_of(request.get(name)) for name in ASKED}


def text_of(value: Any) -> str:
    """A value as the fields show it: '' for none, two numbers with a comma."""
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return ",".join(f"{one:g}" for one in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{_words(name)} '{text[:30]}' is not a number", "write it with a point, such as 0.02")
    return value


def _number_or_none(name: str, text: str) -> float | None:
    return _number(name, text) if text else None


def _whole(name: str, text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 9):
        raise InputError(f"{_words(name)} '{text[:30]}' is no whole number", "give 0, 1, 2 and so on")
    return int(text)


def _pair(name: str, text: str) -> list[float]:
    values = [_number(name, part.strip()) for part in text.split(",")]
    if len(values) > 2:
        raise InputError(f"{_words(name)} '{text[:30]}' is not possible", "give one number or two, as 0.02,0.03")
    return [values[0], values[-1]]


def _pair_or_none(name: str, text: str) -> list[float] | None:
    return _pair(name, text) if text else None


def _control(name: str, text: str) -> int | str:
    return "auto" if text in ("", "auto") else _whole(name, text)


def _text(name: str, text: str) -> str:
    return text


def _text_or_none(name: str, text: str) -> str | None:
    return text or None


def _words(name: str) -> str:
    return name.replace("_", " ")


ASKED: dict[str, Callable[[str, str], Any]] = {
    "gsd": _number, "forward_overlap": _number, "side_overlap": _number, "direction": _number_or_none,
    "cross_strips": _whole, "height_mode": _text, "rays": _whole, "control": _control, "control_sigma": _pair,
    "positions_sigma": _pair_or_none, "target": _text_or_none, "self_calibration": _text, "image_sigma": _number,
}  # fmt: skip
"""What may be changed, and how its text is read."""
