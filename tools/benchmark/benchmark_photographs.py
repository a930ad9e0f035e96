"""From photographs to a block: time by stage and tracks, with pycolmap's features, matching and mapping beside.

    python tools/benchmark/benchmark_photographs.py PHOTOGRAPHS --out DIR [--points 1000] [--focal-length-mm C
        --pixel-um P] [--no-peer]

Both begin with nothing kept, one after the other, each with its defaults and with all processors. Kernels are compiled
before (run it twice). Residuals are those of both programs in pixels of the photograph: of aerotri after `adjust`, all
rays with Huber's weights; of pycolmap's model, whose bundle adjustment has left out rays beyond 4 px.
"""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

import numpy as np

import aerotri

HEAD = """| program | features s | matching s | orientation s | together s | photographs | points | rays a photograph \
| rays a point | three or more | median residual px | 95 % below px |
|---|---|---|---|---|---|---|---|---|---|---|---|"""
STAGES = ("features of photographs", "matching pairs", "first orientation")


def timed_tying(photographs: Path, folder: Path, points: int) -> tuple[aerotri.TiedPhotographs, list[float]]:
    """The block, and seconds of features, matching and first orientation with what follows it."""
    ends: dict[str, float] = {}

    def progress(stage: str, share: float | None) -> None:
        ends[stage] = time.perf_counter()

    begun = time.perf_counter()
    tied = aerotri.tie_points(photographs, cache=folder / "cache", points=points, progress=progress)
    marks = [begun, *(ends[stage] for stage in STAGES[:2]), time.perf_counter()]
    return tied, np.diff(marks).tolist()


def tracks_of(lengths: np.ndarray, residual_px: np.ndarray, photographs: int) -> str:
    """Photographs, points, rays a photograph, rays a point, share of points with three or more, residuals."""
    return (
        f"{photographs} | {len(lengths)} | {lengths.sum() / photographs:.0f} | {lengths.mean():.2f} | "
        f"{(lengths > 2).mean():.0%} | {np.median(residual_px):.2f} | {np.percentile(residual_px, 95):.2f}"
    )


def ours(photographs: Path, folder: Path, points: int) -> tuple[list[float], str]:
    tied, seconds = timed_tying(photographs, folder, points)
    result = aerotri.adjust(tied.save(folder / "block"))
    pixel = tied.block.cameras[0].pixel_mm
    residual = np.hypot(result.rays["vx"], result.rays["vy"]) / pixel
    lengths = np.bincount(tied.block.image_points.point)
    return seconds, tracks_of(lengths[lengths > 0], residual, len(tied.block.images))


def pycolmaps(photographs: Path, folder: Path) -> tuple[list[float], str]:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    marks, database = [time.perf_counter()], folder / "database.db"
    pycolmap.extract_features(database, photographs, camera_mode=pycolmap.CameraMode.SINGLE)
    marks.append(time.perf_counter())
    pycolmap.match_exhaustive(database)
    marks.append(time.perf_counter())
    models = pycolmap.incremental_mapping(database, photographs, folder)
    marks.append(time.perf_counter())
    model = max(models.values(), key=lambda one: one.num_reg_images())
    lengths = np.array([point.track.length() for point in model.points3D.values()])
    residual = [
        np.linalg.norm(
            model.images[e.image_id].project_point(p.xyz) - model.images[e.image_id].points2D[e.point2D_idx].xy
        )
        for p in model.points3D.values()
        for e in p.track.elements
    ]
    return np.diff(marks).tolist(), tracks_of(lengths, np.array(residual), model.num_reg_images())


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("photographs", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--no-peer", action="store_true")
    arguments = parser.parse_args()
    shutil.rmtree(arguments.out, ignore_errors=True)
    arguments.out.mkdir(parents=True)
    print(HEAD)
    found = {"aerotri": ours(arguments.photographs, arguments.out, arguments.points)}
    if not arguments.no_peer:
        found["pycolmap"] = pycolmaps(arguments.photographs, arguments.out)
    for name, (seconds, tracks) in found.items():
        print(f"| {name} | " + " | ".join(f"{s:.1f}" for s in (*seconds, sum(seconds))) + f" | {tracks} |")
    if not arguments.no_peer:
        print(f"\npycolmap takes {sum(found['pycolmap'][0]) / sum(found['aerotri'][0]):.1f} times as long")


if __name__ == "__main__":
    main()
