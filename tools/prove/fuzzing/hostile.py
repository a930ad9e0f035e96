"""The damaged files that lie beside the project, given to the commands that open them: exit 2, one line, in time.

Measures the commands themselves, and single readers whose commands need more than a test can make: imports inside on
purpose.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fuzzing import seeds
from fuzzing.worker import MEMORY_BYTES, SECONDS, Target

HOSTILE = seeds.DATA / "hostile"
START_SECONDS = 20
"""What the start of the program may take of a processor, beyond the time of the file."""
WALL_SECONDS = 900
"""On the clock, for a program that waits and uses no processor; a busy machine makes the others slow too."""


@dataclass(frozen=True)
class Case:
    """A damaged file: its folder, the file that the message must name, and how commands and readers open it.

    Parameters
    ----------
    command : arguments of `aerotri`, given the file or folder and a folder to write into.
    """

    name: str
    file: str
    command: Callable[[Path, Path], list[str]]


def _convert(kind: str = "") -> Callable[[Path, Path], list[str]]:
    return lambda path, out: ["convert", f"{kind}{path}", str(out / "x")]


def _boundary(path: Path, out: Path) -> list[str]:
    (out / "dem.tif").write_bytes(seeds.raster())
    return ["volume", str(out / "dem.tif"), "--boundary", str(path / "b.geojson"), "--out", str(out / "x")]


def _cloud(name: str) -> Callable[[Path, Path], list[str]]:
    return lambda path, out: ["compare", str(path / name), str(path / name), "--out", str(out / "x")]


def _diff(path: Path, out: Path) -> list[str]:
    return ["diff", str(path), str(path)]


def _npz(path: Path, out: Path) -> list[str]:
    """A damaged solution.npz beside the block of another of the damaged results."""
    shutil.copytree(HOSTILE / "result_error", out / "r", copy_function=shutil.copyfile)
    shutil.copyfile(path / "solution.npz", out / "r" / "solution.npz")
    return ["convert", str(out / "r"), str(out / "x"), "--to", "bal"]


def _model(path: Path, out: Path) -> list[str]:
    """A COLMAP model whose other files are those of a damaged one that are whole."""
    shutil.copytree(HOSTILE / "colmap_Hang", out / "m", copy_function=shutil.copyfile)
    for file in path.iterdir():
        shutil.copyfile(file, out / "m" / file.name)
    return ["convert", str(out / "m"), str(out / "x")]


def _positions(path: Path, out: Path) -> list[str]:
    (out / "rays.txt").write_text("a cam\np 1 2\n-99\n")
    camera = ["--camera-size", "8192x5460", "--pixel-um", "4.2", "--focal-length-mm", "35"]
    return ["convert", str(out / "rays.txt"), str(out / "x"), *camera, "--positions", f"csv:{path / 'positions.csv'}"]


def _ign(path: Path, out: Path) -> list[str]:
    return ["convert", str(path), str(out / "x"), "--pixel-um", "4", "--control-sigma-m", "0.1"]


def _read_only(reader: str, name: str) -> Callable[[Path, Path], list[str]]:
    """Files whose commands need more than a test can make at once: the reader alone, as the commands call it."""
    return lambda path, out: ["-reader", reader, str(path / name)]


CASES = (
    Case("npz_error", "solution.npz", _npz),
    Case("npz_EOFError", "solution.npz", _npz),
    Case("npz_NotImplementedError", "solution.npz", _npz),
    Case("result_error", "solution.npz", _diff),
    Case("result_NotImplementedError", "solution.npz", _diff),
    Case("result_TokenError", "solution.npz", _diff),
    Case("gj_AttributeError", "b.geojson", _boundary),
    Case("gj_AttributeError_2", "b.geojson", _boundary),
    Case("gj_RecursionError", "b.geojson", _boundary),
    Case("models_AttributeError", "b.geojson", _read_only("models", "b.geojson")),
    Case("models_OverflowError", "b.geojson", _read_only("models", "b.geojson")),
    Case("lgj_OverflowError", "l.geojson", _read_only("breaklines", "l.geojson")),
    Case("dxf_RuntimeError", "l.dxf", _read_only("breaklines", "l.dxf")),
    Case("dxf_OverflowError", "l.dxf", _read_only("breaklines", "l.dxf")),
    Case("dbat_IndexError", "images.txt", _convert()),
    Case("eagle_LinAlgError", "Camera1.txt", _ign),
    Case("positions_Hang", "positions.csv", _positions),
    Case("pix4d-eo_Hang", "pix4d-eo.txt", _convert("pix4d-eo:")),
    Case("colmap_Hang", "frames.bin", _model),
    Case("slow_colmap_frames", "frames.bin", _model),
    Case("slow_colmap_points", ".bin", _model),
    Case("slow_las", "c.las", _cloud("c.las")),
    Case("abort_laz", "laz_abort.laz", _cloud("laz_abort.laz")),
)
"""Every folder of the corpus, once."""
READERS = {
    "models": "from aerotri.deformation.model_map import read_polygons as read",
    "breaklines": "from aerotri.formats.foreign.breaklines import read_breaklines as read",
}


def command_of(case: Case, out: Path) -> list[str]:
    """The arguments for a case; 'pix4d-eo:' stands before a file, not a folder."""
    arguments = case.command(HOSTILE / case.name, out)
    return [a + f"/{case.file}" if a.startswith("pix4d-eo:") else a for a in arguments]


def call_of(arguments: list[str]) -> None:
    """What a case does, in this process."""
    if arguments[0] == "-reader":
        place: dict = {}
        exec(READERS[arguments[1]], place)
        place["read"](Path(arguments[2]))
        return
    from aerotri.cli.app import invoke

    invoke(arguments)


def target_of(case: Case) -> Target:
    """A case as an input of the fuzzer, to be run in its forked process."""
    return Target(case.name, {case.file: b""}, (), lambda folder: call_of(command_of(case, folder)))


def run_hostile() -> int:
    """Every case as a command of its own; a table of what it said. 1 where one was not refused as it should be."""
    print("| folder | exit | processor, s | what it says |\n|---|---|---|---|")
    wrong = 0
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            code, seconds, said = _as_command(command_of(case, Path(folder)))
        # a command says which of its stages begins; what is wrong is the last line
        last = (said.strip().splitlines() or [""])[-1]
        good = code == 2 and case.file in last and " — " in last and "Traceback" not in said
        wrong += not good
        told = last.replace("|", "/").replace(str(HOSTILE), "hostile")[:200]
        print(f"| {case.name} | {code}{'' if good else ' WRONG'} | {seconds:.1f} | {told} |")
    return int(wrong > 0)


def _as_command(arguments: list[str]) -> tuple[int, float, str]:
    """Exit code, seconds and what was said of a command within its limits."""
    code = "import sys; sys.argv[0] = 'aerotri'; from aerotri.cli import main; main()"
    if arguments[0] == "-reader":
        code = (
            "import sys; from fuzzing.hostile import call_of; from aerotri.conventions import InputError\n"
            "try: call_of(sys.argv[1:])\n"
            "except InputError as error: print(f'aerotri: {error}', file=sys.stderr); raise SystemExit(2)"
        )
    begun = _seconds_of_children()
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], capture_output=True, text=True, preexec_fn=_limited, check=False,
            timeout=WALL_SECONDS, env=_environment(),
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return -1, _seconds_of_children() - begun, "not within the time"
    return done.returncode, _seconds_of_children() - begun, done.stderr


def _seconds_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _environment() -> dict[str, str]:
    import os

    return os.environ | {"PYTHONPATH": os.pathsep.join([str(seeds.ROOT / "src"), str(seeds.ROOT / "tools" / "prove")])}


def _limited() -> None:
    # the program itself maps two to three GiB of libraries
    resource.setrlimit(resource.RLIMIT_AS, (4 * MEMORY_BYTES, 4 * MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (START_SECONDS + int(SECONDS), START_SECONDS + int(SECONDS)))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
