"""Odd blocks through the commands: whatever comes in, exit 0, 1 or 2 with words, no exception, no warning of numpy.

The blocks of tests/odd_blocks.py, drawn by their numbers alone: a few photographs without strips, points with one to
four rays, pieces without a common point, wrong orientations, σ over six decades, no control, no errors at all. Each
goes through one command or two, in this process. What became of each is kept beside the table: a run that was cut off
goes on with --go-on, and after a repair --again runs those that ended in an exception anew.

Example
-------
    nice python tools/prove/odd_blocks.py --blocks 5000 --out tools/results/odd_blocks.md
    python tools/prove/odd_blocks.py --one 2030
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

# small blocks: threads would only wait for one another
for _name in ("AEROTRI_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from odd_blocks import COMMANDS, PARAMETERS, drawn, ends  # noqa: E402
from runs_elsewhere import Runs, add_executor, runs_of  # noqa: E402

AT_ONCE = 100
"""Blocks after which what became of them is kept."""
SLOW_S = 60.0
"""Processor time from which a block is listed."""


@dataclass(frozen=True)
class Became:
    """What became of a block: exit codes, or the exception with its place; processor time in s."""

    number: int
    command: str
    parameters: str
    codes: tuple[int, ...]
    exception: str
    seconds: float


def became(_shared: None, number: int) -> Became:
    """Run one block."""
    odd, begun, codes, exception = drawn(number), time.process_time(), (), ""
    with tempfile.TemporaryDirectory(prefix="aerotri_odd_") as folder:
        try:
            codes = tuple(end.code for end in ends(odd, Path(folder)))
        except Exception as error:
            exception = _place_of(error)
    return Became(number, odd.command, odd.parameters, codes, exception, round(time.process_time() - begun, 2))


def _place_of(error: Exception) -> str:
    """Type and text of an exception, and the innermost frame of the program."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "aerotri" in Path(frame.filename).parts]
    at = frames[-1]
    return f"{type(error).__name__}: {str(error)[:80]} at {Path(at.filename).name}:{at.lineno} in {at.name}"


def markdown(found: Iterable[Became]) -> str:
    """The table."""
    known = list(found)
    fell = Counter(one.exception for one in known if one.exception)
    first = {one.exception: one.number for one in reversed(known) if one.exception}
    lines = [
        "# Odd blocks", "",
        f"`python tools/prove/odd_blocks.py --blocks {len(known)}`: {len(known)} blocks, {sum(fell.values())} ended in "
        "an exception or a warning of numpy. Exit 0: adjusted. 1: no result, or a rejected one, with the reasons. 2: "
        "refused, with what to do. Of two commands the worse exit counts.", "",
        "| command | parameters | blocks | exit 0 | exit 1 | exit 2 | exceptions | longest, s |", "|" + "---|" * 8,
    ]  # fmt: skip
    for command in COMMANDS:
        for parameters in PARAMETERS:
            own = [one for one in known if (one.command, one.parameters) == (command, parameters)]
            codes = Counter(max(one.codes) for one in own if one.codes)
            numbers = [len(own), codes[0], codes[1], codes[2], sum(bool(one.exception) for one in own)]
            longest = max((one.seconds for one in own), default=0.0)
            lines.append(f"| {command} | {parameters} | {' | '.join(map(str, numbers))} | {longest:.1f} |")
    lines += ["", f"{sum(one.seconds for one in known):.0f} s of one processor.", ""]
    lines += [f"- {count} × {text} (first: block {first[text]})" for text, count in fell.most_common()]
    slow = [f"block {one.number}: {one.seconds:.0f} s" for one in known if one.seconds > SLOW_S]
    return "\n".join([*lines, *([f"Slow: {', '.join(slow)}"] if slow else [])]) + "\n"


def main() -> None:
    """Run the blocks, write the table; exit 1 where one ended in an exception."""
    arguments = _arguments()
    if arguments.one is not None:
        print(drawn(arguments.one))
        with tempfile.TemporaryDirectory() as folder:
            for end in ends(drawn(arguments.one), Path(folder)):
                print(f"exit {end.code}\n{end.text}")
        return
    kept = arguments.out.with_suffix(".jsonl")
    known = _known(kept) if arguments.go_on or arguments.again else {}
    if not known:
        kept.unlink(missing_ok=True)
    wanted = [k for k in range(arguments.blocks) if k not in known or (arguments.again and known[k].exception)]
    with runs_of(arguments) as runs:
        for begin in range(0, len(wanted), AT_ONCE):
            _run(runs, wanted[begin : begin + AT_ONCE], known, kept)
            arguments.out.write_text(markdown(known.values()), encoding="utf-8")
    raise SystemExit(1 if any(one.exception for one in known.values()) else 0)


def _run(runs: Runs, numbers: list[int], known: dict[int, Became], kept: Path) -> None:
    """Run some blocks, and keep what became of them."""
    for one in runs(became, None, numbers):
        known[one.number] = one
        with kept.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(one)) + "\n")
        if one.exception:
            print(one.number, one.exception, flush=True)


def _known(path: Path) -> dict[int, Became]:
    """What became of blocks of earlier runs, the last word on each."""
    if not path.is_file():
        return {}
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return {row["number"]: Became(**row | {"codes": tuple(row["codes"])}) for row in rows}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=5000)
    parser.add_argument("--one", type=int, help="one block by its number, with what the commands say")
    parser.add_argument("--go-on", action="store_true", help="leave out blocks that --out knows already")
    parser.add_argument("--again", action="store_true", help="run blocks that ended in an exception anew as well")
    parser.add_argument("--out", type=Path, default=Path("odd_blocks.md"), help="table to write")
    add_executor(parser)
    return parser.parse_args()


if __name__ == "__main__":
    main()
