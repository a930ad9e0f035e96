"""Which pairs of photographs measure a piece of ground: by the angle of their rays, and by what they show of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.terrain.dense.place import Place

LEAST_ANGLE, BEST_ANGLE, LARGEST_ANGLE = 3.0, 15.0, 40.0
"""Degrees between the rays of a pair; chosen [C]: below the least a pixel of parallax is 20 GSD of height, beyond the
largest the photographs differ too much to be matched densely, and the best lies between; other bounds were
not compared."""
WEAKEST_ANGLE = 0.5
"""Degrees between two rays at least, where nobody knows which photographs measured a place and none makes the least
angle [C]: a narrow lens has such pairs; heads of one camera station and photographs of a hovering drone have not."""
LARGEST_OFF_NADIR = 45.0
"""Degrees of a ray from the vertical; beyond, a photograph sees walls rather than ground."""
GAIN = (1.0, 0.6, 0.4, 0.25, 0.15, 0.1)
"""What the first, second … pair that shows a place is worth; chosen [C]: the second tells errors of the first, the
third decides between two, others only average."""
LEAST_GAIN = 0.01
"""Of the whole piece, below which one more pair is not worth its time."""
LEAST_OF_HOLES = 0.02
"""Share of a piece that is a hole and shown by one more pair, from which on it is matched; chosen [C]."""
LARGEST_SCALE = 1.5
"""Ratio of the distances from which the two see the ground; beyond, windows are no longer alike."""


@dataclass(frozen=True)
class Pair:
    """Two photographs and the angle between their rays, degrees."""

    left: int
    right: int
    angle: float


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pair, and what it is worth at places on the ground: (n,), 0 where not both photographs show them."""

    pair: Pair
    worth: np.ndarray


def possible_pairs(place: Place, ground: np.ndarray) -> list[Candidate]:
    """The pairs that show some of the ground (n, 3) m in q under an angle that can be matched."""
    seen = {k: place.seen(k, ground) for k in _near(place, ground)}
    shown = {k: s for k, s in seen.items() if s.any()}
    up = ground.mean(axis=0)
    candidates: list[Candidate] = []
    rows = sorted(shown)
    for n, a in enumerate(rows):
        for b in rows[n + 1 :]:
            both = shown[a] & shown[b]
            if not both.any():
                continue
            at = ground[both].mean(axis=0) if both.sum() else up
            pair = _pair(place, a, b, at)
            if pair is not None:
                candidates.append(Candidate(pair, both * _worth(pair.angle)))
    return candidates


def _near(place: Place, ground: np.ndarray) -> list[int]:
    """Photographs whose ray to the middle or a corner is not too oblique."""
    away = ground[:, None] - place.centres[None]
    down = -away[:, :, 2]
    plan = np.hypot(away[:, :, 0], away[:, :, 1])
    near = ((down > 0.0) & (plan <= down * np.tan(np.radians(LARGEST_OFF_NADIR)))).any(axis=0)
    return np.flatnonzero(near).tolist()


def _pair(place: Place, a: int, b: int, at: np.ndarray) -> Pair | None:
    one, other = place.centres[a] - at, place.centres[b] - at
    far = np.linalg.norm(one), np.linalg.norm(other)
    if min(far) <= 0.0 or max(far) > LARGEST_SCALE * min(far):
        return None
    angle = float(np.degrees(np.arccos(np.clip(one @ other / (far[0] * far[1]), -1.0, 1.0))))
    if not LEAST_ANGLE <= angle <= LARGEST_ANGLE:
        return None
    return Pair(a, b, angle)


def _worth(angle: float) -> float:
    """1 at the best angle, less on either side: a smaller one has a weak base, a larger one shows less alike."""
    ratio = angle / BEST_ANGLE
    return ratio if ratio < 1.0 else 1.0 / ratio


def chosen_pairs(candidates: list[Candidate], most: int) -> list[Pair]:
    """The pairs that show the ground best, the best first: one after the other, always the one that adds most.

    Parameters
    ----------
    most : pairs, more only where they show what no other does.
    """
    if not candidates:
        return []
    places = len(candidates[0].worth)
    count = np.zeros(places, int)
    gain = np.array([*GAIN, 0.0])
    used: dict[int, int] = {}
    found: list[Pair] = []
    rest = list(candidates)
    while rest:
        worth = gain[np.minimum(count, len(GAIN))]
        gains = [
            float((worth * c.worth).sum())
            / places
            / (1.0 + 0.2 * (used.get(c.pair.left, 0) + used.get(c.pair.right, 0)))
            for c in rest
        ]
        if len(found) >= most:  # enough, but for what none shows yet
            gains = [float(((count == 0) * c.worth).sum()) / places for c in rest]
        best = int(np.argmax(gains))
        if gains[best] < LEAST_GAIN:
            break
        chosen = rest.pop(best)
        pair = chosen.pair
        found.append(pair)
        count += chosen.worth > 0.0
        for k in (pair.left, pair.right):
            used[k] = used.get(k, 0) + 1
    return found


def pair_for_holes(candidates: list[Candidate], tried: list[Pair], holes: np.ndarray) -> tuple[Pair, float] | None:
    """The pair not tried yet that shows most of the holes, and which share of the piece it may fill.

    Parameters
    ----------
    holes : (n,) share of the ground about each place that has no height; 0 at places outside of the piece.

    Returns
    -------
    None where no pair shows enough of them.
    """
    rest = [c for c in candidates if c.pair not in tried]
    if not rest:
        return None
    best = max(rest, key=lambda c: float((holes * c.worth).sum()))
    hoped = float((holes * (best.worth > 0.0)).sum()) / len(holes)
    return (best.pair, hoped) if hoped >= LEAST_OF_HOLES else None


def noise_correlation(place: Place, pairs: list[Pair]) -> np.ndarray:
    """(pairs, pairs) of the noise of their heights: those that share a photograph share half of it.

    On one side of the shared photograph it has one sign, on the other side the other.
    """
    out = np.eye(len(pairs))
    for n, p in enumerate(pairs):
        for m in range(n):
            q = pairs[m]
            shared = {p.left, p.right} & {q.left, q.right}
            if len(shared) == 1:
                k = shared.pop()
                to_p = place.centres[p.right if k == p.left else p.left] - place.centres[k]
                to_q = place.centres[q.right if k == q.left else q.left] - place.centres[k]
                cosine = float(to_p @ to_q / (np.linalg.norm(to_p) * np.linalg.norm(to_q)))
                out[n, m] = out[m, n] = 0.5 * cosine
    return out
