"""How well what is given (control, check points, GNSS, INS, start values) fits a model of the image points alone.

Every given position counts with log2 of its misfit over what is tolerable: a few wrong ones among many cannot hide, and
none outweighs the rest. The model is laid on each set of positions in turn; the placing that fits all of them best
counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from aerotri.adjustment.directions import directions_of
from aerotri.coordinates.similarity import Similarity
from aerotri.diagnosis.free_model import FreeModel
from aerotri.diagnosis.placement import lay_on
from aerotri.functional_model.rotation import exponential, logarithm, rotation_from_angles
from aerotri.observations import Block

MOST_DOUBLINGS = 14.0
"""A position counts no more than this, however far off."""
LOOSE_START = 0.03
"""Error of a start position that is tolerable, as a share of the flying height."""
LOOSE_ANGLE = np.radians(4.0)
"""Error of a start angle that is tolerable, as a rotation."""
GROUND_ERRORS = 4.0
"""Error of the free model that is tolerable, in tolerances of a ray on the ground."""


@dataclass(frozen=True, eq=False)
class Positions:
    """Given positions, k of them, with the rows they have in the block.

    Parameters
    ----------
    name : 'control', 'check', 'gnss' or 'start'. row : (k,) row of the block's table. labels : (k,) names.
    model : (k, 3) in the model. given : (k, 3) m, NaN where not given. sigma : m, the median one.
    """

    name: str
    row: np.ndarray
    labels: np.ndarray
    model: np.ndarray
    given: np.ndarray
    sigma: float

    def __len__(self) -> int:
        return len(self.row)

    @property
    def full(self) -> np.ndarray:
        """(k,) bool: all three coordinates are given."""
        return np.asarray(np.isfinite(self.given).all(axis=1))


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Given attitudes (k, 3, 3) and those in the model; `name` is 'ins' or 'start angles'."""

    name: str
    row: np.ndarray
    labels: np.ndarray
    model: np.ndarray
    given: np.ndarray
    tolerance: float
    with_boresight: bool


@dataclass(frozen=True, eq=False)
class Evidence:
    """All that is given of a block beside its image points, in the local frame; `ray` rad is the tolerance of a ray."""

    positions: tuple[Positions, ...]
    attitudes: tuple[Attitudes, ...]
    looking: np.ndarray
    reach: float
    ray: float


@dataclass(frozen=True, eq=False)
class Fit:
    """What a placing leaves: the cost, (k, 3) m residuals given − model by set, and (k,) rad by set of attitudes.

    `tolerance` m by set of positions.
    """

    cost: float
    placed: Similarity | None
    residual: dict[str, np.ndarray]
    turned: dict[str, np.ndarray]
    tolerance: dict[str, float]


def gather(block: Block, model: FreeModel) -> Evidence:
    """The evidence of a block in a local frame.

    Parameters
    ----------
    model : of the same photographs and points.
    """
    positions = [_ground(block, model, is_check) for is_check in (False, True)]
    attitudes = []
    ray = float(np.median(directions_of(block).tolerance))
    gnss = block.gnss_ins
    if gnss is not None:
        there = np.isfinite(gnss.xyz).any(axis=1) & model.joined[gnss.image]
        positions.append(_centres("gnss", block, model, gnss.image, gnss.xyz, np.flatnonzero(there), gnss.sigma))
        known = np.flatnonzero(np.isfinite(gnss.angles).all(axis=1) & model.joined[gnss.image])
        if len(known) >= 2:
            sigma = float(np.nanmedian(gnss.angles_sigma[known]))
            tolerance, boresight = max(3.0 * sigma, 3.0 * ray), block.settings.ins.boresight != "off"
            image, angles = gnss.image[known], gnss.angles[known]
            attitudes.append(_attitudes("ins", block, model, known, image, angles, tolerance, boresight))
    images = np.arange(len(block.images))
    own = block.images
    there = np.isfinite(own.centre).any(axis=1) & model.joined
    positions.append(_centres("start", block, model, images, own.centre, np.flatnonzero(there), None))
    known = np.flatnonzero(np.isfinite(own.angles).all(axis=1) & model.joined)
    if len(known) >= 2:
        attitudes.append(_attitudes("start angles", block, model, known, known, own.angles[known], LOOSE_ANGLE, False))
    reach = _reach(block, model)
    return Evidence(tuple(p for p in positions if len(p)), tuple(attitudes), model.looking, reach, ray)


def _reach(block: Block, model: FreeModel) -> float:
    """Median distance of the points from the photographs, in the model."""
    rays = block.image_points
    reach = np.linalg.norm(model.points[rays.point] - model.centre[rays.image], axis=1)
    return float(np.nanmedian(reach)) if np.isfinite(reach).any() else 1.0


def _ground(block: Block, model: FreeModel, is_check: bool) -> Positions:
    control = block.control
    there = (control.is_check == is_check) & np.isfinite(control.xyz).any(axis=1)
    row = np.flatnonzero(there & np.isfinite(model.points[control.point, 0]))
    sigma = control.sigma[row]
    median = float(np.median(sigma[np.isfinite(sigma)])) if np.isfinite(sigma).any() else 0.0
    point = control.point[row]
    name = "check" if is_check else "control"
    return Positions(name, row, block.points[point].astype(str), model.points[point], control.xyz[row], median)


def _centres(
    name: str,
    block: Block,
    model: FreeModel,
    image: np.ndarray,
    xyz: np.ndarray,
    row: np.ndarray,
    sigma: np.ndarray | None,
) -> Positions:
    own = image[row]
    spread = 0.0
    if sigma is not None and np.isfinite(sigma[row]).any():
        spread = float(np.nanmedian(sigma[row])) + float(np.linalg.norm(block.settings.gnss.lever_arm_m))
    return Positions(name, row, block.images.names[own].astype(str), model.centre[own], xyz[row], spread)


def _attitudes(
    name: str,
    block: Block,
    model: FreeModel,
    row: np.ndarray,
    image: np.ndarray,
    angles: np.ndarray,
    tolerance: float,
    with_boresight: bool,
) -> Attitudes:
    given = rotation_from_angles(angles, block.rotation)
    names = block.images.names[image].astype(str)
    return Attitudes(name, row, names, model.rotation[image], given, tolerance, with_boresight)


def fit(evidence: Evidence, trusted: tuple[str, ...] = ("control", "check", "gnss", "start")) -> Fit:
    """The best placing of the model and what it leaves.

    Parameters
    ----------
    trusted : the sets of positions that the model may be laid on.
    """
    best = None
    for own in _bases(evidence, trusted):
        placed = _laid(own.model[own.full], own.given[own.full], evidence.looking)
        if placed is None or not np.isfinite(placed.scale) or placed.scale <= 0.0:
            continue
        found = left_over(evidence, placed)
        if best is None or found.cost < best.cost:
            best = found
    return best if best is not None else Fit(0.0, None, {}, {}, {})


def _laid(model: np.ndarray, given: np.ndarray, looking: np.ndarray) -> Similarity | None:
    """`lay_on`, remembered: most hypotheses leave most sets as they are."""
    return _laid_once(model.tobytes(), given.tobytes(), looking.tobytes())


@lru_cache(maxsize=512)
def _laid_once(model: bytes, given: bytes, looking: bytes) -> Similarity | None:
    source, target = (np.frombuffer(values).reshape(-1, 3) for values in (model, given))
    return lay_on(source, target, np.frombuffer(looking))


def _bases(evidence: Evidence, trusted: tuple[str, ...]) -> list[Positions]:
    """Each set of positions alone, and control with check points and with GNSS."""
    alone = [p for p in evidence.positions if p.name in trusted and p.full.sum() >= (2 if p.name == "gnss" else 3)]
    together = [p for p in evidence.positions if p.name in trusted and p.name != "start"]
    if len(together) > 1:
        alone.append(_together(together))
    ground = [p for p in together if p.name != "gnss"]
    if 1 < len(ground) < len(together):
        alone.append(_together(ground))
    return [p for p in alone if p.full.sum() >= 2 and (p.name in ("gnss", "start") or p.full.sum() >= 3)]


def _together(parts: list[Positions]) -> Positions:
    return replace(
        parts[0], name=" and ".join(p.name for p in parts),
        row=np.concatenate([p.row for p in parts]), labels=np.concatenate([p.labels for p in parts]),
        model=np.concatenate([p.model for p in parts]), given=np.concatenate([p.given for p in parts]),
    )  # fmt: skip


def places_by_others(evidence: Evidence) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """By set of positions: where its middle is given (2,), and where it is according to the other sets (2,) m."""
    ground, found = ("control", "check"), {}
    for own in evidence.positions:
        others = [p.name for p in evidence.positions if p.name != own.name]
        if own.name in ground:
            others = [name for name in others if name not in ground]
        placed = fit(evidence, tuple(others)).placed if others and own.full.any() else None
        if placed is not None:
            there = own.full
            found[own.name] = own.given[there, :2].mean(axis=0), placed(own.model[there])[:, :2].mean(axis=0)
    return found


def left_over(evidence: Evidence, placed: Similarity) -> Fit:
    """Residuals and cost of a placing."""
    residual, turned, tolerances, cost = {}, {}, {}, 0.0
    for own in evidence.positions:
        height = evidence.reach * placed.scale
        tolerance = max(3.0 * own.sigma, GROUND_ERRORS * evidence.ray * height)
        if own.name == "start":
            tolerance = max(tolerance, LOOSE_START * height)
        left = own.given - placed(own.model)
        residual[own.name], tolerances[own.name] = left, tolerance
        cost += _doublings(sizes(left), tolerance)
    for own in evidence.attitudes:
        turned[own.name] = _turned(own, placed)
        cost += _doublings(turned[own.name], own.tolerance)
    return Fit(cost, placed, residual, turned, tolerances)


def sizes(residual: np.ndarray) -> np.ndarray:
    """(k,) length of residuals (k, 3) over the coordinates that are given."""
    return np.sqrt(np.nansum(residual**2, axis=1))


def _doublings(size: np.ndarray, tolerance: float) -> float:
    """Mean over positions of how often the tolerance doubles up to the misfit."""
    return float(np.mean(np.clip(np.log2(np.maximum(size, 1e-300) / tolerance), 0.0, MOST_DOUBLINGS)))


def _turned(own: Attitudes, placed: Similarity) -> np.ndarray:
    """(k,) rad between given attitudes and those of the placed model, a constant boresight taken off."""
    apart = np.swapaxes(expected_attitudes(own, placed), 1, 2) @ own.given
    return np.linalg.norm(logarithm(apart), axis=1)


def expected_attitudes(own: Attitudes, placed: Similarity) -> np.ndarray:
    """(k, 3, 3) what the placed model says of given attitudes, a constant boresight added where there may be one."""
    expected = placed.rotation @ own.model
    if not own.with_boresight:
        return expected
    apart = np.swapaxes(expected, 1, 2) @ own.given
    middle = apart[int(np.argmin(np.linalg.norm(logarithm(apart[0].T @ apart), axis=1)))]
    for _ in range(5):
        step = np.median(logarithm(np.swapaxes(middle[None], 1, 2) @ apart), axis=0)
        middle = middle @ exponential(step)
    return expected @ middle
