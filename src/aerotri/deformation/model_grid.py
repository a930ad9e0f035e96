"""The deformation of one stereo model over a grid of nodes, on flat ground or on a DEM, in the CRS of the block."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from aerotri.conventions import InputError
from aerotri.coordinates import LocalFrame
from aerotri.deformation.model_geometry import ModelGeometry, geometry_of, normal_model
from aerotri.deformation.orientation import Orientation, row_of_image
from aerotri.deformation.photo_errors import seams_mm
from aerotri.deformation.restitution import Restitution
from aerotri.deformation.stereo_model import (
    StereoModel,
    covariance_of,
    deform_points,
    pair_model,
    regions,
    seen_by_both,
)
from aerotri.rasters.grids import RasterReader
from aerotri.results.adjustment import Adjustment

DEFAULT_NODES = 120
"""Nodes along the longer side of a model, about."""
MOST_NODES = 4_000_000
"""Of a grid with a given spacing [C]: 100 MB for every vector that a node has; a spacing in wrong units would ask for
more."""
PARTIALS_STEP_M = 50.0
"""Half the distance of a difference between CRS and local frame [C]: curvature cancels in it; a much shorter one shows
the rounding of coordinates of millions of metres, a much longer one the change of curvature."""
AROUND_FORMAT = 9
"""Points along each side of a format whose images on the ground bound a model."""
STEEPEST = 0.1
"""Smallest cosine off the nadir of a ray to a corner of the format that is taken to meet the ground."""


class Ground(Protocol):
    """Heights of the ground, in the CRS of the block. `text` says what it is."""

    @property
    def text(self) -> str: ...
    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class FlatGround:
    """A level."""

    height: float

    @property
    def text(self) -> str:
        return f"flat at {self.height:.1f} m"

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) m."""
        return np.full(np.shape(x), self.height)


@dataclass(frozen=True, eq=False)
class DemGround:
    """A DEM, read where it is needed."""

    reader: RasterReader

    @property
    def text(self) -> str:
        return f"DEM {self.reader.path.name}"

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) m at places near one another, NaN off the DEM."""
        return self.reader.sample(x, y)


@dataclass(frozen=True, eq=False)
class Deformation:
    """The deformation of a model over nodes.

    Parameters
    ----------
    title : 'pair 01_003, 01_004' or 'normal case, end lap 66.3 %'.
    variant : 'free', 'absorbed' or 'given'.
    names : of the two photographs, None for the normal case. group : parameter group of the left photograph.
    geometry : base, height, end lap.
    crs : of the coordinates; 'model' for the normal case, whose X runs along the flight.
    ground : what the heights are.
    x : (nx,) rising, y : (ny,) falling, z : (ny, nx) m.
    d : (ny, nx, 3) m, wrong − true; NaN off the model. sigma : (ny, nx, 3) m.
    parallax : (ny, nx) mm, remaining y-parallax without sign.
    region : (ny, nx) number of the pair of tiles that show a node, −1 off the model: dZ may jump between regions.
    base : (2, 2) m, plan positions of the projection centres.
    seams : lines (2, 2) m on which the tiles of the photographs meet, on the mean height of the ground.
    change : as of `Restitution`.
    """

    title: str
    variant: str
    names: tuple[str, str] | None
    group: str
    geometry: ModelGeometry
    crs: str
    ground: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    d: np.ndarray
    sigma: np.ndarray
    parallax: np.ndarray
    region: np.ndarray
    base: np.ndarray
    seams: tuple[np.ndarray, ...]
    change: str = ""

    @property
    def spacing(self) -> float:
        """m between nodes."""
        return float(self.x[1] - self.x[0])


@dataclass(frozen=True, eq=False)
class Places:
    """Between the CRS of a block and its local frame; without a frame nothing changes."""

    frame: LocalFrame | None = None

    def to_local(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) m in the local frame of coordinates in the CRS."""
        return xyz if self.frame is None else self.frame.to_local(xyz)

    def from_local(self, xyz: np.ndarray) -> np.ndarray:
        """The inverse of `to_local`."""
        return xyz if self.frame is None else self.frame.from_local(xyz)

    def axes_at(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3,) a place of the CRS in the frame, and (3, 3) frame coordinates per CRS coordinates there."""
        if self.frame is None:
            return place, np.eye(3)
        steps = PARTIALS_STEP_M * np.eye(3)
        around = self.to_local(np.concatenate([place[None], place + steps, place - steps]))
        return around[0], ((around[1:4] - around[4:]) / (2.0 * PARTIALS_STEP_M)).T

    def variances(self, xyz: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """(n, 3) m² in the CRS, at (n, 3) m in the frame, of covariances (n, 3, 3) m² there."""
        return np.diagonal(self.covariances(xyz, covariance), axis1=1, axis2=2)

    def covariances(self, xyz: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """(n, 3k, 3k) m² in the CRS, at (n, 3) m in the frame, of covariances (n, 3k, 3k) m² there.

        Of k vectors of three coordinates at a place, one behind the other.
        """
        if self.frame is None:
            return covariance
        one = self.frame.crs_per_local(xyz)
        count = covariance.shape[1] // 3
        # the same for every vector: zeros between them
        jacobian = np.einsum("kl,nij->nkilj", np.eye(count), one).reshape(covariance.shape)
        return jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)


def places_of(calibration: Adjustment) -> Places:
    """Refuses a geographic CRS, whose degrees no grid of cells in metres fits.

    Raises
    ------
    InputError
    """
    frame = calibration.frame
    if frame is not None and not frame.georeference.is_projected:
        raise InputError(
            f"the block is in {frame.crs}, in degrees", "bring it into a projected CRS, or use --end-lap"
        )  # fmt: skip
    return Places(frame)


def pair_of(restitution: Restitution, calibration: Adjustment, left: str, right: str) -> StereoModel:
    """The model of two photographs of the block, by their names.

    Raises
    ------
    InputError
        When the block has no such photograph, or it is not oriented.
    """
    rows = []
    for name in (left, right):
        row = row_of_image(calibration.local.block, name)
        if row < 0:
            raise InputError(f"the block has no photograph '{name}'", "name two photographs of images.csv")
        if not (restitution.true.known & restitution.used.known)[row]:
            raise InputError(f"photograph '{name}' is not oriented", "name two photographs that are")
        rows.append(row)
    if left == right:
        raise InputError(f"'{left}' is named twice", "a model needs two photographs")
    return pair_model(restitution, (left, right), (rows[0], rows[1]))


def mean_ground(calibration: Adjustment) -> float:
    """Median height of the object points, in the CRS of the block."""
    return float(np.nanmedian(calibration.result.points.xyz[:, 2]))


def deform_pair(
    calibration: Adjustment,
    restitution: Restitution,
    names: tuple[str, str],
    ground: Ground,
    spacing: float | None = None,
) -> Deformation:
    """The deformation of a pair of the block as flown.

    Parameters
    ----------
    ground : heights in the CRS of the block. spacing : m between nodes; about 120 along the longer side unless given.

    Raises
    ------
    InputError
        When the photographs do not overlap.
    """
    places, model = places_of(calibration), pair_of(restitution, calibration, *names)
    level = _level(calibration, places, model)
    low, high = _overlap(places, model, level)
    if not (high > low).all():
        raise InputError(f"'{names[0]}' and '{names[1]}' do not overlap", "name neighbours")
    x, y = nodes_between(low, high, spacing)
    z = np.stack([ground.heights(x, np.full(len(x), value)) for value in y])
    centre = places.from_local(model.true.centre)
    return _on_nodes(
        model, places, x, y, z, title=f"pair {names[0]}, {names[1]}", variant=restitution.variant,
        change=restitution.change, names=names,
        geometry=geometry_of(model, _local_level(places, centre, level)), crs=calibration.result.block.crs,
        ground=ground.text, base=centre[:, :2], seams=_seams(places, model, level),
    )  # fmt: skip


def deform_normal_case(
    calibration: Adjustment,
    restitution: Restitution,
    end_lap: float,
    spacing: float | None = None,
    group: str | None = None,
    gsd: float | None = None,
) -> Deformation:
    """The deformation of the normal-case model at an end lap, over its flat ground; see `model_geometry`."""
    model, geometry = normal_model(calibration, restitution, end_lap, group, gsd)
    low, high = _overlap(Places(), model, 0.0)
    x, y = nodes_between(low, high, spacing)
    return _on_nodes(
        model, Places(), x, y, np.zeros((len(y), len(x))), title=f"normal case, end lap {100.0 * end_lap:.1f} %",
        variant=restitution.variant, change=restitution.change, names=None, geometry=geometry, crs="model",
        ground="flat",
        base=model.true.centre[:, :2], seams=_seams(Places(), model, 0.0),
    )  # fmt: skip


def nodes_between(low: np.ndarray, high: np.ndarray, spacing: float | None) -> tuple[np.ndarray, np.ndarray]:
    """x rising and y falling, whole multiples of the spacing, two at least of each.

    Raises
    ------
    InputError
        For a spacing that is none, or that gives more nodes than can be held.
    """
    if spacing is None:
        spacing = _round_length(float((high - low).max()) / DEFAULT_NODES)
    if not spacing > 0.0:
        raise InputError(f"a spacing of {spacing:g} m is not possible", "give metres greater than 0")
    first, last = np.floor(low / spacing), np.ceil(high / spacing)
    count = np.maximum(last - first, 1.0) + 1.0
    if count.prod() > MOST_NODES:
        raise InputError(
            f"a spacing of {spacing:g} m gives {count.prod():.0f} nodes, more than {MOST_NODES}",
            "give a larger spacing",
        )
    x = (first[0] + np.arange(count[0])) * spacing
    y = (first[1] + np.arange(count[1])) * spacing
    return x, y[::-1]


def grid_points(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """(ny·nx, 3) the nodes row by row."""
    grid_x, grid_y = np.meshgrid(x, y)
    return np.column_stack([grid_x.ravel(), grid_y.ravel(), z.ravel()])


def deform_places(model: StereoModel, places: Places, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Deformation (n, 3) m, its σ (n, 3) m and y-parallax (n,) mm at places (n, 3) in the CRS."""
    local = places.to_local(xyz)
    known = np.flatnonzero(np.isfinite(local).all(axis=1))
    d, sigma, parallax = np.full(xyz.shape, np.nan), np.full(xyz.shape, np.nan), np.full(len(xyz), np.nan)
    found = deform_points(model, local[known])
    wrong = places.from_local(local[known] + found.d)
    d[known] = wrong - places.from_local(local[known])
    parallax[known] = found.parallax
    variance = places.variances(local[known], covariance_of(model, local[known]))
    sigma[known] = np.sqrt(np.maximum(variance, 0.0))
    return d, sigma, parallax


def _on_nodes(
    model: StereoModel, places: Places, x: np.ndarray, y: np.ndarray, z: np.ndarray, **described: Any
) -> Deformation:
    d, sigma, parallax = deform_places(model, places, grid_points(x, y, z))
    if not np.isfinite(d).any():
        raise InputError("no node of the grid lies in the model", "give a smaller spacing, or a DEM that covers it")
    known = np.isfinite(z.ravel())
    region = np.full(z.size, -1)
    region[known] = regions(model, places.to_local(grid_points(x, y, z)[known]))
    return Deformation(
        x=x, y=y, z=z, d=d.reshape(*z.shape, 3), sigma=sigma.reshape(*z.shape, 3), parallax=parallax.reshape(z.shape),
        region=region.reshape(z.shape), group=model.errors[0].function.group, **described,
    )  # fmt: skip


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= length * (1.0 + 1e-9)) * power)


def _level(calibration: Adjustment, places: Places, model: StereoModel) -> float:
    """Median height, in the CRS, of the object points that both photographs see; of all where they see none."""
    xyz = calibration.local.points.xyz
    known = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    seen = known[seen_by_both(model, xyz[known])]
    return float(np.median(calibration.result.points.xyz[seen if len(seen) else known, 2]))


def _local_level(places: Places, centre: np.ndarray, level: float) -> float:
    """Height in the local frame of the ground below the model."""
    middle = centre.mean(axis=0)
    return float(places.to_local(np.array([[middle[0], middle[1], level]]))[0, 2])


def _overlap(places: Places, model: StereoModel, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (2,) of the rectangle that bounds the overlap on level ground."""
    lows, highs = [], []
    for k, errors in enumerate(model.errors):
        half = np.array(errors.camera.half_format_mm)
        t = np.linspace(-1.0, 1.0, AROUND_FORMAT)
        one = np.ones_like(t)
        edge = np.concatenate([np.column_stack(side) for side in ((t, one), (t, -one), (one, t), (-one, t))])
        on_ground = _to_ground(places, model.true, k, edge * half, level)[:, :2]
        lows.append(np.nanmin(on_ground, axis=0))
        highs.append(np.nanmax(on_ground, axis=0))
    return np.max(lows, axis=0), np.min(highs, axis=0)


def _to_ground(places: Places, orientation: Orientation, k: int, xy: np.ndarray, level: float) -> np.ndarray:
    """(n, 3) in the CRS, where rays through image positions (n, 2) mm meet level ground; NaN near the horizon."""
    centre, (c, x0, y0) = orientation.centre[k], orientation.interior[k]
    ray = np.column_stack([xy - (x0, y0), np.full(len(xy), -c)]) @ orientation.rotation[k].T
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    ground = _local_level(places, places.from_local(centre[None]), level)
    down = np.where(-ray[:, 2] > STEEPEST, -ray[:, 2], np.nan)
    return places.from_local(centre + ray * ((centre[2] - ground) / down)[:, None])


def _seams(places: Places, model: StereoModel, level: float) -> tuple[np.ndarray, ...]:
    """Lines of the seams of both photographs on level ground, (2, 2) each."""
    lines = []
    for k, errors in enumerate(model.errors):
        half = errors.camera.half_format_mm
        x_seams, y_seams = seams_mm(errors.camera)
        ends = [[[x, -half[1]], [x, half[1]]] for x in x_seams] + [[[-half[0], y], [half[0], y]] for y in y_seams]
        lines += [_to_ground(places, model.true, k, np.array(line), level)[:, :2] for line in ends]
    return tuple(line for line in lines if np.isfinite(line).all())
