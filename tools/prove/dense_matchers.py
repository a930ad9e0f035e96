"""Which semi-global matching is the better start: OpenCV's in three or in eight directions, or one with census?

The scenes of dense_surface.py. Each matcher gives whole surfaces by itself, and is refined by our least squares as
`aerotri dsm` does. The third matcher compares census transforms of 9 × 7 pixels by the number of bits that differ
(Zabih and Woodfill 1994), summed over eight directions (Hirschmüller 2008), with the penalties of `PENALTIES`, a
parabola for the part of a pixel, left against right, and the same filter of speckles. Measures
matchers in place of the one inside the package, on purpose.

    python tools/prove/dense_matchers.py [FOLDER] [--scenes hill …] [--keep]

The last answer stands in tools/results/dense_matchers.md.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numba as nb
import numpy as np

import aerotri
from aerotri.terrain.dense import parallaxes, tile
from aerotri.terrain.dense.parallaxes import (
    BLOCK_PX,
    BOTH_WAYS_PX,
    CLIPPED_GRADIENT,
    LARGE_STEP,
    SMALL_STEP,
    SPECKLE_PX,
    SPECKLE_STEP,
    UNIQUE_PERCENT,
    Parallaxes,
    semi_global,
)
from dense_surface import GSD_M, OTHER_SPEC, SCENES, SPEC, cells_of, nmad, render

HALF_ROWS, HALF_COLUMNS = 3, 4
PENALTIES = 20, 80
"""Bits by which a change of parallax by one pixel, and by more, has to pay; of 62."""
DEFAULT_SCENES = (
    "undulating",
    "houses",
    "noisy",
    "weak texture",
    "repeated texture",
    "shadow",
    "water",
    "wall",
    "tilted",
)
RESULTS = Path(__file__).parents[1] / "results"
Matcher = Callable[[parallaxes.EpipolarImages], np.ndarray]


@nb.njit(cache=True)
def census(grey):
    """(rows, columns) uint64: which neighbours are darker."""
    rows, columns = grey.shape
    out = np.zeros((rows, columns), np.uint64)
    for i in range(HALF_ROWS, rows - HALF_ROWS):
        for j in range(HALF_COLUMNS, columns - HALF_COLUMNS):
            bits = np.uint64(0)
            for a in range(-HALF_ROWS, HALF_ROWS + 1):
                for b in range(-HALF_COLUMNS, HALF_COLUMNS + 1):
                    if a != 0 or b != 0:
                        bits = (bits << np.uint64(1)) | np.uint64(grey[i + a, j + b] < grey[i, j])
            out[i, j] = bits
    return out


@nb.njit(cache=True)
def bits_that_differ(one, other, lowest, count):
    """(rows, columns, count) uint8; 63 beyond the right image."""
    rows, columns = one.shape
    out = np.full((rows, columns, count), np.uint8(63))
    for i in range(rows):
        for j in range(columns):
            for d in range(count):
                k = j - lowest - d
                if 0 <= k < columns:
                    v, n = one[i, j] ^ other[i, k], 0
                    while v != 0:
                        v &= v - np.uint64(1)
                        n += 1
                    out[i, j, d] = n
    return out


@nb.njit(cache=True)
def add_direction(cost, di, dj, small, large, total):
    """One direction of the paths."""
    rows, columns, count = cost.shape
    path = np.zeros((rows, columns, count), np.uint16)
    for ii in range(rows):
        i = ii if di >= 0 else rows - 1 - ii
        for jj in range(columns):
            j = jj if dj >= 0 else columns - 1 - jj
            a, b = i - di, j - dj
            if a < 0 or a >= rows or b < 0 or b >= columns:
                for d in range(count):
                    path[i, j, d] = cost[i, j, d]
            else:
                least = path[a, b].min()
                for d in range(count):
                    best = path[a, b, d]
                    if d > 0:
                        best = min(best, path[a, b, d - 1] + small)
                    if d < count - 1:
                        best = min(best, path[a, b, d + 1] + small)
                    best = min(best, least + large)
                    path[i, j, d] = cost[i, j, d] + best - least
            for d in range(count):
                total[i, j, d] += path[i, j, d]


@nb.njit(cache=True)
def best_of(total, unique):
    """(rows, columns) place of the least sum with its part of a pixel, NaN where another one is as good."""
    rows, columns, count = total.shape
    left = np.full((rows, columns), np.nan, np.float32)
    for i in range(rows):
        for j in range(columns):
            k = np.argmin(total[i, j])
            least = np.float64(total[i, j, k])
            good = True
            for d in range(count):
                if abs(d - k) > 1 and total[i, j, d] * (100.0 - unique) < least * 100.0:
                    good = False
            if good:
                part = 0.0
                if 0 < k < count - 1:
                    low, high = np.float64(total[i, j, k - 1]), np.float64(total[i, j, k + 1])
                    bend = low + high - 2.0 * least
                    if bend > 0.0:
                        part = 0.5 * (low - high) / bend
                left[i, j] = k + part
    return left


@nb.njit(cache=True)
def same_both_ways(total, left, lowest, most):
    """Takes out parallaxes of the left image that the right one does not have."""
    rows, columns, count = total.shape
    for i in range(rows):
        for j in range(columns):
            if np.isfinite(left[i, j]):
                k = j - lowest - int(np.rint(left[i, j]))
                if k < 0 or k >= columns:
                    left[i, j] = np.nan
                    continue
                best, at = 65535, -1
                for d in range(count):
                    c = k + lowest + d
                    if 0 <= c < columns and total[i, c, d] < best:
                        best, at = total[i, c, d], d
                if abs(at - left[i, j]) > most:
                    left[i, j] = np.nan


def by_census(images) -> np.ndarray:
    """(rows, columns) float32 px, NaN where nothing matches."""
    g = images.geometry
    cost = bits_that_differ(census(images.left), census(images.right), g.lowest, g.count)
    total = np.zeros(cost.shape, np.uint16)
    for di, dj in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        add_direction(cost, di, dj, *PENALTIES, total)
    found = best_of(total, float(UNIQUE_PERCENT))
    same_both_ways(total, found, g.lowest, float(BOTH_WAYS_PX))
    whole = np.where(np.isfinite(found), np.rint(16.0 * found), -16.0).astype(np.int16)
    cv2.filterSpeckles(whole, -16, SPECKLE_PX, 16 * SPECKLE_STEP)
    return of_both(images, np.where(whole >= 0, found + g.lowest, np.nan).astype(np.float32))


def by_eight_directions(images) -> np.ndarray:
    """OpenCV's, in all directions."""
    g = images.geometry
    matcher = cv2.StereoSGBM.create(
        minDisparity=g.lowest, numDisparities=g.count, blockSize=BLOCK_PX, P1=SMALL_STEP, P2=LARGE_STEP,
        disp12MaxDiff=BOTH_WAYS_PX, preFilterCap=CLIPPED_GRADIENT, uniquenessRatio=UNIQUE_PERCENT,
        speckleWindowSize=SPECKLE_PX, speckleRange=SPECKLE_STEP, mode=cv2.STEREO_SGBM_MODE_HH,
    )  # fmt: skip
    grey = [np.clip(np.rint(one), 0.0, 255.0).astype(np.uint8) for one in (images.left, images.right)]
    found = matcher.compute(*grey).astype(np.float32) / 16.0
    return of_both(images, np.where(found >= g.lowest, found, np.nan).astype(np.float32))


def of_both(images, found: np.ndarray) -> np.ndarray:
    """Without pixels that one of the images does not have."""
    known = np.isfinite(found) & images.left_known
    rows, columns = np.nonzero(known)
    at = np.rint(columns - found[rows, columns]).astype(np.int64)
    inside = (at >= 0) & (at < found.shape[1])
    known[rows, columns] = inside & images.right_known[rows, np.clip(at, 0, found.shape[1] - 1)]
    return np.where(known, found, np.nan).astype(np.float32)


MATCHERS: dict[str, Matcher] = {
    "OpenCV, three directions": semi_global, "OpenCV, eight": by_eight_directions, "census, eight": by_census,
}  # fmt: skip
HEAD = (
    "| scene | matcher | alone: coverage | NMAD px | refined: coverage | NMAD px | std z | beyond 4 σ | seconds |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def surfaces(result: aerotri.Adjustment, photographs: Path, matcher: Matcher):
    """The surface with a matcher alone, and refined; seconds of the refined one."""
    ours, start = tile.parallaxes_of, parallaxes.semi_global

    def alone(images) -> Parallaxes:
        value = matcher(images)
        return Parallaxes(value, np.where(np.isfinite(value), np.float32(0.3), np.float32(np.nan)), 0.0, 1.0)

    tile.parallaxes_of = alone
    try:
        by_itself = aerotri.dense_surface(result, photographs)
    finally:
        tile.parallaxes_of = ours
    parallaxes.semi_global = matcher
    try:
        begun = time.perf_counter()
        refined = aerotri.dense_surface(result, photographs)
        return by_itself, refined, time.perf_counter() - begun
    finally:
        parallaxes.semi_global = start


def rows(folder: Path, name: str, seed: int) -> list[str]:
    """Lines of a scene."""
    ground, look = SCENES[name]
    spec = SPEC | {"terrain": {"height_m": 50.0} | ground}
    spec |= {table: SPEC[table] | other for table, other in OTHER_SPEC.get(name, {}).items()}
    flight = aerotri.simulate(spec, seed)
    photographs = render(folder / "flown", flight, name, look)
    result = aerotri.adjust(flight.block, explain=False)
    found = []
    for words, matcher in MATCHERS.items():
        by_itself, refined, seconds = surfaces(result, photographs, matcher)
        a, r = (cells_of(one, flight, name) for one in (by_itself, refined))
        z = (r.error / r.sigma)[~r.steep]
        found.append(
            f"| {name} | {words} | {a.coverage:.3f} | {nmad(a.error[~a.steep]) / GSD_M:.3f} | {r.coverage:.3f} | "
            f"{nmad(r.error[~r.steep]) / GSD_M:.3f} | {np.std(z):.2f} | {100.0 * np.mean(np.abs(z) > 4.0):.2f} % | "
            f"{seconds:.1f} |"
        )
    return found


def main() -> None:
    """Render, match, print, write where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(DEFAULT_SCENES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="write tools/results/dense_matchers.md")
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp())
    lines = ["# Start of the dense matching: three kinds of semi-global matching", "", HEAD]
    print(HEAD, flush=True)
    for name in arguments.scenes:
        new = rows(folder / name.replace(" ", "_"), name, arguments.seed)
        print("\n".join(new), flush=True)
        lines += new
    if arguments.keep:
        (RESULTS / "dense_matchers.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
