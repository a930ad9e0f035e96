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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import aerotri
import default_choice
import real_data
from aerotri import observations
from league_programs import colmap, dbat, ours, pix4d
from league_programs.stated import AXES, ELEMENTS, INTERIOR, Held, Stated
from real_blocks import version

LIMIT_S = 1500
LENS = "lens:k1+k2+p1+p2+k3"
BASE = "aerotri lens, noise"
NEAREST_M = 0.3
"""Points of Pix4D have no names: the nearest within this is taken for the same."""
UNITS = {**dict.fromkeys(ELEMENTS[:3], "m"), **dict.fromkeys(ELEMENTS[3:], "°"), **dict.fromkeys(AXES, "m"),
         **dict.fromkeys(INTERIOR, "mm")}  # fmt: skip
KINDS = {"photographs": "photographs", "points": "points", "control": "control points", "interior": "cameras"}
QUANTITIES = {"photographs": ELEMENTS, "points": AXES, "control": AXES, "interior": INTERIOR}
SIMULATED = {"right": "no image errors beyond the lens", "drift": "a lens that changes along the flight"}
LAYOUT = "four corners and the middle"


@dataclass(frozen=True)
class Entry:
    """A block of the league.

    Parameters
    ----------
    block : of `real_data`. lens : parameters that all programs have. robust : of both of our adjustments.
    others : columns beside ours, from the data. colmap : whether pycolmap can be given it.
    default : parameters of "default"; None where the block states its own.
    """

    block: str
    lens: str = LENS
    robust: str = "off"
    others: Callable[[Path], list[Stated]] = lambda data: []
    colmap: bool = True
    default: str | None = "auto"
    notes: tuple[str, ...] = ()


def of_pix4d(folder: str) -> Callable[[Path], list[Stated]]:
    return lambda data: [pix4d.stated(data / folder)]


def of_dbat(folder: str) -> Callable[[Path], list[Stated]]:
    return lambda data: [dbat.stated(data / folder / "result" / "report.txt")]


ENTRIES = {
    "dbat_sxb": Entry("dbat_sxb", "none", others=of_dbat("dbat_sxb"), notes=(
        "pycolmap has one σ for all image points; DBAT and ours have 0.5 px for marks and 1 px for the others.",)),
    "dbat_roma": Entry("dbat_roma", "lens:k1+k2", others=of_dbat("dbat_roma"), default=None, notes=(
        "Datum of all but pycolmap as it comes: one photograph and one coordinate of another held.",
        "DBAT: K1 and K2 of Brown at the measured points; k1 and k2 of the others act on the ideal ones.")),
    "camcaldemo": Entry("camcaldemo", others=of_dbat("camcaldemo"), default=None, notes=(
        "Four control points held, at coordinates that were assumed, not surveyed.",
        "DBAT estimates an aspect ratio as well.",)),
    "cu_sbr_p1": Entry("cu_sbr_p1", robust="huber", others=of_pix4d("cu_sbr_p1"), notes=(
        "Pix4D had all ground points as control, ours and pycolmap the six of control_points.csv.",
        "pycolmap by least squares without a robust estimator.")),
    "ca502": Entry("ca502_rig", robust="huber", others=of_pix4d("ca502"), colmap=False, notes=(
        "Pix4D had all ground points as control, ours the six of control_points.csv.",)),
    "share5": Entry("share5", robust="huber", others=of_pix4d("share5"), colmap=False, notes=(
        "Pix4D had seven ground points as control, ours the four of control_points.csv.",)),
}  # fmt: skip


@dataclass(frozen=True)
class Found:
    """The columns of a block, and what is said about them."""

    columns: tuple[Stated, ...]
    notes: tuple[str, ...] = field(default=())


def adjusted(block: aerotri.Block, parameters: str, robust: str) -> aerotri.Adjustment | str:
    try:
        found = aerotri.adjust(block, parameters=parameters, robust=robust, max_iterations=150, explain=False)  # pyright: ignore[reportArgumentType]
    except (aerotri.AdjustmentFailedError, aerotri.InputError) as failure:
        return str(failure)
    return found if found.status == "converged" else found.adjusted.outcome.message


def columns_of(program: str, found: aerotri.Adjustment) -> list[Stated]:
    """Two columns of ours, with points held back."""
    others = [] if len(found.adjusted.check) else ours.without_each(found)
    out = []
    for total in (False, True):
        one = ours.stated(f"{program}, {'total' if total else 'noise'}", found, total)
        which = "total_sigma" if total else "sigma"
        parts = [one.held, *(ours.held(other, which) for other in others)]
        out.append(replace(one, held=ours.together(parts)))
    return out


def peers_of(found: aerotri.Adjustment, block: aerotri.Block, entry: Entry) -> list[Stated]:
    """Both columns of pycolmap, with points held back."""
    plain = adjusted(block, entry.lens, "off") if entry.robust != "off" else found
    if isinstance(plain, str):
        raise RuntimeError(plain)
    same = colmap.stated(plain.record.local)
    others = [] if same.held is not None else ours.without_each(plain)
    parts = [same.held, *(colmap.stated(other.record.local).held for other in others)]
    return [replace(same, held=ours.together(parts)), colmap.as_it_comes(plain.record.local)]


def found_of(name: str, data: Path, work: Path) -> Found:
    """All columns of a block."""
    entry, notes, columns = ENTRIES[name], [*ENTRIES[name].notes], []
    folder = work / entry.block
    real_data.BLOCKS[entry.block](data, folder)
    block = aerotri.read_block(folder)
    base = adjusted(block, entry.lens, entry.robust)
    if isinstance(base, str):
        return Found((), (f"aerotri lens: {base}",))
    columns += columns_of("aerotri lens", base)
    if entry.default:
        chosen = adjusted(block, entry.default, entry.robust)
        if isinstance(chosen, str):
            notes.append(f"aerotri default: {chosen}")
        else:
            columns += columns_of("aerotri default", chosen)
            families = chosen.block.settings.adjustment.additional_parameters
            notes.append(f"aerotri default: {', '.join(':'.join([f, '+'.join(i)]) for f, i in families) or 'none'}.")
    for other in entry.others(data):
        if other.nameless is not None:
            points = pix4d.matched(other.nameless, base.adjusted.points.xyz, base.block.points, NEAREST_M)
            notes.append(f"{other.program}: {len(points)} of {len(other.nameless)} points are within {NEAREST_M} m.")
            other = replace(other, points=points)
        columns.append(other)
    if entry.colmap:
        try:
            columns += peers_of(base, block, entry)
        except RuntimeError as failure:
            notes.append(f"pycolmap: {failure}")
    else:
        notes.append("pycolmap's covariance knows no photographs on a rig.")
    return Found(tuple(columns), tuple(notes))


def shared(columns: Sequence[Stated], kind: str) -> dict[str, np.ndarray]:
    """σ (k, 3) or (k, 6) by program, of the names that all columns with this kind have; what is held is left out."""
    own = {one.program: of_kind(one, kind, columns) for one in columns}
    own = {program: found for program, found in own.items() if found}
    known = set.intersection(*(set(found) for found in own.values())) if BASE in own else set()
    names = sorted(name for name in known if (own[BASE][name] > 0.0).any())
    return {program: np.array([found[name] for name in names]) for program, found in own.items()} if names else {}


def of_kind(one: Stated, kind: str, columns: Sequence[Stated]) -> Mapping[str, np.ndarray]:
    """σ by name; of control only where a program states nothing else."""
    if kind != "control" or one.control or not any(other.control for other in columns):
        return getattr(one, kind)
    return one.points


def with_one_camera(columns: Sequence[Stated]) -> list[Stated]:
    """A report without the name of its only camera: it is that of ours."""
    name = next(iter(columns[0].interior), None)
    return [replace(one, interior={name: one.interior[""]}) if "" in one.interior and name else one for one in columns]


def sigma_tables(found: Found) -> list[str]:
    """Medians of σ, and medians of the ratios."""
    columns = with_one_camera(found.columns)
    heads = [one.program for one in columns]
    medians, ratios = [], []
    for kind, title in KINDS.items():
        table = shared(columns, kind)
        for k, quantity in enumerate(QUANTITIES[kind] if table else ()):
            text = f"σ {quantity}, {UNITS[quantity]}"
            own = {head: table[head][:, k] for head in heads if head in table}
            medians.append([text, f"{len(table[BASE])} {title}", *(_cell(median(own.get(head))) for head in heads)])
            ratios.append([text, title, *(_cell(ratio(own.get(head), own[BASE])) for head in heads)])
    if not medians:
        return []
    out = ["", "Median σ:", "", *markdown(["quantity", "of", *heads], medians)]
    return [*out, "", f"Over {BASE} (median of the ratios):", "", *markdown(["quantity", "of", *heads], ratios)]


def median(values: np.ndarray | None) -> float:
    return float(np.nanmedian(values)) if values is not None and np.isfinite(values).any() else np.nan


def ratio(values: np.ndarray | None, base: np.ndarray) -> float:
    """Median of the ratios, where the base is not held."""
    free = base > 0.0
    return median(values[free] / base[free]) if values is not None and free.any() else np.nan


def _cell(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else ""


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def held_table(found: Found) -> list[str]:
    """Errors at points that took no part, over what is stated."""
    rows = []
    for one in found.columns:
        if one.held is not None:
            rows.append([one.program, str(len(one.held.difference)), *held_cells(one.held)])
    head = ["program", "points", "RMS dX dY m", "over σ", "with given σ", "RMS dZ m", "over σ", "with given σ"]
    return ["", "Points held back:", "", *markdown(head, rows)] if rows else []


def held_cells(held: Held) -> list[str]:
    cells = []
    for axes in (slice(0, 2), slice(2, 3)):
        d, s, g = (part[:, axes] for part in (held.difference, held.sigma, held.given))
        cells += [_cell(rms(d)), _cell(rms(d / s)), _cell(rms(d / np.hypot(s, g)))]
    return cells


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


def correlation_table(data: Path) -> list[str]:
    """The largest correlations that Pix4D states for a camera."""
    rows = []
    for folder in ("cu_sbr_p1", "ca502", "share5"):
        for camera, names, matrix in pix4d.correlations(data / folder):
            k, j = divmod(int(np.argmax(np.abs(np.triu(matrix, 1)))), len(names))
            f = 1 + int(np.argmax(np.abs(matrix[0, 1:])))
            rows.append([folder, camera, f"{names[k]}–{names[j]}", f"{matrix[k, j]:.3f}", names[f],
                         f"{matrix[0, f]:.3f}"])  # fmt: skip
    head = ["block", "camera", "largest", "correlation", "largest with F", "correlation"]
    return ["## Correlations of the interior orientation, as Pix4D states them", "", *markdown(head, rows)]


def true_block(kind: str, seed: int) -> tuple[aerotri.Block, np.ndarray, np.ndarray, np.ndarray]:
    """A simulated block with a free interior orientation; true points, centres (m) and angles (rad)."""
    made = aerotri.simulate(default_choice.flight(True), seed=seed)
    block, rays = made.block, made.block.image_points
    if kind != "right":
        errors = default_choice.errors(kind, block, np.random.default_rng(seed))
        block = replace(block, image_points=replace(rays, xy=rays.xy + errors))
    free = {"focal_length_mm": observations.Prior(35.0), "x0_mm": observations.Prior(0.0),
            "y0_mm": observations.Prior(0.0)}  # fmt: skip
    block = replace(block, cameras=tuple(replace(camera, interior=free) for camera in block.cameras))
    points = np.column_stack([made.true_points[axis] for axis in AXES])
    centre = np.column_stack([made.true_images[name] for name in ELEMENTS[:3]])
    angles = np.radians(np.column_stack([made.true_images[name] for name in ELEMENTS[3:]]))
    return default_choice.held(block, LAYOUT), points, centre, angles


def errors_of(kind: str, seed: int) -> list[Stated]:
    """Error over stated σ of one simulated block, by program."""
    block, points, centre, angles = true_block(kind, seed)
    lens, default = (adjusted(block, parameters, "off") for parameters in (LENS, "auto"))
    out = []
    for program, found in (("aerotri lens", lens), ("aerotri default", default)):
        if not isinstance(found, str):
            for total in (False, True):
                one = ours.stated(f"{program}, {'total' if total else 'noise'}", found, total)
                out.append(with_errors(one, found, points, centre, angles))
    if not isinstance(lens, str):
        same = colmap.stated(lens.record.local)
        out.append(with_errors(same, lens, points, centre, angles))
    return out


def with_errors(
    one: Stated, found: aerotri.Adjustment, points: np.ndarray, centre: np.ndarray, angles: np.ndarray
) -> Stated:
    """The column with the errors of the adjustment over its σ; of pycolmap too, whose solution is the same."""
    adjusted, block, errors = found.adjusted, found.block, {}
    turn = (adjusted.images.angles - angles + np.pi) % (2.0 * np.pi) - np.pi
    six = np.hstack([adjusted.images.centre - centre, np.degrees(turn)])
    for kind, names, rows, difference in (
        ("photographs", block.images.names, ELEMENTS, six),
        ("points", block.points, AXES, adjusted.points.xyz - points),
    ):
        sigma = getattr(one, kind)
        known = [k for k, name in enumerate(names.astype(str)) if name in sigma]
        ratio = difference[known] / np.array([sigma[str(names[k])] for k in known])
        errors |= {quantity: ratio[:, k] for k, quantity in enumerate(rows)}
    for camera in block.cameras:
        if camera.name in one.interior:
            rows = {str(n): v for n, v in zip(adjusted.parameters.names, adjusted.parameters.value, strict=True)}
            value = np.array([rows[name] for name in ours.ELEMENT_OF]) - [35.0, 0.0, 0.0]
            errors |= {quantity: (value / one.interior[camera.name])[k : k + 1] for k, quantity in enumerate(INTERIOR)}
    return replace(one, errors=errors)


def simulated_section(kind: str, blocks: int) -> list[str]:
    """Error over σ, all blocks of a kind together."""
    found: dict[str, list[Stated]] = {}
    for seed in range(1, blocks + 1):
        for one in errors_of(kind, seed):
            found.setdefault(one.program, []).append(one)
    rows = []
    for quantity in (*ELEMENTS, *AXES, *INTERIOR):
        cells = [quantity]
        for parts in found.values():
            there = [one.errors[quantity] for one in parts if quantity in one.errors]
            cells.append(_cell(rms(np.concatenate(there))) if there else "")
        rows.append(cells)
    counts = ", ".join(f"{program}: {len(parts)}" for program, parts in found.items())
    text = (
        f"{blocks} flights of 40 photographs, {SIMULATED[kind]}; GNSS, five control points. Blocks adjusted: {counts}."
    )
    head = ["error over σ, RMS", *found]
    return [f"## Simulated: {SIMULATED[kind]}", "", text, "", *markdown(head, rows)]


def section(name: str, data: Path, work: Path, blocks: int) -> list[str]:
    """The part of the page about one block."""
    if name == "correlations":
        return correlation_table(data)
    if name in SIMULATED:
        return simulated_section(name, blocks)
    found = found_of(name, data, work)
    notes = [f"- {note}" for note in found.notes]
    return [f"## {name}", *sigma_tables(found), *held_table(found), "", *notes]


def in_own_process(name: str, options: argparse.Namespace) -> None:
    words = [sys.executable, __file__, str(options.data), "--work", str(options.work), "--one", name,
             "--simulated", str(options.simulated)]  # fmt: skip
    place = options.work / "sections" / f"{name}.json"
    try:
        subprocess.run(words, timeout=options.limit, check=True)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError) as failure:
        text = [f"## {name}", "", f"Not computed: {str(failure)[-200:]}"]
        place.write_text(json.dumps({"version": version(), "lines": text}), encoding="utf-8")


def page(work: Path) -> str:
    """All sections that are there."""
    out = ["# The league of stated σ (tools/prove/league.py)", ""]
    for name in NAMES:
        place = work / "sections" / f"{name}.json"
        if place.exists():
            read = json.loads(place.read_text(encoding="utf-8"))
            out += [*read["lines"], "", f"Version {read['version']}.", ""]
    return "\n".join(out)


NAMES = (*ENTRIES, *SIMULATED, "correlations")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with the data sets")
    parser.add_argument("--work", type=Path, required=True, help="folder for blocks and sections; kept")
    parser.add_argument("--blocks", nargs="+", choices=NAMES, default=list(NAMES))
    parser.add_argument("--simulated", type=int, default=10, help="blocks of every simulated kind")
    parser.add_argument("--limit", type=int, default=LIMIT_S, help="seconds for a block")
    parser.add_argument("--table", type=Path, help="file for the page, written anew after every block")
    parser.add_argument("--one", choices=NAMES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    (options.work / "sections").mkdir(parents=True, exist_ok=True)
    if options.one:
        lines = section(options.one, options.data, options.work, options.simulated)
        text = json.dumps({"version": version(), "lines": lines})
        (options.work / "sections" / f"{options.one}.json").write_text(text, encoding="utf-8")
        return
    for name in options.blocks:
        in_own_process(name, options)
        if options.table:
            options.table.write_text(page(options.work), encoding="utf-8")
    if not options.table:
        print(page(options.work))


if __name__ == "__main__":
    main()
