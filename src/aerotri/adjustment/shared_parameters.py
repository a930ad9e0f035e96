"""Which unknowns are shared by many rays: interior orientation, additional parameters, GNSS shifts and drifts.

The list made here is the border of the normal equations; `Unknowns` is the only map between it and the vector x.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from aerotri.adjustment.height_columns import HeightColumns, Relief
from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.parallel import run_chunks
from aerotri.conventions import InputError
from aerotri.functional_model._kernels import USUAL
from aerotri.functional_model.additional_parameters import (
    FAMILIES,
    Parameter,
    ParameterSet,
    collocation,
    mark_of,
    parameter_set,
)
from aerotri.functional_model.additional_parameters.beside_field import patterns_of_other_unknowns
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES, parameter_sets
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, interior_row
from aerotri.observations import Block, Camera, Prior
from aerotri.observations.block import INTERIOR_ELEMENTS

FREE = Prior()


@dataclass(frozen=True, eq=False)
class RandomField:
    """Shared parameters that are nodes of a random field: known beforehand together, by its covariance.

    Parameters
    ----------
    columns : of the p nodes in the shared list. items : their names in the family. camera, group : they belong to.
    held : (p, k) patterns that the unknowns beside the field say.
    """

    columns: slice
    items: tuple[str, ...]
    camera: Camera
    group: str
    held: np.ndarray

    def prior_weight(self, sigma_um: float, length_mm: float) -> tuple[np.ndarray, float]:
        """(p, p) 1/mm², the inverse of the covariance of the nodes, and the logarithm of the determinant of that."""
        return collocation.prior_weight(self.camera, self.items, 1e-3 * sigma_um, length_mm, self.held)

    def prior_covariance(self, sigma_um: float, length_mm: float) -> np.ndarray:
        """(p, p) mm², the covariance of the nodes before anything is measured."""
        return collocation.prior_covariance(self.camera, self.items, 1e-3 * sigma_um, length_mm, self.held)


@dataclass
class SharedList:
    """The shared parameters while they are being listed, one entry each."""

    names: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    marks: list[str] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    observed: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)
    fields: list[RandomField] = field(default_factory=list)
    position_errors: list[JointPrior] = field(default_factory=list)
    photograph_fields: list[RandomField] = field(default_factory=list)

    def add(
        self, name: str, group: str, kind: str, mark: str = "", prior: Prior = FREE, start: float | None = None
    ) -> int:
        """Append one parameter; its column. It starts at the value observed, unless `start` says otherwise."""
        self.names.append(name)
        self.groups.append(group)
        self.kinds.append(kind)
        self.marks.append(mark)
        self.start.append(prior.value if start is None else start)
        self.observed.append(prior.value)
        self.sigma.append(np.inf if prior.sigma is None else prior.sigma)
        return len(self.names) - 1

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False)
class LensTable:
    """Interior orientation and lens of every (camera, parameter group) pair: one row each.

    Parameters
    ----------
    base : (L, 24) start values, columns of `INTERIOR_COLUMNS`.
    columns : (L, 24) shared parameter of each element, −1 where it is held.
    of_image : (n,) row of every photograph.
    """

    base: np.ndarray
    columns: np.ndarray
    of_image: np.ndarray

    @property
    def used_columns(self) -> np.ndarray:
        """(L, 0), (L, 15) or (L, 24), `columns` without those that no camera of the block needs."""
        needed = self.base[:, USUAL:-1].any() or (self.columns[:, USUAL:] >= 0).any()
        if needed:
            return self.columns
        return np.ascontiguousarray(self.columns[:, : USUAL if (self.columns >= 0).any() else 0])


def group_of_images(block: Block) -> np.ndarray:
    """(n,) str, the parameter group every photograph belongs to."""
    how = block.settings.adjustment.parameter_groups
    if how == "camera":
        return np.array([block.cameras[c].name for c in block.images.camera], dtype=object)
    if how == "block":
        return np.full(len(block.images), "block", dtype=object)
    if how == "strip":
        return np.asarray(block.images.strip, dtype=object)
    if how not in block.images.columns:
        raise InputError(
            f"parameter_groups names '{how}', images.csv has no such column",
            "use camera, block, strip or a column of images.csv",
            file="block.toml",
        )
    return np.asarray(block.images.columns[how], dtype=object)


def cameras_of_groups(camera: np.ndarray, group: np.ndarray) -> dict[str, int]:
    """How many cameras the photographs of every group have.

    Parameters
    ----------
    camera : (n,) index. group : (n,) str.
    """
    pairs = dict.fromkeys(zip(group.astype(str).tolist(), camera.tolist(), strict=True))
    return Counter(name for name, _ in pairs)


def lens_table(block: Block, images: np.ndarray, shared: SharedList) -> LensTable:
    """Interior and lens unknowns of the photographs `images`, appended to `shared`.

    Interior elements belong to a camera whatever the parameter groups are; brown and lens parameters to a group.
    """
    chosen = dict(block.settings.adjustment.additional_parameters)
    groups = group_of_images(block)[images]
    keys = list(zip(block.images.camera[images].tolist(), groups.tolist(), strict=True))
    rows = {key: row for row, key in enumerate(dict.fromkeys(keys))}
    columns = np.full((len(rows), len(INTERIOR_COLUMNS)), -1, dtype=np.int64)
    removed = np.zeros(columns.shape, dtype=bool)
    made: dict[tuple[str, str], int] = {}
    for (camera_index, group), row in rows.items():
        camera = block.cameras[camera_index]
        for column, name in enumerate(INTERIOR_COLUMNS):
            prior = _interior_prior(camera, name, chosen)
            if prior is None or prior.fixed:
                continue
            owner = camera.name if name in INTERIOR_ELEMENTS else group
            if (name, owner) in block.settings.adjustment.parameters_removed:
                removed[row, column] = True
                continue
            if (name, owner) not in made:
                kind, mark = "interior", ""
                if name not in INTERIOR_ELEMENTS:
                    kind, mark = "additional", FAMILIES[Parameter.of(name).family].mark
                made[name, owner] = shared.add(name, owner, kind, mark, prior)
            columns[row, column] = made[name, owner]
    base = np.array([interior_row(block.cameras[camera]) for camera, _ in rows]).reshape(-1, len(INTERIOR_COLUMNS))
    base[removed] = 0.0
    return LensTable(base, columns, np.array([rows[key] for key in keys], dtype=np.int64))


def _interior_prior(camera: Camera, name: str, chosen: dict[str, tuple[str, ...]]) -> Prior | None:
    """What is known of one interior column; None where it is not an unknown."""
    if name in INTERIOR_ELEMENTS:
        return camera.interior[name]
    parameter = Parameter.of(name)
    if parameter.item not in chosen.get(parameter.family, ()):
        return None
    return (camera.brown if parameter.family == "brown" else camera.lens).get(parameter.item, FREE)


@dataclass(frozen=True, eq=False)
class LinearColumns:
    """Columns of the linear additional parameters at every ray: index (m, k) into the shared list, value (m, 2, k)."""

    index: np.ndarray
    value: np.ndarray


@dataclass(frozen=True, eq=False)
class FamilySets:
    """A linear family: of every combination of camera and group its set, with its first column in the shared list.

    Parameters
    ----------
    of_ray : (m,) combination of every ray.
    """

    sets: dict[int, tuple[ParameterSet, int]]
    of_ray: np.ndarray


@dataclass(frozen=True, eq=False)
class HeldParameters:
    """Linear parameters with a value that is held: of every combination of camera and group those of each family.

    Parameters
    ----------
    sets : with their values. of_ray : (m,) combination of every ray.
    """

    sets: dict[int, list[tuple[ParameterSet, np.ndarray]]]
    of_ray: np.ndarray

    def image_errors(self, xy: np.ndarray) -> np.ndarray | None:
        """(m, 2) mm at positions (m, 2) mm of the rays; None where nothing is held."""
        if not self.sets:
            return None
        errors = np.zeros_like(xy)
        for key, held in self.sets.items():
            own = np.flatnonzero(self.of_ray == key)
            for chosen, values in held:
                errors[own] += chosen.basis(*xy[own].T) @ values
        return errors


RAYS_AT_ONCE = 16_384
"""Rays at which linear parameters are evaluated together [C]: their numbers stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class LinearParameters:
    """The linear additional parameters of a block.

    Parameters
    ----------
    families : one record each.
    held : those with a value that is no unknown.
    heights : the one that depends on the heights of the points; None where there is none.
    """

    families: tuple[FamilySets, ...]
    held: HeldParameters
    heights: HeightColumns | None = None

    def beside(self, family: FamilySets) -> LinearParameters:
        """With one more family."""
        return replace(self, families=(*self.families, family))

    def at(self, relief: Relief) -> LinearParameters:
        """With other heights of the rays."""
        return self if self.heights is None else replace(self, heights=self.heights.at(relief))

    def columns(self, xy: np.ndarray) -> LinearColumns:
        """The columns at positions (m, 2) mm of the rays; what depends on heights comes last."""
        widths = [_width(family.sets) for family in self.families]
        index, value = np.zeros((len(xy), sum(widths)), np.int64), np.zeros((len(xy), 2, sum(widths)))
        begins = range(0, len(xy), RAYS_AT_ONCE)

        def fill(k: int) -> None:
            rays = slice(begins[k], begins[k] + RAYS_AT_ONCE)
            for family, end in zip(self.families, np.cumsum(widths).tolist(), strict=True):
                _fill_columns(family.sets, family.of_ray[rays], xy[rays], index[rays, :end], value[rays, :, :end])

        run_chunks(fill, len(begins), len(xy))
        if self.heights is not None:
            place, pattern = self.heights.columns(xy)
            return LinearColumns(np.hstack([index, place]), np.concatenate([value, pattern], axis=2))
        return LinearColumns(index, value)


def linear_parameters(block: Block, images: np.ndarray, ray_image: np.ndarray, shared: SharedList) -> LinearParameters:
    """Linear additional parameters, appended to `shared`.

    Parameters
    ----------
    images : (n,) photographs used; ray_image : (m,) index into `images`.
    """
    groups = group_of_images(block)[images]
    keys = list(zip(block.images.camera[images].tolist(), groups.tolist(), strict=True))
    number = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    of_ray = np.array([number[key] for key in keys], dtype=np.int64)[ray_image]
    families, heights = [], None
    for family, items in block.settings.adjustment.additional_parameters:
        if family in LINEAR_FAMILIES:
            first: dict[str, int] = {}
            sets: dict[int, tuple[ParameterSet, int]] = {}
            of_camera = _sets_by_camera(block, family, items)
            for (camera, group), key in number.items():
                if camera in of_camera:
                    chosen = _without_removed(block, _without_held(of_camera[camera]), group)
                    if group not in first:
                        first[group] = _add_set(shared, chosen, group)
                        if family == collocation.FAMILY.name:
                            shared.fields.append(random_field(block, chosen, group, first[group]))
                    _refuse_other_values(shared, chosen, first[group])
                    sets[key] = chosen, first[group]
            families.append(FamilySets(sets, of_ray))
            heights = _height_columns(family, families[-1]) or heights
    return LinearParameters(tuple(families), HeldParameters(_held_sets(block, number), of_ray), heights)


def _height_columns(family: str, chosen: FamilySets) -> HeightColumns | None:
    """The column of the item of a family that depends on heights; None where it is not chosen."""
    for item in LINEAR_FAMILIES[family].needs_height:
        sets = {
            key: (one.camera, first + one.items.index(item))
            for key, (one, first) in chosen.sets.items()
            if item in one.items
        }
        if sets:
            return HeightColumns(family, item, sets, chosen.of_ray)
    return None


def _held_sets(block: Block, number: dict[tuple[int, str], int]) -> dict[int, list[tuple[ParameterSet, np.ndarray]]]:
    """The parameters that are held at the value their camera states, by the number of a (camera, group)."""
    chosen = dict(block.settings.adjustment.additional_parameters)
    found = {}
    for (row, group), key in number.items():
        camera = block.cameras[row]
        values = {name: prior.value for name, prior in camera.parameters.items() if prior.value != 0.0}
        for name, prior in camera.parameters.items():
            parameter = Parameter.of(name)
            estimated = parameter.item in chosen.get(parameter.family, ()) and not prior.fixed
            if estimated or (name, group) in block.settings.adjustment.parameters_removed:
                values.pop(name, None)
        if values:
            sets = parameter_sets(values, camera)
            found[key] = [(one, np.array([values[name] for name in one.names])) for one in sets]
    return found


def _sets_by_camera(block: Block, family: str, items: tuple[str, ...]) -> dict[int, ParameterSet]:
    used = sorted(set(block.images.camera.tolist()))
    fitting = [c for c in used if LINEAR_FAMILIES[family].fits(block.cameras[c])]
    # without a fitting camera let parameter_set say what is wrong
    return {c: parameter_set(family, items, block.cameras[c]) for c in fitting or used}


def _without_held(chosen: ParameterSet) -> ParameterSet:
    """The set without what its camera holds."""
    held = {name for name, prior in chosen.camera.parameters.items() if prior.fixed}
    left = tuple(item for name, item in zip(chosen.names, chosen.items, strict=True) if name not in held)
    return replace(chosen, items=left)


def _refuse_other_values(shared: SharedList, chosen: ParameterSet, first: int) -> None:
    """Refuse cameras that share parameters but state different values of them, or hold different ones.

    Raises
    ------
    InputError
    """
    for k, name in enumerate(chosen.names, start=first):
        prior = chosen.camera.parameters.get(name, FREE)
        sigma = np.inf if prior.sigma is None else prior.sigma
        same = k < len(shared) and shared.names[k] == name
        if not same or (shared.observed[k], shared.sigma[k]) != (prior.value, sigma):
            raise InputError(
                f"camera '{chosen.camera.name}' shares its additional parameters with other cameras, which state "
                f"another value of {name} or hold it",
                f'state the same in [camera.{chosen.camera.name}.parameters], or set parameter_groups = "camera"',
                file="block.toml",
            )


def _without_removed(block: Block, chosen: ParameterSet, group: str) -> ParameterSet:
    """The set without what the selection took out of a group."""
    removed = {name for name, where in block.settings.adjustment.parameters_removed if where == group}
    left = tuple(item for name, item in zip(chosen.names, chosen.items, strict=True) if name not in removed)
    return replace(chosen, items=left)


def _add_set(shared: SharedList, chosen: ParameterSet, group: str) -> int:
    """The set appended to the shared list; its first column."""
    first = len(shared)
    for name, item in zip(chosen.names, chosen.items, strict=True):
        prior = chosen.camera.parameters.get(name, FREE)
        shared.add(name, group, "additional", mark_of(chosen.family, item), prior)
    return first


def random_field(block: Block, nodes: ParameterSet, group: str, first: int) -> RandomField:
    """The field whose nodes begin at column `first` of the shared list."""
    held = patterns_of_other_unknowns(nodes.camera, nodes.items, block.settings.adjustment.additional_parameters)
    return RandomField(slice(first, first + len(nodes.items)), nodes.items, nodes.camera, group, held)


def _width(sets: dict[int, tuple[ParameterSet, int]]) -> int:
    """Most columns of a family at a ray."""
    none = np.zeros(0)
    return max(chosen.terms(none, none).index.shape[1] for chosen, _ in sets.values())


def _fill_columns(
    sets: dict[int, tuple[ParameterSet, int]], of_ray: np.ndarray, xy: np.ndarray, index: np.ndarray, value: np.ndarray
) -> None:
    """One family at the rays, into the last columns of index (m, ·) and value (m, 2, ·).

    Parameters
    ----------
    sets : by the numbers in `of_ray` (m,), each with its first column in the shared list.
    """
    width = _width(sets)
    index, value = index[:, index.shape[1] - width :], value[:, :, value.shape[2] - width :]
    for key, (chosen, first) in sets.items():
        own = of_ray == key
        rays = slice(None) if own.all() else own
        terms = chosen.terms(*xy[rays].T)
        k = terms.index.shape[1]
        index[rays, :k], value[rays, :, :k] = terms.index + first, terms.value
