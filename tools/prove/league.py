"""The league of stated σ: what programs state for the same photographs and points, side by side, and who is right.

Of every block a table has the medians of σ over the photographs, points and cameras that all programs of the block
have, and a second one each σ over that of our noise (median of the ratios). Points held back, where there are some,
show whose σ holds: RMS of the error over the stated σ, and over that and the σ of the given coordinates together; 1 is
right.

aerotri: adjusted by least squares with the lens parameters that the other programs have as well ("lens"), and with
what it takes by default ("default"), σ of the noise and in total. Pix4D and DBAT: their files beside the data.
pycolmap: its BACovariance for the same image points and unknowns as "lens", in our datum and with our σ̂0
("same datum"), and with two photographs held, no control and a noise of 1 pixel ("as it comes").

Simulated blocks have a truth: error over stated σ, RMS over all photographs, points and blocks.

Example: python tools/prove/league.py ../shared/data --work /tmp/league --table tools/results/league.md
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import aerotri
import real_data
from aerotri import observations
from league_programs import colmap, dbat, ours, pix4d
from league_programs.ours import adjusted
from league_programs.stated import Stated
from league_programs.tables import LENS, Found, correlation_table, held_table, short_table, sigma_tables
from league_programs.truth import SIMULATED, simulated_section
from real_data import into_page, version

LIMIT_S = 1500
NEAREST_M = 0.3
"""Points of Pix4D have no names: the nearest within this is taken for the same."""


@dataclass(frozen=True)
class Entry:
    """A block of the league.

    Parameters
    ----------
    block : of `real_data`. lens : parameters that all programs have. robust : of ours, where pycolmap does
        not have to have the same.
    others : columns beside ours, from the data. colmap : whether pycolmap can be given it.
    default : parameters of "default"; None where the block states its own. default_held : leave points out of it too.
    """

    block: str
    lens: str = LENS
    robust: str = "off"
    others: Callable[[Path], list[Stated]] = lambda data: []
    colmap: bool = True
    default: str | None = "auto"
    default_held: bool = True
    notes: tuple[str, ...] = ()


def of_pix4d(folder: str) -> Callable[[Path], list[Stated]]:
    return lambda data: [pix4d.stated(data / folder)]


def of_dbat(folder: str) -> Callable[[Path], list[Stated]]:
    return lambda data: [dbat.stated(data / folder / "result" / "report.txt")]


ENTRIES = {
    "dbat_sxb": Entry("dbat_sxb", "none", others=of_dbat("dbat_sxb"), notes=(
        "pycolmap has one σ for all image points; DBAT and aerotri have 0.5 px for marks and 1 px for the others.",)),
    "dbat_roma": Entry("dbat_roma", "lens:k1+k2", others=of_dbat("dbat_roma"), default=None, notes=(
        "Datum of all but pycolmap as it comes: one photograph and one coordinate of another held.",
        "DBAT: K1 and K2 of Brown at the measured points; k1 and k2 of the others act on the ideal ones.",
        "The report has no σ of object points.")),
    "camcaldemo": Entry("camcaldemo", LENS + "+b1", others=of_dbat("camcaldemo"), default=None, notes=(
        "Four control points held, at coordinates that were assumed, not surveyed.",
        "All have an aspect ratio as well.",)),
    "cu_sbr_p1": Entry("cu_sbr_p1", robust="huber", others=of_pix4d("cu_sbr_p1"), notes=(
        "Pix4D had all ground points as control, ours and pycolmap the six of control_points.csv.",
        "aerotri lens and pycolmap by least squares, aerotri default with the robust estimator huber.")),
    "ca502": Entry("ca502_rig", robust="huber", others=of_pix4d("ca502"), colmap=False, default_held=False, notes=(
        "Pix4D had all ground points as control, ours the six of control_points.csv.",
        "Robust estimator huber.",)),
    "share5": Entry("share5", robust="huber", others=of_pix4d("share5"), colmap=False, default_held=False, notes=(
        "Pix4D had seven ground points as control, ours the four of control_points.csv.",
        "Robust estimator huber.",)),
}  # fmt: skip


def with_lens_alone(block: aerotri.Block) -> aerotri.Block:
    """The block whose given radial terms of Brown are those of a lens, as start values: one model of the lens."""
    cameras = []
    for camera in block.cameras:
        k1, k2 = (camera.brown[name].value if name in camera.brown else 0.0 for name in ("K1", "K2"))
        c = camera.focal_length_mm
        lens = {"k1": -k1 * c**2, "k2": (3.0 * k1**2 - k2) * c**4} if k1 else {}
        priors = {name: observations.Prior(value) for name, value in lens.items()}
        cameras.append(replace(camera, brown={}, lens={**camera.lens, **priors}))
    return replace(block, cameras=tuple(cameras))


def without_each(found: aerotri.Adjustment) -> list[aerotri.Adjustment]:
    """What holds points back: the adjustment itself where it has check points, else it without each control point."""
    return [found] if len(found.adjusted.check) else ours.without_each(found)


def columns_of(program: str, found: aerotri.Adjustment, others: Sequence[aerotri.Adjustment]) -> list[Stated]:
    """Two columns of ours.

    Parameters
    ----------
    others : adjustments with points held back.
    """
    out = []
    for total in (False, True):
        one = ours.stated(f"{program}, {'total' if total else 'noise'}", found, total)
        which = "total_sigma" if total else "sigma"
        out.append(replace(one, held=ours.together([ours.held(other, which) for other in others])))
    return out


def peers_of(found: aerotri.Adjustment, others: Sequence[aerotri.Adjustment]) -> list[Stated]:
    """Both columns of pycolmap."""
    held = ours.together([colmap.stated(other.record.local).held for other in others])
    return [replace(colmap.stated(found.record.local), held=held), colmap.as_it_comes(found.record.local)]


def found_of(name: str, data: Path, work: Path) -> Iterator[Found]:
    """All columns of a block, after every program those that there are."""
    entry, notes, columns = ENTRIES[name], [*ENTRIES[name].notes], []
    folder = work / entry.block
    real_data.BLOCKS[entry.block](data, folder)
    block = aerotri.read_block(folder)
    lens = block if entry.lens == "none" else with_lens_alone(block)
    base = adjusted(lens, entry.lens, "off" if entry.colmap else entry.robust)
    if isinstance(base, str):
        yield Found((), (f"aerotri lens: {base}",))
        return
    columns += columns_of("aerotri lens", base, [])
    for other in entry.others(data):
        points, told = named_points(other, base)
        columns.append(replace(other, points=points))
        notes += told
    yield Found(tuple(columns), tuple(notes))
    others = without_each(base)
    columns[:2] = columns_of("aerotri lens", base, others)
    yield Found(tuple(columns), tuple(notes))
    if not entry.colmap:
        notes.append("pycolmap is not run on blocks with a rig.")
    for peers in (peers_of(base, others),) if entry.colmap else ():
        columns += peers
        yield Found(tuple(columns), tuple(notes))
    if entry.default:
        chosen = adjusted(block, entry.default, entry.robust)
        if isinstance(chosen, str):
            notes.append(f"aerotri default: {chosen}")
        else:
            held = without_each(chosen) if entry.default_held else []
            columns[2:2] = columns_of("aerotri default", chosen, held)
            families = chosen.block.settings.adjustment.additional_parameters
            notes.append(f"aerotri default: {', '.join(':'.join([f, '+'.join(i)]) for f, i in families) or 'none'}.")
    yield Found(tuple(columns), tuple(notes))


def named_points(other: Stated, base: aerotri.Adjustment) -> tuple[Mapping[str, np.ndarray], list[str]]:
    """Points of another program by our names, and in words how many have one."""
    if other.nameless is None:
        return other.points, []
    points = pix4d.matched(other.nameless, base.adjusted.points.xyz, base.block.points, NEAREST_M)
    return points, [f"{other.program}: {len(points)} of {len(other.nameless)} points are within {NEAREST_M} m."]


@dataclass(frozen=True)
class Section:
    """The part of the results about one block: lines of the file, and fewer lines for the page."""

    lines: list[str]
    short: list[str]


def sections_of(name: str, data: Path, work: Path, blocks: int) -> Iterator[Section]:
    """The section of a block, more complete each time."""
    if name == "correlations" or name in SIMULATED:
        lines = correlation_table(data) if name == "correlations" else simulated_section(name, blocks)
        yield Section(lines, lines[2:])
        return
    for found in found_of(name, data, work):
        notes = ["", *(f"- {note}" for note in found.notes)]
        lines = [f"## {name}", *sigma_tables(found), *held_table(found), *notes]
        yield Section(lines, [*short_table(found), *held_table(found), *notes])


def in_own_process(name: str, options: argparse.Namespace) -> None:
    words = [sys.executable, __file__, str(options.data), "--work", str(options.work), "--one", name,
             "--simulated", str(options.simulated)]  # fmt: skip
    place = options.work / "sections" / f"{name}.json"
    place.unlink(missing_ok=True)
    try:
        subprocess.run(words, timeout=options.limit, check=True)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError) as failure:
        none = {"version": version(), "lines": [f"## {name}"], "short": []}
        there = json.loads(place.read_text(encoding="utf-8")) if place.exists() else none
        why = f"Not computed to the end: {str(failure)[-100:]}."
        there |= {key: [*there[key], "", why] for key in ("lines", "short")}
        place.write_text(json.dumps(there), encoding="utf-8")


def sections_there(work: Path) -> dict[str, dict]:
    places = {name: work / "sections" / f"{name}.json" for name in NAMES}
    return {name: json.loads(place.read_text(encoding="utf-8")) for name, place in places.items() if place.exists()}


def result(work: Path) -> str:
    """All sections that are there."""
    out = ["# The league of stated σ (tools/prove/league.py)", ""]
    for read in sections_there(work).values():
        out += [*read["lines"], "", f"Version {read['version']}.", ""]
    return "\n".join(out)


NAMES = (*ENTRIES, *SIMULATED, "correlations")


def write(options: argparse.Namespace) -> None:
    """The results and the page as far as they are there; without a file for them, to the screen."""
    if options.table:
        options.table.write_text(result(options.work), encoding="utf-8")
    else:
        print(result(options.work))
    for name, read in sections_there(options.work).items() if options.page else ():
        into_page(options.page, name, [*read["short"], "", f"Version {read['version']}."])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with the data sets")
    parser.add_argument("--work", type=Path, required=True, help="folder for blocks and sections; kept")
    parser.add_argument("--blocks", nargs="*", choices=NAMES, default=list(NAMES))
    parser.add_argument("--simulated", type=int, default=10, help="blocks of every simulated kind")
    parser.add_argument("--limit", type=int, default=LIMIT_S, help="seconds for a block")
    parser.add_argument("--table", type=Path, help="file for the page, written anew after every block")
    parser.add_argument("--page", type=Path, help="page of the documentation whose tables are written anew")
    parser.add_argument("--one", choices=NAMES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    (options.work / "sections").mkdir(parents=True, exist_ok=True)
    if options.one:
        place = options.work / "sections" / f"{options.one}.json"
        for made in sections_of(options.one, options.data, options.work, options.simulated):
            text = json.dumps({"version": version(), "lines": made.lines, "short": made.short})
            place.write_text(text, encoding="utf-8")
        return
    for name in options.blocks:
        in_own_process(name, options)
        write(options)
    if not options.blocks:
        write(options)


if __name__ == "__main__":
    main()
