"""How the parameters of the strips differ: estimated with their covariance, against direction, time and landings.

Every strip (a strip with a landing in it: every part) has parameters of its own, or an interior orientation of its own;
both together are too weakly determined. Sizes are µm of image error, root mean square over the format.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2, t

import aerotri
from moving.flights import Flight

SET = "legendre:4x4"
PART = "part"
"""Column of the photographs that names their group."""
INTERIOR = ("focal_length_mm", "x0_mm", "y0_mm")
PERMUTATIONS = 4000
DETERMINED_UM = 0.3
"""σ in µm of image error above which a combination of parameters is not taken for determined by one group."""


@dataclass(frozen=True, eq=False)
class StripValues:
    """Parameters of G groups of photographs, K of them, and their covariance.

    Parameters
    ----------
    names : (K,) of the parameters. size : (K,) µm of image error of a unit. determined : combinations that are kept.
    value : (G, K) µm of image error. covariance : (K, G, G) µm², of one parameter; joint : (G, K, G, K).
    project : (K, K) onto what a group determines.
    interior : (G, 3) µm, c, x0, y0; interior_sigma : (G, 3) µm.
    way, time, landing : (G,) of the groups; time in s from the first photograph. photographs : (G,).
    sigma0_um : of the adjustment.
    """

    names: tuple[str, ...]
    size: np.ndarray
    determined: int
    value: np.ndarray
    covariance: np.ndarray
    joint: np.ndarray
    project: np.ndarray
    interior: np.ndarray
    interior_covariance: np.ndarray
    way: np.ndarray
    time: np.ndarray
    landing: np.ndarray
    photographs: np.ndarray
    sigma0_um: float

    @property
    def sigma(self) -> np.ndarray:
        """(G, K) µm."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).T


def groups_of(flight: Flight) -> np.ndarray:
    """(n,) number of every photograph's group: its strip, divided where the drone landed."""
    both = np.stack([flight.strip, flight.landing], axis=1)
    return np.unique(both, axis=0, return_inverse=True)[1].ravel()


def with_own_parameters(block: aerotri.Block, group: np.ndarray) -> aerotri.Block:
    """A block with additional parameters of its own for every group (n,), and one interior orientation."""
    names = np.array([name_of(k) for k in group], dtype=object)
    images = replace(block.images, columns={PART: names})
    return aerotri.with_settings(replace(block, images=images), parameters=SET, parameter_groups=PART)


def as_adjusted(flight: Flight) -> aerotri.Block:
    """The block with its adjusted orientations, interior and exterior, to start from."""
    block, result = flight.adjusted.block, flight.adjusted.adjusted
    p, camera = result.parameters, block.cameras[0]
    interior = dict(camera.interior)
    for name in INTERIOR:
        interior[name] = replace(interior[name], value=float(p.value[p.names == name][0]))
    images = replace(block.images, centre=result.images.centre, angles=result.images.angles)
    return replace(block, cameras=(replace(camera, interior=interior),), images=images)


def with_own_interior(block: aerotri.Block, group: np.ndarray) -> aerotri.Block:
    """A block with an interior orientation of its own for every group (n,), and one set of parameters."""
    cameras = tuple(replace(block.cameras[0], name=name_of(k)) for k in range(int(group.max()) + 1))
    block = replace(block, cameras=cameras, images=replace(block.images, camera=group))
    return aerotri.with_settings(block, parameters=SET, parameter_groups="block")


def name_of(group: int) -> str:
    return f"g{group:02d}"


def of_groups(adjusted: aerotri.Adjustment, names: tuple[str, ...], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Values (G, k) of parameters in the groups, and their covariance (G, k, G, k)."""
    p = adjusted.adjusted.parameters
    row = {(name, own): k for k, (name, own) in enumerate(zip(p.names.tolist(), p.groups.tolist(), strict=True))}
    rows = np.array([[row[name, name_of(k)] for name in names] for k in range(count)])
    flat = rows.ravel()
    return p.value[rows], p.covariance[np.ix_(flat, flat)].reshape(*rows.shape, *rows.shape)


def strip_values(
    flight: Flight, parameters: aerotri.Adjustment, interior: aerotri.Adjustment | None, group: np.ndarray
) -> StripValues:
    """The estimates of adjustments of `with_own_parameters` and `with_own_interior`.

    Combinations of parameters that a group alone does not determine to `DETERMINED_UM` (affinity, shear and tilts
    beside what the positions hold) are taken off all groups.
    """
    p, count = parameters.adjusted.parameters, int(group.max()) + 1
    names = tuple(dict.fromkeys(p.names[p.kinds == "additional"].tolist()))
    camera = flight.adjusted.block.cameras[0]
    unit, known = aerotri.parameters.patterns(SET, camera, np.zeros((1, 2)))[0], 1e3 * pattern_sizes(camera)
    size = np.array([known[unit.index(name)] for name in names])
    value, covariance = of_groups(parameters, names, count)
    value = value * size
    covariance = covariance * size[:, None, None] * size
    own = np.mean([covariance[k, :, k] for k in range(count)], axis=0)
    variance, axes = np.linalg.eigh(own)
    kept = axes[:, variance < DETERMINED_UM**2]
    project = kept @ kept.T
    value = value @ project
    covariance = np.einsum("ki,gihj,lj->gkhl", project, covariance, project, optimize=True)
    inner, of_inner = np.full((count, 3), np.nan), np.full((count, 3, count, 3), np.nan)
    if interior is not None:
        inner, of_inner = of_groups(interior, INTERIOR, count)
    mean = [np.array([values[group == k].mean() for k in range(count)]) for values in (flight.way, flight.landing)]
    time = np.array([flight.time[group == k].mean() for k in range(count)])
    return StripValues(
        names,
        size,
        kept.shape[1],
        value,
        np.stack([covariance[:, k, :, k] for k in range(len(names))]),
        covariance,
        project,
        1e3 * inner,
        1e6 * np.stack([of_inner[:, k, :, k] for k in range(len(INTERIOR))]),
        np.round(mean[0]),
        time,
        np.round(mean[1]),
        np.bincount(group),
        parameters.sigma0_um,
    )


def pattern_sizes(camera: aerotri.observations.Camera) -> np.ndarray:
    """(K,) RMS length over the format of what a unit of each parameter of the set moves image points by."""
    bx, by = camera.half_format_mm
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-bx, bx, 61), np.linspace(-by, by, 41)))
    unit = aerotri.parameters.patterns(SET, camera, np.stack([x, y], axis=1))[1]
    return np.sqrt(np.mean(np.sum(unit**2, axis=1), axis=0))


def columns(values: StripValues, causes: tuple[str, ...]) -> np.ndarray:
    """(G, 1 + causes) a mean and the causes: direction ±1; time −½ to ½ over the flight; landing 0, 1."""
    time = (values.time - values.time.min()) / np.ptp(values.time) - 0.5
    known = {"direction": 2.0 * values.way - 1.0, "time": time, "landing": values.landing}
    return np.stack([np.ones(len(time)), *(known[name] for name in causes)], axis=1)


def chi_square_of_change(values: StripValues) -> tuple[np.ndarray, int]:
    """(K,) χ² of every parameter against one value for all groups, and the degrees of freedom."""
    out = np.empty(len(values.names))
    for k, covariance in enumerate(values.covariance):
        weight = np.linalg.pinv(covariance)
        y, one = values.value[:, k], np.ones(len(weight))
        mean = one @ weight @ y / (one @ weight @ one)
        out[k] = (y - mean) @ weight @ (y - mean)
    return out, len(values.time) - 1


def restricted(y: np.ndarray, covariance: np.ndarray, design: np.ndarray, kernel: np.ndarray) -> tuple[float, float]:
    """s² of deviations with the covariance s²·kernel beside `covariance`, and −2 ln of the restricted likelihood."""

    def deviance(log_s: float) -> float:
        v = covariance + np.exp(2.0 * log_s) * kernel
        weight = np.linalg.inv(v)
        n = design.T @ weight @ design
        rest = y - design @ np.linalg.solve(n, design.T @ weight @ y)
        return float(np.linalg.slogdet(v)[1] + np.linalg.slogdet(n)[1] + rest @ weight @ rest)

    found = minimize_scalar(deviance, bounds=(np.log(1e-3), np.log(10.0)), method="bounded")
    return (float(np.exp(2.0 * found.x)), float(found.fun)) if found.fun < deviance(-50.0) else (0.0, deviance(-50.0))


def walk_kernel(count: int) -> np.ndarray:
    """(G, G) covariance of a random walk of unit steps."""
    at = np.arange(count, dtype=float)
    return np.minimum(at[:, None], at[None, :])


@dataclass(frozen=True)
class Cause:
    """What one cause does to one parameter: effect, its σ (µm), degrees of freedom and probability."""

    parameter: str
    cause: str
    effect: float
    sigma: float
    p: float


def causes_of(values: StripValues, causes: tuple[str, ...]) -> Iterator[Cause]:
    """Every cause of every parameter, all causes together, against the scatter of the strips that is left."""
    design = columns(values, causes)
    freedom = len(design) - design.shape[1]
    for k, name in enumerate(values.names):
        y, covariance = values.value[:, k], values.covariance[k]
        s2, _ = restricted(y, covariance, design, np.eye(len(y)))
        weight = np.linalg.inv(covariance + s2 * np.eye(len(y)))
        cofactor = np.linalg.inv(design.T @ weight @ design)
        found = cofactor @ design.T @ weight @ y
        for j, cause in enumerate(causes, start=1):
            sigma = float(np.sqrt(cofactor[j, j]))
            yield Cause(name, cause, float(found[j]), sigma, float(2.0 * t.sf(abs(found[j]) / sigma, freedom)))


def variance(values: StripValues, design: np.ndarray) -> np.ndarray:
    """(K,) µm², the variance between groups that a design (G, c) leaves, the noise of the estimates taken off."""
    stay = np.eye(len(design)) - design @ np.linalg.pinv(design)
    rest = stay @ values.value
    noise = np.einsum("ij,kji->k", stay, values.covariance)
    return (np.sum(rest**2, axis=0) - noise) / np.trace(stay)


def permuted(values: StripValues, cause: str, beside: tuple[str, ...], rng: np.random.Generator) -> float:
    """Probability that so much of the scatter would go with a cause by chance: groups exchanged in all parameters."""
    sigma = values.sigma.mean(axis=0)
    before = columns(values, beside)
    stay = np.eye(len(before)) - before @ np.linalg.pinv(before)
    rest = stay @ (values.value / sigma)
    column = stay @ columns(values, (cause,))[:, 1]

    def explained(order: np.ndarray) -> float:
        turned = stay @ column[order]
        return float(np.sum((turned @ rest) ** 2) / (turned @ turned))

    own = explained(np.arange(len(column)))
    by_chance = [explained(rng.permutation(len(column))) for _ in range(PERMUTATIONS)]
    return (1.0 + np.sum(np.array(by_chance) >= own)) / (1.0 + PERMUTATIONS)


def probability_of_change(values: StripValues) -> np.ndarray:
    """(K,)."""
    found, freedom = chi_square_of_change(values)
    return chi2.sf(found, freedom)


def principal(values: StripValues) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Main patterns of the deviations.

    Returns
    -------
    Share of the sum of squares (G,), amounts (G, G) µm with their σ, and patterns (G, K), the largest first.
    """
    away = values.value - np.average(values.value, axis=0, weights=values.photographs)
    amount, root, pattern = np.linalg.svd(away, full_matrices=False)
    own = np.stack([values.joint[k, :, k] for k in range(len(away))])
    sigma = np.sqrt(np.einsum("pk,gkl,pl->gp", pattern, own, pattern))
    return root**2 / np.sum(root**2), amount * root, sigma, pattern


def inner_groups(values: StripValues, outer: int) -> StripValues:
    """Without the first and the last groups, those at the border of the block."""
    keep = np.arange(outer, len(values.time) - outer)
    return replace(
        values,
        value=values.value[keep],
        covariance=values.covariance[:, keep][:, :, keep],
        joint=values.joint[keep][:, :, keep],
        interior=values.interior[keep],
        interior_covariance=values.interior_covariance[:, keep][:, :, keep],
        way=values.way[keep],
        time=values.time[keep],
        landing=values.landing[keep],
        photographs=values.photographs[keep],
    )
