"""A block from its CRS into the local frame before the adjustment, and the result back into the CRS after it.

What is measured keeps its meaning: coordinates are transformed exactly, attitudes turn with the axes of the CRS at the
projection centre. Standard deviations go through the partials of the transformation; of the covariance that this gives
a control or GNSS position only the variances are kept [C], since axes differ by no more than the convergence and the
tilt of the vertical within the block: 0.0016 rad at 10 km from the origin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.local_frame import LocalFrame, local_frame
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block, Control, GnssIns, Images
from aerotri.observations.block import Constraints

FAR_SIZES = 10.0
"""Distance between start values and what is observed, in sizes of the larger area, beyond which they are in other axes
[C]: photographs of one block lie above its control."""


def frame_of_block(block: Block, geoid: FilePath | None = None, origin: np.ndarray | None = None) -> LocalFrame:
    """The local frame of a block with a CRS: around its control points, projection centres and GNSS positions.

    Parameters
    ----------
    geoid, origin : see `local_frame`.
    """
    return local_frame(block.crs, places_of(_observed_places(block), block.images.centre), geoid, origin)


def _observed_places(block: Block) -> np.ndarray:
    """(n, 3) control points and GNSS positions."""
    return np.concatenate([block.control.xyz, *([] if block.gnss_ins is None else [block.gnss_ins.xyz])])


def starts_elsewhere(block: Block) -> bool:
    """Whether start values of photographs are in axes of their own: far from control points and GNSS positions."""
    return _is_elsewhere(block.images.centre, _observed_places(block))


def places_of(observed: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(n, 3) where a block lies in its CRS: what is observed, and start values of photographs unless in other axes.

    Start values of other programs count in axes of their own as a rule. Their place says nothing then, and a frame
    halfway to it would change lengths and σ of what is observed.

    Parameters
    ----------
    observed : (k, 3) control points and GNSS positions. start : (m, 3) projection centres. NaN where unknown.
    """
    return observed if _is_elsewhere(start, observed) else np.concatenate([observed, start])


def _is_elsewhere(start: np.ndarray, observed: np.ndarray) -> bool:
    one, other = (xyz[np.isfinite(xyz[:, :2]).all(axis=1), :2] for xyz in (start, observed))
    if not len(one) or not len(other):
        return False
    size = max(float(np.ptp(plan, axis=0).max()) for plan in (one, other))
    return bool(np.linalg.norm(np.median(one, axis=0) - np.median(other, axis=0)) > FAR_SIZES * size)


def needs_positions(block: Block) -> bool:
    """Whether control or GNSS with missing coordinates makes the transformation depend on what is not measured."""
    observed = [block.control.xyz] + ([] if block.gnss_ins is None else [block.gnss_ins.xyz])
    if block.constraints is not None and len(block.constraints):
        return True
    return any(_partly_known(xyz).any() for xyz in observed)


def transform_block(
    block: Block, frame: LocalFrame, points: np.ndarray | None = None, centres: np.ndarray | None = None
) -> Block:
    """The block in the local frame, with crs 'local'.

    A height-only or plan-only point has local coordinates only together with its other coordinates. They are taken
    from `points`; a wrong plan position moves the local height by its error times the distance from the origin over
    the earth's radius. So where `needs_positions`, transform again with what was adjusted and adjust again, until
    nothing moves: from a first guess 1 km off, 10 km from the origin, two times.

    Parameters
    ----------
    points, centres : (N, 3), (n, 3) m in the frame, approximate positions of the block's points and photographs, NaN
        where not known; None: points below the photographs that see them, at the mean height of the control, and
        photographs at their start values.

    Raises
    ------
    InputError
        When the block asks for an earth curvature correction, which the frame makes needless.
    """
    if block.crs != frame.crs:
        raise ValueError(f"block in {block.crs}, frame for {frame.crs}")
    if block.settings.earth_curvature != "off":
        raise InputError(
            f"earth_curvature is a correction for local blocks; a block in {block.crs} needs none",
            'set earth_curvature = "off"',
            file="block.toml",
        )
    images = _images_to_local(block.images, frame, block.rotation)
    control = _control_to_local(block, frame, points)
    gnss_ins = None if block.gnss_ins is None else _gnss_to_local(block, block.gnss_ins, frame, centres)
    constraints = None if block.constraints is None else _constraints_to_local(block.constraints, frame, points)
    return replace(block, crs="local", images=images, control=control, gnss_ins=gnss_ins, constraints=constraints)


def _constraints_to_local(constraints: Constraints, frame: LocalFrame, points: np.ndarray | None) -> Constraints:
    """Conditions with the axes of the CRS at their place: plumb lines and heights are those there, not the frame's."""
    places = np.zeros((len(constraints), 3))
    if points is not None:
        places = np.array([points[members].mean(axis=0) for members in constraints.points]).reshape(-1, 3)
    return replace(constraints, axes=frame.axes_at(frame.from_local(np.nan_to_num(places))))


def _images_to_local(images: Images, frame: LocalFrame, order: str) -> Images:
    place = completed(images.centre, _middle_of(images.centre, frame))
    centre = np.where(np.isfinite(images.centre), frame.to_local(place), np.nan)
    return replace(images, centre=centre, angles=_angles_to_local(images.angles, place, frame, order))


def _angles_to_local(angles: np.ndarray, place: np.ndarray, frame: LocalFrame, order: str) -> np.ndarray:
    """(n, 3) angles in the frame of those in the CRS at `place`; a missing angle counts as zero for the others."""
    known = np.isfinite(angles)
    rotation = frame.axes_at(place) @ rotation_from_angles(np.where(known, angles, 0.0), order)
    return np.where(known, angles_from_rotation(rotation, order), np.nan)


def _control_to_local(block: Block, frame: LocalFrame, points: np.ndarray | None) -> Control:
    control = block.control
    guess = _below_photographs(block, frame)[control.point] if _partly_known(control.xyz).any() else control.xyz
    if points is not None:
        guess = completed(frame.from_local(points[control.point]), guess)
    xyz, sigma = _positions_to_local(control.xyz, control.sigma, guess, frame)
    return replace(control, xyz=xyz, sigma=sigma)


def _gnss_to_local(block: Block, observed: GnssIns, frame: LocalFrame, centres: np.ndarray | None) -> GnssIns:
    guess = completed(block.images.centre, _middle_of(observed.xyz, frame))[observed.image]
    if centres is not None:
        guess = completed(frame.from_local(centres[observed.image]), guess)
    xyz, sigma = _positions_to_local(observed.xyz, observed.sigma, guess, frame)
    place = completed(observed.xyz, guess)
    return replace(
        observed, xyz=xyz, sigma=sigma, angles=_angles_to_local(observed.angles, place, frame, block.rotation)
    )


def _positions_to_local(xyz: np.ndarray, sigma: np.ndarray, guess: np.ndarray, frame: LocalFrame):
    """Local positions and their σ, NaN where a coordinate is not known; `guess` stands in for the unknown ones."""
    known = np.isfinite(xyz)
    local = frame.to_local(completed(xyz, guess))
    local_per_crs = np.linalg.inv(frame.crs_per_local(local))
    # what is not known has no σ, and the guess in its place none to pass on
    variance = np.where(known, np.nan_to_num(sigma), 0.0) ** 2
    spread = np.sqrt(np.einsum("nij,nj->ni", local_per_crs**2, variance))
    # what is held stays held, along the axis of the frame that takes its place
    spread = np.where(sigma == 0.0, 0.0, spread)
    return np.where(known, local, np.nan), np.where(np.isfinite(sigma), spread, np.nan)


def _partly_known(xyz: np.ndarray) -> np.ndarray:
    count = np.isfinite(xyz).sum(axis=1)
    return (count > 0) & (count < 3)


def completed(xyz: np.ndarray, guess: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(xyz), xyz, guess)


def _middle_of(xyz: np.ndarray, frame: LocalFrame) -> np.ndarray:
    """(3,) in the CRS: the mean of what is known of `xyz`, the frame's origin where nothing is."""
    origin = frame.from_local(np.zeros((1, 3)))[0]
    known = [column[np.isfinite(column)] for column in xyz.T]
    return np.array([column.mean() if len(column) else origin[k] for k, column in enumerate(known)])


def _below_photographs(block: Block, frame: LocalFrame) -> np.ndarray:
    """(N, 3) in the CRS: plan positions below the photographs that see a point, at the mean height of the control."""
    centre = block.images.centre.copy()
    if block.gnss_ins is not None:
        centre[block.gnss_ins.image] = completed(centre[block.gnss_ins.image], block.gnss_ins.xyz)
    rays = block.image_points
    use = np.isfinite(centre[rays.image, :2]).all(axis=1)
    guess = np.tile(_middle_of(block.control.xyz, frame), (len(block.points), 1))
    count = np.bincount(rays.point[use], minlength=len(block.points))
    for axis in range(2):
        total = np.bincount(rays.point[use], weights=centre[rays.image[use], axis], minlength=len(block.points))
        guess[count > 0, axis] = total[count > 0] / count[count > 0]
    return guess
