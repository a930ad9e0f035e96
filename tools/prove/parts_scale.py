"""A block simulated and adjusted in parts at a size that no machine would hold at once: time, memory, files, tree.

UltraCamD, 60/30 %, positions of the projection centres, Brown's parameters, 40 image points a photograph; every σ. The
memory is that of this program and its processes together (proportional set size), looked at every second; the files are
those that parts and joints exchange. What the tree lets expect stands beside. Prints Markdown.

Measures the fronts of the tree beside the memory, which no command prints: it looks within the package on purpose.

    python tools/prove/parts_scale.py FOLDER --photographs 250000 --parts 250 > tools/results/parts_scale.md
"""

from __future__ import annotations

import argparse
import threading
import time
from pathlib import Path

import numpy as np
import psutil

import aerotri
from aerotri.partition.joint_tasks import B
from aerotri.partition.tree import tree_over

SECONDS_BETWEEN, LOOKS_BETWEEN_FILES = 1.0, 15
PARAMETERS = 5
"""Of Brown, for one camera."""


class Watch:
    """Largest memory, of a worker and of all, and files, in bytes, seen until it is ended."""

    def __init__(self, folder: Path):
        self.together = self.of_one = self.files = 0
        self._folder, self._over = folder, threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def end(self) -> None:
        self._over.set()
        self._thread.join()

    def _look(self) -> None:
        own, looks = psutil.Process(), 0
        while not self._over.wait(SECONDS_BETWEEN):
            sizes = [memory_of(process) for process in (own, *own.children(recursive=True))]
            self.together, self.of_one = max(self.together, sum(sizes)), max([self.of_one, *sizes[1:]])
            if looks % LOOKS_BETWEEN_FILES == 0:
                self.files = max(self.files, size_of(self._folder))
            looks += 1


def memory_of(process: psutil.Process) -> int:
    """Bytes, 0 of one that is gone."""
    try:
        return process.memory_full_info().pss
    except psutil.Error:
        return 0


def size_of(folder: Path) -> int:
    """Bytes of all files; some come and go meanwhile."""
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size
        except OSError:
            continue
    return total


def plan_of(photographs: int, per_image: float) -> dict:
    """A flight of about so many photographs, as long as wide."""
    strips = max(3, round(0.75 * photographs**0.5))
    return {
        "name": f"scale_{photographs}",
        "camera": {"ucd8": {"preset": "ultracam_d"}},
        "flight": {
            "gsd_m": 0.09, "strips": strips, "images_per_strip": round(photographs / strips), "end_lap": 0.6,
            "side_lap": 0.3, "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
        },
        "terrain": {"kind": "undulating", "height_m": 250.0, "relief_rms_m": 40.0, "wavelength_m": 2000.0},
        "tie_points": {"per_image": per_image, "rays_per_point": 2.8, "sigma_um": 2.0},
        "control": {"distance_bases": 20.0, "sigma_m": [0.03, 0.03, 0.03]},
        "gnss": {"sigma_m": [0.05, 0.05, 0.08]},
        "adjustment": {"additional_parameters": ["brown"]},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.0573},
    }  # fmt: skip


def expected(folder: Path) -> tuple[int, float, float]:
    """Shared photographs; bytes of the task of the largest joint; multiplications of all joints."""
    parts = [aerotri.read_block(path).images for path in sorted((folder / "parts").iterdir())]
    names, count = np.unique(np.concatenate([images.names for images in parts]), return_counts=True)
    kept = names[count > 1]
    shared = [np.searchsorted(kept, images.names[np.isin(images.names, kept)]) for images in parts]
    tree = tree_over(shared, np.array([images.centre[:, :2].mean(axis=0) for images in parts]), len(kept))
    sizes = [(B * joint.own, B * len(joint.rows) + PARAMETERS) for joint in tree.joints]
    largest = max(c * c + r * c + r * r for c, r in sizes)
    return len(kept), 16.0 * largest, sum(c**3 / 3 + c * c * r + c * r * r for c, r in sizes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photographs", type=int, default=250_000)
    parser.add_argument("--parts", type=int, default=250)
    parser.add_argument("--per-image", type=float, default=40.0)
    parser.add_argument("--executor", default="processes:2")
    asked = parser.parse_args()
    folder, begun = asked.folder, time.perf_counter()
    counts = aerotri.simulate_parts(plan_of(asked.photographs, asked.per_image), folder / "block", parts=asked.parts)
    simulated, own = time.perf_counter() - begun, psutil.Process().memory_info().rss
    watch, begun = Watch(folder), time.perf_counter()

    def say(stage: str, _: float | None) -> None:
        print(f"| {time.perf_counter() - begun:.0f} s | {stage} |", flush=True)

    print(f"# {counts['images']} photographs, {counts['image_points']} rays in {asked.parts} parts, {asked.executor}")
    print("\n(tools/prove/parts_scale.py)\n\n| after | begun or reached |\n|---|---|")
    found = aerotri.adjust_parts(folder / "block", folder / "result", executor=asked.executor, progress=say)
    watch.end()
    print(f"| {time.perf_counter() - begun:.0f} s | {found.status}, {found.verdict}, σ0 {found.sigma0:.4f} |\n")
    shared, of_task, flops = expected(folder / "block")
    print("| what | measured | from the tree |\n|---|---|---|")
    print(f"| simulated in, s | {simulated:.0f} | |\n| memory of that, GB | {own / 1e9:.2f} | |")
    print(f"| memory together, GB | {watch.together / 1e9:.2f} | |")
    print(f"| of the largest process, GB | {watch.of_one / 1e9:.2f} | {of_task / 1e9:.2f} and the program |")
    print(f"| files, GB | {watch.files / 1e9:.1f} | |")
    print(f"| shared photographs | {shared} | |\n| multiplications of the joints, 10¹² | | {flops / 1e12:.2f} |")


if __name__ == "__main__":
    main()
