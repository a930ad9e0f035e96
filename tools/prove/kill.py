"""Kill commands at random moments, fill the disk, and run two at once: what stands in the result folder afterwards?

After every trial the folder must hold, whole, the older result or the new one, and files of the user as they were; the
next run must succeed and leave nothing hidden behind. A trial is a fork of a process that has everything imported and
compiled, so that a thousand of them are cheap. A third each is killed

- at any moment of the run,
- while the new result is being written, a random time after its hidden folder has appeared,
- between two operations on files, counted by an audit hook, so that every step of the writing is met.

Measures the commands from within: imports aerotri.cli on purpose.

    python tools/prove/kill.py          # a thousand kills, disk full, two at once; writes tools/results/kill.md
    python tools/prove/kill.py --kills 30 --only convert,volume --no-table
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

RESULTS = Path(__file__).parents[1] / "results" / "kill.md"
SHARES = {"adjust": 250, "convert": 250, "volume": 200, "simulate": 150, "dtm": 100, "tiepoints": 50}
"""Kills of a thousand."""
PLAN = """
name = "tiny"
camera.cam = { preset = "ultracam_d", size_px = [575, 375], pixel_um = 180.0 }
flight = { gsd_m = 1.0, strips = 1, images_per_strip = 3, end_lap = 0.6, heading_deg = 30.0 }
terrain = { kind = "undulating", height_m = 100.0, relief_rms_m = 10.0, wavelength_m = 400.0 }
tie_points = { per_image = 60, probability = 0.9, sigma_um = 9.0 }
control = { distance_bases = 1.0, sigma_m = [0.05, 0.05, 0.05] }
"""
VOLATILE = ("timings_s", "seconds")
NOTES = "this is mine"
MODES = ("any moment", "while writing", "between operations")
DEADLINE_S = 300.0


@dataclass
class Case:
    """A command in two variants whose results differ, writing to the same place.

    Parameters
    ----------
    variants : arguments of the two, without the target. notes : places of files of the user in the target.
    whole : digests of the two results. seconds : how long a run takes.
    """

    name: str
    out: Path
    variants: tuple[list[str], list[str]]
    notes: tuple[str, ...] = ("notes.txt",)
    whole: list[str] = field(default_factory=list)
    seconds: float = 1.0
    operations: int = 100
    tally: Counter = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)

    @property
    def is_folder(self) -> bool:
        return bool(self.notes)

    def arguments(self, variant: int, out: Path | None = None) -> list[str]:
        target = str(out or self.out)
        if self.name == "convert":
            return [self.name, *self.variants[variant], target, "--overwrite"]
        return [self.name, *self.variants[variant], "--out", target]


def digest(path: Path, notes: tuple[str, ...]) -> str:
    """Of a result without its times, user's files, hidden files and kept features; '' for nothing there."""
    if not path.exists():
        return ""
    own = hashlib.sha256()
    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
    for file in files:
        rel = str(file.relative_to(path)) if path.is_dir() else ""
        if rel in notes or file.name.startswith(".") or rel.startswith("tie_point_cache"):
            continue
        own.update(rel.encode() + content(file))
    return own.hexdigest()


def content(file: Path) -> bytes:
    """What of a file is the same in every run; raises where the file is not whole."""
    if file.suffix == ".json":
        return json.dumps(without_times(json.loads(file.read_text(encoding="utf-8"))), sort_keys=True).encode()
    import numpy as np

    if file.suffix == ".npz":
        with np.load(file) as arrays:
            return b"".join(name.encode() + arrays[name].tobytes() for name in sorted(arrays.files))
    if file.suffix == ".laz":
        import laspy

        return np.asarray(laspy.read(file).xyz).tobytes()
    return file.read_bytes()


def without_times(value: object) -> object:
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if k not in VOLATILE}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def hidden(case: Case) -> list[str]:
    """Leftovers beside the target and in it."""
    found = [p for p in case.out.parent.glob(".*.tmp")]
    inside = [p for p in case.out.rglob(".*.tmp")] if case.out.is_dir() else []
    return sorted(str(p) for p in found + inside)


def in_child(work: Callable[[], int], log: Path) -> int:
    """Process number of a fork that does the work, with its output in a file."""
    sys.stdout.flush()
    number = os.fork()
    if number:
        return number
    code = 99
    try:
        out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        code = work()
    finally:
        sys.stdout.flush()
        os._exit(code)


def command(arguments: list[str]) -> int:
    """Exit code of a command line as the program gives it."""
    import aerotri.cli as cli

    sys.argv = ["aerotri", *arguments]
    try:
        cli.main()
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


def killed_at_operation(arguments: list[str], place: str, count: int, counter: Path) -> int:
    """A run that kills itself at the count-th operation on files beneath a place; 0: it only counts them."""
    done = 0
    watched = ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.listdir", "os.scandir")

    def hook(event: str, args: tuple) -> None:
        nonlocal done
        if event in watched and any(isinstance(a, (str, bytes, os.PathLike)) and place in str(a) for a in args):
            done += 1
            if done == count:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)
    code = command(arguments)
    counter.write_text(str(done))
    return code


def ended(number: int) -> int:
    """How a child ended: its exit code, or minus the signal."""
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])


def complete_run(case: Case, variant: int, log: Path) -> int:
    return ended(in_child(lambda: command(case.arguments(variant)), log))


def trial(case: Case, mode: str, chance: random.Random, log: Path) -> None:
    """Kill one run, look at what is there, and run again."""
    variant = chance.randrange(2)
    before = digest(case.out, case.notes)
    if mode == "between operations":
        at = chance.randrange(1, case.operations + 1)
        arguments = case.arguments(variant)
        number = in_child(lambda: killed_at_operation(arguments, str(case.out.parent), at, log.with_name("n")), log)
    else:
        number = in_child(lambda: command(case.arguments(variant)), log)
        wait_for(case, mode, chance, number)
        os.kill(number, signal.SIGKILL)
    code = ended(number)
    case.tally["killed" if code == -signal.SIGKILL else "ended before"] += 1
    if code not in (0, -signal.SIGKILL):
        case.failures.append(f"{mode}: exit {code}: {log.read_text(errors='replace')[-300:]}")
    look(case, mode, (before, case.whole[variant]))
    case.tally["leftovers"] += bool(hidden(case))
    if chance.random() < 0.4:
        run_again(case, mode, chance.randrange(2), log)


def wait_for(case: Case, mode: str, chance: random.Random, number: int) -> None:
    """Wait for the moment of the kill, or for the end of the run."""
    begun = time.monotonic()
    if mode == "any moment":
        until = begun + chance.uniform(0.0, 1.1 * case.seconds)
    else:
        place = case.out.with_name(f".{case.out.name}.aerotri.tmp")
        while not place.exists() and time.monotonic() < begun + DEADLINE_S and not is_over(number):
            time.sleep(0.002)
        until = time.monotonic() + chance.uniform(0.0, 0.3) ** 2 * case.seconds
    while time.monotonic() < until and not is_over(number):
        time.sleep(0.002)


def is_over(number: int) -> bool:
    """Whether a child has ended; it still has to be waited for."""
    return os.waitid(os.P_PID, number, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def look(case: Case, mode: str, allowed: tuple[str, ...]) -> None:
    """What is in the place must be one of the results allowed, and files of the user as they were."""
    try:
        found = digest(case.out, case.notes)
    except Exception as error:  # whatever a half-written file makes a reader say
        case.failures.append(f"{mode}: not readable: {error!r}")
        return
    if found not in allowed:
        case.failures.append(f"{mode}: neither the old nor the new result")
    for name in case.notes:
        note = case.out / name
        if not note.is_file() or note.read_text() != NOTES:
            case.failures.append(f"{mode}: {name} of the user is gone")


def run_again(case: Case, mode: str, variant: int, log: Path) -> None:
    """The next run succeeds and leaves nothing hidden."""
    begun = time.monotonic()
    code = complete_run(case, variant, log)
    case.seconds = 0.7 * case.seconds + 0.3 * (time.monotonic() - begun)
    case.tally["next runs"] += 1
    if code:
        case.failures.append(f"{mode}: the next run ended with {code}: {log.read_text(errors='replace')[-300:]}")
    look(case, mode, (case.whole[variant],))
    if hidden(case):
        case.failures.append(f"{mode}: the next run leaves {hidden(case)}")


def disk_full(case: Case, chance: random.Random, log: Path, mount: Path | None) -> None:
    """A run without enough room: exit 2 and one line, the older result as it was, nothing hidden."""
    before = digest(case.out, case.notes)
    variant = chance.randrange(2)
    size = sum(f.stat().st_size for f in ([case.out] if case.out.is_file() else case.out.rglob("*")) if f.is_file())
    if mount is not None:
        place = mount / case.out.name
        room = int(size * chance.uniform(1.02, 1.9)) + 8192
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={room}", "tmpfs", str(mount)], check=True)
    try:
        if mount is None:
            number = in_child(lambda: limited(case.arguments(variant), int(size * chance.uniform(0.001, 0.3))), log)
            copy = case
        else:
            try:
                shutil.copytree(case.out, place) if case.out.is_dir() else shutil.copy2(case.out, place)
            except OSError:
                return  # not even the older result fits
            copy = Case(case.name, place, case.variants, case.notes, case.whole)
            number = in_child(lambda: command(copy.arguments(variant)), log)
        code, said = ended(number), log.read_text(errors="replace")
        if code == 0:
            case.tally["had room"] += 1
            look(copy, "disk full", (case.whole[variant],))
        else:
            case.tally["disk full"] += 1
            look(copy, "disk full", (before,))
            if code != 2 or "disk is full" not in said.splitlines()[-1]:
                case.failures.append(f"disk full: exit {code}: {said[-300:]}")
        if hidden(copy):
            case.failures.append(f"disk full: leaves {hidden(copy)}")
        case.failures += copy.failures if copy is not case else []
    finally:
        if mount is not None:
            subprocess.run(["umount", str(mount)], check=True)


def limited(arguments: list[str], largest: int) -> int:
    """A run whose files cannot grow beyond a size, where no disk can be made."""
    import resource

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    return command(arguments)


def two_at_once(case: Case, log: Path) -> None:
    """Two runs to one place: each ends well or is refused, and what stands there is of one of them."""
    logs = [log.with_name(f"two{k}") for k in range(2)]
    numbers = [in_child(lambda k=k: command(case.arguments(k)), logs[k]) for k in range(2)]
    codes = [ended(number) for number in numbers]
    for code, own in zip(codes, logs, strict=True):
        said = own.read_text(errors="replace")
        case.tally["two: done" if code == 0 else "two: refused"] += 1
        if code not in (0, 2) or (code == 2 and "another run is writing here" not in said):
            case.failures.append(f"two at once: exit {code}: {said[-300:]}")
    if codes == [2, 2]:
        case.failures.append("two at once: both were refused")
    look(case, "two at once", tuple(case.whole))
    if hidden(case):
        case.failures.append(f"two at once: leaves {hidden(case)}")


def make_cases(here: Path, only: tuple[str, ...]) -> list[Case]:
    """Inputs made by the program itself, and the cases about them."""
    for k in (1, 2):
        (here / f"plan{k}.toml").write_text(PLAN.replace("per_image = 60", f"per_image = {58 + 2 * k}"))
    block, plan = here / "block", str(here / "plan1.toml")
    run_here("simulate", plan, "--out", block, "--seed", 3, "--render")
    run_here("adjust", block, "--out", here / "result", "--no-plots")
    dtm = (str(here / "result"), str(block / "photographs"), "--no-plots", "--pairs", "--interval")
    if "volume" in only or "dtm" in only:
        run_here("dtm", *dtm, 30, "--out", here / "surface")
    surface = here / "surface" / "dsm.tif"
    photographs = (str(block / "photographs"), "--focal-length-mm", "101.4", "--pixel-um", "180", "--features", "500")
    places = {name: here / "out" / name / "result" for name in SHARES}
    inside = ("notes.txt", "block/mine.txt")
    return [
        case
        for case in (
            Case("adjust", places["adjust"], ([str(block), "--no-plots"], [str(block), "--no-plots", "--parameters",
                                                                           "bluh:1-2"]), inside),
            Case("convert", places["convert"], ([str(block), "--to", "bingo"], [str(block), "--to", "ign-mes"]), ()),
            Case("volume", places["volume"], ([str(surface), "--base", "level:50", "--no-plots"],
                                              [str(surface), "--base", "level:60", "--no-plots"])),
            Case("simulate", places["simulate"], ([plan], [str(here / "plan2.toml")]), ("notes.txt", "truth/mine.txt")),
            Case("dtm", places["dtm"], ([*dtm, "30"], [*dtm, "40"])),
            Case("tiepoints", places["tiepoints"], ([*photographs, "--points", "100"], [*photographs, "--points",
                                                                                        "150"])),
        )
        if case.name in only
    ]  # fmt: skip


def run_here(*arguments: object) -> None:
    """A command line within this process, so that what it imports and compiles is there for the forks."""
    from aerotri.cli import app

    app([str(a) for a in arguments], standalone_mode=False)


def prepare(case: Case, log: Path) -> None:
    """Both results, how long a run takes and how many operations on files it has; notes of the user beside them."""
    case.out.parent.mkdir(parents=True)
    run_here(*case.arguments(0))
    for variant in (0, 1):
        begun = time.monotonic()
        if complete_run(case, variant, log):
            raise SystemExit(f"{case.name} does not run: {log.read_text()}")
        case.seconds = time.monotonic() - begun
        case.whole.append(digest(case.out, case.notes))
    if case.whole[0] == case.whole[1]:
        raise SystemExit(f"the variants of {case.name} give the same")
    for name in case.notes:
        (case.out / name).write_text(NOTES)
    counter = log.with_name("n")
    ended(in_child(lambda: killed_at_operation(case.arguments(0), str(case.out.parent), 0, counter), log))
    case.operations = int(counter.read_text())


def mounted() -> bool:
    """Whether a small disk can be made here."""
    with tempfile.TemporaryDirectory() as place:
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place], capture_output=True)
        if done.returncode == 0:
            subprocess.run(["umount", place], check=True)
        return done.returncode == 0


def table(cases: list[Case], how_full: str) -> str:
    lines = [
        "# Killed, without room, and two at once",
        "",
        f"`python tools/prove/kill.py`. Runs killed by SIGKILL: {sum(c.tally['killed'] for c in cases)}. "
        "After each the "
        "older or the new result stood in its place, whole and readable, and the files of the user as they were, but "
        "for the failures counted. Every next run succeeded and left nothing hidden.",
        f"Disk full: {how_full}. Two at once: both done one after the other, or one refused.",
        "",
        "| command | file operations | killed | ended before | left something hidden | next runs | disk full, exit 2 "
        "| had room | two at once: done | refused | failures |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for c in cases:
        t = c.tally
        numbers = (c.operations, t["killed"], t["ended before"], t["leftovers"], t["next runs"], t["disk full"],
                   t["had room"], t["two: done"], t["two: refused"], len(c.failures))  # fmt: skip
        lines.append(f"| {c.name} | " + " | ".join(str(n) for n in numbers) + " |")
    told = [f"- {c.name}: {count} × {text}" for c in cases for text, count in Counter(c.failures).most_common(5)]
    return "\n".join([*lines, *(["", "Failures:", *told] if told else [])]) + "\n"


def joined(tables: list[str]) -> str:
    """One table of those printed for some commands each."""
    lines = [line for text in tables for line in text.splitlines()]
    rows = [line for line in lines if line.startswith("| ") and line.split(" ")[1] in SHARES]
    failures = [line for line in lines if line.startswith("- ")]
    head = tables[0][tables[0].index("# Killed") :].split("|---", 1)[0]
    head = re.sub(r"SIGKILL: [0-9]+", f"SIGKILL: {sum(int(row.split('|')[3]) for row in rows)}", head)
    told = ["", "Failures:", *failures] if failures else []
    return "\n".join([head + "|---" * 11 + "|", *rows, *told]) + "\n"


def main() -> int:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--kills", type=int, default=1000)
    reader.add_argument("--full", type=int, default=10, help="disks filled for every command")
    reader.add_argument("--two", type=int, default=5, help="pairs of runs at once for every command")
    reader.add_argument("--minutes", type=float, default=0.0, help="end the kills after so long; 0: when all are done")
    reader.add_argument("--join", nargs="+", type=Path, help="make the table of tables printed for some commands each")
    reader.add_argument("--only", default=",".join(SHARES))
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--no-table", action="store_true", help="print the table, do not keep it")
    given = reader.parse_args()
    if given.join:
        RESULTS.write_text(joined([file.read_text(encoding="utf-8") for file in given.join]), encoding="utf-8")
        return 0
    only = tuple(given.only.split(","))
    # one thread each, before anything is imported: a fork has only the thread that made it
    for setting in ("AEROTRI_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[setting] = "1"
    with tempfile.TemporaryDirectory(prefix="kill_") as folder:
        here, chance = Path(folder), random.Random(given.seed)
        log = here / "log"
        (here / "out").mkdir()
        cases = make_cases(here, only)
        for case in cases:
            prepare(case, log)
            print(f"{case.name}: {case.seconds:.2f} s, {case.operations} operations on files", file=sys.stderr)
        # what kills between operations did not use up goes to the other kinds
        whole = sum(SHARES[case.name] for case in cases)
        mount = None
        if mounted():
            mount = here / "disk"
            mount.mkdir()
        for case in cases:
            wanted, k = round(given.kills * SHARES[case.name] / whole), 0
            until = time.monotonic() + (60.0 * given.minutes or float("inf")) * SHARES[case.name] / whole
            for _ in range(given.full):
                disk_full(case, chance, log, mount)
            for _ in range(given.two):
                two_at_once(case, log)
            while case.tally["killed"] < wanted and k < 3 * wanted and time.monotonic() < until:
                trial(case, MODES[k % 3], chance, log)
                k += 1
            print(f"{case.name}: {dict(case.tally)}, {len(case.failures)} failures", file=sys.stderr)
        how = "a tmpfs of random size" if mount is not None else "a limit on the size of a file (RLIMIT_FSIZE)"
        text = table(cases, how)
    print(text)
    if not given.no_table:
        RESULTS.write_text(text, encoding="utf-8")
    return 1 if any(case.failures for case in cases) else 0


if __name__ == "__main__":
    raise SystemExit(main())
