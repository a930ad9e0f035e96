"""Between which heights the first level looks: about the tie points, but not about one that stands alone."""

import numpy as np

from aerotri.terrain.pickets import Area
from aerotri.terrain.prior import first_prior

AREA = Area(np.array([0.0, 0.0]), np.array([100.0, 100.0]))


def points() -> np.ndarray:
    """(400, 3) m, of a slope with a little relief."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(0.0, 100.0, (400, 2))
    return np.column_stack([xy, 50.0 + 0.1 * xy[:, 0] + rng.normal(scale=0.5, size=400)])


def test_a_wrong_tie_point_does_not_bend_the_search():
    right = first_prior(points(), AREA, 0.1, 3)
    wrong = first_prior(np.concatenate([points(), [[103.0, 97.0, 20.0]]]), AREA, 0.1, 3)
    assert np.abs(wrong.z - right.z).max() < 1.0
    assert np.abs(wrong.spare - right.spare).max() < 0.2


def test_a_pit_that_several_tie_points_show_is_looked_into():
    rng = np.random.default_rng(2)
    pit = np.column_stack([rng.uniform(60.0, 64.0, (12, 2)), np.full(12, 20.0)])
    found = first_prior(np.concatenate([points(), pit]), AREA, 0.1, 3)
    height, _, about = found.at(np.array([[62.0, 62.0]]))
    assert height[0] - about[0] < 21.0


def test_few_points_all_count():
    three = np.array([[0.0, 0.0, 10.0], [100.0, 0.0, 10.0], [0.0, 100.0, 90.0]])
    assert first_prior(three, AREA, 0.1, 3).z.max() > 60.0
