"""What an adjustment says about itself, as tables: the verdict's numbers, the work list, gross errors, changes."""

from __future__ import annotations

from aerotri.public.table import Table
from aerotri.results.adjusted_block import AdjustedBlock


def findings_table(adjusted: AdjustedBlock) -> Table:
    """As `Adjustment.findings`.

    Parameters
    ----------
    adjusted : in the frame of the adjustment.
    """
    from aerotri.diagnosis import findings

    found = findings(adjusted)
    names = ("quantity", "value", "expected", "says", "level", "grade")
    return Table.of("findings", {name: [getattr(one, name) for one in found] for name in names})


def work_table(adjusted: AdjustedBlock) -> Table:
    """As `Adjustment.work_list`: the items of the report, first things first.

    Parameters
    ----------
    adjusted : in the frame of the adjustment.
    """
    from aerotri.diagnosis.work_list import work_list
    from aerotri.formats.results.evaluation import work_columns

    return Table.of("what to look at first", {name: list(v) for name, v in work_columns(work_list(adjusted)).items()})


def blunders_table(adjusted: AdjustedBlock) -> Table:
    """As `Adjustment.blunders`."""
    found = adjusted.blunders
    columns = {
        "image": [one.image for one in found],
        "point": [one.point for one in found],
        "w": [one.w for one in found],
        "estimated": [1e3 * one.estimated_mm for one in found],
        "action": [one.action for one in found],
    }
    return Table.of("gross errors found", columns, {"estimated": "µm"})


def changes_table(adjusted: AdjustedBlock) -> Table:
    """As `Adjustment.group_changes`: a row a pair of groups, the numbers of parameter_changes.json."""
    from aerotri.formats.results.parameter_sets import changes_json
    from aerotri.image_errors import group_changes

    rows = changes_json(group_changes(adjusted))
    names = ("first", "second", "camera", "rms_um", "max_um", "rms_of_sigma_um", "statistic", "freedom", "p", "changed",
             "sentence")  # fmt: skip
    units: dict[str, str] = dict.fromkeys(("rms_um", "max_um", "rms_of_sigma_um"), "µm")
    return Table.of("changes between groups", {name: [row[name] for row in rows] for name in names}, units)
