"""The self-calibration report of every block, made as a user would: block folder, adjustment, report.html."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from aerotri.commands.adjust import run_adjust
from aerotri.simulation import SimulationSpec, simulate
from aerotri.simulation.truth import write_simulated
from paper_003.cases import Case
from paper_003.runs import with_parameters


def write_reports(cases: Iterable[tuple[Case, SimulationSpec]], folder: Path) -> list[Path]:
    """Write NAME/ and NAME_result/ of every block under a folder; days of a block get parameters of their own.

    Returns
    -------
    The paths of the reports.
    """
    reports = []
    for case, spec in cases:
        block, truth = simulate(spec, 1)
        groups = "day" if spec.flight.days else "camera"
        place, result = folder / case.name, folder / f"{case.name}_result"
        write_simulated(place, with_parameters(block, case.sets[-1 if len(case.sets) < 4 else 3][1], groups), truth)
        if run_adjust(place, result, None, None, None, plots=True, as_json=False):
            raise SystemExit(f"{case.title} was not adjusted")
        reports.append(result / "report.html")
    return reports
