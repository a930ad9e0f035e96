"""From photographs to a block: time by stage and tracks, with pycolmap's features, matching and mapping beside.

    python tools/benchmark/benchmark_photographs.py PHOTOGRAPHS --out DIR [--gcp LIST] [--spatial] [--no-peer]

Both begin with nothing kept, one after the other, each with its defaults and with all processors. Kernels are compiled
before (run it twice). Residuals are those of both programs in pixels of the photograph: of aerotri after `adjust`, all
rays with Huber's weights; of pycolmap's model, whose bundle adjustment has left out rays beyond 4 px.

With --spatial pycolmap matches photographs near one another by the positions of EXIF, in place of all pairs.

With --gcp both blocks are free of control (aerotri has the positions of EXIF), control points are intersected, and a
similarity brings those called C… onto their coordinates; what is left at those called K… is the check.
"""

from __future__ import annotations

import argparse
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import aerotri

HEAD = """| program | features s | matching s | orientation s | together s | of the processor s | photographs | points \
| rays a photograph | rays a point | three or more | median residual px | 95 % below px | check RMS X Y Z m |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"""
STAGES = ("features of photographs", "matching pairs")
FIRST_PIXEL = 0.5
"""Of gcp_list.txt, which counts from the centre of the first pixel."""


@dataclass(frozen=True, eq=False)
class Marks:
    """Control points and where they are measured: xyz by name, and (photograph, column, row) by name."""

    path: Path
    xyz: dict[str, np.ndarray]
    rays: dict[str, list[tuple[str, float, float]]]


@dataclass(frozen=True, eq=False)
class Found:
    """What a program made: (k, 2) seconds of the clock and of the processor, tracks, and intersected control points."""

    seconds: np.ndarray
    tracks: str
    xyz: dict[str, np.ndarray]


def read_marks(path: Path | None) -> Marks | None:
    if path is None:
        return None
    xyz: dict[str, np.ndarray] = {}
    rays: dict[str, list[tuple[str, float, float]]] = {}
    for line in path.read_text().splitlines()[1:]:
        *numbers, image, name = line.split()
        xyz[name] = np.array(numbers[:3], float)
        rays.setdefault(name, []).append((image, float(numbers[3]) + FIRST_PIXEL, float(numbers[4]) + FIRST_PIXEL))
    return Marks(path, xyz, rays)


def now() -> tuple[float, float]:
    return time.perf_counter(), time.process_time()


def tracks_of(lengths: np.ndarray, residual_px: np.ndarray, photographs: int) -> str:
    """Photographs, points, rays a photograph, rays a point, share of points with three or more, residuals."""
    return (
        f"{photographs} | {len(lengths)} | {lengths.sum() / photographs:.0f} | {lengths.mean():.2f} | "
        f"{(lengths > 2).mean():.0%} | {np.median(residual_px):.2f} | {np.percentile(residual_px, 95):.2f}"
    )


def ours(photographs: Path, folder: Path, points: int, marks: Marks | None) -> Found:
    ends: dict[str, tuple[float, float]] = {}

    def progress(stage: str, share: float | None) -> None:
        ends[stage] = now()

    control: dict[str, Any] = {}
    if marks is not None:
        control = {"control": marks.path, "check": tuple(marks.xyz), "control_sigma_m": (0.01, 0.01, 0.02)}
    begun = now()
    tied = aerotri.tie_points(photographs, cache=folder / "cache", points=points, progress=progress, **control)
    times = np.diff([begun, *(ends[stage] for stage in STAGES), now()], axis=0)
    result = aerotri.adjust(tied.save(folder / "block"))
    ties = ~np.isin(result.rays["point"], list(marks.xyz) if marks else [])
    residual = np.hypot(result.rays["vx"], result.rays["vy"])[ties] / tied.block.cameras[0].pixel_mm
    lengths = np.unique(result.rays["point"][ties], return_counts=True)[1]
    xyz = {}
    if marks is not None:
        off = np.column_stack([result.check[f"d{axis}"] for axis in "XYZ"])
        xyz = {name: marks.xyz[name] + d for name, d in zip(result.check["point"].tolist(), off, strict=True)}
    return Found(times, tracks_of(lengths, residual, len(tied.block.images)), xyz)


def pycolmaps(photographs: Path, folder: Path, marks: Marks | None, spatial: bool) -> Found:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    times, database = [now()], folder / "database.db"
    pycolmap.extract_features(database, photographs, camera_mode=pycolmap.CameraMode.SINGLE)
    times.append(now())
    match = pycolmap.match_spatial if spatial else pycolmap.match_exhaustive
    match(database)
    times.append(now())
    models = pycolmap.incremental_mapping(database, photographs, folder)
    times.append(now())
    model = max(models.values(), key=lambda one: one.num_reg_images())
    lengths = np.array([point.track.length() for point in model.points3D.values()])
    residual = [
        np.linalg.norm(
            model.images[e.image_id].project_point(p.xyz) - model.images[e.image_id].points2D[e.point2D_idx].xy
        )
        for p in model.points3D.values()
        for e in p.track.elements
    ]
    xyz = {} if marks is None else intersected(model, marks)
    return Found(np.diff(times, axis=0), tracks_of(lengths, np.array(residual), model.num_reg_images()), xyz)


def intersected(model: Any, marks: Marks) -> dict[str, np.ndarray]:
    """The points nearest to their rays, of those with two or more."""
    images = {image.name: image for image in model.images.values() if image.has_pose}
    found = {}
    for name, rays in marks.rays.items():
        normal, right, count = np.zeros((3, 3)), np.zeros(3), 0
        for image, column, row in rays:
            if image not in images:
                continue
            pose = images[image].cam_from_world().matrix()
            place = model.cameras[images[image].camera_id].cam_from_img(np.array([column, row]))
            direction = pose[:, :3].T @ np.array([*place, 1.0])
            across = np.eye(3) - np.outer(direction, direction) / (direction @ direction)
            normal, right, count = normal + across, right - across @ pose[:, :3].T @ pose[:, 3], count + 1
        if count > 1:
            found[name] = np.linalg.solve(normal, right)
    return found


def check(found: dict[str, np.ndarray], marks: Marks | None) -> str:
    """RMS of what is left at check points, X Y Z m."""
    if marks is None:
        return "–"
    control = sorted(name for name in found if name.startswith("C"))
    others = sorted(name for name in found if name.startswith("K"))
    source, target = (np.array([xyz[name] for name in (*control, *others)]) for xyz in (found, marks.xyz))
    held = slice(0, len(control))
    one, other = source - source[held].mean(axis=0), target - target[held].mean(axis=0)
    turned = Rotation.align_vectors(other[held], one[held])[0].apply(one)
    scale = (turned[held] * other[held]).sum() / (turned[held] ** 2).sum()
    left = (scale * turned - other)[len(control) :]
    return " ".join(f"{value:.4f}" for value in np.sqrt((left**2).mean(axis=0)))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("photographs", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--gcp", type=Path)
    parser.add_argument("--spatial", action="store_true")
    parser.add_argument("--no-peer", action="store_true")
    arguments = parser.parse_args()
    shutil.rmtree(arguments.out, ignore_errors=True)
    arguments.out.mkdir(parents=True)
    marks = read_marks(arguments.gcp)
    found = {"aerotri": ours(arguments.photographs, arguments.out, arguments.points, marks)}
    if not arguments.no_peer:
        found["pycolmap"] = pycolmaps(arguments.photographs, arguments.out, marks, arguments.spatial)
    print(HEAD)
    for name, one in found.items():
        clock, processor = one.seconds.T
        said = " | ".join(f"{s:.1f}" for s in (*clock, clock.sum(), processor.sum()))
        print(f"| {name} | {said} | {one.tracks} | {check(one.xyz, marks)} |")
    if not arguments.no_peer:
        clock, processor = (found["pycolmap"].seconds.sum(axis=0) / found["aerotri"].seconds.sum(axis=0)).tolist()
        print(f"\npycolmap takes {clock:.1f} times as long, {processor:.1f} times of the processor")


if __name__ == "__main__":
    main()
