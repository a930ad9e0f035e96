"""Heights sought along strips against windows rectified at every height."""

import numpy as np

from aerotri.terrain._plan_kernels import Locus, make_rooms
from aerotri.terrain._search_kernels import search
from aerotri.terrain._strip_kernels import strip_search
from aerotri.terrain.photographs import site_at

POSTS, WINDOW, STEP, HEIGHTS = 17, 1.0, 2.0, 41


def test_strips_find_the_height_that_windows_find(rendered):
    """On sloping ground: the same profile at its top, the same height to a step, from two and from four photographs.

    Nodes stand at their true height, where the ray of the first photograph meets the vertical line.
    """
    photographs = rendered.photographs()
    site = site_at(photographs, 0.0, 0.0)
    rng, half = np.random.default_rng(1), STEP * (HEIGHTS // 2)
    xy = rng.uniform(-150.0, 150.0, (60, 2))
    z = rendered.scene.terrain.height(xy)
    slopes = np.column_stack([
        (rendered.scene.terrain.height(xy + d) - rendered.scene.terrain.height(xy - d)) / 2.0 for d in np.eye(2)
    ])  # fmt: skip
    delta = np.column_stack([xy, z]) - site.place
    view = site.view(0, delta.min(axis=0) - [0, 0, half], delta.max(axis=0) + [0, 0, half], 0.0, 40.0)
    rooms = make_rooms(POSTS, HEIGHTS, HEIGHTS, 4)
    exact, fast, compared = np.empty(HEIGHTS), np.empty(HEIGHTS), 0
    for place, slope in zip(delta, slopes, strict=True):
        nearest = np.argsort(np.hypot(*(site.centres[:, :2] - place[:2]).T))
        spot, locus = np.array([*place, *slope]), Locus(0.0, 0.0, place[2] - half, STEP)
        for chosen in (nearest[:2], nearest):
            best = search(view, chosen, spot, locus, WINDOW, rooms.search, exact)
            found = strip_search(view, chosen, spot, locus, WINDOW, rooms, fast)
            if found < 0 or exact[best] < 0.9:
                continue
            compared += 1
            assert abs(best - HEIGHTS // 2) <= 1
            assert abs(found - best) <= 1
            assert abs(fast[best] - exact[best]) < 0.1
    assert compared > 50
