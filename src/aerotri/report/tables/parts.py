"""A block in parts in a few lines of plain text."""

from __future__ import annotations

from aerotri.conventions import counted
from aerotri.partition.whole import Whole
from aerotri.report.quality import ground_statistics, metre_digits, printable
from aerotri.report.tables.adjustment import verdict_lines


def parts_lines(whole: Whole) -> list[str]:
    """What the user reads first."""
    o, record = whole.outcome, whole.record
    lines = [
        *verdict_lines(o),
        f"{printable(record.block.name)}: {o.status} after {counted(o.iterations, 'iteration')}",
        f"sigma0 {o.sigma0:.3f} ({o.sigma0_um:.2f} µm)",
        f"redundancy {o.redundancy} = {o.observations} observations − {o.unknowns} unknowns",
        f"{counted(len(whole.parts), 'part')}, {counted(whole.photographs, 'photograph')}, "
        f"{counted(whole.points, 'point')}, {counted(whole.rays, 'ray')}",
    ]
    for name, results in (("control point", record.control), ("check point", record.check)):
        if len(results):
            s, digits = ground_statistics(record, results), metre_digits(results.sigma)
            rms = ", ".join(f"{axis} {value:.{digits}f}" for axis, value in zip("XYZ", s.rms, strict=True))
            lines.append(f"{counted(len(results), name)}: RMS {rms} m")
    return lines + [f"warning: {printable(text, 500)}" for text in o.warnings]
