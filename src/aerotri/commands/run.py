"""`aerotri run`: every step there is, from photographs or a block to one report.

The steps are the program's own commands, called as from the command line; one that this installation does not have, or
that needs photographs where only a block is given, is left out and named.
"""

from __future__ import annotations

import contextlib
import io
import json
import time
from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError

RECORD, REPORT = "run.json", "report.html"
BLOCK, RESULT, DTM, VOLUME = "block", "result", "dtm", "volume"
Invoke = Callable[[list[str]], int]


@dataclass(frozen=True)
class Step:
    """One step: what is called, where it writes, what it was about, and how it ended.

    Parameters
    ----------
    status : 'done', 'failed' or 'left out'; reason : why, where it is not done.
    """

    name: str
    folder: str
    what: str
    arguments: tuple[str, ...]
    status: str = ""
    reason: str = ""
    seconds: float = 0.0


def run_all(
    source: Path,
    out: Path,
    passed_on: dict[str, tuple[str, ...]],
    invoke: Invoke,
    known: Collection[str],
    as_json: bool,
    go_on: bool = False,
) -> int:
    """Exit code: 0 when every step that there is was done, 1 when one failed; arguments as on the command line.

    An adjustment that is rejected is a step that failed: nothing is built on it, unless `go_on` says so.

    Parameters
    ----------
    passed_on : further arguments of the steps, by their names. invoke : runs a command line of this program and gives
        its exit code. known : the commands there are.

    Raises
    ------
    InputError
        When there is nothing to begin with, or the first step refuses its input.
    """
    begun = time.perf_counter()
    steps, missing = [], ""
    for step in _steps(source, out, passed_on):
        before = _written(out)
        done = _left_out(step, missing, known) or _called(step, invoke, first=not steps, quiet=as_json)
        ending = "is missing" if done.status == "failed" else ""
        if ending and step.name == "adjust" and _written(out) != before:
            done, ending = _judged(done, out), "" if go_on else "is rejected; --go-on builds on it all the same"
        steps.append(done)
        missing = missing or (f"{step.name} {ending}" if ending else "")
    content = {"source": str(source), "steps": [asdict(step) for step in steps],
               "seconds": round(time.perf_counter() - begun, 1), "report": str(out / REPORT)}  # fmt: skip
    write_report(content, out)
    if as_json:
        print(json.dumps(content, ensure_ascii=False))
    else:
        _tell(steps, out)
    return 1 if any(step.status == "failed" for step in steps) else 0


def _steps(source: Path, out: Path, passed_on: dict[str, tuple[str, ...]]) -> list[Step]:
    """What there is to do, in its order."""
    is_block = source.name == "block.toml" or (source / "block.toml").is_file()
    if not is_block and not source.is_dir():
        raise InputError("is neither a folder of photographs nor a block", "give the folder", source)
    block, result, dtm = (str(out / name) for name in (BLOCK, RESULT, DTM))
    adjust = Step("adjust", RESULT, "Adjustment", ("adjust", str(source) if is_block else block, "--out", result))
    begin = Step("tiepoints", BLOCK, "Tie points", ("tiepoints", str(source), "--out", block))
    surface = Step("dtm", DTM, "Terrain", ("dtm", result, str(source), "--out", dtm))
    on_it = ("volume", f"{dtm}/dsm.tif", "--adjustment", result, "--pickets", f"{dtm}/pickets.parquet")
    volume = Step("volume", VOLUME, "Volume", (*on_it, "--out", str(out / VOLUME)))
    if not passed_on.get("volume"):
        volume = replace(volume, status="left out", reason="no --boundary was given")
    if is_block:
        reason = "it needs photographs, and a block was given"
        steps = [adjust, *(replace(step, status="left out", reason=reason) for step in (surface, volume))]
    else:
        steps = [begin, adjust, surface, volume]
    return [replace(step, arguments=step.arguments + passed_on.get(step.name, ())) for step in steps]


def _written(out: Path) -> int:
    """When the adjustment's result was written, ns; 0 where there is none."""
    path = out / RESULT / "adjustment.json"
    return path.stat().st_mtime_ns if path.is_file() else 0


def _judged(step: Step, out: Path) -> Step:
    """The step of an adjustment that has a result all the same, with what speaks against it."""
    content = json.loads((out / RESULT / "adjustment.json").read_text(encoding="utf-8"))
    return replace(step, reason=f"{content['verdict']}: {next(iter(content['reasons']), content['message'])}")


def _left_out(step: Step, missing: str, known: Collection[str]) -> Step | None:
    if step.status:
        return step
    if missing:
        return replace(step, status="left out", reason=missing)
    if step.name not in known:
        return replace(step, status="left out", reason=f"this installation has no command '{step.name}'")
    return None


def _called(step: Step, invoke: Invoke, first: bool, quiet: bool) -> Step:
    """The step done; bad input ends the run at the first step, and is told of a later one."""
    begun = time.perf_counter()
    if not quiet:
        print(f"── {step.what}: aerotri {' '.join(step.arguments)}")
    try:
        with contextlib.redirect_stdout(io.StringIO()) if quiet else contextlib.nullcontext():
            code = invoke(list(step.arguments))
    except InputError as error:
        if first:
            raise
        code, reason = 2, str(error)
    else:
        reason = "" if code == 0 else f"aerotri {step.name} ended with {code}"
    seconds = round(time.perf_counter() - begun, 1)
    return replace(step, status="failed" if code else "done", reason=reason, seconds=seconds)


def write_report(content: dict[str, Any], out: Path) -> None:
    """The record and the page, each whole or not at all."""
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.report.pages.run import run_page

    with atomic_file(out / RECORD) as place:
        place.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    with atomic_file(out / REPORT) as place:
        place.write_text(run_page(content, out), encoding="utf-8")


def _tell(steps: list[Step], out: Path) -> None:
    print("──")
    for step in steps:
        ending = f": {step.reason}" if step.reason else f", {step.seconds:.0f} s, {out / step.folder}"
        print(f"{step.what} {step.status}{ending}")
    print(f"Report: {out / REPORT}")
