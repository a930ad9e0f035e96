"""Additional parameters that differ from group to group around a mean: what is known of that beforehand.

[D] Every group, a strip say, has values p_g of its own. Independent deviations, p_g = μ + δ_g with δ_g of standard
deviation s and the mean μ unknown, have the weight matrix (I − 1·1ᵀ/m)/s² of all m values of a parameter together: what
is left when μ is eliminated. A random walk, p_{g+1} − p_g of standard deviation s, has DᵀD/s², D the differences of
neighbours. Neither says anything of the mean: it is as free as a parameter of the whole block. s is stated as an image
error, root mean square over the format, so that parameters of different units compare.

Changes of the interior orientation (family interior) have a mean already, the camera's own c, x0 and y0. Theirs is 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.shared_parameters import SharedList, group_of_images
from aerotri.adjustment.track import exposure_times, one_an_exposure, order_of_exposure
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import (
    FAMILIES,
    Parameter,
    brown,
    collocation,
    interior_change,
    lens,
    parameter_set,
)
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES
from aerotri.observations import Block, Camera

FIRST_SIGMA = 0.3
"""s to begin with, in σ of an image coordinate [C]."""
MEAN_SIGMA_UM = 1e-3
"""σ with which the mean of changes of the interior orientation is 0, as an image error [C]."""
GRID = 21, 15
"""Cells of the format in whose middles the size of a pattern is taken."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """One parameter that has a value in each of m groups.

    Parameters
    ----------
    name : of the parameter, such as 'brown.K1'. groups : (m,) their names, in the order of flight.
    columns : (m,) in the shared list. pattern : (m, m), the weight matrix at s = 1. rank : of the pattern, m − 1.
    size_mm : image error per unit of the parameter, root mean square over the format.
    about_zero : whether the mean is 0, and not unknown.
    """

    name: str
    groups: tuple[str, ...]
    columns: np.ndarray
    pattern: np.ndarray
    size_mm: float
    about_zero: bool = False

    @property
    def rank(self) -> int:
        return len(self.groups) - 1

    def weight(self, sigma_um: float) -> np.ndarray:
        """(m, m) weight matrix of the values for deviations of `sigma_um` µm."""
        return self.pattern * (self.size_mm / (1e-3 * sigma_um)) ** 2

    @property
    def of_mean(self) -> np.ndarray:
        """(m, m) weight matrix of the mean: 0 where it is unknown."""
        m = len(self.groups)
        return np.full((m, m), self.about_zero * (self.size_mm / (1e-3 * MEAN_SIGMA_UM)) ** 2 / m**2)

    def prior(self, sigma_um: float) -> JointPrior:
        """What is known beforehand where the deviations have `sigma_um` µm."""
        return JointPrior(self.columns, self.weight(sigma_um) + self.of_mean, self.rank + self.about_zero)


def deviations_of(block: Block, shared: SharedList) -> tuple[Deviation, ...]:
    """The parameters that have values in several groups, as the settings tie them; none where they are free."""
    kind = block.settings.deviations.kind
    _check_interior(block, shared)
    if kind == "free":
        return ()
    order = {name: k for k, name in enumerate(groups_in_flight_order(block))}
    found: dict[str, dict[str, int]] = {}
    for column, (name, group, of) in enumerate(zip(shared.names, shared.groups, shared.kinds, strict=True)):
        if of == "additional" and Parameter.of(name).family != collocation.FAMILY.name:
            found.setdefault(name, {})[group] = column
    out = []
    for name, columns in found.items():
        groups = tuple(sorted(columns, key=lambda group: order.get(group, len(order))))
        if len(groups) > 1:
            at = np.array([columns[group] for group in groups], dtype=np.int64)
            camera = next(c for c in block.cameras if FAMILIES[Parameter.of(name).family].fits(c))
            about_zero = Parameter.of(name).family == interior_change.FAMILY.name
            out.append(Deviation(name, groups, at, _pattern(kind, len(groups)), size_mm(camera, name), about_zero))
    return tuple(out)


def _check_interior(block: Block, shared: SharedList) -> None:
    """Changes of the interior orientation need groups, and something that ties them: they count from their mean."""
    family = interior_change.FAMILY.name
    changes = [name for name in shared.names if Parameter.of(name).family == family]
    if changes and (block.settings.deviations.kind == "free" or len(set(changes)) == len(changes)):
        raise InputError(
            f"additional_parameters has '{family}', changes of the interior orientation from group to group, but the "
            "groups have no common mean",
            'give parameter_groups of several groups, such as "strip", and [deviations] kind = "independent" or "walk"',
            file="block.toml",
        )
    for item in sorted({Parameter.of(name).item for name in changes}):
        element = interior_change.ELEMENTS[item]
        for camera in (block.cameras[c] for c in sorted(set(block.images.camera.tolist()))):
            if camera.interior[element].fixed:
                raise InputError(
                    f"additional_parameters has '{family}.{item}', but {element} of camera '{camera.name}', the mean "
                    "of the groups, is held",
                    f"make it unknown, or state how well it is known: {element} = {{ sigma = 0.01 }} in "
                    f"[camera.{camera.name}.interior]",
                    file="block.toml",
                )


def groups_in_flight_order(block: Block) -> tuple[str, ...]:
    """The names of the parameter groups in the order in which their photographs were taken."""
    labels, images = group_of_images(block), block.images
    rows = np.flatnonzero(np.isfinite(images.centre).all(axis=1))
    if len(rows) < len(images):
        return tuple(dict.fromkeys(labels.tolist()))
    strips = images.strip.astype(str)
    strips = strips if all(strips.tolist()) else np.full(len(images), "")
    alone, exposure = one_an_exposure(block, np.arange(len(images)))
    track = order_of_exposure(images.centre[alone], strips[alone], images.names[alone], exposure_times(block)[alone])
    rank = np.empty(len(alone), dtype=np.int64)
    rank[track] = np.arange(len(alone))
    return tuple(dict.fromkeys(labels[np.argsort(rank[exposure], kind="stable")].tolist()))


def size_mm(camera: Camera, name: str) -> float:
    """Image error per unit of a parameter, mm, root mean square over the format."""
    parameter = Parameter.of(name)
    half = camera.half_format_mm
    x, y = (a.ravel() for a in np.meshgrid(*(h * _middles(n) for h, n in zip(half, GRID, strict=True))))
    if parameter.family in LINEAR_FAMILIES:
        d = parameter_set(parameter.family, (parameter.item,), camera).basis(x, y)[:, :, 0]
    elif parameter.family == brown.FAMILY.name:
        d = brown.basis(x - camera.principal_point_mm[0], y - camera.principal_point_mm[1])
        d = d[:, :, brown.ITEMS.index(parameter.item)]
    else:
        c = camera.focal_length_mm
        d = c * lens.patterns(x / c, y / c, lens.vector({}))[:, :, lens.ITEMS.index(parameter.item)]
    return float(np.sqrt(np.mean(np.sum(d**2, axis=1))))


def _middles(count: int) -> np.ndarray:
    """Middles of so many equal parts of −1 … 1."""
    return (2.0 * np.arange(count) + 1.0) / count - 1.0


def _pattern(kind: str, m: int) -> np.ndarray:
    if kind == "walk":
        steps = np.diff(np.eye(m), axis=0)
        return steps.T @ steps
    return np.eye(m) - 1.0 / m


def deviation_priors(deviations: tuple[Deviation, ...], block: Block) -> tuple[JointPrior, ...]:
    """The priors of the deviations with the sizes that the settings say, or one to begin with."""
    known = block.settings.deviations.sigma_um or {}
    first = FIRST_SIGMA * block.settings.image_sigma_um
    return tuple(one.prior(known.get(one.name, first)) for one in deviations)
