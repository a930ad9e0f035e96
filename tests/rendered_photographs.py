"""Photographs of a small simulated block, and the lists a surveyor gives beside them, in any order, names and frame."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import px_from_mm
from aerotri.observations import Block
from aerotri.rasters.images import create_image
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.rendering import RenderOptions, make_scene, render

COLUMNS, ROWS = 400, 300
SPEC = {
    "name": "rendered",
    "camera": {"cam": {"size_px": [COLUMNS, ROWS], "pixel_um": 14.4, "focal_length_mm": 6.0}},
    "flight": {"gsd_m": 0.24, "strips": 2, "images_per_strip": 3, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
               "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [2.0, 2.0, 2.0]},
    "terrain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 5.0, "wavelength_m": 120.0},
    "tie_points": {"per_image": 20, "probability": 0.9, "sigma_um": 1.5},
    "control": {"distance_bases": 1.0, "sigma_m": [0.02, 0.02, 0.03], "check_points": 8},
}  # fmt: skip
POSITION_SIGMA_M = 0.5
Frame = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Flown:
    """Photographs in a folder, called as in the block with '.tif' behind, and the block they are of."""

    photographs: Path
    block: Block
    positions: np.ndarray

    def files(self) -> list[str]:
        return [f"{name}.tif" for name in self.block.images.names.tolist()]

    def check_points(self) -> tuple[str, ...]:
        control = self.block.control
        return tuple(self.block.points[control.point[control.is_check]].tolist())

    def control_points(self) -> list[str]:
        return self.block.points[self.block.control.point].tolist()


def fly(folder: Path, seed: int = 3, **changes) -> Flown:
    """Simulate and render; positions of the photographs are those of the truth, half a metre off."""
    spec = parse_spec(SPEC | changes)
    block, truth = simulate(spec, seed)
    columns, rows = block.cameras[0].size_px
    scene = make_scene(spec, seed, block, truth, RenderOptions())
    folder.mkdir()
    for number, name in enumerate(block.images.names.tolist()):
        with create_image(folder / f"{name}.tif", columns, rows, 1, "uint16") as writer:
            writer.write(0, render(scene, number)[None])
    off = np.random.default_rng(seed).normal(0.0, POSITION_SIGMA_M, (len(block.images), 3))
    return Flown(folder, block, truth.centre + off)


def _as_it_is(xyz: np.ndarray) -> np.ndarray:
    return xyz


@dataclass(frozen=True, eq=False)
class Lists:
    """How lists are written.

    Parameters
    ----------
    names : new names of files and points by the old ones. crs : first line of gcp_list.txt. frame : of (n, 3)
        coordinates. scale : of their standard deviations. seed : of the order of the rows; None: as they are.
    """

    names: dict[str, str]
    crs: str = "+proj=local"
    frame: Frame = _as_it_is
    scale: float = 1.0
    seed: int | None = None

    def name(self, old: str) -> str:
        return self.names.get(old, old)

    def ordered(self, rows: list[str]) -> list[str]:
        order = np.arange(len(rows)) if self.seed is None else np.random.default_rng(self.seed).permutation(len(rows))
        return [rows[k] for k in order]


def copy_photographs(flown: Flown, folder: Path, lists: Lists) -> Path:
    """The files under their new names, which may have folders; their times too, so that what is kept is theirs."""
    for file in flown.files():
        target = folder / lists.name(file)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(flown.photographs / file, target)
    return folder


def write_gcp_list(flown: Flown, path: Path, lists: Lists) -> Path:
    """Control points with their image points, ODM's gcp_list.txt."""
    block, rays = flown.block, flown.block.image_points
    xyz = dict(zip(block.control.point.tolist(), lists.frame(block.control.xyz), strict=True))
    rows, camera = [], block.cameras[0]
    for image, point, xy in zip(rays.image.tolist(), rays.point.tolist(), rays.xy, strict=True):
        if point in xyz:
            column, row = px_from_mm(xy[None], camera.size_px, camera.pixel_mm)[0] - 0.5
            place = " ".join(repr(float(value)) for value in xyz[point])
            file, name = lists.name(f"{block.images.names[image]}.tif"), lists.name(str(block.points[point]))
            rows.append(f'{place} {column:.3f} {row:.3f} "{file}" "{name}"')
    path.write_text("\n".join([lists.crs, *lists.ordered(rows)]) + "\n", encoding="utf-8")
    return path


def write_positions(flown: Flown, path: Path, lists: Lists, columns: str = "X,Y,Z") -> Path:
    """Positions of the photographs with their standard deviations."""
    sigma = ",".join([repr(lists.scale * POSITION_SIGMA_M)] * 3)
    rows = [
        f"{lists.name(file)},{','.join(repr(float(value)) for value in xyz)},{sigma}"
        for file, xyz in zip(flown.files(), lists.frame(flown.positions), strict=True)
    ]
    path.write_text("\n".join([f"image,{columns},sX,sY,sZ", *lists.ordered(rows)]) + "\n", encoding="utf-8")
    return path
