"""Every real block by the documented commands, with defaults: does it go through, what is said, do its σ hold?

A block is converted and adjusted (`--parameters auto` where its files state none) by the commands a user gives, in
processes of their own. Then every control point is left out in turn, with the parameters that were chosen held, and
predicted by everything else; check points are taken where the block has them. Printed are the exit code, verdict,
what was chosen, σ0, and the errors at those points over the total σ of the prediction, and over that and the σ of the
given coordinates together: 1 is right. The parameters were chosen with the point that is left out.

Blocks are computed one after the other, each with a limit of time; a row is kept as a file, and the table is printed
of all rows that are there, with the version of the program that made each of them.

Example: python tools/prove/real_blocks.py ../shared/data --work /tmp/real --table tools/results/real_blocks.md
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
import real_data
from real_data import Ran, command, into_page, version

LIMIT_S = 1500
"""Of a block with all its points left out, seconds."""
GSD_BRIGHTON_M = 0.0231
LONGEST = 300
"""Letters of a sentence in the table."""
GEOIDS = {"ultracam_eagle_m3": "ultracam_eagle_m3/fr_ign_RAF20.tif"}


@dataclass
class Row:
    """What came of a block.

    Parameters
    ----------
    code : exit code of the last command. said : refusal, first doubt, or ''. parameters : what was chosen.
    count : of the additional parameters. held : number of points that were left out or are check points.
    plan, height : RMS (m), over total σ, over total σ and given σ. largest : of all coordinates, over both σ.
    seconds : of conversion and adjustment. all_seconds : with everything. version : that made the row.
    """

    block: str
    code: int | None = None
    verdict: str = ""
    said: str = ""
    parameters: str = ""
    count: int | None = None
    sigma0: float | None = None
    iterations: int | None = None
    held: str = ""
    plan: list[float] = field(default_factory=list)
    height: list[float] = field(default_factory=list)
    largest: float | None = None
    more: str = ""
    seconds: float | None = None
    all_seconds: float | None = None
    version: str = ""


@dataclass(frozen=True)
class Place:
    """Folders of a block: of the data, and of what is made.

    Parameters
    ----------
    data : all data sets. block, result : of this one.
    """

    data: Path
    block: Path
    result: Path


Steps = Callable[[Place], Iterator[Ran]]


def adjusted(name: str, *options: str) -> Steps:
    """Conversion and adjustment of a block of `real_data`."""

    def steps(place: Place) -> Iterator[Ran]:
        ran = real_data.BLOCKS[name](place.data, place.block)
        if ran is not None:
            yield ran
        yield command("adjust", place.block, "--out", place.result, "--no-plots", *options)

    return steps


def eagle(place: Place) -> Iterator[Ran]:
    return adjusted("ultracam_eagle_m3", "--geoid", str(place.data / GEOIDS["ultracam_eagle_m3"]))(place)


def copr(place: Place) -> Iterator[Ran]:
    folder = place.data / "copr"
    yield command("run", folder / "images", "--out", place.result.parent, "--gcp", folder / "gcp_list.txt",
                  *real_data.COPR.split())  # fmt: skip


def brighton(place: Place) -> Iterator[Ran]:
    yield command("run", place.data / "brighton" / "images", "--out", place.result.parent, "--no-dense")
    yield command("compare", place.result.parent / "dtm", place.data / "brighton" / "model.laz", "--align", "rigid",
                  "--out", place.result.parent.parent / "brighton_compared")  # fmt: skip


def dmc(place: Place) -> Iterator[Ran]:
    folder = place.data / "dmc_ngi"
    ran = real_data.converted(place.block, folder / "camera_pos_ori.txt", "--camera", folder / "config.yaml")
    if ran is not None:
        yield ran
    yield command("adjust", place.block, "--out", place.result, "--no-plots")


RUNS: dict[str, Steps] = {"copr": copr, "brighton": brighton}
"""From photographs: block and result lie in the folder of `aerotri run`."""
CHOSEN = {
    "cu_sbr_p1": ("cu_sbr_p1", "--parameters", "auto", "--robust", "huber"),
    "cu_sbr_p1_control": ("cu_sbr_p1_control", "--parameters", "auto", "--robust", "huber"),
    "ca502_independent": ("ca502_independent", "--parameters", "auto"),
    "ca502_rig": ("ca502_rig", "--parameters", "auto"),
    "share5": ("share5", "--parameters", "auto"),
    "share5_lens": ("share5", "--parameters", "lens:k1+k2+k3+p1+p2"),
    "stpierre": ("stpierre", "--parameters", "auto"),
    "stpierre_none": ("stpierre", "--parameters", "none"),
}
"""Blocks whose files state no additional parameters, or those of a tool: what is adjusted, and with which options."""
AS_STATED = {name: (name,) for name in real_data.BLOCKS if name not in CHOSEN and name != "ultracam_eagle_m3"}
"""Blocks whose files state the additional parameters: adjusted as they are."""
CASES: dict[str, Steps] = {
    **{name: adjusted(*words) for name, words in (AS_STATED | CHOSEN).items()},
    "ultracam_eagle_m3": eagle,
    "dmc_ngi": dmc,
    **RUNS,
}


def computed(name: str, data: Path, work: Path) -> Row:
    """A block, from its files to the points left out."""
    begun = time.perf_counter()
    parent = work / f"{name}_run" if name in RUNS else work
    result = parent / "result" if name in RUNS else work / f"{name}_result"
    row = Row(name, version=version())
    ran = list(CASES[name](Place(data, work / name, result)))
    first = next((one for one in ran if one.words[0] in ("adjust", "run") or one.code), ran[-1])
    row.code, row.seconds = first.code, sum(one.seconds for one in ran if one.words[0] != "compare")
    row.said = refusal(first.text)
    made = result / "adjustment.json"
    if made.exists() and made.stat().st_mtime > time.time() - (time.perf_counter() - begun):
        read_outcome(row, json.loads(made.read_text(encoding="utf-8")))
        (work / "rows" / f"{name}.json").write_text(json.dumps(asdict(row)), encoding="utf-8")
        left_out(row, aerotri.open_result(result), data / GEOIDS[name] if name in GEOIDS else None)
    if ran[-1].words[0] == "compare" and not ran[-1].code:
        nmad = json.loads((parent.parent / "brighton_compared" / "comparison.json").read_text("utf-8"))["nmad"]
        row.more = f"NMAD against the other program's cloud {nmad / GSD_BRIGHTON_M:.2f} GSD"
    row.all_seconds = time.perf_counter() - begun
    return row


def refusal(text: str) -> str:
    """The line of an error, or the last one said."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith(("what to do", "because"))]
    wrong = [line for line in lines if (line.startswith("aerotri: ") and " — " in line) or "unexpected" in line]
    return (wrong or lines or [""])[-1].removeprefix("aerotri: ")


def read_outcome(row: Row, outcome: dict[str, Any]) -> None:
    row.verdict, row.sigma0, row.iterations = outcome["verdict"], outcome["sigma0"], outcome["iterations"]
    row.said = (outcome["reasons"] or [outcome["message"]])[0]
    there = [one for one in outcome["additional_parameters"] if one.get("status") != "removed"]
    row.count = len(there)
    settings = {one["key"]: one["value"] for one in outcome["settings"] if "key" in one}
    row.parameters = ", ".join(settings.get("adjustment.additional_parameters") or ["none"])


def left_out(row: Row, full: aerotri.Adjustment, geoid: Path | None) -> None:
    """Check points of the result, or its control points left out in turn."""
    block = full.block
    check, control = full.adjusted.check, block.control
    if len(check):
        row.held, parts = f"{len(check)} check points", [errors(full)]
    else:
        names = block.points[control.point[~control.is_check]].astype(str).tolist()
        images = replace(block.images, centre=full.adjusted.images.centre, angles=full.adjusted.images.angles)
        parts = [without(replace(block, images=images), name, geoid) for name in names]
        row.held = f"{sum(part is not None for part in parts)} of {len(names)} left out" if names else ""
    there = [part for part in parts if part is not None]
    if there:
        difference, total, given = (np.concatenate(column) for column in zip(*there, strict=True))
        summarise(row, difference, total, given)


def without(block: aerotri.Block, name: str, geoid: Path | None) -> tuple[np.ndarray, ...] | None:
    """What one control point is without itself."""
    try:
        found = aerotri.adjust(aerotri.edit(block, check=[name]), geoid=geoid, explain=False)
    except (aerotri.AdjustmentFailedError, aerotri.InputError) as failure:
        print(f"{name}: {failure}", file=sys.stderr)
        return None
    return errors(found) if found.status == "converged" and len(found.adjusted.check) else None


def errors(found: aerotri.Adjustment) -> tuple[np.ndarray, ...]:
    """Differences, total σ of the prediction and σ of what is given, (k, 3) m each."""
    check, control = found.adjusted.check, found.block.control
    row = {int(point): k for k, point in enumerate(control.point)}
    given = np.array([control.sigma[row[int(point)]] for point in check.point])
    return check.difference, check.total_sigma, given


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def summarise(row: Row, difference: np.ndarray, total: np.ndarray, given: np.ndarray) -> None:
    both = difference / np.hypot(total, given)
    for target, axes in (("plan", slice(0, 2)), ("height", slice(2, 3))):
        d, t = difference[:, axes], total[:, axes]
        setattr(row, target, [rms(d), rms(d / t), rms(both[:, axes])])
    row.largest = float(np.nanmax(np.abs(both)))


HEAD = (
    "block", "exit", "verdict", "parameters", "number", "σ0", "iterations", "points held back", "RMS dX dY m",
    "over total σ", "with given σ", "RMS dZ m", "over total σ", "with given σ", "largest", "s", "version",
)  # fmt: skip


def number(value: float | None, digits: str = ".3g") -> str:
    return "" if value is None or not np.isfinite(value) else format(value, digits)


def cells(row: Row) -> list[str]:
    three = [*(number(v) for v in row.plan or [None] * 3), *(number(v) for v in row.height or [None] * 3)]
    return [
        row.block, "" if row.code is None else str(row.code), row.verdict, row.parameters.replace("|", "/"),
        number(row.count, "d"), number(row.sigma0), number(row.iterations, "d"), row.held, *three,
        number(row.largest), number(row.seconds, ".0f"), row.version,
    ]  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    lines = ["# Real blocks by the documented commands (tools/prove/real_blocks.py)", ""]
    lines += ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    lines += ["| " + " | ".join(cells(row)) + " |" for row in rows]
    lines += ["", "What is said: the refusal, or the first doubt.", ""]
    for row in rows:
        said = row.said if len(row.said) <= LONGEST else row.said[:LONGEST] + " …"
        lines += [f"- {row.block}: {'; '.join(text for text in (said, row.more) if text)}"] if said or row.more else []
    return "\n".join(lines) + "\n"


SHORT = (
    "block", "exit", "verdict", "parameters", "σ0", "points", "RMS dX dY m", "over total and given σ", "RMS dZ m",
    "over total and given σ", "s", "version",
)  # fmt: skip


def short_table(rows: Sequence[Row]) -> list[str]:
    """The essence of the table, for the page."""
    lines = ["| " + " | ".join(SHORT) + " |", "|" + "---|" * len(SHORT)]
    for row in rows:
        plan, height = ([number(v) for v in three] if three else ["", "", ""] for three in (row.plan, row.height))
        cells = [
            row.block.replace("_", " "), number(row.code, "d"), row.verdict, number(row.count, "d"),
            number(row.sigma0), row.held, plan[0], plan[2], height[0], height[2], number(row.seconds, ".0f"),
            row.version.split(" ")[0],
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def rows_there(work: Path) -> list[Row]:
    files = {path.stem: path for path in (work / "rows").glob("*.json")}
    return [Row(**json.loads(files[name].read_text(encoding="utf-8"))) for name in CASES if name in files]


def in_own_process(name: str, options: argparse.Namespace) -> None:
    """Compute one block; a block that is stopped has a row that says so."""
    words = [sys.executable, __file__, str(options.data), "--work", str(options.work), "--one", name]
    place = options.work / "rows" / f"{name}.json"
    place.unlink(missing_ok=True)
    try:
        subprocess.run(words, timeout=options.limit, check=True)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError) as failure:
        row = Row(**json.loads(place.read_text(encoding="utf-8"))) if place.exists() else Row(name, version=version())
        why = f"stopped after {options.limit} s" if isinstance(failure, subprocess.TimeoutExpired) else str(failure)
        row.more = f"{row.more} {why[-LONGEST:]}".strip()
        place.write_text(json.dumps(asdict(row)), encoding="utf-8")


def write(options: argparse.Namespace) -> None:
    """The table and the page as far as they are there; without a file for the table, to the screen."""
    rows = rows_there(options.work)
    if options.table:
        options.table.write_text(table(rows), encoding="utf-8")
    else:
        print(table(rows))
    if options.page:
        into_page(options.page, "real blocks", short_table(rows))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with the data sets")
    parser.add_argument("--work", type=Path, required=True, help="folder for blocks, results and rows; kept")
    parser.add_argument("--blocks", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--limit", type=int, default=LIMIT_S, help="seconds for a block")
    parser.add_argument("--table", type=Path, help="file for the table, written anew after every block")
    parser.add_argument("--page", type=Path, help="page of the documentation that gets the essence")
    parser.add_argument("--one", choices=list(CASES), help=argparse.SUPPRESS)
    options = parser.parse_args()
    (options.work / "rows").mkdir(parents=True, exist_ok=True)
    if options.one:
        row = computed(options.one, options.data, options.work)
        text = json.dumps(asdict(row))
        (options.work / "rows" / f"{options.one}.json").write_text(text, encoding="utf-8")
        return
    for name in options.blocks:
        in_own_process(name, options)
        write(options)
    if not options.blocks:
        write(options)


if __name__ == "__main__":
    main()
