"""A small block with photographs of it, its orientation as good as free of error."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.observations import Block
from aerotri.pipeline import adjust_keeping_system
from aerotri.rasters.images import create_image
from aerotri.results.adjustment import Adjustment
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.rendering import RenderOptions, Scene, make_scene, render
from aerotri.simulation.rendering_texture import Lattice, Texture
from aerotri.terrain.photographs import Photographs, photographs_of
from small_blocks import small_spec

CAMERA = {"preset": "ultracam_d", "size_px": [575, 375], "pixel_um": 180.0}


@dataclass(frozen=True, eq=False)
class Rendered:
    """A block whose orientation is as good as free of error, and photographs of it."""

    block: Block
    scene: Scene
    paths: tuple[Path, ...]
    calibration: Adjustment

    def truth(self, xyz: np.ndarray) -> np.ndarray:
        """(n,) m, the ground's height at the plan position of points (n, 3)."""
        return self.scene.terrain.height(xyz[:, :2])

    def photographs(self) -> Photographs:
        return photographs_of(self.calibration, np.arange(len(self.paths)), self.paths)


@dataclass(frozen=True)
class Painted(Texture):
    """A texture with something painted on it, that `paint` makes of its nodes."""

    paint: Callable[[Lattice], Lattice]

    def lattice(self, low: np.ndarray, high: np.ndarray) -> Lattice:
        return self.paint(super().lattice(low, high))


def write_photograph(path: Path, pixels: np.ndarray) -> Path:
    with create_image(path, pixels.shape[1], pixels.shape[0], 1, pixels.dtype.name) as writer:
        writer.write(0, pixels[None])
    return path


def rendered_block(
    folder: Path,
    errors: dict | None = None,
    options: RenderOptions | None = None,
    flight: dict | None = None,
    paint: Callable[[Lattice], Lattice] | None = None,
    **terrain,
) -> Rendered:
    tables = small_spec(camera={"cam": CAMERA | ({"errors": errors} if errors else {})})
    tables["flight"] = tables["flight"] | {"gsd_m": 1.0, "strips": 1, "images_per_strip": 4, "cross_strips": []}
    tables["flight"] |= flight or {}
    ground = {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 15.0, "wavelength_m": 400.0}
    tables["terrain"] = ground | terrain
    tables["tie_points"] = {"per_image": 60, "probability": 0.9, "sigma_um": 0.0, "stated_sigma_um": 0.18}
    exact = {"distance_bases": 1.0, "sigma_m": [0.0] * 3, "stated_sigma_m": [0.001] * 3, "check_points": 12}
    tables["control"] = exact
    spec = parse_spec(tables)
    block, truth = simulate(spec, 1)
    scene = make_scene(spec, 1, block, truth, options or RenderOptions())
    if paint is not None:
        scene = replace(scene, texture=Painted(scene.texture.spacing, scene.texture.seed, paint))
    folder.mkdir(exist_ok=True)
    paths = tuple(write_photograph(folder / f"{name}.tif", render(scene, k)) for k, name in enumerate(scene.names))
    return Rendered(block, scene, paths, adjust_keeping_system(block))
