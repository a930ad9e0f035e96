"""A block as the cross-check's own adjustment sees it: one vector of unknowns, its observations, what is held.

The vector x holds six values a photograph (X0, Y0, Z0, ω, φ, κ), then the shared entries owner by owner, then three
values a point. Everything is taken from the `Block` and from which rays took part; the adjustment's own set-up is not
looked at, so that a mistake there shows as a difference.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.crosscheck.paper_families import LINEAR, unknown_parameters
from aerotri.crosscheck.paper_rays import ELEMENTS, INTERIOR
from aerotri.observations import Block, Prior

Owner = tuple[str, str]
"""What a shared entry belongs to: ('camera', name), ('group', name) or ('gnss', strip)."""

Removed = frozenset[tuple[str, str]]
"""Names and groups of parameters."""

MOST_NAMED = 12
"""Parameters of a family that are named one by one [C]: more fill the message, and stand in the block's settings."""


class UnknownToPaperError(Exception):
    """The block has observations or parameters for which no independent formula stands here."""


@dataclass(frozen=True, eq=False)
class Shared:
    """Shared entries in the order of x; those of one owner stand together.

    Parameters
    ----------
    names, owners : of the s entries. start : (s,). sigma : (s,) of observed ones, ∞ elsewhere. free : (s,) bool.
    """

    names: tuple[str, ...]
    owners: tuple[Owner, ...]
    start: np.ndarray
    sigma: np.ndarray
    free: np.ndarray

    def place(self) -> dict[tuple[str, Owner], int]:
        return {key: i for i, key in enumerate(zip(self.names, self.owners, strict=True))}

    def spans(self) -> dict[Owner, slice]:
        """The entries of every owner."""
        first: dict[Owner, int] = {}
        for i, owner in enumerate(self.owners):
            first.setdefault(owner, i)
        ends = [*list(first.values())[1:], len(self.owners)]
        return {owner: slice(begin, end) for (owner, begin), end in zip(first.items(), ends, strict=True)}


@dataclass(frozen=True, eq=False)
class PaperRays:
    """The m rays, sorted by point.

    Parameters
    ----------
    image, point, setup : (m,) rows; xy, inv_sigma : (m, 2). at : (m, 2) mm, where parameters are evaluated.
    elements : (S, 24) shared entry of every element of `paper_rays.ELEMENTS`, for each setup (camera and group).
    linear : (S, q) shared entries of the linear patterns, −1 where a setup has fewer; patterns : (m, 2, q) mm, 0 there.
    """

    image: np.ndarray
    point: np.ndarray
    setup: np.ndarray
    xy: np.ndarray
    at: np.ndarray
    inv_sigma: np.ndarray
    elements: np.ndarray
    linear: np.ndarray
    patterns: np.ndarray


@dataclass(frozen=True, eq=False)
class Antennas:
    """Observed antenna positions, g of them: photograph, local position (g, 3), 1/σ (0 where not observed), shared
    entries of shift and drift (g, 3; −1 where there is none), seconds from the strip's mean (g,), lever arm (3,) m."""

    image: np.ndarray
    xyz: np.ndarray
    inv_sigma: np.ndarray
    shift: np.ndarray
    drift: np.ndarray
    since: np.ndarray
    lever_arm: np.ndarray


@dataclass(frozen=True, eq=False)
class PaperBlock:
    """Observations and unknowns of the independent adjustment.

    Parameters
    ----------
    images, points : rows of the block that take part. origin : (3,) m. order : of the angles.
    point_value, point_inv_sigma : (P, 3) observed coordinates, local; 1/σ is 0 where not observed.
    point_held : (P, 3) bool, coordinates without error, at `point_value`.
    """

    images: np.ndarray
    points: np.ndarray
    origin: np.ndarray
    order: str
    shared: Shared
    rays: PaperRays
    antennas: Antennas | None
    point_value: np.ndarray
    point_inv_sigma: np.ndarray
    point_held: np.ndarray

    @property
    def observations(self) -> int:
        count = 2 * len(self.rays.image) + int((self.point_inv_sigma > 0.0).sum())
        count += int((np.isfinite(self.shared.sigma) & self.shared.free).sum())
        return count + (0 if self.antennas is None else int((self.antennas.inv_sigma > 0.0).sum()))


def paper_block(
    block: Block,
    used: np.ndarray,
    weight: np.ndarray,
    origin: np.ndarray,
    at: np.ndarray | None = None,
    removed: Removed = frozenset(),
) -> PaperBlock:
    """The block for an independent adjustment.

    Parameters
    ----------
    used : (m,) bool, rays that take part. weight : (m,) robust factors, kept as they are. origin : (3,) m, local.
    at : (m, 2) mm, where parameters that are functions of the position are evaluated; as measured where None.
    removed : additional parameters that a selection took out.

    Raises
    ------
    UnknownToPaperError
    """
    _refuse_unknown(block)
    rows = np.flatnonzero(used)
    rows = rows[np.lexsort((block.image_points.image[rows], block.image_points.point[rows]))]
    images, image = np.unique(block.image_points.image[rows], return_inverse=True)
    points, point = np.unique(block.image_points.point[rows], return_inverse=True)
    groups = _groups(block)[images]
    entries = _Entries(removed)
    setups = list(dict.fromkeys(zip(block.images.camera[images].tolist(), groups.tolist(), strict=True)))
    elements = np.array([_element_entries(block, *setup, entries) for setup in setups])
    linear = [_linear_entries(block, *setup, entries) for setup in setups]
    antennas = _antennas(block, images, origin, entries)
    shared, place = entries.sorted()
    number = {setup: k for k, setup in enumerate(setups)}
    of_image = [number[key] for key in zip(block.images.camera[images].tolist(), groups.tolist(), strict=True)]
    setup = np.array(of_image)[image]
    xy = block.image_points.xy[rows]
    inv_sigma = np.sqrt(weight[rows])[:, None] / block.image_points.sigma[rows]
    there = xy if at is None else at[rows]
    lines, values = _patterns(block, setups, linear, setup, there)
    return PaperBlock(
        images, points, origin, block.rotation, shared,
        PaperRays(image, point, setup, xy, there, inv_sigma, place[elements], _final(lines, place), values),
        None if antennas is None else _replaced(antennas, place),
        *_control(block, points, origin),
    )  # fmt: skip


def _refuse_unknown(block: Block) -> None:
    settings, observed = block.settings, block.gnss_ins
    free = settings.adjustment.is_free
    unknown = ", ".join(parameters_text(unknown_parameters(all_parameters(block))))
    refused = [
        (block.crs != "local", f"a block in {block.crs}, which is not the frame of its adjustment"),
        (block.constraints is not None and len(block.constraints) > 0, "conditions between points"),
        (observed is not None and np.isfinite(observed.angles).any(), "observed attitudes"),
        (observed is not None and free, "a free datum beside observed projection centres"),
        (settings.gnss.lever_arm_sigma_m is not None, "a free lever arm"),
        (settings.gnss.time_offset != "off", "a time offset of GNSS"),
        (settings.deviations.kind != "free", "deviations from group to group"),
        (settings.gnss.correlated != "off", "GNSS errors that stay for a while"),
        (settings.gnss.noise_factor not in (None, (1.0, 1.0)), "a factor of the σ of GNSS"),
        (settings.refraction != "off" or settings.earth_curvature != "off", "refraction and earth curvature"),
        (settings.photograph_fields.correlated != "off", "smooth errors of single photographs"),
        (bool(unknown), f"the parameters {unknown}"),
    ]
    for there, what in refused:
        if there:
            raise UnknownToPaperError(f"no independent formula stands here for {what}")


def all_parameters(block: Block) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """The parameters of the linear and interior families that act, estimated or held at a value: (family, items)."""
    found = {family: list(items) for family, items in block.settings.adjustment.additional_parameters}
    for camera in block.cameras:
        for name in camera.parameters:
            family, _, item = name.partition(".")
            found.setdefault(family, []).append(item)
    return tuple((family, tuple(dict.fromkeys(items))) for family, items in found.items())


def parameters_text(parameters: tuple[tuple[str, tuple[str, ...]], ...]) -> list[str]:
    """Parameters, (family, items) pairs, in words: 'dmc.29', or the family alone where there are many."""
    words = []
    for family, items in parameters:
        words += [f"{family}.{item}" for item in items] if len(items) <= MOST_NAMED else [family]
    return words


def _groups(block: Block) -> np.ndarray:
    """(n,) str, the parameter group of every photograph."""
    how = block.settings.adjustment.parameter_groups
    if how == "camera":
        return np.array([block.cameras[k].name for k in block.images.camera], dtype=object)
    if how == "block":
        return np.array(["block"] * len(block.images), dtype=object)
    return np.asarray(block.images.strip if how == "strip" else block.images.columns[how], dtype=object)


class _Entries:
    """Shared entries while they are listed; numbered as they come, put in order of their owners at the end."""

    def __init__(self, removed: Removed) -> None:
        self._removed = removed
        self._rows: dict[tuple[str, Owner], tuple[int, float, float, bool]] = {}

    def add(self, name: str, owner: Owner, prior: Prior) -> int:
        """The provisional number of an entry; the first to name it says what is known of it."""
        if owner[0] == "group" and (name, owner[1]) in self._removed:
            prior = Prior(0.0, fixed=True)
        sigma = np.inf if prior.sigma is None else prior.sigma
        return self._rows.setdefault((name, owner), (len(self._rows), prior.value, sigma, not prior.fixed))[0]

    def is_removed(self, name: str, group: str) -> bool:
        """Whether a selection took a parameter out of a group."""
        return (name, group) in self._removed

    def sorted(self) -> tuple[Shared, np.ndarray]:
        """The entries, and the final place of every provisional number."""
        keys = list(self._rows)
        owners = list(dict.fromkeys(owner for _, owner in keys))
        order = sorted(range(len(keys)), key=lambda i: owners.index(keys[i][1]))
        place = np.empty(len(keys), np.int64)
        place[order] = np.arange(len(keys))
        start, sigma, free = (np.array([self._rows[keys[i]][k] for i in order]) for k in (1, 2, 3))
        names, groups = tuple(keys[i][0] for i in order), tuple(keys[i][1] for i in order)
        return Shared(names, groups, start, sigma, free.astype(bool)), place


def _element_entries(block: Block, camera_row: int, group: str, entries: _Entries) -> list[int]:
    camera = block.cameras[camera_row]
    chosen = dict(block.settings.adjustment.additional_parameters)
    numbers = []
    for element in ELEMENTS:
        if element in INTERIOR:
            numbers.append(entries.add(element, ("camera", camera.name), camera.interior[element]))
            continue
        if element == "lens.fisheye":
            numbers.append(entries.add(element, ("camera", camera.name), Prior(float(camera.is_fisheye), fixed=True)))
            continue
        family, item = element.split(".")
        known = (camera.brown if family == "brown" else camera.lens).get(item)
        estimated = item in chosen.get(family, ()) and not (known is not None and known.fixed)
        if estimated:
            numbers.append(entries.add(element, ("group", group), known or Prior()))
        else:
            value = 0.0 if known is None else known.value
            numbers.append(entries.add(element, ("camera", camera.name), Prior(value, fixed=True)))
    return numbers


_Linear = tuple[str, str, int]
"""Family, item and number of an entry."""


def _linear_entries(block: Block, camera_row: int, group: str, entries: _Entries) -> list[_Linear]:
    """Entries of the linear families of a camera and group: (family, item, number)."""
    camera, chosen = block.cameras[camera_row], dict(block.settings.adjustment.additional_parameters)
    found = []
    for family, items in all_parameters(block):
        if family not in LINEAR or not LINEAR[family].fits(camera):
            continue
        for item in items:
            name = f"{family}.{item}"
            stated = camera.parameters.get(name)
            if item in chosen.get(family, ()) and not (stated is not None and stated.fixed):
                found.append((family, item, entries.add(name, ("group", group), stated or Prior())))
            elif stated is not None and not entries.is_removed(name, group):
                held = Prior(stated.value, fixed=True)
                found.append((family, item, entries.add(name, ("camera", camera.name), held)))
    return found


def _patterns(
    block: Block, setups: list[tuple[int, str]], linear: list[list[_Linear]], setup: np.ndarray, xy: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Entries (S, q) and patterns (m, 2, q) of the linear families at the rays."""
    width = max((len(found) for found in linear), default=0)
    entries, values = np.full((len(setups), width), -1), np.zeros((len(xy), 2, width))
    for k, (camera_row, _) in enumerate(setups):
        own = np.flatnonzero(setup == k)
        entries[k, : len(linear[k])] = [number for _, _, number in linear[k]]
        for family in dict.fromkeys(family for family, _, _ in linear[k]):
            columns = [c for c, (f, _, _) in enumerate(linear[k]) if f == family]
            items = tuple(linear[k][c][1] for c in columns)
            values[own[:, None, None], np.arange(2)[:, None], columns] = LINEAR[family].patterns(
                block.cameras[camera_row], xy[own, 0], xy[own, 1], items
            )
    return entries, values


def _control(block: Block, points: np.ndarray, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    value, inv_sigma = np.zeros((len(points), 3)), np.zeros((len(points), 3))
    held = np.zeros((len(points), 3), dtype=bool)
    if block.settings.adjustment.datum == "control":
        row = {int(p): k for k, p in enumerate(points)}
        control, in_use = block.control, _control_in_use(block)
        for k in range(len(control)):
            at = row.get(int(control.point[k]))
            if at is not None and in_use[k]:
                known = np.isfinite(control.xyz[k])
                value[at, known] = (control.xyz[k] - origin)[known]
                held[at] = known & (control.sigma[k] == 0.0)
                observed = known & ~held[at]
                inv_sigma[at, observed] = 1.0 / control.sigma[k, observed]
    return value, inv_sigma, held


def _control_in_use(block: Block) -> np.ndarray:
    """(k,) bool, what is control after the operator's decisions; what is off stays off."""
    in_use, off = ~block.control.is_check, np.zeros(len(block.control), dtype=bool)
    if block.edits is not None:
        for image, point, action in zip(block.edits.image, block.edits.point, block.edits.action, strict=True):
            own = (block.control.point == point) & (image < 0)
            off |= own & (action == "off")
            in_use[own] = action == "control"
    return in_use & ~off


def _antennas(block: Block, images: np.ndarray, origin: np.ndarray, entries: _Entries) -> Antennas | None:
    observed, settings = block.gnss_ins, block.settings.gnss
    if observed is None:
        return None
    row = {int(i): k for k, i in enumerate(images)}
    used = [g for g in range(len(observed)) if int(observed.image[g]) in row and np.isfinite(observed.xyz[g]).any()]
    if not used:
        return None
    strips = [str(block.images.strip[i]) for i in observed.image[used]]
    known = np.isfinite(observed.xyz[used])
    columns = []
    for what, per in (("shift", settings.shift), ("drift", settings.drift)):
        column = np.full((len(used), 3), -1)
        for g, strip in enumerate(strips if per == "strip" else ["block"] * len(used)):
            for axis in np.flatnonzero(known[g]) if per != "off" else ():
                column[g, axis] = entries.add(f"gnss.{what}_{'XYZ'[axis]}", ("gnss", strip), Prior())
        columns.append(column)
    since = np.nan_to_num(observed.time[used])
    for strip in set(strips):
        own = np.array([s == strip for s in strips])
        since[own] -= since[own].mean()
    return Antennas(
        image=np.array([row[int(i)] for i in observed.image[used]]),
        xyz=np.where(known, observed.xyz[used] - origin, 0.0),
        inv_sigma=np.where(known, 1.0 / np.where(known, observed.sigma[used], 1.0), 0.0),
        shift=columns[0],
        drift=columns[1],
        since=since,
        lever_arm=np.array(settings.lever_arm_m, dtype=float),
    )


def _replaced(antennas: Antennas, place: np.ndarray) -> Antennas:
    """The antennas with the final places of their entries."""
    return replace(antennas, shift=_final(antennas.shift, place), drift=_final(antennas.drift, place))


def _final(numbers: np.ndarray, place: np.ndarray) -> np.ndarray:
    return np.where(numbers >= 0, place[np.maximum(numbers, 0)], -1)
