"""Two halves of a block compared, as a table and as lines."""

from __future__ import annotations

from aerotri.diagnosis.halves import conclusion, division_sentence
from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table, table
from aerotri.report.tables.terminal import table_lines
from aerotri.results.halves import DIVISIONS, HalvesRecord

NOTE = (
    "difference/σ: RMS over the cells; largest: beside it what noise alone exceeds in one case of twenty; p: "
    "probability of such differences by noise alone"
)


def tests_table(record: HalvesRecord) -> Table:
    """A row a test of every division."""
    rows = [(DIVISIONS[one.division], name, test) for one in record.comparisons for name, test in one.tests]
    return table(
        "Halves adjusted apart",
        (Column("halves"), [division for division, _, _ in rows]),
        (Column("compared"), [name for _, name, _ in rows]),
        (Column("difference/σ", "", ".2f"), [test.rms_z for _, _, test in rows]),
        (Column("largest", "", ".1f"), [test.max_z for _, _, test in rows]),
        (Column("usual", "", ".1f"), [test.usual_max_z for _, _, test in rows]),
        (Column("p", "", ".2g"), [test.p for _, _, test in rows]),
        (Column("outcome"), ["differ" if test.differs else "agree" for _, _, test in rows]),
    )


def halves_lines(record: HalvesRecord) -> list[str]:
    """What the command prints: the tests, a sentence a division, what all say together and what to do."""
    lines = table_lines(tests_table(record))
    lines += [NOTE, ""] if lines else []
    for one in record.comparisons:
        lines.append(_capital(printable(division_sentence(one), 500)))
        lines += [f"  {printable(note, 500)}" for note in one.notes]
    return [*lines, "", *conclusion(record)]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
