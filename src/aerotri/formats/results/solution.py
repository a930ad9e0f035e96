"""solution.npz: the final unknowns, from which any covariance can be had again without adjusting.

Coordinates are kept as the adjustment had them, reduced to the local origin, so that nothing is lost in between.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import Unknowns
from aerotri.conventions import FilePath
from aerotri.coordinates import LocalFrame
from aerotri.formats.files.npz import Archive
from aerotri.formats.results.json_text import json_text, number_or_none
from aerotri.formats.results.solution_checks import SCHEMA, checked_values
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.model_part import OtherSet, SetDifference
from aerotri.results.photograph_fields import PhotographFields
from aerotri.results.position_errors import PositionErrors
from aerotri.results.removal import Removal
from aerotri.results.variance_components import VarianceComponents
from aerotri.statistics.summarise import OF_POINTS


@dataclass(frozen=True, eq=False)
class SavedSolution:
    """What solution.npz holds; rows of photographs, points and rays as in the result's block.

    Parameters
    ----------
    origin : (3,) m. rotation : (n, 3, 3). centre : (n, 3) m, points : (N, 3) m, from the origin; NaN if not adjusted.
    shared : (s,) values, shared_names, shared_groups : (s,) str, shared_cofactor : (s, s), without σ̂0², NaN of
        what is not listed among the parameters.
    xy : (m, 2) mm, image points as adjusted, freed of refraction and earth curvature where the settings ask.
    frame_origin : (3,) of the local frame, NaN for a block in local coordinates; geoid : its grid file, '' if none.
    held : (k, 2) point and axis of coordinates held for the datum.
    ray_status, weight : (m,).
    components : the variance components as JSON, '' where there are none; the block has the σ they led to.
    removals : the parameters that the selection took out, as JSON, '' where there are none.
    verdict, reasons, notes : of the outcome; empty in results of versions that did not have them.
    position_errors, photograph_fields : what was said of the errors of positions and photographs as JSON, '' where
        there is nothing.
    other_set : of the additional parameters that could not be told from those taken, as JSON, '' where there are none.
    other_images : (n, 6), other_shared : (s,), other_points : (N, 3) m, what differs with them; None without any.
    """

    origin: np.ndarray
    rotation: np.ndarray
    centre: np.ndarray
    points: np.ndarray
    shared: np.ndarray
    shared_names: np.ndarray
    shared_groups: np.ndarray
    shared_cofactor: np.ndarray
    xy: np.ndarray
    frame_origin: np.ndarray
    geoid: str
    held: np.ndarray
    ray_status: np.ndarray
    weight: np.ndarray
    estimator_code: int
    estimator_limit: float
    sigma0: float
    status: str
    iterations: int
    warnings: tuple[str, ...]
    components: str = ""
    removals: str = ""
    verdict: str = ""
    reasons: tuple[str, ...] = ()
    position_errors: str = ""
    photograph_fields: str = ""
    notes: tuple[str, ...] = ()
    other_set: str = ""
    other_images: np.ndarray | None = None
    other_shared: np.ndarray | None = None
    other_points: np.ndarray | None = None

    def difference(self, unknowns: Unknowns) -> SetDifference | None:
        """What another set of additional parameters would change; None where there is none."""
        images, shared, points = self.other_images, self.other_shared, self.other_points
        if not self.other_set or images is None or shared is None or points is None:
            return None
        other, u = OtherSet.from_dict(json.loads(self.other_set)), unknowns
        return SetDifference(other, images[u.images], shared, points[u.points])

    def removal_records(self) -> tuple[Removal, ...]:
        """The parameters that the selection took out."""
        return tuple(Removal(**removal) for removal in json.loads(self.removals or "[]"))

    def component_record(self) -> VarianceComponents | None:
        """The variance components; None where there are none."""
        return VarianceComponents.from_dict(json.loads(self.components)) if self.components else None

    def position_record(self) -> PositionErrors | None:
        """What was said of the errors of positions; None where there is nothing."""
        return PositionErrors.from_dict(json.loads(self.position_errors)) if self.position_errors else None

    def photograph_record(self) -> PhotographFields | None:
        """What was said of smooth errors of single photographs; None where nobody asked."""
        return PhotographFields.from_dict(json.loads(self.photograph_fields)) if self.photograph_fields else None


def write_solution(
    path: FilePath,
    system: NormalSystem,
    solution: Solution,
    result: AdjustedBlock,
    frame: LocalFrame | None = None,
    other: SetDifference | None = None,
) -> None:
    """Write solution.npz.

    Parameters
    ----------
    result : in the frame of `system`. frame : the local frame of a block with a CRS.
    other : what another set of additional parameters would change; None where there is none.
    """
    u, state = system.unknowns, solution.state
    n, count = len(u.block.images), len(u.block.points)
    centre, rotation, points = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((count, 3), np.nan)
    centre[u.images], rotation[u.images], points[u.points] = state.centre, state.rotation, state.points
    row, axis = np.nonzero(~u.point_free)
    np.savez_compressed(
        path,
        schema=SCHEMA,
        origin=u.origin,
        rotation=rotation,
        centre=centre,
        points=points,
        shared=state.shared,
        shared_names=np.array(u.shared.names, dtype=str),
        shared_groups=np.array(u.shared.groups, dtype=str),
        shared_cofactor=_shared_cofactor(u, result),
        xy=u.block.image_points.xy,
        frame_origin=np.full(3, np.nan) if frame is None else frame.origin,
        geoid=np.array("" if frame is None or frame.geoid is None else os.fspath(frame.geoid)),
        held=np.column_stack([u.points[row], axis]),
        ray_status=result.rays.status,
        weight=result.rays.weight,
        estimator_code=solution.estimator.code,
        estimator_limit=solution.estimator.limit,
        sigma0=result.outcome.sigma0,
        status=np.array(solution.status),
        iterations=solution.iterations,
        warnings=np.array(result.outcome.warnings, dtype=str),
        verdict=np.array(result.outcome.verdict),
        reasons=np.array(result.outcome.reasons, dtype=str),
        notes=np.array(result.outcome.notes, dtype=str),
        removals=np.array(json.dumps([removal.as_dict() for removal in result.removals])),
        position_errors=np.array("" if result.position_errors is None else json_text(result.position_errors.as_dict())),
        photograph_fields=np.array(
            "" if result.photograph_fields is None else json_text(result.photograph_fields.as_dict())
        ),
        components=np.array("" if result.components is None else json_text(result.components.as_dict())),
        allow_pickle=False,
        **_other_set(u, other),
    )


def _other_set(unknowns: Unknowns, difference: SetDifference | None) -> dict[str, np.ndarray]:
    """The entries of another set of parameters, rows as in the block, 0 of what is not adjusted."""
    if difference is None:
        return {}
    images = np.zeros((len(unknowns.block.images), 6))
    points = np.zeros((len(unknowns.block.points), 3))
    images[unknowns.images], points[unknowns.points] = difference.images, difference.points
    told = {key: number_or_none(v) if key != "set" else v for key, v in asdict(difference.other).items()}
    return {
        "other_set": np.array(json_text(told)), "other_images": images, "other_shared": difference.shared,
        "other_points": points,
    }  # fmt: skip


def _shared_cofactor(unknowns: Unknowns, result: AdjustedBlock) -> np.ndarray:
    """(s, s) cofactors of the shared parameters, NaN of those that stand for points or single exposures."""
    there = np.flatnonzero(result.parameters.status != "removed")
    kinds = np.array(unknowns.shared.kinds, dtype=object).astype(str)
    listed = np.flatnonzero(~np.isin(kinds, OF_POINTS))
    cofactor = np.full((len(kinds), len(kinds)), np.nan)
    found = result.parameters.covariance[np.ix_(there, there)] / result.outcome.sigma0**2
    cofactor[np.ix_(listed, listed)] = found
    return cofactor


def read_solution(path: FilePath, block: Block | None = None) -> SavedSolution:
    """Read solution.npz.

    Parameters
    ----------
    block : that was adjusted, whose sizes the arrays must have; None: they only have to agree with one another.

    Raises
    ------
    InputError
        When the file is missing, damaged, of another schema, or holds what no adjustment writes.
    """
    return SavedSolution(**checked_values(Archive(Path(path)), block))
