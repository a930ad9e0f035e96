"""The ground: flat, undulating or a hill, as a function of the plan coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.simulation.spec import TerrainSpec

WAVES = 12


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground height Z = base + Σ a·cos(k·(X, Y) + phase) + hill·exp(−ρ²/2radius²).

    Parameters
    ----------
    base : m, the mean level.
    wave_number : (w, 2) rad/m; amplitude, phase : (w,) m, rad.
    hill_height, hill_radius : m; the hill holds the volume 2π·radius²·height over the base.
    hill_centre : (2,) m.
    """

    base: float
    wave_number: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray
    hill_height: float = 0.0
    hill_radius: float = 1.0
    hill_centre: tuple[float, float] = (0.0, 0.0)

    def height(self, xy: np.ndarray) -> np.ndarray:
        """(n,) m at (n, 2) m."""
        xy = np.asarray(xy, dtype=float)
        z = np.full(len(xy), self.base)
        for k, a, phase in zip(self.wave_number, self.amplitude, self.phase, strict=True):
            z += a * np.cos(xy @ k + phase)
        if self.hill_height:
            rho2 = np.sum((xy - np.array(self.hill_centre)) ** 2, axis=1)
            z += self.hill_height * np.exp(-0.5 * rho2 / self.hill_radius**2)
        return z


def make_terrain(spec: TerrainSpec, centre: tuple[float, float], rng: np.random.Generator) -> Terrain:
    """Terrain of a spec; a hill stands on either kind of ground.

    Undulating ground is a sum of `WAVES` waves in random directions, their lengths within a factor √2 of
    the wavelength asked for, with a common amplitude that gives the RMS asked for.

    Parameters
    ----------
    centre : (2,) m of the block: a hill's place counts from there.
    """
    waves = WAVES if spec.kind == "undulating" else 0
    direction = rng.uniform(0.0, 2.0 * np.pi, waves)
    length = spec.wavelength_m * 2.0 ** rng.uniform(-0.5, 0.5, waves)
    number = (2.0 * np.pi / length)[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    amplitude = np.full(waves, spec.relief_rms_m * np.sqrt(2.0 / WAVES))
    phase = rng.uniform(0.0, 2.0 * np.pi, waves)
    height = 0.0 if spec.kind == "flat" else spec.hill_height_m
    place = (centre[0] + spec.hill_centre_m[0], centre[1] + spec.hill_centre_m[1])
    return Terrain(spec.height_m, number, amplitude, phase, height, spec.hill_radius_m, place)
