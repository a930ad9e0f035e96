"""Medians, ratios with their spread, growth: what the tables and the plot show."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from adjusting.measure import FACTORS, OURS, OURS_44, Run

UNKNOWN = (float("nan"), float("nan"), float("nan"))
OPTIMUM = 1e-9
"""Relative difference of ½Σr² within which two optima are the same."""


@dataclass(frozen=True)
class Row:
    """A program on a block: medians over the repeats.

    Parameters
    ----------
    prepare : s, equations and symbolic factor, or Ceres' problem built. solve : s, from the start to convergence.
    iteration : s, one whole Gauss-Newton iteration. sigmas : s, all σ and redundancy numbers. statistics : s, these and
        the external reliability of every ray; all NaN for peers.
    ratio : peer's solve over our prepare and solve without parameters, run by run: median, smallest, largest.
    vtpv_difference : relative, against ours with the same parameters. peak : bytes above the program without a block.
    failure : why there are no numbers.
    """

    photographs: int
    rays: int
    program: str
    prepare: float
    iterations: float
    solve: float
    iteration: float
    sigmas: float
    statistics: float
    ratio: tuple[float, float, float]
    vtpv_difference: float
    peak: float
    failure: str = ""

    @property
    def total(self) -> float:
        return self.prepare + self.solve


def seconds(run: Run, *phases: str) -> float:
    """Seconds of some phases together; NaN where none was measured."""
    times = run.outcome.get("seconds", {})
    found = [times[phase] for phase in phases if phase in times]
    return float(sum(found)) if found else float("nan")


def _compared(run: Run) -> float:
    """Seconds that are compared: with ours the set-up counts, of a peer the solution alone."""
    return seconds(run, "prepare", "iterations", "solve")


def rows_of(runs: Sequence[Run]) -> list[Row]:
    """A row for every block and program, in the order they were measured."""
    adjusting = [run for run in runs if run.program not in {f.name for f in FACTORS}]
    keys = dict.fromkeys((run.photographs, run.program) for run in adjusting)
    return [_row([r for r in adjusting if (r.photographs, r.program) == key], adjusting) for key in sorted_keys(keys)]


def sorted_keys(keys: Iterable[tuple[int, str]]) -> list[tuple[int, str]]:
    """By size, programs in their order of appearance."""
    return sorted(keys, key=lambda key: key[0])


def _row(own: list[Run], everything: list[Run]) -> Row:
    good = [run for run in own if not run.failure]
    first = own[0]
    nan = float("nan")
    if not good:
        return Row(first.photographs, 0, first.program, nan, nan, nan, nan, nan, nan, UNKNOWN, nan, nan, first.failure)
    ours = {run.repeat: run for run in everything if run.photographs == first.photographs and run.program == OURS.name}
    ratios = [
        _compared(run) / _compared(ours[run.repeat])
        for run in good
        if run.repeat in ours and not ours[run.repeat].failure
    ]
    reference = next((run.outcome["vtpv"] for run in ours.values() if not run.failure), nan)
    same_model = first.program != OURS_44.name
    iterations = [run.outcome["iterations"] for run in good if run.outcome.get("iterations") is not None]
    return Row(
        photographs=first.photographs,
        rays=good[0].outcome["rays"],
        program=first.program,
        prepare=statistics.median(seconds(run, "prepare", "build") for run in good),
        iterations=statistics.median(iterations) if iterations else nan,
        solve=statistics.median(seconds(run, "iterations", "solve") for run in good),
        iteration=statistics.median(seconds(run, "iteration") for run in good),
        sigmas=statistics.median(seconds(run, "sigmas") for run in good),
        statistics=statistics.median(seconds(run, "statistics") for run in good),
        ratio=_spread(ratios),
        vtpv_difference=(good[0].outcome["vtpv"] - reference) / reference if same_model else nan,
        peak=statistics.median(run.outcome["peak"] for run in good),
        failure="" if good[0].outcome.get("status") in ("converged", "convergence") else good[0].outcome["status"],
    )


def _spread(ratios: list[float]) -> tuple[float, float, float]:
    """Median, smallest and largest."""
    return (statistics.median(ratios), min(ratios), max(ratios)) if ratios else UNKNOWN


def growth(rows: Sequence[Row], value: str) -> list[tuple[str, list[tuple[int, int, float]]]]:
    """Exponents of a time over the number of photographs, program by program, from each size to the next."""
    found = []
    for program in dict.fromkeys(row.program for row in rows):
        own = [(row.photographs, getattr(row, value)) for row in rows if row.program == program]
        own = [(n, t) for n, t in own if np.isfinite(t) and t > 0.0]
        steps = [(a[0], b[0], float(np.log(b[1] / a[1]) / np.log(b[0] / a[0]))) for a, b in pairwise(own)]
        if steps:
            found.append((program, steps))
    return found


@dataclass(frozen=True)
class FactorRow:
    """The factor of a block's reduced matrix by one library: median seconds over the runs, ratio to ours."""

    photographs: int
    unknowns: int
    parameters: str
    library: str
    symbolic: float
    factor: float
    ratio: tuple[float, float, float]
    error: float
    missing: str = ""


def factor_rows(runs: Sequence[Run]) -> list[FactorRow]:
    """A row for every block, set of parameters and library."""
    rows = []
    for program in FACTORS:
        own = [run for run in runs if run.program == program.name and not run.failure]
        for photographs in sorted({run.photographs for run in own}):
            sized = [run for run in own if run.photographs == photographs]
            for library in sized[0].outcome["factors"]:
                rows.append(_factor_row(sized, photographs, program.parameters, library))
    return rows


def _factor_row(runs: list[Run], photographs: int, parameters: str, library: str) -> FactorRow:
    entries = [run.outcome["factors"][library] for run in runs]
    unknowns, nan = runs[0].outcome["unknowns"], float("nan")
    if "missing" in entries[0]:
        missing = entries[0]["missing"]
        return FactorRow(photographs, unknowns, parameters, library, nan, nan, UNKNOWN, nan, missing)
    ratios = [e["factor"] / run.outcome["factors"]["ours"]["factor"] for e, run in zip(entries, runs, strict=True)]
    return FactorRow(
        photographs,
        unknowns,
        parameters,
        library,
        symbolic=statistics.median(e["symbolic"] for e in entries),
        factor=statistics.median(e["factor"] for e in entries),
        ratio=_spread(ratios),
        error=max(e["error"] for e in entries),
    )
