"""Changes of a block that must not change its result, each with the way back.

A transformation gives another `Block` and says where every photograph, point and ray has gone, and by which similarity
the object frame was moved; `mapped_back` reads a result of the new block as one of the old.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block, Control, GnssIns, ImagePoints, Images
from aerotri.observations.block import Constraints, Edits
from aerotri.results.adjusted_block import AdjustedBlock


@dataclass(frozen=True, eq=False)
class Similarity:
    """X' = scale·turn·X + shift of the object frame."""

    turn: np.ndarray
    shift: np.ndarray
    scale: float = 1.0

    @classmethod
    def none(cls) -> Similarity:
        return cls(np.eye(3), np.zeros(3))

    @property
    def turned(self) -> bool:
        return not np.array_equal(self.turn, np.eye(3))

    @property
    def is_none(self) -> bool:
        return self.scale == 1.0 and np.array_equal(self.turn, np.eye(3)) and not self.shift.any()

    def points(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) m; a coordinate that is unknown may stay so as long as it is not mixed with others."""
        if np.array_equal(self.turn, np.eye(3)):
            return self.scale * xyz + self.shift
        plan_only = self.turn[2, 2] == 1.0
        if plan_only:
            plan = xyz[:, :2] @ self.turn[:2, :2].T
            return np.column_stack([self.scale * plan, self.scale * xyz[:, 2]]) + self.shift
        return self.scale * xyz @ self.turn.T + self.shift

    def angles(self, angles: np.ndarray, order: str) -> np.ndarray:
        """(n, 3) rad."""
        out = np.full_like(angles, np.nan)
        known = np.isfinite(angles).all(axis=1)
        out[known] = angles_from_rotation(self.turn @ rotation_from_angles(angles[known], order), order)
        return out


@dataclass(frozen=True, eq=False)
class Changed:
    """Another block of the same measurements.

    Parameters
    ----------
    image, point, ray : rows of the old block's photographs, points and rays in the new one.
    names : new names by old ones, of photographs, points, cameras and strips; those not in it are as they were.
    """

    block: Block
    image: np.ndarray
    point: np.ndarray
    ray: np.ndarray
    frame: Similarity
    names: Mapping[str, str]

    def name(self, old: str) -> str:
        return self.names.get(old, old)


Transformation = Callable[[Block], Changed]


def same(block: Block) -> Changed:
    """The block as it is."""
    rows = (np.arange(len(part)) for part in (block.images, block.points, block.image_points))
    return Changed(block, *rows, Similarity.none(), {})


def permuted(seed: int) -> Transformation:
    """Rows of every table in another order, cameras and points numbered otherwise."""

    def change(block: Block) -> Changed:
        rng = np.random.default_rng(seed)
        image, point, ray, camera = (
            rng.permutation(len(part)) for part in (block.images, block.points, block.image_points, block.cameras)
        )
        # order[k] is the old row that stands in the new row k; where[k] is the new row of the old row k
        to_image, to_point, to_camera = np.argsort(image), np.argsort(point), np.argsort(camera)
        images, rays = block.images, block.image_points
        moved = replace(
            block,
            cameras=tuple(block.cameras[c] for c in camera),
            points=block.points[point],
            images=Images(
                images.names[image], to_camera[images.camera[image]], images.strip[image], images.centre[image],
                images.angles[image], {name: values[image] for name, values in images.columns.items()},
            ),
            image_points=ImagePoints(
                to_image[rays.image[ray]], to_point[rays.point[ray]], rays.xy[ray], rays.sigma[ray]
            ),
            control=_control(block.control, rng.permutation(len(block.control)), to_point),
            gnss_ins=_gnss(block.gnss_ins, rng, to_image),
            edits=_edits(block.edits, rng, to_image, to_point),
            constraints=_constraints(block.constraints, rng, to_point),
        )  # fmt: skip
        return Changed(moved, to_image, to_point, np.argsort(ray), Similarity.none(), {})

    return change


def _control(control: Control, order: np.ndarray, to_point: np.ndarray) -> Control:
    return Control(to_point[control.point[order]], control.xyz[order], control.sigma[order], control.is_check[order])


def _gnss(observed: GnssIns | None, rng: np.random.Generator, to_image: np.ndarray) -> GnssIns | None:
    if observed is None:
        return None
    k = rng.permutation(len(observed))
    o = observed
    return GnssIns(to_image[o.image[k]], o.xyz[k], o.sigma[k], o.angles[k], o.angles_sigma[k], o.time[k])


def _edits(edits: Edits | None, rng, to_image: np.ndarray, to_point: np.ndarray) -> Edits | None:
    if edits is None:
        return None
    k = rng.permutation(len(edits))
    image = np.where(edits.image[k] < 0, -1, to_image[edits.image[k]])
    return Edits(image, to_point[edits.point[k]], edits.action[k], edits.reason[k])


def _constraints(given: Constraints | None, rng, to_point: np.ndarray) -> Constraints | None:
    if given is None:
        return None
    k = rng.permutation(len(given))
    return Constraints(given.kind[k], tuple(to_point[given.points[i]] for i in k), given.value[k], given.sigma[k])


def renamed(block: Block) -> Changed:
    """Photographs, points, strips and cameras called otherwise: sorted the other way round, with blanks, in Unicode."""
    names: dict[str, str] = {}
    for kind, own in (("Foto Ä ", block.images.names), ("Punkt – ", block.points), ("Streifen №", block.images.strip)):
        for k, name in enumerate(dict.fromkeys(own.tolist())):
            if name:
                names[name] = f"{kind}{10**6 - 7 * k if k % 3 else k}{'' if k % 2 else ' ß'}"
    for k, camera in enumerate(block.cameras):
        names[camera.name] = f"Kamera {len(block.cameras) - k} 東"
    return replace(same(with_names(block, names)), names=names)


def by_names(
    block: Block, other: Block, names: Mapping[str, str] | None = None, frame: Similarity | None = None
) -> Changed:
    """The other block as one of the same names in other rows.

    Parameters
    ----------
    names : new names by old ones, where they are not the same. frame : from the old block's to the other's.
    """
    names = names or {}

    def rows(own: np.ndarray, there: np.ndarray) -> np.ndarray:
        place = {name: k for k, name in enumerate(there.tolist())}
        return np.array([place[names.get(name, name)] for name in own.tolist()])

    image, point = rows(block.images.names, other.images.names), rows(block.points, other.points)
    a, b = block.image_points, other.image_points
    place = {pair: k for k, pair in enumerate(zip(b.image.tolist(), b.point.tolist(), strict=True))}
    ray = np.array([place[i, p] for i, p in zip(image[a.image].tolist(), point[a.point].tolist(), strict=True)])
    return Changed(other, image, point, ray, frame or Similarity.none(), names)


def with_names(block: Block, names: Mapping[str, str]) -> Block:
    """The block with other names, in its settings too."""

    def of(values: np.ndarray) -> np.ndarray:
        return np.array([names.get(value, value) for value in values.tolist()], dtype=str)

    images, adjustment = block.images, block.settings.adjustment
    adjustment = replace(
        adjustment,
        datum_points=tuple(names.get(p, p) for p in adjustment.datum_points),
        datum_fixed=tuple((names.get(i, i), element) for i, element in adjustment.datum_fixed),
    )
    return replace(
        block,
        points=of(block.points),
        images=replace(images, names=of(images.names), strip=of(images.strip)),
        cameras=tuple(replace(camera, name=names.get(camera.name, camera.name)) for camera in block.cameras),
        settings=replace(block.settings, adjustment=adjustment),
    )


def moved(turn: np.ndarray, shift: np.ndarray, scale: float = 1.0) -> Transformation:
    """The object frame turned, shifted and in another unit of length, with the standard deviations along.

    Standard deviations are turned with the axes where these only change places; otherwise they have to be the same in
    all directions that are mixed.
    """
    frame = Similarity(np.asarray(turn, float), np.asarray(shift, float), scale)

    def change(block: Block) -> Changed:
        images, control, observed = block.images, block.control, block.gnss_ins
        constraints = block.constraints
        if observed is not None:
            observed = replace(
                observed, xyz=frame.points(observed.xyz), sigma=scale * observed.sigma,
                angles=frame.angles(observed.angles, block.rotation),
            )  # fmt: skip
        if constraints is not None:
            constraints = replace(constraints, value=scale * constraints.value, sigma=scale * constraints.sigma)
        changed = replace(
            block,
            images=replace(
                images, centre=frame.points(images.centre), angles=frame.angles(images.angles, block.rotation)
            ),
            control=replace(control, xyz=frame.points(control.xyz), sigma=scale * control.sigma),
            gnss_ins=observed,
            constraints=constraints,
        )
        return replace(same(changed), frame=frame)

    return change


def about_z(degrees: float) -> np.ndarray:
    """(3, 3) turn about the vertical."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def both(first: Transformation, second: Transformation) -> Transformation:
    """One after the other; at most one of them moves the frame."""

    def change(block: Block) -> Changed:
        one = first(block)
        two = second(one.block)
        frame = one.frame if two.frame.is_none else two.frame
        names = {**two.names, **{old: two.name(new) for old, new in one.names.items()}}
        return Changed(two.block, two.image[one.image], two.point[one.point], two.ray[one.ray], frame, names)

    return change


@dataclass(frozen=True, eq=False)
class Numbers:
    """What of a result has to agree: values by what they are, each with its σ (or scale) in the same unit."""

    values: dict[str, np.ndarray]
    sigmas: dict[str, np.ndarray]
    words: dict[str, object]


def numbers_of(result: AdjustedBlock, changed: Changed) -> Numbers:
    """The result in the rows, names and frame of the old block."""
    f, old = changed.frame, {new: name for name, new in changed.names.items()}
    values: dict[str, np.ndarray] = {}
    sigmas: dict[str, np.ndarray] = {}

    def add(what: str, value: np.ndarray, sigma: np.ndarray | float) -> None:
        values[what], sigmas[what] = value, np.broadcast_to(sigma, np.shape(value))

    images, points, rays = result.images, result.points, result.rays
    covariance = images.covariance[changed.image][:, :3, :3] / f.scale**2
    covariance = np.einsum("ji,njk,kl->nil", f.turn, covariance, f.turn)
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    add("centre", (images.centre[changed.image] - f.shift) @ f.turn / f.scale, sigma)
    add("covariance of centre", covariance, sigma[:, :, None] * sigma[:, None, :])
    rotation = rotation_from_angles(images.angles[changed.image], result.block.rotation)
    sigma_angle = np.nanmin(images.sigma[changed.image][:, 3:], axis=1)
    add("rotation", np.einsum("ji,njk->nik", f.turn, rotation), sigma_angle[:, None, None])
    covariance = points.covariance[changed.point] / f.scale**2
    covariance = np.einsum("ji,njk,kl->nil", f.turn, covariance, f.turn)
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    add("points", (points.xyz[changed.point] - f.shift) @ f.turn / f.scale, sigma)
    add("covariance of points", covariance, sigma[:, :, None] * sigma[:, None, :])
    add("rays of points", points.rays[changed.point].astype(float), 1.0)
    block = result.block
    smallest = np.full(len(block.points), 1.0)
    np.fmin.at(smallest, block.image_points.point, np.nanmin(np.nan_to_num(rays.r, nan=1.0), axis=1))
    add("largest w", points.max_abs_w[changed.point], 1.0 / np.abs(smallest[changed.point]))
    add("v", rays.v[changed.ray], block.image_points.sigma[changed.ray])
    add("r", rays.r[changed.ray], 1.0)
    # rounding of the redundancy number r changes w = −v/(σ√r) the more the smaller r is
    add("w", rays.w[changed.ray], 1.0 / np.abs(rays.r[changed.ray]))
    add("weight", rays.weight[changed.ray], 1.0)
    add("status", rays.status[changed.ray].astype(float), 1.0)
    p = result.parameters
    keys = [f"{name} ({old.get(str(group), str(group))})" for name, group in zip(p.names, p.groups, strict=True)]
    order = np.argsort(keys)
    value, sigma, turned = p.value.copy(), p.sigma.copy(), not np.array_equal(f.turn, np.eye(3))
    of_frame = np.array([is_length(str(name)) for name in p.names], dtype=bool)
    if turned:
        # shifts and drifts are vectors in the object frame
        for rows in vectors(p.names, p.groups):
            value[rows], of_q = f.turn.T @ value[rows], f.turn.T @ p.covariance[np.ix_(rows, rows)] @ f.turn
            sigma[rows] = np.sqrt(np.diagonal(of_q))
    length = np.where(of_frame, f.scale, 1.0)[order]
    add("parameters", value[order] / length, sigma[order] / length)
    add("σ of parameters", sigma[order] / length, sigma[order] / length)
    if not (turned and of_frame.any()):
        add("total correlation", p.total_correlation[order], 1.0)
        add("largest correlation", np.abs(p.max_correlation[order]), 1.0)
    for kind, ground in (("control", result.control), ("check", result.check)):
        row = np.full(len(block.points), -1)
        row[ground.point] = np.arange(len(ground))
        own = row[changed.point]
        own = own[own >= 0]
        scale_of = np.where(np.isnan(ground.sigma[own]), 1.0, ground.sigma[own])
        add(f"d of {kind}", _turned_back(ground.difference[own], f) / f.scale, scale_of / f.scale)
        if np.allclose(f.turn, np.eye(3)):
            add(f"w of {kind}", ground.w[own], 1.0)
            add(f"r of {kind}", ground.r[own], 1.0)
    o = result.outcome
    add("σ0, vᵀPv", np.array([o.sigma0, o.vtpv]), np.array([o.sigma0, o.vtpv]))
    words: dict[str, object] = {
        "status": o.status, "iterations": o.iterations, "redundancy": o.redundancy, "keys": sorted(keys),
        "statuses": [str(p.status[k]) for k in order],
        "blunders": sorted((old.get(b.image, b.image), old.get(b.point, b.point), b.action) for b in result.blunders),
        "groups": sorted((_old_words(g.name, old), g.count) for g in result.groups),
        "warnings": sorted(_old_words(w, old) for w in o.warnings),
        "notes": [_old_words(note, old) for note in o.notes],
    }  # fmt: skip
    return Numbers(values, sigmas, words)


def is_length(name: str) -> bool:
    """Whether a shared parameter is a length in the object frame."""
    return name.startswith(("gnss.shift", "gnss.drift"))


def vectors(names: np.ndarray, groups: np.ndarray) -> list[list[int]]:
    """Rows of the shared parameters that are X, Y, Z of one vector."""
    place = {(str(name), str(group)): k for k, (name, group) in enumerate(zip(names, groups, strict=True))}
    return [
        [k, place[name[:-1] + "Y", group], place[name[:-1] + "Z", group]]
        for (name, group), k in place.items()
        if is_length(name) and name.endswith("X")
    ]


def _turned_back(difference: np.ndarray, frame: Similarity) -> np.ndarray:
    if np.array_equal(frame.turn, np.eye(3)):
        return difference
    if frame.turn[2, 2] == 1.0:
        # plan and height apart: one of them may be unknown
        return np.column_stack([difference[:, :2] @ frame.turn[:2, :2], difference[:, 2]])
    return difference @ frame.turn


def _old_words(text: str, old: Mapping[str, str]) -> str:
    for new in sorted(old, key=len, reverse=True):
        text = text.replace(new, old[new])
    return text


def largest_difference(one: Numbers, other: Numbers) -> dict[str, float]:
    """By what it is, the largest |difference| over σ; infinite where only one of them has a value."""
    found = {}
    for what in one.values.keys() & other.values.keys():
        value, else_, sigma = one.values[what], other.values[what], one.sigmas[what]
        if value.shape != else_.shape or not np.array_equal(np.isnan(value), np.isnan(else_)):
            found[what] = np.inf
            continue
        # a coordinate that is held has no σ: that of its neighbours counts
        usual = float(np.nanmedian(sigma[sigma > 0.0])) if (sigma > 0.0).any() else 1.0
        ratio = np.abs(value - else_) / np.where(sigma > 1e-3 * usual, sigma, usual)
        found[what] = float(np.nanmax(ratio, initial=0.0))
    return found
