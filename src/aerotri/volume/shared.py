"""What two surfaces share: errors of one adjustment, measurements that are in both, control and camera of two epochs.

[D] The volume between two surfaces of one adjustment is one functional over the pickets of both, with the gradient
g = g' − g'' where a picket is in both. Its response to the adjustment is c = c' − c'', so that whatever moves both
surfaces alike (the datum, the camera, the orientation of their photographs) counts by its difference alone, and its
noise is that of g: a measurement that is in both cancels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, KDTree

from aerotri.adjustment import rigging
from aerotri.adjustment.scanning import READOUT
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import noise_beside_field
from aerotri.volume.parts import Measured, Part
from aerotri.volume.pickets import Pickets
from aerotri.volume.response import Response, control_response, control_responses, respond, respond_to_all
from aerotri.volume.roughness import Between

OF_CAMERA = ("interior", "additional", rigging.KIND)
"""Kinds of unknowns that belong to a camera and outlast a flight."""
SAME_PLACE_M = 1e-6
"""Pickets at one place with one height, in the same photographs, are the same measurement."""


def adjustment_key(calibration: Adjustment) -> str:
    """A short text that two adjustments have in common only when they are the same one."""
    system, state = calibration.system, calibration.solution.state
    digest = hashlib.sha256("\n".join(system.unknowns.block.images.names.astype(str)).encode())
    for values in (system.unknowns.origin, state.centre, state.rotation, state.points, state.shared):
        digest.update(np.ascontiguousarray(values, dtype=float).tobytes())
    digest.update(f"{calibration.local.outcome.sigma0:.9e}".encode())
    return digest.hexdigest()[:32]


def same_adjustment(first: Part, second: Part) -> bool:
    """Whether two surfaces were measured in one adjustment."""
    one, other = first.calibration, second.calibration
    return one is other or adjustment_key(one) == adjustment_key(other)


def difference_part(surface: Part, base: Part, corrected: bool, of_side: bool = False) -> tuple[Part, float]:
    """The share of the difference of two surfaces of one adjustment, and which part of it was measured once, 0 … 1.

    Parameters
    ----------
    base : responses to its own volume, counted positive. corrected : as of `respond`. of_side : of a cut or a fill.
    """
    if surface.measured is None or base.measured is None:
        raise ValueError("the pickets of both surfaces are needed")
    joint, common = _joined(surface.measured, base.measured)
    response = respond(surface.calibration, joint.pickets, joint.gradient, corrected)
    # where both have the same heights, nothing lies between them
    between = both_between([(surface.between, 1.0 - common[0]), (base.between, 1.0 - common[1])], of_side)
    rays = len(joint.pickets.image)
    part = Part(surface.calibration, response, between, len(joint.pickets), rays, surface.unseen + base.unseen, joint)
    return part, float(min(common))


def difference_responses(pairs: Sequence[tuple[Part, Part]]) -> list[Response]:
    """The responses of first less second functionals, all of the same pickets of two surfaces of one adjustment."""
    joints = [_joined(_measured_of(one), _measured_of(other))[0] for one, other in pairs]
    return respond_to_all(pairs[0][0].calibration, joints[0].pickets, [joint.gradient for joint in joints])


def _measured_of(part: Part) -> Measured:
    if part.measured is None:
        raise ValueError("the pickets of both surfaces are needed")
    return part.measured


def summed_part(parts: Sequence[Part], corrected: bool) -> Part:
    """The share of the sum of several volumes of one surface: a measurement that is in two of them counts in both.

    Parameters
    ----------
    corrected : as of `respond`.
    """
    kept: list[Measured] = []
    for part in parts:
        if part.measured is None:
            raise ValueError("the pickets of all parts are needed")
        used = part.measured.gradient.any(axis=1)
        kept.append(Measured(part.measured.pickets.take(np.flatnonzero(used)), part.measured.gradient[used]))
    pickets = _stacked([one.pickets for one in kept])
    _, place, number = np.unique(_keys(pickets), axis=0, return_index=True, return_inverse=True)
    gradient = np.zeros((len(place), 3))
    np.add.at(gradient, number.ravel(), np.concatenate([one.gradient for one in kept]))
    joint = Measured(pickets.take(place), gradient)
    first, known = parts[0], [part.between for part in parts if part.between is not None]
    between = Between(sum(b.curvature for b in known), sum(b.variance for b in known)) if known else None
    response = respond(first.calibration, joint.pickets, gradient, corrected)
    unseen = sum(part.unseen for part in parts)
    # patches are those of the whole surface: one that reaches into two volumes errs in both
    each = [part.bridged for part in parts if part.bridged is not None]
    bridged = np.sum(each, axis=0) if each else None
    return Part(
        first.calibration, response, between, len(joint.pickets), len(joint.pickets.image), unseen, joint,
        first.lasting, bridged=bridged,
    )  # fmt: skip


def _stacked(pickets: Sequence[Pickets]) -> Pickets:
    """All of them one after the other."""
    counts = np.concatenate([np.diff(one.start) for one in pickets])
    rows = (np.concatenate(part) for part in zip(
        *((one.xyz, one.image, one.sigma_mm, one.noise_share) for one in pickets), strict=True
    ))  # fmt: skip
    xyz, image, sigma, share = rows
    return Pickets(xyz, np.concatenate([[0], np.cumsum(counts)]), image, sigma, share)


def _joined(first: Measured, second: Measured) -> tuple[Measured, tuple[float, float]]:
    """The pickets of both, each once, with g' − g''; and the share of either's weight that is in both."""
    one, other = first.pickets, second.pickets
    both = _stacked([one, other])
    _, place, number = np.unique(_keys(both), axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    gradient = np.zeros((len(place), 3))
    np.add.at(gradient, number[: len(one)], first.gradient)
    np.subtract.at(gradient, number[len(one) :], second.gradient)
    shares = []
    sides = (number[: len(one)], number[len(one) :])
    for own, rest, measured in zip(sides, sides[::-1], (first, second), strict=True):
        weight = np.abs(measured.gradient[:, 2])
        shares.append(float(weight[np.isin(own, rest)].sum() / max(weight.sum(), 1e-300)))
    return Measured(both.take(place), gradient), (shares[0], shares[1])


def _keys(pickets: Pickets) -> np.ndarray:
    """(k, 6) whole numbers, equal for the same place, height and photographs."""
    place = np.rint(pickets.xyz / SAME_PLACE_M).astype(np.int64)
    first, count = pickets.start[:-1], np.diff(pickets.start)
    image = pickets.image.astype(np.int64) + 1
    sums = [np.add.reduceat(values, first) for values in (image, image**2)] if len(first) else [count, count]
    return np.column_stack([place, count, *sums])


def places_apart(surface: Part, base: Part) -> float:
    """How far the points of a base lie from those of the surface, 0 … 1: 0 at the same places, 1 independent of them.

    Straight triangles of the base lose of a cut and a fill beside what those of the surface lose. Between points at the
    same places both have the same triangles, and what they lose together the heights of the surface over the base tell
    already. [C] Between linearly in the mean square of the distance to the next point of the surface, whose mean is a/6
    for places at random among squares of area a.
    """
    if surface.measured is None or base.measured is None:
        return 1.0
    xy, own = surface.measured.pickets.xyz[:, :2], base.measured.gradient[:, 2] != 0.0
    if len(xy) < 3 or not own.any():
        return 1.0
    area = float(ConvexHull(xy - xy.mean(axis=0)).volume) / len(xy)
    distance = KDTree(xy).query(base.measured.pickets.xyz[own, :2])[0]
    return float(min(np.mean(np.minimum(np.square(distance), 0.5 * area)) / (area / 6.0), 1.0))


def both_between(parts: Sequence[tuple[Between | None, float]], of_side: bool) -> Between | None:
    """The ground between the heights of a surface, and of its base where that is measured too.

    Parameters
    ----------
    parts : of the surface and of the base, and which share of each counts.
    of_side : of a cut or a fill: either is told as what that volume holds beyond the straight lines. Else the base's is
        what lies under the base.
    """
    known = [(1.0 if of_side or not k else -1.0, *part) for k, part in enumerate(parts)]
    found = [(sign, between, share) for sign, between, share in known if between is not None]
    if not found:
        return None
    return Between(
        sum(sign * between.curvature * share for sign, between, share in found),
        sum(between.variance * share for _, between, share in found),
    )


def shared_control_covariance(first: Part, second: Part) -> float:
    """Covariance of two functionals adjusted in blocks of their own that share control points.

    [D] An error of a given coordinate moves both: Σ h'·h''·σ² over the coordinates shared, h = ∂V/∂(given coordinate).
    """
    rows, variance = _shared_control(first.calibration, second.calibration)
    h, k = (control_response(one.calibration, one.response) for one in (first, second))
    total = float(np.sum(h[rows[0]] * k[rows[1]] * variance))
    s0 = [noise_beside_field(one.calibration) for one in (first, second)]
    return s0[0] * s0[1] * total


def shared_camera_covariance(first: Part, second: Part) -> float:
    """Covariance of two functionals adjusted in blocks of their own that took values of one camera from a calibration.

    [D] As of control: the error of a value that both observed moves both, h'·h''·σ², h = ∂V/∂(observed value).
    """
    sides = [_observed_camera(one.calibration, one.response.solved) for one in (first, second)]
    common = sides[0].keys() & sides[1].keys()
    s0 = [noise_beside_field(one.calibration) for one in (first, second)]
    return s0[0] * s0[1] * float(sum(sides[0][key] * sides[1][key] / key[3] for key in sorted(common)))


def shared_covariances(
    calibrations: tuple[Adjustment, Adjustment], solved: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """(n, 3, 3) covariances of n places of one adjustment with those of another, by control and camera they share.

    Parameters
    ----------
    solved : (6n + s, n, 3) solutions Q·c for the coordinates of the places, of either adjustment.
    """
    rows, variance = _shared_control(*calibrations)
    h, k = (
        control_responses(one, columns.reshape(len(columns), -1), own).reshape(len(own), 3, *columns.shape[1:])
        for one, columns, own in zip(calibrations, solved, rows, strict=True)
    )
    total = np.einsum("pcna,pcnb,pc->nab", h, k, variance, optimize=True)
    first, second = (_observed_camera(one, columns) for one, columns in zip(calibrations, solved, strict=True))
    for key in sorted(first.keys() & second.keys()):
        total += first[key][:, :, None] * second[key][:, None, :] / key[3]
    s0 = [noise_beside_field(one) for one in calibrations]
    return s0[0] * s0[1] * total


def _observed_camera(calibration: Adjustment, solved: np.ndarray) -> dict[tuple[str, str, float, float], np.ndarray]:
    """∂V (…) by every observed value of a camera: by name, camera, value and weight 1/σ².

    Parameters
    ----------
    solved : (6n + s, …) Q·c.
    """
    shared, priors = calibration.system.unknowns.shared, calibration.system.priors
    own = solved[len(solved) - len(shared) :]
    return {
        (str(name), str(group), float(value), float(weight)): weight * by
        for name, group, kind, value, weight, by in zip(
            shared.names, shared.groups, shared.kinds, priors.value, priors.weight, own, strict=True
        )
        if weight > 0.0 and (kind in OF_CAMERA or name == READOUT)
    }


def shared_in_words(first: Part, second: Part, names: tuple[str, str] = ("surface", "base")) -> str:
    """A sentence about what two adjustments have in common as far as it is known.

    Parameters
    ----------
    names : of the two, as the sentence calls them.
    """
    points = int(_shared_control(first.calibration, second.calibration)[1].any(axis=1).sum())
    observed = [_observed_camera(one.calibration, one.response.solved).keys() for one in (first, second)]
    values = len(observed[0] & observed[1])
    images = [set(one.calibration.result.block.images.names.astype(str).tolist()) for one in (first, second)]
    photographs = len(images[0] & images[1])
    said = f"{names[0]} and {names[1]} come from two adjustments, taken for independent"
    common = [f"the {points} control points that both have with the same coordinates"] if points else []
    if values:
        common.append(f"the {values} values of the camera that both took with the same σ")
    if common:
        said += f" but for {' and '.join(common)}"
    if photographs:
        said += (
            f"; {photographs} photographs have the same names in both: what their image points and their camera "
            "share is not taken into account"
        )
    else:
        said += "; what a camera or a GNSS base that both used would share is not known"
    return said


def _shared_control(first: Adjustment, second: Adjustment) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Control points of both: their rows in either system, and the variances (p, 3) of equal coordinates, else 0."""
    sides = []
    for one in (first, second):
        row = {int(point): k for k, point in enumerate(one.system.unknowns.points)}
        block = one.result.block
        sides.append({
            str(block.points[point]): (row[int(point)], xyz, sigma)
            for point, xyz, sigma, check in zip(
                block.control.point, block.control.xyz, block.control.sigma, block.control.is_check, strict=True
            )
            if not check and int(point) in row
        })  # fmt: skip
    names = sorted(sides[0].keys() & sides[1].keys())
    variance = np.zeros((len(names), 3))
    for k, name in enumerate(names):
        (_, xyz, sigma), (_, other, _) = sides[0][name], sides[1][name]
        same = np.isfinite(xyz) & (np.abs(xyz - other) < 1e-6)
        variance[k] = np.where(same, np.nan_to_num(sigma) ** 2, 0.0)
    rows = [np.array([side[name][0] for name in names], dtype=np.int64) for side in sides]
    return (rows[0], rows[1]), variance
