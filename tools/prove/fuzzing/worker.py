"""Inputs run one after the other in a forked process with limits of time and memory, which may die of them."""

from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import select
import shutil
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType

from fuzzing.mutations import mutated

SECONDS = 5
"""Time of the processor for an input, on which a busy machine has no influence; what Python cannot interrupt is killed
after twice as much."""
STANDSTILL_SECONDS = 120
"""Time on the clock after which an input that does not even compute is given up."""
MEMORY_BYTES = 1 << 30
"""What an input may take beyond what the process had."""


@dataclass(frozen=True)
class Target:
    """A reader: the good files it reads, those of them that are damaged, and the call.

    Parameters
    ----------
    files : content by path within a folder. damaged : keys of it. call : given the folder.
    """

    name: str
    files: dict[str, bytes]
    damaged: tuple[str, ...]
    call: Callable[[Path], object]


@dataclass(frozen=True)
class Found:
    """What became of one input.

    Parameters
    ----------
    outcome : 'accepted', 'refused', 'exception', 'warning', 'hang', 'memory' or 'abort'.
    place : of an exception, its type and the innermost frame of this program.
    """

    number: int
    reader: str
    outcome: str
    place: str = ""
    message: str = ""
    seconds: float = 0.0
    memory_mb: float = 0.0


class TooLongError(BaseException):
    """Raised by the alarm; no `except Exception` may swallow it."""


def input_of(targets: Sequence[Target], seed: int, number: int) -> tuple[Target, dict[str, bytes]]:
    """The reader of an input and its files, one or two of them damaged; the same for the same numbers."""
    rng = random.Random(f"{seed}:{number}")
    target = targets[number % len(targets)]
    files = dict(target.files)
    for name in rng.sample(target.damaged, min(len(target.damaged), rng.choice((1, 1, 1, 1, 2)))):
        files[name] = mutated(name, files[name], rng)
        if len(target.files) > 1 and rng.random() < 0.01:
            del files[name]
    return target, files


def write_files(files: dict[str, bytes], folder: Path) -> None:
    """The files of an input in an empty folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def warm_up(targets: Sequence[Target], folder: Path) -> None:
    """Read the good files once, so that every forked process finds the program loaded and compiled."""
    for target in {target.name: target for target in targets}.values():
        write_files(target.files, folder)
        target.call(folder)


def run_inputs(targets: Sequence[Target], seed: int, numbers: Sequence[int], folder: Path) -> Iterator[Found]:
    """What becomes of inputs; a process that dies of one is replaced."""
    rest = list(numbers)
    while rest:
        done = 0
        for found in _of_one_process(targets, seed, rest, folder):
            done += 1
            yield found
        if done < len(rest) and done == 0:
            raise RuntimeError("the process died before its first input")
        rest = rest[done:]


def _of_one_process(targets: Sequence[Target], seed: int, numbers: Sequence[int], folder: Path) -> Iterator[Found]:
    reading, writing = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _child(targets, seed, numbers, folder, writing)
    os.close(writing)
    current, begun, spent, ended = None, time.perf_counter(), 0.0, False
    with os.fdopen(reading, "rb") as pipe:
        while not ended:
            ready, _, _ = select.select([pipe], [], [], 1.0)
            if not ready and current is None:
                continue
            waited = time.perf_counter() - begun
            if not ready and _cpu_seconds(child) - spent < 2 * SECONDS and waited < STANDSTILL_SECONDS:
                continue
            if not ready:
                os.kill(child, signal.SIGKILL)
                yield Found(current, _name(targets, current), "hang", "outside of Python", "", 2.0 * SECONDS)
                current = None
                break
            line = pipe.readline()
            if not line:
                break
            message = json.loads(line)
            if "begin" in message:
                current, begun, spent = message["begin"], time.perf_counter(), _cpu_seconds(child)
            elif "end" in message:
                ended = True
            else:
                current = None
                yield Found(**message)
    _, status = os.waitpid(child, 0)
    if current is not None:
        said = os.waitstatus_to_exitcode(status)
        yield Found(current, _name(targets, current), "abort", f"exit {said}", "", time.perf_counter() - begun)


def _name(targets: Sequence[Target], number: int) -> str:
    return targets[number % len(targets)].name


def _child(targets: Sequence[Target], seed: int, numbers: Sequence[int], folder: Path, writing: int) -> None:
    """Run the inputs and tell of each on the pipe; never returns."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    signal.signal(signal.SIGPROF, _alarmed)
    try:
        base = _status("VmSize")
        resource.setrlimit(resource.RLIMIT_AS, (base + MEMORY_BYTES, base + MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with os.fdopen(writing, "w") as pipe:
            for number in numbers:
                target, files = input_of(targets, seed, number)
                write_files(files, folder)
                pipe.write(json.dumps({"begin": number}) + "\n")
                pipe.flush()
                pipe.write(json.dumps(asdict(run_one(target, folder, number))) + "\n")
                pipe.flush()
            pipe.write('{"end": 1}\n')
    finally:
        os._exit(0)


def run_one(target: Target, folder: Path, number: int) -> Found:
    """What a reader makes of the files of a folder."""
    from aerotri import InputError

    _forget_peak()
    before, begun = _status("VmRSS"), time.process_time()
    outcome, place, message = "accepted", "", ""
    try:
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", category=RuntimeWarning)
            target.call(folder)
    except InputError as error:
        outcome, message = "refused", str(error)
        named = error.file is not None or any(Path(name).name in message for name in target.files)
        if not named or not error.remedy or not str(error).isprintable():
            outcome, place = "exception", f"InputError without file or remedy at {_place(error)}"
    except TooLongError as error:
        outcome, place = "hang", _place(error)
    except MemoryError as error:
        outcome, place = "memory", _place(error)
    except RuntimeWarning as error:
        outcome, place, message = "warning", f"{error} at {_place(error)}"[:150], str(error)
    except BaseException as error:
        outcome, place, message = "exception", f"{type(error).__name__} at {_place(error)}", str(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    seconds = time.process_time() - begun
    peak = max(0, _status("VmHWM") - before) / 2**20
    return Found(number, target.name, outcome, place, message[:300], seconds, peak)


def _alarmed(number: int, frame: FrameType | None) -> None:
    raise TooLongError


def _place(error: BaseException) -> str:
    """The innermost frame of this program that an error came through."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if f"{os.sep}aerotri{os.sep}" in frame.filename] or frames
    last = own[-1]
    return f"{Path(last.filename).parent.name}/{Path(last.filename).name}:{last.lineno} {last.name}"


def _status(key: str) -> int:
    """Bytes of an entry of /proc/self/status."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) * 1024
    return 0


def _cpu_seconds(process: int) -> float:
    """Time of the processor that a process has had."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _forget_peak() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
