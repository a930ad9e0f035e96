"""σ of a volume by its boundary, with bases that follow from the surface along it: by differences and by chance."""

import numpy as np
import pytest
import shapely

from aerotri.rasters.grids import Grid
from aerotri.volume.accuracy import boundary_variance
from aerotri.volume.bases import parse_base, quadrature_of
from aerotri.volume.boundary import boundary_of
from aerotri.volume.regions import Region

SIGMA, MOVED, PANELS = 0.1, 0.2, 60


class Hill:
    """A smooth hill on ground that slopes and rolls: an outline on its flank is neither level nor plane."""

    grid = Grid(200, 200, -25.0, 25.0, 0.25, 0.25)

    def sample(self, x, y):
        hill = 6.0 * np.exp(-(x**2 + y**2) / 60.0)
        return 100.0 + 0.05 * x + hill + 0.3 * np.sin(x / 5.0) * np.cos(y / 4.0)


def outline(radius=9.0, corners=6):
    angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return np.column_stack([radius * np.cos(angle), 0.8 * radius * np.sin(angle)])


def over_base(rings, text):
    """Boundary, base, places with what they stand for, and heights over the base there."""
    boundary = boundary_of(shapely.Polygon(rings[0], rings[1:]), "drawn")
    base = parse_base(text, Hill(), boundary)
    places, weight = quadrature_of(boundary, PANELS)
    return boundary, base, places, weight, Hill().sample(*places.T) - base.heights(*places.T)


def volume(rings, text, sign=0):
    weight, d = over_base(rings, text)[3:]
    return float(weight @ (np.maximum(sign * d, 0.0) if sign else d))


def stated(rings, text, sign=0):
    boundary, base, places, weight, d = over_base(rings, text)
    counts = sign * d > 0.0
    region = Region(places[counts], weight[counts], sign) if sign else None
    return np.sqrt(boundary_variance(Hill(), base, boundary, SIGMA, sign, region))


def by_differences(rings, text, sign=0):
    """σ, m³, by moving one corner after the other."""
    total = 0.0
    for k, ring in enumerate(rings):
        for at in np.ndindex(ring.shape):
            pair = []
            for move in (-MOVED, MOVED):
                moved = [one.copy() for one in rings]
                moved[k][at] += move
                pair.append(volume(moved, text, sign))
            total += ((pair[1] - pair[0]) / (2.0 * MOVED)) ** 2
    return SIGMA * np.sqrt(total)


@pytest.mark.parametrize(("base", "holes"), [("boundary", 0), ("boundary", 1), ("plane", 1), ("level:100", 1)])
def test_corners_moved_one_by_one(base, holes):
    """The base moves with the corners: it goes through the surface where the corners are then.

    Moved by less, the places along the outline, which are spaced anew, make a difference of their own.
    """
    rings = [outline(), outline(2.0, 3)][: 1 + holes]
    assert stated(rings, base) == pytest.approx(by_differences(rings, base), rel=0.2)


@pytest.mark.parametrize("sign", [1, -1])
def test_of_a_cut_and_of_a_fill(sign):
    """A plane through an outline on a flank cuts the ground; where it rises the cut shrinks and the fill grows."""
    rings = [outline(14.0)]
    assert volume(rings, "plane", sign) > 5.0
    assert stated(rings, "plane", sign) == pytest.approx(by_differences(rings, "plane", sign), rel=0.2)


def test_lowest_place_may_become_another_one():
    rng, ring = np.random.default_rng(1), outline()
    first = volume([ring], "lowest")
    errors = [volume([ring + more], "lowest") - first for more in rng.normal(scale=SIGMA, size=(60, *ring.shape))]
    assert stated([ring], "lowest") == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=0.25)


def test_of_a_base_that_is_stated_the_area_alone_counts():
    ring, moved = outline(), outline()
    moved[0, 0] += MOVED
    swept = shapely.Polygon(moved).area - shapely.Polygon(ring).area
    found = volume([moved], "level:0") - volume([ring], "level:0")
    assert found == pytest.approx(swept * 100.0, rel=0.1)
    assert stated([ring], "level:0") > 10.0 * stated([ring], "boundary")
