"""A first orientation, in a frame of its own, brought onto control points or observed positions: the similarity that
most of them agree on.

[L] Umeyama's closed form on triples; of these the one with the least M-estimate of sample consensus (MSAC, Torr and
Zisserman 2000), the points that agree with it adjusted by least squares again and again. The scale of the misfits is
the σ that is stated, never one that the misfits themselves give. What the first orientation errs by is the one thing
about it that is not known: it is found by maximum likelihood, [C] from a sequence of bends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.coordinates.similarity import nearest_similarities
from aerotri.functional_model.rotation import exponential

COLLINEAR = 0.03
"""Width over length of a set of points below which it is a line."""
TRIPLES = 1000
"""Triples of points that are tried; chosen [C]: with half of the points wrong one in eight is right, so that 1000 hold
more than a hundred right ones."""
SOUGHT_WITH = 500
"""Points that the place is sought with where there are more, evenly from end to end [C]; all of them improve it."""
KEPT = 10
"""Triples that are improved by least squares; chosen [C]: the best one by itself may be of three points near to one
another, which its neighbours in cost are not."""
AGREES = 4.0
"""Misfit in σ up to which a point agrees: a thousandth of right ones has more, χ of three coordinates."""
BENDS = tuple(1e-3 * 2.0**k for k in range(11))
"""Errors of a first orientation, as a share of the extent of the points: from what any block without control has, to
where nothing is left of it."""
MOST_BENT = 0.032
"""The largest of these that a first orientation may really have; chosen [C]: of single long strips. Wrong coordinates
or marks are off by more."""
LOOKING = 0.5
"""σ, as a length beside 1, of the assumption that photographs look down, on average; chosen [C]: oblique ones look down
by 45°. It decides only what the points leave open: the roll about a line, and which side of it is up."""
UNKNOWNS = 7
"""Of a similarity: scale, rotation, translation."""
STEPS = 30
"""Rounds of least squares at most; chosen [C]: a consensus settles in a few."""


@dataclass(frozen=True, eq=False)
class Placement:
    """target ≈ scale·R·source + translation.

    Parameters
    ----------
    offset : (k, 3) m, of the points it was found from, source in its place less target.
    sigma : (k, 3) m, what is stated and what the first orientation errs by.
    bend : that error, as a share of the extent of the points.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray
    offset: np.ndarray
    sigma: np.ndarray
    bend: float

    def __call__(self, xyz: np.ndarray) -> np.ndarray:
        return self.scale * xyz @ self.rotation.T + self.translation

    @property
    def misfit(self) -> np.ndarray:
        """(k,) m."""
        return np.linalg.norm(self.offset, axis=1)

    @property
    def relative(self) -> np.ndarray:
        """(k,) misfits in their σ."""
        return np.linalg.norm(self.offset / self.sigma, axis=1)

    @property
    def used(self) -> np.ndarray:
        """(k,) bool, the points that agree; no others have moved it."""
        return self.relative < AGREES

    @property
    def agreed(self) -> bool:
        """Whether most of the points agree."""
        return int(self.used.sum()) >= min(3, len(self.used)) and 2 * int(self.used.sum()) > len(self.used)

    @property
    def fits(self) -> bool:
        """Whether most of the points agree, and better than a first orientation may be bent."""
        return self.agreed and self.bend <= MOST_BENT


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Points (k, 3) in both frames, their σ (k, 3) m, and the direction of view (3,) in the source frame or None."""

    source: np.ndarray
    target: np.ndarray
    sigma: np.ndarray
    looking: np.ndarray | None

    def some(self) -> _Pairs:
        """Those that the place is sought with, where there are very many."""
        rows = np.unique(np.linspace(0, len(self.source) - 1, SOUGHT_WITH).astype(np.int64))
        return replace(self, source=self.source[rows], target=self.target[rows], sigma=self.sigma[rows])

    def bent(self, bend_m: float) -> _Pairs:
        """With what the first orientation errs by in their σ."""
        return replace(self, sigma=np.hypot(self.sigma, bend_m))


@dataclass(frozen=True, eq=False)
class _Similarities:
    """t of them: scales (t,), rotations (t, 3, 3), translations (t, 3)."""

    scale: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray

    def __len__(self) -> int:
        return len(self.scale)

    def take(self, rows: np.ndarray) -> _Similarities:
        return _Similarities(self.scale[rows], self.rotation[rows], self.translation[rows])

    def offsets(self, pairs: _Pairs) -> np.ndarray:
        """(t, k, 3) m."""
        turned = pairs.source @ np.swapaxes(self.rotation, 1, 2)
        return self.scale[:, None, None] * turned + self.translation[:, None] - pairs.target


def place(
    source: np.ndarray, target: np.ndarray, sigma: np.ndarray, looking: np.ndarray | None = None, seed: int = 1
) -> Placement:
    """The similarity of points in two frames that most of them agree on.

    Parameters
    ----------
    source, target : (k, 3). sigma : (k,) or (k, 3) m, above zero, how well the two are known.
    looking : (3,) mean direction of view in the source frame, which is taken as down where the points leave that open;
        None: points on a line are refused.

    Raises
    ------
    InputError
        When the points do not determine it.
    """
    if len(source) < 2 or (looking is None and len(source) < 3):
        raise InputError(
            f"{counted(len(source), 'known point is', 'known points are')} too few to place the block",
            "give three control points, or positions of the photographs",
        )
    sigma = np.broadcast_to(sigma if np.ndim(sigma) == 2 else np.asarray(sigma)[:, None], target.shape)
    # triples are drawn by place: the same points in another order, or another frame, have to give the same
    order = np.lexsort(source.T)
    down = None if looking is None else looking / np.linalg.norm(looking)
    pairs = _Pairs(source[order], target[order], sigma[order], down)
    some, extent = pairs.some(), _extent(target)
    bend, placed = _likeliest(some, _of_triples(some, seed), extent)
    pairs = pairs.bent(bend * extent)
    placed, back = _improved(pairs, placed)[0], np.argsort(order)
    return Placement(
        float(placed.scale[0]), placed.rotation[0], placed.translation[0], placed.offsets(pairs)[0][back],
        pairs.sigma[back], bend,
    )  # fmt: skip


def is_line(xyz: np.ndarray) -> bool:
    """Whether points (k, 3) lie nearly on a line."""
    size = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return len(xyz) < 3 or size[1] < COLLINEAR * max(size[0], 1e-300)


def _extent(target: np.ndarray) -> float:
    """m, of the points but for some that are far off."""
    return 2.0 * float(np.median(np.linalg.norm(target - np.median(target, axis=0), axis=1)))


def _of_triples(pairs: _Pairs, seed: int) -> _Similarities:
    """The similarities of three points each; those on a line turned so that photographs look down."""
    sets = _sets(len(pairs.source), seed)
    source, target = pairs.source[sets], pairs.target[sets]
    size = np.linalg.svd(target - target.mean(axis=1, keepdims=True), compute_uv=False)
    spread = np.ptp(source, axis=1).max(axis=1)
    apart = (size[:, 0] > 0.0) & (spread > 0.0)
    if not apart.any():
        raise InputError("the known points all lie at one place", "give points or positions that lie apart")
    line = (size[:, 1] < COLLINEAR * size[:, 0]) | (sets.shape[1] < 3)
    if pairs.looking is None:
        apart &= ~line
        if not apart.any():
            raise InputError("the control points lie on a line", "add one beside it, or positions of the photographs")
    found = _Similarities(*nearest_similarities(source[apart], target[apart], np.ones(sets[apart].shape)))
    if pairs.looking is None:
        return found
    # a set whose width its σ may make does not tell which side is up
    narrow = line | (size[:, 1] < np.linalg.norm(pairs.sigma[sets], axis=2).max(axis=1))
    return _looking_down(found, target[apart], narrow[apart], pairs.looking)


def _sets(count: int, seed: int) -> np.ndarray:
    """(t, 3) rows of points, all of them or drawn; (1, 2) of two."""
    if count < 3:
        return np.arange(count)[None]
    if count * (count - 1) * (count - 2) // 6 <= TRIPLES:
        return np.array(list(combinations(range(count), 3)))
    rng = np.random.default_rng(seed)
    return np.array([rng.choice(count, 3, replace=False) for _ in range(TRIPLES)])


def _looking_down(found: _Similarities, target: np.ndarray, narrow: np.ndarray, looking: np.ndarray) -> _Similarities:
    """Similarities (t,) of sets (t, p, 3), the narrow ones (t,) turned about their line until the view is lowest."""
    rotation, translation = found.rotation.copy(), found.translation.copy()
    for k in np.flatnonzero(narrow):
        middle = target[k].mean(axis=0)
        axis = np.linalg.svd(target[k] - middle)[2][0]
        view, down = rotation[k] @ looking, np.array([0.0, 0.0, -1.0])
        across, aim = view - (view @ axis) * axis, down - (down @ axis) * axis
        turn = exponential(axis * np.arctan2(np.cross(across, aim) @ axis, across @ aim))
        rotation[k] = turn @ rotation[k]
        translation[k] = middle + turn @ (translation[k] - middle)
    return _Similarities(found.scale, rotation, translation)


def _likeliest(pairs: _Pairs, tried: _Similarities, extent: float) -> tuple[float, _Similarities]:
    """The bend with which the points are most likely, and the similarity (1,) then; `extent` is theirs, m."""
    best, least = (BENDS[0], tried.take(np.zeros(1, np.int64))), np.inf
    for bend in BENDS:
        bent = pairs.bent(bend * extent)
        placed, surprise = _consensus(bent, tried)
        if surprise < least:
            best, least = (bend, placed), surprise
        elif (_squares(bent, placed)[0] < AGREES**2).all():
            # where all agree and a larger bend makes them less likely, it goes on like that
            break
    return best


def _consensus(pairs: _Pairs, tried: _Similarities) -> tuple[_Similarities, float]:
    """The best similarity (1,) of those tried, improved, and −2 log of its likelihood.

    A point that does not agree lies anywhere within the extent of the points. The seven unknowns take so many
    coordinates of those that agree, as in a restricted likelihood [L: Patterson and Thompson 1971]: three points that
    agree by chance do not count for more than five that agree less well.
    """
    begun = np.argsort(_costs(pairs, tried), kind="stable")[:KEPT]
    ends = [_improved(pairs, tried.take(begun[k : k + 1])) for k in range(len(begun))]
    best, _ = min(ends, key=lambda end: end[1])
    square = _squares(pairs, best)[0]
    agrees = square < AGREES**2
    share = max(1.0 - UNKNOWNS / max(3.0 * int(agrees.sum()), 1.0), 0.0)
    normal = square + share * (2.0 * np.log(pairs.sigma).sum(axis=1) + 3.0 * np.log(2.0 * np.pi))
    anywhere = 6.0 * np.log(max(_extent(pairs.target), 1e-300))
    return best, float(np.where(agrees, normal, anywhere).sum())


def _squares(pairs: _Pairs, tried: _Similarities) -> np.ndarray:
    """(t, k) squares of the misfits in σ."""
    return np.square(tried.offsets(pairs) / pairs.sigma).sum(axis=2)


def _costs(pairs: _Pairs, tried: _Similarities) -> np.ndarray:
    """(t,) squares of misfits in σ, those that do not agree counted as the largest that does; and of the view."""
    cost = np.minimum(_squares(pairs, tried), AGREES**2).sum(axis=1)
    return cost if pairs.looking is None else cost + np.square(_view(pairs, tried)).sum(axis=1)


def _view(pairs: _Pairs, tried: _Similarities) -> np.ndarray:
    """(t, 3) the direction of view less down, in its σ."""
    return (tried.rotation @ pairs.looking - [0.0, 0.0, -1.0]) / LOOKING


def _improved(pairs: _Pairs, at: _Similarities) -> tuple[_Similarities, float]:
    """By least squares of the points that agree, as long as the cost falls, and the cost: no worse than it began.

    The exact solution of the points that agree cannot raise the cost (majorisation [L: Hunter and Lange 2004]).
    """
    cost = float(_costs(pairs, at)[0])
    for _ in range(STEPS):
        after = _step(pairs, at, _squares(pairs, at)[0] < AGREES**2)
        lower = float(_costs(pairs, after)[0])
        if not lower < cost - 1e-9:
            break
        at, cost = after, lower
    return at, cost


def _step(pairs: _Pairs, at: _Similarities, use: np.ndarray) -> _Similarities:
    """One step of Gauss and Newton: scale, rotation and translation by the points in use and the view."""
    if not use.any():
        return at
    rotation, scale = at.rotation[0], float(at.scale[0])
    middle = pairs.source[use].mean(axis=0)
    centre = scale * rotation @ middle + at.translation[0]
    arm = scale * (pairs.source[use] - middle) @ rotation.T
    size = max(float(np.abs(arm).max()), 1e-300)
    design = np.zeros((len(arm), 3, 7))
    design[:, :, 0], design[:, :, 1:4] = arm / size, -_cross(arm / size)
    design[:, :, 4:] = np.eye(3)
    design /= pairs.sigma[use, :, None]
    rows, right = [design.reshape(-1, 7)], [(-at.offsets(pairs)[0][use] / pairs.sigma[use]).ravel()]
    if pairs.looking is not None:
        of_view = np.zeros((3, 7))
        of_view[:, 1:4] = -_cross((rotation @ pairs.looking)[None])[0] / LOOKING / size
        rows.append(of_view)
        right.append(-_view(pairs, at)[0])
    x = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
    turned, grown = exponential(x[1:4] / size) @ rotation, scale * float(np.exp(x[0] / size))
    translation = centre + x[4:] - grown * turned @ middle
    return _Similarities(np.array([grown]), turned[None], translation[None])


def _cross(vectors: np.ndarray) -> np.ndarray:
    """(k, 3, 3) matrices that make the vector product with (k, 3) vectors."""
    made = np.zeros((len(vectors), 3, 3))
    made[:, 0, 1], made[:, 0, 2], made[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return made - np.swapaxes(made, 1, 2)
