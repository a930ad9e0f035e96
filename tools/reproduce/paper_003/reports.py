"""The self-calibration report of every block, made as a user would: block folder, adjustment, report.html."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import aerotri
from paper_003.cases import Case
from paper_003.runs import Plan


def write_reports(cases: Iterable[tuple[Case, Plan]], folder: Path) -> list[Path]:
    """Write NAME/ and NAME_result/ of every block under a folder; days of a block get parameters of their own.

    Returns
    -------
    The paths of the reports.
    """
    reports = []
    for case, plan in cases:
        settings = {
            "additional_parameters": case.sets[-1 if len(case.sets) < 4 else 3][1].split(","),
            "parameter_groups": "day" if plan["flight"].get("days") else "camera",
        }
        place = aerotri.simulate(plan | {"adjustment": settings}, 1).save(folder / case.name)
        result = aerotri.adjust(place)
        if result.status != "converged":
            raise SystemExit(f"{case.title} was not adjusted: {result.status}")
        reports.append(result.save(folder / f"{case.name}_result") / "report.html")
    return reports
