"""The tables in Markdown."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence

import numpy as np

from adjusting.measure import Run
from adjusting.summary import OPTIMUM, FactorRow, Row, factor_rows, growth, rows_of

READING = """Simulated UltraCamD blocks after DSK-Saar: 80/40 %, 9 cm, 130 points a photograph, 6.5 rays a point, sparse
control. Every program starts 1 m and 1 mrad off with object points intersected from there; medians of {repeats} runs,
programs in turn, each in a process of its own, {threads} threads. Reading is excluded. *prepare* is our set-up with the
symbolic factor, or Ceres' problem built by pycolmap in C++; *solve* runs to convergence; *× ours* is a program's solve
alone over our prepare and solve without parameters, run by run (smallest to largest). *Σ* is the relative difference of
½Σr². *iteration* is one whole Gauss-Newton iteration; *σ* every σ and every redundancy number, also in such iterations;
*statistics* these and tests and external reliability of every ray. Memory is the peak above the program without a
block."""


def markdown(runs: Sequence[Run], threads: int) -> str:
    """Everything that was measured."""
    rows, factors = rows_of(runs), factor_rows(runs)
    repeats = 1 + max((run.repeat for run in runs), default=0)
    reading = READING.format(repeats=repeats, threads=threads)
    parts = ["# Adjustment beside its peers", _machine(), reading, _adjustments(rows)]
    if factors:
        parts += ["## The factor of the reduced matrix", _factors(factors)]
    if len({row.photographs for row in rows}) > 1:
        parts += ["## Growth: exponent of the time over the number of photographs", _growth(rows)]
    return "\n\n".join(parts) + "\n"


def _machine() -> str:
    model = platform.processor() or platform.machine()
    if os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
        model = names[0] if names else model
    load = f", load {os.getloadavg()[0]:.1f} at the end" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} processors{load}; Python {platform.python_version()}, numpy {np.__version__}."


def _adjustments(rows: Sequence[Row]) -> str:
    head = ("photographs", "rays", "program", "prepare [s]", "iterations", "solve [s]", "× ours", "Σ", "iteration [s]",
            "σ [s]", "in iterations", "statistics [s]", "peak [MB]", "bytes/ray")  # fmt: skip
    return _table(head, [_cells(row) for row in rows])


def _cells(row: Row) -> list[str]:
    if not np.isfinite(row.solve):
        return [str(row.photographs), "", row.program, row.failure, *[""] * 10]
    optimum = "" if not np.isfinite(row.vtpv_difference) else f"{row.vtpv_difference:+.0e}"
    if optimum and abs(row.vtpv_difference) > OPTIMUM:
        optimum += " (not the optimum)"
    return [
        str(row.photographs),
        str(row.rays),
        row.program + (f" ({row.failure})" if row.failure else ""),
        _seconds(row.prepare),
        f"{row.iterations:.0f}" if np.isfinite(row.iterations) else "",
        _seconds(row.solve),
        _ratio(row.ratio),
        optimum,
        _seconds(row.iteration),
        _seconds(row.sigmas),
        f"{row.sigmas / row.iteration:.1f}" if np.isfinite(row.sigmas) else "",
        _seconds(row.statistics),
        f"{row.peak / 1e6:.0f}",
        f"{row.peak / row.rays:.0f}",
    ]


def _factors(rows: Sequence[FactorRow]) -> str:
    head = ("photographs", "unknowns", "parameters", "library", "symbolic [s]", "factor [s]", "× ours", "residual")
    cells = []
    for row in rows:
        known = [str(row.photographs), str(row.unknowns), row.parameters, row.library]
        if row.missing:
            cells.append([*known, f"not installed ({row.missing})", "", "", ""])
        else:
            cells.append([*known, _seconds(row.symbolic), _seconds(row.factor), _ratio(row.ratio), f"{row.error:.0e}"])
    return _table(head, cells)


def _growth(rows: Sequence[Row]) -> str:
    lines = []
    for what, value in (("prepare and solve", "total"), ("statistics", "statistics")):
        for program, steps in growth(rows, value):
            text = ", ".join(f"{a} → {b}: {exponent:.2f}" for a, b, exponent in steps)
            lines.append([program, what, text])
    return _table(("program", "time", "exponent"), lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [list(head), ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def _seconds(value: float) -> str:
    if not np.isfinite(value):
        return ""
    return f"{value:.3f}" if value < 1.0 else f"{value:.2f}" if value < 10.0 else f"{value:.1f}"


def _ratio(ratio: tuple[float, float, float]) -> str:
    if not np.isfinite(ratio[0]):
        return ""
    return f"{ratio[0]:.2f} ({ratio[1]:.2f}–{ratio[2]:.2f})"
