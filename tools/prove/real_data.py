"""The real blocks of the validation, made by the documented commands; what tools that use them share.

Every conversion is cached in a folder of its own and made anew where that is deleted. The commands are those of
docs/validation/data.md, docs/validation/real_blocks.md and of the README of each data set.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import aerotri
import ca502
import rigs

CU_SBR_P1 = (
    "--gnss-shift off --control-prefix GCP_ --camera-name P1 --camera-size 8192x5460 --pixel-um 4.27246 "
    "--focal-length-mm 35.01 --free-interior --image-sigma-px 0.5 --crs EPSG:32647"
)
SHARE5 = (
    "--camera-size 6000x4000 --pixel-um 4.23333 --focal-length-mm 38 --free-interior --rig-reference down "
    "--station-pattern 8{camera}0{station} --control-prefix GCP_ --control-sigma-m 0.02,0.02,0.05 --crs EPSG:32647 "
    "--image-sigma-px 0.5"
)
SHARE5_DOWN_MM = "27.0"
"""Focal length of the head that looks down: the file names one camera for all heads, so that one is asked for all."""
EAGLE = (
    "--pixel-um 4 --image-sigma-px 0.5 --crs EPSG:2154+5720 --control-heights ellipsoidal --linear-alteration 5 "
    "--control-sigma-m 0.05 --orientation-sigma-m 0.1 --orientation-sigma-deg 0.002"
)
DRONE = (
    "--camera-name drone --camera-size 640x480 --pixel-um 7.5 --focal-length-mm 4.8 --image-sigma-px 0.1 "
    "--flight-axis +y --free-interior"
)
COPR = "--control-sigma-m 2,2,3 --unmarked continue --no-dense"


@dataclass(frozen=True)
class Ran:
    """A command that has run.

    Parameters
    ----------
    words : of the command, after `aerotri`. code : its exit code. text : all that it printed. seconds : of the clock.
    """

    words: tuple[str, ...]
    code: int
    text: str
    seconds: float


def into_page(page: Path, name: str, lines: Sequence[str]) -> None:
    """Put lines of a result between the marks of that name in a page of the documentation."""
    text = page.read_text(encoding="utf-8")
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    if begin not in text or end not in text:
        raise SystemExit(f"{page} has no marks '{name}'")
    before, rest = text.split(begin, 1)
    after = rest.split(end, 1)[1]
    page.write_text(before + begin + "\n".join(["", *lines, ""]) + end + after, encoding="utf-8")


def version() -> str:
    """The last commit that changed the program, and its date."""
    told = subprocess.run(
        ["git", "log", "-1", "--format=%h %cd", "--date=format:%Y-%m-%d %H:%M", "--", "src"],
        cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False,
    )  # fmt: skip
    return told.stdout.strip() or aerotri.__version__


def command(*words: object) -> Ran:
    """Run a command of aerotri in a process of its own."""
    texts = tuple(str(word) for word in words)
    begun = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "aerotri", *texts], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        encoding="utf-8", errors="replace", check=False,
    )  # fmt: skip
    return Ran(texts, done.returncode, done.stdout, time.perf_counter() - begun)


def converted(folder: Path, *words: object) -> Ran | None:
    """`aerotri convert` into a folder; None where it is there already."""
    return None if folder.exists() else command("convert", *words, "--out", folder)


def cu_sbr_p1(data: Path, folder: Path) -> Ran | None:
    place = data / "cu_sbr_p1"
    return converted(
        folder, place / "tp_bingo.txt", "--positions", place / "gnss_positions.csv", "--control",
        place / "control_points.csv", *CU_SBR_P1.split(),
    )  # fmt: skip


def cu_sbr_p1_control(data: Path, folder: Path) -> Ran | None:
    """Without the RTK positions: the block of the files, and the table taken out of it."""
    ran = cu_sbr_p1(data, folder)
    (folder / "gnss_ins.csv").unlink(missing_ok=True)
    return ran


def share5(data: Path, folder: Path) -> Ran | None:
    place = data / "share5"
    start = place / "share_5cam_v2_calibrated_external_camera_parameters.txt"
    ran = converted(
        folder, place / "share_5cam_v2_tp_bingo.txt", "--orientation", start, "--control",
        place / "control_points.csv", *SHARE5.split(),
    )  # fmt: skip
    if ran is not None and ran.code == 0:
        set_focal_length(folder / "block.toml", "down", SHARE5_DOWN_MM)
    return ran


def set_focal_length(toml: Path, head: str, focal_mm: str) -> None:
    """The focal length of the camera whose name ends with that of a head."""
    lines, inside, changed = toml.read_text(encoding="utf-8").splitlines(), False, 0
    for number, line in enumerate(lines):
        if line.startswith("["):
            inside = line.endswith((f'_{head}"]', f".{head}]"))
        elif inside and line.startswith("focal_length_mm = "):
            lines[number], changed = f"focal_length_mm = {focal_mm}", changed + 1
    if changed != 1:
        raise SystemExit(f"{toml}: {changed} cameras of the head '{head}', not one")
    toml.write_text("\n".join(lines) + "\n", encoding="utf-8")


def ultracam_eagle_m3(data: Path, folder: Path) -> Ran | None:
    place = data / "ultracam_eagle_m3"
    return converted(folder, place, "--geoid", place / "fr_ign_RAF20.tif", *EAGLE.split())


def ca502_independent(data: Path, folder: Path) -> Ran | None:
    """By tools/prove/ca502.py: no command gives five heads cameras of their own."""
    if not folder.exists():
        aerotri.convert(ca502.oriented(ca502.unoriented(data / "ca502")), folder)
    return None


def ca502_rig(data: Path, folder: Path) -> Ran | None:
    """By tools/prove/rigs.py."""
    if not folder.exists():
        aerotri.convert(rigs.with_rig(ca502.unoriented(data / "ca502")), folder)
    return None


def stpierre(data: Path, folder: Path) -> Ran | None:
    return copied(data / "stpierre", folder)


def copied(place: Path, folder: Path) -> None:
    """A block folder as it is; commands write beside what they are given."""
    if not folder.exists():
        shutil.copytree(place, folder)
        for file in folder.rglob("*"):
            file.chmod(file.stat().st_mode | 0o200)


def of_file(*parts: str, options: Sequence[str] = ()) -> Callable[[Path, Path], Ran | None]:
    """The conversion of one file of the data, or of a folder of it."""

    def convert(data: Path, folder: Path) -> Ran | None:
        return converted(folder, data.joinpath(*parts), *options)

    return convert


def camcaldemo_weighted(data: Path, folder: Path) -> Ran | None:
    """The script with weighted control, changed in one line as its own text says."""
    place = folder.parent / "camcaldemo_weighted_script"
    copied(data / "camcaldemo", place)
    script = place / "camcaldemo.xml"
    fixed = '<file format="id,label,x,y,z">reference/camcal-fixed.txt</file>'
    weighted = '<file format="id,label,x,y,z,sxyz">reference/camcal-weighted.txt</file>'
    script.write_text(script.read_text(encoding="utf-8").replace(fixed, weighted), encoding="utf-8")
    return converted(folder, script)


def metashape_two_components(data: Path, folder: Path) -> Ran | None:
    place = data / "doors" / "metashape_two_components"
    return converted(folder, place / "twocomp.xml", "--image-points", place / "pts_n.mes", "--image-sigma-px", "0.3")


def noise_free(data: Path, folder: Path) -> Ran | None:
    place = data / "doors" / "noise_free_not_converged"
    return converted(folder, place / "plain.xml", "--image-points", place / "pts.mes", "--image-sigma-px", "0.5")


def turned_over(orientation: str) -> Callable[[Path, Path], Ran | None]:
    """doors/crash_eigenvalues with one of its orientation lists."""

    def convert(data: Path, folder: Path) -> Ran | None:
        place = data / "doors" / "crash_eigenvalues"
        return converted(
            folder, place / "sim_bingo.txt", "--orientation", place / orientation, "--positions",
            place / "sim_geo.txt", "--control", place / "sim_p4gcp.csv", *DRONE.split(), "--crs", "EPSG:32632",
        )  # fmt: skip

    return convert


def door(name: str) -> Callable[[Path, Path], Ran | None]:
    """A block folder of doors/."""

    def copy(data: Path, folder: Path) -> Ran | None:
        return copied(data / "doors" / name, folder)

    return copy


def without_gnss(block: aerotri.Block) -> aerotri.Block:
    return replace(block, gnss_ins=None)


BLOCKS: dict[str, Callable[[Path, Path], Ran | None]] = {
    "bal_16": of_file("bal", "problem-16-22106-pre.txt"),
    "bal_49": of_file("bal", "problem-49-7776-pre.txt"),
    "ca502_independent": ca502_independent,
    "ca502_rig": ca502_rig,
    "camcaldemo": of_file("camcaldemo", "camcaldemo.xml"),
    "camcaldemo_weighted": camcaldemo_weighted,
    "cu_sbr_p1": cu_sbr_p1,
    "cu_sbr_p1_control": cu_sbr_p1_control,
    "dbat_roma": of_file("dbat_roma", "romabundledemo.xml"),
    "dbat_sxb": of_file("dbat_sxb", "sxb.xml"),
    "share5": share5,
    "stpierre": stpierre,
    "ultracam_eagle_m3": ultracam_eagle_m3,
    "doors_crash_eigenvalues": turned_over("eo_bad.txt"),
    "doors_crash_eigenvalues_180": turned_over("all_om180.txt"),
    "doors_crash_not_positive_definite": door("crash_not_positive_definite"),
    "doors_metashape_two_components": metashape_two_components,
    "doors_noise_free": noise_free,
    "doors_rows_flipped": door("rows_flipped"),
    "doors_strip_mirrored": door("strip_mirrored"),
}
"""Blocks whose image points are measured: name → what makes the block folder."""
