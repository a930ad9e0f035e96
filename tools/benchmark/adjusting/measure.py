"""The measurements: every one in a process of its own, programs in turn, so that the machine's moods hit all alike."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

TOOLS = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Program:
    """A program to measure: its name in tables, the task and parameters of the child, the largest block it is given."""

    name: str
    task: str
    parameters: str = "none"
    largest: int = 10**9


OURS = Program("aerotri", "ours")
OURS_44 = Program("aerotri, 44 parameters", "ours", "44")
PROGRAMS = {
    "aerotri": OURS,
    "aerotri-44": OURS_44,
    "ceres": Program("Ceres", "ceres"),
    "ceres-undamped": Program("Ceres, undamped start", "ceres-undamped"),
    "pycolmap": Program("pycolmap's adjuster", "pycolmap", largest=5_000),
    "scipy": Program("SciPy least_squares", "scipy", largest=200),
}
FACTORS = (Program("factor", "factors"), Program("factor, 44 parameters", "factors", "44"))


@dataclass(frozen=True)
class Run:
    """One measurement of a program on a block: what the child printed, or why there is nothing."""

    photographs: int
    program: str
    repeat: int
    outcome: dict[str, Any] = field(default_factory=dict)
    failure: str = ""

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class Settings:
    """How to measure.

    Parameters
    ----------
    threads : of every program. limit_s : seconds after which a measurement is given up.
    peers_path : folders to look for libraries in after Python's own.
    """

    threads: int
    limit_s: float
    peers_path: tuple[str, ...]


def run_child(program: Program, photographs: int, folder: Path, repeat: int, settings: Settings) -> Run:
    """Measure a program once, in a new process."""
    job = {
        "task": program.task,
        "parameters": program.parameters,
        "folder": str(folder),
        "threads": settings.threads,
        "peers_path": list(settings.peers_path),
    }
    command = [sys.executable, "-m", "adjusting.child", json.dumps(job)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, env=_environment(settings), timeout=settings.limit_s, check=False
        )
    except subprocess.TimeoutExpired:
        return Run(photographs, program.name, repeat, failure=f"not within {settings.limit_s:.0f} s")
    if done.returncode != 0:
        return Run(photographs, program.name, repeat, failure=_last_line(done.stderr) or f"exit {done.returncode}")
    return Run(photographs, program.name, repeat, json.loads(_last_line(done.stdout)))


def _environment(settings: Settings) -> dict[str, str]:
    threads = str(settings.threads)
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "AEROTRI_THREADS")
    path = os.pathsep.join([str(TOOLS), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, **dict.fromkeys(names, threads), "PYTHONPATH": path}


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1].strip() if lines else ""


def programs_for(photographs: int, names: Sequence[str]) -> list[Program]:
    """The programs asked for that are given a block of this size."""
    return [PROGRAMS[name] for name in names if photographs <= PROGRAMS[name].largest]
