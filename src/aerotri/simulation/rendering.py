"""Photographs of the simulated ground through the true, erring camera.

Every pixel is followed backwards: measured position m → ideal = m − d(m) within the tile that recorded it → ray through
the true camera → terrain, by fixed point → texture. Ground positions are computed exactly at nodes a few pixels apart
inside each tile, and are linear between them (see `image_errors.tile_grid`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import ndtr

from aerotri.adjustment.parallel import thread_count
from aerotri.conventions import InputError, mm_from_px, px_from_mm
from aerotri.functional_model.additional_parameters.lens import undistort
from aerotri.image_errors.tile_grid import Tile, TileGrid, sample, seams_px, tiles_of
from aerotri.observations import Block
from aerotri.simulation import _rendering_kernels as kernels
from aerotri.simulation.camera_errors import ImageError
from aerotri.simulation.cameras import true_camera
from aerotri.simulation.flight import flying_height
from aerotri.simulation.projection import Photographs, Rays, TrueCamera, measured_rays, project
from aerotri.simulation.random_streams import stream
from aerotri.simulation.rendering_texture import Texture
from aerotri.simulation.simulate import true_image_errors
from aerotri.simulation.spec import SimulationSpec
from aerotri.simulation.terrain import Terrain, make_terrain
from aerotri.simulation.truth import Truth

BAND_ROWS, CHUNK_COLUMNS = 256, 1024
"""Rows rendered at a time and written, and columns of a piece; chosen [C]: a piece in 32 bit numbers, 1 MB, stays in
the cache."""
WHITE = 65535.0
"""Largest grey value of 16 bits."""
BLUR_REACH = 4.0
"""Where the blur is cut off, in its σ: 4 as in scipy, beyond which lies 0.006 % of it."""
TARGET_EDGE_PX = 0.7
"""σ of the edge of a disc, so that its sampling by pixels leaves its centroid alone."""
RAY_TOLERANCE_M, RAY_ITERATIONS = 1e-5, 100
"""Height, m, to which a ray meets the ground, and most steps; chosen [C]: 0.01 mm is far below a pixel on the ground; a
hundred steps do not suffice only where the ground is nearly as steep as the ray, or a lens bends too much."""
STEP_M = 0.5
"""In plan, by which rays are followed where houses hide what is behind them."""
Report = Callable[[float], None]


@dataclass(frozen=True)
class RenderOptions:
    """How photographs look.

    Parameters
    ----------
    mean : grey value. contrast : RMS of the texture over the mean.
    detail_px : nodes of the finest texture are this far apart, pixels of the mean scale.
    blur_px : σ of the Gaussian point spread, pixels. noise : σ of the grey values.
    targets : whether control and check points are signalised by bright discs on the ground.
    target_radius_px, target_level : of the discs, pixels of the mean scale and grey value.
    """

    mean: float = 16000.0
    contrast: float = 0.25
    detail_px: float = 2.0
    blur_px: float = 0.5
    noise: float = 50.0
    targets: bool = False
    target_radius_px: float = 3.0
    target_level: float = 60000.0


@dataclass(frozen=True, eq=False)
class Scene:
    """What photographs are made of.

    Parameters
    ----------
    names : (n,) str of the photographs. photographs : their true orientation and cameras.
    fields : (n,) the image error of each.
    terrain, texture : the ground; gsd_m : of the mean scale. targets : (k, 3) m.
    seed : of the noise.
    """

    names: np.ndarray
    photographs: Photographs
    fields: tuple[ImageError, ...]
    terrain: Terrain
    texture: Texture
    gsd_m: float
    targets: np.ndarray
    options: RenderOptions
    seed: int

    def camera(self, image: int) -> TrueCamera:
        return self.photographs.cameras[self.photographs.camera[image]]


def make_scene(
    spec: SimulationSpec, seed: int, block: Block, truth: Truth, options: RenderOptions | None = None
) -> Scene:
    """The scene behind a simulated block.

    Parameters
    ----------
    spec, seed : the block was simulated from. block, truth : what `simulate` gave.
    """
    options = RenderOptions() if options is None else options
    cameras = tuple(true_camera(name, camera) for name, camera in spec.camera.items())
    images = block.images
    day = images.columns["day"] if spec.flight.days else np.full(len(images), "")
    fields = true_image_errors(spec, seed)
    first = cameras[images.camera[0]].nominal
    gsd = flying_height(spec.flight, first) * first.pixel_mm / first.focal_length_mm
    return Scene(
        names=images.names,
        photographs=Photographs.of(truth.centre, truth.angles, block.rotation, images.camera, cameras, truth.motion),
        fields=tuple(fields[block.cameras[c].name, str(d)] for c, d in zip(images.camera, day, strict=True)),
        terrain=make_terrain(spec.terrain, spec.flight.centre_m, stream(seed, "terrain")),
        texture=Texture(options.detail_px * gsd, seed),
        gsd_m=gsd,
        targets=truth.points[block.control.point] if options.targets else np.zeros((0, 3)),
        options=options,
        seed=seed,
    )


def render(scene: Scene, image: int, report: Report | None = None) -> np.ndarray:
    """(rows, columns) uint16, the photograph of number `image`."""
    return np.concatenate([rows for _, rows in rendered_rows(scene, image, report)])


def rendered_rows(scene: Scene, image: int, report: Report | None = None) -> Iterator[tuple[int, np.ndarray]]:
    """The photograph from its top as (first row, (rows, columns) uint16), made in threads some hundred rows at a time.

    Parameters
    ----------
    report : called with the share that is done.

    Raises
    ------
    InputError
        Where a ray meets no ground, or the terrain is too steep for what the ray sees to be followed.
    """
    rows = scene.camera(image).nominal.size_px[1]
    threads = thread_count()
    with ThreadPoolExecutor(threads) as pool:
        view = _view(scene, image, pool)
        starts = list(range(0, rows, BAND_ROWS))
        # a few at a time: what is not taken away yet is kept
        for place in range(0, len(starts), threads):
            group = starts[place : place + threads]
            for first, band in zip(group, pool.map(view.band, group), strict=True):
                yield first, band
                if report is not None:
                    report((first + len(band)) / rows)


@dataclass(frozen=True, eq=False)
class _View:
    """One photograph: ground position of its pixels by tile, and where its targets lie (k, 2) px."""

    scene: Scene
    image: int
    tiles: tuple[tuple[TileGrid, ...], ...]
    columns: list[tuple[int, int]]
    rows: list[tuple[int, int]]
    targets: np.ndarray
    target_places: np.ndarray

    def band(self, first: int) -> np.ndarray:
        """(rows, columns) uint16 of the next `BAND_ROWS` rows."""
        last = min(first + BAND_ROWS, self.rows[-1][1])
        grey = np.empty((last - first, self.columns[-1][1]), np.float32)
        for grids, (top, bottom) in zip(self.tiles, self.rows, strict=True):
            rows = max(top, first), min(bottom, last)
            if rows[0] >= rows[1]:
                continue
            for grid, (left, right) in zip(grids, self.columns, strict=True):
                for start in range(left, right, CHUNK_COLUMNS):
                    columns = start, min(start + CHUNK_COLUMNS, right)
                    grey[rows[0] - first : rows[1] - first, slice(*columns)] = self._piece(grid, rows, columns)
        options = self.scene.options
        if options.noise:
            rng = stream(self.scene.seed, "render", str(self.scene.names[self.image]), str(first))
            grey += np.float32(options.noise) * rng.standard_normal(grey.shape, np.float32)
        return np.clip(np.rint(grey), 0.0, WHITE).astype(np.uint16)

    def _piece(self, grid: TileGrid, rows: tuple[int, int], columns: tuple[int, int]) -> np.ndarray:
        """Grey values of one tile, the blur taken within it: the seams are cut after the lens."""
        options = self.scene.options
        halo = _halo(options)
        row, column = rows[0] - halo, columns[0] - halo
        size = rows[1] - rows[0] + 2 * halo, columns[1] - columns[0] + 2 * halo
        lattice = self.scene.texture.lattice(*grid.bounds((row, row + size[0] - 1), (column, column + size[1] - 1)))
        out = np.empty(size, np.float32)
        kernels.texture_of_pixels(
            kernels.LatticeArrays(lattice.values, lattice.row, lattice.column, lattice.spacing),
            kernels.PixelPlaces(grid.nodes, np.array([grid.row, grid.column]), grid.step), (row, column), out,
        )  # fmt: skip
        out = np.float32(options.mean) * (1.0 + np.float32(options.contrast) * out)
        self._signalise(grid, row, column, out)
        if not halo:
            return out
        from scipy.ndimage import gaussian_filter

        return gaussian_filter(out, options.blur_px, truncate=BLUR_REACH)[halo:-halo, halo:-halo]

    def _signalise(self, grid: TileGrid, row: int, column: int, out: np.ndarray) -> None:
        """Draw the discs that reach into a piece."""
        options, gsd = self.scene.options, self.scene.gsd_m
        radius = options.target_radius_px * gsd
        reach = int(np.ceil(3.0 * options.target_radius_px)) + 4
        for target, place in zip(self.targets, self.target_places, strict=True):
            r, c = np.floor(place[::-1]).astype(int) - (row, column)
            part = slice(max(r - reach, 0), max(r + reach, 0)), slice(max(c - reach, 0), max(c + reach, 0))
            view = out[part]
            if view.size:
                i, j = np.indices(view.shape).reshape(2, -1)
                ground = grid.at((i + part[0].start + row).astype(float), (j + part[1].start + column).astype(float))
                inside = (radius - np.hypot(*(ground - target[:2]).T)) / (TARGET_EDGE_PX * gsd)
                share = ndtr(inside).reshape(view.shape).astype(np.float32)
                view += share * (np.float32(options.target_level) - view)


def _halo(options: RenderOptions) -> int:
    return int(BLUR_REACH * options.blur_px + 0.5) if options.blur_px else 0


def _view(scene: Scene, image: int, pool: ThreadPoolExecutor) -> _View:
    camera = scene.camera(image).nominal
    tiles, halo = tiles_of(camera), _halo(scene.options)
    columns, rows = (_pixel_ranges(seams, count) for seams, count in zip(seams_px(camera), camera.size_px, strict=True))
    places = [(i, j) for i in range(len(rows)) for j in range(len(columns))]

    def one(place: tuple[int, int]) -> TileGrid:
        (top, bottom), (left, right) = rows[place[0]], columns[place[1]]
        function = _ground_function(scene, image, tiles[place[0]][place[1]])
        return sample(function, (top - halo, bottom + halo), (left - halo, right + halo), scene.gsd_m)

    grids = list(pool.map(one, places))
    lines = tuple(tuple(grids[i * len(columns) : (i + 1) * len(columns)]) for i in range(len(rows)))
    return _View(scene, image, lines, columns, rows, *_targets_seen(scene, image))


def _pixel_ranges(seams: np.ndarray, count: int) -> list[tuple[int, int]]:
    """First pixel of every tile and the one after its last, by the centres of the pixels."""
    edges = [0, *np.ceil(seams - 0.5).astype(int).tolist(), count]
    return list(pairwise(edges))


def _targets_seen(scene: Scene, image: int) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3) m, and (k, 2) px where they lie in the photograph, which need not be inside."""
    targets = scene.targets
    if not len(targets):
        return targets, np.zeros((0, 2))
    index = np.arange(len(targets))
    ideal = project(scene.photographs, targets, np.full(len(targets), image), index)
    camera = scene.camera(image).nominal
    ahead = (np.abs(ideal) < 1.1 * np.array(camera.half_format_mm)).all(axis=1)
    seen = Rays(np.full(int(ahead.sum()), image), index[ahead], ideal[ahead])
    measured, _ = measured_rays(scene.photographs, targets, seen, scene.fields[image])
    return targets[ahead], px_from_mm(measured, camera.size_px, camera.pixel_mm)


def _ground_function(scene: Scene, image: int, tile: Tile) -> Callable[[np.ndarray], np.ndarray]:
    """Plan position (n, 2) m of what the pixel positions (n, 2) of a tile show."""
    true, field, photographs = scene.camera(image), scene.fields[image], scene.photographs
    camera = true.nominal
    low, high = tile.bounds_mm(camera)

    def ground(column_row: np.ndarray) -> np.ndarray:
        measured = mm_from_px(column_row, camera.size_px, camera.pixel_mm)
        ideal = measured - field(*np.clip(measured, low, high).T)
        direction = undistort((ideal - (true.x0, true.y0)) / true.focal_length, true.lens)
        if np.isnan(direction).any():
            name = scene.names[image]
            raise InputError(f"photograph '{name}' has pixels without a direction", "take a longer focal length")
        centre, rotation = photographs.during_readout(np.full(len(measured), image), measured)
        ray = np.einsum("nij,nj->ni", rotation, np.column_stack([direction, -np.ones(len(direction))]))
        return _on_terrain(scene, image, centre, ray)

    return ground


def _on_terrain(scene: Scene, image: int, centre: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """(n, 2) X, Y where rays (n, 3) of a photograph from their centres (n, 3) meet the terrain.

    Raises
    ------
    InputError
    """
    name = scene.names[image]
    if (ray[:, 2] >= 0.0).any():
        raise InputError(f"photograph '{name}' looks over the horizon", "tilt it less to have it rendered")
    slope = ray[:, :2] / ray[:, 2:]
    if len(scene.terrain.houses):
        return _first_met(scene.terrain, centre, slope)
    height = np.full(len(ray), scene.terrain.base)
    active = np.arange(len(ray))
    for _ in range(RAY_ITERATIONS):
        plan = centre[active, :2] + (height[active] - centre[active, 2])[:, None] * slope[active]
        new = scene.terrain.height(plan)
        change = np.abs(new - height[active])
        height[active] = new
        active = active[change > RAY_TOLERANCE_M]
        if not len(active):
            return centre[:, :2] + (height - centre[:, 2])[:, None] * slope
    raise InputError(f"the terrain hides itself in photograph '{name}'", "render flatter terrain, or tilt less")


def _first_met(terrain: Terrain, centre: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """(n, 2) X, Y where rays first meet ground, wall or roof: downwards step by step, then by halving the last step.

    slope : (n, 2) change of X and Y with the height.
    """

    def plan(height: np.ndarray, which: np.ndarray | slice = np.s_[:]) -> np.ndarray:
        return centre[which, :2] + (height - centre[which, 2])[:, None] * slope[which]

    low, high = terrain.reach
    steps = int((high - low) * float(np.hypot(*slope.T).max(initial=0.0)) / STEP_M) + 1
    above, below = np.full(len(slope), high), np.full(len(slope), low)
    active = np.arange(len(slope))
    for height in np.linspace(high, low, steps + 1)[1:]:
        at = np.full(len(active), height)
        met = terrain.height(plan(at, active)) >= height
        below[active[met]] = height
        active = active[~met]
        above[active] = height
    for _ in range(int(np.log2(max((high - low) / steps, RAY_TOLERANCE_M) / RAY_TOLERANCE_M)) + 1):
        middle = 0.5 * (above + below)
        met = terrain.height(plan(middle)) >= middle
        above, below = np.where(met, above, middle), np.where(met, middle, below)
    return plan(0.5 * (above + below))
