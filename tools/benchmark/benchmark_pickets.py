"""Pickets against OpenCV's matchTemplate on the same windows, in turn, medians of five, one thread each.

    python tools/benchmark/benchmark_pickets.py RESULT PHOTOGRAPHS

Every node has one pair of photographs and a range of parallax about its height. OpenCV gets the template and the strip
of the other photograph along the base cut out of the photographs, in 8 bits, not rectified, and is asked for the best
place (TM_CCOEFF_NORMED, minMaxLoc). aerotri rectifies the template and the strip by the orientation and the image
errors, in 16 bits, and goes from places to heights. Beside it stands OpenCV with rectification at every height: two
remaps to a window, then the coefficient of the two.

Measures the kernel of the search alone: imports inside on purpose.

Last result, Brighton, two quiet cores:

    9999 nodes, 17 posts a side, 17 places; OpenCV 5.0.0
    aerotri, a height every post: 12.9 µs a node (12.7–13.3)
    aerotri, a height every half post: 14.1 µs a node (13.9–14.3)
    OpenCV matchTemplate, not rectified: 12.1 µs a node (11.7–13.2)
    OpenCV remap at every height, matchTemplate: 212.2 µs a node (209.7–216.5)

With its rectification aerotri takes 7 % longer than matchTemplate alone; before strips, with windows rectified at every
height, it took 91.8 and 172.2 µs.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import cv2
import numpy as np

import aerotri
from aerotri.public.terrain import terrain_plan
from aerotri.terrain._plan_kernels import Nodes, Plan
from aerotri.terrain._search_kernels import find_heights
from aerotri.terrain._view_kernels import parallax_per_metre, photo_place
from aerotri.terrain.photographs import photographs_of, site_at
from aerotri.terrain.settings import TerrainSettings

POSTS, HALF_RANGE, ROUNDS = 17, 8, 5


def prepare(result: Path, folder: Path, count: int):
    """View, nodes (n, 3), pairs (n, 2), ranges and post size of nodes in the middle of the block."""
    calibration = aerotri.open_result(result).record
    plan, _ = terrain_plan(calibration, [folder], TerrainSettings())
    photographs = photographs_of(calibration, plan.rows, plan.paths)
    known = calibration.result.points.xyz
    middle, gsd = np.nanmedian(known, axis=0), float(np.median(photographs.gsd))
    site = site_at(photographs, *middle[:2].tolist())
    side = int(np.sqrt(count))
    x = 6.0 * gsd * (np.arange(side) - side / 2)
    nodes = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    nodes = np.column_stack([nodes, np.full(len(nodes), middle[2] - site.place[2])])
    nearest = np.argsort(np.hypot(*site.centres[:, :2].T))[:2]
    spot = np.array([0.0, 0.0, nodes[0, 2], 0.0, 0.0])
    half = HALF_RANGE * gsd / parallax_per_metre(site.view(0, nodes[0] - 1, nodes[0] + 1, 0.0, 1.0), nearest, spot)
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    low[2], high[2] = low[2] - half, high[2] + half
    view = site.view(0, low, high, 0.0, POSTS * gsd)
    return view, nodes, np.tile(nearest, (len(nodes), 1)), nodes[:, 2:] + [-half, half], gsd


def cut(view, nodes: np.ndarray, pair: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Templates and strips of 8 bits around the places of nodes; strips as long as the range, along columns."""
    h, found, grey = POSTS // 2, [], []
    for k in pair:
        offset, _, _, rows, columns = view.crops[k]
        grey.append((view.pixels[offset : offset + rows * columns].reshape(rows, columns) >> 8).astype(np.uint8))
    for x, y, z in nodes:
        (c, r), (oc, orow) = (
            np.array(photo_place(view, k, 0, 0, x, y, z)).astype(int) - view.crops[k, [2, 1]] for k in pair
        )
        template = grey[0][r - h : r + h + 1, c - h : c + h + 1]
        reach = h + HALF_RANGE
        found.append((template, grey[1][orow - h : orow + h + 1, oc - reach : oc + reach + 1]))
    return found


def by_template(windows: list[tuple[np.ndarray, np.ndarray]]) -> None:
    for template, strip in windows:
        cv2.minMaxLoc(cv2.matchTemplate(strip, template, cv2.TM_CCOEFF_NORMED))


def by_remaps(windows: list[tuple[np.ndarray, np.ndarray]], places: tuple[np.ndarray, np.ndarray]) -> None:
    for template, strip in windows:
        for _ in range(2 * HALF_RANGE + 1):
            one = cv2.remap(template, *places, cv2.INTER_LINEAR)
            other = cv2.remap(strip, *places, cv2.INTER_LINEAR)
            cv2.matchTemplate(other, one, cv2.TM_CCOEFF_NORMED)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("result", type=Path)
    parser.add_argument("photographs", type=Path)
    parser.add_argument("--nodes", type=int, default=10_000)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    view, nodes, chosen, ranges, gsd = prepare(arguments.result, arguments.photographs, arguments.nodes)
    windows = cut(view, nodes, chosen[0])
    whole = [one.shape == (POSTS, POSTS) and other.shape == (POSTS, POSTS + 2 * HALF_RANGE) for one, other in windows]
    windows = [pair for pair, kept in zip(windows, whole, strict=True) if kept]
    nodes, chosen, ranges = nodes[whole], chosen[whole], ranges[whole]
    y, x = np.mgrid[:POSTS, :POSTS].astype(np.float32)
    places = cv2.convertMaps(x + 0.3, y + 0.4, cv2.CV_16SC2)
    heights, scores = np.empty(len(nodes)), np.empty(len(nodes))

    def ours(step: float) -> None:
        slopes = np.zeros((len(nodes), 2))
        most = int(2 * HALF_RANGE / step) + 2
        plan = Plan(POSTS, gsd, step, most)
        find_heights(view, Nodes(nodes, slopes, ranges, chosen), plan, heights, scores)

    runs = {
        "aerotri, a height every post": lambda: ours(1.0),
        "aerotri, a height every half post": lambda: ours(0.5),
        "OpenCV matchTemplate, not rectified": lambda: by_template(windows),
        "OpenCV remap at every height, matchTemplate": lambda: by_remaps(windows, places),
    }
    ours(1.0)
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(ROUNDS):
        for name, run in runs.items():
            begun = time.perf_counter()
            run()
            taken[name].append(time.perf_counter() - begun)
    print(f"{len(nodes)} nodes, {POSTS} posts a side, {2 * HALF_RANGE + 1} places; OpenCV {cv2.__version__}")
    for name, seconds in taken.items():
        each = 1e6 * np.array(seconds) / len(nodes)
        print(f"{name}: {np.median(each):.1f} µs a node ({each.min():.1f}–{each.max():.1f})")


if __name__ == "__main__":
    main()
