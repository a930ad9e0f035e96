"""The ground: flat or undulating, hills and houses on it, as a function of the plan coordinates."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aerotri.simulation.spec import TerrainSpec

WAVES = 12
"""Waves of undulating ground; chosen [C]: fewer show as a pattern of stripes, more look alike and take longer at every
point."""


@dataclass(frozen=True, eq=False)
class Terrain:
    """Height Z = base + Σ a·cos(k·(X, Y) + phase) + Σ hill·exp(−ρ²/2radius²), and houses over it.

    Parameters
    ----------
    base : m, the mean level.
    wave_number : (w, 2) rad/m; amplitude, phase : (w,) m, rad.
    hills : (g, 4) m, X and Y, height, radius; a hill holds the volume 2π·radius²·height over the base.
    houses : (h, 5) m, middle X and Y, sizes along X and Y, height of the flat roof over the ground in the middle.
    """

    base: float
    wave_number: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray
    hills: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    houses: np.ndarray = field(default_factory=lambda: np.zeros((0, 5)))

    def height(self, xy: np.ndarray) -> np.ndarray:
        """(n,) m at (n, 2) m, of the ground or of the roof over it."""
        xy = np.asarray(xy, dtype=float)
        z = self.ground(xy)
        roofs = self.ground(self.houses[:, :2]) + self.houses[:, 4]
        for house, roof in zip(self.houses, roofs, strict=True):
            on_it = (np.abs(xy - house[:2]) <= 0.5 * house[2:4]).all(axis=1)
            z[on_it] = np.maximum(z[on_it], roof)
        return z

    @property
    def reach(self) -> tuple[float, float]:
        """m, heights that nothing is below and nothing above."""
        waves = float(np.abs(self.amplitude).sum())
        low = self.base - waves + float(np.minimum(self.hills[:, 2], 0.0).sum())
        high = self.base + waves + float(np.maximum(self.hills[:, 2], 0.0).sum())
        high += float(self.houses[:, 4].max(initial=0.0))
        return low, high

    def ground(self, xy: np.ndarray) -> np.ndarray:
        """(n,) m at (n, 2) m, of the ground, below houses too."""
        xy = np.asarray(xy, dtype=float)
        z = np.full(len(xy), self.base)
        for k, a, phase in zip(self.wave_number, self.amplitude, self.phase, strict=True):
            z += a * np.cos(xy @ k + phase)
        for x, y, height, radius in self.hills.tolist():
            rho2 = np.sum((xy - np.array([x, y])) ** 2, axis=1)
            z += height * np.exp(-0.5 * rho2 / radius**2)
        return z


def make_terrain(spec: TerrainSpec, centre: tuple[float, float], rng: np.random.Generator) -> Terrain:
    """Terrain of a spec, its houses and hills where the spec puts them.

    Undulating ground is a sum of `WAVES` waves in random directions, their lengths within a factor √2 of
    the wavelength asked for, with a common amplitude that gives the RMS asked for.

    Parameters
    ----------
    centre : (2,) m of the block: places of hills and houses count from there.
    """
    waves = WAVES if spec.kind == "undulating" else 0
    direction = rng.uniform(0.0, 2.0 * np.pi, waves)
    length = spec.wavelength_m * 2.0 ** rng.uniform(-0.5, 0.5, waves)
    number = (2.0 * np.pi / length)[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    amplitude = np.full(waves, spec.relief_rms_m * np.sqrt(2.0 / WAVES))
    phase = rng.uniform(0.0, 2.0 * np.pi, waves)
    one = (*spec.hill_centre_m, 0.0 if spec.kind == "flat" else spec.hill_height_m, spec.hill_radius_m)
    hills = np.array([hill for hill in (one, *spec.hills) if hill[2] != 0.0], dtype=float).reshape(-1, 4)
    hills[:, :2] += centre
    houses = np.array([list(house) for house in spec.houses], dtype=float).reshape(-1, 5)
    houses[:, :2] += centre
    return Terrain(spec.height_m, number, amplitude, phase, hills, houses)
