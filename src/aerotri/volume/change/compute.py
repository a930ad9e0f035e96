"""The difference of two surfaces against its σ, and the volumes gained and lost.

[D] σ² of a cell is that of both noises, scaled to what stable ground shows, and that of the alignment, aCaᵀ. Without an
alignment the adjustments' parts stand in its place; they cancel where both surfaces come from one adjustment. A
volume Σw·d has the variance of its noise, with the square of cells that share one, of the alignment, (Σw·a)C(Σw·a)ᵀ,
and of the adjustments. Where these are given it follows from their equations, see `adjusted`, after the alignment too;
else it is (Σ|w|·σ_adjustment)², as if every cell erred alike: the most that it can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import SIGMAS_OF_95
from aerotri.rasters.grids import Grid
from aerotri.volume.bridges import errors_of_patches
from aerotri.volume.change.adjusted import AdjustedPair, AlignedPair
from aerotri.volume.change.alignment import NO_ALIGNMENT, Align, Alignment, align
from aerotri.volume.change.noise import variance_of_sum
from aerotri.volume.lasting import NO_LASTING, Lasting, lasting_variance_of_cells

LEVEL = SIGMAS_OF_95
"""Of 95 %: changes beyond so many σ are told from noise."""
PARTS = ("noise", "alignment", "adjustment", "model", "matching_shared", "bridged")


@dataclass(frozen=True, eq=False)
class BridgedCells:
    """(rows, columns), m, σ of cells that are bridged, 0 of others, and the number of the patch each belongs to.

    σ is in that of the cell's noise too; in a volume it counts as of cells that err together, `volume.bridges`.
    """

    sigma: np.ndarray
    patch: np.ndarray

    def variance(self, weight: np.ndarray) -> float:
        """m⁶, of a volume with weights (rows, columns) m²."""
        return float(np.sum(errors_of_patches(self.patch, weight, self.sigma, int(self.patch.max(initial=0))) ** 2))


@dataclass(frozen=True, eq=False)
class Epoch:
    """A surface on the cells of the change.

    Parameters
    ----------
    z : (rows, columns) m. noise : σ of each cell's own noise, m, NaN where not stated.
    adjustment : σ of what the adjustment adds, m, 0 where not known. sharing : cells of one noise.
    lasting : errors of the heights that do not average out. bridge : cells that are bridged below objects; None: none.
    """

    z: np.ndarray
    noise: np.ndarray
    adjustment: np.ndarray
    sharing: float = 1.0
    lasting: Lasting = NO_LASTING
    bridge: BridgedCells | None = None


@dataclass(frozen=True)
class ChangedVolume:
    """Volumes of an area, m³, all positive, and σ of each with its parts.

    Parameters
    ----------
    gained, lost : of the cells whose change is beyond the level of detection. net : of all cells.
    parts : of σ of gained, lost and net, by `PARTS`. area : m², of cells with heights in both. no_data_area : m².
    gained_area, lost_area : m², of significant cells.
    """

    name: str
    gained: float
    lost: float
    net: float
    parts: dict[str, dict[str, float]]
    area: float
    no_data_area: float
    gained_area: float
    lost_area: float

    def sigma(self, of: str) -> float:
        """m³, of 'gained', 'lost' or 'net'."""
        return float(np.sqrt(sum(v**2 for v in self.parts[of].values())))


@dataclass(frozen=True, eq=False)
class Change:
    """The change between two surfaces.

    Parameters
    ----------
    difference, sigma : (rows, columns) m, second less first after the alignment; NaN where not known.
    moved_sigma : (u,) of what the second was moved by, m and m/m: by the noise on stable ground, and by the
        adjustments where they are given.
    """

    grid: Grid
    difference: np.ndarray
    sigma: np.ndarray
    alignment: Alignment
    moved_sigma: np.ndarray
    volumes: tuple[ChangedVolume, ...]
    sharing: float

    @property
    def significance(self) -> np.ndarray:
        """(rows, columns) difference over σ."""
        return self.difference / self.sigma

    @property
    def beyond(self) -> float:
        """Share of the cells beyond the level of detection."""
        known = np.isfinite(self.difference)
        return float((np.abs(self.significance[known]) > LEVEL).mean()) if known.any() else float("nan")


def compute_change(
    grid: Grid, first: Epoch, second: Epoch, stable: np.ndarray | None, how: Align,
    areas: Sequence[tuple[str, np.ndarray]], adjusted: AdjustedPair | None = None,
) -> Change:  # fmt: skip
    """The change, cell by cell and as volumes.

    Parameters
    ----------
    stable : (rows, columns) bool, ground that did not change; None where none is known.
    areas : names, and which part of every cell is inside, 0 … 1. adjusted : both with their adjustments, where given.

    Raises
    ------
    InputError
    """
    raw = second.z - first.z
    noise = np.hypot(first.noise, second.noise)
    found = NO_ALIGNMENT
    if stable is not None:
        stated = np.isfinite(noise).any()
        found = align(grid, 0.5 * (first.z + second.z), raw, noise if stated else np.ones_like(raw), stable, how)
        noise = (max(found.factor, 1.0) if stated else found.factor) * (noise if stated else np.ones_like(raw))
        found = found if stated else replace(found, factor=np.nan)
    sharing = max(_sharing(first, second), found.sharing)
    design = found.design(grid, second.z)
    moved = len(found.names) > 0
    difference = raw - design @ found.values
    by_alignment = np.einsum("rcu,uv,rcv->rc", design, found.covariance, design)
    pair = None if adjusted is None else adjusted.aligned(found, design)
    if pair is not None:
        adjustment = pair.sigma()
    else:
        adjustment = np.zeros_like(raw) if moved else np.hypot(first.adjustment, second.adjustment)
    sigma = np.sqrt(noise**2 + by_alignment + adjustment**2)
    difference = np.where(np.isfinite(sigma), difference, np.nan)
    lasting = first.lasting, second.lasting
    bridges = [one.bridge for one in (first, second) if one.bridge is not None]
    alone = np.sqrt(np.maximum(noise**2 - sum(one.sigma**2 for one in bridges), 0.0))
    cells = _Cells(grid, difference, alone, adjustment, design, found, sharing, pair, lasting, bridges)
    significant = np.abs(difference) > LEVEL * sigma
    volumes = tuple(cells.volume(name, part, significant) for name, part in areas)
    own = np.diag(found.covariance)
    moved_sigma = np.sqrt(own if pair is None else own + pair.unknowns())
    sigma = np.where(np.isfinite(difference), sigma, np.nan)
    return Change(grid, difference, sigma, found, moved_sigma, volumes, sharing)


def _sharing(first: Epoch, second: Epoch) -> float:
    """Cells of one noise of a difference: the mean of both by their variances."""
    known = np.isfinite(first.noise) & np.isfinite(second.noise)
    if not known.any():
        return max(first.sharing, second.sharing)
    of = [float(np.mean(one.noise[known] ** 2)) for one in (first, second)]
    return (of[0] * first.sharing + of[1] * second.sharing) / max(sum(of), 1e-300)


@dataclass(frozen=True, eq=False)
class _Cells:
    """What volumes are summed from."""

    grid: Grid
    difference: np.ndarray
    noise: np.ndarray
    adjustment: np.ndarray
    design: np.ndarray
    alignment: Alignment
    sharing: float
    pair: AlignedPair | None
    lasting: tuple[Lasting, Lasting]
    bridges: Sequence[BridgedCells]

    def volume(self, name: str, part: np.ndarray, significant: np.ndarray) -> ChangedVolume:
        """Of the cells of an area."""
        cell, known = self.grid.cell_x * self.grid.cell_y, np.isfinite(self.difference)
        d, inside = np.where(known, self.difference, 0.0), np.where(known, part, 0.0) * cell
        weights = {"gained": inside * (significant & (d > 0.0)), "lost": inside * (significant & (d < 0.0)),
                   "net": inside}  # fmt: skip
        sums = {of: float(np.sum(weight * d)) for of, weight in weights.items()}
        return ChangedVolume(
            name, sums["gained"], abs(sums["lost"]), sums["net"], {of: self._parts(w) for of, w in weights.items()},
            float(inside.sum()), float(np.sum(part) * cell - inside.sum()), float(weights["gained"].sum()),
            float(weights["lost"].sum()),
        )  # fmt: skip

    def _parts(self, weight: np.ndarray) -> dict[str, float]:
        used = weight > 0.0
        own = np.where(used, weight * np.where(used, self.noise, 0.0), 0.0)
        moved = np.einsum("rc,rcu->u", weight, np.where(used[..., None], self.design, 0.0))
        noise, model = (np.sum(weight * np.where(used, self.adjustment, 0.0)) ** 2, 0.0)
        if self.pair is not None:
            noise, model = self.pair.variances(weight)
        cell = self.grid.cell_x, self.grid.cell_y
        values = (
            np.sqrt(variance_of_sum(own, self.sharing)),
            np.sqrt(max(float(moved @ self.alignment.covariance @ moved), 0.0)),
            np.sqrt(noise),
            np.sqrt(model),
            np.sqrt(sum(lasting_variance_of_cells(weight, cell, one) for one in self.lasting)),
            np.sqrt(sum(one.variance(weight) for one in self.bridges)),
        )
        return {name: float(value) for name, value in zip(PARTS, values, strict=True)}
