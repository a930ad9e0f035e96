"""Averaged residuals of groups of rays on a grid over the image, against those of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from moving.flights import Flight

CELLS = 12, 8
FEWEST = 20


@dataclass(frozen=True, eq=False)
class CellTest:
    """A grouping of rays, G groups.

    Parameters
    ----------
    name : of the grouping. mean : (G, ny, nx, 2) µm, mean of a group − mean of all; sigma : of it.
    chi2, freedom : sum of squares of both coordinates over σ², all groups. rms_um : of the differences, the
        noise taken off (negative where there is less than noise).
    """

    name: str
    mean: np.ndarray
    sigma: np.ndarray
    chi2: float
    freedom: int
    rms_um: float

    @property
    def p(self) -> float:
        return float(chi2.sf(self.chi2, self.freedom))


def cell_of(flight: Flight) -> np.ndarray:
    """(m,) number of the cell of every ray."""
    block = flight.adjusted.block
    half = np.array([c.half_format_mm for c in block.cameras])[block.images.camera[block.image_points.image]]
    at = (block.image_points.xy + half) / (2.0 * half)
    column = np.clip((at[:, 0] * CELLS[0]).astype(np.int64), 0, CELLS[0] - 1)
    row = np.clip((at[:, 1] * CELLS[1]).astype(np.int64), 0, CELLS[1] - 1)
    return row * CELLS[0] + column


def cell_test(flight: Flight, name: str, label: np.ndarray) -> CellTest:
    """Groups by a label (m,) of every ray, −1 for none.

    σ of a mean is that of the residuals within cells (the redundancy numbers stand in the residuals), over the root
    of their number. Where a cell of a group has too few rays it counts as nothing.
    """
    used = flight.used & (label >= 0)
    u, cell, group = flight.remaining[used], cell_of(flight)[used], label[used]
    cells, groups = CELLS[0] * CELLS[1], int(group.max()) + 1
    place = group * cells + cell
    count = np.bincount(place, minlength=cells * groups)
    kept = count >= FEWEST
    count = np.where(kept, count, 0).reshape(groups, cells)
    total = np.stack([np.bincount(place, u[:, k], cells * groups) for k in (0, 1)], axis=1)
    total = np.where(kept[:, None], total, 0.0).reshape(groups, cells, 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        own = total / count[..., None]
        mean = own - total.sum(axis=0) / count.sum(axis=0)[:, None]
        within = (u - own.reshape(-1, 2)[place])[kept[place]]
        variance = (within**2).sum(axis=0) / (len(within) - np.count_nonzero(kept))
        sigma = np.sqrt(variance * (1.0 / count - 1.0 / count.sum(axis=0))[..., None])
    chi = float(np.nansum(count[..., None] * mean**2 / variance))
    freedom = 2 * int(np.sum(np.maximum((count > 0).sum(axis=0) - 1, 0)))
    rms2 = float(np.nanmean(np.sum(mean**2 - sigma**2, axis=-1)))
    shape = (groups, CELLS[1], CELLS[0], 2)
    rms = float(np.sign(rms2) * np.sqrt(abs(rms2)))
    return CellTest(name, mean.reshape(shape), sigma.reshape(shape), chi, freedom, rms)


def thirds(values: np.ndarray) -> np.ndarray:
    """0, 1, 2 by the size of values, −1 where there is none."""
    there = np.isfinite(values)
    label = np.full(len(values), -1)
    label[there] = np.searchsorted(np.quantile(values[there], [1 / 3, 2 / 3]), values[there])
    return label


def groupings(flight: Flight) -> dict[str, np.ndarray]:
    """(m,) labels of the rays in every way they are divided."""
    result = flight.adjusted.adjusted
    rays, centre = result.block.image_points, result.images.centre
    image = rays.image
    found = {"strip": flight.strip[image], "direction of flight": flight.way[image]}
    if np.isfinite(flight.time).all() and np.ptp(flight.time) > 0.0:
        found["thirds of the time"] = thirds(flight.time)[image]
    if flight.landing.max():
        found["before and after the landing"] = flight.landing[image]
    axis = np.array([np.cos(flight.course[0]), np.sin(flight.course[0])])
    along = centre[:, :2] @ axis
    across = centre[:, :2] @ np.array([-axis[1], axis[0]])
    found["thirds of the block along the strips"] = thirds(along)[image]
    found["thirds of the block across the strips"] = thirds(across)[image]
    found["thirds of the strip in the order of flight"] = thirds(flight.step)[image]
    found["thirds of the ground by height"] = thirds(result.points.xyz[:, 2])[rays.point]
    rng = np.random.default_rng(len(centre))
    found["photographs at random, as many groups as strips"] = rng.permutation(flight.strip)[image]
    return {name: label for name, label in found.items() if label.max() > 0}
