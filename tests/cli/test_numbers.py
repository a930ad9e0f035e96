"""Every option that takes a number refuses what is none, naming the option."""

from __future__ import annotations

import inspect
import typing

import pytest
import typer

from aerotri.cli import UsageError, app
from aerotri.cli.app import predict
from aerotri.conventions import InputError

COMMAND = typer.main.get_command(app)
NO_NUMBERS = ("nan", "inf", "-1e300")
TEXTS_WITH_NUMBERS = (
    ("dtm", "--interval", ("{}",)), ("volume", "--base", ("level:{}", "{}", "plane:1,2,{};3,4,5;9,1,3")),
    ("convert", "--control-sigma-m", ("{}", "1,{},1")), ("convert", "--positions-sigma-m", ("{}",)),
    ("convert", "--orientation-sigma-m", ("{}",)), ("convert", "--orientation-sigma-deg", ("{}",)),
    ("convert", "--camera-size", ("{}x100", "100x{}")), ("tiepoints", "--control-sigma-m", ("{}",)),
)  # fmt: skip


def _commands():
    for group, path in ((app, ()), (predict, ("predict",))):
        for info in group.registered_commands:
            yield (*path, info.name or info.callback.__name__), info.callback


def _options(callback):
    """(name, type, option) of what a command takes; None in place of the name of an argument."""
    hints = typing.get_type_hints(callback, include_extras=True)
    for name, parameter in inspect.signature(callback).parameters.items():
        kind, told = typing.get_args(hints[name])[:2]
        given = [word for word in told.param_decls or () if word.startswith("--")]
        is_option = type(told).__name__ == "OptionInfo"
        option = (given[0] if given else f"--{name.strip('_').replace('_', '-')}") if is_option else None
        yield option, kind, parameter.default is inspect.Parameter.empty


def _numbers_of(kind):
    """How many numbers a type takes, 0 for none: float, int | None, tuple[float, float] | None."""
    kinds = [k for k in typing.get_args(kind) or (kind,) if k is not type(None)]
    if len(kinds) == 1 and typing.get_origin(kinds[0]) is tuple:
        kinds = list(typing.get_args(kinds[0]))
    return len(kinds) if all(k in (float, int) for k in kinds) else 0


def _needed(callback, but):
    """Words without which a command line is refused for another reason."""
    words = []
    for option, kind, required in _options(callback):
        if required and option != but:
            words += ([] if option is None else [option]) + ["1"] * (_numbers_of(kind) or 1)
    return words


OPTIONS = [
    (path, option, _numbers_of(kind), _needed(callback, option))
    for path, callback in _commands()
    for option, kind, _ in _options(callback)
    if option is not None and _numbers_of(kind)
]


def test_there_are_options_with_numbers():
    known = {(path[-1], option) for path, option, *_ in OPTIONS}
    assert {("deform", "--gsd"), ("volume", "--azimuth"), ("dtm", "--area"), ("attitude", "--site")} <= known
    assert len(OPTIONS) >= 40


def _refused(arguments, option):
    with pytest.raises((UsageError, InputError)) as caught:
        COMMAND.main(arguments, prog_name="aerotri", standalone_mode=False)
    said = caught.value.format_message() if isinstance(caught.value, UsageError) else str(caught.value)
    assert option in said, (arguments, said)


@pytest.mark.parametrize(
    ("path", "option", "count", "needed"), OPTIONS, ids=[" ".join((*path, option)) for path, option, *_ in OPTIONS]
)
def test_what_is_no_number_is_refused(path, option, count, needed):
    for word in NO_NUMBERS if count == 1 else NO_NUMBERS[:1]:
        for place in range(count):
            values = ["1"] * count
            values[place] = word
            given = [f"{option}={word}"] if count == 1 else [option, *values]
            _refused([*path, *needed, *given], option)


@pytest.mark.parametrize(
    ("command", "option", "forms"), TEXTS_WITH_NUMBERS, ids=[f"{c} {o}" for c, o, _ in TEXTS_WITH_NUMBERS]
)
def test_numbers_within_a_text_are_refused(command, option, forms, tmp_path):
    callback = dict(_commands())[command,]
    needed = _needed(callback, option)
    if command == "volume":
        pytest.importorskip("rasterio")
        needed = [str(_raster(tmp_path / "dtm.tif"))]
    for word in ("nan", "1e300"):
        for form in forms:
            _refused([command, *needed, f"{option}={form.format(word)}"], option)


def _raster(path):
    import numpy as np

    from aerotri.rasters.grids import Grid, write_raster

    write_raster(path, np.ones((8, 8)), Grid(8, 8, 0.0, 8.0, 1.0, 1.0), None, "Z, m")
    return path
