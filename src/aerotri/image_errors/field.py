"""Systematic image errors d(x, y) of a group of photographs, with their covariance: d = B·p, Q_dd = B·Q_pp·Bᵀ.

measured = ideal + d, evaluated at the measured position. σ̂0² is in Q_pp, so every σ here is final.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.additional_parameters import brown, lens, parameter_sets
from aerotri.functional_model.orientation_patterns import orientation_patterns
from aerotri.image_errors.groups import (
    ImageGroup,
    image_group,
    image_groups,
    interior_elements,
    parameters_of_group,
)
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock

CHI2_LIMIT = -2.0 * np.log(1.0 - 0.95)
"""95 % quantile of χ² with two degrees of freedom; the distribution function is 1 − exp(−χ²/2)."""


@dataclass(frozen=True, eq=False)
class ErrorField:
    """Systematic image errors on a grid over the format; the nodes are the centres of nx × ny equal cells.

    Parameters
    ----------
    camera, group : of the photographs.
    x, y : (ny, nx) mm from the image centre; y grows with the row index.
    d : (ny, nx, 2) mm, measured − ideal.
    sigma : (ny, nx, 2) mm.
    significant : (ny, nx) bool, dᵀQ⁻¹d above the 95 % quantile of χ² with two degrees of freedom.
    without_orientation : shifts, scale, rotation and tilts of the whole image are left out, as of a random field: the
        orientation takes them, and their own large σ would hide everything else.
    """

    camera: Camera
    group: str
    x: np.ndarray
    y: np.ndarray
    d: np.ndarray
    sigma: np.ndarray
    significant: np.ndarray
    without_orientation: bool = False

    @property
    def rms(self) -> float:
        """mm, root mean square length of the vectors."""
        return float(np.sqrt(np.mean(np.sum(self.d**2, axis=-1))))

    @property
    def max(self) -> float:
        """mm, the longest vector."""
        return float(np.max(np.hypot(self.d[..., 0], self.d[..., 1])))


def systematic_errors(
    adjusted: AdjustedBlock, group: str, x: np.ndarray, y: np.ndarray, camera: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Systematic image errors of a group at image positions, and their covariance.

    Linear families count exactly. Brown's family is evaluated about the adjusted principal point. The forward lens is a
    function of the ideal direction, which is found from the measured one; of a fisheye the ideal position is that of
    its own ideal projection. Lens values that were given and not adjusted belong to d and carry no variance.

    Parameters
    ----------
    group : name of the parameter group.
    x, y : (n,) mm from the image centre, measured positions.
    camera : name; needed only where several cameras share the group.

    Returns
    -------
    d : (n, 2) mm, measured − ideal.
    covariance : (n, 2, 2) mm².
    """
    d, jacobian, rows = errors_with_jacobian(adjusted, image_group(adjusted.block, group, camera), x, y)
    return d, _propagated(jacobian, _covariance_of(adjusted, rows))


def field_on_grid(adjusted: AdjustedBlock, group: str, nx: int | None = None, camera: str | None = None) -> ErrorField:
    """The systematic image errors of a group on a grid.

    Parameters
    ----------
    nx : nodes along x; default 25 on the longer side of the format. The cells are as square as the format allows.
    """
    images = image_group(adjusted.block, group, camera)
    x, y = grid_nodes(images.camera, nx)
    return _field(adjusted, images.camera, group, (x, y), errors_with_jacobian(adjusted, images, x.ravel(), y.ravel()))


def field_without_orientation(
    adjusted: AdjustedBlock, group: str, nx: int | None = None, camera: str | None = None
) -> ErrorField:
    """As `field_on_grid`, less what the orientation of a photograph over flat ground can take of it.

    Shifts, scale, rotation and two tilts say alike what sets of parameters give to the image or leave to the
    orientation, each in its own way; what remains can be compared between sets.
    """
    images = image_group(adjusted.block, group, camera)
    x, y = grid_nodes(images.camera, nx)
    errors = errors_with_jacobian(adjusted, images, x.ravel(), y.ravel())
    return _field(adjusted, images.camera, group, (x, y), errors, without_orientation=True)


def field_difference(
    adjusted: AdjustedBlock, first: str, second: str, nx: int | None = None, camera: str | None = None
) -> ErrorField:
    """First group minus second group, with the covariance of the difference: correlations between the two count."""
    one = image_group(adjusted.block, first, camera)
    x, y = grid_nodes(one.camera, nx)
    two = image_group(adjusted.block, second, camera)
    d_one, jacobian_one, rows_one = errors_with_jacobian(adjusted, one, x.ravel(), y.ravel())
    d_two, jacobian_two, rows_two = errors_with_jacobian(adjusted, two, x.ravel(), y.ravel())
    rows, column = np.unique(np.concatenate([rows_one, rows_two]), return_inverse=True)
    jacobian = np.zeros((*d_one.shape, len(rows)))
    # a parameter that both groups share counts once, by the difference of its partials
    jacobian[:, :, column[: len(rows_one)]] += jacobian_one
    jacobian[:, :, column[len(rows_one) :]] -= jacobian_two
    errors = d_one - d_two, jacobian, rows
    return _field(adjusted, one.camera, f"{first} − {second}", (x, y), errors)


def field_of(
    camera: Camera, group: str, d: Callable[[np.ndarray, np.ndarray], np.ndarray], nx: int | None = None,
    without_orientation: bool = False,
) -> ErrorField:  # fmt: skip
    """A field that is known without error, on a grid.

    Parameters
    ----------
    d : (n,) x and (n,) y in mm → (n, 2) mm. nx, without_orientation : as of `field_on_grid` and
        `field_without_orientation`.
    """
    x, y = grid_nodes(camera, nx)
    errors = d(x.ravel(), y.ravel())
    if without_orientation:
        errors = take_off_orientation(camera, x.ravel(), y.ravel(), errors, np.zeros((len(errors), 2, 0)))[0]
    grid = (*x.shape, 2)
    known = np.ones(x.shape, dtype=bool)
    return ErrorField(camera, group, x, y, errors.reshape(grid), np.zeros(grid), known, without_orientation)


def lens_errors(
    c: float, principal_point: tuple[float, float], lens_parameters: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """(n, 2) mm, measured − ideal by a forward lens, at measured positions (n,) x and (n,) y in mm.

    Parameters
    ----------
    c : mm, principal distance. principal_point : x0, y0 in mm. lens_parameters : (14,) in the order of `lens.COLUMNS`.
    """
    x0, y0 = principal_point
    return _lens((x - x0) / c, (y - y0) / c, c, lens_parameters)[0]


def field_between(first: ErrorField, second: ErrorField) -> ErrorField:
    """First field less second on the same grid, the two taken as independent of each other.

    Significant where (d_x/σ_x)² + (d_y/σ_y)² exceeds the 95 % quantile of χ² with two degrees of freedom: the fields do
    not keep how d_x and d_y of a node are correlated. Where σ is 0 any difference but 0 counts.
    """
    d, sigma = first.d - second.d, np.hypot(first.sigma, second.sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        statistic = np.nan_to_num((d / sigma) ** 2, posinf=np.inf).sum(axis=-1)
    name = f"{first.group} − {second.group}"
    freed = first.without_orientation and second.without_orientation
    return ErrorField(first.camera, name, first.x, first.y, d, sigma, statistic > CHI2_LIMIT, freed)


def largest_effects(adjusted: AdjustedBlock) -> np.ndarray:
    """(s,) mm, the longest displacement that each additional parameter causes on the grid; NaN for other parameters.

    Makes parameters of different families and units comparable.
    """
    effects = np.full(len(adjusted.parameters), np.nan)
    for group in image_groups(adjusted.block):
        x, y = grid_nodes(group.camera)
        _, jacobian, rows = errors_with_jacobian(adjusted, group, x.ravel(), y.ravel())
        longest = np.linalg.norm(jacobian, axis=1).max(axis=0, initial=0.0) * np.abs(adjusted.parameters.value[rows])
        effects[rows] = np.fmax(effects[rows], longest)
    return effects


def grid_nodes(camera: Camera, nx: int | None = None, longer: int = 25) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the cells that divide the format, (ny, nx) mm each; `longer` cells on the longer side unless nx."""
    half_x, half_y = camera.half_format_mm
    if nx is None:
        nx = longer if half_x >= half_y else max(1, round(longer * half_x / half_y))
    ny = max(1, round(nx * half_y / half_x))
    x = (2.0 * (np.arange(nx) + 0.5) / nx - 1.0) * half_x
    y = (2.0 * (np.arange(ny) + 0.5) / ny - 1.0) * half_y
    grid_x, grid_y = np.meshgrid(x, y)
    return grid_x, grid_y


def _field(
    adjusted: AdjustedBlock,
    camera: Camera,
    group: str,
    at: tuple[np.ndarray, np.ndarray],
    errors: tuple[np.ndarray, np.ndarray, np.ndarray],
    without_orientation: bool = False,
) -> ErrorField:
    """The field at nodes x, y (ny, nx) from errors (n, 2), their partials (n, 2, k) and the rows (k,) of these."""
    (x, y), (d, jacobian, rows) = at, errors
    without_orientation |= bool(adjusted.parameters.is_node[rows].any())
    if without_orientation:
        d, jacobian = take_off_orientation(camera, x.ravel(), y.ravel(), d, jacobian)
    covariance = _propagated(jacobian, _covariance_of(adjusted, rows))
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    grid = (*x.shape, 2)
    mask = significant(d, covariance).reshape(x.shape)
    return ErrorField(camera, group, x, y, d.reshape(grid), sigma.reshape(grid), mask, without_orientation)


def take_off_orientation(
    camera: Camera, x: np.ndarray, y: np.ndarray, d: np.ndarray, jacobian: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """d (n, 2) and its partials (n, 2, k) less the six orientation patterns that fit them best."""
    basis = np.linalg.qr(orientation_patterns(x, y, camera.focal_length_mm).reshape(-1, 6))[0]
    both = np.concatenate([d[:, :, None], jacobian], axis=2).reshape(len(basis), -1)
    both = (both - basis @ (basis.T @ both)).reshape(len(x), 2, -1)
    return both[:, :, 0], both[:, :, 1:]


def significant(d: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(n,) bool: dᵀQ⁻¹d above `CHI2_LIMIT`.

    Where Q is singular (a pattern that moves points along a line only) its pseudo-inverse is used; where Q is zero, a
    vector other than zero was given as known and counts as significant.
    """
    finite = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    safe = np.where(finite[:, None, None], covariance, 0.0)
    statistic = np.einsum("ni,nij,nj->n", d, np.linalg.pinv(safe, rcond=1e-10, hermitian=True), d)
    known = np.trace(safe, axis1=1, axis2=2) == 0.0
    return np.where(known, np.any(d != 0.0, axis=1), statistic > CHI2_LIMIT) & finite


def _propagated(jacobian: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(n, 2, 2) J·Q·Jᵀ of (n, 2, k) and (k, k)."""
    return jacobian @ covariance @ jacobian.transpose(0, 2, 1)


def _covariance_of(adjusted: AdjustedBlock, rows: np.ndarray) -> np.ndarray:
    """(k, k) of some shared parameters; what was held has no variance, whatever the record keeps for it."""
    p = adjusted.parameters
    varies = np.isin(p.status[rows], ("estimated", "weighted"))
    return np.where(varies[:, None] & varies[None, :], p.total_covariance[np.ix_(rows, rows)], 0.0)


def errors_with_jacobian(
    adjusted: AdjustedBlock, group: ImageGroup, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """d (n, 2) mm, its partials (n, 2, k) by the k parameters in force, and their rows (k,) in the record."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    rows = np.flatnonzero(parameters_of_group(adjusted, group))
    column_of = {str(name): column for column, name in enumerate(adjusted.parameters.names[rows])}
    d, jacobian = np.zeros((len(x), 2)), np.zeros((len(x), 2, len(rows)))
    for names, d_of_family, basis in _families(adjusted, group, rows, x, y):
        d += d_of_family
        for i, name in enumerate(names):
            if name in column_of:
                jacobian[:, :, column_of[name]] += basis[:, :, i]
    return d, jacobian, rows


def _families(adjusted: AdjustedBlock, group: ImageGroup, rows: np.ndarray, x: np.ndarray, y: np.ndarray):
    """Names, image errors (n, 2) and patterns (n, 2, p) of every family that acts in a group."""
    camera, values = group.camera, _values_in_force(adjusted, group, rows)
    for chosen in parameter_sets(values, camera):
        basis = chosen.basis(x, y)
        yield chosen.names, basis @ np.array([values[name] for name in chosen.names]), basis
    (c, x0, y0), _ = interior_elements(adjusted, camera)
    for module in (brown, lens):
        names = tuple(f"{module.FAMILY.name}.{item}" for item in module.ITEMS)
        if any(name in values for name in names):
            p = np.array([*(values.get(name, 0.0) for name in names), float(camera.is_fisheye)])
            bar = x - x0, y - y0
            yield names, *(_brown(*bar, p[:-1]) if module is brown else _lens(bar[0] / c, bar[1] / c, c, p))


def _values_in_force(adjusted: AdjustedBlock, group: ImageGroup, rows: np.ndarray) -> dict[str, float]:
    """Values by name: adjusted where they were, as the camera gives them otherwise, without what was removed."""
    p = adjusted.parameters
    given = {f"brown.{item}": prior.value for item, prior in group.camera.brown.items()}
    given |= {f"lens.{item}": prior.value for item, prior in group.camera.lens.items()}
    given |= {name: prior.value for name, prior in group.camera.parameters.items()}
    for name in p.names[p.status == "removed"]:
        given.pop(str(name), None)
    return given | {str(name): float(value) for name, value in zip(p.names[rows], p.value[rows], strict=True)}


def _brown(x_bar: np.ndarray, y_bar: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return brown.image_error(x_bar, y_bar, p), brown.basis(x_bar, y_bar)


def _lens(a: np.ndarray, b: np.ndarray, c: float, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Image error and its partials by the forward lens at measured positions a, b for c = 1."""
    measured = np.stack([a, b], axis=-1)
    ideal = lens.unbend(measured, p)
    x, y = ideal.T
    by_ideal, by_parameter = lens.slopes(x, y, p), lens.patterns(x, y, p)
    there = np.isfinite(by_ideal).all(axis=(1, 2))
    # the measured position stays: what a parameter adds, the ideal position gives way
    by_parameter[there] = np.linalg.solve(by_ideal[there], by_parameter[there])
    return c * (measured - ideal), c * by_parameter
