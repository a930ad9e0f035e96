"""Odd blocks: small, and in every way unlike the blocks that an adjustment is written for.

`odd_blocks` draws them for hypothesis: a few photographs that do not stand in strips, points with one to four rays,
pieces without a common point, wrong orientations, σ of any size, no control or nothing else. `ends` adjusts one
through the commands of the program: whatever comes out, it is an exit code with words and no exception.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from typer.main import get_command

from aerotri.cli import app
from aerotri.conventions import InputError
from aerotri.execution.work import TasksFailedError
from aerotri.formats.block.folder import write_block
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.functional_model.rotation import angles_from_rotation, exponential
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    Control,
    GnssIns,
    GnssSettings,
    ImagePoints,
    Images,
    Prior,
    Settings,
)

HEIGHT = 60.0
"""Of the photographs above the points, m."""
ARRANGEMENTS = ("row", "ring", "scattered", "facade", "one place", "two places")
PARAMETERS = ("none", "lens:k1+k2+p1+p2", "bluh:1-12", "auto")
COMMANDS = ("check", "adjust", "robust", "halves", "deform", "compare-parameters", "free")
WIDEST = 20.0
"""Of image coordinates, in principal distances."""
FAR = 1e4
"""Of a point or photograph that is nowhere near the others, m."""


@dataclass(frozen=True)
class Odd:
    """What is odd about a block.

    Parameters
    ----------
    seed : of positions and errors. photographs, points : numbers of them.
    rays : most rays of a point. lonely : share of points with one ray.
    arrangement : one of `ARRANGEMENTS`. pieces : groups of photographs that have no point in common.
    cameras : number of them. focal_length_mm : short for wide angles. fisheye : their model. free : whether c, x0, y0
        are unknowns.
    log_sigma_um : of the stated σ of image points. noise : of their errors in that σ; 0 for none.
    control : share of the points; control_sigma_m : 0 holds them. heights_only : without plan. check : share of check
        points among them.
    gnss_sigma_m : None without GNSS. shift : whether it has a shift.
    datum : as in block.toml. oriented : share of the photographs with start orientations.
    wrong : photograph whose start orientation is turned by wrong_deg about `wrong_axis` and moved by wrong_m, −1 for
        none.
    behind : points that lie behind the photographs. far : points that lie far away.
    spoilt : rays whose coordinates are those of another point.
    mirrored : photographs with x reversed.
    parameters : as of `adjust --parameters`. command : one of `COMMANDS`.
    """

    seed: int = 0
    photographs: int = 3
    points: int = 12
    rays: int = 3
    lonely: float = 0.0
    arrangement: str = "row"
    pieces: int = 1
    cameras: int = 1
    focal_length_mm: float = 8.0
    fisheye: bool = False
    free: bool = True
    log_sigma_um: float = 0.0
    noise: float = 1.0
    control: float = 0.0
    control_sigma_m: float = 0.02
    heights_only: bool = False
    check: float = 0.0
    gnss_sigma_m: float | None = None
    shift: bool = False
    datum: str = "control"
    oriented: float = 1.0
    wrong: int = -1
    wrong_axis: int = 0
    wrong_deg: int = 0
    wrong_m: float = 0.0
    behind: int = 0
    far: int = 0
    spoilt: int = 0
    mirrored: int = 0
    parameters: str = "none"
    command: str = "adjust"


@dataclass(frozen=True)
class End:
    """Exit code of a command, and what it said."""

    code: int
    text: str


def _seldom(usual: Any, *others: Any) -> tuple[Any, ...]:
    """The usual seven times in eight."""
    return (usual,) * 7 * len(others) + others


CHOICES: dict[str, Sequence[Any]] = {
    "photographs": (2, 3, 4, 5),
    "points": _seldom(12, 20, 40, 1, 3, 6),
    "rays": (2, 3, 4),
    "lonely": _seldom(0.0, 0.3, 1.0),
    "arrangement": ARRANGEMENTS,
    "pieces": _seldom(1, 2, 3),
    "cameras": _seldom(1, 2, 3),
    "focal_length_mm": _seldom(8.0, 2.0, 0.5, 50.0),
    "fisheye": _seldom(False, True),
    "free": (False, True),
    "log_sigma_um": _seldom(0.0, -3.0, -1.5, 1.5, 3.0),
    "noise": _seldom(1.0, 0.0, 1e-6, 30.0),
    "control": (0.3, 0.0, 1.0),
    "control_sigma_m": _seldom(0.02, 0.0, 1e-6, 10.0),
    "heights_only": _seldom(False, True),
    "check": _seldom(0.0, 0.5, 1.0),
    "gnss_sigma_m": (None, 0.02, 1e-6, 5.0),
    "shift": _seldom(False, True),
    "datum": _seldom("control", "minimal", "inner"),
    "oriented": _seldom(1.0, 0.5, 0.0),
    "wrong": _seldom(-1, 0, 1),
    "wrong_axis": (0, 1, 2),
    "wrong_deg": range(-180, 181),
    "wrong_m": _seldom(0.0, 1.0, HEIGHT, FAR),
    "behind": _seldom(0, 1, 5),
    "far": _seldom(0, 1, 5),
    "spoilt": _seldom(0, 1, 10),
    "mirrored": _seldom(0, 1, 2),
    "parameters": PARAMETERS,
    "command": COMMANDS,
}
"""What every field of `Odd` is drawn from."""


def odd_blocks() -> SearchStrategy[Odd]:
    """Draws what is odd, for hypothesis."""
    fields = {name: st.sampled_from(choices) for name, choices in CHOICES.items()}
    return st.builds(Odd, seed=st.integers(0, 2**31), **fields)


def drawn(number: int) -> Odd:
    """The odd block of a number, for series of them."""
    rng = np.random.default_rng(number)
    fields = {name: choices[int(rng.integers(len(choices)))] for name, choices in CHOICES.items()}
    return Odd(seed=number, **fields)


def odd_block(odd: Odd) -> Block:
    """The block itself; everything follows from the record."""
    rng = np.random.default_rng(odd.seed)
    centre, rotation = _photographs(odd, rng)
    xyz = _points(odd, rng)
    image, point, xy = _rays(odd, rng, centre, rotation, xyz)
    sigma_mm = 10.0**odd.log_sigma_um * 1e-3
    xy = xy + odd.noise * sigma_mm * rng.normal(size=xy.shape)
    half_format = max(float(np.abs(xy).max(initial=0.0)), odd.focal_length_mm)
    control = _control(odd, rng, xyz)
    adjustment = AdjustmentSettings(
        additional_parameters=() if odd.parameters == "auto" else parse_parameters(odd.parameters), datum=odd.datum
    )
    return Block(
        name="odd",
        cameras=tuple(_camera(odd, k, half_format) for k in range(odd.cameras)),
        images=_images(odd, rng, centre, rotation),
        points=np.array([f"P{k}" for k in range(len(xyz))], dtype=str),
        image_points=ImagePoints(image, point, xy, np.full(xy.shape, sigma_mm)),
        control=control,
        gnss_ins=_gnss(odd, rng, centre),
        settings=Settings(
            adjustment=adjustment,
            gnss=GnssSettings(shift="block" if odd.shift and odd.gnss_sigma_m is not None else "off"),
            image_sigma_um=1e3 * sigma_mm,
        ),
    )


def _photographs(odd: Odd, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) m and (n, 3, 3): where they truly stand."""
    n = odd.photographs
    k = np.arange(n)
    turn = rng.normal(0.0, 0.05, (n, 3))
    centre = np.column_stack([20.0 * k, rng.normal(0.0, 2.0, n), HEIGHT + rng.normal(0.0, 2.0, n)])
    if odd.arrangement == "ring":
        around = 2.0 * np.pi * k / n
        centre = np.column_stack([40.0 * np.cos(around), 40.0 * np.sin(around), np.full(n, HEIGHT)])
        turn += 0.5 * np.column_stack([np.sin(around), -np.cos(around), np.zeros(n)])
        turn[:, 2] = rng.uniform(-np.pi, np.pi, n)
    if odd.arrangement == "scattered":
        centre = rng.uniform(-40.0, 40.0, (n, 3)) + [0.0, 0.0, HEIGHT]
        turn[:, 2] = rng.uniform(-np.pi, np.pi, n)
    if odd.arrangement == "facade":
        centre, turn = np.column_stack([15.0 * k, np.full(n, -HEIGHT), np.zeros(n)]), turn + [0.5 * np.pi, 0.0, 0.0]
    if odd.arrangement == "one place":
        centre = np.tile(centre[0], (n, 1))
    if odd.arrangement == "two places":
        centre = centre[k % 2]
    return centre, exponential(turn)


def _points(odd: Odd, rng: np.random.Generator) -> np.ndarray:
    """(P, 3) m; the last of them behind the photographs or far away."""
    xyz = rng.uniform(-25.0, 25.0, (odd.points, 3)) + [10.0 * odd.photographs, 0.0, 0.0]
    xyz[:, 2] *= 0.2
    if odd.arrangement == "facade":
        xyz[:, 1], xyz[:, 2] = xyz[:, 2], xyz[:, 1].copy()
    toward = np.array([0.0, -1.0, 0.0]) if odd.arrangement == "facade" else np.array([0.0, 0.0, 1.0])
    xyz[: odd.behind] += 3.0 * HEIGHT * toward
    xyz[odd.behind : odd.behind + odd.far] -= FAR * toward
    return xyz


def _rays(
    odd: Odd, rng: np.random.Generator, centre: np.ndarray, rotation: np.ndarray, xyz: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(m,) photograph, (m,) point and (m, 2) mm without errors."""
    seen = [
        (image, point)
        for point in range(len(xyz))
        for image in _seen_by(odd, rng, point)
    ]  # fmt: skip
    if not seen:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2))
    image, point = np.array(seen).T
    u = np.einsum("mki,mk->mi", rotation[image], xyz[point] - centre[image])
    # a point behind the photograph is measured where its reflection would be
    across, along = np.hypot(u[:, 0], u[:, 1]), -u[:, 2]
    scale = np.arctan2(across, along) / np.maximum(across, 1e-9) if odd.fisheye else 1.0 / along
    xy = odd.focal_length_mm * scale[:, None] * u[:, :2]
    xy[np.isin(image, np.arange(odd.mirrored)), 0] *= -1.0
    spoilt = rng.permutation(len(xy))[: odd.spoilt]
    xy[spoilt] = xy[rng.permutation(len(xy))[: len(spoilt)]]
    return image, point, np.clip(xy, -WIDEST * odd.focal_length_mm, WIDEST * odd.focal_length_mm)


def _seen_by(odd: Odd, rng: np.random.Generator, point: int) -> np.ndarray:
    """Photographs of its piece that a point is measured in."""
    own = np.flatnonzero(np.arange(odd.photographs) % odd.pieces == point % odd.pieces)
    most = 1 if rng.uniform() < odd.lonely else int(rng.integers(2, odd.rays + 1))
    return np.sort(rng.permutation(own)[:most])


def _images(odd: Odd, rng: np.random.Generator, centre: np.ndarray, rotation: np.ndarray) -> Images:
    n = odd.photographs
    start, turned = centre + rng.normal(0.0, 0.2, (n, 3)), exponential(rng.normal(0.0, 0.005, (n, 3))) @ rotation
    if 0 <= odd.wrong < n:
        axis = np.eye(3)[odd.wrong_axis]
        turned[odd.wrong] = exponential(np.radians(odd.wrong_deg) * axis[None])[0] @ turned[odd.wrong]
        start[odd.wrong] += odd.wrong_m * axis
    angles = angles_from_rotation(turned)
    without = np.arange(n) >= round(odd.oriented * n)
    start[without], angles[without] = np.nan, np.nan
    names = np.array([f"photo {k}" for k in range(n)])
    return Images(names, np.arange(n) % odd.cameras, np.full(n, "", dtype=str), start, angles)


def _camera(odd: Odd, k: int, half_format_mm: float) -> Camera:
    held = {name: Prior(value, fixed=not odd.free) for name, value in (
        ("focal_length_mm", odd.focal_length_mm), ("x0_mm", 0.0), ("y0_mm", 0.0))}  # fmt: skip
    projection = "fisheye" if odd.fisheye else "perspective"
    size_px = 4000, 4000
    return Camera(f"camera {k}", "frame", size_px, 2e3 * half_format_mm / size_px[0], held, projection=projection)


def _control(odd: Odd, rng: np.random.Generator, xyz: np.ndarray) -> Control:
    count = round(odd.control * len(xyz))
    point = np.sort(rng.permutation(len(xyz))[:count])
    sigma = np.full((count, 3), odd.control_sigma_m)
    given = xyz[point] + odd.noise * sigma * rng.normal(size=sigma.shape)
    if odd.heights_only:
        given[:, :2] = sigma[:, :2] = np.nan
    return Control(point, given, sigma, np.arange(count) < round(odd.check * count))


def _gnss(odd: Odd, rng: np.random.Generator, centre: np.ndarray) -> GnssIns | None:
    if odd.gnss_sigma_m is None:
        return None
    nothing = np.full(centre.shape, np.nan)
    sigma = np.full(centre.shape, odd.gnss_sigma_m)
    observed = centre + odd.noise * sigma * rng.normal(size=sigma.shape)
    return GnssIns(np.arange(len(centre)), observed, sigma, nothing, nothing, nothing[:, 0])


def command_lines(odd: Odd, folder: Path) -> list[list[str]]:
    """What is run, one after the other."""
    block, out = str(folder / "block"), str(folder / "result")
    adjust = ["adjust", block, "--out", out, "--no-plots", "--parameters", odd.parameters]
    further = str(folder / "further")
    return {
        "check": [["check", block]],
        "adjust": [adjust],
        "robust": [[*adjust, "--robust", ("huber", "danish", "cauchy", "adaptive", "data-snooping")[odd.seed % 5]]],
        "halves": [adjust, ["halves", out, "--out", further]],
        "deform": [adjust, ["deform", out, "--out", further]],
        "compare-parameters": [
            ["compare-parameters", block, "--set", "none", "--set", PARAMETERS[1], "--folds", "2", "--out", further]
        ],
        "free": [[*adjust, "--check-free"]],
    }[odd.command]


def ends(odd: Odd, folder: Path) -> list[End]:
    """How the commands of an odd block end; raises what `end_of` does."""
    write_block(odd_block(odd), folder / "block")
    return [end_of(words) for words in command_lines(odd, folder)]


def end_of(words: list[str]) -> End:
    """How a command ends.

    Raises
    ------
    Exception
        Whatever the program would call unexpected, a warning of numpy among it.
    """
    text = io.StringIO()
    with warnings.catch_warnings(), redirect_stdout(text), redirect_stderr(text):
        warnings.simplefilter("error", RuntimeWarning)
        try:
            code = _command().main(args=words, standalone_mode=False)
        except InputError as error:
            code, _ = 2, text.write(str(error))
        except TasksFailedError as error:
            code, _ = 1, text.write(str(error))
    return End(code or 0, text.getvalue())


@cache
def _command() -> Any:
    """The command line, made once: that takes longer than some of the blocks."""
    return get_command(app)
