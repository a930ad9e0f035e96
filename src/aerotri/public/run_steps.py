"""The steps of a run: what each does, where it writes, and how it ended."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from aerotri.conventions import InputError
from aerotri.volume.settings import LAYER

RECORD, REPORT = "run.json", "report.html"
BLOCK, RESULT, ACCURACY, DTM, VOLUME, DSM, ORTHO = "block", "result", "accuracy", "dtm", "volume", "dsm", "ortho"
DENSE_VOLUME = "dsm_volume"
Verb = Literal["tie_points", "adjust", "accuracy", "terrain", "volume", "dense", "orthophoto", "dense_volume"]
BUILT_ON: Mapping[Verb, Verb] = {
    "adjust": "tie_points", "accuracy": "adjust", "terrain": "adjust", "volume": "terrain", "dense": "adjust",
    "orthophoto": "dense", "dense_volume": "dense",
}  # fmt: skip
"""The step that each takes up."""
OPTIONS = {"control": "gcp"}
"""Options of the command line whose names differ from the settings'."""
NEEDS_PHOTOGRAPHS = "it needs photographs, and a block was given"
NO_BOUNDARY = "no --boundary was given"
NOT_DENSE = "--no-dense was given"
NO_CHECK_POINTS = "there are no check points"


@dataclass(frozen=True)
class Step:
    """One step: the command line that does the same, where it writes, what it is about, and how it ended.

    Parameters
    ----------
    name : of its command. folder : in that of the run. what : for people.
    arguments : of the command line.
    status : '' before it ended, 'done', 'failed' or 'left out'.
    reason : why, where it is not done.
    seconds : that it took.
    """

    name: str
    folder: str
    what: str
    arguments: tuple[str, ...]
    status: str = ""
    reason: str = ""
    seconds: float = 0.0

    @property
    def command(self) -> str:
        """The command line, as a shell takes it: names with spaces in quotes."""
        return shlex.join(("aerotri", *self.arguments))


def is_block(source: Path) -> bool:
    """Whether a run begins with a block, not with photographs."""
    return source.name == "block.toml" or (source / "block.toml").is_file()


def steps_of(
    source: Path, out: Path, settings: Mapping[Verb, Mapping[str, Any]], dense: bool = True
) -> dict[Verb, Step]:
    """What there is to do, in its order.

    Parameters
    ----------
    settings : of every verb, by the names of its arguments. dense : also the dense surface and the orthophoto.

    Raises
    ------
    InputError
        When there is nothing to begin with.
    """
    if not is_block(source) and not source.is_dir():
        raise InputError("is neither a folder of photographs nor a block", "give the folder", source)
    block, result, accuracy, dtm, volume, dsm, ortho = (
        str(out / name) for name in (BLOCK, RESULT, ACCURACY, DTM, VOLUME, DSM, ORTHO)
    )
    refuse_of_photographs(source, settings)
    begun = str(source) if is_block(source) else block
    steps: dict[Verb, Step] = {
        "tie_points": Step("tiepoints", BLOCK, "Tie points", ("tiepoints", str(source), "--out", block)),
        "adjust": Step("adjust", RESULT, "Adjustment", ("adjust", begun, "--out", result)),
        "accuracy": Step("accuracy", ACCURACY, "Accuracy", ("accuracy", result, "--out", accuracy)),
        "terrain": Step("dtm", DTM, "Terrain", ("dtm", result, str(source), "--out", dtm)),
        "volume": Step("volume", VOLUME, "Volume", ("volume", dtm, "--adjustment", result, "--out", volume)),
        "dense": Step("dsm", DSM, "Dense surface", ("dsm", result, str(source), "--out", dsm)),
        "orthophoto": Step("ortho", ORTHO, "Orthophoto", ("ortho", result, str(source), dsm, "--out", ortho)),
    }
    if dense and not is_block(source) and settings["volume"].get("boundary"):
        given = ("volume", dsm, "--adjustment", result, "--out", str(out / DENSE_VOLUME))
        steps["dense_volume"] = Step("volume", DENSE_VOLUME, "Volume on the dense surface", given)
    if is_block(source):
        del steps["tie_points"]
    without: dict[Verb, str] = {}
    if is_block(source):
        without = dict.fromkeys(("terrain", "volume", "dense", "orthophoto"), NEEDS_PHOTOGRAPHS)
    else:
        without |= {} if settings["volume"].get("boundary") else {"volume": NO_BOUNDARY}
        without |= {} if dense else {"dense": NOT_DENSE, "orthophoto": NOT_DENSE}
    for verb, reason in without.items():
        steps[verb] = replace(steps[verb], status="left out", reason=reason)
    return {
        verb: replace(step, arguments=step.arguments + command_line(settings[verb])) for verb, step in steps.items()
    }


def refuse_of_photographs(source: Path, settings: Mapping[Verb, Mapping[str, Any]]) -> None:
    """What is said of photographs has no meaning where a run begins with a block.

    Raises
    ------
    InputError
    """
    if not is_block(source):
        return
    of_adjust = ("seed", *settings["adjust"])
    given = [name for name, value in settings["tie_points"].items() if name not in of_adjust and not is_missing(value)]
    if given:
        options = ", ".join(f"--{OPTIONS.get(name, name).replace('_', '-')}" for name in given)
        raise InputError(f"{options}: for photographs only, and a block was given", "leave them out", source)


def command_line(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Settings as options of a command line; what is not given has none."""
    words: list[str] = []
    for name, value in settings.items():
        option = f"--{OPTIONS.get(name, name).replace('_', '-')}"
        if name == "plots":
            words += [] if value else ["--no-plots"]
        elif name == "layer" and value == LAYER:
            continue
        elif name == "check":
            words += [word for one in value for word in (option, str(one))]
        elif not is_missing(value):
            words += [option, _text(value)]
    return tuple(words)


def is_missing(value: Any) -> bool:
    """Whether a setting is not given."""
    return value is None or (isinstance(value, str | tuple | list) and len(value) == 0)


def _text(value: Any) -> str:
    """A value as a user would write it; one number for three that are alike."""
    if isinstance(value, tuple | list):
        values = list(value)
        return ",".join(map(_text, values[:1] if len(set(values)) == 1 else values))
    return f"{value!r}".removesuffix(".0") if isinstance(value, float) else str(value)
