"""What became of the inputs, reader by reader, and the findings by their place."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from fuzzing.worker import Found

BAD = ("exception", "warning", "hang", "memory", "abort")


@dataclass
class _Reader:
    """Counts by outcome, the longest time, the largest memory."""

    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    seconds: float = 0.0
    memory_mb: float = 0.0


@dataclass
class Tally:
    """Everything seen; findings hold their number and the first input."""

    inputs: int = 0
    readers: dict[str, _Reader] = field(default_factory=lambda: defaultdict(_Reader))
    findings: dict[tuple[str, str, str], list] = field(default_factory=dict)

    @classmethod
    def of(cls, part: Iterable[Found]) -> Tally:
        """What became of some inputs, counted."""
        tally = cls()
        tally._add(part)
        return tally

    def _add(self, part: Iterable[Found]) -> None:
        for found in part:
            self.inputs += 1
            reader = self.readers[found.reader]
            reader.counts[found.outcome] += 1
            reader.seconds = max(reader.seconds, found.seconds)
            reader.memory_mb = max(reader.memory_mb, found.memory_mb)
            if found.outcome in BAD:
                key = (found.outcome, found.place, found.reader)
                self.findings.setdefault(key, [0, found.number, found.message])[0] += 1

    def in_short(self) -> str:
        """Numbers by outcome."""
        total: dict[str, int] = defaultdict(int)
        for reader in self.readers.values():
            for outcome, count in reader.counts.items():
                total[outcome] += count
        return ", ".join(f"{count} {outcome}" for outcome, count in sorted(total.items()))


def markdown(tally: Tally, seed: int) -> str:
    """The tables."""
    lines = [
        "# Damaged files in every reader",
        "",
        f"`python tools/prove/fuzz.py --inputs {tally.inputs} --seed {seed}`: {tally.inputs} inputs, "
        f"{tally.in_short()}. Accepted: the damage left a file that says something possible. Refused: an error that "
        "names the file and what to do. Limits of an input: 5 s, 1 GiB beyond the program itself.",
        "",
        "| reader | inputs | accepted | refused | exceptions | hangs | no memory | aborts | longest, s | memory, MB |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name in sorted(tally.readers):
        reader = tally.readers[name]
        c = reader.counts
        kinds = ("accepted", "refused", "exception", "hang", "memory", "abort")
        cells = (sum(c.values()), *(c[kind] + (c["warning"] if kind == "exception" else 0) for kind in kinds))
        lines.append(f"| {name} | {' | '.join(map(str, cells))} | {reader.seconds:.2f} | {reader.memory_mb:.0f} |")
    lines += ["", f"Findings by place: {len(tally.findings) or 'none'}.", ""]
    if tally.findings:
        lines += ["| kind | place | reader | inputs | first | message |", "|---|---|---|---|---|---|"]
        for (kind, place, reader), (count, first, message) in sorted(tally.findings.items(), key=lambda f: -f[1][0]):
            said = message.replace("|", "/").replace("\n", " ")[:120]
            lines.append(f"| {kind} | {place.replace('|', '/')} | {reader} | {count} | {first} | {said} |")
    return "\n".join(lines) + "\n"
