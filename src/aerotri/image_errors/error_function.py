"""The image errors of a group of photographs as a function, in both directions: without covariances, and fast.

measured = ideal + d. The linear families and Brown's are functions of the measured position, a forward lens is one of
the ideal direction; both directions are exact here, m = lens(ideal) + d(m) and its inverse.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import brown, lens, parameter_sets
from aerotri.functional_model.additional_parameters.registry import ParameterSet
from aerotri.image_errors.groups import ImageGroup, interior_elements, parameters_of_group
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock

PIECE = 16384
"""Positions evaluated at a time, so that the patterns stay in the cache."""
ITERATIONS = 100
"""Steps of a fixed point at most: each shrinks by the slope of the image error; a hundred serve a slope of 0.8, from 1
mm [D]."""
TOLERANCE_MM = 1e-9
"""Last step of a fixed point [C]: 0.001 nm, far below any image error and above the rounding of image coordinates."""
FARTHEST_MM = 1e4
"""Step from which a fixed point runs away [C]: 10 m, beyond any image."""
Bounds = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class ErrorFunction:
    """d of one group of photographs taken with one camera.

    Parameters
    ----------
    camera, group : of the photographs.
    interior : (3,) mm, c, x0, y0 as adjusted.
    linear : sets with the values of their parameters.
    brown : (7,) values in the order of the items. lens : (14,) in the order of `lens.COLUMNS`.
    """

    camera: Camera
    group: str
    interior: np.ndarray
    linear: tuple[tuple[ParameterSet, np.ndarray], ...]
    brown: np.ndarray
    lens: np.ndarray

    @property
    def is_zero(self) -> bool:
        """Whether no parameter does anything."""
        return not (self.brown.any() or self.lens.any() or any(values.any() for _, values in self.linear))

    def of_measured(self, xy: np.ndarray) -> np.ndarray:
        """(n, 2) mm, d = measured − ideal at measured positions (n, 2) mm from the image centre."""
        xy = np.asarray(xy, dtype=float)
        d = self._by_position(xy)
        return d if not self.lens.any() else xy - self._without_lens(xy - d)

    def directions(self, xy: np.ndarray) -> np.ndarray:
        """(n, 3) directions in the camera frame of the rays through measured positions (n, 2) mm; any length.

        Of a fisheye as well. NaN where the lens records no ray.
        """
        xy = np.asarray(xy, dtype=float)
        distorted = (xy - self._by_position(xy) - self.interior[1:]) / self.interior[0]
        ideal = lens.unbend(distorted, self.lens)
        if not self.camera.is_fisheye:
            return np.column_stack([ideal, np.full(len(ideal), -1.0)])
        angle = np.hypot(ideal[:, 0], ideal[:, 1])
        angle = np.where(angle < np.pi, angle, np.nan)
        return np.column_stack([ideal * np.sinc(angle / np.pi)[:, None], -np.cos(angle)])

    def measured(self, ideal: np.ndarray, within: Bounds | None = None) -> np.ndarray:
        """Measured positions of ideal ones: m = lens(ideal) + d(m) by fixed point.

        Parameters
        ----------
        ideal : (n, 2) mm.
        within : lower and upper corner (2,) mm; d is taken no further out, so that it stays that of one tile.

        Returns
        -------
        (n, 2) mm.

        Raises
        ------
        InputError
            Where the image errors change so fast that there is no such position.
        """
        start = self._with_lens(np.asarray(ideal, dtype=float))
        measured, active = start.copy(), np.arange(len(start))
        for _ in range(ITERATIONS):
            at = measured[active]
            new = start[active] + self._by_position(at if within is None else np.clip(at, *within))
            change = np.abs(new - at).max(axis=1, initial=0.0)
            measured[active] = new
            active = active[change > TOLERANCE_MM]
            if not len(active):
                return measured
            if not change.max() < FARTHEST_MM:
                break
        raise InputError(
            f"the image errors of group '{self.group}' are so large that neighbouring image points change places",
            "adjust with fewer additional parameters",
        )

    def _by_position(self, xy: np.ndarray) -> np.ndarray:
        """(n, 2) mm, what depends on the measured position: the linear families and Brown's."""
        d = np.zeros((len(xy), 2))
        for start in range(0, len(xy), PIECE):
            x, y = xy[start : start + PIECE].T
            piece = d[start : start + PIECE]
            for chosen, values in self.linear:
                terms = chosen.terms(x, y)
                piece += np.einsum("nak,nk->na", terms.value, values[terms.index])
            if self.brown.any():
                piece += brown.image_error(x - self.interior[1], y - self.interior[2], self.brown)
        return d

    def _with_lens(self, ideal: np.ndarray) -> np.ndarray:
        if not self.lens.any():
            return ideal
        c, principal_point = self.interior[0], self.interior[1:]
        direction = (ideal - principal_point) / c
        return c * lens.distort(direction[:, 0], direction[:, 1], self.lens) + principal_point

    def _without_lens(self, distorted: np.ndarray) -> np.ndarray:
        """The inverse of `_with_lens`."""
        c, principal_point = self.interior[0], self.interior[1:]
        direction = lens.undistort((distorted - principal_point) / c, self.lens)
        if not np.isnan(direction).any():
            return c * direction + principal_point
        raise InputError(
            f"the lens distortion of group '{self.group}' is so large that neighbouring image points change places",
            "adjust with fewer additional parameters",
        )


def error_function(adjusted: AdjustedBlock, group: ImageGroup) -> ErrorFunction:
    """All additional parameters in force in a group, estimated or given; what the selection removed is not.

    Raises
    ------
    InputError
        For a fisheye.
    """
    _refuse_fisheye(group.camera)
    return errors_in_force(adjusted, group)


def errors_in_force(adjusted: AdjustedBlock, group: ImageGroup) -> ErrorFunction:
    """As `error_function`; of a fisheye too, which has `directions` only."""
    values = _values_in_force(adjusted, group)
    sets = tuple(
        (chosen, np.array([values[name] for name in chosen.names]))
        for chosen in parameter_sets(values, group.camera)
    )  # fmt: skip
    return ErrorFunction(
        camera=group.camera,
        group=group.name,
        interior=interior_elements(adjusted, group.camera)[0],
        linear=sets,
        brown=np.array([values.get(f"brown.{item}", 0.0) for item in brown.ITEMS]),
        lens=lens.vector({item: values.get(f"lens.{item}", 0.0) for item in lens.ITEMS}, group.camera.is_fisheye),
    )


def _refuse_fisheye(camera: Camera) -> None:
    """Ideal photographs, models and ground points are computed in perspective photographs."""
    if camera.is_fisheye:
        raise InputError(
            f"camera '{camera.name}' is a fisheye: ideal photographs, model deformation and ground points are computed "
            "in perspective photographs only",
            "write the result with `aerotri convert RESULT --to colmap --out MODEL`, have the photographs made "
            "perspective there (`colmap image_undistorter`), and read that model as a block",
        )


def _values_in_force(adjusted: AdjustedBlock, group: ImageGroup) -> dict[str, float]:
    """Values by name: adjusted where they were, as the camera gives them otherwise."""
    p = adjusted.parameters
    given = {f"brown.{item}": prior.value for item, prior in group.camera.brown.items()}
    given |= {f"lens.{item}": prior.value for item, prior in group.camera.lens.items()}
    given |= {name: prior.value for name, prior in group.camera.parameters.items()}
    for name in p.names[(p.status == "removed") & (p.groups == group.name)]:
        given.pop(str(name), None)
    rows = np.flatnonzero(parameters_of_group(adjusted, group))
    return given | {str(name): float(value) for name, value in zip(p.names[rows], p.value[rows], strict=True)}
